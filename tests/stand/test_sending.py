"""Packets over a network, read by python-osc and by a library for Art-Net."""

from __future__ import annotations

import socket
import threading
import time

import numpy as np
import pytest
from pythonosc.dispatcher import Dispatcher
from pythonosc.osc_bundle import OscBundle
from pythonosc.osc_server import BlockingOSCUDPServer
from stupidArtnet import StupidArtnetServer
from tests.stand.hoist import STAND

import fantoccini as fan
from fantoccini.base.errors import FileError, PacketError, StandError
from fantoccini.stand import (
    Receiver,
    SendCounts,
    loads_stand,
    packet_encoder,
    send_points,
    sending,
    set_points,
    udp_sender,
)
from fantoccini.stand.sending import REPEAT_TIME
from fantoccini.stand.stand_file import BUNDLED_STANDS_FOLDER

ABLE = STAND.replace("TORQUE", "0.5").replace("speed: 1\n", "speed: 2\n")
SIX = (
    (BUNDLED_STANDS_FOLDER / "six_winches.yaml").read_text(encoding="utf-8").split("controller:")[0]
)
GENTLE = {"line.length": [(0.2, 0.8), (1.4, 0.6), (1.6, 0.6), (2.8, 0.75)]}
LOCAL = "127.0.0.1"


@pytest.fixture(autouse=True)
def patience(monkeypatch):
    """Tolerate a busy machine: late set points are skipped."""
    monkeypatch.setattr(sending, "MAX_DELAY", 2.0)


def points_of(lifted, hoist, kind="osc", more="", **options):
    return set_points(
        loads_stand(f"{ABLE}controller: {{type: {kind}{more}}}\n"), lifted, hoist, **options
    )


def artnet_read(data, universe=0):
    """Channels of a packet, read by a library."""
    server = StupidArtnetServer.__new__(StupidArtnetServer)  # without its thread and its port
    assert server.validate_header(data)
    server.listeners = []
    number = server.register_listener(universe)
    assert server.listeners[number]["address_mask"] == data[14:16]
    slots = list(data)[18:]
    assert int.from_bytes(data[16:18], "big") == len(slots) and len(slots) % 2 == 0
    assert 2 <= len(slots) <= 512
    assert data[12] == 0  # no sequence
    return slots


def test_an_osc_server_receives_every_set_point(conduct):
    """The first second of six axes is sent in real time."""
    points = set_points(
        "six_winches",
        conduct.resample(np.linspace(0.0, 1.0, 501)),
        fan.puppets.stand6(),
        controller="osc",
    )
    values = {}

    def hear(address, value):
        values.setdefault(address, []).append(value)

    dispatcher = Dispatcher()
    dispatcher.set_default_handler(hear)
    with BlockingOSCUDPServer((LOCAL, 0), dispatcher) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        with udp_sender(*server.server_address) as send:
            done = send_points(points, send)
        time.sleep(0.1)
        server.shutdown()
        thread.join()
    assert set(values) == {f"/{axis.name}" for axis in points.axes}
    indices = np.rint(np.array(done.times) * points.rate).astype(int)
    assert len(set(indices)) == len(points) - done.dropped and done.t == points.motion.t[-1]
    for k, axis in enumerate(points.axes):
        steps = np.rint(np.array(values[f"/{axis.name}"]) * axis.counts_per_unit)
        assert np.max(np.abs(steps - points.counts[indices, k])) <= 1.0


def test_bundles_carry_the_time_at_which_they_are_due(lifted, hoist):
    sent, points, begun = [], points_of(lifted, hoist, rate=100.0), time.time()
    done = send_points(points, lambda data: sent.append((time.time(), OscBundle(data))))
    stamps = np.array([bundle.timestamp for _, bundle in sent])
    n = round(100.0 * REPEAT_TIME)
    # Intervals are those of the motion's set points; before and after it, they are constant.
    in_motion = slice(n, len(sent) - n)
    np.testing.assert_allclose(
        stamps[in_motion] - stamps[n], np.array(done.times)[in_motion] - done.times[n], atol=1e-6
    )
    np.testing.assert_allclose(np.diff(stamps)[[*range(n), *range(-n, 0)]], 0.01, atol=1e-6)
    assert stamps[0] == pytest.approx(begun, abs=0.2)
    late = [expected - stamp for (expected, _), stamp in zip(sent, stamps, strict=True)]
    np.testing.assert_allclose(late, done.delays, atol=0.02)
    values = np.array([bundle.content(0).params[0] for _, bundle in sent])
    assert np.all(values[:n] == np.float32(0.8)) and np.all(values[-n:] == values[-n - 1])
    expected = np.interp(done.times, points.motion.t, points.motion.position[:, 0])
    np.testing.assert_allclose(values, expected, atol=3e-8)


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("universe", [0, 300])
def test_art_net_is_read_by_a_library(conduct, bits, universe):
    """Every set point is exact to half a unit of the last channel."""
    controller = f"{{type: artnet, universe: {universe}, bits: {bits}, names: {{head: 11}}}}"
    points = set_points(
        loads_stand(SIX + f"controller: {controller}\n"), conduct, fan.puppets.stand6()
    )
    packets = packet_encoder(points.map.stand, points.controller, points.rate)
    assert points.rate == 40.0
    wide, values = bits // 8, []
    for position in points.motion.position:
        slots = artnet_read(packets.encode(position, 0.0), universe)
        first = [11, *(1 + wide * k for k in range(5))]
        values.append([int.from_bytes(bytes(slots[k - 1 : k - 1 + wide]), "big") for k in first])
    low, high = np.array([axis.travel for axis in points.axes]).T
    unit = (high - low) / (2**bits - 1)
    errors = np.abs(low + np.array(values) * unit - points.motion.position) / unit
    assert 0.3 < np.max(errors) <= 0.5 + 1e-9


