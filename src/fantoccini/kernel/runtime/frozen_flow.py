"""The ODE of an event-driven run between events, for external integrators.

ydot = f(t, y),   y = (q_D, v_D, work, loss, slip loss),   with the active set frozen

The active set consists of the taut strings and closed limits. q_D and v_D are the dynamic
coordinates and velocities; a winch changes the length of a string, and its slip is the length that
it has let out.
"""

from __future__ import annotations

import ctypes

import numpy as np

from fantoccini.base import Array
from fantoccini.kernel.runtime.compiled import Library, Run
from fantoccini.kernel.runtime.options import RunOptions
from fantoccini.motion import Input, State

_ADDRESS, _TIME = ctypes.c_void_p, ctypes.c_double

_SIGNATURES = {
    "evaluate": (None, _TIME, *[_ADDRESS] * 4),
    "smooth_until": (ctypes.c_int, _TIME, _ADDRESS, _ADDRESS),
    "present": (_TIME, _ADDRESS, _ADDRESS),
}
"""ctypes result and arguments of the functions ``fan_...``; the run comes first."""


class FrozenFlow(Run):
    """Right-hand side of the ODE with the active set of the start, evaluated at any (t, y).

    Attributes:
        t: time of the start [s].
        y: (n_y,) at the start: q_D [rad, m or 1], v_D [rad/s or m/s], work of the inputs, loss to
            damping and drag, loss of slipping winches [J].
        active_set: (n_rows,) state of every row, a ``contract.Hold``; 0 for slack.

    Args:
        library, options, x0, p, winches, inputs: see :class:`Run`.
    """

    def __init__(
        self,
        library: Library,
        options: RunOptions,
        x0: State,
        p: Array,
        winches: Array,
        inputs: Input,
    ):
        dll, sizes = library.dll, library.sizes
        for name, (result, *arguments) in _SIGNATURES.items():
            function = getattr(dll, f"fan_{name}")
            function.restype, function.argtypes = result, [_ADDRESS, *arguments]
        super().__init__(library, "event", options, x0, p, winches, inputs)
        self.y = np.empty(sizes["n_qD"] + sizes["n_vD"] + 3)
        self.active_set = np.empty(sizes["n_rows"], dtype=np.int8)
        self.t: float = dll.fan_present(self._run, self.y.ctypes.data, self.active_set.ctypes.data)

    def rate(self, t: float, y: Array) -> Array:
        """The rate ydot (n_y,) at a time [s] and y (n_y,)."""
        rate = np.empty(len(self.y))
        self._evaluate(t, y, rate, None, None)
        return rate

    def guards(self, t: float, y: Array) -> Array:
        """(n_rows + n_watched,) guards at (t, y), positive where the active set no longer holds.

        h / length for a slack row; -tension / weight for a taut row; for a stepper motor, its lag
        minus the largest lag it can hold.
        """
        guards = np.empty(self.library.n_attributable)
        self._evaluate(t, y, None, guards, None)
        return guards

    def slip(self, t: float, y: Array) -> Array:
        """(n_strings,) string length that slipped through each winch, at (t, y) [m]."""
        slip = np.empty(self.library.sizes["n_strings"])
        self._evaluate(t, y, None, None, slip)
        return slip

    def smooth_until(self, t_end: float) -> float:
        """Time up to which the inputs are smooth from the start, at most ``t_end`` [s]."""
        end = ctypes.c_double()
        out = ctypes.addressof(self._record)
        self.library.dll.fan_smooth_until(self._run, t_end, ctypes.addressof(end), out)
        return end.value

    def _evaluate(self, t: float, y: Array, *outputs: Array | None) -> None:
        """Writes rate, guards and slip at (t, y) to the arrays that are not None."""
        y = np.ascontiguousarray(y, dtype=float)
        if y.shape != self.y.shape:
            raise ValueError(f"y has the shape {y.shape}; it must be {self.y.shape}")
        addresses = [None if a is None else a.ctypes.data for a in outputs]
        self.library.dll.fan_evaluate(self._run, t, y.ctypes.data, *addresses)
