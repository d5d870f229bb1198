"""``fantoccini follow``: a puppet that follows captured motion."""

from __future__ import annotations

from collections.abc import Iterator

import typer

from fantoccini.app.cli.show import show_run
from fantoccini.app.console import (
    FAILED,
    FollowRequest,
    Steps,
    check_output,
    check_outputs,
    marionette,
    say,
    table,
    write_outputs,
    writing,
)
from fantoccini.theatre.capture import load_bvh
from fantoccini.theatre.perform import Recording
from fantoccini.theatre.retarget import (
    ACCELERATION,
    MAX_ERROR,
    SPEED,
    Followed,
    FollowStatus,
    follow_clip,
    place_clip,
)

_STEP = 0.004
"""Time step of the recording that is saved [s]."""


def follow_file(request: FollowRequest) -> None:
    """Follows a clip, prints a report and writes the outputs.

    Exit code 1 where the puppet does not follow the clip to its end.
    """
    out = request.out or []
    check_outputs(out, None)
    request.look.check(out, None)
    if request.save is not None:
        check_output(request.save, (".npz",), "--save")
    with Steps(request.quiet) as steps:
        steps.step(f"reading {request.clip}")
        clip = load_bvh(request.clip)
        for note in clip.notes:
            say(note)
        puppet = marionette(request.file, steps.named)
        placed = place_clip(
            puppet,
            clip,
            request.mapping,
            travel=request.travel,
            up=request.up and request.up.value,
            of=request.of,
        )
        followed = follow_clip(
            puppet,
            placed,
            speed=request.speed or SPEED,
            acceleration=request.acceleration or ACCELERATION,
            progress=steps.bar("following"),
        )
        if request.save is not None:
            steps.step(f"writing {request.save}")
            with writing(request.save):
                _recording(followed).save(request.save)
        guides = followed.guides if request.guides else None
        write_outputs(puppet, followed.run, out, None, steps, look=request.look, guides=guides)
    if not request.quiet:
        _report(followed)
    if request.show:
        show_run(puppet, followed.run, request.quiet)
    for remark in _remarks(followed):
        say(f"fantoccini: {remark}")
    if followed.status is FollowStatus.STOPPED:
        say(f"fantoccini: {followed.status.message}: {followed.run.status}")
    if not followed:
        raise typer.Exit(FAILED)


def _remarks(followed: Followed) -> Iterator[str]:
    """Remarks that explain the figures of the report."""
    for remark in followed.retargeted.remarks:
        yield f"{remark} (--up)"
    if followed.hanging_far > MAX_ERROR:
        yield (
            f"the puppet cannot hang as the clip shows: {100 * followed.hanging_far:.0f} % of its "
            "height off; try --travel 0, or another puppet"
        )
    elif followed.status is FollowStatus.ASTRAY:
        worst = max(followed.report, key=lambda part: part.run)
        yield (
            f"the puppet does not follow: its {worst.name} are {1e3 * worst.run:.0f} mm off (root "
            f"mean square), {100 * followed.far:.0f} % of its height, where hanging poses are "
            f"{1e3 * worst.reach:.0f} mm off; try slower hands (--speed, --acceleration), a slower "
            "clip, or another puppet"
        )
    if followed.share < 1.0:
        yield (
            "the puppet went astray within the bounds of speed and acceleration; the hands use "
            f"{100 * followed.share:.0f} % of them"
        )
    if followed.crossings:
        first = followed.crossings[0]
        yield (
            f"strings pass through one another {len(followed.crossings)} times, which real strings "
            f"cannot do: first {first}"
        )


def _recording(followed: Followed) -> Recording:
    return Recording(
        followed.retargeted.marionette,
        followed.run.state(0),
        followed.acc_K,
        followed.interval,
        round(followed.interval / _STEP),
    )


def _report(followed: Followed) -> None:
    found = followed.retargeted
    speed, acceleration = abs(followed.run.v_K).max(), abs(followed.acc_K).max()
    table(
        "Clip",
        ("", ">"),
        [
            ("duration [s]", f"{found.clip.duration:.4g}"),
            ("frames, and poses that settled", f"{len(found.t)}, {found.settled}"),
            ("size of the puppet, of the person's", f"{found.places.scale:.3g}"),
            ("fastest driven coordinate [m/s, rad/s]", f"{speed:.3g}"),
            ("largest acceleration [m/s^2, rad/s^2]", f"{acceleration:.3g}"),
            ("time [s]", f"{followed.seconds:.3g}"),
        ],
    )
    table(
        "Distance from the clip, root mean squares [mm]",
        ("", "hanging>", "in motion>", "largest>", "more, of the height>"),
        [
            (
                one.name,
                f"{1e3 * one.reach:.1f}",
                f"{1e3 * one.run:.1f}",
                f"{1e3 * one.largest:.1f}",
                f"{100 * one.above:.1f} %",
            )
            for one in followed.report
        ],
    )
