"""Recordings in the previous format: every sample, event and point of contact."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import fantoccini as fan


def previous_format_arrays(recording: fan.theatre.Recording, path: Path) -> dict[str, np.ndarray]:
    """The arrays of a file of the format `fantoccini.recording.2`.

    Args:
        recording: recording without edits.
        path: path of a temporary file.
    """
    recording.save(path)
    with np.load(path) as file:
        arrays = {name: x for name, x in file.items() if name not in ("ticks", "checks")}
    about = arrays["about"].tobytes().replace(b"recording.3", b"recording.2")
    output = recording.output.piece
    return arrays | {
        "about": np.frombuffer(about, dtype=np.uint8),
        "rows": output.samples,
        "events": output.events,
        "contacts": output.contacts,
    }
