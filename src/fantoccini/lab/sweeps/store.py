"""The folder of a sweep: one file per finished case, so that an interrupted sweep can resume.

    sweep.json             properties that all cases share: study, seed, names of the values
    cases/ab/ab12....npz   one case: its figures, or its failure; no pickle

Files are written under a temporary name and renamed, so a file with a case's name is complete. A
damaged one counts as missing. A case's name is a digest of its values, so a larger grid reuses the
cases of a smaller one.

A case is one combination of values; its figures are the numbers that the study returned for it.
"""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

from fantoccini.base import StoreError, npz, replacing
from fantoccini.lab.sweeps.outcome import Failure, Outcome

FORMAT = "fantoccini.sweep.1"
MANIFEST = "sweep.json"
FIGURE_PREFIX = "figure:"


class Store:
    """A sweep's folder; created, with its parents, if it does not exist.

    Args:
        folder: its path.
        manifest: properties that all cases share, as data for JSON. A folder with another manifest
            is never written to.

    Raises:
        StoreError: the folder belongs to another sweep, or holds something else.
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
        """The stored outcome of a case; None if it is missing or damaged."""
        try:
            arrays = npz.read(self._path(key))
            metadata = npz.about_of(arrays)
            figures = {n: arrays[f"{FIGURE_PREFIX}{k}"] for k, n in enumerate(metadata["figures"])}
            if metadata["key"] != key:
                return None
            failure = None if metadata["failure"] is None else Failure(**metadata["failure"])
            return Outcome(figures, float(metadata["seconds"]), failure)
        except npz.UNREADABLE:
            return None

    def write(self, key: str, outcome: Outcome, labels: dict[str, Any]) -> None:
        """Writes the outcome of a case.

        Args:
            key: digest of its values.
            outcome: the outcome.
            labels: names of its values, for people who open the file.

        Raises:
            StoreError: the disk is full, or the folder is gone.
        """
        metadata = {
            "key": key,
            "values": {name: str(label) for name, label in labels.items()},
            "seconds": outcome.seconds,
            "figures": list(outcome.figures),
            "failure": outcome.failure and dataclasses.asdict(outcome.failure),
        }
        arrays = {
            f"{FIGURE_PREFIX}{k}": figure for k, figure in enumerate(outcome.figures.values())
        }
        path = self._path(key)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            npz.write(path, arrays, metadata)
        except OSError as error:
            raise StoreError(
                f"cannot write a finished case to {self.folder}: {error}; earlier cases are kept; "
                "free some space and run the same sweep again"
            ) from error

    def _path(self, key: str) -> Path:
        return self.folder / "cases" / key[:2] / f"{key}.npz"

    def _check(self) -> None:
        """Claims an empty folder, or checks that it belongs to this sweep."""
        path = self.folder / MANIFEST
        if not path.exists():
            if any(not file.name.endswith(".part") for file in self.folder.iterdir()):
                raise StoreError(
                    f"the store {self.folder} is not empty and holds no sweep ({MANIFEST} is "
                    "missing); give an empty folder"
                )
            with replacing(path) as temporary:
                temporary.write_text(json.dumps(self._manifest, indent=1) + "\n", encoding="utf-8")
            return
        try:
            stored = json.loads(path.read_bytes())
            names = {**self._manifest, **stored}
            differing = [name for name in names if stored.get(name) != self._manifest.get(name)]
        except (ValueError, TypeError) as error:
            raise StoreError(
                f"{path} was not written by a sweep ({error}); give another folder"
            ) from None
        if differing:
            reasons = [
                f"{name} is {stored.get(name)!r} there and {self._manifest.get(name)!r} here"
                for name in differing
                if name != "code"
            ] or ["the code or the settings of the study have changed (version='1' disables this)"]
            raise StoreError(
                f"the store {self.folder} holds another sweep: {'; '.join(reasons)}; give another "
                "folder, or delete this one to start over"
            )
