"""The mechanism that Sec. VI assumes: a drive on every driven coordinate, with known inertia.

The *mixed* model has the driven coordinates as inputs. The *full* model has drives on all of them:
its q_D holds the puppet's and the mechanism's coordinates, q = [q_D, q_M].
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fantoccini.arrays import Array
from fantoccini.errors import Problem, PuppetError
from fantoccini.marionette import Marionette
from fantoccini.motion import Input, State, Trajectory
from fantoccini.motion.pieces import channel_names
from fantoccini.motion.tangent import between
from fantoccini.puppet import Chain, ComputedTorque, Drive, Parameter, Puppet

MASS, INERTIA, BANDWIDTH = "drive_mass", "drive_inertia", "drive_bandwidth"
"""Parameters of the drives, so that nothing is compiled again when they are varied."""
_ARM = 0.1
"""Radius of inertia of a drive that turns, over the mean length of the strings."""


@dataclass(frozen=True)
class Mechanism:
    """A puppet without drives of its own, and drives for it.

    Attributes:
        mixed: the puppet, its driven coordinates as inputs.
    """

    mixed: Marionette

    @classmethod
    def of(cls, marionette: Marionette) -> Mechanism:
        """Of a puppet, without the drives that its file has.

        Raises:
            PuppetError: it has no driven coordinates, or is a world of several puppets.
        """
        puppet = marionette.model.described
        if len(marionette.world.puppets) > 1:
            raise PuppetError([Problem(
                marionette.name, None, "", f"found a world of {len(marionette.world.puppets)} "
                "puppets; needed: one puppet by itself",
            )])  # fmt: skip
        mixed = Marionette(
            puppet.model_copy(update={"drives": ()}), marionette.model.compiled.progress
        )
        if mixed.coordinates.n_vK == 0:
            file, _ = puppet.locate(puppet.name)
            raise PuppetError([Problem(
                file, None, "", "no coordinate is driven, so that there is no mechanism to reduce; "
                "give a string `length: driven` or an end `driven: [x]`, or a joint `driven: true`",
            )])  # fmt: skip
        return cls(mixed)

    @cached_property
    def lengths(self) -> Array:
        """(n_vK,) bool: driven velocities in m/s; the others are in rad/s."""
        table = self.mixed.coordinates
        units = {row.name: row.unit for row in table.rows}
        found = np.zeros(table.n_vK, dtype=bool)
        for q, v in table.scalars_K:
            found[v] = units[table.q_K[q]] == "m"
        return found

    @cached_property
    def size(self) -> float:
        """Mean length of the strings in the file's pose [m]; 1 without strings."""
        x = self.mixed.state()
        lengths = self.mixed.model.string_lengths(x.q_D, x.q_K)
        return float(np.mean(lengths)) if len(lengths) else 1.0

    @property
    def pace(self) -> float:
        """sqrt(l/g) of a pendulum as long as the strings [s]."""
        g = self.mixed.weight / self.mixed.mass if self.mixed.mass else 1.0
        return float(np.sqrt(self.size / g))

    def inertia(self, ratio: float) -> Array:
        """(n_vK,) reflected inertia of drives of ``ratio`` times the puppet's mass [kg, kg m^2]."""
        mass, turning = self._sizes(ratio)
        return np.where(self.lengths, mass, turning)

    def full(self, ratio: float = 1.0, bandwidth: float | None = None) -> Marionette:
        """The puppet on drives.

        Args:
            ratio: mass of each drive over that of the puppet.
            bandwidth: of a computed-torque control [rad/s]; without it forces move the drives.
        """
        made = Marionette(
            self._on_drives(self.mixed.puppet, bandwidth), self.mixed.model.compiled.progress
        )
        return self.tuned(made, ratio, bandwidth)

    def tuned(self, full: Marionette, ratio: float, bandwidth: float | None = None) -> Marionette:
        """A puppet on drives with other drives; nothing is compiled again."""
        mass, turning = self._sizes(ratio)
        values = {MASS: mass, INERTIA: turning, BANDWIDTH: bandwidth}
        there = full.tree.parameters
        return full.with_parameters({n: v for n, v in values.items() if n in there})

    def state(self, full: Marionette, x: State) -> State:
        """A mixed model's state as one of the full model, commands where and as fast as drives."""
        found = full.state(self.values(x))
        v_K = np.array(found.v_K)
        for row in full.tree.drives:
            if row.command is not None:
                _, v = row.command
                v_K[v : v + row.v.stop - row.v.start] = found.v_D[row.v]
        return found.replace(t=x.t, v_K=v_K)

    def values(self, x: State) -> dict[str, float]:
        """A mixed model's state by name, as :meth:`Marionette.state` takes it."""
        own, values = self.mixed.coordinates, {}
        for names, q in ((own.q_D, x.q_D), (own.q_K, x.q_K)):
            values.update(zip(names, q.tolist(), strict=True))
        for names, v in ((own.v_D, x.v_D), (own.v_K, x.v_K)):
            values.update(zip((f"v:{name}" for name in names), v.tolist(), strict=True))
        return values

    def chained(self, name: str, chain: Chain) -> Mechanism:
        """The same with one string a chain; its drives need :meth:`tuned` of this one."""
        puppet = self.mixed.puppet.expanded()
        strings = tuple(
            s.model_copy(update={"chain": chain}) if s.name == name else s for s in puppet.strings
        )
        heavy = puppet.model_copy(update={"strings": strings})
        return Mechanism(Marionette(heavy, self.mixed.model.compiled.progress))

    def commanded(self, full: Marionette, inputs: Input) -> Input:
        """Inputs of one of these puppets as those of another: of coordinates, or of drives."""
        table, named = full.coordinates, np.zeros(full.coordinates.n_vK, dtype=bool)
        plain = {command: name for name, command in inputs.coordinates.commands.items()}
        coef = np.zeros((len(inputs.coef), table.n_vK, inputs.coef.shape[2]))
        base = np.zeros((len(inputs.base), table.n_qK))
        theirs = channel_names(table)
        for name, (q, v) in channel_names(inputs.coordinates).items():
            own = plain.get(name, name)
            at_q, at_v = theirs[table.commands.get(own, own)]
            coef[:, at_v], base[:, at_q] = inputs.coef[:, v], inputs.base[:, q]
            named[at_v] = inputs.named[v]
        return Input(table, inputs.breaks, coef, base, named)

    def away(self, mixed: Trajectory, run: Trajectory) -> tuple[Array, Array]:
        """How far a run's configurations are from the mixed model's, as tangent vectors.

        Args:
            mixed: a run of the mixed model.
            run: at the same times, of the puppet on drives or with a chain, dynamic or driven.

        Returns:
            (T, n_vD) of the puppet, (T, n_vK) of the mechanism.
        """
        own, theirs = self.mixed.coordinates, run.coordinates
        names, q = [*theirs.q_D, *theirs.q_K], np.hstack([run.q_D, run.q_K])
        found = []
        for of, mine, scalars, quaternions, n in (
            (own.q_D, mixed.q_D, own.scalars_D, own.quaternions_D, own.n_vD),
            (own.q_K, mixed.q_K, own.scalars_K, own.quaternions_K, own.n_vK),
        ):
            places = [names.index(name) for name in of]
            found.append(between(scalars, quaternions, mine, q[:, places], n))
        return found[0], found[1]

    def _sizes(self, ratio: float) -> tuple[float, float]:
        mass = ratio * (self.mixed.mass or 1.0)
        return mass, mass * (_ARM * self.size) ** 2

    def _on_drives(self, puppet: Puppet, bandwidth: float | None) -> Puppet:
        table = self.mixed.coordinates
        control = None
        if bandwidth is not None:
            given = Parameter(parameter=BANDWIDTH, value=bandwidth)
            control = ComputedTorque(type="computed_torque", bandwidth=given)
        mass, turning = self._sizes(1.0)
        straight = [table.q_K[q] for q, v in table.scalars_K if self.lengths[v]]
        turned = [table.q_K[q] for q, v in table.scalars_K if not self.lengths[v]]
        turned += list(table.rotations)
        drives = []
        if straight:
            given = Parameter(parameter=MASS, value=mass)
            drives.append(Drive(on=tuple(straight), mass=given, control=control))
        if turned:
            given = Parameter(parameter=INERTIA, value=turning)
            drives.append(Drive(on=tuple(turned), inertia=given, control=control))
        return puppet.model_copy(update={"drives": tuple(drives)})
