"""``fantoccini mapping``: writes a mapping file to fill in.

A mapping says which joint of a captured skeleton is which part of a person.
"""

from __future__ import annotations

import os
from pathlib import Path

from fantoccini.app.cli_support import (
    ProgressDisplay,
    check_output,
    fail,
    load_marionette,
    output_errors,
    print_message,
    print_output,
)
from fantoccini.theatre.capture import clip_path, load_bvh
from fantoccini.theatre.retarget import draft_mapping


def write_mapping(clip: Path, puppet: str | None, out: Path | None, quiet: bool) -> None:
    """Writes or prints the mapping file of a clip.

    Args:
        clip: BVH file, or name of a bundled clip.
        puppet: PUPPET argument; its bodies are listed if they need names.
        out: file to write; None prints the text.
        quiet: print no progress.
    """
    if out is not None:
        check_output(out, (".yaml", ".yml"), "--out")
        if os.path.exists(out):
            fail(f"{out} exists already; give another name", "--out")
    path = clip_path(clip)
    with ProgressDisplay(quiet) as display:
        display.stage(f"reading {clip}")
        loaded_clip = load_bvh(path)
        marionette = None if puppet is None else load_marionette(puppet, display.update)
    text = draft_mapping(loaded_clip, marionette)
    if out is None:
        print_output(text.rstrip("\n"))
        return
    with output_errors(out):
        out.write_text(text, encoding="utf-8")
    if not quiet:
        print_message(f"fantoccini: wrote {out}; check it, then: fantoccini follow --mapping {out}")
