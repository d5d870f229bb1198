"""Companies: players and props that may touch each other, and are simulated together.

At every time the play is divided into companies; a player that touches nobody is one by itself.
Where a prop is taken, given or left, companies change, and members continue from their states.

A meeting is a time during which certain players and props may touch. q_D are dynamic coordinates,
q_K driven ones (ends and lengths of strings); slip is the length of string that a winch has let out
because the tension was too large. A marionette is a puppet with its compiled equations;
`marionette.puppet` is the description in its file. A taut string pulls, a slack one does not.
Breaks are the times at which the pieces of a motion meet, and `coef` their coefficients.
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
from fantoccini.theatre.cast.casting import Cast, combined_start_state
from fantoccini.theatre.cast.contacts import Pair, contact_rules, hanging_pair
from fantoccini.theatre.cast.players import moved_to_footing
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
            somebody ``sits``, or ``walks`` on the floor.
        cue: keys of the cue that begins it; None for one that exists at the start.
        bearing_interval: times between which a seat carries the sitter [s].
    """

    begin: float
    end: float
    players: tuple[str, ...]
    props: tuple[str, ...]
    pairs: frozenset[Pair]
    kind: MeetingKind
    cue: Spot | None = None
    bearing_interval: tuple[float, float] = (0.0, 0.0)


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
    def has_resting_contact(self) -> bool:
        """Whether somebody sits or walks on the floor, or a prop stands above the floor."""
        props = {*self.props}
        on_forearm = [
            bool(pair & props) and any("." in name for name in pair) for pair in self.pairs
        ]
        on_floor = [FLOOR in pair and bool(pair & props) for pair in self.pairs]
        return not all(a or b for a, b in zip(on_forearm, on_floor, strict=True))


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


def company_spans(
    players: Sequence[str], meetings: Iterable[Meeting], end: float
) -> tuple[Span, ...]:
    """Companies of a play over time, in order of their beginnings.

    Args:
        players: all players, in the order of the cast.
        meetings: pairs that may touch, over time; a player in no meeting is alone.
        end: end of the play [s].
    """
    meetings = [meeting for meeting in meetings if meeting.begin < min(meeting.end, end)]
    boundaries = sorted(
        {0.0, end, *(min(t, end) for meeting in meetings for t in (meeting.begin, meeting.end))}
    )
    begin_times: dict[Company, float] = {}
    intervals = []
    for begin, until in pairwise(boundaries):
        present_companies = _companies(
            players, [m for m in meetings if m.begin <= begin and m.end >= until]
        )
        for ended_company in [
            company for company in begin_times if company not in present_companies
        ]:
            intervals.append(Span(ended_company, begin_times.pop(ended_company), begin))
        for company in present_companies:
            begin_times.setdefault(company, begin)
    intervals += [Span(company, begin, end) for company, begin in begin_times.items()]
    return tuple(sorted(intervals, key=lambda span: (span.begin, span.company.players)))


def _companies(players: Sequence[str], meetings: Sequence[Meeting]) -> list[Company]:
    """Groups of players and props that meetings connect."""
    groups: list[set[str]] = [{name} for name in players]
    for meeting in meetings:
        members = {*meeting.players, *meeting.props}
        touched_groups = [group for group in groups if group & members]
        groups = [group for group in groups if group not in touched_groups]
        groups.append(members.union(*touched_groups))
    order = {name: i for i, name in enumerate(players)}
    companies = []
    for group in groups:
        member_meetings = [m for m in meetings if group & {*m.players, *m.props}]
        pairs = frozenset[Pair]().union(*(m.pairs for m in member_meetings))
        group_players = tuple(sorted(group & {*players}, key=order.__getitem__))
        companies.append(Company(group_players, tuple(sorted(group - {*players})), pairs))
    return sorted(companies, key=lambda company: [order[name] for name in company.players])


