"""``export``: writes a motion as an animation, in any format.

A run is a simulated motion of a puppet.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TypeAlias

from fantoccini.base import replacing
from fantoccini.control.optimal import Optimum
from fantoccini.control.planning import PlanResult
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.tree import grow
from fantoccini.motion import Trajectory
from fantoccini.output.animation.formats import format_of
from fantoccini.output.animation.scene import AnimatedScene, Bodies
from fantoccini.output.view import Drawable, UncompiledPuppet
from fantoccini.theatre.perform import Recording
from fantoccini.theatre.plays import Verification
from fantoccini.theatre.retarget import FollowResult

Moving: TypeAlias = Trajectory | Recording | PlanResult | Optimum | FollowResult | Verification
"""A result that has a motion."""


def export(
    what: Moving,
    path: str | os.PathLike[str],
    fps: float | None = None,
    bodies: Bodies | None = None,
    marionette: Marionette | None = None,
) -> Path:
    """Writes a motion as an animation for other programs. The file appears only when complete.

    The ending selects the format:

    - ``.glb``: glTF 2.0. The keys are cubic splines through positions and velocities of the motion,
      as many as keep every point of a body within 0.01 mm. With ``fps`` the keys are linear, at
      that rate: for programs that do not read splines, such as Blender.
    - ``.usda``, ``.usdc``: OpenUSD, text or binary; linear, at 60 a second unless ``fps`` is given.
    - ``.bvh``: the bodies as a skeleton, in metres, y up; at 60 frames a second unless ``fps`` is
      given.
    - ``.csv``: the columns of the run, at every sample, or at ``fps`` a second; with ``bodies``
      also their poses and the ends of their strings.
    - ``.mcap``: messages for Foxglove and Rerun; at 60 a second unless ``fps`` is given.

    Args:
        what: a run, recording, plan, optimum, followed clip or verified play. A run that stopped
            early is written up to where it stopped.
        path: path of the file.
        fps: keys per second.
        bodies: names of the bodies to write, with the strings between them and the world. All by
            default, and for ``all``.
        marionette: the marionette to show, for a run with obstacles that its puppet lacks.

    Returns:
        The path.

    Raises:
        ValueError: the ending is unknown, the rate is invalid, there is no motion, or the run does
            not carry its puppet.
        UnknownNameError: there is no such body.
        MissingLibraryError: the library for OpenUSD or MCAP is not installed.
        FileNotFoundError: there is no such folder.
    """
    path = Path(path)
    file_format, rate = format_of(path, fps)
    puppet, run = _puppet_and_run(what)
    if marionette is not None:
        puppet = marionette
    scene = AnimatedScene.from_run(puppet, run, bodies, rate)
    with replacing(path) as temporary:
        # The temporary name has another ending, but USD chooses its format by the ending.
        complete_file = temporary.with_name(temporary.name + path.suffix.lower())
        try:
            file_format.writer(scene, complete_file)
            os.replace(complete_file, temporary)
        finally:
            complete_file.unlink(missing_ok=True)
    return path


def _puppet_and_run(what: Moving) -> tuple[Drawable, Trajectory]:
    """The puppet to show, and its motion."""
    match what:
        case Trajectory():
            if what.puppet is None:
                raise ValueError("the run has no puppet; give `marionette`")
            return UncompiledPuppet(what.puppet, grow(what.puppet)), what
        case Recording():
            return what.marionette, what.trajectory
        case PlanResult():
            if what.reason:
                raise ValueError(f"there is no plan to export: {what.reason}")
            return what.problem.drawn_marionette, what.trajectory
        case Optimum():
            return what.marionette, what.run
        case Verification():
            return what.play.marionette, what.run
        case FollowResult():
            return what.retargeted.marionette, what.run
    raise ValueError(
        f"found {type(what).__name__}; expected a run, a recording, a plan, an optimum, a followed "
        "clip or a verified play"
    )
