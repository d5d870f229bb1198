"""``python -m docs.gallery``: draws and films the bundled puppets, and writes docs/gallery.md."""

from __future__ import annotations

import argparse
import contextlib
import runpy
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import fantoccini as fan
from fantoccini.motion import Trajectory
from fantoccini.output import view
from fantoccini.theatre.script import is_score

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "gallery.md"
PICTURES = ROOT / "docs" / "pictures" / "gallery"
PROBLEM = "src/fantoccini/control/tasks/bundled_problems/arm3d_boxes.yaml"
NUMBER = "examples/20_number.py"
PERFORMANCES = "src/fantoccini/model/puppets/performances"

FPS = 12.0


@dataclass(frozen=True)
class Piece:
    """One puppet in one motion.

    Attributes:
        puppet: name of the bundled puppet or scene.
        text: caption.
        inputs: name of the performance; None if nothing is driven.
        start: coordinates at the start that differ from the rest pose.
        duration: duration of the motion [s].
        part: interval of the film [s]; None for no film.
        times: times of the strip's poses [s].
        view: preset, or azimuth and elevation in degrees.
        focus: framing of the film; ``bodies`` may crop strings.
        theme: theme of the film; the strip has the other.
        size: width and height of the film [px].
        speed: seconds of motion per second of film.
        dt: time step [s], for solids that touch; None for event-driven.
    """

    puppet: str
    text: str
    duration: float
    part: tuple[float, float] | None
    times: tuple[float, ...]
    inputs: str | None = None
    start: dict[str, float] = field(default_factory=dict)
    view: str | tuple[float, float] = "auto"
    focus: str = "all"
    theme: str = "dark"
    size: tuple[int, int] = (320, 400)
    speed: float = 1.0
    dt: float | None = None

    @property
    def name(self) -> str:
        """Name of the motion."""
        return self.inputs or "loop"

    @property
    def command(self) -> str:
        """The command that simulates the motion."""
        inputs = f" --inputs {self.inputs}" if self.inputs else ""
        if self.dt is not None:
            inputs += f" --method timestepping --dt {self.dt:g}"
        start = "".join(f" --start {name}={value:g}" for name, value in self.start.items())
        duration = "" if self.inputs else f" --duration {self.duration:g}"
        out = f" --out {self.name}.png --out {self.name}.mp4"
        return f"fantoccini simulate {self.puppet}{inputs}{start}{duration}{out}"