@pytest.mark.parametrize("kind", ["osc", "artnet"])
def test_a_puppet_on_the_received_set_points_moves_as_in_its_run(hoist, kind):
    save_at = np.linspace(0.0, 2.9, 291)
    x0 = hoist.rest({"line.length": 0.8})
    first = fan.simulate(hoist, x0, fan.Input.waypoints(hoist, GENTLE), 3.0, save_at=save_at)
    points = points_of(first, hoist, kind, rate=40.0)
    with Receiver(points.map.stand, points.controller, LOCAL, 0) as stand:
        with udp_sender(*stand.address) as send:
            done = send_points(points, send)
        time.sleep(0.1)
    assert stand.n_unreadable == 0 and len(stand) == done.sent
    # Before, during and after the motion.
    t = np.array(done.times)
    counts = np.rint(
        np.interp(t, points.motion.t, points.motion.position[:, 0]) * points.axes[0].counts_per_unit
    )
    within = 1.0 if kind == "osc" else 1.0 + 0.7 / 65535 / 2 * points.axes[0].counts_per_unit
    assert np.max(np.abs(stand.steps[:, 0] - counts)) <= within
    in_motion = np.append(np.diff(t) > 0.0, False)
    p = stand.steps[in_motion, 0] / points.axes[0].counts_per_unit
    inputs = fan.Input.samples(hoist, t[in_motion], {"line.length": p})
    again = fan.simulate(hoist, hoist.rest({"line.length": p[0]}), inputs, 2.9, save_at=save_at)
    poses = [hoist.poses(r.resample(save_at).q_D, r.resample(save_at).q_K) for r in (first, again)]
    errors = np.linalg.norm(poses[0][..., 3] - poses[1][..., 3], axis=-1)
    assert 0.0 < np.max(errors) < 1e-3


def test_late_set_points_are_skipped_and_not_sent_in_bursts(lifted, hoist):
    times, values = [], []

    def slow(data):
        times.append(time.monotonic())
        values.append(OscBundle(data).content(0).params[0])
        if len(times) == 60:
            time.sleep(0.07)  # 7 intervals

    points = points_of(lifted, hoist, rate=100.0)
    done = send_points(points, slow)
    repeated = 2 * round(100.0 * REPEAT_TIME)
    assert done.dropped >= 5
    assert done.sent == len(points) + repeated - done.dropped == len(times)
    assert np.max(np.diff(times)) > 0.069
    # One set point that is late, one without a successor, and one that is due; not all seven.
    assert np.min(np.array(times)[6:] - times[:-6]) > 0.0095
    assert np.max(np.diff(done.times)) > 0.055
    expected = np.interp(done.times, points.motion.t, points.motion.position[:, 0])
    np.testing.assert_allclose(values, expected, atol=3e-8)


def test_a_long_pause_stops_before_the_axes_jump(lifted, hoist):
    sent = []

    def stuck(data):
        sent.append(data)
        if len(sent) == 60:
            time.sleep(0.5)

    with pytest.raises(PacketError, match=r"was 0\.\d+ s late, and the axes would jump") as stopped:
        send_points(points_of(lifted, hoist, rate=100.0), stuck, max_delay=0.2)
    assert len(sent) == 60
    assert stopped.value.t == pytest.approx(0.34, abs=0.05)


def test_without_a_listener_the_motion_does_not_begin(lifted, hoist):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind((LOCAL, 0))
        port = taken.getsockname()[1]
    progress = SendCounts()
    with udp_sender(LOCAL, port) as send, pytest.raises(PacketError, match="not sent") as stopped:
        send_points(points_of(lifted, hoist), send, counts=progress)
    assert stopped.value.t == 0.0 and progress.sent <= 2


