"""The page: one table of all targets, then the measurements by section."""

from __future__ import annotations

from ..strings.report import Table, machine, wrap_paragraph
from .figures import Chapter, goals_table
from .peers import Peers

OPENING = (
    "After this page you know the speed of fantoccini compared with MuJoCo, Pinocchio and Drake "
    "on the same puppet. `make bench` installs them from the extra `bench`, measures everything "
    "in one run and writes this page. Compared programs are timed in turn, and ratios are "
    "computed turn by turn, so the ratios are more reliable than the times of this one machine. "
    "Every figure is the median, with the minimum and the maximum."
)


def page(chapters: list[Chapter], peers: Peers, flags: str) -> str:
    """The page as Markdown."""
    computer = machine(("numpy", "scipy", "casadi"))
    versions = [["compiler's flags", flags]]
    versions += [[name, peer.version] for name, peer in peers.mujoco.items()]
    for name, peer in (("Pinocchio", peers.pinocchio), ("Drake", peers.drake)):
        if peer:
            versions.append([name, peer.version])
    versions += [[name, why] for name, why in peers.missing.items()]
    parts = [
        "# Speed, measured",
        wrap_paragraph(OPENING),
        goals_table(chapters).markdown(),
        Table(computer.header, [*computer.rows, *versions]).markdown(),
        *(chapter.section.markdown() for chapter in chapters),
    ]
    return "\n\n".join(parts) + "\n"
