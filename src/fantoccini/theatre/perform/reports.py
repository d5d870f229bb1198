"""Reports on hands that stay visible for a while: stopped hands and weak motors.

A drive is a motor with a controller that moves a driven coordinate; it is weak if its load is
larger than its torque.
"""

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
        last_stop: time and reason of the last stop of all hands; None without a stop.
    """

    def __init__(self) -> None:
        self.last_stop: tuple[float, str] | None = None
        # Name of a drive -> last time its motor was too weak.
        self._weak_motor_times: dict[str, float] = {}

    def clear(self) -> None:
        """Forgets all reports."""
        self.last_stop = None
        self._weak_motor_times.clear()

    def forget_motors(self) -> None:
        """Forgets weak motors, when the drives change."""
        self._weak_motor_times.clear()

    def stop(self, t: float, reason: str) -> None:
        """Records that all hands were stopped."""
        self.last_stop = (t, reason)

    def note_motors(self, t: float, tree: Tree, stepper: Stepper) -> None:
        """Records the drives whose motors were overloaded in the last tick."""
        if not tree.watched:
            return
        for index in stepper.events[:, EVENT_AT["row"]].astype(int) - tree.n_rows:
            if 0 <= index < len(tree.watched):
                self._weak_motor_times[tree.watched[index].name.rsplit(".", 1)[0]] = t

    def with_reports(
        self, messages: dict[str, list[str]], t: float, names: Iterable[str]
    ) -> dict[str, str]:
        """Messages by handle or string, including the given ones.

        Args:
            messages: given messages.
            t: present time [s].
            names: names of all hands.
        """
        if self.last_stop and t - self.last_stop[0] < _REPORT_TIME:
            for name in dict.fromkeys(names):
                messages.setdefault(name, []).append(f"hand was stopped: {self.last_stop[1]}")
        for name, last_time in self._weak_motor_times.items():
            if t - last_time < _REPORT_TIME:
                messages.setdefault(name, []).append("its motor is too weak for this")
        return {name: "; ".join(texts) for name, texts in messages.items()}
