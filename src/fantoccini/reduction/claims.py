"""Which claims of Sec. VI hold for a puppet, in words."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from fantoccini.reduction.products import MAX_OUTSIDE
from fantoccini.reduction.structure import Structure

_MAX_NAMED = 6
"""Couplings listed by name."""


class Verdict(enum.StrEnum):
    """Whether a claim holds; NONE if it does not apply."""

    HOLDS = "holds"
    FAILS = "fails"
    NONE = "-"


@dataclass(frozen=True)
class Claim:
    """A claim of Sec. VI.

    Attributes:
        text: the claim.
        verdict: whether it holds for the puppet.
        evidence: the reason.
    """

    text: str
    verdict: Verdict
    evidence: str


def claims(found: Structure) -> tuple[Claim, ...]:
    """The claims of Sec. VI in order."""
    return (_diagonal(found), _separate(found), _slack(found), _tracking(found), _taut(found))


def _verdict(holds: bool) -> Verdict:
    return Verdict.HOLDS if holds else Verdict.FAILS


def _diagonal(found: Structure) -> Claim:
    kinetic = found.kinetic
    if kinetic.block_diagonal:
        evidence = "every entry of M_DK is the expression 0"
    else:
        pairs = [f"{d} with {k}" for d, k in kinetic.coupled[:_MAX_NAMED]]
        more = len(kinetic.coupled) - len(pairs)
        listed = ", ".join(pairs) + (f" and {more} more" if more else "")
        evidence = (
            f"M_DK couples {listed}: up to {kinetic.coupling:.2g} of sqrt(M_DD M_KK) over "
            f"{kinetic.n} configurations"
        )
    holds = kinetic.block_diagonal or kinetic.coupling < MAX_OUTSIDE
    return Claim("the kinetic energy is block diagonal in [q_D, q_K]", _verdict(holds), evidence)


def _separate(found: Structure) -> Claim:
    kinetic = found.kinetic
    wrong = []
    if kinetic.M_DD_has_q_K and kinetic.M_DD_change > MAX_OUTSIDE:
        wrong.append(f"M_DD changes with q_K, by up to {kinetic.M_DD_change:.2g} of itself")
    if kinetic.M_KK_has_q_D and kinetic.M_KK_change > MAX_OUTSIDE:
        wrong.append(f"M_KK changes with q_D, by up to {kinetic.M_KK_change:.2g} of itself")
    none = (
        f"in numbers, over {kinetic.n} configurations"
        if kinetic.M_DD_has_q_K or kinetic.M_KK_has_q_D
        else "M_DD holds no q_K, M_KK no q_D"
    )
    evidence = "; ".join(wrong) or none
    return Claim("each block depends on its own coordinates alone", _verdict(not wrong), evidence)


def _slack(found: Structure) -> Claim:
    text = "<Y_i, Y_j> lies in span{Y_k} while the strings are slack"
    kinetic, blocks = found.kinetic, found.symbolic
    if kinetic.block_diagonal and not kinetic.M_KK_has_q_D:
        evidence = "the drives move M_KK alone, which does not depend on q_D"
    elif blocks is not None and blocks.of_q_D is not None:
        how = "depends" if blocks.of_q_D else "does not depend"
        evidence = f"M_KK - M_KD M_DD^-1 M_DK {how} on q_D, as an expression"
    else:
        evidence = "in numbers"
    evidence += f"; largest part outside {found.slack:.2g} ({found.n_slack} configurations)"
    return Claim(text, _verdict(found.slack < MAX_OUTSIDE), evidence)


def _tracking(found: Structure) -> Claim:
    text = "with taut strings the drives can still give any acc_K"
    if not found.tracking:
        return Claim(text, Verdict.NONE, "no configuration with taut strings")
    kept = min(t.min_acceleration for t in found.tracking)
    singular = min(t.min_singular_value for t in found.tracking)
    evidence = (
        f"a drive keeps {kept:.2g} or more of its acceleration; smallest singular value of the "
        f"scaled A_D {singular:.2g} ({len(found.tracking)} configurations)"
    )
    if found.tied:
        counts = ", ".join(f"{' + '.join(names)} ({n})" for names, n in found.tied.items())
        evidence = (
            f"strings tie drives to one another: {counts} of {len(found.tracking)} configurations"
        )
    return Claim(text, _verdict(not found.tied), evidence)


def _taut(found: Structure) -> Claim:
    text = "<X_i, X_j> lies in span{X_k} with taut strings, constrained connection"
    if not found.taut:
        return Claim(text, Verdict.NONE, "no configuration with taut strings")
    outside = sum(share > MAX_OUTSIDE for share in found.taut)
    evidence = (
        f"outside in {outside} of {len(found.taut)} configurations; largest part outside "
        f"{max(found.taut):.2g}"
    )
    return Claim(text, _verdict(outside == 0), evidence)


def meaning(found: Structure) -> list[str]:
    """The consequences for the mixed model, one paragraph each."""
    paragraphs = []
    if not found.kinetic.block_diagonal:
        jump = f"{100.0 * found.kinetic.impact_share:.2g} %"
        paragraphs.append(
            "A driven joint moves mass (M_DK is not 0), so the metric is not block diagonal and "
            "nabla_vD v_D = 0 does not separate. M_DK acc_K acts on the puppet, and a jump of v_K "
            f"sets it in motion by an impulse (with up to {jump} of the kinetic energy of the "
            "driven coordinate). Velocities are therefore not enough as inputs: their "
            "accelerations must be bounded. The mechanism is fully actuated, so it can follow "
            "every q_K(t) of bounded acceleration, and the mixed model with its term M_DK acc_K is "
            "exact."
        )
    elif not found.kinetic.separate:
        paragraphs.append(
            "The kinetic energy is block diagonal, but one block depends on the coordinates of "
            "the other, so nabla_vD v_D = 0 does not separate: v_K enters the puppet's equations "
            "through Coriolis forces. Without taut strings acc_K does not enter, and the mixed "
            "model with these forces is exact."
        )
    if any(share > MAX_OUTSIDE for share in found.taut):
        paragraphs.append(
            "With taut strings the products leave the span, although the strings have no mass: "
            "A_K acc_K in Eq. 11 couples the drives' acceleration to the puppet as M_DK would. In "
            "that sense the constraints cannot be \"addressed independently\", and the quoted "
            "condition does not make the puppet with its mechanism kinematically reducible. The "
            "mixed model does not need it: by Eqs. 11 and 12 it takes accelerations, and it is "
            "exact wherever the drives can give any acc_K."
        )
    if found.tied:
        pulls = any(t.pulls_apart for t in found.tracking)
        paragraphs.append(
            "Some strings tie drives to one another: tensions in them balance on the puppet "
            "(A_D^T y = 0) but load the drives (A_K^T y is not 0). "
            + (
                "The drives can pull these strings against one another; motions that do so "
                "have no solution in the mixed model, and stop a run with a status."
                if pulls
                else "One of them goes slack if the drives move apart, and the active set changes."
            )
        )
    return paragraphs
