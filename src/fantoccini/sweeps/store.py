"""The folder of a sweep: a file for each finished case, so that a sweep goes on where it stopped.

    sweep.json             what all cases have in common: study, seed, names of the values
    cases/ab/ab12....npz   one case: its figures, or why it failed; no pickle

Files are written under a temporary name and renamed, so that one with a case's name is whole or was
damaged afterwards; a damaged one counts as not there. A case's name is a digest of its values: a
grid that has grown finds the cases it had before.
"""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np

from fantoccini.errors import StoreError
from fantoccini.files import replacing
from fantoccini.motion.npz import ABOUT, UNREADABLE, about_of, read
from fantoccini.sweeps.outcome import Failure, Outcome

FORMAT = "fantoccini.sweep.1"
MANIFEST = "sweep.json"
_FIGURE = "figure:"


class Store:
    """A sweep's folder; made when it is not there.

    Args:
        folder: where; its parent folders are made too.
        manifest: what all cases have in common, as JSON-able data. A folder with other contents is
            never written to.

    Raises:
        StoreError: the folder is another sweep's, or somebody else's.
    """

    def __init__(self, folder: str | Path, manifest: dict[str, Any]):
        self.folder = Path(folder)
        self._manifest = {"format": FORMAT, **manifest}
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._check()
        except OSError as error:
            raise StoreError(f"the store {self.folder} cannot be used: {error}") from error

    def read(self, key: str) -> Outcome | None:
        """What is stored of a case; None where that is nothing, or damaged."""
        try:
            arrays = read(self._place(key))
            about = about_of(arrays)
            figures = {n: arrays[f"{_FIGURE}{k}"] for k, n in enumerate(about["figures"])}
            if about["key"] != key:
                return None
            failure = None if about["failure"] is None else Failure(**about["failure"])
            return Outcome(figures, float(about["seconds"]), failure)
        except UNREADABLE:
            return None

    def write(self, key: str, outcome: Outcome, told: dict[str, Any]) -> None:
        """Keeps a case.

        Args:
            key: digest of its values.
            outcome: what it gave.
            told: its values as tables have them, for people who look into the file.

        Raises:
            StoreError: the disk is full, or the folder is gone.
        """
        about = {
            "key": key,
            "values": {name: str(label) for name, label in told.items()},
            "seconds": outcome.seconds,
            "figures": list(outcome.figures),
            "failure": outcome.failure and dataclasses.asdict(outcome.failure),
        }
        arrays = {f"{_FIGURE}{k}": x for k, x in enumerate(outcome.figures.values())}
        arrays[ABOUT] = np.frombuffer(json.dumps(about).encode(), dtype=np.uint8)
        place = self._place(key)
        try:
            place.parent.mkdir(parents=True, exist_ok=True)
            with replacing(place) as temporary, temporary.open("wb") as file:
                np.savez(file, **arrays)
        except OSError as error:
            raise StoreError(
                f"a finished case cannot be kept in {self.folder}: {error}; those before it are "
                "kept; make room and run the same sweep again"
            ) from error

    def _place(self, key: str) -> Path:
        return self.folder / "cases" / key[:2] / f"{key}.npz"

    def _check(self) -> None:
        """The folder is empty and becomes ours, or it is ours already."""
        place = self.folder / MANIFEST
        if not place.exists():
            if any(not file.name.endswith(".part") for file in self.folder.iterdir()):
                raise StoreError(
                    f"the store {self.folder} is not empty and holds no sweep ({MANIFEST} is "
                    "missing); give a folder of its own"
                )
            with replacing(place) as temporary:
                temporary.write_text(json.dumps(self._manifest, indent=1) + "\n", encoding="utf-8")
            return
        try:
            found = json.loads(place.read_bytes())
            names = {**self._manifest, **found}
            differ = [name for name in names if found.get(name) != self._manifest.get(name)]
        except (ValueError, TypeError) as error:
            raise StoreError(
                f"{place} is not the file that a sweep writes ({error}); give another folder"
            ) from None
        if differ:
            told = [
                f"{name} is {found.get(name)!r} there and {self._manifest.get(name)!r} here"
                for name in differ
                if name != "code"
            ]
            if not told:
                told = [
                    "the code or the settings of the study have changed since (with "
                    "version='1', you say yourself when its results become others)"
                ]
            raise StoreError(
                f"the store {self.folder} holds another sweep: {'; '.join(told)}; give another "
                "folder, or delete this one to begin anew"
            )
