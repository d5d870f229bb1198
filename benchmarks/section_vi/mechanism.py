"""The mechanism that Sec. VI assumes: a drive of known inertia on every driven coordinate.

The *mixed* model has the driven coordinates as inputs. The *full* model has drives on all of them:
its q_D holds the puppet's and the mechanism's coordinates, q = [q_D, q_M].
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fantoccini.base.arrays import Array
from fantoccini.base.documents import Parameter
from fantoccini.base.tangent import between
from fantoccini.dynamics.marionette import Marionette
from fantoccini.lab.reduction_states import drive_inertia, in_metres, mean_length, without_drives
from fantoccini.model.puppet import Chain, ComputedTorque, Drive, Puppet
from fantoccini.motion import Input, State, Trajectory
from fantoccini.motion.pieces import channel_names

MASS, INERTIA, BANDWIDTH = "drive_mass", "drive_inertia", "drive_bandwidth"
"""Parameters of the drives, so that varying them compiles nothing."""


@dataclass(frozen=True)
class Mechanism:
    """A puppet without the drives of its file, and drives for it.

    Attributes:
        mixed: the puppet, its driven coordinates as inputs.
    """

    mixed: Marionette

    @classmethod
    def of(cls, marionette: Marionette) -> Mechanism:
        """The mechanism of a puppet.

        Raises:
            PuppetError: it has no driven coordinates.
            StateError: it has contact.
        """
        return cls(without_drives(marionette))

    @cached_property
    def in_metres(self) -> NDArray[np.bool_]:
        """(n_vK,) mask of the driven velocities in m/s; the others are in rad/s."""
        return in_metres(self.mixed)[self.mixed.coordinates.n_vD :]

    @cached_property
    def length_scale(self) -> float:
        """Mean string length in the file's pose [m]; 1 without strings."""
        return mean_length(self.mixed)

    @property
    def time_scale(self) -> float:
        """sqrt(l/g) of a pendulum as long as the strings [s]."""
        g = self.mixed.weight / self.mixed.mass if self.mixed.mass else 1.0
        return float(np.sqrt(self.length_scale / g))

    def inertia(self, ratio: float) -> Array:
        """(n_vK,) inertia of drives with ``ratio`` times the puppet's mass [kg or kg m^2]."""
        return np.where(self.in_metres, *drive_inertia(self.mixed, ratio))

    def full(self, ratio: float = 1.0, bandwidth: float | None = None) -> Marionette:
        """The puppet on drives.

        Args:
            ratio: mass of each drive, relative to the puppet's.
            bandwidth: bandwidth of computed-torque control [rad/s]; None for forces as inputs.
        """
        marionette = Marionette(
            self._on_drives(self.mixed.puppet, bandwidth), self.mixed.libraries.progress
        )
        return self.with_drives(marionette, ratio, bandwidth)

    def with_drives(
        self, full: Marionette, ratio: float, bandwidth: float | None = None
    ) -> Marionette:
        """The full model with other drives, without a new compilation."""
        mass, inertia = drive_inertia(self.mixed, ratio)
        values = {MASS: mass, INERTIA: inertia}
        if bandwidth is not None:
            values[BANDWIDTH] = bandwidth
        known = full.tree.parameters
        return full.with_parameters({n: v for n, v in values.items() if n in known})

    def full_state(self, full: Marionette, x: State) -> State:
        """The full model's state for one of the mixed model; commands move with their drives."""
        state = full.state(self.values(x))
        v_K = np.array(state.v_K)
        for row in full.tree.drives:
            if row.command is not None:
                _, v = row.command
                v_K[v : v + row.v.stop - row.v.start] = state.v_D[row.v]
        return state.replace(t=x.t, v_K=v_K)

    def values(self, x: State) -> dict[str, float]:
        """A mixed model's state by name, for :meth:`Marionette.state`."""
        own = self.mixed.coordinates
        values: dict[str, float] = {}
        for names, q in ((own.q_D, x.q_D), (own.q_K, x.q_K)):
            values.update(zip(names, q.tolist(), strict=True))
        for names, v in ((own.v_D, x.v_D), (own.v_K, x.v_K)):
            values.update(zip((f"v:{name}" for name in names), v.tolist(), strict=True))
        return values

    def with_chain(self, name: str, chain: Chain) -> Mechanism:
        """The same with one string as a chain; its mass counts, so scale drives by the original."""
        puppet = self.mixed.puppet.expanded()
        strings = tuple(
            s.model_copy(update={"chain": chain}) if s.name == name else s for s in puppet.strings
        )
        heavy = puppet.model_copy(update={"strings": strings})
        return Mechanism(Marionette(heavy, self.mixed.libraries.progress))

    def translated(self, inputs: Input, target: Marionette) -> Input:
        """Inputs of one model as those of another: coordinates become commands, or the reverse."""
        table, named = target.coordinates, np.zeros(target.coordinates.n_vK, dtype=bool)
        plain = {command: name for name, command in inputs.coordinates.commands.items()}
        coef = np.zeros((len(inputs.coef), table.n_vK, inputs.coef.shape[2]))
        base = np.zeros((len(inputs.base), table.n_qK))
        channels = channel_names(table)
        for name, (q, v) in channel_names(inputs.coordinates).items():
            own = plain.get(name, name)
            at_q, at_v = channels[table.commands.get(own, own)]
            coef[:, at_v], base[:, at_q] = inputs.coef[:, v], inputs.base[:, q]
            named[at_v] = inputs.named[v]
        return Input(table, inputs.breaks, coef, base, named)

    def difference(self, mixed: Trajectory, run: Trajectory) -> tuple[Array, Array]:
        """Differences of a run's configurations from the mixed model's, as tangent vectors.

        Args:
            mixed: a run of the mixed model.
            run: at the same times, of the puppet on drives or with a chain.

        Returns:
            (T, n_vD) of the puppet, (T, n_vK) of the mechanism.
        """
        own, table = self.mixed.coordinates, run.coordinates
        names, q = [*table.q_D, *table.q_K], np.hstack([run.q_D, run.q_K])
        differences = []
        for own_names, reference, scalars, quaternions, n in (
            (own.q_D, mixed.q_D, own.scalars_D, own.quaternions_D, own.n_vD),
            (own.q_K, mixed.q_K, own.scalars_K, own.quaternions_K, own.n_vK),
        ):
            places = [names.index(name) for name in own_names]
            differences.append(between(scalars, quaternions, reference, q[:, places], n))
        return differences[0], differences[1]

    def _on_drives(self, puppet: Puppet, bandwidth: float | None) -> Puppet:
        table = self.mixed.coordinates
        control = None
        if bandwidth is not None:
            parameter_ = Parameter(parameter=BANDWIDTH, value=bandwidth)
            control = ComputedTorque(type="computed_torque", bandwidth=parameter_)
        mass, inertia = drive_inertia(self.mixed)
        linear = [table.q_K[q] for q, v in table.scalars_K if self.in_metres[v]]
        rotary = [table.q_K[q] for q, v in table.scalars_K if not self.in_metres[v]]
        rotary += list(table.rotations)
        drives = []
        if linear:
            mass_parameter = Parameter(parameter=MASS, value=mass)
            drives.append(Drive(on=tuple(linear), mass=mass_parameter, control=control))
        if rotary:
            inertia_parameter = Parameter(parameter=INERTIA, value=inertia)
            drives.append(Drive(on=tuple(rotary), inertia=inertia_parameter, control=control))
        return puppet.model_copy(update={"drives": tuple(drives)})
