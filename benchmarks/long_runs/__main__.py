"""``python -m benchmarks.long_runs``: the variational integrator measured; docs/long-runs.md."""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.long_runs import measure
from benchmarks.strings.report import Table, machine, number, wrap_paragraph

ROOT = Path(__file__).resolve().parents[2]
SECONDS = 1000.0


def main() -> None:
    parser = argparse.ArgumentParser(description="Writes docs/long-runs.md.")
    parser.add_argument("--seconds", type=float, default=SECONDS, help="of the long runs")
    seconds = parser.parse_args().seconds
    gentle = printed_table("a gentle swing", measure.energy_errors(measure.GENTLE, seconds))
    longer = measure.long_run_slope(measure.GENTLE, 8 * seconds)
    vigorous = printed_table(
        "a vigorous swing", measure.energy_errors(measure.VIGOROUS, min(seconds, 100.0))
    )
    orders = printed_table("orders", measure.convergence_orders())
    catches = printed_table("catches", measure.catch_errors())
    momenta = printed_table("momenta", measure.momentum_drift())
    cost, slowest = measure.step_costs()
    printed_table("cost", cost)
    lanes = measure.lane_cost_text()
    print(lanes, flush=True)
    growth = printed_table("growth", measure.cost_by_size())
    text = PAGE.format(
        seconds=seconds,
        longer=longer,
        gentle=gentle,
        vigorous=vigorous,
        orders=orders,
        catches=catches,
        momenta=momenta,
        cost=cost.markdown(),
        lanes=lanes,
        growth=growth,
        machine=machine().markdown(),
        fast=number(measure.TREP[0] / slowest),
        slow=number(measure.TREP[1] / slowest),
        slowest=f"{slowest:.1f}",
        drift=measure.TREP_DRIFT,
        strays=min(seconds, 100.0),
    )
    parts = (
        p if p.startswith(("|", "#")) else wrap_paragraph(p) for p in text.strip().split("\n\n")
    )
    page = ROOT / "docs" / "long-runs.md"
    page.write_text("\n\n".join(parts) + "\n", encoding="utf-8")


def printed_table(what: str, table: Table) -> str:
    """A table as text, printed when complete."""
    print(what, table.markdown(), sep="\n", flush=True)
    return table.markdown()


PAGE = """\
# Long runs and large steps, measured

After this page you know how the [variational integrator](variational.md) compares with the other
methods in energy, order and cost. `make long-runs-report` measures everything and writes this page.

## Energy

The bundled marionette without damping and drag, its knees lifted until all seven strings pull. The
slope is that of a straight line through the means of 40 intervals, with its standard error.

A gentle swing (random velocities of 0.02 rad/s and m/s, projected onto the taut strings),
{seconds:g} s. No string goes slack and no limit is reached.

{gentle}

The slope of `variational` over 1,000 s is part of a slow oscillation: over eight times as long it
is {longer} of the mean kinetic energy a second. trep, on a comparable puppet, drifts by {drift:g} J
within 10 s in steps of 10 ms.

A vigorous swing (0.5), {strays:g} s: strings and limits catch, and every catch takes energy. The
residual of the ledger is the method's own energy error.

{vigorous}

## Order

The largest error of a configuration number against the event-driven motion at rtol 1e-12.

{orders}

The next table is for many catches that nearly coincide: the marionette, lifted by 1 cm until all
its strings are slack, is dropped; errors at 0.06 s. The order of the catches determines the
impulses, and steps resolve it if they are shorter than the time between catches, here 0.1 ms and
less: from there on the error is roughly of first order. With longer steps the order of the catches
differs, and the error hardly depends on the step.

{catches}

## Momenta

A free body with a leg, over 100 s.

{momenta}

## Cost

A step of the bundled marionette (25 degrees of freedom, seven strings, damped), processor time in
compiled code, the shortest of five runs. trep's step took 150 to 850 us on such a puppet: the
slowest of those at 10 ms here, {slowest} us, is {fast} to {slow} times as fast.

{lanes}

{cost}

The last table is for chains of damped hinges on three strings, by degrees of freedom. The
operations of a correction grow with the number of links, not with its square. The longest chains'
fastest modes, about 2 sqrt(n g / l) or 200 rad/s for 100 links of 0.1 m, are hardly resolved in
steps of 10 ms: there the mass matrix alone is a poor derivative, and steps take many corrections or
are halved.

{growth}

## Measured on

{machine}
"""

if __name__ == "__main__":
    main()
