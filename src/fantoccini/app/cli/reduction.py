"""``fantoccini validate-reduction``: checks the claims of the paper's Sec. VI on a puppet.

The section asks whether driven coordinates (ends and lengths of strings), moved by motors, may be
treated as inputs.
"""

from __future__ import annotations

from fantoccini.app.cli_support import ProgressDisplay, load_marionette, print_output, print_table
from fantoccini.lab import validate_reduction

_VERDICTS = {True: "holds", False: "fails", None: "-"}


def validate_file(file: str, quiet: bool) -> None:
    """Prints the claims with their evidence, and whether driven coordinates can be inputs.

    Args:
        file: FILE argument.
        quiet: print no progress.
    """
    with ProgressDisplay(quiet) as display:
        puppet = load_marionette(file, display.update)
        display.stage("examining the kinetic energy and taut strings")
        report = validate_reduction(puppet)
    table_lines = [(claim.text, _VERDICTS[claim.holds], claim.evidence) for claim in report.claims]
    print_table(f"Section VI for {report.name}", ("claim", "", "evidence"), table_lines)
    print_output(report.conclusion)
