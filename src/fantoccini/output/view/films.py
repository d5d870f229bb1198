"""Films of a motion: frames drawn here and encoded by an ffmpeg process.

A frame is one picture of the film.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from fantoccini.base import FantocciniError, MediaError, OnProgress, Progress, ffmpeg, replacing
from fantoccini.output.view.camera import Camera, Viewport
from fantoccini.output.view.compose import Layout, compose_polygons, shadow_polygons
from fantoccini.output.view.drawing import PictureOptions, Sheet, fit_layout, set_polygons
from fantoccini.output.view.geometry import Geometry, Guides, run_geometry
from fantoccini.output.view.pan import camera_path, should_follow
from fantoccini.output.view.shots import shot_cameras
from fantoccini.output.view.soundtrack import soundtrack
from fantoccini.output.view.stage_set import puppet_viewport
from fantoccini.output.view.stage_shadows import stage_shadows
from fantoccini.output.view.still import Drawable
from fantoccini.output.view.studio import Studio, check_renderer
from fantoccini.output.view.subtitles import Subtitles
from fantoccini.output.view.theme import Theme

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.image import AxesImage
    from matplotlib.text import Text

    from fantoccini.motion import Trajectory
    from fantoccini.theatre.gestures import Caption, Sound
    from fantoccini.theatre.plays import Shot

CODEC_ARGUMENTS = {
    ".mp4": (
        "-c:v",
        "libx264",
        "-preset",
        "veryfast",
        "-crf",
        "18",
        "-pix_fmt",
        "yuv420p",
        "-movflags",
        "+faststart",
        "-f",
        "mp4",
    ),
    ".gif": (
        "-vf",
        "split[a][b];[a]palettegen=max_colors=128[p];[b][p]paletteuse=dither=bayer",
        "-loop",
        "0",
        "-f",
        "gif",
    ),
}
"""Arguments of ffmpeg, by file ending."""
_MAX_CAPTION_SHARE = 0.2
"""Largest height of the captions, relative to the picture."""

MAX_GIF_FPS = 50.0
"""Largest frame rate of a GIF [1/s]: frames last whole hundredths of a second, and browsers show
a frame of 0.01 s for 0.1 s."""


class FilmError(FantocciniError):
    """The film could not be written; the message ends with the encoder's last lines."""


