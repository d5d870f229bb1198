"""A film of a motion: frames drawn here, encoded by ffmpeg in a process of its own."""

from __future__ import annotations

import os
import secrets
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fantoccini.errors import FantocciniError
from fantoccini.view.camera import Viewport
from fantoccini.view.compose import Stage, compose, shadows
from fantoccini.view.drawing import (
    collection,
    floor,
    image,
    sheet,
    show,
    stage_of,
    tension_bar,
    write,
)
from fantoccini.view.pan import pan, walks
from fantoccini.view.scene import Scene, scene_of
from fantoccini.view.studio import Studio, checked_renderer
from fantoccini.view.theme import Theme, theme_of

if TYPE_CHECKING:
    from fantoccini.marionette import Marionette
    from fantoccini.motion import Trajectory

CODECS = {
    ".mp4": (
        "-c:v", "libx264", "-preset", "veryfast", "-crf", "18", "-pix_fmt", "yuv420p",
        "-movflags", "+faststart", "-f", "mp4",
    ),
    ".gif": (
        "-vf", "split[a][b];[a]palettegen=max_colors=128[p];[b][p]paletteuse=dither=bayer",
        "-loop", "0", "-f", "gif",
    ),
}  # fmt: skip
"""ffmpeg's arguments for each ending that a film can have."""


class FilmError(FantocciniError):
    """The film could not be written; the message carries what the encoder last said."""


def film(
    marionette: Marionette,
    run: Trajectory,
    path: str | os.PathLike,
    fps: float = 30.0,
    size: tuple[int, int] = (960, 720),
    view: str | tuple[float, float] = "auto",
    focus: str = "all",
    theme: str | Theme = "light",
    speed: float = 1.0,
    progress: Callable[[int, int], None] | None = None,
    renderer: str = "matplotlib",
    follow: bool | None = None,
) -> Path:
    """Writes a film of a run.

    The file appears under its name only when it is whole. The camera stands still and frames all
    of the motion; where the puppet walks so far that it would be small, the camera goes along.

    Args:
        marionette: the puppet's handle.
        run: its motion.
        path: ends in ``.mp4`` (H.264, yuv420p) or ``.gif``.
        fps: frames a second.
        size: width and height [px], rounded up to even numbers.
        view: preset, or (azimuth, elevation) in degrees.
        focus: ``all`` frames bodies and strings, ``bodies`` lets strings leave the picture.
        theme: ``light``, ``dark``, or a Theme.
        speed: seconds of motion for a second of film.
        progress: called with (frames done, frames in all) after each frame.
        renderer: ``matplotlib``, or ``pyvista`` for shaded solids where that is installed; it takes
            several times as long.
        follow: whether the camera goes along; by default where the puppet walks.

    Returns:
        The path of the film.

    Raises:
        FilmError: the encoder failed, or the folder does not exist.
        MissingLibraryError: pyvista is asked for and not installed.
        ValueError: a number is out of range, or the ending is unknown.
    """
    path = Path(path)
    if path.suffix.lower() not in CODECS:
        raise ValueError(f"a film ends in {' or '.join(CODECS)}, not in {path.suffix!r}")
    if not (0.0 < fps <= 240.0 and speed > 0.0 and min(size) >= 16 and max(size) <= 8192):
        raise ValueError("a film needs 0 < fps <= 240, speed > 0 and sides of 16 to 8192 pixels")
    if not path.parent.is_dir():
        raise FilmError(f"there is no folder {path.parent}")
    width, height = (int(n) + int(n) % 2 for n in size)
    checked_renderer(renderer)

    start, stop = float(run.t[0]), float(run.t[-1])
    n = max(1, round((stop - start) / speed * fps))
    times = np.minimum(start + np.arange(n) * (speed / fps), stop)
    scene = scene_of(marionette, run.resample(times))
    frames = Frames(scene, (width, height), theme_of(theme), view, focus, renderer, follow)
    part = path.with_name(f".film-{secrets.token_hex(6)}{path.suffix.lower()}")
    try:
        _encode(frames, n, part, fps, progress)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)
        frames.close()
    return path


