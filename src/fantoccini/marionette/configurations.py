"""States and configurations of a puppet: whether they are its own, and what lies between them."""

from __future__ import annotations

from collections.abc import Sequence

from fantoccini.arrays import Array
from fantoccini.marionette import checks
from fantoccini.motion import State, States, check_size, tangent
from fantoccini.tree import CoordinateTable, Tree


class Configurations:
    """The part of a marionette that knows its states and configurations."""

    tree: Tree
    coordinates: CoordinateTable

    def check_state(self, x: State) -> None:
        """Raises :class:`StateError` when ``x`` is a state of another puppet, or none."""
        check_size(x, self.coordinates, self.tree.n_rows)

    def difference(self, q0: Array, q1: Array, driven: bool = False) -> Array:
        """The tangent vectors dq that move q0 to q1: ``integrate(q0, dq)`` is q1.

        A scalar's is q1 - q0, an orientation's the shortest rotation vector in the body's frame:
        as in :meth:`linearise`, ordered and sized as the velocities.

        Args:
            q0, q1: (..., n_qD) dynamic configurations [rad, m or 1]; leading axes broadcast.
            driven: they are driven ones, (..., n_qK).

        Returns:
            (..., n_vD), or (..., n_vK) [rad or m].
        """
        scalars, quaternions, n_v = self._vectors_of(driven)
        q0, q1 = (self._configuration(q, driven) for q in (q0, q1))
        return tangent.between(scalars, quaternions, q0, q1, n_v)

    def integrate(self, q: Array, dq: Array, driven: bool = False) -> Array:
        """q moved by tangent vectors: scalars add, orientations turn; see :meth:`difference`.

        Args:
            q: (..., n_qD) dynamic configurations [rad, m or 1].
            dq: (..., n_vD) tangent vectors [rad or m]; leading axes broadcast.
            driven: they are driven ones, (..., n_qK) and (..., n_vK).

        Returns:
            (..., n_qD), or (..., n_qK).
        """
        scalars, quaternions, n_v = self._vectors_of(driven)
        q, dq = self._configuration(q, driven), checks.vectors("dq", dq, n_v)
        return tangent.moved(scalars, quaternions, q, dq)

    def states(self, states: Sequence[State]) -> States:
        """States of this puppet side by side.

        Raises:
            StateError: one is of another puppet, or what its winches have let out is no length.
        """
        tree = self.tree
        return States.of(states, self.coordinates, len(tree.strings), tree.n_rows)

    def _configuration(self, q: Array, driven: bool) -> Array:
        t = self.coordinates
        return checks.vectors("q", q, t.n_qK if driven else t.n_qD)

    def _vectors_of(self, driven: bool) -> tuple[tangent.Places, tangent.Places, int]:
        t = self.coordinates
        if driven:
            return t.scalars_K, t.quaternions_K, t.n_vK
        return t.scalars_D, t.quaternions_D, t.n_vD
