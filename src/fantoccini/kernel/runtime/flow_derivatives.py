"""Changes along smooth pieces of event-driven runs (``derivatives/flow_derivatives.hpp``).

A change is a derivative of the state, with a column for each cause. q_D and v_D are the dynamic
coordinates and velocities, v_K and acc_K driven velocities and accelerations.
"""

from __future__ import annotations

import ctypes
from typing import Any, NamedTuple

from fantoccini.base import Array, Status, Times
from fantoccini.kernel.runtime.functions import AnyArray, Functions
from fantoccini.kernel.runtime.inputs import input_arrays
from fantoccini.kernel.runtime.packing import new_arrays, packed
from fantoccini.motion import Input

_RESULTS = ("q_D_at", "v_D_at", "changes_at")


class FlowChanges(NamedTuple):
    """States and changes at n times of a piece.

    Attributes:
        q_D, v_D: (n, ...) the states.
        changes: (n, 2 n_vD, m) of (q_D, v_D).
        status: ``DONE``, or ``STEP_TOO_SMALL``: entries of times not reached are undefined.
        step: length of the next trial step [s].
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
        """The state and its changes at times of a smooth piece.

        Args:
            start: time [s], q_D, v_D, and changes (2 n_vD, m): by the state, then by all
                parameters, then along the inputs.
            times: (n,) increasing, up to the end of the piece [s].
            inputs: inputs with one piece.
            by_inputs: (6, 3 n_vK + n_vD, n_inputs) changes of q_K, v_K, acc_K and u_D in powers of
                the time since the start over the whole.
            held: (n_rows,) bool, the rows that are held.
            p: (n_p,) parameters.
            rtol, atol: tolerances of the integration.
            step: length of the first trial step [s].
        """
        t, q_D, v_D, changes = start
        n, m = len(times), changes.shape[1]
        results = new_arrays("FlowDerivativeArrays", _RESULTS, self.sizes, n_times=n, m=m)
        arrays: Any = packed(
            "FlowDerivativeArrays",
            rtol=rtol,
            atol=atol,
            step=step,
            start=t,
            n_times=n,
            times=times,
            input=input_arrays(inputs),
            m=m,
            n_inputs=by_inputs.shape[2],
            by_inputs=by_inputs,
            p=p,
            held=held,
            q_D=q_D,
            v_D=v_D,
            changes=changes,
            **results,
        )
        failed = self.dll.fan_flow_derivatives(ctypes.byref(arrays))
        if failed:
            raise MemoryError(f"no memory for {m} changes")
        q_D_at, v_D_at, changes_at = (results[name] for name in _RESULTS)
        return FlowChanges(q_D_at, v_D_at, changes_at, Status(arrays.status), arrays.step)
