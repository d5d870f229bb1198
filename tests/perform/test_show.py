"""Shows: GO, hold, skip, repeat, taking over and giving back, within bounds and without jumps."""

from __future__ import annotations

import socket
import time

import numpy as np
import pytest
from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message_builder import OscMessageBuilder
from pythonosc.osc_packet import OscPacket
from tests.perform.hands import hands_of
from tests.perform.short_play import PLAY

import fantoccini as fan
from fantoccini.base.datagrams import socket_to
from fantoccini.base.errors import StateError, UnknownNameError
from fantoccini.theatre.perform import osc, reach
from fantoccini.theatre.perform.osc import Address, Osc

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def play(tmp_path_factory):
    path = tmp_path_factory.mktemp("play") / "short.yaml"
    path.write_text(PLAY, encoding="utf-8")
    return fan.load_play(path)


class MeasuredShow:
    """A measured show: the largest shares of bounds that its hands have used."""

    def __init__(self, play):
        self.show = fan.theatre.LivePlay(play)
        self.hands = hands_of(self.show.performance)
        self.events = []
        self.show.listen(lambda event: self.events.append((event.kind, event.number or event.name)))
        self.max_bound_shares = np.zeros(2)

    def advance(self, seconds: float) -> None:
        performance = self.show.performance
        hands = self.hands
        for _ in range(round(seconds / performance.tick)):
            old_v_K = np.array(performance.state.v_K)
            self.show.advance(performance.tick)
            bound_shares = (
                reach.lengths(performance.state.v_K, hands.group, len(hands.speed)) / hands.speed,
                reach.lengths(performance.state.v_K - old_v_K, hands.group, len(hands.speed))
                / performance.tick
                / hands.acceleration,
            )
            self.max_bound_shares = np.maximum(self.max_bound_shares, np.max(bound_shares, axis=1))

    def play_distance(self, who: str = "") -> float:
        """Distance of hands from their positions in the play at its time [m]."""
        performance, play = self.show.performance, self.show.play
        play_offsets, _ = play.score.offsets(self.show.t)
        distances = np.abs(
            self.hands.displacement(play.x0.q_K, performance.state.q_K) - play_offsets
        )
        is_of_player = [name.startswith(who) for name in play.marionette.coordinates.v_K]
        return float(np.max(distances[is_of_player]))

    def is_within_bounds(self) -> bool:
        return bool(np.all(self.max_bound_shares <= 1.0 + 1e-9))


@pytest.fixture
def stage(play):
    return MeasuredShow(play)


def test_the_hands_follow_the_compiled_play_and_events_are_reported(stage):
    stage.advance(0.5)
    assert stage.show.t == 0.0
    stage.show.go()
    stage.advance(5.0)
    assert stage.play_distance() < 1e-3
    assert stage.events == [("act", "One"), ("start", 1), ("start", 2), ("end", 1), ("end", 2)]
    stage.advance(3.0)
    cue = stage.show.play.cues[2]
    assert stage.show.waiting is not None
    assert stage.show.t == pytest.approx(cue.start)
    assert stage.events[5:] == [("act", "Two"), ("wait", "cue 3")]
    stage.show.go()
    stage.advance(6.0)
    assert stage.show.done
    assert stage.events[7:] == [("start", 3), ("start", 4), ("end", 3), ("end", 4)]
    assert stage.is_within_bounds()


def test_early_go_is_kept_and_a_second_one_refused(stage):
    stage.show.go()
    stage.advance(1.0)
    stage.show.go()
    assert stage.show.message == "GO is kept for cue 3 (columbine: wave)"
    assert stage.show.released
    stage.show.go()
    assert "GO is refused" in stage.show.message
    stage.advance(7.0)
    assert stage.show.t > stage.show.play.cues[2].start + 0.5
    assert ("wait", "cue 3") not in stage.events
    stage.show.go()
    assert stage.show.message == "GO is refused: no cue waits any more"


def test_skip_and_repeat_begin_at_the_positions_of_the_hands(stage):
    show = stage.show
    show.repeat()
    assert "refused" in show.message
    show.go()
    stage.advance(1.5)
    show.skip()
    stage.advance(2.0)
    assert show.latest_cue.number == 2
    show.repeat()
    stage.advance(0.02)
    assert show.t == show.play.cues[1].start
    stage.advance(2.0)
    show.skip()
    stage.advance(3.0)
    assert show.waiting.name == "cue 3"
    # The hands shift against the swing that the transition left.
    assert stage.play_distance() < 0.01
    show.skip()
    stage.advance(2.0)
    assert show.latest_cue.number == 4
    show.repeat()
    assert show.next_cue is None
    show.skip()
    assert show.message == "skip is refused: this is the last cue"
    assert stage.is_within_bounds()


