"""Shots of a play's film: where its camera looks, and when.

A driven body is moved by the hands, such as a control. In names, D stands for dynamic coordinates,
which move by the equations of motion. Mistakes of the file are recorded in a log.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.base import did_you_mean
from fantoccini.dynamics.compiled import moving_and_carrying
from fantoccini.theatre.cast import Cast, Places, shot_time_keys
from fantoccini.theatre.plays.placing import Placement
from fantoccini.theatre.script import PlayCue, PlayFile, ScriptLog, Timeline

_WHOLE_STAGE = "all"
"""Name in `at` of the whole stage."""


@dataclass(frozen=True)
class Shot:
    """A shot of a film's camera, until the next one begins.

    Attributes:
        t: beginning [s].
        over: duration of the camera's move to it [s]; 0 for a cut.
        bodies: names of the bodies that it shows and follows; () for everything or a place.
        place: x, y and possibly z of a place that it shows [m]; None for bodies or everything.
        azimuth, elevation: direction from which it sees them [rad].
        zoom: size in the picture, relative to the size at which the target just fills it.
    """

    t: float
    over: float = 0.0
    bodies: tuple[str, ...] = ()
    place: tuple[float, ...] | None = None
    azimuth: float = 0.0
    elevation: float = 0.0
    zoom: float = 1.0


def check_shots(file: PlayFile, log: ScriptLog) -> None:
    """Records unknown names in shots, and places listed together with other names."""
    moving_names = {*file.cast, *file.props}
    fixed_names = {
        *file.stage.marks,
        *(obstacle.name for obstacle in file.stage.obstacles),
        _WHOLE_STAGE,
    }
    all_names = sorted(moving_names | fixed_names)
    for act_index, act in enumerate(file.acts):
        for shot_index, shot in enumerate(act.camera):
            spot = ("acts", act_index, "camera", shot_index, "at")
            for name in shot.at:
                if name not in all_names:
                    text = f"no player, prop, mark or obstacle is called {name!r}"
                    log.mistakes.add(spot, text + did_you_mean(name, all_names))
                elif name in fixed_names and len(shot.at) > 1:
                    text = f"found {name!r} with others; needed: players and props, or one place"
                    log.mistakes.add(spot, text)


def shots_of(
    cast: Cast, timeline: Timeline[PlayCue], placement: Placement, places: Places, beat: float
) -> tuple[Shot, ...]:
    """Shots of a play whose cues are placed, in order of time.

    Args:
        cast, timeline, placement, places: parts of the play.
        beat: duration of a beat [s].
    """
    shots = []
    for act_index, act in enumerate(cast.file.acts):
        for shot_index, shot in enumerate(act.camera):
            reference, start = (
                timeline.refs[shot_time_keys(act_index, shot_index)],
                placement.act_starts[act_index],
            )
            (name, *_), moving_names = shot.at, {*cast.file.cast, *cast.file.props}
            bodies = _bodies(cast, shot.at) if name in moving_names else ()
            fixed_place = (
                None if name in moving_names or name == _WHOLE_STAGE else places.fixed_place(name)
            )
            shots.append(
                Shot(
                    timeline.time(reference, start, placement.moments),
                    shot.over * beat,
                    bodies,
                    None if fixed_place is None else (fixed_place.real, fixed_place.imag),
                    shot.from_,
                    shot.above,
                    shot.zoom,
                )
            )
    return tuple(sorted(shots, key=lambda shot: shot.t))


def _bodies(cast: Cast, names: tuple[str, ...]) -> tuple[str, ...]:
    """Bodies in the scene of players and props, without controls and other driven bodies."""
    tree, n_D = cast.marionette.tree, cast.marionette.coordinates.n_vD
    moves_freely = np.any(moving_and_carrying(tree)[0][:, :n_D], axis=1)
    return tuple(
        link.name
        for link, is_free in zip(tree.links, moves_freely, strict=True)
        if is_free and cast.owner(link.name) in names
    )
