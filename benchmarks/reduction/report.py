"""The page: what came out for every puppet, and the mathematics behind it."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.strings.report import Table, number

from fantoccini.reduction import ReductionReport, Verdict
from fantoccini.reduction.page import BANDWIDTH, CATCH, CLAIMS, EXACT, MASSIVE, tables
from fantoccini.reduction.plots import PICTURES

SHORT = (
    "block diagonal", "each block its own", "products, slack", "any acc_K", "products, taut",
)  # fmt: skip
"""The claims of :func:`fantoccini.reduction.claims.claims`, in few words."""


def page(reports: Sequence[ReductionReport], chains: str, machine: str) -> str:
    """The whole page as Markdown; paragraphs are not wrapped yet."""
    boom = next(r for r in reports if not r.structure.kinetic.identically)
    return TEXT.format(
        structure=structure(reports).markdown(), figures=figures(reports).markdown(),
        boom=boom.meaning[0], coupling=number(boom.structure.kinetic.coupling),
        jump=number(100.0 * boom.structure.kinetic.jump),
        details="\n\n".join(details(report) for report in reports),
        chains=chains.strip(), machine=machine,
    )  # fmt: skip


def structure(reports: Sequence[ReductionReport]) -> Table:
    """Which claims hold."""
    rows = [[r.name, *(said(c.verdict) for c in r.claims)] for r in reports]
    return Table(["puppet", *SHORT], rows)


def said(verdict: Verdict) -> str:
    return {Verdict.HOLDS: "holds", Verdict.FAILS: "**fails**", Verdict.NONE: "-"}[verdict]


def figures(reports: Sequence[ReductionReport]) -> Table:
    """The figures that matter, a row for each puppet."""
    rows = []
    for r in reports:
        massive = r.massive[-1] if r.massive else None
        rows.append([
            r.name, str(len(r.driven)), number(r.exact.worst[0]),
            f"{r.catch_order:.2f}", f"{r.bandwidth_order:.2f}", number(r.tracked[-1].worst[0]),
            number(massive.tracked[-1].worst[0]) if massive else "-",
        ])  # fmt: skip
    return Table(
        ["puppet", "drives", "exact tracking (m, rad)", "catch: power of the inertia",
         "power of the bandwidth", "at the highest bandwidth", "with the heaviest string"],
        rows,
    )  # fmt: skip


def details(report: ReductionReport) -> str:
    """A puppet's tables and plots."""
    parts = [f"## {report.name}"]
    for table in tables(report):
        rows = table.markdown().split("\n\n")[-1]
        parts += [f"### {table.title} of {report.name}", *table.text, rows]
        if table.title == CLAIMS:
            parts += report.meaning
        else:
            name = f"reduction_{report.name}_{PICTURES[table.title]}"
            parts.append(f"![{ALT[table.title]} of {report.name}](pictures/{name})")
    return "\n\n".join([*parts, *(f"Not measured: {line}." for line in report.missing)])


ALT = {
    EXACT: "Differences with exact tracking",
    CATCH: "Differences at a catch over the drives' inertia",
    BANDWIDTH: "Differences over the bandwidth",
    MASSIVE: "Differences over the bandwidth for strings with mass",
}

TEXT = """\
# The mixed model, checked

The paper takes driven coordinates as inputs and leaves out the mechanism that moves them. Its
Section VI ("Validity of mixed kinematic-dynamic modeling") argues why. `fantoccini
validate-reduction FILE` makes an experiment of that argument for any puppet; this page holds its
figures for some. `make reports` measures everything and writes the page.

## What came out

Every driven coordinate gets a drive as heavy as the puppet, so that q = [q_D, q_M] of the full
model.

{structure}

{figures}

The mixed model is exact where the paper needs it: with drives that follow their inputs exactly,
the full model's puppet moves as the mixed one's up to the integrator's error. At a catch a drive
takes a part of the blow, in proportion to 1 / inertia. Drives of finite bandwidth w lag by pull /
(J w^2), and the puppet with them. A string with mass leaves a difference that no bandwidth takes
away. Two steps of the argument itself do not hold as they are printed:

- *"because the strings are massless, the inertia tensor is block diagonal"*: massless strings are
  not enough. A joint that is driven and moves mass couples the blocks; and a block diagonal
  tensor still needs M_DD to depend on q_D alone.
- *"this allows us to address the constraints independently"*: with a taut string whose end moves,
  the symmetric products of the constrained connection leave the span although the string has no
  mass.

## The structure, (a)

A force on driven coordinate i accelerates along Y_i = M^-1 e_i. The paper asks <Y_i, Y_j> =
nabla_Yi Y_j + nabla_Yj Y_i to lie in span{{Y_k}}. Forces on coordinates are gradients, Y_i = grad
q_i, so

    <Y_i, Y_j> = grad (M^-1)_ij

and the condition says: the driven block of M^-1, the inverse of M_KK - M_KD M_DD^-1 M_DK, does
not change with q_D. In words: a puppet whose momentum is zero keeps it so, however the mechanism
moves. M_DK = 0 with M_KK(q_K) has it.

With taut strings A = [A_D A_K] the same holds of X_i = P Y_i, P the projection on A v = 0, within
the surface h = 0. For a bob of mass m on a string of length L at the angle theta, with drives of
inertia J, the winch alone has

    T = (m L^2 thetadot^2 + (m + J) Ldot^2) / 2,    <X_L, X_L> = grad 1 / (m + J) = 0

and a string's end that moves along x has

    <X_x, X_x> = grad 1 / (J + m sin^2 theta)

which is not in span{{X_x}} = span{{grad x}}: the end's acceleration moves the bob, by A_K acc_K
in Eq. 11, as M_DK acc_K would. The paper's own model has that term; it takes accelerations (Eq.
12) and asks for continuous velocities. What it needs is less than the condition: that the drives
can give any acc_K. With the multipliers eliminated acc_K = G u_K + ..., and G is regular if and
only if no y has A_D^T y = 0 and A_K^T y != 0: no tensions that the puppet does not feel and the
drives do. That is "any acc_K" above. It fails where strings tie drives to one another, as two
winches that pull on one bob from both sides of its rail.

The boom's carriage carries mass by a joint (|M_DK| up to {coupling} of sqrt(M_DD M_KK)). {boom}

{details}

## Strings as chains

What it costs to simulate strings as chains of masses and springs, where the constraint is not
wanted:

{chains}

## Measured on

{machine}
"""