def film(
    marionette: Drawable,
    run: Trajectory,
    path: str | os.PathLike[str],
    fps: float = 30.0,
    size: tuple[int, int] = (960, 720),
    view: str | tuple[float, float] = "auto",
    focus: str | None = None,
    theme: str | Theme = "light",
    speed: float = 1.0,
    progress: OnProgress | None = None,
    renderer: str = "matplotlib",
    follow: bool | None = None,
    forces: bool = False,
    captions: Sequence[Caption] = (),
    sounds: Sequence[Sound] = (),
    guides: Guides | None = None,
    look: str = "diagram",
    shots: Sequence[Shot] = (),
) -> Path:
    """Writes a film of a run.

    The file appears only when complete. A fixed camera frames the whole motion, unless the puppet
    walks so far that it would appear small: then the camera follows it. Shots replace both.

    Args:
        marionette: the puppet.
        run: its motion.
        path: path that ends in ``.mp4`` (H.264, yuv420p) or ``.gif``.
        fps: frames per second; for a ``.gif`` at most 50, the limit of browsers.
        size: width and height [px], rounded up to even numbers.
        view: preset, or (azimuth, elevation) in degrees.
        focus: ``all`` frames bodies and strings; with ``bodies`` strings may leave the picture, as
            by default in the look ``stage``.
        theme: ``light``, ``dark``, or a Theme; the look ``stage`` has its own colours.
        speed: seconds of motion per second of film.
        progress: callback after each frame.
        renderer: ``matplotlib``, or ``pyvista`` for shaded solids, if installed; it takes several
            times as long.
        follow: whether the camera follows the puppet; by default if it would otherwise be small.
        forces: whether to draw the forces of contacts, as in :func:`strip`; matplotlib only.
        captions: captions below the picture, in the run's time, such as ``score.captions``.
        sounds: sounds, in the run's time, such as ``score.sounds``. They keep their pitch in slow
            and fast films. A ``.gif`` is silent.
        guides: function that returns polylines (T, n, 3) [m] for times (T,), to compare the motion
            with, drawn in front of it: ``followed.guides``; matplotlib only.
        look: ``diagram``, or ``stage``: a theatre, with thin plain strings and without title, time
            and tension scale.
        shots: shots of the camera, in the run's time: ``play.shots``. Before the first one, the
            camera shows the whole motion.

    Returns:
        The path of the film.

    Raises:
        FilmError: the encoder failed, a sound cannot be read, or the folder does not exist.
        MissingLibraryError: pyvista was chosen and is not installed.
        ValueError: a number is out of range, the ending is unknown, there are no forces to draw, or
            a film with sound is more than 4 times as slow or fast as the motion.
    """
    path = Path(path)
    if path.suffix.lower() not in CODEC_ARGUMENTS:
        raise ValueError(f"a film ends in {' or '.join(CODEC_ARGUMENTS)}, not in {path.suffix!r}")
    if not (0.0 < fps <= 240.0 and speed > 0.0 and min(size) >= 16 and max(size) <= 8192):
        raise ValueError("a film needs 0 < fps <= 240, speed > 0 and sides of 16 to 8192 pixels")
    if not os.path.isdir(path.parent):
        raise FilmError(f"there is no folder {path.parent}")
    width, height = (int(n_frames) + int(n_frames) % 2 for n_frames in size)
    if check_renderer(renderer) == "pyvista" and (forces or guides):
        raise ValueError("pyvista draws no forces and no guides; use renderer='matplotlib'")

    suffix = path.suffix.lower()
    if suffix == ".gif":
        fps = min(fps, MAX_GIF_FPS)
    start, end = float(run.t[0]), float(run.t[-1])
    n_frames = max(1, round((end - start) / speed * fps))
    times = np.minimum(start + np.arange(n_frames) * (speed / fps), end)
    sound = soundtrack(sounds if suffix == ".mp4" else (), start, n_frames / fps, speed)
    geometry = run_geometry(marionette, run.resample(times), forces).with_guides(guides)
    options = PictureOptions.resolve(view, focus, theme, (width, height), look)
    frames = Frames(geometry, options, renderer, follow, captions, shots)
    try:
        with replacing(path) as temporary:
            _encode(frames, n_frames, temporary, (*sound, CODEC_ARGUMENTS[suffix]), fps, progress)
    finally:
        frames.close()
    return path


