"""``fantoccini follow``: makes a puppet follow captured motion.

A clip is a captured motion. acc_K are the accelerations of the driven coordinates, the ends and
lengths of strings.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import typer

from fantoccini.app.cli.show import show_run
from fantoccini.app.cli_support import (
    FAILED,
    FollowArguments,
    ProgressDisplay,
    check_output,
    check_outputs,
    check_time_range,
    load_marionette,
    output_errors,
    print_message,
    print_output,
    print_table,
    puppet_path,
    write_outputs,
)
from fantoccini.theatre.capture import clip_path, load_bvh
from fantoccini.theatre.perform import Recording
from fantoccini.theatre.retarget import (
    MAX_ACCELERATION,
    MAX_ERROR,
    MAX_SPEED,
    FollowResult,
    FollowStatus,
    follow_clip,
    place_clip,
)

_TIME_STEP = 0.004
"""Time step of the saved recording [s]."""


def follow_file(arguments: FollowArguments) -> None:
    """Makes a puppet follow a clip, prints a report and writes the outputs.

    Exits with 1 if the puppet does not follow the clip to its end.
    """
    out = arguments.out or []
    check_outputs(out, None)
    arguments.output_options.check(out, None)
    if arguments.save is not None:
        check_output(arguments.save, (".npz",), "--save")
    path = clip_path(arguments.clip)
    puppet_path(arguments.file)  # a wrong name is an error before the clip is read
    with ProgressDisplay(arguments.quiet) as display:
        display.stage(f"reading {arguments.clip}")
        clip = load_bvh(path)
        for note in clip.notes:
            print_message(note)
        check_time_range(arguments.begin, arguments.end, float(clip.t[0]), float(clip.t[-1]))
        puppet = load_marionette(arguments.file, display.update)
        placed_clip = place_clip(
            puppet,
            clip,
            arguments.mapping,
            travel=arguments.travel,
            up=arguments.up and arguments.up.value,
            of=arguments.of,
            begin=arguments.begin,
            end=arguments.end,
        )
        for note in placed_clip.clip.notes[len(clip.notes) :]:
            print_message(note)
        followed = follow_clip(
            puppet,
            placed_clip,
            speed=arguments.speed or MAX_SPEED,
            acceleration=arguments.acceleration or MAX_ACCELERATION,
            progress=display.bar("following"),
        )
        if arguments.save is not None:
            display.stage(f"writing {arguments.save}")
            with output_errors(arguments.save):
                _recording(followed).save(arguments.save)
        guides = followed.guides if arguments.guides else None
        write_outputs(
            puppet,
            followed.run,
            out,
            None,
            display,
            output_options=arguments.output_options,
            guides=guides,
        )
    if not arguments.quiet:
        _print_report(followed)
    if arguments.show:
        show_run(puppet, followed.run, arguments.quiet)
    for remark in _remarks(followed):
        print_message(f"fantoccini: {remark}")
    if followed.status is FollowStatus.STOPPED:
        print_message(f"fantoccini: {followed.status.message}: {followed.run.status}")
    if not followed:
        raise typer.Exit(FAILED)


def _remarks(followed: FollowResult) -> Iterator[str]:
    """Remarks that explain the numbers in the report."""
    for remark in followed.retargeted.remarks:
        yield f"{remark} (--up)"
    if followed.pose_error > MAX_ERROR:
        yield (
            "the strings cannot hold the poses of the clip: the error is "
            f"{100 * followed.pose_error:.0f} % of the puppet's height; try --travel 0, or "
            "another puppet"
        )
    elif followed.status is FollowStatus.DIVERGED:
        worst = max(followed.report, key=lambda part: part.run_error)
        yield (
            f"the puppet does not follow: the error of its {worst.name} is "
            f"{1e3 * worst.run_error:.0f} mm (root mean square), {100 * followed.error:.0f} % of "
            f"its height; that of hanging poses is {1e3 * worst.pose_error:.0f} mm; try slower "
            "hands (--speed, --acceleration), a slower clip, or another puppet"
        )
    if followed.losses:
        longest = max(followed.losses, key=lambda loss: loss.end - loss.begin)
        count = len(followed.losses)
        yield f"{longest}" if count == 1 else f"{longest}; {count} such times in all"
    if followed.bound_factor < 1.0:
        yield (
            "the puppet cannot follow with the full speed and acceleration of the hands; they use "
            f"{100 * followed.bound_factor:.0f} % of them"
        )
    if followed.crossings:
        first_crossing = followed.crossings[0]
        yield (
            f"strings pass through each other {len(followed.crossings)} times, which real strings "
            f"cannot: first {first_crossing}"
        )


def _recording(followed: FollowResult) -> Recording:
    return Recording(
        followed.retargeted.marionette,
        followed.run.state(0),
        followed.acc_K,
        followed.interval,
        round(followed.interval / _TIME_STEP),
    )


def _print_report(followed: FollowResult) -> None:
    retargeted = followed.retargeted
    speed, acceleration = abs(followed.run.v_K).max(), abs(followed.acc_K).max()
    print_table(
        "Clip",
        ("", ">"),
        [
            ("duration [s]", f"{retargeted.clip.duration:.4g}"),
            (
                "duration of the run, which starts and ends slowly and comes to rest [s]",
                f"{followed.run.duration:.4g}",
            ),
            ("frames, settled poses", f"{len(retargeted.t)}, {retargeted.settled}"),
            ("size relative to the person", f"{retargeted.targets.scale:.3g}"),
            ("fastest driven coordinate [m/s, rad/s]", f"{speed:.3g}"),
            ("largest acceleration [m/s^2, rad/s^2]", f"{acceleration:.3g}"),
            ("computing time [s]", f"{followed.computing_time:.3g}"),
        ],
    )
    height = retargeted.figure.height
    print_table(
        f"Distance from the clip, root mean square; the puppet is {1e3 * height:.0f} mm high",
        (
            "",
            "distance [mm]>",
            "largest [mm]>",
            "of the height [%]>",
            "hanging still [%]>",
            "added by motion [%]>",
        ),
        [
            (
                part.name,
                f"{1e3 * part.run_error:.1f}",
                f"{1e3 * part.max_run_error:.1f}",
                f"{100 * part.run_error / height:.1f}",
                f"{100 * part.pose_error / height:.1f}",
                f"{100 * part.excess:.1f}",
            )
            for part in followed.report
        ],
    )
    print_table(
        "Bending: ranges of the angles, root mean square of their difference [deg]",
        ("", "clip>", "run>", "difference>"),
        [
            (bend.name, *(f"{np.degrees(x):.0f}" for x in (bend.clip, bend.run, bend.error)))
            for bend in followed.bends
        ],
    )
    worst = max(followed.report, key=lambda part: part.run_error)
    print_output(
        f"up to {100 * followed.error:.1f} % of the height from the clip ({worst.name}); hanging "
        "still in the nearest poses that its strings allow: "
        f"{100 * worst.pose_error / height:.1f} %"
    )
