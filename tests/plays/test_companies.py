"""Companies, the players that are simulated together, and plays in which a prop is given."""

from __future__ import annotations

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.theatre.cast.companies import Company, Meeting, Span, company_spans
from fantoccini.theatre.cast.contacts import ContactBodies, hanging_pair
from fantoccini.theatre.plays.failures import find_failures
from fantoccini.theatre.plays.stage_run import combine_runs

pytestmark = [pytest.mark.slow, pytest.mark.long]

PLAY = """\
play: gift
tempo: 100
stage:
  marks:
    west: {at: [0, 0.4], facing: right}
    east: {at: [0, -0.4], facing: left}
    front: {at: [0.5, -0.6]}
cast:
  pierrot: {at: west}
  columbine: {at: east}
props:
  ball: {held by: pierrot}
acts:
  - act: A gift
    cues:
      - {who: pierrot, gives: ball, to: columbine}
      - {who: pierrot, does: wave, when: give.taken + 20}
"""


def meeting(begin: float, end: float, players: str, props: str = "p") -> Meeting:
    pairs = frozenset(
        hanging_pair(ContactBodies(player, {"left": f"{player}.arm"}), "left", "p")
        for player in players
    )
    return Meeting(begin, end, tuple(players), tuple(props), pairs, "hangs")


def test_companies_are_players_connected_by_meetings():
    companies = company_spans(
        "abc", [meeting(0, 4, "a"), meeting(4, 6, "ab"), meeting(6, 9, "b")], 9.0
    )
    assert companies == (
        Span(Company(("a",), ("p",), meeting(0, 4, "a").pairs), 0.0, 4.0),
        Span(Company(("b",)), 0.0, 4.0),
        Span(Company(("c",)), 0.0, 9.0),
        Span(Company(("a", "b"), ("p",), meeting(4, 6, "ab").pairs), 4.0, 6.0),
        Span(Company(("a",)), 6.0, 9.0),
        Span(Company(("b",), ("p",), meeting(6, 9, "b").pairs), 6.0, 9.0),
    )


@pytest.mark.parametrize("seed", range(20))
def test_at_every_time_each_player_and_prop_is_in_one_company(seed):
    rng = np.random.default_rng(seed)
    players, meetings = "abcd", []
    for prop in "pq":
        t = 0.0
        while t < 8.0:
            end = t + rng.uniform(0.5, 3.0)
            who = "".join(sorted(rng.choice(list(players), rng.integers(1, 3), replace=False)))
            meetings.append(meeting(t, end, who, prop))
            t = end + rng.choice([0.0, 1.0])
    companies = company_spans(players, meetings, 8.0)
    for t in rng.uniform(0.0, 8.0, 30):
        present = [company.company for company in companies if company.begin <= t < company.end]
        assert sorted(name for company in present for name in company.players) == list(players)
        present_props = [name for company in present for name in company.props]
        assert len(present_props) == len(set(present_props))
        for present_meeting in meetings:
            if present_meeting.begin <= t < present_meeting.end:
                (company,) = [c for c in present if present_meeting.props[0] in c.props]
                assert {*present_meeting.players} <= {
                    *company.players
                } and present_meeting.pairs <= company.pairs
    assert [company.begin for company in companies] == sorted(
        company.begin for company in companies
    )


@pytest.fixture(scope="module")
def gift(tmp_path_factory):
    path = tmp_path_factory.mktemp("plays") / "gift.yaml"
    path.write_text(PLAY, encoding="utf-8")
    return fan.load_play(path)


def test_a_ball_is_given_in_a_play(gift):
    assert gift, gift.changes
    give, wave = gift.cues
    assert give.who == ("pierrot", "columbine")
    assert give.description == "pierrot: gives ball to columbine"
    marks = {**give.marks["pierrot"], **give.marks["columbine"]}
    assert marks["offered"] < marks["under"] < marks["taken"] < marks["released"]
    assert wave.start == pytest.approx(marks["taken"] + 20 * gift.score.beat, abs=0.1)
    kinds = [
        (play_meeting.kind, play_meeting.players)
        for play_meeting in sorted(gift.meetings, key=lambda play_meeting: play_meeting.begin)
    ]
    assert kinds == [
        ("hangs", ("pierrot",)),
        ("given", ("pierrot", "columbine")),
        ("hangs", ("columbine",)),
    ]
    verification = fan.theatre.verify_play(gift)
    assert verification, verification.faults
    touching_pairs = {
        frozenset(names)
        for names in np.array(verification.run.contact.names)[
            np.unique(verification.run.contact.pair)
        ].tolist()
    }
    assert touching_pairs == {
        frozenset(("ball", "pierrot.forearm_right")),
        frozenset(("ball", "columbine.forearm_left")),
    }


