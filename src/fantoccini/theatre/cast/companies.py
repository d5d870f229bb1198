"""Companies: players and props that may touch each other, and are simulated together.

At every time a play is in companies: who touches nobody is one alone. Where a prop is taken, given
or left, companies change, and the states of their members go on.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fantoccini.base import Array
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.puppet import FLOOR
from fantoccini.model.scene import Member, Scene
from fantoccini.model.tree import CoordinateTable
from fantoccini.motion import State, pieces
from fantoccini.theatre.cast.casting import Cast, all_together, placed
from fantoccini.theatre.cast.contacts import Pair, hanging, rules_of
from fantoccini.theatre.cast.kept import Kept
from fantoccini.theatre.cast.props import PropState
from fantoccini.theatre.gestures import Gesture
from fantoccini.theatre.script import MeetingKind, Spot


@dataclass(frozen=True)
class Meeting:
    """Players and props that may touch for a while.

    Attributes:
        begin, end: [s].
        players, props: who takes part.
        pairs: what may touch.
        kind: whether a prop ``hangs`` on a forearm, is ``given``, ``put`` or ``picked`` up, or
            somebody ``sits``.
        cue: where the cue is written by which it has begun; None from the start on.
        bears: from when to when a seat bears who sits [s].
    """

    begin: float
    end: float
    players: tuple[str, ...]
    props: tuple[str, ...]
    pairs: frozenset[Pair]
    kind: MeetingKind
    cue: Spot | None = None
    bears: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Company:
    """Players and props that are simulated together, in the order of the cast.

    Attributes:
        players, props: who takes part.
        pairs: what may touch.
    """

    players: tuple[str, ...]
    props: tuple[str, ...] = ()
    pairs: frozenset[Pair] = frozenset()

    @property
    def rests(self) -> bool:
        """Whether somebody sits, or a prop stands on something but the floor."""
        props = {*self.props}
        arms = [any(".forearm_" in name for name in pair) for pair in self.pairs]
        falls = [FLOOR in pair and bool(pair & props) for pair in self.pairs]
        return not all(a or b for a, b in zip(arms, falls, strict=True))


@dataclass(frozen=True)
class Span:
    """A company for a while.

    Attributes:
        company: who.
        begin, end: [s].
    """

    company: Company
    begin: float
    end: float


def spans(players: Sequence[str], meetings: Iterable[Meeting], end: float) -> tuple[Span, ...]:
    """The companies of a play over time, in order of their beginnings.

    Args:
        players: all, in the order of the cast.
        meetings: who may touch what, and when; who meets nobody is alone.
        end: of the play [s].
    """
    listed = [meeting for meeting in meetings if meeting.begin < min(meeting.end, end)]
    cuts = sorted({0.0, end, *(min(t, end) for one in listed for t in (one.begin, one.end))})
    open_: dict[Company, float] = {}
    found = []
    for begin, until in pairwise(cuts):
        now = _companies(players, [m for m in listed if m.begin <= begin and m.end >= until])
        for gone in [company for company in open_ if company not in now]:
            found.append(Span(gone, open_.pop(gone), begin))
        for company in now:
            open_.setdefault(company, begin)
    found += [Span(company, begin, end) for company, begin in open_.items()]
    return tuple(sorted(found, key=lambda one: (one.begin, one.company.players)))


def _companies(players: Sequence[str], meetings: Sequence[Meeting]) -> list[Company]:
    """Players and props connected by meetings."""
    groups: list[set[str]] = [{name} for name in players]
    for meeting in meetings:
        own = {*meeting.players, *meeting.props}
        joined = [group for group in groups if group & own]
        groups = [group for group in groups if group not in joined]
        groups.append(own.union(*joined))
    order = {name: i for i, name in enumerate(players)}
    companies = []
    for group in groups:
        own_meetings = [one for one in meetings if group & {*one.players, *one.props}]
        pairs = frozenset[Pair]().union(*(one.pairs for one in own_meetings))
        members = tuple(sorted(group & {*players}, key=order.__getitem__))
        companies.append(Company(members, tuple(sorted(group - {*players})), pairs))
    return sorted(companies, key=lambda one: [order[name] for name in one.players])


@dataclass(frozen=True, eq=False)
class Staged:
    """A company as it is simulated.

    Attributes:
        company: who.
        marionette: all of them.
        prefixes: player -> what stands before the names of its parts there.
        props: prop -> its name there.
        obstacles: obstacle that may be touched -> its name there.
        content: says all that it is.
    """

    company: Company
    marionette: Marionette
    prefixes: Mapping[str, str]
    props: Mapping[str, str]
    obstacles: Mapping[str, str]
    content: str

    def motion(self, motions: Mapping[str, Gesture]) -> Gesture:
        """Motions of the players, each in its own coordinates, as one."""
        table = self.marionette.coordinates
        whole, *others = (
            of_stage(table, prefix, motions[name]) for name, prefix in self.prefixes.items()
        )
        for other in others:
            whole += other
        return whole

    def state(self, players: Mapping[str, State], props: Mapping[str, PropState]) -> State:
        """The state of all from those of its members."""
        tree, x = self.marionette.tree, self.marionette.state()
        table = self.marionette.coordinates
        parts = {name: np.array(getattr(x, name)) for name in ("q_D", "v_D", "q_K", "v_K")}
        rows = [*(string.name for string in tree.strings), *(limit.name for limit in tree.limits)]
        taut, slip = np.zeros(len(rows), dtype=bool), np.zeros(len(tree.strings))
        for name, prefix in self.prefixes.items():
            own = players[name]
            assert own.coordinates is not None
            for part, values in parts.items():
                names = getattr(own.coordinates, part)
                where = [getattr(table, part).index(prefix + one) for one in names]
                values[where] = getattr(own, part)
            mine = [i for i, row in enumerate(rows) if row.startswith(prefix)]
            taut[mine] = own.taut
            strings = [i for i in mine if i < len(slip)]
            slip[strings] = own.slip if len(own.slip) else 0.0
        for name, local in self.props.items():
            for part, values in zip(("q_D", "v_D"), props[name], strict=True):
                first = getattr(table, part).index(f"{local}.x")
                parts[part][first : first + len(values)] = values
        return State(0.0, **parts, taut=taut, slip=slip, coordinates=table)

    def local(self, name: str) -> str:
        """The name there of a body, a prop, an obstacle or the floor of the stage."""
        for named in (self.props, self.obstacles):
            if name in named:
                return named[name]
        first, dot, rest = name.partition(".")
        if dot and first in self.prefixes:
            return self.prefixes[first] + rest
        return name

    def on_stage(self, name: str) -> str:
        """The name on the stage of a body, a prop, an obstacle or the floor there."""
        for named in (self.props, self.obstacles):
            for one, local in named.items():
                if name == local or name.startswith(f"{local}."):
                    return one + name.removeprefix(local)
        for player, prefix in self.prefixes.items():
            if prefix and name.startswith(prefix):
                return f"{player}.{name.removeprefix(prefix)}"
        (only,) = self.prefixes if len(self.prefixes) == 1 else ("",)
        return name if name == FLOOR or not only else f"{only}.{name}"


def staged(cast: Cast, company: Company, kept: Kept) -> Staged:
    """A company as it is simulated.

    Args:
        cast: of the play.
        company: who.
        kept: has what was made before.
    """
    players = [cast.players[name] for name in company.players]
    if len(players) == 1 and not company.props and not company.pairs:
        (only,) = players
        return Staged(company, only.alone, {only.name: ""}, {}, {}, only.content)
    things = [cast.props[name] for name in company.props]
    used = {name for pair in company.pairs for name in pair}
    stand = [obstacle for obstacle in cast.file.stage.obstacles if obstacle.name in used]
    alone = len(players) == 1
    prefixes = {one.name: "" if alone else f"player_{i}." for i, one in enumerate(players, 1)}
    props = {one.name: f"prop_{i}" for i, one in enumerate(things, 1)}
    # All have names of their own there, whatever they are called on the stage.
    names = {one.name: f"obstacle_{i}" for i, one in enumerate(stand, 1)}
    obstacles = tuple(one.model_copy(update={"name": names[one.name]}) for one in stand)
    local = Staged(company, players[0].alone, prefixes, props, names, "").local
    content = repr(
        (
            [player.content for player in players],
            [thing.content for thing in things],
            sorted(sorted(map(local, pair)) for pair in company.pairs),
            [repr(obstacle) for obstacle in obstacles],
            cast.file.stage.floor,
        )
    )

    def made() -> Marionette:
        scene = Scene(
            scene="company",
            floor=cast.file.stage.floor,
            contact=rules_of(company.pairs, local),
            puppets=tuple(
                Member(name=f"player_{i}", puppet=one.alone.puppet)
                for i, one in enumerate(players, 1)
            ),
            props=tuple(
                thing.prop.model_copy(update={"name": props[thing.name]}) for thing in things
            ),
            obstacles=obstacles,
        )
        return Marionette(scene)

    marionette = kept.get(f"company {content}", made)
    return Staged(company, marionette, prefixes, props, names, content)


def settled(cast: Cast, kept: Kept) -> Cast:
    """A cast in which what hangs on forearms at the start hangs there in equilibrium.

    Raises:
        StateError: something does not hang there.
    """
    players, lie = dict(cast.players), dict(cast.lie)
    for who, player in cast.players.items():
        held = [prop for prop in cast.props.values() if prop.held_by == who]
        if not held:
            continue
        pairs = frozenset(hanging(who, one.side, one.name) for one in held)
        company = Company((who,), tuple(one.name for one in held), pairs)
        stage = staged(cast, company, kept)
        # The place of a handle is that on the arm of the puppet as its file has it.
        as_written = placed(player.alone, player.alone.state(), player.start)
        x = stage.marionette.rest(stage.state({who: as_written}, lie))
        table = stage.marionette.coordinates
        own = {name: float(x[name]) for name in player.alone.coordinates.q_D}
        players[who] = dataclasses.replace(
            player, x0=player.x0.replace(q_D=np.array(list(own.values())))
        )
        for one in held:
            first = table.q_D.index(f"{stage.props[one.name]}.x")
            lie[one.name] = (x.q_D[first : first + 7], np.zeros(6))
    x0 = all_together(cast.whole, players, lie)
    return dataclasses.replace(cast, players=players, lie=lie, x0=x0)


def of_stage(table: CoordinateTable, prefix: str, own: Gesture) -> Gesture:
    """A player's gesture in the coordinates of all, where its names have a prefix."""
    known, of_mine = pieces.channel_names(table), pieces.channel_names(own.coordinates)
    coef: Array = np.zeros((len(own.coef), table.n_vK, own.coef.shape[2]))
    named, travel = np.zeros(table.n_vK, dtype=bool), np.zeros(table.n_vK)
    for channel, (_, v) in of_mine.items():
        to = known[prefix + channel][1]
        coef[:, to], named[to], travel[to] = own.coef[:, v], own.named[v], own.travel[v]
    return Gesture(table, own.breaks, coef, named, travel, own.name, own.marks, own.turns)
