"""Cases of a sweep: a grid or a list of points, repetitions, and random values for every case."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import Any

import numpy as np

from fantoccini.base import UnknownNameError
from fantoccini.dynamics.marionette import Marionette
from fantoccini.lab.sweeps.case import PARAMETER_PREFIX, PUPPET, Case
from fantoccini.lab.sweeps.identity import digest
from fantoccini.model.puppet import Puppet
from fantoccini.model.scene import Scene
from fantoccini.motion import Input

REPEAT = "repeat"
"""Name of the axis of repetitions."""
CASE = "case"
"""Name of the axis of a list of cases."""

Draw = tuple[float, float] | Callable[[np.random.Generator], Any]
Over = Mapping[str, Any] | Sequence[Mapping[str, Any]]


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
        keys: per case, a digest of everything that defines it except the study and the seed.
        puppets: label -> marionette.
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
class Item:
    """A varied value.

    Attributes:
        value: the value.
        label: its name in tables.
        stream: identifies its random numbers.
        key: digest that identifies its stored results.
    """

    value: Any
    label: Any
    stream: Any
    key: str


def make_design(
    over: Over | None,
    draw: Mapping[str, Draw] | None,
    seeds: int | None,
    seed: int,
    puppet: Marionette | Puppet | Scene | None,
) -> Design:
    """The cases of a sweep; the arguments are those of :func:`fantoccini.lab.sweep`."""
    seed = check_whole("seed", seed, 0)
    seeds = None if seeds is None else check_whole("seeds", seeds, 1)
    draw = dict(draw or {})
    shared = None if puppet is None else _items(PUPPET, [puppet])[0]
    axes, points = _points(over)
    names = (*points[0], *draw)
    _check_names(names, points[0], draw, shared)
    items = {item.label: item for p in points for n, item in p.items() if n == PUPPET}
    items |= {} if shared is None else {shared.label: shared}
    puppets = {label: item.value for label, item in items.items()}
    _check_parameters(names, puppets)
    streams = {name: int(digest(name), 16) for name in draw}
    cases: list[Case] = []
    labels: list[dict[str, Any]] = []
    keys: list[str] = []
    for point in points:
        stream = int(digest({n: item.stream for n, item in point.items()}), 16)
        point_keys = {
            n: item.key for n, item in (point | ({PUPPET: shared} if shared else {})).items()
        }
        for repeat in range(seeds or 1):
            entropy = (seed, stream, repeat)
            drawn = {
                n: _draw(n, distribution, (*entropy, streams[n]))
                for n, distribution in draw.items()
            }
            values = {n: i.label if n == PUPPET else i.value for n, i in point.items()} | drawn
            if shared is not None:
                values = {PUPPET: shared.label} | values
            cases.append(Case(len(cases), values, repeat, entropy))
            labels.append({n: item.label for n, item in point.items()} | drawn)
            keys.append(digest([point_keys, drawn, stream, repeat]))
    _check_unique(keys, labels)
    if seeds is not None:
        axes = (*axes, Axis(REPEAT, tuple(range(seeds))))
    return Design(axes, names, tuple(cases), tuple(labels), tuple(keys), puppets)


def _points(over: Over | None) -> tuple[tuple[Axis, ...], list[dict[str, Item]]]:
    """The axes, and all points: the product of a mapping's values, or a list of mappings."""
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
                f"cases 0 and {k} of over differ in {differing}; all need the same names"
            )
    columns = {name: _items(name, [p[name] for p in points]) for name in names}
    axis = Axis(CASE, tuple(range(len(points))))
    return (axis,), [{name: columns[name][k] for name in names} for k in range(len(points))]


def _column(name: str, values: Any) -> list[Item]:
    """The values of an axis: a list, or a mapping label -> value."""
    if isinstance(values, str | Marionette) or not isinstance(values, Iterable):
        raise TypeError(
            f"{name} is {values!r:.80}; it must be a list of values, even for one value"
        )
    labels = [str(label) for label in values] if isinstance(values, Mapping) else None
    items = _items(name, list(values.values() if isinstance(values, Mapping) else values), labels)
    if not items:
        raise ValueError(f"{name} has no values; give at least one")
    used: set[str] = set()
    for item in items:
        if repr(item.stream) in used:
            raise ValueError(f"{name} has {item.label!r} twice; seeds=N repeats every case N times")
        used.add(repr(item.stream))
    return items


def _items(name: str, values: list[Any], labels: list[str] | None = None) -> list[Item]:
    """Values with labels; equal objects share a label, others are numbered."""
    items: list[Item] = []
    by_key: dict[str, str] = {}
    label: Any
    stream: Any
    for k, value in enumerate(values):
        if name == PUPPET:
            value = _marionette(value)
        elif isinstance(value, np.generic):
            value = value.item()
        key = digest(value)
        if labels is not None:
            label = stream = labels[k]
        elif isinstance(value, bool | int | float | str) and name != PUPPET:
            label = stream = value
        elif isinstance(value, np.ndarray):
            label, stream = value, key
        else:
            own_name = value.name if isinstance(value, Marionette | Input) else ""
            label = by_key.setdefault(
                key, _unused_label(own_name or name, by_key, bare=bool(own_name))
            )
            stream = label if own_name else key
        items.append(Item(value, label, stream, key))
    return items


def _unused_label(base: str, by_key: dict[str, str], bare: bool) -> str:
    """``base`` if it is unused and ``bare``, otherwise with the first free number appended."""
    taken = set(by_key.values())
    if bare and base not in taken:
        return base
    numbered = (f"{base} {k}" for k in itertools.count(2 if bare else 0))
    return next(label for label in numbered if label not in taken)


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


def check_whole(name: str, value: Any, minimum: int) -> int:
    """The value as an int; ValueError unless it is an integer and at least ``minimum``."""
    if isinstance(value, bool) or not isinstance(value, Integral) or value < minimum:
        raise ValueError(f"{name} is {value!r}; it must be an integer, {minimum} or more")
    return int(value)


def _check_names(names: tuple[str, ...], over: Any, draw: Any, shared: Item | None) -> None:
    for name in names:
        if not isinstance(name, str) or not name:
            raise TypeError(f"found the name {name!r} in over or draw; names must be texts")
        if name in over and name in draw:
            raise ValueError(f"{name} is in over and in draw; a value is varied or drawn, not both")
        if name in (REPEAT, CASE):
            raise ValueError(f"no value may be called {name!r}, the name of an axis of the results")
    if PUPPET in draw or (PUPPET in names and shared is not None):
        raise ValueError("give puppets in over, or one for all cases as puppet=")


def _check_parameters(names: tuple[str, ...], puppets: dict[str, Marionette]) -> None:
    """Raises for a parameter that no puppet has."""
    parameters = [name for m in puppets.values() for name in m.tree.parameters]
    for name in names:
        if name.startswith(PARAMETER_PREFIX) and name[len(PARAMETER_PREFIX) :] not in parameters:
            raise UnknownNameError("parameter", name[len(PARAMETER_PREFIX) :], parameters)


def _check_unique(keys: list[str], labels: list[dict[str, Any]]) -> None:
    first: dict[str, int] = {}
    for k, key in enumerate(keys):
        if first.setdefault(key, k) != k:
            raise ValueError(
                f"cases {first[key]} and {k} are equal, {labels[k]}; seeds=N repeats every case"
            )
