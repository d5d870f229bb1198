"""States are values: copies that nobody can change."""

from __future__ import annotations

import numpy as np
import pytest

from fantoccini.motion import Event, EventKind, State


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
    assert Event(0, "catch", "hand", 1).kind is EventKind.CATCH
    with pytest.raises(ValueError, match="snap"):
        Event(0, "snap")