class Frames:
    """Drawing of a film's frames; background, scale and captions are drawn once.

    Args:
        geometry: geometry to show.
        options: options of the pictures.
        renderer: renderer of solids and strings.
        follow: whether the camera follows the puppet; None if it would otherwise be small.
        captions: captions below the picture.
        shots: shots of the camera; () for one fixed camera, or one that follows the puppet.
    """

    def __init__(
        self,
        geometry: Geometry,
        options: PictureOptions,
        renderer: str = "matplotlib",
        follow: bool | None = None,
        captions: Sequence[Caption] = (),
        shots: Sequence[Shot] = (),
    ):
        self.size = width, height = options.size or (960, 720)
        unit = max(height / 50.0, min(10.0, width / 24.0))  # keeps captions of small films legible
        self.geometry, self.sheet = geometry, Sheet(self.size, options.theme)
        self._subtitles = Subtitles(captions, width, unit, _MAX_CAPTION_SHARE * height)
        bottom = 3.2 * unit + self._subtitles.height
        viewport = Viewport(unit, bottom, width - 2.0 * unit, height - 2.8 * unit - bottom)
        if options.look == "stage":
            viewport = puppet_viewport(self.sheet.frame, self._subtitles.height)
        self.layout, self.pan = _choose_framing(
            geometry, viewport, options, False if shots else follow
        )
        self.cameras = self._cameras_of(shots, strings=options.focus == "all")
        self._camera_moves = any(camera is not self.layout.camera for camera in self.cameras)
        self._last_camera: Camera | None = None
        self._floor: list[Artist] = []
        if not self._camera_moves:
            self.sheet.add_floor(geometry, self.layout)
        self._artists_below, self._artists_above = self._static_artists(options, unit)
        self._subtitles.place(self.sheet, 3.2 * unit if self.layout.stage is None else unit)
        self._floor_centre = np.append(geometry.balls(pan=self.pan)[0][:, :2].mean(axis=0), 0.0)
        self._polygons = self.sheet.add_polygons([], animated=True)
        self._studio = None
        if renderer == "pyvista":
            self._studio = Studio(geometry, self.layout, self.size)
            blank, extent = np.zeros((height, width, 4)), (0.0, width, 0.0, height)
            self._studio_image = self.sheet.add_image(blank, extent, 3.0, animated=True)
        self._canvas = cast("FigureCanvasAgg", self.sheet.figure.canvas)
        self._canvas.draw()
        self._empty_sheet = self._canvas.copy_from_bbox(self.sheet.figure.bbox)
        self._background = self._empty_sheet

    def draw(self, k: int) -> memoryview:
        """Pixels of frame k: rows from the top; red, green, blue, opacity, a byte each."""
        layout = self._frame_layout(k)
        draw_scene = compose_polygons if self._studio is None else shadow_polygons
        set_polygons(self._polygons, draw_scene(self.geometry, k, layout))
        if self._clock is not None:
            self._clock.set_text(f"{self.geometry.t[k]:.2f} s")
        captions = self._subtitles.at(float(self.geometry.t[k]))
        artists: list[Artist] = [self._polygons, *self._artists_above, *captions]
        if self._studio is not None:
            self._studio_image.set_data(self._studio.render(k)[::-1])
            artists.insert(1, self._studio_image)
        if self._shadows is not None:
            self._shadows.set_data(stage_shadows(self.geometry, k, layout, self.sheet.frame))
            artists.insert(0, self._shadows)
        for artist in artists:
            self.sheet.axes.draw_artist(artist)
        return self._canvas.buffer_rgba()

    def _cameras_of(self, shots: Sequence[Shot], strings: bool) -> list[Camera]:
        """Camera of every frame; equal ones are the same object."""
        camera, n = self.layout.camera, len(self.geometry.t)
        if self.pan is not None:
            return [replace(camera, eye=camera.eye + displacement) for displacement in self.pan]
        if not shots:
            return [camera] * n
        return shot_cameras(self.geometry, self.layout, shots, strings)

    def _static_artists(
        self, options: PictureOptions, unit: float
    ) -> tuple[list[Artist], list[Artist]]:
        """Tension scale, drawn before the puppet; title and time, or darkness, drawn after it."""
        width, height = self.size
        axes, geometry = self.sheet.axes, self.geometry
        self._clock: Text | None = None
        self._shadows: AxesImage | None = None
        if self.layout.stage is not None:
            blank = np.zeros((1, 1, 4))
            self._shadows = self.sheet.add_shadows(blank, self.sheet.frame, animated=True)
            return [], [self.sheet.add_vignette(self.sheet.frame, animated=True)]
        before = set(axes.get_children())
        self.sheet.add_tension_bar(geometry, self.layout, 2.2 * unit, unit)
        scale = [x for x in axes.get_children() if x not in before]
        for artist in scale if self._camera_moves else ():
            artist.set_animated(True)  # a moving floor is drawn before it
        # Strings may pass behind the title.
        title = self.sheet.add_title(geometry.title, unit, height - 1.6 * unit, animated=True)
        self._clock = self.sheet.add_text(
            width - 1.6 * unit,
            height - 1.6 * unit,
            "",
            1.15 * unit,
            options.theme.muted,
            ha="right",
            va="top",
            animated=True,
        )
        return scale, [title, self._clock]

    def _frame_layout(self, k: int) -> Layout:
        """Layout of frame k; draws its background."""
        camera = self.cameras[k]
        layout = replace(self.layout, camera=camera)
        if not self._camera_moves or camera is self._last_camera:
            self._canvas.restore_region(self._background)
            return layout
        self._canvas.restore_region(self._empty_sheet)
        for artist in self._floor:
            artist.remove()
        middle = None if self.pan is None else self.pan[k] + self._floor_centre
        self._floor = self.sheet.add_floor(
            self.geometry, layout, light_centre=middle, animated=True
        )
        for artist in (*self._floor, *self._artists_below):
            self.sheet.axes.draw_artist(artist)
        self._last_camera, self._background = (
            camera,
            self._canvas.copy_from_bbox(self.sheet.figure.bbox),
        )
        if self._studio is not None:
            self._studio.aim(layout, self.size)
        return layout

    def close(self) -> None:
        """Releases the renderer."""
        if self._studio is not None:
            self._studio.close()