def test_a_listener_that_goes_away_stops_the_motion(lifted, hoist):
    points = points_of(lifted, hoist)
    progress = SendCounts()
    listener = Receiver(points.map.stand, points.controller, LOCAL, 0)
    with listener as stand, udp_sender(*stand.address) as send:

        def until(data):
            if len(stand) == 40:
                stand.close()
            send(data)

        with pytest.raises(PacketError, match="not sent"):
            send_points(points, until, counts=progress)
    assert 0.2 < progress.t < 1.0


def test_wrong_hosts_are_refused():
    for host in ("no.such.host.invalid", "a..b", "a" * 64 + ".b"):
        refused = r"is no address: .*; needed: an address such as 127\.0\.0\.1"
        with pytest.raises(StandError, match=refused), udp_sender(host, 9000):
            pass
    with pytest.raises(StandError, match="needed: a port from 1 on"), udp_sender(LOCAL, 0):
        pass


def test_a_broadcast_address_needs_the_option():
    """Nothing is sent: the socket only gets its address."""
    refused = pytest.raises(StandError, match=r"needed: the address of one, or `broadcast: true`")
    with refused, udp_sender("255.255.255.255", 6454):
        pass
    try:
        with udp_sender("255.255.255.255", 6454, broadcast=True):
            pass
    except StandError as error:
        assert "unreachable" in str(error)  # a machine without a network


@pytest.mark.parametrize("host", ["224.0.0.1", "239.255.1.2", "ff02::1", "::ffff:224.0.0.1"])
def test_a_multicast_address_needs_the_option_too(host):
    refused = pytest.raises(StandError, match=r"needed: the address of one, or `broadcast: true`")
    with refused, udp_sender(host, 6454):
        pass
    try:
        with udp_sender(host, 6454, broadcast=True):
            pass
    except StandError as error:
        assert "all machines" not in str(error)  # without a network


def test_only_art_net_broadcasts(lifted, hoist):
    assert points_of(lifted, hoist, "artnet", ", broadcast: true").controller.broadcast
    assert not points_of(lifted, hoist, "artnet").controller.broadcast
    with pytest.raises(FileError, match="broadcast"):
        points_of(lifted, hoist, "osc", ", broadcast: true")


@pytest.mark.parametrize("answer", [True, False])
def test_a_hold_stays_on_the_path_and_resumes_or_stops(lifted, hoist, answer):
    """Its time slows down and speeds up linearly; meanwhile the position is repeated."""
    points, progress = points_of(lifted, hoist, rate=100.0), SendCounts()
    hold, sent, asked = threading.Event(), [], []

    def send(data):
        sent.append(OscBundle(data).content(0).params[0])
        if len(sent) == 60:
            hold.set()

    def should_resume(done):
        before = len(sent)
        time.sleep(0.3)
        sent_on = sent[before:]
        assert len(sent_on) > 5 and len(set(sent_on)) == 1
        asked.append((len(done.times), len(sent_on)))
        return answer

    if answer:
        send_points(points, send, hold=hold, should_resume=should_resume, counts=progress)
        assert progress.t == points.motion.t[-1]
        assert sent[-1] == np.float32(points.motion.position[-1, 0])
    else:
        with pytest.raises(PacketError, match="stopped here") as stopped:
            send_points(points, send, hold=hold, should_resume=should_resume, counts=progress)
        assert stopped.value.t == progress.t
    ((k, n_repeated),) = asked
    t = np.array(progress.times)
    expected = np.interp(t, points.motion.t, points.motion.position[:, 0])
    sent_in_motion = np.delete(
        sent, range(k, k + len(sent) - len(t))
    )  # without repetitions during the hold
    assert len(sent) - len(t) >= n_repeated
    np.testing.assert_allclose(
        sent_in_motion, expected, atol=2e-4
    )  # between set points it is a spline
    # Twice the time that the axis needs to stop from 2 m/s at 20 m/s^2, from full speed to rest.
    ramp = 2.0 * 2.0 / 20.0
    begun = t[59]
    assert t[k - 1] - begun == pytest.approx(ramp / 2.0, abs=0.011 + 0.01 * progress.dropped)
    if not progress.dropped:
        step = np.diff(t)
        np.testing.assert_allclose(np.diff(step[60 : k - 2]), -(0.01**2) / ramp, atol=1e-9)
        if answer:
            np.testing.assert_allclose(np.diff(step[k + 1 : k + 15]), 0.01**2 / ramp, atol=1e-9)


