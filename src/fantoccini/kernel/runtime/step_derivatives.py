"""Derivatives of many time steps at once (``cpp/fantoccini/derivatives/step_derivatives.hpp``).

n_vD and n_vK are the numbers of dynamic and driven velocities, acc_D and acc_K their accelerations.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from fantoccini.base import Array, Indices, MaskRows
from fantoccini.kernel.runtime.functions import Loaded
from fantoccini.kernel.runtime.packing import new_arrays, packed
from fantoccini.kernel.runtime.touching_steps import StepTouches, in_parts


class StepPartials(NamedTuple):
    """Derivatives of n steps by q_D, v_D, q_K, v_K, acc_K, u_D (on request) and p, in m columns.

    Attributes:
        acc_D: (n, n_vD) mean accelerations over the steps.
        motion: (n, 2 n_vD, m) derivatives of (dq_D, v_D) after the step. Columns of v_K, acc_K of
            driven rotations are by dq_K/dt and dv_K/dt over the step instead.
        pull: (n, n_rows, m) derivatives of the tensions, on request.
        shares: (n, 3 capacity, m) derivatives of the forces of points that push, on request.
        moved: (n, n_vD + n_vK, m) derivatives of the configuration at the touch, on request, of
            steps with a rebound.
    """

    acc_D: Array
    motion: Array
    pull: Array | None
    shares: Array | None
    moved: Array | None


class StepDerivatives(Loaded):
    """A puppet's library of derivatives of time steps."""

    def find(
        self,
        starts: Mapping[str, Array],
        held: MaskRows,
        cap_by: Indices,
        p: Array,
        u_D: Array | None,
        *,
        dt: float,
        recovery_speed: float,
        forces: bool,
        pull: bool,
        shares: bool,
        threads: int,
        touches: StepTouches | None = None,
        motion_out: Array | None = None,
    ) -> StepPartials:
        """The derivatives of n steps.

        Args:
            starts: q_D, v_D, q_K, rate (dq_K/dt over the step), mean (dv_K/dt), slip and tension,
                (n, ...) each.
            held: (n, n_rows) rows held in the steps.
            cap_by: (n_rows,) parameter that is a row's largest tension; -1 for none.
            p: (1 or n, n_p) parameters.
            u_D: (1 or n, n_vD) user forces; None for none.
            dt: length of the steps [s].
            recovery_speed: largest speed at which a violation is corrected [m/s].
            forces: whether to differentiate by u_D, too.
            pull: whether to differentiate the tensions, too.
            shares: whether to differentiate the multipliers of contact points, too.
            threads: number of threads.
            touches: contacts in the steps; its ``edges`` are added to. None without contact.
            motion_out: array for ``motion``, reused from call to call: new pages cost more than the
                derivatives.
        """
        n, sizes = len(held), self.sizes
        n_v, n_k = sizes["n_vD"], sizes["n_vK"]
        m = 2 * n_v + 3 * n_k + (n_v if forces else 0) + sizes["n_p"]
        if motion_out is None or motion_out.shape != (n, 2 * n_v, m):
            motion_out = np.empty((n, 2 * n_v, m))
        names = ("acc_D", *["pull"] * pull)
        if shares and touches is not None:
            names += ("shares", "moved")
        points = 0 if touches is None else touches.points.shape[1]
        results: dict[str, Any] = new_arrays(
            "StepDerivativeArrays", names, sizes, n=n, m=m, capacity=points
        )
        out = StepPartials(
            results["acc_D"],
            motion_out,
            results.get("pull"),
            results.get("shares"),
            results.get("moved"),
        )
        held_points: dict[str, Any] = {}
        if touches is not None:
            held_points["capacity"] = points
            for name in ("n_points", "delay", "points", "screws", "by_p", "edges"):
                held_points[name] = getattr(touches, name)
        arrays = packed(
            "StepDerivativeArrays",
            dt=dt,
            recovery_speed=recovery_speed,
            forces=int(forces),
            p=p,
            u_D=u_D,
            held=held,
            cap_by=cap_by,
            **out._asdict(),
            **starts,
            **held_points,
        )
        in_parts(self.dll.fan_step_derivatives, arrays, n, threads)
        return out
