"""Report of a measurement with invented figures: its page, plots and results."""

from __future__ import annotations

import numpy as np
import sympy as sp
from benchmarks.section_vi import __main__ as command
from benchmarks.section_vi.bandwidth import TrackingRun
from benchmarks.section_vi.deviation import Deviation
from benchmarks.section_vi.exact import Comparison, SharedCatch
from benchmarks.section_vi.file_drives import FileDrives
from benchmarks.section_vi.heavy_string import HeavyString
from benchmarks.section_vi.page import page
from benchmarks.section_vi.report import SectionReport
from benchmarks.section_vi.symbolic import symbolic_blocks

import fantoccini as fan
from fantoccini import puppets
from lab.toys import CART


def invented_report(puppet: fan.Marionette) -> SectionReport:
    """Report with invented figures; only the puppet's structure is real."""
    t, runs = np.linspace(0.0, 1.0, 5), []
    for w in (50.0, 100.0, 200.0):
        runs.append(TrackingRun(w, Deviation(t, t / w**2, 0.1 * t / w**2)))
    exact = ("event", 1e-8, 1e-9), ("event", 1e-12, 0.0), ("variational", 0.004, 1e-5)
    return SectionReport(
        reduction=fan.lab.validate_reduction(puppet),
        symbolic=symbolic_blocks(puppet),
        mass=puppet.mass,
        duration=1.0,
        first_impact=1.0,
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
    )


def test_the_command_leaves_the_page_of_a_puppet_with_its_plots(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(command, "measure", lambda puppet, *_: invented_report(puppet))
    command.write_report("arm2d", None, tmp_path / "made" / "here")
    pictures = {"exact_tracking.png", "catches.png", "bandwidth.png", "string_mass.png"}
    assert {p.name for p in (tmp_path / "made" / "here").iterdir()} == {"reduction.md", *pictures}
    text = (tmp_path / "made" / "here" / "reduction.md").read_text(encoding="utf-8")
    assert all(f"]({name})" in text for name in pictures)
    assert "M_DK = 0  (2 x 2)" in text and "| hand.length |" in text
    output = capsys.readouterr().out
    for line in (
        "(a) fails: <X_i, X_j>",
        "(a) yes: the mixed model is exact",
        "at rtol 1e-12",
        "to the power -1.00",
        "to the power -2.00",
        "with hand of 0.01 kg",
        "on the file's own drives they differ by 0.01 (m, rad)",
        "not measured: a | line with [red]markup[/red]",
    ):
        assert line in " ".join(output.split()) and line in " ".join(text.split())


def test_the_page_has_a_row_for_every_puppet():
    boom = fan.load(command.BOOM)
    text = page([invented_report(puppets.arm2d()), invented_report(boom)], "chains", "machine")
    assert "| arm2d | holds | holds | holds | holds | **fails** |" in text
    assert "| boom | **fails** | holds | **fails** | holds | **fails** |" in text
    assert text.count("\n| boom | ") == 7
    assert "| puppet | rtol 1e-08 | rtol 1e-12 | variational, 4 ms |" in text
    assert "up to 24 % of the kinetic energy of the driven coordinate" in " ".join(text.split())
    assert "Not measured: boom, a | line with" in text


def test_the_blocks_of_a_rod_on_a_trolley_as_expressions():
    blocks = symbolic_blocks(fan.loads(CART))
    assert blocks.of_q_D == ((0, 0),)
    (theta,) = blocks.effective.free_symbols
    expected = 3 - sp.cos(theta) ** 2 / 4 / sp.Rational(7, 20)
    assert sp.simplify(blocks.effective[0] - expected) == 0
    assert "M_KK - M_KD M_DD^-1 M_DK depends on q_D" in blocks.text()
