"""Props put on tables and picked up, in plays."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.base.errors import FileError
from fantoccini.model.puppet.bundled_files import bundled
from fantoccini.theatre.plays import putting
from fantoccini.theatre.plays.stage_run import combine_runs

pytestmark = pytest.mark.slow

PUT_DOWN_CUE = "      - {who: pierrot, puts down: PROP, onto: table}\n"
PICK_UP_CUE = "      - {who: pierrot, picks up: PROP}\n"
TABLE_HEIGHT = 0.2
"""Height of a suitable table [m]."""


def load_marionette() -> fan.Marionette:
    return fan.load(bundled("marionette"))


def write_play_with_table(
    folder: Path,
    cues: str,
    prop: str = "ball",
    side: str = "right",
    top: float = TABLE_HEIGHT,
    at: str = "[-0.3, 0]",
) -> Path:
    """A play with a puppet that holds a prop, and a table."""
    path = folder / "put.yaml"
    path.write_text(
        "play: put\ntempo: 100\nstage:\n  space: {x: [-1.5, 1.5], y: [-1.2, 1.2]}\n  obstacles:\n"
        f"    - {{name: table, type: box, size: [0.3, 0.3, {top}], at: [0.6, 0, {top / 2}]}}\n"
        f"  marks: {{start: {{at: {at}}}}}\n"
        "cast:\n  pierrot: {at: start}\n"
        f"props:\n  {prop}: {{held by: pierrot, side: {side}}}\n"
        f"acts:\n  - act: One\n    cues:\n{cues.replace('PROP', prop)}",
        encoding="utf-8",
    )
    return path


def prop_place(play: fan.theatre.Play, prop: str) -> np.ndarray:
    """(4,) place of a prop's bottom and height of its axis, between the two cues of a play."""
    run = combine_runs(play.cast, play.runs())
    t = 0.5 * (play.cues[0].end + play.cues[1].start)
    k = int(np.searchsorted(run.t, t))
    poses = play.cast.marionette.poses(run.q_D[k : k + 1], run.q_K[k : k + 1])
    pose = poses[0, play.cast.marionette.link_index(prop)]
    return np.append(pose[:, 3], pose[2, 2])


@pytest.mark.parametrize(
    ("prop", "side", "top", "at"),
    [
        ("ball", "right", 0.19, "[0.7, 0.8]"),
        ("basket", "left", TABLE_HEIGHT, "[-0.3, 0]"),
        ("basket", "right", 0.21, "[0.9, -0.7]"),
    ],
)
def test_a_prop_is_put_down_and_picked_up_again(tmp_path, prop, side, top, at):
    play = fan.load_play(
        write_play_with_table(tmp_path, PUT_DOWN_CUE + PICK_UP_CUE, prop, side, top, at)
    )
    assert play.changes == ()
    x, y, z, upright = prop_place(play, prop)
    assert max(abs(x - 0.6), abs(y)) < 0.15  # half the table's width
    assert z == pytest.approx(top, abs=1e-3)
    assert upright > 0.9999


@pytest.mark.parametrize(("top", "off"), [(0.1, "low"), (0.3, "high")])
def test_an_unsuitable_table_is_refused_with_the_nearest_suitable_one(tmp_path, top, off):
    play = fan.load_play(write_play_with_table(tmp_path, PUT_DOWN_CUE, top=top))
    (change,) = play.changes
    assert "puts down ball onto table cannot be done" in str(change)
    assert f"table is {top:.3f} m high, which is too {off} for pierrot" in str(change)
    nearest = float(str(change).split(" m is nearest")[0].split()[-1])
    assert abs(nearest - top) > 0.05
    assert nearest == pytest.approx(0.189 if off == "low" else 0.228, abs=0.004)


def test_only_held_props_are_put_down_and_only_free_ones_are_picked_up(tmp_path):
    cues = "      - {who: pierrot, picks up: ball}\n"
    (change,) = fan.load_play(write_play_with_table(tmp_path, cues)).changes
    assert "pierrot holds ball" in str(change) and ":15: " in str(change)


def test_an_unknown_table_is_a_mistake_with_its_line(tmp_path):
    with pytest.raises(FileError, match=r"put.yaml:15: .*no obstacle is called 'tabel'"):
        fan.load_play(
            write_play_with_table(
                tmp_path, "      - {who: pierrot, puts down: ball, onto: tabel}\n"
            )
        )


def test_a_prop_that_hangs_too_high_or_too_low_is_refused():
    alone = load_marionette()
    for drop in putting.DROP_RANGE:
        with pytest.raises(ValueError, match="ball would go down by"):
            putting.putting(alone, "", "ball", 2.0 * drop)


@pytest.mark.parametrize("side", ["left", "right"])
def test_picking_up_is_putting_down_backwards(side):
    alone = load_marionette()
    down = putting.putting(alone, "", "ball", 0.01, side=side)
    up = putting.pick_up(alone, "", "ball", 0.01, side=side)
    assert (up.forward, up.left) == (down.forward, down.left)
    assert up.gesture.duration == down.gesture.duration
    hand = alone.coordinates.v_K.index(f"hand_{side}.x")
    differences = []
    for t in np.linspace(0.0, up.gesture.duration, 8):
        there, back = down.gesture.offsets(t)[0], up.gesture.offsets(up.gesture.duration - t)[0]
        # The arm without the prop hangs farther back, and is held out farther.
        differences.append(back[hand] - there[hand])
        np.testing.assert_allclose(
            np.delete(there, hand), np.delete(back, hand), rtol=0.0, atol=0.005
        )
    assert min(differences) > -0.005 and 0.02 < max(differences) < 0.045
