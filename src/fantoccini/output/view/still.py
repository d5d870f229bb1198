"""Poses by forward kinematics in NumPy, for pictures of a puppet that is not compiled.

A notebook shows a puppet at the end of a cell; compiling it for that would take seconds to minutes.

q_D and q_K are the dynamic and driven coordinates. A taut string pulls, a slack one does not.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from fantoccini.base import Array
from fantoccini.base.documents import Number, Parameter
from fantoccini.dynamics.equilibrium import initial_state
from fantoccini.model.puppet import Puppet
from fantoccini.model.tree import Tree, link_poses, placed, point_position
from fantoccini.motion import State

if TYPE_CHECKING:
    from fantoccini.dynamics.marionette import Marionette


Drawable: TypeAlias = "Marionette | UncompiledPuppet"
"""Puppet that can be drawn."""


def file_value(number: Number) -> float:
    """Value of a number in the puppet's file; for a parameter, its value there."""
    return float(number.value) if isinstance(number, Parameter) else float(number)


class UncompiledPuppet:
    """Puppet without a compiled model; ``number`` returns the values of its numbers."""

    def __init__(self, puppet: Puppet, tree: Tree, number: Callable[[Number], float] = file_value):
        self.puppet, self.tree, self.number = puppet, tree, number
        self.coordinates = tree.coordinates

    @property
    def model(self) -> UncompiledPuppet:
        """This object, which provides numbers and lengths as a compiled model does."""
        return self

    def start(self) -> State:
        """State at rest in the file's pose. Strings without a given length are just taut."""
        coordinates, strings = self.coordinates, self.tree.strings
        q_D, q_K = coordinates.start_D.copy(), coordinates.start_K.copy()
        q_D, q_K = placed(self.tree, q_D, q_K, self.number)
        spans = np.array(
            [
                np.linalg.norm(np.diff(points[0], axis=0), axis=1).sum()
                for points in self.string_points(np.nan_to_num(q_D), np.nan_to_num(q_K)).values()
            ]
        )
        for span, string in zip(spans, strings, strict=True):
            string.set_unknown_length(span, q_D, q_K)
        initial_state.set_commands(self.tree.drives, (), q_D, q_K)
        taut = np.zeros(self.tree.n_rows, dtype=bool)
        lengths = self.string_lengths(q_D, q_K)[0]
        taut[: len(strings)] = spans >= lengths * (1.0 - 1e-3)
        return State(0.0, q_D, np.zeros(coordinates.n_vD), q_K, np.zeros(coordinates.n_vK), taut)

    def poses(self, q_D: Array, q_K: Array) -> Array:
        """(T, n_links, 3, 4) link poses, for (T, n_qD) and (T, n_qK) or one of each."""
        return link_poses(self.tree.links, np.atleast_2d(q_D), np.atleast_2d(q_K), self.number)

    def string_points(self, q_D: Array, q_K: Array) -> dict[str, Array]:
        """String -> (T, n_points, 3) points of its path [m]."""
        poses = self.poses(q_D, q_K)
        return {
            string.name: np.stack(
                [point_position(poses, p, self.number) for p in string.points], axis=1
            )
            for string in self.tree.strings
        }

    def string_lengths(self, q_D: Array, q_K: Array) -> Array:
        """(T, n_strings) lengths [m], for (T, n_qD) and (T, n_qK) or one of each."""
        return self.tree.string_lengths(np.atleast_2d(q_D), np.atleast_2d(q_K), self.number)