@dataclass(frozen=True, eq=False)
class CompanyScene:
    """Scene of a company.

    Attributes:
        company: the company.
        marionette: scene of all members.
        prefixes: player -> prefix of the names of its parts in the scene.
        props: prop -> name in the scene.
        obstacles: obstacle that may be touched -> name in the scene.
        content_key: key that determines the scene.
    """

    company: Company
    marionette: Marionette
    prefixes: Mapping[str, str]
    props: Mapping[str, str]
    obstacles: Mapping[str, str]
    content_key: str

    def motion(self, motions: Mapping[str, Gesture]) -> Gesture:
        """Gesture of the scene from those of the players, each in its own coordinates."""
        table = self.marionette.coordinates
        motion, *other_motions = (
            gesture_in_scene(table, prefix, motions[name]) for name, prefix in self.prefixes.items()
        )
        for other_motion in other_motions:
            motion += other_motion
        return motion

    def state(self, players: Mapping[str, State], props: Mapping[str, PropState]) -> State:
        """State of the scene from those of its members."""
        tree, x = self.marionette.tree, self.marionette.state()
        table = self.marionette.coordinates
        arrays = {name: np.array(getattr(x, name)) for name in ("q_D", "v_D", "q_K", "v_K")}
        row_names = [
            *(string.name for string in tree.strings),
            *(limit.name for limit in tree.limits),
        ]
        taut, slip = np.zeros(len(row_names), dtype=bool), np.zeros(len(tree.strings))
        for name, prefix in self.prefixes.items():
            player = players[name]
            assert player.coordinates is not None
            for array_name, values in arrays.items():
                player_names = getattr(player.coordinates, array_name)
                indices = [
                    getattr(table, array_name).index(prefix + coordinate)
                    for coordinate in player_names
                ]
                values[indices] = getattr(player, array_name)
            player_rows = [i for i, row in enumerate(row_names) if row.startswith(prefix)]
            taut[player_rows] = player.taut
            strings = [i for i in player_rows if i < len(slip)]
            slip[strings] = player.slip if len(player.slip) else 0.0
        for name, local in self.props.items():
            for array_name, values in zip(("q_D", "v_D"), props[name], strict=True):
                start = getattr(table, array_name).index(f"{local}.x")
                arrays[array_name][start : start + len(values)] = values
        return State(0.0, **arrays, taut=taut, slip=slip, coordinates=table)

    def local(self, name: str) -> str:
        """Name in the scene of a body, a prop, an obstacle or the floor of the stage."""
        for scene_names in (self.props, self.obstacles):
            if name in scene_names:
                return scene_names[name]
        player, dot, local_name = name.partition(".")
        if dot and player in self.prefixes:
            return self.prefixes[player] + local_name
        return name

    def on_stage(self, name: str) -> str:
        """Name on the stage of a body, a prop, an obstacle or the floor of the scene."""
        for scene_names in (self.props, self.obstacles):
            for stage_name, scene_name in scene_names.items():
                if name == scene_name or name.startswith(f"{scene_name}."):
                    return stage_name + name.removeprefix(scene_name)
        for player, prefix in self.prefixes.items():
            if prefix and name.startswith(prefix):
                return f"{player}.{name.removeprefix(prefix)}"
        (player_name,) = self.prefixes if len(self.prefixes) == 1 else ("",)
        return name if name == FLOOR or not player_name else f"{player_name}.{name}"


