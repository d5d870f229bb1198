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
    """Players and props that may touch during a time.

    Attributes:
        begin, end: beginning and end of the time [s].
        players, props: members.
        pairs: pairs that may touch.
        kind: whether a prop ``hangs`` on a forearm, is ``given``, ``put`` or ``picked`` up, or
            somebody ``sits``.
        cue: keys of the cue that begins it; None for one that exists at the start.
        bears: times between which a seat carries the sitter [s].
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
        floors = [FLOOR in pair and bool(pair & props) for pair in self.pairs]
        return not all(a or b for a, b in zip(arms, floors, strict=True))


@dataclass(frozen=True)
class Span:
    """Company over an interval of time.

    Attributes:
        company: the company.
        begin, end: beginning and end of the interval [s].
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
    meetings = [meeting for meeting in meetings if meeting.begin < min(meeting.end, end)]
    cuts = sorted(
        {0.0, end, *(min(t, end) for meeting in meetings for t in (meeting.begin, meeting.end))}
    )
    begins: dict[Company, float] = {}
    intervals = []
    for begin, until in pairwise(cuts):
        present = _companies(players, [m for m in meetings if m.begin <= begin and m.end >= until])
        for ended in [company for company in begins if company not in present]:
            intervals.append(Span(ended, begins.pop(ended), begin))
        for company in present:
            begins.setdefault(company, begin)
    intervals += [Span(company, begin, end) for company, begin in begins.items()]
    return tuple(sorted(intervals, key=lambda span: (span.begin, span.company.players)))


def _companies(players: Sequence[str], meetings: Sequence[Meeting]) -> list[Company]:
    """Groups of players and props that meetings connect."""
    groups: list[set[str]] = [{name} for name in players]
    for meeting in meetings:
        members = {*meeting.players, *meeting.props}
        joined = [group for group in groups if group & members]
        groups = [group for group in groups if group not in joined]
        groups.append(members.union(*joined))
    order = {name: i for i, name in enumerate(players)}
    companies = []
    for group in groups:
        group_meetings = [m for m in meetings if group & {*m.players, *m.props}]
        pairs = frozenset[Pair]().union(*(m.pairs for m in group_meetings))
        group_players = tuple(sorted(group & {*players}, key=order.__getitem__))
        companies.append(Company(group_players, tuple(sorted(group - {*players})), pairs))
    return sorted(companies, key=lambda company: [order[name] for name in company.players])


@dataclass(frozen=True, eq=False)
class Staged:
    """Scene of a company.

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
            in_scene(table, prefix, motions[name]) for name, prefix in self.prefixes.items()
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
            player = players[name]
            assert player.coordinates is not None
            for part, values in parts.items():
                names = getattr(player.coordinates, part)
                indices = [getattr(table, part).index(prefix + coordinate) for coordinate in names]
                values[indices] = getattr(player, part)
            player_rows = [i for i, row in enumerate(rows) if row.startswith(prefix)]
            taut[player_rows] = player.taut
            strings = [i for i in player_rows if i < len(slip)]
            slip[strings] = player.slip if len(player.slip) else 0.0
        for name, local in self.props.items():
            for part, values in zip(("q_D", "v_D"), props[name], strict=True):
                first = getattr(table, part).index(f"{local}.x")
                parts[part][first : first + len(values)] = values
        return State(0.0, **parts, taut=taut, slip=slip, coordinates=table)

    def local(self, name: str) -> str:
        """Name in the scene of a body, a prop, an obstacle or the floor of the stage."""
        for scene_names in (self.props, self.obstacles):
            if name in scene_names:
                return scene_names[name]
        first, dot, rest = name.partition(".")
        if dot and first in self.prefixes:
            return self.prefixes[first] + rest
        return name

    def on_stage(self, name: str) -> str:
        """Name on the stage of a body, a prop, an obstacle or the floor of the scene."""
        for scene_names in (self.props, self.obstacles):
            for original, local in scene_names.items():
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


def with_settled_props(cast: Cast, cache: ResultCache) -> Cast:
    """Cast whose props on forearms hang there in equilibrium at the start.

    Raises:
        StateError: there is no such equilibrium.
    """
    players, prop_states = dict(cast.players), dict(cast.prop_states)
    for who, player in cast.players.items():
        held = [prop for prop in cast.props.values() if prop.held_by == who]
        if not held:
            continue
        pairs = frozenset(hanging_pair(player.bodies, prop.side, prop.name) for prop in held)
        company = Company((who,), tuple(prop.name for prop in held), pairs)
        stage = staged(cast, company, cache)
        # A handle's place is given on the arm of the puppet as its file has it.
        as_written = placed(player.marionette, player.marionette.state(), player.start)
        x = stage.marionette.rest(stage.state({who: as_written}, prop_states))
        table = stage.marionette.coordinates
        q_D = np.array([float(x[name]) for name in player.marionette.coordinates.q_D])
        players[who] = dataclasses.replace(player, x0=player.x0.replace(q_D=q_D))
        for prop in held:
            first = table.q_D.index(f"{stage.props[prop.name]}.x")
            prop_states[prop.name] = (x.q_D[first : first + 7], np.zeros(6))
    x0 = all_together(cast.whole, players, prop_states)
    return dataclasses.replace(cast, players=players, prop_states=prop_states, x0=x0)


def in_scene(table: CoordinateTable, prefix: str, gesture: Gesture) -> Gesture:
    """A player's gesture in the coordinates of a scene, in which its names have a prefix."""
    channels = pieces.channel_names(table)
    coef: Array = np.zeros((len(gesture.coef), table.n_vK, gesture.coef.shape[2]))
    named, travel = np.zeros(table.n_vK, dtype=bool), np.zeros(table.n_vK)
    for channel, (_, v) in pieces.channel_names(gesture.coordinates).items():
        to = channels[prefix + channel][1]
        coef[:, to], named[to] = gesture.coef[:, v], gesture.named[v]
        travel[to] = gesture.travel[v]
    name, marks = gesture.name, gesture.marks
    return Gesture(table, gesture.breaks, coef, named, travel, name, marks, gesture.changes_heading)
