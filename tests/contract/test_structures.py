"""Structures and codes have the same layout in C++ and in ctypes."""

from __future__ import annotations

import ctypes
import subprocess

import pytest

from cpp.toolchain import gcc
from fantoccini.base.errors import Status
from fantoccini.dynamics.compiled import active_set
from fantoccini.dynamics.marionette.puppets import arm2d
from fantoccini.kernel.build import runtime_folder
from fantoccini.kernel.contract import (
    CONSTANTS,
    ENERGY_TERMS,
    PARTS,
    SAMPLE,
    STRUCTURES,
    EventCode,
    identity,
    width,
)
from fantoccini.kernel.contract.cpp import header
from fantoccini.kernel.runtime.clearance import SOLID
from fantoccini.kernel.runtime.structures import structures


def offsets(structure) -> list[int]:
    """Offsets of the fields, then the size of the structure."""
    fields = structures[structure.name]
    return [getattr(fields, f.name).offset for f in structure.fields] + [ctypes.sizeof(fields)]


def test_the_fields_are_where_cpp_has_them(tmp_path):
    """One declaration, the same layout in both languages."""
    lines = ["#include <cstddef>", '#include "fantoccini/contract.hpp"', "using namespace fan;"]
    for s in STRUCTURES:
        expressions = [f"offsetof({s.name}, {f.name})" for f in s.fields] + [f"sizeof({s.name})"]
        places = zip(expressions, offsets(s), strict=True)
        lines += [f'static_assert({e} == {n}, "{e}");' for e, n in places]
    lines += [f'static_assert({m.name} == {m.value}, "");' for m in (*Status, *EventCode)]
    file = tmp_path / "layout.cpp"
    file.write_text("\n".join(lines), encoding="ascii")
    command = [gcc(), "-std=c++17", "-fsyntax-only", "-I", str(runtime_folder()), str(file)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:2000]


def test_the_header_has_the_constants_of_python():
    """Gaps were closed up to 1e-12 in Python, up to 5e-13 in compiled code."""
    for name, x in CONSTANTS.items():
        assert f"  static constexpr double {name} = {float(x)!r};" in header()
    tolerances = active_set.ROW_TOLERANCES
    assert (tolerances.closed_gap, tolerances.start_gap, tolerances.rest_speed) == (
        CONSTANTS["closed_gap"],
        CONSTANTS["start_gap"],
        CONSTANTS["rest_speed"],
    )
    arm = arm2d()
    assert arm.tension_cap == CONSTANTS["tension_cap"] * arm.weight


def test_no_other_header_repeats_them():
    """The size of forces in the runtime once replaced Python's 1e5 by its own 1e-5."""
    owners = {
        "event/flow.hpp": ("closed_gap", "min_scale_length", "tension_cap"),
        "event/instants.hpp": ("start_gap",),
        "event/attempts.hpp": ("rest_speed",),
        "model/winch.hpp": ("winch_deceleration",),
        "collision/hull.hpp": ("hull_vertices",),
    }
    assert sorted(name for names in owners.values() for name in names) == sorted(CONSTANTS)
    for file, names in owners.items():
        text = (runtime_folder() / "fantoccini" / file).read_text(encoding="utf-8")
        assert all(f"Constants::{name}" in text for name in names), file


def test_numpy_has_solids_as_they_are():
    solid = next(s for s in STRUCTURES if s.name == "Solid")
    assert [SOLID.fields[f.name][1] for f in solid.fields] + [SOLID.itemsize] == offsets(solid)


def test_an_integer_that_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="n_segments is 2147483648"):
        structures["InputArrays"](n_segments=2**31)


def test_the_parts_of_a_batch_are_a_row_behind_its_time():
    """Event-driven batches copy rows part by part."""
    sizes = arm2d().tree.sizes
    assert width(PARTS, sizes) + 1 == width(SAMPLE, sizes)
    assert tuple(q.name for q in SAMPLE[9:16]) == ENERGY_TERMS


def test_wording_does_not_change_the_digest(monkeypatch):
    """Names, shapes, types and codes make the digest."""
    before = identity.digest()
    for change in (STRUCTURES[1:], STRUCTURES[::-1]):
        identity.digest.cache_clear()
        monkeypatch.setattr(identity, "STRUCTURES", change)
        assert identity.digest() != before
    monkeypatch.undo()
    identity.digest.cache_clear()
    assert identity.digest() == before
