"""``fantoccini validate-reduction``: what it prints and leaves; the measuring has its own tests."""

from __future__ import annotations

import numpy as np
import pytest
from tests.cli.command import fantoccini, mistake

import fantoccini as fan
from fantoccini import puppets
from fantoccini.cli import reduction
from fantoccini.reduction.bandwidth import TrackingRun
from fantoccini.reduction.claims import claims, meaning
from fantoccini.reduction.deviation import Deviation
from fantoccini.reduction.exact import Comparison, SharedCatch
from fantoccini.reduction.file_drives import FileDrives
from fantoccini.reduction.heavy_string import HeavyString
from fantoccini.reduction.structure import structure


def report() -> fan.ReductionReport:
    """Of arm2d, with figures that are made up but for the structure."""
    arm = puppets.arm2d()
    found = structure(arm, np.ones(2), n=2)
    t, runs = np.linspace(0.0, 1.0, 5), []
    for w in (50.0, 100.0, 200.0):
        runs.append(TrackingRun(w, Deviation(t, t / w**2, 0.1 * t / w**2)))
    exact = ("event", 1e-8, 1e-9), ("event", 1e-12, 0.0), ("variational", 0.004, 1e-5)
    return fan.ReductionReport(
        name="arm2d", driven=arm.coordinates.v_K, mass=arm.mass, structure=found,
        claims=claims(found), meaning=tuple(meaning(found)), duration=1.0, first_impact=1.0,
        comparisons=tuple(Comparison(m, s, Deviation(t, x * t, 0.1 * x * t)) for m, s, x in exact),
        catches=tuple(
            SharedCatch(r, "hand", 1.0 - 0.1 / r, 1.0, 0.1 / r, 0.01 / r) for r in (1.0, 10.0, 1e2)
        ),
        tracking=tuple(runs),
        heavy_strings=(HeavyString("hand", 0.01, 0.02, runs[-1].deviation, tuple(runs[1:])),),
        missing=("a | line with [red]markup[/red]",),
        file_drives=FileDrives(
            ("hand.length",), Deviation(t, 0.01 * t, 0.0 * t), 0.002 * t[:, None], np.array([3.0])
        ),
    )  # fmt: skip


@pytest.fixture
def quick(monkeypatch):
    """No measuring."""
    monkeypatch.setattr(reduction, "validate_reduction", lambda *_: report())


def test_prints_a_verdict_and_tables_and_leaves_the_report(quick, tmp_path):
    done = fantoccini("validate-reduction", "arm2d", "--out", tmp_path / "made" / "here")
    assert done.exit_code == 0, done.stderr
    text = " ".join(done.stdout.split())
    for part in (
        "block diagonal in [q_D, q_K]", "(a) fails: <X_i, X_j>", "at rtol 1e-12",
        "to the power -1.00", "to the power -2.00", "with hand of 0.01 kg",
        "on the file's own drives they differ by 0.01 (m, rad)", "hand.length",
        "not measured: a | line with [red]markup[/red]",
    ):  # fmt: skip
        assert part in text
    left = {p.name for p in (tmp_path / "made" / "here").iterdir()}
    pictures = {"exact_tracking.png", "catches.png", "bandwidth.png", "string_mass.png"}
    assert left == {"reduction.md", *pictures}
    page = (tmp_path / "made" / "here" / "reduction.md").read_text(encoding="utf-8")
    assert all(f"]({name})" in page for name in pictures)
    assert "M_DK = 0  (2 x 2)" in page
    assert "\x1b" not in page


def test_quiet_leaves_the_report_and_says_nothing(quick, tmp_path):
    done = fantoccini("validate-reduction", "arm2d", "--out", tmp_path, "--quiet")
    assert (done.exit_code, done.stdout, done.stderr) == (0, "", "")
    assert (tmp_path / "reduction.md").is_file()


WRONG = {
    "a name like a bundled one": (["marionete"], "did you mean 'marionette'?"),
    "a file in place of a folder": (["arm2d", "--out", "file"], "file is a file"),
    "a folder below a file": (["arm2d", "--out", "file/below"], "file"),
    "no file": ([], "Missing argument"),
    "an unknown option": (["arm2d", "--bogus"], "No such option"),
}


@pytest.mark.parametrize(("arguments", "message"), WRONG.values(), ids=WRONG)
def test_wrong_arguments_are_mistakes(arguments, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("")
    assert message in " ".join(mistake("validate-reduction", *arguments).split())
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_a_puppet_without_driven_coordinates_is_a_mistake(tmp_path):
    said = mistake("validate-reduction", "string_pendulum", "--quiet", "--out", tmp_path)
    assert "string_pendulum.yaml" in said and "no coordinate is driven" in said
    assert list(tmp_path.iterdir()) == []
