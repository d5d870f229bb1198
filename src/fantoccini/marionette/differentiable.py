"""A puppet's derivatives: compiled when they are first asked for, in a library of their own."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cached_property
from typing import TYPE_CHECKING, Any

from fantoccini.arrays import Array
from fantoccini.marionette.linearisation import Linearisation, linearise
from fantoccini.marionette.modes import Modes, modes
from fantoccini.marionette.step_linearisation import StepLinearisation, linearise_step
from fantoccini.motion import State
from fantoccini.runtime import Slopes
from fantoccini.tree import Tree

if TYPE_CHECKING:
    from fantoccini.marionette.handle import Marionette


class Differentiable:
    """The part of a marionette that knows derivatives."""

    tree: Tree
    _compiled: Callable[[str, Callable], Any]

    @cached_property
    def derivatives(self) -> Slopes:
        """The compiled derivatives, from the cache or made now.

        Raises:
            BuildError: no compiler, or it failed.
        """
        return self._compiled("derivatives", lambda file: Slopes(file, self.tree.sizes))

    def linearise(
        self: Marionette,
        x: State,
        acc_K: Array | None = None,
        u_D: Array | None = None,
        rows: Iterable[str] | None = None,
    ) -> Linearisation:
        """Derivatives of acc_D and the tensions at a state, and A and B of the linear system.

        Args:
            x: the state.
            acc_K: (n_vK,) accelerations of the inputs; 0 when not given.
            u_D: (n_vD,) user forces; 0 when not given.
            rows: names of the strings and limits to hold; those that pull when not given.
        """
        return linearise(self, x, acc_K, u_D, rows)

    def linearise_step(
        self: Marionette,
        x: State,
        acc_K: Array | None = None,
        u_D: Array | None = None,
        dt: float = 0.002,
    ) -> StepLinearisation:
        """One step of the time-stepper with its derivatives, in the mode that it chooses.

        Args:
            x: where the step starts.
            acc_K: (n_vK,) accelerations of the inputs over the step; 0 when not given.
            u_D: (n_vD,) user forces over the step; 0 when not given.
            dt: its length [s].
        """
        return linearise_step(self, x, acc_K, u_D, dt)

    def modes(self: Marionette, x: State) -> Modes:
        """How the puppet swings about a state of rest, and which inputs excite each swing.

        Args:
            x: a state of rest, as :meth:`Marionette.rest` gives it.

        Raises:
            StateError: the puppet does not rest there.
        """
        return modes(self, x)