PIECES = (
    Piece(
        "promenade",
        "The marionette walks on a floor. Six times a string lifts a knee while the other foot "
        "pushes off. Then it stands, waves and nods.",
        duration=12.0,
        part=(0.8, 5.0),
        times=(0.0, 1.2, 1.7, 2.3, 2.9, 3.5, 4.6, 7.2, 9.7),
        inputs="walk",
        focus="bodies",
        theme="light",
        view=(-80.0, 8.0),
        size=(280, 320),
        speed=1.5,
        dt=1e-3,
    ),
    Piece(
        "stroll",
        "The marionette walks on its control bar, which one hand drags and rolls from side to "
        "side. With `fantoccini show stroll` you move the bar yourself.",
        duration=6.0,
        part=(0.4, 5.0),
        times=(0.0, 1.8, 2.4, 3.0),
        inputs="stroll",
        focus="bodies",
        view=(-80.0, 8.0),
        size=(240, 280),
        speed=2.0,
        dt=1e-3,
    ),
    Piece(
        "visit",
        "Two marionettes, a ball and a chair. Pierrot carries the ball by its frame on his arm. "
        "Columbine puts her hand through the frame and lifts it off his arm; then she sits down on "
        "the chair with it, and both nod. Only contact and friction hold the ball.",
        duration=12.0,
        part=(1.6, 9.8),
        times=(0.0, 3.6, 5.2, 6.6, 8.5, 9.0, 10.0),
        inputs="visit",
        focus="bodies",
        theme="light",
        view=(-75.0, 14.0),
        size=(260, 260),
        speed=2.6,
        dt=1e-3,
    ),
    Piece(
        "marionette",
        "The paper's marionette: 25 degrees of freedom on seven strings, 21 driven coordinates. It "
        "lifts its right hand and waves, takes four steps and bows.",
        duration=10.0,
        part=(0.4, 9.4),
        times=(0.0, 1.4, 2.1, 4.6, 5.4, 8.2),
        inputs="greeting",
        focus="bodies",
        speed=2.0,
    ),
    Piece(
        "marionette_bar",
        "The same puppet on a control bar held in one hand. Only the bar moves: tipped up and "
        "rolled from side to side it lifts hands and knees in turn; tipped down it lets them fall.",
        duration=6.0,
        part=(0.2, 5.6),
        times=(0.0, 0.7, 1.7, 2.7, 3.7, 4.9),
        inputs="dance",
        theme="light",
        size=(320, 440),
        speed=1.5,
    ),
    Piece(
        "airplane",
        "The same puppet on an airplane control. Tipped, the control lets the head nod; tipped "
        "further, its back string makes the puppet bow. The leg bar rocks for a walk, and the hand "
        "bar comes off for a wave. The motion is a score of bundled gestures.",
        duration=15.0,
        part=None,
        times=(0.0, 1.35, 2.6, 3.4, 4.2, 5.0, 8.6, 9.3, 12.7),
        inputs="parade",
        dt=2e-3,
        view=(-70.0, 8.0),
    ),
    Piece(
        "dachshund",
        "A dachshund on eight strings. It sniffs the ground, sits up to beg and wags its tail.",
        duration=8.4,
        part=(0.2, 8.2),
        times=(0.0, 1.1, 2.3, 5.1, 5.9, 8.4),
        inputs="wag",
        dt=2e-3,
        theme="light",
        focus="bodies",
        size=(240, 210),
        speed=2.5,
    ),
    Piece(
        "heron",
        "A heron on eight strings. It flaps its wings, glides, bends down and pecks.",
        duration=11.2,
        part=(0.2, 11.0),
        times=(0.0, 0.65, 1.05, 4.6, 6.4, 9.2),
        inputs="flap",
        dt=2e-3,
        focus="bodies",
        size=(240, 230),
        speed=3.0,
    ),
    Piece(
        "hans",
        "Hans has another build than the marionette, and bends at the waist. He nods, waves and "
        "bows.",
        duration=8.0,
        part=(0.2, 7.4),
        times=(0.0, 0.7, 2.0, 2.4, 5.4, 8.0),
        inputs="hello",
        dt=2e-3,
        theme="light",
        focus="bodies",
        size=(220, 260),
        speed=2.0,
    ),
    Piece(
        "dragon",
        "A dragon on eleven strings. It rears its head, beats its wings and lashes its tail.",
        duration=7.0,
        part=(0.2, 6.6),
        times=(0.0, 1.2, 1.6, 2.0, 4.0, 4.5),
        inputs="roar",
        dt=2e-3,
        focus="bodies",
        size=(260, 210),
        speed=2.0,
    ),
    Piece(
        "stand6",
        "The paper's stand: only winches at fixed places change the strings' lengths. Two strings "
        "to each hand conduct up, out and in; one string over two pulleys bends both knees.",
        duration=5.0,
        part=(0.2, 4.4),
        times=(0.0, 0.8, 1.2, 1.6, 3.0, 3.4),
        inputs="conduct",
        speed=1.2,
    ),
    Piece(
        "crane",
        "A load of a quarter of a tonne on one cable, hoisted, carried to one side and to the "
        "other while it swings, and lowered.",
        duration=10.0,
        part=(0.2, 9.6),
        times=(0.2, 3.4, 5.2, 6.9),
        inputs="hoist",
        theme="light",
        size=(440, 320),
        speed=2.0,
    ),
    Piece(
        "arm2d",
        "The paper's two-link arm. The winch jerks it up and lets the string run out: the arm "
        "falls free while the string sags, and snaps taut.",
        duration=4.0,
        part=(0.2, 3.4),
        times=(0.0, 0.6, 0.8, 1.5, 2.0, 2.3),
        inputs="toss",
    ),
    Piece(
        "arm3d",
        "The arm of the paper's planning example: a ball joint, a hinge and one string, whose "
        "upper end moves in a plane while the string is wound in and out. The hand stirs a pot.",
        duration=4.4,
        part=(0.0, 3.7),
        times=(0.0, 0.6, 1.0, 1.4, 1.8, 3.6),
        inputs="stir",
        theme="light",
        view=(-50.0, 22.0),
        speed=1.2,
    ),
    Piece(
        "string_pendulum",
        "A point mass on a string of one metre, pushed just too weakly for a full circle: it "
        "leaves the circle, flies with the string slack and is caught.",
        duration=3.0,
        part=(0.0, 3.0),
        times=(0.0, 0.25, 0.5, 0.75, 1.0, 1.3),
        start={"v:bob.x": 6.2},
    ),
)