def test_the_run_of_the_stage_is_that_of_its_companies(gift):
    """Energies and places are continuous between companies."""
    runs = gift.runs()
    stage_run = combine_runs(gift.cast, runs)
    for company in runs.companies:
        if "ball" not in company.scene.props:
            continue
        scene_name = company.scene.props["ball"]
        t = np.linspace(company.begin, company.end, 7)[1:-1]
        company_samples = company.trajectory.resample(t - company.begin)
        for axis in "xyz":
            assert stage_run.resample(t)[f"ball.{axis}"] == pytest.approx(
                company_samples[f"{scene_name}.{axis}"], abs=2e-4
            )
    height_steps = np.abs(np.diff(stage_run["ball.z"]))
    assert height_steps.max() < 0.005  # no jumps
    assert not find_failures(gift.cast, gift.meetings, runs)
    # Energy gained = work done - losses in contact, strings and air.
    ledger = stage_run.ledger
    energy = ledger["kinetic"] + ledger["potential"]
    losses = ledger["damping"] + ledger["impact"] + ledger["slip"] + ledger["friction"]
    energy_error = energy - energy[0] + losses - ledger["work"]
    assert np.abs(energy_error).max() < 0.05


@pytest.mark.parametrize(
    ("cue", "text"),
    [
        ("{who: pierrot, gives: ball}", "no `to`; `gives` has `to`, and only it"),
        ("{who: pierrot, does: bow, to: columbine}", "`does` with `to`"),
        ("{who: all, gives: ball, to: columbine}", "`all`; needed: one player"),
        ("{who: pierrot, gives: bal, to: columbine}", "no prop is called 'bal'; did you mean"),
        ("{who: pierrot, gives: ball, to: pierrot}", "gives it to itself"),
        ("{who: pierrot, gives: ball, to: nobody}", "no player is called 'nobody'"),
        ("{who: pierrot, sits on: sofa}", "no prop or obstacle is called 'sofa'"),
        ("{who: pierrot, puts down: ball, onto: table}", "no obstacle is called 'table'"),
        ("{who: pierrot, puts down: ball}", "no `onto`"),
        ("{who: pierrot, gives: ball, to: columbine, on: {taken: 4}}", "needed: `when`"),
    ],
)
def test_mistakes_of_cues_with_props_have_their_line(tmp_path, cue, text):
    path = tmp_path / "gift.yaml"
    path.write_text(PLAY.replace("{who: pierrot, gives: ball, to: columbine}", cue))
    with pytest.raises(fan.errors.FileError) as error:
        fan.theatre.plays.check_play(path)
    assert text in str(error.value)
    assert "gift.yaml:16" in str(error.value)


@pytest.mark.parametrize(
    ("prop", "text"),
    [
        ("{}", "nothing of `held by` and a place"),
        ("{held by: pierrot, at: west}", "both of `held by` and a place"),
        ("{held by: pierot}", "no player is called 'pierot'; did you mean 'pierrot'?"),
        ("{like: bal, held by: pierrot}", "no bundled prop is called 'bal'; did you mean 'ball'?"),
        ("{like: chair, held by: pierrot}", "has no handle"),
        ("{at: west, on: table}", "needed: an obstacle"),
        ("{at: westt}", "no mark is called 'westt'; did you mean 'west'?"),
    ],
)
def test_mistakes_of_props_have_their_line(tmp_path, prop, text):
    path = tmp_path / "gift.yaml"
    path.write_text(PLAY.replace("ball: {held by: pierrot}", f"ball: {prop}"))
    with pytest.raises(fan.errors.FileError) as error:
        fan.theatre.plays.check_play(path)
    assert text in str(error.value)
    assert "gift.yaml:12" in str(error.value)


def test_a_player_without_a_prop_cannot_give_it(tmp_path):
    path = tmp_path / "gift.yaml"
    path.write_text(
        PLAY.replace(
            "who: pierrot, gives: ball, to: columbine", "who: columbine, gives: ball, to: pierrot"
        )
    )
    change, *_ = fan.load_play(path).changes
    assert "gift.yaml:16" in str(change)
    assert "columbine does not hold ball: pierrot holds it" in str(change)


def test_a_ball_is_given_live(gift):
    """The time steps are those of the whole stage, with feedback against swing."""
    show = fan.theatre.LivePlay(gift)
    show.go()
    while not show.done:
        x = show.advance(0.5)
    ball, torso = (gift.marionette.pose(x, name)[:3, 3] for name in ("ball", "columbine.torso"))
    assert np.linalg.norm((ball - torso)[:2]) < 0.25
    assert ball[2] > 0.15  # it hangs
