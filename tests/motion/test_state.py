"""States are values: immutable copies."""

from __future__ import annotations

import numpy as np
import pytest

from fantoccini.base.errors import StateError, UnknownNameError
from fantoccini.motion import EventKind, EventRecord, State


def test_a_state_keeps_its_own_copies():
    q = np.zeros(2)
    state = State(0, q, q, [1], [2], [True, False])
    q[0] = 5.0
    assert state.q_D.tolist() == [0.0, 0.0]
    assert state.q_K.dtype == float and state.taut.dtype == bool
    with pytest.raises(ValueError, match="read-only"):
        state.q_D[0] = 1.0


def test_replace_changes_a_copy():
    state = State(0.0, [1.0], [2.0], [], [], [])
    later = state.replace(t=3.0, v_D=[4.0])
    assert (later.t, later.q_D[0], later.v_D[0]) == (3.0, 1.0, 4.0)
    assert state.t == 0.0


def test_events_have_kinds():
    assert EventRecord(0, "catch", "hand", 1).kind is EventKind.CATCH
    with pytest.raises(ValueError, match="snap"):
        EventRecord(0, "snap")


def test_states_are_equal_by_their_values():
    """States are equal if all their numbers and flags are."""
    x = State(0.0, [1.0], [2.0], [3.0], [4.0], [True], [0.0])
    y = State(0.0, [1.0], [2.0], [3.0], [4.0], [True])
    assert x == y and hash(x) == hash(y) and x in {y}
    assert x == x.replace(v_D=[2.0])
    for change in ({"t": 1.0}, {"q_D": [0.0]}, {"v_K": [0.0]}, {"taut": [False]}, {"slip": [0.1]}):
        assert x != x.replace(**change)
    assert x != "a state" and x.replace(v_K=[0.0]) == x.replace(v_K=[-0.0])


def test_a_coordinate_has_its_name(table):
    """Values are read by `x["crank"]`, `x["v:crank"]` and `x["bar.rotation"]`."""
    q_K = np.arange(1.0, table.n_qK + 1)
    x = State(
        0.0, np.zeros(table.n_qD), np.zeros(table.n_vD), q_K, -np.arange(table.n_vK), [], (), table
    )
    for at, v in table.scalars_K:
        assert x[table.q_K[at]] == q_K[at] and x[f"v:{table.v_K[v]}"] == -v
    for name, (at, _) in table.rotations.items():
        assert x[name].tolist() == q_K[at : at + 4].tolist()
    assert x.replace(t=1.0)[table.q_K[0]] == q_K[0]
    with pytest.raises(UnknownNameError, match="did you mean 'crank'"):
        x["crnk"]
    with pytest.raises(StateError, match=r"replace\(coordinates="):
        State(0.0, [1.0], [2.0], [], [], [])["crank"]
    with pytest.raises(TypeError, match="not iterable"):
        list(x)


def test_a_changed_state_has_no_mode():
    """Changing a state clears its mode, unless a new mode is given."""
    x = State(0.0, [1.0], [2.0], [3.0], [4.0], [True])
    assert x.replace(t=1.0).taut[0] and x.replace(q_D=[1.0]).taut[0]
    for name in ("q_D", "v_D", "q_K", "v_K"):
        assert not x.replace(**{name: [9.0]}).taut[0]
        assert x.replace(**{name: [9.0]}, taut=[True]).taut[0]