PLAYS = {
    "duet": (
        "Pierrot brings a ball that hangs from his arm by a bar. Columbine comes up beside him, "
        "slips her arm under the free half of the bar and lifts the ball off. Only contact and "
        "friction hold it.",
        (1.0, 33.6, 36.8, 39.6, 51.4, 59.4),
    ),
    "chase": (
        "One player chases another round a table. Their paths are planned past the table and "
        "each other.",
        (1.0, 8.0, 14.0, 20.0, 26.0, 32.0),
    ),
    "trio": (
        "Pierrot enters and greets his friends; all three come forward and bow together.",
        (1.0, 8.0, 16.0, 24.0, 31.0, 34.5),
    ),
}
"""Play -> caption, and the times of the poses in its strip [s]."""
PLAY_SPEED = 4.0
"""Seconds of a play per second of its film."""


def perform_piece(piece: Piece) -> tuple[fan.Marionette, Trajectory]:
    """The puppet of a piece and its motion."""
    marionette = getattr(fan.puppets, piece.puppet)()
    method = "event" if piece.dt is None else fan.TimeStepping(dt=piece.dt)
    if piece.inputs is None:
        return marionette, fan.simulate(
            marionette, marionette.state(piece.start), None, piece.duration
        )
    path, x0 = ROOT / PERFORMANCES / f"{piece.inputs}.yaml", marionette.rest()
    score = fan.load_score(marionette, path) if is_score(path) else None
    inputs = fan.Input.load(marionette, path) if score is None else score.inputs(x0)
    return marionette, fan.simulate(
        marionette,
        x0,
        inputs,
        piece.duration,
        method=method,
        save_every=None if piece.dt is None else 4,
    )


def draw_piece(piece: Piece, marionette: fan.Marionette, run: Trajectory) -> None:
    """Writes strip of a piece, and its film if it has one."""
    other = {"dark": "light", "light": "dark"}[piece.theme]
    view.strip(
        marionette,
        run,
        PICTURES / f"{piece.puppet}.png",
        times=piece.times,
        view=piece.view,
        theme=other,
        scale=0.6,
    )
    if piece.part is None:
        return
    start, stop = piece.part
    times = np.arange(start, stop, piece.speed / FPS)
    view.film(
        marionette,
        run.resample(times),
        PICTURES / f"{piece.puppet}.gif",
        fps=FPS,
        size=piece.size,
        view=piece.view,
        focus=piece.focus,
        theme=piece.theme,
        speed=piece.speed,
    )


def draw_play(name: str) -> None:
    """Writes strip and film of a bundled play."""
    play = fan.load_play(name)
    run = fan.theatre.verify_play(play).run
    _, times = PLAYS[name]
    times = tuple(t for t in times if t < run.t[-1])
    view.strip(
        play.marionette, run, PICTURES / f"{name}.png", times=times, view=view.AUDIENCE, scale=0.4
    )
    if name == "trio":  # docs/plays.md
        view.strip(
            play.marionette,
            run,
            PICTURES.parent / "theatre.png",
            times=times[-1:],
            view=(14.0, 8.0),
            size=(760, 480),
            scale=1.0,
            look="stage",
        )
    part = run.resample(np.arange(0.0, run.t[-1], PLAY_SPEED / FPS))
    view.film(
        play.marionette,
        part,
        PICTURES.parent / f"{name}.mp4",
        fps=FPS,
        size=(400, 320),
        view=view.AUDIENCE,
        theme="dark",
        speed=PLAY_SPEED,
        captions=play.score.captions,
    )


def draw_plan() -> None:
    """Writes picture and film of the bundled plan."""
    plan = fan.control.solve(fan.control.load_problem(ROOT / PROBLEM), seed=0).polish()
    plan.plot(PICTURES / "arm3d_boxes.png", size=(640, 640), scale=1.0)
    plan.animate(PICTURES / "arm3d_boxes.gif", fps=FPS, size=(320, 320))