def test_a_hold_stops_within_a_third_of_a_second(stage):
    show = stage.show
    show.go()
    stage.advance(1.0)
    show.hold()
    stage.advance(0.35)
    t = show.t
    stage.advance(0.5)
    assert show.t == t
    assert np.max(np.abs(show.performance.state.v_K)) < 1e-5  # the shift fades
    show.go()
    stage.advance(1.0)
    assert show.t > t + 0.7
    assert stage.play_distance() < 0.01
    assert stage.is_within_bounds()


@pytest.mark.parametrize("moves_head", [False, True])
def test_a_player_is_taken_and_given_back_while_the_other_plays_on(stage, moves_head):
    show, live = stage.show, stage.show.performance
    show.go()
    stage.advance(0.8)
    show.take("pierrot")
    stage.advance(0.5)
    held_q_K = np.array(live.state.q_K)
    if moves_head:
        live.move("pierrot.head", live.place("pierrot.head")[0] + [0.1, 0.0, 0.05])
    stage.advance(1.5)
    names = live.marionette.coordinates.q_K
    other_strings = [name.startswith("pierrot") and "head" not in name for name in names]
    np.testing.assert_allclose(live.state.q_K[other_strings], held_q_K[other_strings], atol=1e-12)
    assert stage.play_distance("columbine") < 1e-3
    assert stage.play_distance("pierrot") > 0.01
    show.give("pierrot")
    stage.advance(2.5)
    assert stage.play_distance() < 1e-3
    assert stage.is_within_bounds()


def test_hands_that_shift_against_swing_end_it_soon(play):
    """A push of 0.5 N for 0.2 s."""

    def max_deviation(is_steadied: bool) -> float:
        pushed, undisturbed = MeasuredShow(play), MeasuredShow(play)
        for measured, force in ((pushed, (0.0, 0.5, 0.0)), (undisturbed, None)):
            if not is_steadied:
                measured.show.steady = None
            measured.show.go()
            measured.advance(0.5)
            measured.show.performance.push("columbine.torso", force)
            measured.advance(0.2)
            measured.show.performance.push("columbine.torso", None)
            measured.advance(2.0)
        assert pushed.is_within_bounds()
        pushed_performance, undisturbed_performance = (
            measured.show.performance for measured in (pushed, undisturbed)
        )
        max_distance = 0.0
        for _ in range(20):
            pushed.advance(0.1)
            undisturbed.advance(0.1)
            poses = [
                live.marionette.pose(live.state, "columbine.torso")
                for live in (pushed_performance, undisturbed_performance)
            ]
            max_distance = max(max_distance, float(np.linalg.norm(poses[0][:, 3] - poses[1][:, 3])))
        return max_distance

    assert max_deviation(True) < 0.5 * max_deviation(False)


def test_players_are_steadied_as_pendulums_in_the_gravity_of_their_own_files(play, tmp_path):
    """w^2 = g/height: on the moon they swing sqrt(9.81/1.62) times more slowly."""
    text = fan.puppets.path("marionette").read_text(encoding="utf-8")
    (tmp_path / "lunar.yaml").write_text("gravity: [0, 0, -1.62]\n" + text, encoding="utf-8")
    cast = "{pierrot: {at: west}, columbine: {at: east}}"
    lunar_cast = (
        "{pierrot: {puppet: lunar.yaml, at: west}, columbine: {puppet: lunar.yaml, at: east}}"
    )
    (tmp_path / "play.yaml").write_text(PLAY.replace(cast, lunar_cast), encoding="utf-8")
    moon_frequencies = fan.theatre.LivePlay(
        fan.load_play(tmp_path / "play.yaml")
    ).steady.frequencies
    ratio = np.sqrt(9.81 / 1.62)
    np.testing.assert_allclose(
        fan.theatre.LivePlay(play).steady.frequencies / moon_frequencies, ratio, rtol=1e-3
    )


