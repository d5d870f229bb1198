"""Reports on hands that stay visible for a while: stopped hands and weak motors."""

from __future__ import annotations

from collections.abc import Iterable

from fantoccini.dynamics.steppers import Stepper
from fantoccini.kernel.contract import EVENT_AT
from fantoccini.model.tree import Tree

_REPORT_TIME = 1.0
"""Time for which a stopped hand or a weak motor is reported [s]."""


class Reports:
    """Reports on a performance, in its time [s].

    Attributes:
        stopped: time and reason of the last stop of all hands; None without a stop.
    """

    def __init__(self) -> None:
        self.stopped: tuple[float, str] | None = None
        self._weak: dict[str, float] = {}  # name of a drive -> last time its motor was too weak

    def clear(self) -> None:
        """Forgets all reports."""
        self.stopped = None
        self._weak.clear()

    def forget_motors(self) -> None:
        """Forgets weak motors, when the drives change."""
        self._weak.clear()

    def stop(self, t: float, why: str) -> None:
        """Records that all hands were stopped."""
        self.stopped = (t, why)

    def note_motors(self, t: float, tree: Tree, stepper: Stepper) -> None:
        """Records the drives whose motors were overloaded in the last tick."""
        if not tree.watched:
            return
        for index in stepper.events[:, EVENT_AT["row"]].astype(int) - tree.n_rows:
            if 0 <= index < len(tree.watched):
                self._weak[tree.watched[index].name.rsplit(".", 1)[0]] = t

    def added(self, found: dict[str, list[str]], t: float, names: Iterable[str]) -> dict[str, str]:
        """Messages by handle or string, including the given ones.

        Args:
            found: given messages.
            t: present time [s].
            names: names of all hands.
        """
        if self.stopped and t - self.stopped[0] < _REPORT_TIME:
            for name in dict.fromkeys(names):
                found.setdefault(name, []).append(f"hand was stopped: {self.stopped[1]}")
        for name, at in self._weak.items():
            if t - at < _REPORT_TIME:
                found.setdefault(name, []).append("its motor is too weak for this")
        return {name: "; ".join(texts) for name, texts in found.items()}
