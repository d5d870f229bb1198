"""Sections 2 and 3: evaluations and steps of everyone in turns, and MuJoCo's settings."""

from __future__ import annotations

from collections.abc import Callable

from ..strings.report import Section, Table
from .figures import Chapter, Goal, Samples, in_turns, ratio_text, spread_text, time_text
from .mujoco_peer import MuJoCo
from .peers import Peers
from .programs import Burst, Program, program_input
from .subject import DT, marionette, swinging_state

OURS = {
    "evaluate": "fantoccini, constrained evaluation",
    "step": "fantoccini, time step with complementarity",
    "rk4": "fantoccini, RK4 step with tensions",
}
"""Work of the scalar program -> its name on the page."""

MARKS = (("Euler", "evaluate", 8.0), ("Euler", "step", 6.0), ("RK4", "rk4", 6.0))
"""(Integrator of mj_step, compared work of ours, target ratio of their times)."""

FINER = 8
"""Turns for one of the others', each so many times as short: this machine's clock changes within
seconds, and a turn's bursts are to share it."""

EVALUATIONS = 20_000 // FINER
EVALUATION_MARK = 2e-6

APART = 1e-6
"""Largest length error of our strings at the end of a burst [m]."""


def chapters(peers: Peers, scalar: Program, turns: int, steps: int) -> list[Chapter]:
    """Times, ratios, and the fastest settings of MuJoCo."""
    x = swinging_state()
    for peer in peers.mujoco.values():
        peer.find_fastest(x.q_D, x.v_D, steps // 5, max(3, turns // 2))
    steps //= FINER
    turns_of_steps = FINER * turns
    taken = in_turns(_actions(peers, scalar, steps), turns_of_steps)
    taken |= in_turns(_other_engines(peers), turns)
    rows = [[name, *spread_text(samples)] for name, samples in taken.items()]
    rows += [[name, why, "-", "-"] for name, why in peers.missing.items()]
    ratios, goals = _ratios(peers, taken)
    goals.append(
        Goal("one constrained evaluation", taken[OURS["evaluate"]], EVALUATION_MARK, False)
    )
    text = (
        f"One evaluation or step, in turn, {turns_of_steps} of them ({turns} of Pinocchio and "
        f"Drake). Steps are of {time_text(DT)}. Times are processor times, which exclude waiting. "
        f"Every burst starts at the same state and makes {steps} steps or {EVALUATIONS} "
        "evaluations: ours in a compiled C++ program with the library's flags, MuJoCo's in one "
        "call of `mj_step` with `nstep`, Drake's in one call of `AdvanceTo`. Pinocchio and "
        "Drake's derivative are called from Python in a loop, so about half a microsecond of "
        "each call is overhead. Ours is compiled for this processor, the others are the "
        "published wheels. Our RK4 step is four evaluations with all tensions, combined, without "
        "projection. Ratios are computed turn by turn."
    )
    table = Table(["program, work", "median", "min", "max"], rows)
    ratio_table = Table(["ratio", "median", "min", "max"], ratios)
    return [
        Chapter(Section("2. Evaluations and steps", [text, table, ratio_table]), goals),
        _settings(peers),
    ]


def _actions(peers: Peers, scalar: Program, steps: int) -> dict[str, Callable[[], float]]:
    """Name on the page -> seconds of one evaluation or step."""
    x, actions = swinging_state(), {}

    def ours(work: str, count: int) -> Callable[[], float]:
        return lambda: _require_plausible(scalar.run(program_input([x]), work, 1, count)).seconds[0]

    def mj_step(peer: MuJoCo, settings: dict) -> Callable[[], float]:
        return lambda: peer.burst(settings, x.q_D, x.v_D, steps)["seconds"]

    for integrator in ("Euler", "RK4"):
        for peer in peers.mujoco.values():
            settings = peer.fastest[integrator]
            actions[_name(peer, integrator)] = mj_step(peer, settings)
        for of, work, _ in MARKS:
            if of == integrator:
                actions[OURS[work]] = ours(work, EVALUATIONS if work == "evaluate" else steps)
    return actions


def _other_engines(peers: Peers) -> dict[str, Callable[[], float]]:
    """Likewise for the engines without ratios."""
    x, actions = swinging_state(), {}
    if peers.pinocchio:
        name = f"Pinocchio {peers.pinocchio.version}, ABA from Python, unconstrained"
        actions[name] = lambda: peers.pinocchio.burst(x.q_D, x.v_D)
    if peers.drake:
        name = f"Drake {peers.drake.version}, "
        actions[name + "derivative from Python, unconstrained"] = lambda: peers.drake.derivative(
            x.q_D, x.v_D
        )
        actions[name + "discrete step with distances"] = lambda: peers.drake.step(x.q_D, x.v_D)
    return actions


def _require_plausible(burst: Burst) -> Burst:
    """A burst whose strings carried the puppet and kept their lengths."""
    carried = burst.tension / marionette().weight
    if not (0.9 < carried < 1.1 and burst.apart < APART):
        raise RuntimeError(f"strings carry {carried:.3g} of the weight, {burst.apart:.1g} m off")
    return burst


def _name(peer: MuJoCo, integrator: str) -> str:
    return f"MuJoCo {peer.version}, mj_step, {integrator}"


def _ratios(peers: Peers, taken: dict[str, Samples]) -> tuple[list[list[str]], list[Goal]]:
    """Every version of MuJoCo over ours; the faster one decides."""
    rows, goals = [], []
    for integrator, work, bound in MARKS:
        what = f"mj_step ({integrator}) / {OURS[work].removeprefix('fantoccini, ')}"
        smallest_ratio: Samples | str = peers.no_mujoco
        for peer in peers.mujoco.values():
            ratio = taken[_name(peer, integrator)].over(taken[OURS[work]])
            rows.append([f"{what}, MuJoCo {peer.version}", *spread_text(ratio, ratio_text)])
            if isinstance(smallest_ratio, str) or ratio.median < smallest_ratio.median:
                smallest_ratio = ratio
        goals.append(Goal(what, smallest_ratio, bound))
    return rows, goals


def _settings(peers: Peers) -> Chapter:
    """The timed settings."""
    versions = list(peers.mujoco.values())
    rows = []
    for settings in zip(*(peer.tried for peer in versions), strict=True):
        cells = [settings[0].settings["integrator"], settings[0].name]
        for peer, tried in zip(versions, settings, strict=True):
            text = tried.wrong or time_text(tried.seconds)
            best = peer.fastest[tried.settings["integrator"]] is tried.settings
            cells.append(f"**{text}**" if best else text)
        rows.append(cells)
    versions_text = [f"MuJoCo {peer.version}" for peer in versions]
    text = (
        "Contacts are off, and so are sensors and energies, which the model does not request; "
        "strings have MuJoCo's default softness. The fastest of some bursts selects the solver, "
        "the Jacobian, and whether constraints are split into islands: section 2 uses the "
        "setting in bold. A setting whose final state differs from that of dense Newton is "
        "excluded."
    )
    table = Table(["integrator", "setting", *versions_text], rows)
    return Chapter(Section("3. MuJoCo's settings", [text, table if rows else "Not installed."]))
