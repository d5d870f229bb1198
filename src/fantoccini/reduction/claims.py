"""What of Sec. VI holds for a puppet, and what does not, in words."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from fantoccini.reduction.products import INSIDE
from fantoccini.reduction.structure import Structure

_NAMED = 6
"""Couplings that are named."""


class Verdict(enum.StrEnum):
    """Of a claim."""

    HOLDS = "holds"
    FAILS = "fails"
    NONE = "-"


@dataclass(frozen=True)
class Claim:
    """A part of Sec. VI.

    Attributes:
        says: the claim.
        verdict: whether it holds for the puppet.
        because: what was found.
    """

    says: str
    verdict: Verdict
    because: str


def claims(found: Structure) -> tuple[Claim, ...]:
    """The parts of Sec. VI in order, each with what was found."""
    return (_diagonal(found), _own(found), _slack(found), _tracking(found), _taut(found))


def _verdict(holds: bool) -> Verdict:
    return Verdict.HOLDS if holds else Verdict.FAILS


def _diagonal(found: Structure) -> Claim:
    kinetic = found.kinetic
    if kinetic.identically:
        because = "every entry of M_DK is the expression 0"
    else:
        pairs = [f"{d} with {k}" for d, k in kinetic.coupled[:_NAMED]]
        more = len(kinetic.coupled) - len(pairs)
        listed = ", ".join(pairs) + (f" and {more} more" if more else "")
        because = (
            f"M_DK couples {listed}: up to {kinetic.coupling:.2g} of sqrt(M_DD M_KK) over "
            f"{kinetic.n} configurations"
        )
    holds = kinetic.identically or kinetic.coupling < INSIDE
    return Claim("the kinetic energy is block diagonal in [q_D, q_K]", _verdict(holds), because)


def _own(found: Structure) -> Claim:
    kinetic = found.kinetic
    wrong = []
    if kinetic.D_of_K and kinetic.D_varies > INSIDE:
        wrong.append(f"M_DD changes with q_K, by up to {kinetic.D_varies:.2g} of itself")
    if kinetic.K_of_D and kinetic.K_varies > INSIDE:
        wrong.append(f"M_KK changes with q_D, by up to {kinetic.K_varies:.2g} of itself")
    none = (
        f"in numbers, over {kinetic.n} configurations"
        if kinetic.D_of_K or kinetic.K_of_D
        else "M_DD holds no q_K, M_KK no q_D"
    )
    because = "; ".join(wrong) or none
    return Claim("each block depends on its own coordinates alone", _verdict(not wrong), because)


def _slack(found: Structure) -> Claim:
    says = "<Y_i, Y_j> lies in span{Y_k} while the strings are slack"
    kinetic, page = found.kinetic, found.symbolic
    if kinetic.identically and not kinetic.K_of_D:
        because = "M_KK alone is felt by the drives, and it does not depend on q_D"
    elif page is not None and page.of_q_D is not None:
        how = "depends" if page.of_q_D else "does not depend"
        because = f"M_KK - M_KD M_DD^-1 M_DK {how} on q_D, as an expression"
    else:
        because = "in numbers"
    because += f"; largest part outside {found.slack:.2g} ({found.n_slack} configurations)"
    return Claim(says, _verdict(found.slack < INSIDE), because)


def _tracking(found: Structure) -> Claim:
    says = "with taut strings the drives can still give any acc_K"
    if not found.tracking:
        return Claim(says, Verdict.NONE, "no configuration with taut strings")
    least, spread = (min(getattr(t, n) for t in found.tracking) for n in ("least", "spread"))
    because = (
        f"a drive keeps {least:.2g} or more of its acceleration; smallest singular value of the "
        f"scaled A_D {spread:.2g} ({len(found.tracking)} configurations)"
    )
    if found.tied:
        times = ", ".join(f"{' + '.join(names)} ({n})" for names, n in found.tied.items())
        of = f"of {len(found.tracking)} configurations"
        because = f"strings tie drives to one another: {times} {of}"
    return Claim(says, _verdict(not found.tied), because)


def _taut(found: Structure) -> Claim:
    says = "<X_i, X_j> lies in span{X_k} with taut strings, constrained connection"
    if not found.taut:
        return Claim(says, Verdict.NONE, "no configuration with taut strings")
    outside = sum(share > INSIDE for share in found.taut)
    because = (
        f"outside in {outside} of {len(found.taut)} configurations; largest part outside "
        f"{max(found.taut):.2g}"
    )
    return Claim(says, _verdict(outside == 0), because)


def meaning(found: Structure) -> list[str]:
    """What follows for the mixed model: a paragraph for each thing found."""
    said = []
    if not found.kinetic.identically:
        jump = f"{100.0 * found.kinetic.jump:.2g} %"
        said.append(
            "A driven joint moves mass (M_DK is not 0). What fails: the metric is not block "
            "diagonal and nabla_vD v_D = 0 does not stand by itself; the puppet feels acc_K "
            "through M_DK acc_K, and a jump of v_K is a blow that sets it in motion (it takes up "
            f"to {jump} of the kinetic energy of the driven coordinate). So velocities are not "
            "enough as inputs: their accelerations must be bounded. What holds: the mechanism is "
            "fully actuated, so that it can follow every q_K(t) of bounded acceleration, and the "
            "mixed model with its term M_DK acc_K is exact."
        )
    elif not found.kinetic.separate:
        said.append(
            "The kinetic energy is block diagonal, but one block depends on the coordinates of "
            "the other. What fails: nabla_vD v_D = 0 does not stand by itself, v_K enters the "
            "puppet's equations through Coriolis forces. What holds: no acc_K without taut "
            "strings, and the mixed model with these forces is exact."
        )
    if any(share > INSIDE for share in found.taut):
        said.append(
            "With taut strings the products leave the span although the strings have no mass: "
            "A_K acc_K in Eq. 11 couples the drives' acceleration to the puppet as M_DK would. The "
            "constraints cannot be \"addressed independently\" in that sense, and the pair "
            "puppet and mechanism is not kinematically reducible by the quoted condition. The "
            "mixed model does not need it: by Eqs. 11 and 12 it takes accelerations, and it is "
            "exact wherever the drives can give any acc_K."
        )
    if found.tied:
        apart = any(t.pulls_apart for t in found.tracking)
        said.append(
            "Some strings tie drives to one another: tensions in them leave the puppet in balance "
            "(A_D^T y = 0) and do not leave the drives (A_K^T y is not 0). "
            + (
                "The drives can pull these strings against one another; motions that would do so "
                "have no solution in the mixed model, and stop a run with a status."
                if apart
                else "One of them goes slack where the drives part, and the mode changes."
            )
        )
    return said
