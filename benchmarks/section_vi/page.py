"""Text and tables of docs/reduction.md."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.section_vi.report import VERDICT_WORDS, SectionReport
from benchmarks.strings.report import Table, number

SHORT_CLAIMS = (
    "M_DK = 0",
    "M_DD(q_D), M_KK(q_K)",
    "<Y, Y> in span, slack",
    "any acc_K",
    "<X, X> in span, taut",
)
"""Short forms of the claims of :attr:`fantoccini.lab.ReductionReport.claims`."""


def page(reports: Sequence[SectionReport], chains: str, machine: str) -> str:
    """The whole page as Markdown; paragraphs are not wrapped yet."""
    boom = next(r.reduction.kinetic for r in reports if r.reduction.kinetic.coupled)
    missing = [f"Not measured: {r.name}, {line}." for r in reports for line in r.missing]
    return TEXT.format(
        verdicts=verdicts(reports).markdown(),
        figures=figures(reports).markdown(),
        structure=structure(reports).markdown(),
        share=f"{100.0 * boom.impact_share:.2g}",
        exact=exact(reports).markdown(),
        catches=catches(reports).markdown(),
        bandwidth=bandwidth(reports).markdown(),
        massive=massive(reports).markdown(),
        missing="\n\n".join(missing),
        chains=chains.strip(),
        machine=machine,
    )


def verdicts(reports: Sequence[SectionReport]) -> Table:
    """The table of the claims that hold."""
    rows = [
        [
            r.name,
            *(VERDICT_WORDS[c.holds].replace("fails", "**fails**") for c in r.reduction.claims),
        ]
        for r in reports
    ]
    return Table(["puppet", *SHORT_CLAIMS], rows)


def figures(reports: Sequence[SectionReport]) -> Table:
    """The main figures, with a row for each puppet."""
    rows = []
    for r in reports:
        heavy = r.heavy_strings[-1]
        rows.append(
            [
                r.name,
                str(len(r.reduction.driven)),
                number(r.exact.deviation.max_puppet),
                f"{r.catch_order:.2f}",
                f"{r.bandwidth_order:.2f}",
                number(r.tracking[-1].deviation.max_puppet),
                number(heavy.tracking[-1].deviation.max_puppet),
            ]
        )
    return Table(
        [
            "puppet",
            "drives",
            "error, exact tracking",
            "catch: exponent of inertia",
            "lag: exponent of bandwidth",
            "error, highest bandwidth",
            "error, string with mass",
        ],
        rows,
    )


def structure(reports: Sequence[SectionReport]) -> Table:
    """The figures of part (a)."""
    rows = []
    for r in reports:
        reduction = r.reduction
        rows.append(
            [
                reduction.name,
                number(reduction.kinetic.coupling),
                number(reduction.slack),
                number(min(t.min_acceleration for t in reduction.tracking)),
                number(min(t.min_singular_value for t in reduction.tracking)),
                number(max(reduction.taut)),
            ]
        )
    return Table(
        [
            "puppet",
            "M_DK / sqrt(M_DD M_KK)",
            "share outside span, slack",
            "acceleration kept",
            "smallest singular value of A_D",
            "share outside span, taut",
        ],
        rows,
    )


def exact(reports: Sequence[SectionReport]) -> Table:
    """Differences with exact tracking, at the extreme settings of every method."""
    methods = ["", *(c.method for c in reports[0].comparisons), ""]
    ends = [k for k in range(len(methods) - 2) if len(set(methods[k : k + 3])) > 1]
    head = [
        f"rtol {c.setting:g}" if c.method == "event" else f"{c.method}, {1e3 * c.setting:.0f} ms"
        for c in (reports[0].comparisons[k] for k in ends)
    ]
    rows = [
        [r.name, *(number(r.comparisons[k].deviation.max_puppet) for k in ends)] for r in reports
    ]
    return Table(["puppet", *head], rows)


def catches(reports: Sequence[SectionReport]) -> Table:
    """Differences of the jump at a catch."""
    rows = [[r.name, r.catches[0].string, *(number(c.jump) for c in r.catches)] for r in reports]
    return Table(["puppet", "string caught", *(f"{c.ratio:g}" for c in reports[0].catches)], rows)


def bandwidth(reports: Sequence[SectionReport]) -> Table:
    """Differences over the bandwidth."""
    rows = [
        [
            r.name,
            f"{r.tracking[0].bandwidth:.3g}",
            *(number(t.deviation.max_puppet) for t in r.tracking),
        ]
        for r in reports
    ]
    first = reports[0].tracking[0].bandwidth
    times = [f"{t.bandwidth / first:.0f} w_1" for t in reports[0].tracking]
    return Table(["puppet", "w_1 [rad/s]", *times], rows)


def massive(reports: Sequence[SectionReport]) -> Table:
    """Differences with a string of the largest mass."""
    rows = [
        [
            r.name,
            m.string,
            number(m.mass),
            number(m.coupling),
            *(number(t.deviation.max_puppet) for t in m.tracking),
            number(m.exact.max_puppet),
        ]
        for r in reports
        for m in r.heavy_strings[-1:]
    ]
    head, first = reports[0].heavy_strings[0], reports[0].tracking[0].bandwidth
    times = [f"{t.bandwidth / first:.0f} w_1" for t in head.tracking]
    return Table(
        ["puppet", "string", "its mass [kg]", "relative M_DK", *times, "exact tracking"], rows
    )


TEXT = """\
# Validity of the mixed model