def test_set_points_resume_at_a_time(lifted, hoist):
    points, sent = points_of(lifted, hoist, rate=100.0), []
    done = send_points(
        points, lambda data: sent.append(OscBundle(data).content(0).params[0]), first=0.4
    )
    n, t = round(100 * REPEAT_TIME), np.array(done.times)
    expected = np.interp(t, points.motion.t, points.motion.position[:, 0])
    np.testing.assert_allclose(sent, expected, atol=2e-4)  # between set points it is a spline
    assert np.all(t[: n + 1] == 0.4) and np.all(t[-n:] == points.motion.t[-1])
    # From rest: by the ramp's triangle, its first 0.1 s cover 0.025 s of the motion.
    ramp = 2.0 * 2.0 / 20.0
    assert np.all(np.diff(t) >= 0.0) and np.max(np.diff(t)) < 0.011 * (1 + done.dropped)
    if not done.dropped:
        assert t[n + 10] - 0.4 == pytest.approx(0.1**2 / ramp / 2.0, rel=1e-6)
        assert t[n + 30] - t[n + 29] == pytest.approx(0.01)
    with pytest.raises(StandError, match=r"the set points last 1\.5 s"):
        send_points(points, sent.append, first=1.5)


def stand_after_packets(points, packets, wait=0.2):
    """An emulated stand that received packets, followed by silence."""
    listener = Receiver(points.map.stand, points.controller, LOCAL, 0)
    with listener as stand, udp_sender(*stand.address) as send:
        for data in packets:
            send(data)
        time.sleep(wait)
    return stand


def test_the_emulated_stand_refuses_other_packets(lifted, hoist):
    points = points_of(lifted, hoist, "artnet", ", universe: 5")
    encoder = packet_encoder(points.map.stand, points.controller, points.rate)
    good = encoder.encode(np.array([0.3]), 0.0)
    elsewhere = points.controller.model_copy(update={"universe": 6})
    other = packet_encoder(points.map.stand, elsewhere, 40.0).encode(np.ones(1), 0.0)
    noise = np.random.default_rng(0).bytes(600)
    stand = stand_after_packets(points, [good, b"Art-Net\0", other, good[:19], b"", noise], 0.7)
    assert len(stand) == 1 and stand.n_unreadable == 5
    assert stand.stops == 1 and stand.silent
    points = points_of(lifted, hoist)
    message = b"/winch\0\0,f\0\0"
    stand = stand_after_packets(
        points,
        [
            message + b"\x7f\xc0\0\0",
            b"/other\0\0,f\0\0\x3f\0\0\0",
            b"#bundle\0",
            message + b"\x3f\0\0\0",
        ],
    )
    assert len(stand) == 1 and stand.n_unreadable == 3
    assert stand.steps[0, 0] == np.rint(0.5 * points.axes[0].counts_per_unit)


def test_a_port_in_use_is_reported(lifted, hoist):
    points = points_of(lifted, hoist)
    refused = pytest.raises(StandError, match="a free port of this machine")
    with Receiver(points.map.stand, points.controller, LOCAL, 0) as stand, refused:
        Receiver(points.map.stand, points.controller, *stand.address)


WRONG = {
    "no address": ("osc, names: {winch: winch}", "needed: an OSC address, such as /winch"),
    "a pattern": ("osc, names: {winch: '/a*'}", "needed: an OSC address"),
    "no channel": ("artnet, names: {winch: x}", "needed: a channel, 1 to 511"),
    "half a channel": ("artnet, names: {winch: 512}", "needed: a channel, 1 to 511"),
    "too often": ("artnet, rate: 50", "DMX allows at most 44 frames per second"),
    "a host of blanks": ("osc, host: 'a b'", "host"),
    "no port": ("artnet, port: 0", "port"),
    "no universe": ("artnet, universe: 40000", "universe"),
}


@pytest.mark.parametrize("given, message", WRONG.values(), ids=WRONG)
def test_mistakes_in_the_file_have_their_line(lifted, hoist, given, message):
    with pytest.raises(FileError) as caught:
        points = set_points(
            loads_stand(f"{ABLE}controller: {{type: {given}}}\n", "s.yaml"), lifted, hoist
        )
        packet_encoder(points.map.stand, points.controller, points.rate)
    assert message in str(caught.value)
    assert caught.value.mistakes[0].line == 1 + ABLE.count("\n")


def test_two_axes_do_not_share_a_channel():
    for kind, names in (("artnet", "{head: 3, knees: 4}"), ("osc", "{head: /a, knees: /a}")):
        stand = loads_stand(f"{SIX}controller: {{type: {kind}, names: {names}}}\n")
        with pytest.raises(FileError, match="of its own"):
            packet_encoder(stand, stand.controller, 40.0)
    with pytest.raises(StandError, match="DMX allows at most 44"):
        packet_encoder(stand, load_controller("artnet"), 100.0)
    with pytest.raises(StandError, match="needed: --controller osc or artnet"):
        packet_encoder(stand, load_controller("csv"), 40.0)


def load_controller(kind):
    return loads_stand(f"{SIX}controller: {{type: {kind}}}\n").controller