def company_scene(cast: Cast, company: Company, cache: ResultCache) -> CompanyScene:
    """Scene of a company.

    Args:
        cast: cast of the play.
        company: the company.
        cache: cached scenes.
    """
    players = [cast.players[name] for name in company.players]
    if len(players) == 1 and not company.props and not company.pairs:
        (player,) = players
        return CompanyScene(
            company, player.marionette, {player.name: ""}, {}, {}, player.content_hash
        )
    props_of_company = [cast.props[name] for name in company.props]
    touched_names = {name for pair in company.pairs for name in pair}
    obstacles_of_company = [
        obstacle for obstacle in cast.file.stage.obstacles if obstacle.name in touched_names
    ]
    is_single = len(players) == 1
    prefixes = {
        player.name: "" if is_single else f"player_{i}." for i, player in enumerate(players, 1)
    }
    props = {prop.name: f"prop_{i}" for i, prop in enumerate(props_of_company, 1)}
    # Names do not depend on those on the stage, so that equal scenes are compiled once.
    obstacle_names = {
        obstacle.name: f"obstacle_{i}" for i, obstacle in enumerate(obstacles_of_company, 1)
    }
    obstacles = tuple(
        obstacle.model_copy(update={"name": obstacle_names[obstacle.name]})
        for obstacle in obstacles_of_company
    )
    shapes = [*obstacles, *(shape for prop in props_of_company for shape in prop.prop.shapes)]
    local_name = CompanyScene(
        company, players[0].marionette, prefixes, props, obstacle_names, ""
    ).local
    content_key = repr(
        (
            [player.content_hash for player in players],
            [prop.content_key for prop in props_of_company],
            sorted(sorted(map(local_name, pair)) for pair in company.pairs),
            [repr(obstacle) for obstacle in obstacles],
            [solid.digest() for solid in shapes if isinstance(solid, Mesh)],
            cast.file.stage.floor,
        )
    )

    def build() -> Marionette:
        scene = Scene(
            scene="company",
            floor=cast.file.stage.floor,
            contact=contact_rules(company.pairs, local_name),
            puppets=tuple(
                Member(name=f"player_{i}", puppet=player.marionette.puppet)
                for i, player in enumerate(players, 1)
            ),
            props=tuple(
                prop.prop.model_copy(update={"name": props[prop.name]}) for prop in props_of_company
            ),
            obstacles=obstacles,
        )
        return Marionette(scene)

    marionette = cache.get(f"company {content_key}", build)
    return CompanyScene(company, marionette, prefixes, props, obstacle_names, content_key)


def with_settled_props(cast: Cast, cache: ResultCache) -> Cast:
    """Cast whose props on forearms hang there in equilibrium at the start.

    Raises:
        StateError: there is no such equilibrium.
    """
    players, prop_states = dict(cast.players), dict(cast.prop_states)
    for who, player in cast.players.items():
        held_props = [prop for prop in cast.props.values() if prop.held_by == who]
        if not held_props:
            continue
        pairs = frozenset(hanging_pair(player.bodies, prop.side, prop.name) for prop in held_props)
        company = Company((who,), tuple(prop.name for prop in held_props), pairs)
        scene = company_scene(cast, company, cache)
        # A handle's place is given on the arm of the puppet as its file has it.
        as_written = moved_to_footing(player.marionette, player.marionette.state(), player.start)
        x = scene.marionette.rest(scene.state({who: as_written}, prop_states))
        table = scene.marionette.coordinates
        q_D = np.array([float(x[name]) for name in player.marionette.coordinates.q_D])
        players[who] = dataclasses.replace(player, x0=player.x0.replace(q_D=q_D))
        for prop in held_props:
            index = table.q_D.index(f"{scene.props[prop.name]}.x")
            prop_states[prop.name] = (x.q_D[index : index + 7], np.zeros(6))
    x0 = combined_start_state(cast.marionette, players, prop_states)
    return dataclasses.replace(cast, players=players, prop_states=prop_states, x0=x0)


def gesture_in_scene(table: CoordinateTable, prefix: str, gesture: Gesture) -> Gesture:
    """A player's gesture in the coordinates of a scene, in which its names have a prefix."""
    channels = pieces.channel_names(table)
    coef: Array = np.zeros((len(gesture.coef), table.n_vK, gesture.coef.shape[2]))
    named, travel = np.zeros(table.n_vK, dtype=bool), np.zeros(table.n_vK)
    for channel, (_, v) in pieces.channel_names(gesture.coordinates).items():
        v_scene = channels[prefix + channel][1]
        coef[:, v_scene], named[v_scene] = gesture.coef[:, v], gesture.named[v]
        travel[v_scene] = gesture.travel[v]
    name, marks = gesture.name, gesture.marks
    return Gesture(table, gesture.breaks, coef, named, travel, name, marks, gesture.changes_heading)
