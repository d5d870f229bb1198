"""The table: costs of strings of masses and springs."""

from __future__ import annotations

from collections.abc import Iterator

from benchmarks.string_model.measure import TOLERANCE, Measurements, measure
from benchmarks.string_model.subject import ARM, PUPPET, Subject
from benchmarks.strings.report import Table, number

from fantoccini.model.puppet.chain import CORD_DAMPING, CORD_MASS, CORD_STIFFNESS

STIFFNESSES = (50.0, 500.0, 50_000.0)
"""EA of other strings than the cord, with 8 pieces [N]."""
HEAD = [
    "strings",
    "EA [N]",
    "DOF",
    "fastest [1/s]",
    "fastest / slowest",
    "largest step [ms]",
    "timestepping [s/s]",
    "event: steps a second",
    "event [s/s]",
    "stretch [mm]",
    "hand error [mm]",
]


def measure_models(
    subject: Subject, stiffnesses: tuple[float, ...]
) -> Iterator[tuple[str, str, Measurements]]:
    """Name, EA and figures of the massless strings and of every chain."""
    figures, hand = measure(subject, subject.massless(), None)
    yield "massless", "-", figures
    chains = [(n, CORD_STIFFNESS) for n in subject.pieces] + [(8, EA) for EA in stiffnesses]
    for pieces, EA in chains:
        # The damping is a share of the stiffness, as in one material.
        damping = CORD_DAMPING * EA / CORD_STIFFNESS
        puppet = subject.chained(pieces=pieces, stiffness=EA, damping=damping)
        yield f"{pieces} pieces", f"{EA:g}", measure(subject, puppet, hand)[0]


def table(
    subject: Subject, stiffnesses: tuple[float, ...] = ()
) -> tuple[Table, list[Measurements]]:
    """The table, with one row for each model."""
    rows, all_found = [], []
    for name, EA, m in measure_models(subject, stiffnesses):
        all_found.append(m)
        rows.append(
            [
                name,
                EA,
                str(m.dof),
                number(m.fastest),
                number(m.fastest / m.slowest),
                number(1e3 * m.largest_step),
                number(m.stepping),
                number(m.steps),
                number(m.event),
                number(1e3 * m.stretch),
                "-" if name == "massless" else number(1e3 * m.error),
            ]
        )
        print(" | ".join(rows[-1]), flush=True)
    return Table(HEAD, rows), all_found


def chain_table() -> str:
    """The tables and their discussion, as Markdown: paragraphs and tables between blank lines."""
    arm, figures = table(ARM, STIFFNESSES)
    puppet, others = table(PUPPET)
    massless, eight = figures[0], figures[1 + ARM.pieces.index(8)]
    return TEXT.format(
        arm=arm.markdown(),
        puppet=puppet.markdown(),
        mass=1e3 * CORD_MASS,
        EA=CORD_STIFFNESS,
        damping=CORD_DAMPING,
        rtol=TOLERANCE,
        step=number(massless.largest_step / eight.largest_step),
        event=number(eight.event / massless.event),
        stepping=number(eight.stepping / massless.stepping),
        error=number(1e3 * eight.error),
        slower=number(others[-1].event / others[0].event),
        last=PUPPET.pieces[-1],
        stiffer=number(eight.fastest / massless.fastest),
    )


TEXT = """\
Each string is {mass:g} g of polyester cord with EA = {EA:g} N and a damping of {damping:g} N s,
unless the table gives another EA; the ratio of damping to EA is the same everywhere. The hands move
in the same way in every model, from each model's own rest. *Fastest* and *slowest* are the absolute
values of the eigenvalues of the linearised motion at rest. The *largest step* is the longest step
with which `timestepping` keeps the hand within 5 mm of the model's own event-driven motion and
loses or gains less than 0.1 J; its processor time for a simulated second is that at half this step.
`event` runs at
rtol = atol = {rtol:g}. The *stretch* is the largest extension of any string. The
*hand error* is the largest distance between the hand and that of the massless model, at 301 times.

The bundled `arm3d`: one string, wound in by 15 cm while its end moves by 9 cm.

{arm}

The bundled `marionette`: seven strings, a hand lifted by 10 cm.

{puppet}

On eight pieces of cord the arm's fastest motion is {stiffer} times as fast as on a massless string.
The largest step of `timestepping` is smaller by a factor of {step}, and a simulated second takes
{stepping} times as long; `event` takes {event} times as long. In return the model includes the
stretch and weight of the cord, which move the hand by up to {error} mm. Softer chains are cheaper
and stretch more. With chains of {last} pieces the marionette's event-driven run takes {slower}
times as long as on constraints.
"""
