"""Cases of a sweep: a grid or a list of points, repetitions, and random values for every case.

A case is one combination of values. An axis is one name that varies, with its values.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import Any

import numpy as np

from fantoccini.base import UnknownNameError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.lab.sweeps.case import PARAMETER_PREFIX, PUPPET_KEY, Case
from fantoccini.lab.sweeps.identity import digest
from fantoccini.model.puppet import Puppet
from fantoccini.model.scene import Scene
from fantoccini.motion import Input

REPEAT_AXIS = "repeat"
"""Name of the axis of repetitions."""
CASE_AXIS = "case"
"""Name of the axis of a list of cases."""

Distribution = tuple[float, float] | Callable[[np.random.Generator], Any]
"""Range (low, high) of a uniform distribution, or a function that draws a value."""
VariedValues = Mapping[str, Any] | Sequence[Mapping[str, Any]]
"""Values to combine, name -> values, or a list of cases."""


@dataclass(frozen=True)
class Axis:
    """One axis of the results.

    Attributes:
        name: name of the value; ``case`` for a list of cases, ``repeat`` for repetitions.
        labels: names of the values in tables; numbers and texts are their own labels.
    """

    name: str
    labels: tuple[Any, ...]


@dataclass(frozen=True)
class Design:
    """All cases of a sweep.

    Attributes:
        axes: axes of the results, the slowest first.
        names: names of all values, in the order of tables.
        cases: all cases in order, without their marionettes.
        labels: per case, name -> label of the value in tables.
        keys: per case, a digest of everything that defines it except the study (the function that
            is run for it) and the seed.
        puppets: label -> compiled puppet.
    """

    axes: tuple[Axis, ...]
    names: tuple[str, ...]
    cases: tuple[Case, ...]
    labels: tuple[dict[str, Any], ...]
    keys: tuple[str, ...]
    puppets: dict[str, Marionette]

    @property
    def shape(self) -> tuple[int, ...]:
        """Lengths of the axes."""
        return tuple(len(axis.labels) for axis in self.axes)


@dataclass(frozen=True, eq=False)
class VariedValue:
    """One value of a name that a sweep varies.

    Attributes:
        value: the value.
        label: its name in tables.
        random_key: seed for the random numbers of its cases.
        store_key: digest that identifies its stored results.
    """

    value: Any
    label: Any
    random_key: Any
    store_key: str


def make_design(
    over: VariedValues | None,
    draw: Mapping[str, Distribution] | None,
    seeds: int | None,
    seed: int,
    puppet: Marionette | Puppet | Scene | None,
) -> Design:
    """The cases of a sweep; the arguments are those of :func:`fantoccini.lab.sweep`."""
    seed = check_integer("seed", seed, 0)
    n_repetitions = 1 if seeds is None else check_integer("seeds", seeds, 1)
    draw = dict(draw or {})
    common_puppet = None if puppet is None else _varied_values(PUPPET_KEY, [puppet])[0]
    axes, points = _points(over)
    names = (*points[0], *draw)
    _check_names(names, points[0], draw, common_puppet)
    items = {item.label: item for p in points for n, item in p.items() if n == PUPPET_KEY}
    items |= {} if common_puppet is None else {common_puppet.label: common_puppet}
    puppets = {label: item.value for label, item in items.items()}
    _check_parameters(names, puppets)
    name_keys = {name: int(digest(name), 16) for name in draw}
    cases: list[Case] = []
    labels: list[dict[str, Any]] = []
    keys: list[str] = []
    for point in points:
        random_key = int(digest({n: item.random_key for n, item in point.items()}), 16)
        with_puppet = point | ({PUPPET_KEY: common_puppet} if common_puppet else {})
        store_keys = {n: item.store_key for n, item in with_puppet.items()}
        for repeat in range(n_repetitions):
            entropy = (seed, random_key, repeat)
            random_values = {
                n: _draw(n, distribution, (*entropy, name_keys[n]))
                for n, distribution in draw.items()
            }
            values = {
                n: i.label if n == PUPPET_KEY else i.value for n, i in point.items()
            } | random_values
            if common_puppet is not None:
                values = {PUPPET_KEY: common_puppet.label} | values
            cases.append(Case(len(cases), values, repeat, entropy))
            labels.append({n: item.label for n, item in point.items()} | random_values)
            keys.append(digest([store_keys, random_values, random_key, repeat]))
    _check_unique(keys, labels)
    if seeds is not None:
        axes = (*axes, Axis(REPEAT_AXIS, tuple(range(n_repetitions))))
    return Design(axes, names, tuple(cases), tuple(labels), tuple(keys), puppets)


def _points(over: VariedValues | None) -> tuple[tuple[Axis, ...], list[dict[str, VariedValue]]]:
    """The axes, and all points: all combinations of a mapping's values, or a list of mappings."""
    if over is None or isinstance(over, Mapping):
        columns = {name: _column(name, values) for name, values in (over or {}).items()}
        axes = tuple(Axis(n, tuple(item.label for item in c)) for n, c in columns.items())
        combinations = itertools.product(*columns.values())
        return axes, [dict(zip(columns, point, strict=True)) for point in combinations]
    points = list(over) if isinstance(over, Iterable) and not isinstance(over, str) else []
    if not points or not all(isinstance(p, Mapping) for p in points):
        raise TypeError(
            f"over is {over!r:.80}; it must be a dict of lists, {{'hand.length': [0.7, 0.8]}}, for "
            "all combinations, or a list of dicts, one per case"
        )
    names = list(points[0])
    for k, point in enumerate(points):
        if set(point) != set(names):
            differing = ", ".join(sorted(set(point) ^ set(names)))
            raise ValueError(
                f"`over` lists case 0 and case {k} with different names, {differing}; needed: the "
                "same names in all"
            )
    columns = {name: _varied_values(name, [p[name] for p in points]) for name in names}
    axis = Axis(CASE_AXIS, tuple(range(len(points))))
    return (axis,), [{name: columns[name][k] for name in names} for k in range(len(points))]