class Frames:
    """Draws the frames of one film; background, scale and captions are drawn once.

    Args:
        scene: what to show.
        size: width and height [px].
        theme: the look.
        view: preset, or (azimuth, elevation) in degrees.
        focus: ``all`` or ``bodies``.
        renderer: of solids and strings.
        follow: whether the camera goes along; None where the puppet walks.
    """

    def __init__(
        self,
        scene: Scene,
        size: tuple[int, int],
        theme: Theme,
        view: str | tuple[float, float] = "auto",
        focus: str = "all",
        renderer: str = "matplotlib",
        follow: bool | None = None,
    ):
        width, height = size
        unit = max(height / 50.0, min(10.0, width / 24.0))  # small films have letters to be read
        self.scene, self.size = scene, size
        self.figure, self.axes = sheet(size, theme)
        inner = Viewport(unit, 3.2 * unit, width - 2.0 * unit, height - 6.0 * unit)
        self.stage, self.pan = _staged(scene, inner, theme, view, focus, follow)
        self._floor = [] if self.pan is not None else floor(self.axes, scene, self.stage)
        before = set(self.axes.get_children())
        tension_bar(self.axes, scene, self.stage, width - 1.6 * unit, 2.2 * unit, unit)
        self._scale = [x for x in self.axes.get_children() if x not in before]
        for artist in self._scale if self.pan is not None else ():
            artist.set_animated(True)  # a floor that moves is drawn before it
        # Strings may run up behind the title.
        self.title = write(
            self.axes, 1.6 * unit, height - 1.6 * unit, scene.title, 1.35 * unit, theme.ink,
            ha="left", va="top", weight="bold", animated=True,
        )  # fmt: skip
        self.clock = write(
            self.axes, width - 1.6 * unit, height - 1.6 * unit, "", 1.15 * unit, theme.faint,
            ha="right", va="top", animated=True,
        )  # fmt: skip
        self.middle = np.append(scene.balls(pan=self.pan)[0][:, :2].mean(axis=0), 0.0)
        self.polygons = collection(self.axes, animated=True)
        self.studio = None
        if renderer == "pyvista":
            self.studio = Studio(scene, self.stage, size)
            blank = np.zeros((height, width, 4))
            self.photograph = image(self.axes, blank, (0.0, width, 0.0, height), 3.0, animated=True)
        self.figure.canvas.draw()
        self.backdrop = self.figure.canvas.copy_from_bbox(self.figure.bbox)

    def draw(self, k: int) -> memoryview:
        """The pixels of frame k: rows from the top, red, green, blue, opacity, a byte each."""
        canvas = self.figure.canvas
        canvas.restore_region(self.backdrop)
        stage = self.stage if self.pan is None else self._go_along(k)
        self.clock.set_text(f"{self.scene.t[k]:.2f} s")
        painted = compose if self.studio is None else shadows
        show(self.polygons, painted(self.scene, k, stage))
        self.axes.draw_artist(self.polygons)
        if self.studio is not None:
            self.photograph.set_data(self.studio.photograph(k)[::-1])
            self.axes.draw_artist(self.photograph)
        self.axes.draw_artist(self.title)
        self.axes.draw_artist(self.clock)
        return canvas.buffer_rgba()

    def _go_along(self, k: int) -> Stage:
        """The stage of frame k, with its floor, of a camera that goes along."""
        gone, camera = self.pan[k], self.stage.camera
        stage = replace(self.stage, camera=replace(camera, eye=camera.eye + gone))
        for artist in self._floor:
            artist.remove()
        self._floor = floor(self.axes, self.scene, stage, gone=gone + self.middle, animated=True)
        for artist in (*self._floor, *self._scale):
            self.axes.draw_artist(artist)
        if self.studio is not None:
            self.studio.aim(stage, self.size)
        return stage

    def close(self) -> None:
        """Gives back what drawing held."""
        if self.studio is not None:
            self.studio.close()


def _staged(
    scene: Scene, viewport: Viewport, theme: Theme, view: Any, focus: str, follow: bool | None
) -> tuple[Stage, np.ndarray | None]:
    """The stage of the first frame and how far its camera goes along, or None."""
    still = stage_of(scene, viewport, theme, view, focus)
    if follow is False:
        return still, None
    gone = pan(scene)
    along = stage_of(scene, viewport, theme, view, focus, pan=gone)
    if follow is None:
        # Whether it walks is seen with its strings: what swings on a fixed one does not.
        whole = [stage_of(scene, viewport, theme, view, "all", pan=path) for path in (None, gone)]
        centres = [scene.balls(pan=path)[0].mean(axis=0) for path in (None, gone)]
        distances = [
            float((centre - stage.camera.eye) @ -stage.camera.axes[2])
            for centre, stage in zip(centres, whole, strict=True)
        ]
        follow = walks(*distances)
    return (along, gone) if follow else (still, None)


def _encode(
    frames: Frames, n: int, part: Path, fps: float, progress: Callable[[int, int], None] | None
) -> None:
    import imageio_ffmpeg

    try:
        ffmpeg = imageio_ffmpeg.get_ffmpeg_exe()
    except RuntimeError as reason:
        raise FilmError(f"there is no ffmpeg on this machine: {reason}") from reason
    width, height = frames.size
    command = [
        ffmpeg, "-hide_banner", "-loglevel", "error", "-y",
        "-f", "rawvideo", "-pix_fmt", "rgba", "-s", f"{width}x{height}", "-r", f"{fps:.6f}",
        "-i", "pipe:0", "-an", *CODECS[part.suffix], str(part.absolute()),
    ]  # fmt: skip
    with tempfile.TemporaryFile() as said:
        encoder = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=said
        )
        broken = False
        try:
            for k in range(n):
                encoder.stdin.write(frames.draw(k))
                if progress is not None:
                    progress(k + 1, n)
            encoder.stdin.close()
        except (BrokenPipeError, ConnectionError):
            broken = True
        except BaseException:
            encoder.kill()
            encoder.wait()
            raise
        code = encoder.wait()
        if broken or code != 0:
            said.seek(0)
            lines = said.read().decode("utf-8", "replace").strip().splitlines()[-6:]
            raise FilmError(
                f"ffmpeg ended with code {code}: " + ("; ".join(lines) or "it said nothing")
            )
