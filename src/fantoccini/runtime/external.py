"""An event-driven run whose steps an external solver makes (``event/external_run.hpp``).

    ydot = f(t, y),   y = (q_D, v_D, work, loss, slip loss),   with the active set frozen

The caller integrates f as it likes and reports the state reached. Projection, event detection,
impulses, active sets, breaks of the inputs, samples and events are the runtime's, as for its own
integrator.
"""

from __future__ import annotations

import ctypes

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import Status
from fantoccini.motion import Input, State
from fantoccini.runtime.compiled import Library, Run
from fantoccini.runtime.options import RunOptions

_ADDRESS, _TIME, _NUMBER = ctypes.c_void_p, ctypes.c_double, ctypes.c_double

_SIGNATURES = {
    "set_noise": (None, _NUMBER, _NUMBER),
    "stretch": (ctypes.c_int, _TIME, _ADDRESS, _ADDRESS),
    "look": (None, _TIME, *[_ADDRESS] * 5),
    "settle": (ctypes.c_int, _TIME, _ADDRESS),
    "accept": (ctypes.c_int, _TIME, _ADDRESS, _ADDRESS),
    "react": (ctypes.c_int, _ADDRESS),
    "save": (ctypes.c_int, _TIME, _ADDRESS, _ADDRESS),
    "present": (_TIME, _ADDRESS, _ADDRESS),
}
"""Result and arguments after the run of the functions ``fan_...``."""


class ExternalRun(Run):
    """One event-driven simulation in progress, integrated by the caller.

    Attributes:
        t: present time [s].
        y: (n_y,) what is integrated, at ``t``: q_D [rad, m or 1], v_D [rad/s or m/s], work of the
            inputs, loss to damping and drag, loss of slipping winches [J].
        active_set: (n_rows,) what every row does (``contract.Hold``); 0 for slack.

    Args:
        library, options, x0, p, winches, inputs, save_at: as for :class:`Run`.
        noise: largest error of the integrator in h, relative to the string's length, where a
            released string has hardly opened yet.
        off_manifold: largest violation of taut strings in the states that are evaluated, likewise.
    """

    def __init__(
        self,
        library: Library,
        options: RunOptions,
        x0: State,
        p: Array,
        winches: Array,
        inputs: Input,
        save_at: Array | None = None,
        noise: float = 0.0,
        off_manifold: float = 0.0,
    ):
        dll, sizes = library.dll, library.sizes
        for name, (result, *arguments) in _SIGNATURES.items():
            function = getattr(dll, f"fan_{name}")
            function.restype, function.argtypes = result, [_ADDRESS, *arguments]
        super().__init__(library, "event", options, x0, p, winches, inputs, save_at)
        dll.fan_set_noise(self._run, noise, off_manifold)
        self._out = ctypes.addressof(self._record)
        self._end = ctypes.c_double()
        self._n_y = sizes["n_qD"] + sizes["n_vD"] + 3
        self._refresh()

    def rate(self, t: float, y: Array) -> Array:
        """ydot (n_y,) at a time [s] and y (n_y,), for the present active set."""
        rate = np.empty(self._n_y)
        self._look(t, y, rate, None, None, None)
        return rate

    def guards(self, t: float, y: Array) -> tuple[Array, Array]:
        """The guards at (t, y) and their tolerances, both (n_rows + n_watched,).

        A guard is positive where the present active set no longer holds: h over its length for a
        slack row, the missing tension over the weight for a taut one, for a stepper motor the lag
        beyond what it holds. At an event it lies between 0 and its tolerance.
        """
        n = self.library.n_blamable
        guard, tolerance = np.empty(n), np.empty(n)
        self._look(t, y, None, guard, tolerance, None)
        return guard, tolerance

    def slip(self, t: float, y: Array) -> Array:
        """(n_strings,) what the winches have let out at (t, y) [m]."""
        slip = np.empty(self.library.sizes["n_strings"])
        self._look(t, y, None, None, None, slip)
        return slip

    def settled(self, t: float, y: Array) -> Array | None:
        """The nearest y (n_y,) with unit quaternions and h = hdot = 0 on taut rows, or None."""
        y = self._checked(y).copy()
        status = self.library.dll.fan_settle(self._run, t, y.ctypes.data)
        return y if status == Status.RUNNING else None

    def stretch(self, t_end: float) -> float:
        """The end of the smooth stretch of the inputs from the present time, at most ``t_end`` [s].

        A break at the present time is handled first, which may change the active set and y.
        """
        status = self.library.dll.fan_stretch(
            self._run, t_end, ctypes.addressof(self._end), self._out
        )
        self._refresh(status)
        return self._end.value

    def accept(self, t: float, y: Array) -> None:
        """Makes (t, y), which a step from the present state has reached, the present state."""
        y = self._checked(y)
        status = self.library.dll.fan_accept(self._run, t, y.ctypes.data, self._out)
        self._refresh(status)

    def react(self) -> None:
        """Handles the guards that are positive at the present state: catches, a new active set."""
        self._refresh(self.library.dll.fan_react(self._run, self._out))

    def verdict(self, t_end: float) -> Status:
        """The status of a run that has reached its end."""
        about = ctypes.c_double(t_end), ctypes.c_longlong(0), ctypes.byref(self._record)
        return Status(self.library.dll.fan_run(self._run, *about))

    def save(self, t: float, y: Array) -> Status:
        """Writes the sample of the next time in ``save_at``, from y (n_y,) of the dense output.

        Returns:
            Status.RUNNING, or why there is no sample.
        """
        y = self._checked(y).copy()
        return Status(self.library.dll.fan_save(self._run, t, y.ctypes.data, self._out))

    @property
    def nearly_full(self) -> bool:
        """Whether samples or events fill half of their arrays."""
        record = self._record
        full: bool = 2 * record.n_samples > record.sample_capacity
        return full or 2 * record.n_events > record.event_capacity

    def _look(self, t: float, y: Array, *into: Array | None) -> None:
        """Writes rate, guards, their tolerances and slip at (t, y) where arrays are given."""
        addresses = [None if a is None else a.ctypes.data for a in into]
        self.library.dll.fan_look(self._run, t, self._checked(y).ctypes.data, *addresses)

    def _checked(self, y: Array) -> Array:
        y = np.ascontiguousarray(y, dtype=float)
        if y.shape != (self._n_y,):
            raise ValueError(f"y has the shape {y.shape}; it must be {(self._n_y,)}")
        return y

    def _refresh(self, status: int | None = None) -> None:
        if status is not None:
            self.status = Status(status)
        # New arrays: a solver may keep those it was given.
        self.y = np.empty(self._n_y)
        self.active_set = np.empty(self.library.sizes["n_rows"], dtype=np.int8)
        self.t: float = self.library.dll.fan_present(
            self._run, self.y.ctypes.data, self.active_set.ctypes.data
        )