def test_skips_leave_a_taken_player_out_and_all_hands_stop_and_resume(stage):
    show, live = stage.show, stage.show.performance
    show.go()
    stage.advance(1.0)
    show.take("columbine")
    stage.advance(0.5)
    held_place = live.place("columbine.head")[0]
    show.start(3)
    stage.advance(1.5)
    np.testing.assert_allclose(live.place("columbine.head")[0], held_place, atol=1e-9)
    show.panic()
    stage.advance(0.3)
    assert np.max(np.abs(live.state.v_K)) < 1e-9
    t = show.t
    show.give("columbine")
    stage.advance(0.5)
    assert show.t == t
    show.resume()
    stage.advance(3.0)
    assert show.t > t + 2.0
    assert stage.play_distance() < 1e-3
    assert stage.is_within_bounds()


def test_unknown_names_and_commands_are_refused(stage):
    with pytest.raises(StateError, match="cues 1 to 4"):
        stage.show.start(5)
    with pytest.raises(UnknownNameError, match="did you mean 'pierrot'"):
        stage.show.take("pierot")
    stage.show.go()
    stage.advance(0.5)
    stage.show.reset()
    assert stage.show.t == 0.0
    assert stage.show.voice is None


# -- OSC -------------------------------------------------------------------------------------------


class OscClient:
    """The other side of the connection: it sends messages and receives others."""

    def __init__(self, stage: MeasuredShow):
        self.stage, self.jobs = stage, []
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(5.0)
        self.osc = Osc(
            stage.show,
            Address("127.0.0.1", 0),
            Address(*self.socket.getsockname()),
            self.jobs.append,
        )

    def send_bytes(self, data: bytes) -> None:
        self.socket.sendto(data, self.osc.heard_at)

    def send(self, address: str, *values) -> None:
        self.send_bytes(built_message(address, *values).dgram)

    def run_commands(self, n: int = 1) -> None:
        """Wait for commands, and apply them as the loop of a page would."""
        end = time.monotonic() + 5.0
        while len(self.jobs) < n:
            assert time.monotonic() < end, self.osc.counts
            time.sleep(0.002)
        for job in self.jobs:
            job()
        self.jobs.clear()

    def wait_for_count(self, outcome: str, n: int) -> None:
        end = time.monotonic() + 5.0
        while getattr(self.osc.counts, outcome) < n:
            assert time.monotonic() < end, self.osc.counts
            time.sleep(0.002)

    def received(self) -> tuple:
        (message,) = OscPacket(self.socket.recv(65536)).messages
        return message.message.address, *message.message.params


def built_message(address: str, *values):
    message = OscMessageBuilder(address)
    for value in values:
        message.add_arg(value)
    return message.build()


@pytest.fixture
def desk(stage):
    client = OscClient(stage)
    yield client
    client.osc.stop()
    client.socket.close()


def test_messages_direct_the_show_and_report_it(desk):
    show = desk.stage.show
    desk.send("/go")
    desk.run_commands()
    desk.stage.advance(0.1)
    assert desk.received() == ("/act", "One", pytest.approx(0.0, abs=0.01))
    assert desk.received() == ("/cue/1/start", 1, "wave", pytest.approx(0.0, abs=0.01))
    for address, is_done in (
        ("/hold", lambda: show.is_held),
        ("/resume", lambda: not show.is_held),
        ("/player/pierrot/take", lambda: show.taken == {"pierrot"}),
        ("/player/pierrot/give", lambda: not show.taken),
        ("/cue/next", lambda: show.t == show.play.cues[1].start),
        ("/cue/4/start", lambda: show.t == show.play.cues[3].start),
        ("/cue/repeat", lambda: show.t == show.play.cues[3].start),
        ("/panic", lambda: show.is_held),
    ):
        desk.send(address)
        desk.run_commands()
        assert is_done(), address
    bundle = OscBundleBuilder(IMMEDIATELY)
    bundle.add_content(built_message("/resume", 1.0))
    bundle.add_content(built_message("/go", 0.0))  # a released button
    desk.send_bytes(bundle.build().dgram)
    desk.run_commands()
    assert not show.is_held
    assert desk.osc.counts.heard == 10
    assert desk.osc.counts.wrong == 0


def test_echoed_messages_make_no_loop(desk):
    desk.send("/go")
    desk.run_commands()
    desk.stage.advance(0.1)
    desk.socket.recv(65536)  # /act
    desk.send_bytes(desk.socket.recv(65536))  # unchanged
    desk.send("/cue/1/start")  # without its arguments
    desk.wait_for_count("echoes", 2)
    assert desk.jobs == []


