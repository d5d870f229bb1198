"""The generated text is the same every time, and its growth is recorded."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from fantoccini import puppets
from fantoccini.kernel.codegen import c99_files, generate, operations
from fantoccini.kernel.equations import derive
from fantoccini.model.puppet import load
from fantoccini.model.tree import grow

pytestmark = pytest.mark.medium

SOURCE = Path(__file__).resolve().parents[2] / "src"

OPERATIONS = {
    "airplane": {
        "dynamics": 6328,
        "step_dynamics": 6973,
        "effort": 1515,
        "energy": 1440,
        "rows": 760,
    },
    "arm2d": {"dynamics": 140, "step_dynamics": 121, "effort": 26, "energy": 46, "rows": 24},
    "arm3d": {"dynamics": 331, "step_dynamics": 337, "effort": 56, "energy": 98, "rows": 54},
    "crane": {"dynamics": 261, "step_dynamics": 277, "effort": 32, "energy": 68, "rows": 29},
    "dachshund": {
        "dynamics": 6019,
        "step_dynamics": 6793,
        "effort": 721,
        "energy": 1263,
        "rows": 750,
    },
    "dragon": {
        "dynamics": 8954,
        "step_dynamics": 10633,
        "effort": 1135,
        "energy": 1855,
        "rows": 1178,
    },
    "hans": {"dynamics": 5587, "step_dynamics": 6827, "effort": 642, "energy": 1237, "rows": 680},
    "heron": {"dynamics": 6818, "step_dynamics": 8326, "effort": 777, "energy": 1448, "rows": 829},
    "marionette": {
        "dynamics": 4727,
        "step_dynamics": 5579,
        "effort": 509,
        "energy": 1179,
        "rows": 545,
    },
    "marionette_bar": {
        "dynamics": 5471,
        "step_dynamics": 6143,
        "effort": 934,
        "energy": 1256,
        "rows": 650,
    },
    "stand6": {"dynamics": 5034, "step_dynamics": 5951, "effort": 0, "energy": 1179, "rows": 556},
    "string_pendulum": {"dynamics": 33, "step_dynamics": 23, "effort": 0, "energy": 6, "rows": 6},
}
"""Arithmetic operations of the compiled functions. Lower a number when the derivation or a puppet
gets simpler; raise it only for a reason given in the commit message.
"""

_HASHES = """
import hashlib, json, sys
from fantoccini import puppets
from fantoccini.kernel.codegen import c99_files, generate
from fantoccini.kernel.equations import derive
from fantoccini.model.puppet import load
from fantoccini.model.tree import grow
equations = derive(grow(load(puppets.path("arm2d"))))
files = generate(equations).files | c99_files(equations)
hashes = {n: hashlib.sha256(t.encode()).hexdigest() for n, t in files.items()}
print(json.dumps(hashes))
"""


def equations_of(name: str):
    return derive(grow(load(puppets.path(name))))


def test_every_process_derives_the_same_text(tmp_path):
    """Names of model.c depend on no path, no order of hashing and no time."""
    hashes = []
    for seed in ("1", "2"):
        folder = tmp_path / seed
        folder.mkdir()
        environment = {**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": str(SOURCE)}
        printed = subprocess.run(
            [sys.executable, "-c", _HASHES],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        hashes.append(json.loads(printed))
    equations = equations_of("arm2d")
    files = generate(equations).files | c99_files(equations)
    assert hashes[0] == hashes[1]
    assert hashes[0] == {n: hashlib.sha256(t.encode()).hexdigest() for n, t in files.items()}


def test_deriving_twice_in_one_process_gives_the_same_text():
    assert generate(equations_of("arm3d")).files == generate(equations_of("arm3d")).files


def test_every_bundled_puppet_has_a_recorded_count():
    assert sorted(OPERATIONS) == sorted(puppets.names())


@pytest.mark.parametrize("name", sorted(OPERATIONS))
def test_a_bundled_puppet_needs_no_more_operations_than_recorded(name):
    model = equations_of(name)
    counts = operations(model)
    counted = {f: counts[f] for f in OPERATIONS[name]}
    grown = {f: n for f, n in counted.items() if n > OPERATIONS[name][f]}
    assert grown == {}
