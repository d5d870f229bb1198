"""Reports on hands that last a while: hands that were stopped, and weak motors."""

from __future__ import annotations

from collections.abc import Iterable

from fantoccini.dynamics.steppers import Stepper
from fantoccini.kernel.contract import EVENT_AT
from fantoccini.model.tree import Tree

_TIME = 1.0
"""Time for which a stopped hand or a weak motor is reported [s]."""


class Reports:
    """Reports on one performance, by its time [s].

    Attributes:
        stopped: when all hands were stopped last, and why; None where they were not.
    """

    def __init__(self) -> None:
        self.stopped: tuple[float, str] | None = None
        self._weak: dict[str, float] = {}  # name of a drive -> when its motor last was too weak

    def clear(self) -> None:
        """Forgets everything."""
        self.stopped = None
        self._weak.clear()

    def forget_motors(self) -> None:
        """Forgets weak motors: the drives are others now."""
        self._weak.clear()

    def stop(self, t: float, why: str) -> None:
        """All hands were stopped."""
        self.stopped = (t, why)

    def note_motors(self, t: float, tree: Tree, stepper: Stepper) -> None:
        """Notes the drives whose motors the last tick overloaded."""
        if not tree.watched:
            return
        for index in stepper.events[:, EVENT_AT["row"]].astype(int) - tree.n_rows:
            if 0 <= index < len(tree.watched):
                self._weak[tree.watched[index].name.rsplit(".", 1)[0]] = t

    def added(self, found: dict[str, list[str]], t: float, names: Iterable[str]) -> dict[str, str]:
        """Messages by handle or string, those of this moment among them.

        Args:
            found: other messages.
            t: now.
            names: of all hands.
        """
        if self.stopped and t - self.stopped[0] < _TIME:
            for name in dict.fromkeys(names):
                found.setdefault(name, []).append(f"hand was stopped: {self.stopped[1]}")
        for name, at in self._weak.items():
            if t - at < _TIME:
                found.setdefault(name, []).append("its motor is too weak for this")
        return {name: "; ".join(texts) for name, texts in found.items()}
