"""Companies: players and props that may touch each other, and are simulated together.

At every time the play is divided into companies; a player that touches nobody is one by itself.
Where a prop is taken, given or left, companies change, and members continue from their states.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fantoccini.base import Array
from fantoccini.dynamics.marionette import Marionette
from fantoccini.model.puppet import FLOOR, Mesh
from fantoccini.model.scene import Member, Scene
from fantoccini.model.tree import CoordinateTable
from fantoccini.motion import State, pieces
from fantoccini.theatre.cast.casting import Cast, all_together
from fantoccini.theatre.cast.contacts import Pair, contact_rules, hanging_pair
from fantoccini.theatre.cast.players import placed
from fantoccini.theatre.cast.props import PropState
from fantoccini.theatre.cast.result_cache import ResultCache
from fantoccini.theatre.gestures import Gesture
from fantoccini.theatre.script import MeetingKind, Spot


@dataclass(frozen=True)
class Meeting:
    """Players and props that may touch for a while.

    Attributes:
        begin, end: [s].
        players, props: members.
        pairs: pairs that may touch.
        kind: whether a prop ``hangs`` on a forearm, is ``given``, ``put`` or ``picked`` up, or
            somebody ``sits``.
        cue: keys of the cue that begins it; None from the start on.
        bears: times between which a seat bears the sitter [s].
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
        players, props: members.
        pairs: pairs that may touch.
    """

    players: tuple[str, ...]
    props: tuple[str, ...] = ()
    pairs: frozenset[Pair] = frozenset()

    @property
    def rests(self) -> bool:
        """Whether somebody sits, or a prop stands on something other than the floor."""
        props = {*self.props}
        arms = [bool(pair & props) and any("." in name for name in pair) for pair in self.pairs]
        falls = [FLOOR in pair and bool(pair & props) for pair in self.pairs]
        return not all(a or b for a, b in zip(arms, falls, strict=True))


@dataclass(frozen=True)
class Span:
    """A company over an interval of time.

    Attributes:
        company: the company.
        begin, end: [s].
    """

    company: Company
    begin: float
    end: float


def spans(players: Sequence[str], meetings: Iterable[Meeting], end: float) -> tuple[Span, ...]:
    """Companies of a play over time, in order of their beginnings.

    Args:
        players: all players, in the order of the cast.
        meetings: pairs that may touch, over time; a player in no meeting is alone.
        end: end of the play [s].
    """
    listed = [meeting for meeting in meetings if meeting.begin < min(meeting.end, end)]
    cuts = sorted(
        {0.0, end, *(min(t, end) for meeting in listed for t in (meeting.begin, meeting.end))}
    )
    open_: dict[Company, float] = {}
    intervals = []
    for begin, until in pairwise(cuts):
        now = _companies(players, [m for m in listed if m.begin <= begin and m.end >= until])
        for gone in [company for company in open_ if company not in now]:
            intervals.append(Span(gone, open_.pop(gone), begin))
        for company in now:
            open_.setdefault(company, begin)
    intervals += [Span(company, begin, end) for company, begin in open_.items()]
    return tuple(sorted(intervals, key=lambda span: (span.begin, span.company.players)))


def _companies(players: Sequence[str], meetings: Sequence[Meeting]) -> list[Company]:
    """Groups of players and props that meetings connect."""
    groups: list[set[str]] = [{name} for name in players]
    for meeting in meetings:
        own = {*meeting.players, *meeting.props}
        joined = [group for group in groups if group & own]
        groups = [group for group in groups if group not in joined]
        groups.append(own.union(*joined))
    order = {name: i for i, name in enumerate(players)}
    companies = []
    for group in groups:
        own_meetings = [m for m in meetings if group & {*m.players, *m.props}]
        pairs = frozenset[Pair]().union(*(m.pairs for m in own_meetings))
        members = tuple(sorted(group & {*players}, key=order.__getitem__))
        companies.append(Company(members, tuple(sorted(group - {*players})), pairs))
    return sorted(companies, key=lambda company: [order[name] for name in company.players])


@dataclass(frozen=True, eq=False)
class Staged:
    """A company's scene.

    Attributes:
        company: the company.
        marionette: scene of all members.
        prefixes: player -> prefix of the names of its parts in the scene.
        props: prop -> name in the scene.
        obstacles: obstacle that may be touched -> name in the scene.
        content: key that determines the scene.
    """

    company: Company
    marionette: Marionette
    prefixes: Mapping[str, str]
    props: Mapping[str, str]
    obstacles: Mapping[str, str]
    content: str

    def motion(self, motions: Mapping[str, Gesture]) -> Gesture:
        """Gesture of the scene from those of the players, each in its own coordinates."""
        table = self.marionette.coordinates
        whole, *others = (
            of_stage(table, prefix, motions[name]) for name, prefix in self.prefixes.items()
        )
        for other in others:
            whole += other
        return whole

    def state(self, players: Mapping[str, State], props: Mapping[str, PropState]) -> State:
        """State of the scene from those of its members."""
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
                indices = [getattr(table, part).index(prefix + coordinate) for coordinate in names]
                values[indices] = getattr(own, part)
            own_rows = [i for i, row in enumerate(rows) if row.startswith(prefix)]
            taut[own_rows] = own.taut
            strings = [i for i in own_rows if i < len(slip)]
            slip[strings] = own.slip if len(own.slip) else 0.0
        for name, local in self.props.items():
            for part, values in zip(("q_D", "v_D"), props[name], strict=True):
                first = getattr(table, part).index(f"{local}.x")
                parts[part][first : first + len(values)] = values
        return State(0.0, **parts, taut=taut, slip=slip, coordinates=table)

    def local(self, name: str) -> str:
        """Name in the scene of a body, a prop, an obstacle or the floor of the stage."""
        for named in (self.props, self.obstacles):
            if name in named:
                return named[name]
        first, dot, rest = name.partition(".")
        if dot and first in self.prefixes:
            return self.prefixes[first] + rest
        return name

    def on_stage(self, name: str) -> str:
        """Name on the stage of a body, a prop, an obstacle or the floor of the scene."""
        for named in (self.props, self.obstacles):
            for original, local in named.items():
                if name == local or name.startswith(f"{local}."):
                    return original + name.removeprefix(local)
        for player, prefix in self.prefixes.items():
            if prefix and name.startswith(prefix):
                return f"{player}.{name.removeprefix(prefix)}"
        (only,) = self.prefixes if len(self.prefixes) == 1 else ("",)
        return name if name == FLOOR or not only else f"{only}.{name}"


def staged(cast: Cast, company: Company, cache: ResultCache) -> Staged:
    """Scene of a company.

    Args:
        cast: cast of the play.
        company: the company.
        cache: cached scenes.
    """
    players = [cast.players[name] for name in company.players]
    if len(players) == 1 and not company.props and not company.pairs:
        (only,) = players
        return Staged(company, only.marionette, {only.name: ""}, {}, {}, only.content)
    things = [cast.props[name] for name in company.props]
    used = {name for pair in company.pairs for name in pair}
    stand = [obstacle for obstacle in cast.file.stage.obstacles if obstacle.name in used]
    is_single = len(players) == 1
    prefixes = {
        player.name: "" if is_single else f"player_{i}." for i, player in enumerate(players, 1)
    }
    props = {thing.name: f"prop_{i}" for i, thing in enumerate(things, 1)}
    # Names do not depend on those on the stage, so that equal scenes are compiled once.
    names = {obstacle.name: f"obstacle_{i}" for i, obstacle in enumerate(stand, 1)}
    obstacles = tuple(
        obstacle.model_copy(update={"name": names[obstacle.name]}) for obstacle in stand
    )
    solids = [*obstacles, *(shape for thing in things for shape in thing.prop.shapes)]
    local = Staged(company, players[0].marionette, prefixes, props, names, "").local
    content = repr(
        (
            [player.content for player in players],
            [thing.content for thing in things],
            sorted(sorted(map(local, pair)) for pair in company.pairs),
            [repr(obstacle) for obstacle in obstacles],
            [solid.digest() for solid in solids if isinstance(solid, Mesh)],
            cast.file.stage.floor,
        )
    )

    def build() -> Marionette:
        scene = Scene(
            scene="company",
            floor=cast.file.stage.floor,
            contact=contact_rules(company.pairs, local),
            puppets=tuple(
                Member(name=f"player_{i}", puppet=player.marionette.puppet)
                for i, player in enumerate(players, 1)
            ),
            props=tuple(
                thing.prop.model_copy(update={"name": props[thing.name]}) for thing in things
            ),
            obstacles=obstacles,
        )
        return Marionette(scene)

    marionette = cache.get(f"company {content}", build)
    return Staged(company, marionette, prefixes, props, names, content)


def settled(cast: Cast, cache: ResultCache) -> Cast:
    """A cast whose props on forearms hang there in equilibrium at the start.

    Raises:
        StateError: there is no such equilibrium.
    """
    players, lie = dict(cast.players), dict(cast.lie)
    for who, player in cast.players.items():
        held = [prop for prop in cast.props.values() if prop.held_by == who]
        if not held:
            continue
        pairs = frozenset(hanging_pair(player.bodies, prop.side, prop.name) for prop in held)
        company = Company((who,), tuple(prop.name for prop in held), pairs)
        stage = staged(cast, company, cache)
        # A handle's place is given on the arm of the puppet as its file has it.
        as_written = placed(player.marionette, player.marionette.state(), player.start)
        x = stage.marionette.rest(stage.state({who: as_written}, lie))
        table = stage.marionette.coordinates
        own = {name: float(x[name]) for name in player.marionette.coordinates.q_D}
        players[who] = dataclasses.replace(
            player, x0=player.x0.replace(q_D=np.array(list(own.values())))
        )
        for prop in held:
            first = table.q_D.index(f"{stage.props[prop.name]}.x")
            lie[prop.name] = (x.q_D[first : first + 7], np.zeros(6))
    x0 = all_together(cast.whole, players, lie)
    return dataclasses.replace(cast, players=players, lie=lie, x0=x0)


def of_stage(table: CoordinateTable, prefix: str, own: Gesture) -> Gesture:
    """A player's gesture in the coordinates of a scene, in which its names have a prefix."""
    known, own_channels = pieces.channel_names(table), pieces.channel_names(own.coordinates)
    coef: Array = np.zeros((len(own.coef), table.n_vK, own.coef.shape[2]))
    named, travel = np.zeros(table.n_vK, dtype=bool), np.zeros(table.n_vK)
    for channel, (_, v) in own_channels.items():
        to = known[prefix + channel][1]
        coef[:, to], named[to], travel[to] = own.coef[:, v], own.named[v], own.travel[v]
    return Gesture(table, own.breaks, coef, named, travel, own.name, own.marks, own.turns)
