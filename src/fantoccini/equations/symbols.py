"""The symbols that all expressions are in, by the paper's letters."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from fantoccini.tree import Tree


@dataclass(frozen=True)
class Symbols:
    """The arguments of every expression.

    Attributes:
        q_D, v_D, acc_D: (n_qD,), (n_vD,), (n_vD,) dynamic configuration, velocity, acceleration.
        q_K, v_K, acc_K: the same of the driven coordinates.
        u_D: (n_vD,) user forces [N or N m].
        v_ahead: (n_vD,) dynamic velocity half a step on, at which a step takes velocity products.
        lam: (n_strings,) multipliers of the strings, minus their tensions [N].
        wrench: (6, n_links) force [N] on each link's centre of mass and torque [N m], world axes.
        dt: step over which joint damping acts implicitly, 0 for the exact equations [s].
        p: (n_p,) parameters.
    """

    q_D: ca.SX
    v_D: ca.SX
    acc_D: ca.SX
    q_K: ca.SX
    v_K: ca.SX
    acc_K: ca.SX
    u_D: ca.SX
    v_ahead: ca.SX
    lam: ca.SX
    wrench: ca.SX
    dt: ca.SX
    p: ca.SX

    @classmethod
    def of(cls, tree: Tree) -> Symbols:
        """Fresh symbols with the sizes of a tree."""
        t = tree.coordinates
        sizes = {
            "q_D": t.n_qD,
            "v_D": t.n_vD,
            "acc_D": t.n_vD,
            "q_K": t.n_qK,
            "v_K": t.n_vK,
            "acc_K": t.n_vK,
            "u_D": t.n_vD,
            "v_ahead": t.n_vD,
            "lam": len(tree.strings),
            "dt": 1,
            "p": len(tree.parameters),
        }
        made = {name: ca.SX.sym(name, size) for name, size in sizes.items()}
        return cls(wrench=ca.SX.sym("wrench", 6, len(tree.links)), **made)
