"""Changes along smooth pieces of event-driven runs (``derivatives/flow_derivatives.hpp``)."""

from __future__ import annotations

import ctypes
from typing import NamedTuple

import numpy as np

from fantoccini.base import Array, Status, Times
from fantoccini.kernel.runtime.functions import AnyArray, Functions, pointer
from fantoccini.kernel.runtime.structures import input_arrays, structures
from fantoccini.motion import Input


class FlowChanges(NamedTuple):
    """What n times of a piece have.

    Attributes:
        q_D, v_D: (n, ...) the states.
        changes: (n, 2 n_vD, m) of (q_D, v_D).
        status: ``DONE``, or ``STEP_TOO_SMALL``: the times that were not reached hold nothing.
        step: that would be tried next [s].
    """

    q_D: Array
    v_D: Array
    changes: Array
    status: Status
    step: float


class DerivativeLibrary(Functions):
    """A puppet's library of derivatives."""

    def flow(
        self,
        start: tuple[float, Array, Array, Array],
        times: Times,
        inputs: Input,
        by_inputs: Array,
        held: AnyArray,
        p: Array,
        *,
        rtol: float,
        atol: float,
        step: float,
    ) -> FlowChanges:
        """The state and its changes at some times of a smooth piece.

        Args:
            start: time [s], q_D, v_D, and changes (2 n_vD, m): by the state, then by all
                parameters, then along the inputs.
            times: (n,) increasing, up to the end of the piece [s].
            inputs: of one piece.
            by_inputs: (6, 3 n_vK + n_vD, n_inputs) changes of q_K, v_K, acc_K and u_D in powers of
                the time since the start over the whole.
            held: (n_rows,) bool, the rows that are held.
            p: (n_p,) parameters.
            rtol, atol: of the integration.
            step: that is tried first [s].
        """
        t, q_D, v_D, changes = start
        n, sizes = len(times), self.sizes
        out = FlowChanges(
            np.empty((n, sizes["n_qD"])),
            np.empty((n, sizes["n_vD"])),
            np.empty((n, *changes.shape)),
            Status.DONE,
            step,
        )
        given = {"q_D": q_D, "v_D": v_D, "changes": changes, "times": times, "p": p}
        kept = {name: np.ascontiguousarray(a, dtype=float) for name, a in given.items()}
        kept["by_inputs"] = np.ascontiguousarray(by_inputs, dtype=float)
        rows = np.ascontiguousarray(held, dtype=np.uint8)
        structure, read = input_arrays(inputs)
        arrays = structures["FlowDerivativeArrays"](
            rtol=rtol,
            atol=atol,
            step=step,
            start=t,
            n_times=n,
            input=structure,
            m=changes.shape[1],
            n_inputs=by_inputs.shape[2],
            held=pointer(rows),
            q_D_at=pointer(out.q_D),
            v_D_at=pointer(out.v_D),
            changes_at=pointer(out.changes),
            **{name: pointer(a) for name, a in kept.items()},
        )
        failed = self.dll.fan_flow_derivatives(ctypes.byref(arrays))
        del read  # which the structure points into
        if failed:
            raise MemoryError(f"no memory for {changes.shape[1]} changes")
        return out._replace(status=Status(arrays.status), step=arrays.step)