@pytest.mark.parametrize(
    "data", [b"", b"\0", b"go", b"/go", b"/go\0,", b"#bundle\0", b"/go\0,i\0\0", bytes(range(256))]
)
def test_broken_messages_are_counted(desk, data):
    desk.send_bytes(data)
    desk.send_bytes(b"\xff" * 999)
    desk.send("/go")
    desk.run_commands()
    assert desk.osc.counts.wrong >= 1
    desk.stage.advance(0.5)
    assert desk.stage.show.t > 0.0


def test_messages_that_are_not_commands_are_reported(desk):
    for address, values in (("/og", ()), ("/cue/x/start", ()), ("/go", ("now",))):
        desk.send(address, *values)
    desk.wait_for_count("wrong", 3)
    assert "needed: no argument, or a number" in str(desk.osc.counts)
    desk.send("/player/pulcinella/take")
    desk.send("/cue/77/start")
    desk.run_commands(2)
    assert desk.osc.counts.refused == 2
    assert "cues 1 to 4" in desk.osc.counts.last_fault


def test_addresses_are_parsed_and_checked(stage):
    assert Address.parse("53001") == ("127.0.0.1", 53001)
    assert str(Address.parse("10.0.0.2:53000")) == "10.0.0.2:53000"
    for text in ("", "host", "host:", "1.2.3.4:99999"):
        with pytest.raises(ValueError, match="needed: HOST:PORT"):
            Address.parse(text)
    receiver = Osc(stage.show, Address("127.0.0.1", 0), None, lambda command: None)
    with pytest.raises(StateError, match="a free port of this machine"):
        Osc(stage.show, receiver.heard_at, None, lambda command: None)
    receiver.stop()
    with pytest.raises(StateError, match="is no address"):
        Osc(stage.show, None, Address("no such host.", 1), lambda command: None)
    for host in ("239.1.2.3", "255.255.255.255"):
        if host == "239.1.2.3" or has_way_to(host):
            with pytest.raises(StateError, match=r"all machines .* needed: the address of one"):
                Osc(stage.show, None, Address(host, 53000), lambda command: None)
            with pytest.raises(StateError, match=r"all machines .* needed: an address of this one"):
                Osc(stage.show, Address(host, 0), None, lambda command: None)
    with pytest.raises(StateError, match="needed: a port from 1 on"):
        Osc(stage.show, None, Address("127.0.0.1", 0), lambda command: None)
    with pytest.raises(StateError, match=r"'a\.\.b' is no address: no host has such a name"):
        Osc(stage.show, None, Address("a..b", 1), lambda command: None)


def has_way_to(host: str) -> bool:
    """Whether this machine has a network that allows broadcasts."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        return probe.connect_ex((host, 53000)) == 0


def test_a_refused_address_leaves_nothing_open(stage, monkeypatch):
    """If one of the two is refused, the other is not used either."""
    listeners, sockets = [], []
    monkeypatch.setattr(stage.show, "listen", listeners.append)
    monkeypatch.setattr(osc, "socket_to", lambda *to: sockets.append(socket_to(*to)) or sockets[0])
    with pytest.raises(StateError, match="is no address"):
        Osc(stage.show, Address("a..b", 1), Address("127.0.0.1", 53000), lambda do: None)
    assert not listeners and sockets[0][0].fileno() == -1


def test_a_flood_is_counted_and_prints_nothing(desk, caplog, capfd):
    """Regression: python-osc printed a line for every message that it read in part."""
    unknown = b"#bundle\0" + bytes(7) + b"\1" + b"\0\0\0\4" + b"none"
    for _ in range(300):
        desk.send_bytes(b"/go\0,x\0\0")
        desk.send_bytes(unknown)
        desk.send("/og")
        time.sleep(1e-4)  # otherwise the system drops datagrams
    desk.wait_for_count("refused", 100)
    desk.wait_for_count("wrong", 200)
    assert len(desk.jobs) <= osc.MAX_WAITING
    assert "100 commands wait already" in desk.osc.counts.last_fault or desk.osc.counts.wrong
    assert "\n" not in str(desk.osc.counts) and len(str(desk.osc.counts)) < 300
    assert caplog.records == []
    assert tuple(capfd.readouterr()) == ("", "")
    desk.run_commands(1)
    desk.send("/go")
    desk.run_commands()
    assert desk.stage.show.voice is not None
