"""``fantoccini validate-reduction``: checks the claims of the paper's Sec. VI on a puppet."""

from __future__ import annotations

from fantoccini.app.cli_support import Steps, marionette, table, write
from fantoccini.lab import validate_reduction

_WORDS = {True: "holds", False: "fails", None: "-"}


def validate_file(file: str, quiet: bool) -> None:
    """Prints the claims with their evidence, and whether driven coordinates can be inputs.

    Args:
        file: FILE argument.
        quiet: print no progress.
    """
    with Steps(quiet) as steps:
        puppet = marionette(file, steps.named)
        steps.step("examining the kinetic energy and taut strings")
        report = validate_reduction(puppet)
    lines = [(claim.text, _WORDS[claim.holds], claim.evidence) for claim in report.claims]
    table(f"Section VI for {report.name}", ("claim", "", "evidence"), lines)
    write(report.conclusion)