def _choose_framing(
    geometry: Geometry, viewport: Viewport, options: PictureOptions, follow: bool | None
) -> tuple[Layout, np.ndarray | None]:
    """Layout of the first frame, and displacements (T, 3) [m] of a camera that follows, or None."""
    fixed_layout = fit_layout(geometry, viewport, options)
    if follow is False:
        return fixed_layout, None
    path = camera_path(geometry)
    following_layout = fit_layout(geometry, viewport, options, pan=path)
    if follow is None:
        # Decided with the strings in view: a puppet that only swings in place is not followed.
        distances = []
        for pan in (None, path):
            camera = fit_layout(geometry, viewport, replace(options, focus="all"), pan=pan).camera
            centre = geometry.balls(pan=pan)[0].mean(axis=0)
            distances.append(float((centre - camera.eye) @ -camera.axes[2]))
        follow = should_follow(*distances)
    return (following_layout, path) if follow else (fixed_layout, None)


def _encode(
    frames: Frames,
    n_frames: int,
    temporary: Path,
    arguments: tuple[Sequence[str], Sequence[str], Sequence[str]],
    fps: float,
    progress: OnProgress | None,
) -> None:
    """Draws and encodes n frames; `arguments` are those for sounds, their mix and the codec."""
    try:
        program = ffmpeg()
    except MediaError as error:
        raise FilmError(str(error)) from error
    sound_arguments, mix_arguments, codec_arguments = arguments
    width, height = frames.size
    command = [
        program,
        "-hide_banner",
        "-loglevel",
        "error",
        "-y",
        "-f",
        "rawvideo",
        "-pix_fmt",
        "rgba",
        "-s",
        f"{width}x{height}",
        "-r",
        f"{fps:.6f}",
        "-i",
        "pipe:0",
        *sound_arguments,
        *mix_arguments,
        *codec_arguments,
        str(temporary.absolute()),
    ]
    with tempfile.TemporaryFile() as log:
        encoder = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=log
        )
        assert encoder.stdin is not None
        pipe_broken = False
        try:
            for k in range(n_frames):
                encoder.stdin.write(frames.draw(k))
                if progress is not None:
                    progress(Progress(done=k + 1, total=n_frames))
            encoder.stdin.close()
        except (BrokenPipeError, ConnectionError):
            pipe_broken = True
        except BaseException:
            encoder.kill()
            encoder.wait()
            raise
        exit_code = encoder.wait()
        if pipe_broken or exit_code != 0:
            log.seek(0)
            lines = log.read().decode("utf-8", "replace").strip().splitlines()[-6:]
            raise FilmError(
                f"ffmpeg ended with code {exit_code}: {'; '.join(lines) or 'no message'}"
            )