def _column(name: str, values: Any) -> list[VariedValue]:
    """The values of an axis: a list, or a mapping label -> value."""
    if isinstance(values, str | Marionette) or not isinstance(values, Iterable):
        raise TypeError(
            f"{name} is {values!r:.80}; it must be a list of values, even for one value"
        )
    labels = [str(label) for label in values] if isinstance(values, Mapping) else None
    value_list = list(values.values() if isinstance(values, Mapping) else values)
    items = _varied_values(name, value_list, labels)
    if not items:
        raise ValueError(f"{name} has no values; give at least one")
    used: set[str] = set()
    for item in items:
        if repr(item.random_key) in used:
            raise ValueError(f"{name} has {item.label!r} twice; seeds=N repeats every case N times")
        used.add(repr(item.random_key))
    return items


def _varied_values(
    name: str, values: list[Any], labels: list[str] | None = None
) -> list[VariedValue]:
    """Values with labels; equal objects share a label, others are numbered."""
    items: list[VariedValue] = []
    label_of_key: dict[str, str] = {}
    label: Any
    random_key: Any
    for k, value in enumerate(values):
        if name == PUPPET_KEY:
            value = _marionette(value)
        elif isinstance(value, np.generic):
            value = value.item()
        key = digest(value)
        if labels is not None:
            label = random_key = labels[k]
        elif isinstance(value, bool | int | float | str) and name != PUPPET_KEY:
            label = random_key = value
        elif isinstance(value, np.ndarray):
            label, random_key = value, key
        else:
            own_name = value.name if isinstance(value, Marionette | Input) else ""
            label = label_of_key.setdefault(
                key, _unused_label(own_name or name, label_of_key, unnumbered=bool(own_name))
            )
            random_key = label if own_name else key
        items.append(VariedValue(value, label, random_key, key))
    return items


def _unused_label(base: str, label_of_key: dict[str, str], unnumbered: bool) -> str:
    """``base`` if it is unused and allowed ``unnumbered``, else with the first free number."""
    used_labels = set(label_of_key.values())
    if unnumbered and base not in used_labels:
        return base
    numbered = (f"{base} {k}" for k in itertools.count(2 if unnumbered else 0))
    return next(label for label in numbered if label not in used_labels)


def _marionette(puppet: Any) -> Marionette:
    if isinstance(puppet, Puppet | Scene):
        return Marionette(puppet)
    if not isinstance(puppet, Marionette):
        raise TypeError(
            f"found the puppet {puppet!r:.80}; it must be a Marionette (from fan.load('arm.yaml') "
            "or fan.puppets.arm2d()), a Puppet or a Scene"
        )
    return puppet


def _draw(name: str, distribution: Any, entropy: tuple[int, ...]) -> Any:
    """A random value for one case.

    Every name has its own entropy, so that adding or removing a name changes no other value.
    """
    rng = np.random.default_rng(np.random.SeedSequence(entropy))
    if hasattr(distribution, "rvs"):
        value = distribution.rvs(random_state=rng)
    elif callable(distribution):
        value = distribution(rng)
    else:
        try:
            low, high = (float(x) for x in distribution)
        except (TypeError, ValueError):
            raise TypeError(
                f"cannot draw {name} from {distribution!r:.80}; give a range (low, high), a "
                "distribution of scipy.stats, or a function of a numpy Generator"
            ) from None
        if not (np.isfinite([low, high]).all() and low <= high):
            raise ValueError(f"cannot draw {name} from {distribution!r}; low must not exceed high")
        value = rng.uniform(low, high)
    return value.item() if isinstance(value, np.generic) else value


def check_integer(name: str, value: Any, minimum: int) -> int:
    """The value as an int; ValueError unless it is an integer and at least ``minimum``."""
    if isinstance(value, bool) or not isinstance(value, Integral) or value < minimum:
        raise ValueError(f"{name} is {value!r}; it must be an integer, {minimum} or more")
    return int(value)


def _check_names(
    names: tuple[str, ...], over: Any, draw: Any, common_puppet: VariedValue | None
) -> None:
    for name in names:
        if not isinstance(name, str) or not name:
            raise TypeError(f"found the name {name!r} in `over` or `draw`; names must be strings")
        if name in over and name in draw:
            raise ValueError(f"{name} is in both `over` and `draw`; needed: only one of them")
        if name in (REPEAT_AXIS, CASE_AXIS):
            raise ValueError(f"no value may be called {name!r}, the name of an axis of the results")
    if PUPPET_KEY in draw or (PUPPET_KEY in names and common_puppet is not None):
        raise ValueError("give puppets in `over`, or one for all cases as puppet=")


def _check_parameters(names: tuple[str, ...], puppets: dict[str, Marionette]) -> None:
    """Raises for a parameter that no puppet has."""
    parameters = [name for m in puppets.values() for name in m.tree.parameters]
    for name in names:
        if name.startswith(PARAMETER_PREFIX) and name[len(PARAMETER_PREFIX) :] not in parameters:
            raise UnknownNameError("parameter", name[len(PARAMETER_PREFIX) :], parameters)


def _check_unique(keys: list[str], labels: list[dict[str, Any]]) -> None:
    first_index: dict[str, int] = {}
    for k, key in enumerate(keys):
        if first_index.setdefault(key, k) != k:
            raise ValueError(
                f"cases {first_index[key]} and {k} are equal, {labels[k]}; seeds=N repeats "
                "every case"
            )
