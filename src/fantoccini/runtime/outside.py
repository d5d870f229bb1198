"""An event-driven run stepped from outside: the Python side of ``external_integrator.hpp``.

    ydot = f(t, y),   y = (q_D, v_D, work, loss, slip loss),   with the taut rows frozen

The caller integrates f as it likes and says what it has reached. Projection, detectors, impulses,
modes, breaks of the inputs, rows and events are the runtime's, as for its own integrator.
"""

from __future__ import annotations

import ctypes

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import Status
from fantoccini.runtime.compiled import Run

_ADDRESS, _TIME = ctypes.c_void_p, ctypes.c_double


class OutsideRun(Run):
    """One event-driven simulation in progress, advanced from outside.

    Attributes:
        t: present time [s].
        y: (n_y,) what is integrated, at ``t``: q_D [rad, m or 1], v_D [rad/s or m/s], work of the
            inputs, loss to damping and drag, loss of slipping winches [J].
        mode: (n_rows,) what every row does; 0 for slack.

    Args:
        library, options, x0, p, winches, inputs, save_at: as of :class:`Run`.
        noise: how large the integrator's errors in h may be where a string has just been released
            and has hardly opened yet, relative to its length.
        afield: how far the states that are looked at may be off the taut strings, likewise.
    """

    def __init__(
        self, library, options, x0, p, winches, inputs, save_at=None, noise=0.0, afield=0.0
    ):
        handle, sizes = library.handle, library.sizes
        handle.fan_set_noise.argtypes = [_ADDRESS, ctypes.c_double, ctypes.c_double]
        handle.fan_set_noise.restype = None
        handle.fan_stretch.argtypes = [_ADDRESS, _TIME, _ADDRESS, _ADDRESS]
        handle.fan_look.argtypes = [_ADDRESS, _TIME, *[_ADDRESS] * 5]
        handle.fan_look.restype = None
        handle.fan_settle.argtypes = [_ADDRESS, _TIME, _ADDRESS]
        handle.fan_accept.argtypes = [_ADDRESS, _TIME, _ADDRESS, _ADDRESS]
        handle.fan_react.argtypes = [_ADDRESS, _ADDRESS]
        handle.fan_save.argtypes = [_ADDRESS, _TIME, _ADDRESS, _ADDRESS]
        handle.fan_save.restype = None
        handle.fan_present.argtypes = [_ADDRESS] * 3
        handle.fan_present.restype = ctypes.c_double
        super().__init__(library, "event", options, x0, p, winches, inputs, save_at)
        handle.fan_set_noise(self._run, noise, afield)
        self._out = ctypes.addressof(self._record)
        self._n_slip = sizes["n_strings"]
        self._n_rows = sizes["n_strings"] + sizes["n_limits"]
        self._n_guards = library.n_blamable
        self._end = ctypes.c_double()
        self._n_y = sizes["n_qD"] + sizes["n_vD"] + 3
        self._refresh()

    def rate(self, t: float, y: Array) -> Array:
        """ydot (n_y,) at a time [s] and y (n_y,), in the present mode."""
        y, rate = self._checked(y), np.empty(self._n_y)
        look = self.library.handle.fan_look
        look(self._run, t, y.ctypes.data, rate.ctypes.data, None, None, None)
        return rate

    def guards(self, t: float, y: Array) -> tuple[Array, Array]:
        """The guards at (t, y), and how far beyond its root each may be at its event.

        Returns:
            guard (n_rows + n_watched,), positive where the present mode no longer holds: of a slack
            row h over its length, of a taut one its lacking tension over the weight, of a stepper
            what it lags by beyond what it holds; met, likewise.
        """
        y = self._checked(y)
        guard, met = np.empty(self._n_guards), np.empty(self._n_guards)
        look = self.library.handle.fan_look
        look(self._run, t, y.ctypes.data, None, guard.ctypes.data, met.ctypes.data, None)
        return guard, met

    def slip(self, t: float, y: Array) -> Array:
        """(n_strings,) what the winches have let out at (t, y) [m]."""
        y, slip = self._checked(y), np.empty(self._n_slip)
        look = self.library.handle.fan_look
        look(self._run, t, y.ctypes.data, None, None, None, slip.ctypes.data)
        return slip

    def settled(self, t: float, y: Array) -> Array | None:
        """The nearest y (n_y,) with unit quaternions and the taut rows at h = 0, hdot = 0."""
        y = self._checked(y).copy()
        status = self.library.handle.fan_settle(self._run, t, y.ctypes.data)
        return y if status == Status.RUNNING else None

    def stretch(self, t_end: float) -> float:
        """How far the inputs are smooth from the present time, at most to ``t_end`` [s].

        A break at the present time is dealt with, which may change the mode and y.
        """
        status = self.library.handle.fan_stretch(
            self._run, t_end, ctypes.addressof(self._end), self._out
        )
        self._refresh(status)
        return self._end.value

    def accept(self, t: float, y: Array) -> None:
        """Goes to (t, y), which a step from the present state has reached."""
        y = self._checked(y)
        status = self.library.handle.fan_accept(self._run, t, y.ctypes.data, self._out)
        self._refresh(status)

    def react(self) -> None:
        """Deals with the guards that are positive at the present state: catches, a new mode."""
        self._refresh(self.library.handle.fan_react(self._run, self._out))

    def verdict(self, t_end: float) -> Status:
        """How a run has ended that has reached its end."""
        about = ctypes.c_double(t_end), ctypes.c_longlong(0), ctypes.byref(self._record)
        return Status(self.library.handle.fan_run(self._run, *about))

    def save(self, t: float, y: Array) -> None:
        """Writes the row of the next time to save, at which y (n_y,) is the step's dense output."""
        y = self._checked(y).copy()
        self.library.handle.fan_save(self._run, t, y.ctypes.data, self._out)

    @property
    def nearly_full(self) -> bool:
        """Whether the rows or events that wait to be taken are many."""
        record = self._record
        return (
            2 * record.n_rows > record.row_capacity or 2 * record.n_events > record.event_capacity
        )

    def _checked(self, y: Array) -> Array:
        y = np.ascontiguousarray(y, dtype=float)
        if y.shape != (self._n_y,):
            raise ValueError(f"y has the shape {y.shape}; it must be {(self._n_y,)}")
        return y

    def _refresh(self, status: int | None = None) -> None:
        if status is not None:
            self.status = Status(status)
        # New arrays: a solver may hold on to those it was given.
        self.y, self.mode = np.empty(self._n_y), np.empty(self._n_rows, dtype=np.int8)
        self.t = self.library.handle.fan_present(
            self._run, self.y.ctypes.data, self.mode.ctypes.data
        )