def draw_number() -> None:
    """Writes the films of the number to music: as a picture, and with its sound."""
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        names = runpy.run_path(str(ROOT / NUMBER))
        score, run = names["score"], names["found"].run
        options = {"focus": "bodies", "theme": "dark", "captions": score.captions}
        view.film(
            names["puppet"],
            run,
            PICTURES.parent / "number.mp4",
            fps=20.0,
            size=(240, 300),
            sounds=score.sounds,
            **options,
        )
        part = run.resample(np.arange(9.4, 25.4, 0.25))
        view.film(
            names["puppet"],
            part,
            PICTURES / "number.gif",
            fps=10.0,
            size=(192, 240),
            speed=2.5,
            **options,
        )


def page() -> str:
    """The text of docs/gallery.md."""
    parts = [_HEAD]
    for piece in PIECES:
        pace = "" if piece.speed == 1.0 else f", {piece.speed:g} times as fast"
        film = note = ""
        if piece.part is not None:
            film = f"![{piece.puppet}: film](pictures/gallery/{piece.puppet}.gif)\n\n"
            note = f"Film: {piece.part[0]:g} to {piece.part[1]:g} s{pace}. "
        parts.append(
            f"## {piece.puppet}\n\n{piece.text}\n\n{film}"
            f"![{piece.puppet}: poses](pictures/gallery/{piece.puppet}.png)\n\n"
            f"{note}The motion:\n\n```\n{piece.command}\n```\n"
        )
    plays = [
        f"## A play: {name}\n\n{text} It is written in "
        f"[{_lines(name)} lines](../src/fantoccini/theatre/plays/repertory/{name}.yaml); see "
        f"[Plays](plays.md).\n\n![{name}: poses](pictures/gallery/{name}.png)\n\n[Film](pictures/"
        f"{name}.mp4): the whole play, {PLAY_SPEED:g} times as fast. The play:\n\n```\n"
        f"fantoccini play {name} --out {name}.mp4\n```\n"
        for name, (text, _) in PLAYS.items()
    ]
    return "\n".join([*parts, *plays, _NUMBER, _PLAN])


def _lines(name: str) -> int:
    path = ROOT / "src" / "fantoccini" / "theatre" / "plays" / "repertory" / f"{name}.yaml"
    return len(path.read_text(encoding="utf-8").splitlines())


_HEAD = """# Gallery

After this page you know the bundled puppets, scenes and motions, and the commands that film them.
`make gallery` draws the page without a GPU or a display. The colour of a string is its tension;
grey is slack. Run the commands in the root of the repository; they film at full size. The motions
are files in [`performances`](../src/fantoccini/model/puppets/performances), to read and change.
"""

_NUMBER = f"""## A number to music

Half a minute, [written in 36 lines](../examples/20_number.yaml): the marionette marches, waves,
claps, points, leaps and bows on the beats of music from [the example](../{NUMBER}). It
rehearses until its limbs turn on the beat in the simulation; see [Gestures and
scores](gestures.md).

![number: film](pictures/gallery/number.gif)

Film: 9.4 to 25.4 s, 2.5 times as fast and silent. [The whole number with its
music](pictures/number.mp4). The number:

```
python {NUMBER}
```
"""

_PLAN = """## A plan: arm3d_boxes

The paper's planning problem: from hanging, past two boxes, to rest with the hand lifted. Dots are
the nodes of the search tree, the line is the path of the plan; see [Planning](planning.md).

![arm3d_boxes: film](pictures/gallery/arm3d_boxes.gif)

![arm3d_boxes: tree, path and poses](pictures/gallery/arm3d_boxes.png)

```
fantoccini plan arm3d_boxes --improve 1 --picture plan.png --out plan.mp4
```
"""


def main() -> None:
    parser = argparse.ArgumentParser(description="Draws and films the bundled puppets.")
    parser.add_argument("only", nargs="*", help="puppets to draw; by default all")
    only = parser.parse_args().only
    PICTURES.mkdir(parents=True, exist_ok=True)
    for piece in PIECES:
        if not only or piece.puppet in only:
            draw_piece(piece, *perform_piece(piece))
            print(piece.puppet, flush=True)
    for name in PLAYS:
        if not only or name in only:
            draw_play(name)
            print(name, flush=True)
    if not only or "number" in only:
        draw_number()
    if not only:
        draw_plan()
    PAGE.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