After this page you know when the paper's mixed model is valid, and the size of its error otherwise.
The *mixed* model treats driven coordinates as inputs and omits the mechanism that moves them;
Section VI of the paper ("Validity of mixed kinematic-dynamic modeling") gives the argument. Here it
is compared with a *full* model, which has a drive as heavy as the puppet on every driven
coordinate: its dynamic coordinates are [q_D, q_M], those of the puppet and of the mechanism. Part
(a) examines the equations, part (b) drives that follow their inputs exactly, part (c) drives of
finite bandwidth and a string with mass.

`fantoccini validate-reduction FILE` checks part (a) for any puppet. `python -m
benchmarks.section_vi FILE` measures all three. `make reports` regenerates this page.

## Results

`boom` is a two-link arm on a driven carriage, whose tip hangs from a winch; the other puppets are
bundled. Differences are the largest of any coordinate at any time, in m or rad.

{verdicts}

{figures}

If the drives follow their inputs exactly, the puppet moves in the full model as in the mixed model,
up to integration error. At a catch a drive absorbs part of the impulse, in proportion to 1 /
inertia; the mixed model neglects this. Drives of inertia J and bandwidth w lag by f / (J w^2) under
a string force f, and the error of the puppet is proportional to this lag. A string with mass causes
an error that no bandwidth removes. Two steps of the printed argument do not hold:

- *"because the strings are massless, the inertia tensor is block diagonal"*: massless strings are
  not enough. A driven joint that moves mass couples the blocks; and even with a block diagonal
  tensor, M_DD must depend on q_D alone, or v_K enters the puppet's equations through Coriolis
  forces.
- *"this allows us to address the constraints independently"*: with a taut string whose end moves,
  the symmetric products of the constrained connection lie outside the span, although the string
  has no mass.

## The structure, (a)

A force on driven coordinate i accelerates along Y_i = M^-1 e_i. The paper requires <Y_i, Y_j> =
nabla_Yi Y_j + nabla_Yj Y_i to lie in span{{Y_k}}. Forces on coordinates are gradients, Y_i = grad
q_i, so

    <Y_i, Y_j> = grad (M^-1)_ij

and the condition is that the driven block of M^-1, the inverse of M_KK - M_KD M_DD^-1 M_DK, does
not change with q_D. Equivalently, if the puppet's momentum M_DD v_D + M_DK v_K is zero, it stays
zero under inertia alone for every motion of the mechanism. The condition holds if M_DK = 0 and M_KK
depends on q_K alone.

With taut strings A = [A_D A_K] the same holds for X_i = P Y_i, P the projection on A v = 0, within
the surface h = 0. For a bob of mass m on a string of length L at the angle theta, with drives of
inertia J, the winch alone has

    T = (m L^2 thetadot^2 + (m + J) Ldot^2) / 2,    <X_L, X_L> = grad 1 / (m + J) = 0

and a string end that moves along x has

    <X_x, X_x> = grad 1 / (J + m sin^2 theta)

which is not in span{{X_x}} = span{{grad x}}: the end's acceleration moves the bob, by A_K acc_K in
Eq. 11, as M_DK acc_K would. The paper's model has this term: its inputs are accelerations (Eq. 12),
with continuous velocities. The mixed model needs only a weaker condition: the drives can produce
any acc_K. After elimination of the multipliers, acc_K = G u_K + ..., and G is regular if and only
if no y has A_D^T y = 0 and A_K^T y != 0, that is, no set of tensions loads the drives without
loading the puppet. This is "any acc_K" above. It fails where strings tie drives to one another, for
example where two winches pull one bob in opposite directions along its rail.

Worst values over 12 random configurations: the coupling M_DK, the share of a symmetric product
outside the span, the share of its acceleration that a drive keeps when strings are taut, and the
smallest singular value of A_D, with rows of unit length in the metric M_DD^-1.

{structure}

A driven joint of the boom moves mass (M_DK is not 0). Two claims fail: the metric is not block
diagonal and nabla_vD v_D = 0 does not separate; M_DK acc_K acts on the puppet, and a jump of v_K
gives it an impulse (with up to {share} % of the kinetic energy of the driven coordinate).
Velocities are therefore not sufficient as inputs: their accelerations must be bounded. The main
claim holds: the mechanism is fully actuated, so it can follow every q_K(t) of bounded acceleration,
and the mixed model with its term M_DK acc_K is exact.

## Exact tracking, (b)

Every driven coordinate makes small smooth moves. The drives of the full model get the forces that
the mixed model's inputs need, `effort` and J acc_K, open loop, as functions of time. Both models
are run with the same method and settings.

{exact}

![Differences of the marionette with exact tracking](pictures/reduction_exact_tracking.png)

## Catches, (b)

The puppet is tossed and falls into its strings. In the mixed model v_K is continuous at a catch,
Eq. 15; a drive absorbs part of the impulse. The table gives the relative error of the jump of v_D
in the mixed model, in the norm of M_DD, for drives of 1 to 10,000 times the puppet's mass.

{catches}

![Differences of the marionette after a catch](pictures/reduction_catches.png)

## Bandwidth, (c)

Drives with computed-torque control, whose model contains the drive but not the strings, follow the
same inputs. A pull of the strings causes a lag of pull / (J w^2).

{bandwidth}

## A string with mass, (c)

"However, we should emphasize that this is only true when the strings are assumed to be massless."
The string that pulls most becomes a chain of three point masses between springs whose EA is 20,000
times the puppet's weight. Its masses are coordinates that the mixed model does not have. The table
compares displacements from rest with those of the massless mixed model. M_DK is that of a straight
string of the same mass. Above some bandwidth the error no longer falls: the remainder also occurs
with exact tracking and is proportional to the mass of the string.

{massive}

![Differences of the marionette with a heavy string](pictures/reduction_string_mass.png)

{missing}

## Strings as chains

Strings can be simulated as chains of masses and springs instead of constraints. This section
measures the cost.

{chains}

## Measured on

{machine}
"""
