"""``fantoccini mapping``: writes a mapping file to fill in."""

from __future__ import annotations

import os
from pathlib import Path

from fantoccini.app.cli_support import Steps, check_output, fail, marionette, say, write, writing
from fantoccini.theatre.capture import load_bvh
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
    with Steps(quiet) as steps:
        steps.step(f"reading {clip}")
        read = load_bvh(clip)
        figure = None if puppet is None else marionette(puppet, steps.named)
    text = draft_mapping(read, figure)
    if out is None:
        write(text.rstrip("\n"))
        return
    with writing(out):
        out.write_text(text, encoding="utf-8")
    if not quiet:
        say(f"fantoccini: wrote {out}; check it, then: fantoccini follow --mapping {out}")
