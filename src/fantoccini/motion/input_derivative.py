"""Derivatives of inputs with respect to the values of their waypoints, dq_K(t)/ds.

s is the value of a waypoint, and q_K are the driven coordinates, ends and lengths of strings.
Breaks are the times at which pieces of an input meet, `coef` their coefficients.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from fantoccini.base import Array, ShortRepr, Times, UnknownNameError, VecK, frozen, polynomial
from fantoccini.base.documents import Mistakes
from fantoccini.motion import channel, pieces, reading
from fantoccini.motion.input import Input
from fantoccini.motion.reading import Table

if TYPE_CHECKING:
    from fantoccini.model.tree import CoordinateTable

_SIDES = {"above": 1.0, "below": -1.0}


@dataclass(frozen=True, eq=False, repr=False)
class InputDerivative(ShortRepr):
    """dq_K(t)/ds, the derivative of inputs with respect to a number s: piecewise quintic, C^1.

    It is constant before the first and after the last break.

    Attributes:
        coordinates: names and indices of the coordinates.
        breaks: (n_seg + 1,) increasing [s].
        coef: (n_seg, n_vK, 6) ascending powers of the time since the piece began; entries
            of rotations are 0.
        name: name of s, such as ``hand.length[1]``: the value of the second waypoint.
        smooth: whether the inputs are differentiable; otherwise the derivative is one-sided, and
            derivatives by several values must not be added.
    """

    coordinates: CoordinateTable
    breaks: Times
    coef: Array
    name: str
    smooth: bool

    def __post_init__(self) -> None:
        for field in ("breaks", "coef"):
            object.__setattr__(self, field, frozen(getattr(self, field)))

    def evaluate(self, t: float | Times) -> tuple[VecK, VecK, VecK]:
        """dq_K/ds, dv_K/ds and dacc_K/ds, each (..., n_vK), at times (...) [s]."""
        t = np.asarray(t, dtype=float)
        i, s, outside = pieces.located(self.breaks, t.ravel())
        q, v, acc = polynomial.evaluate(self.coef[i], s[:, None])
        v[outside], acc[outside] = 0.0, 0.0
        q, v, acc = (x.reshape(*t.shape, x.shape[-1]) for x in (q, v, acc))
        return q, v, acc

    @classmethod
    def of_waypoints(
        cls,
        table: Table,
        points: Mapping[str, Sequence[Any]],
        *,
        only: Sequence[str] | None = None,
        side: Literal["above", "below"] = "above",
    ) -> tuple[InputDerivative, ...]:
        """The derivatives of ``Input.waypoints(table, points)`` by every value in ``points``.

        Moves through waypoints are not linear in the values: the slope at an inner waypoint is a
        harmonic mean, bounded to prevent overshoot, and 0 where the direction reverses. These
        derivatives are exact. At the point where a bound becomes active, or where two
        neighbouring values are equal, the derivatives on the two sides differ: ``side`` selects
        one, and ``smooth`` is False.

        Args:
            table: coordinate table, or an object with ``.coordinates``.
            points: waypoints, as in :meth:`Input.waypoints`.
            only: coordinates to differentiate by; all by default.
            side: ``above`` for increasing values, or ``below`` for decreasing ones.

        Returns:
            One derivative for each value, in the order of ``points``.

        Raises:
            InputError: a mistake in ``points``, or a rotation among the coordinates.
            UnknownNameError: a name in ``only`` is not in ``points``.
            ValueError: ``side`` is not ``above`` or ``below``.
        """
        if side not in _SIDES:
            raise ValueError(f"side is {side!r}; it must be 'above' or 'below'")
        table, mistakes, sign = reading.table_of(table), Mistakes.of_inputs(), _SIDES[side]
        inputs = Input.waypoints(table, points)
        # A coordinate with a drive is replaced by its command.
        channel_of = {name: table.commands.get(name, name) for name in points}
        for name in only if only is not None else ():
            if name not in channel_of:
                raise UnknownNameError("coordinate of these waypoints", name, list(channel_of))
        names = [name for name in channel_of if only is None or name in only]
        for name in names:
            if channel_of[name] in table.rotations:
                mistakes.add(
                    (name,),
                    "is a rotation, for whose waypoints there is no derivative; leave it out with "
                    "only=[...]",
                )
        mistakes.raise_if_any()
        checked_points = reading.waypoints(table, points, mistakes)
        derivatives = []
        for name in names:
            t, values = checked_points[channel_of[name]]
            t, (_, v) = (
                pieces.snapped_to_breaks(t, inputs.breaks),
                pieces.channel_names(table)[channel_of[name]],
            )
            for k, unit_change in enumerate(np.eye(len(t))):
                derivative, smooth = channel.scalar_waypoints_along(t, values, sign * unit_change)
                coef = np.zeros((len(inputs.coef), table.n_vK, polynomial.N_COEF))
                coef[:, v] = sign * derivative.on(inputs.breaks)[0]
                derivatives.append(cls(table, inputs.breaks, coef, f"{name}[{k}]", smooth))
        return tuple(derivatives)
