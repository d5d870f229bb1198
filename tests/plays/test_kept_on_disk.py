"""Results of plays kept on disk: the next process computes only what has changed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fantoccini as fan
from fantoccini.kernel.build.kept import ArrayStore
from fantoccini.theatre.cast import result_cache
from fantoccini.theatre.plays.runs import Runs
from plays.conftest import Plays
from plays.tiny import CUES, write_play

pytestmark = pytest.mark.medium


@pytest.fixture(autouse=True)
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ArrayStore:
    """An empty store for every test; an absolute name is a place outside of the cache folder."""
    own = ArrayStore(str(tmp_path / "kept"))
    monkeypatch.setattr(result_cache, "RESULTS", own)
    return own


def same(first: Runs, second: Runs) -> bool:
    """Whether the runs of all players are equal to the bit, with events, ledger and contacts."""
    pairs = [
        (first.players[name].columns(), second.players[name].columns()) for name in first.players
    ]
    return all(
        a.keys() == b.keys() and all(a[name].tobytes() == b[name].tobytes() for name in a)
        for a, b in pairs
    ) and all(first.players[n].events == second.players[n].events for n in first.players)


def test_the_next_process_computes_nothing_and_gets_the_same(tmp_path, store):
    path = write_play(tmp_path)
    first = fan.load_play(path, on_disk=True)
    checked = fan.theatre.verify_play(first)
    assert first.cache.n_computed > 0 and store.files()
    again = fan.load_play(path, on_disk=True)
    rechecked = fan.theatre.verify_play(again)
    assert again.cache.n_computed == 0
    assert np.array_equal(first.score.gesture.coef, again.score.gesture.coef)
    assert same(first.runs(), again.runs()) and same(first.runs(exact=True), again.runs(exact=True))
    assert rechecked.run.columns().keys() == checked.run.columns().keys()
    for name, column in checked.run.columns().items():
        assert np.array_equal(rechecked.run[name], column, equal_nan=True), name
    anew = fan.load_play(path)
    assert anew.cache.n_computed > 0 and same(anew.runs(), again.runs())


def test_a_changed_cue_costs_what_it_costs_with_the_version_before(tmp_path):
    path = write_play(tmp_path)
    in_memory, _ = fan.load_play(path), fan.load_play(path, on_disk=True)
    computed = in_memory.cache.n_computed
    write_play(tmp_path, CUES.replace("top: 2", "top: 2.2"))
    with_before = fan.load_play(path, before=in_memory).cache.n_computed - computed
    again = fan.load_play(path, on_disk=True)
    assert 0 < again.cache.n_computed <= with_before
    anew = fan.load_play(path)
    assert again.cache.n_computed < anew.cache.n_computed
    assert np.array_equal(again.score.gesture.coef, anew.score.gesture.coef)
    assert same(again.runs(), anew.runs())


def test_without_it_nothing_is_written(tmp_path, store):
    fan.load_play(write_play(tmp_path))
    assert not store.files()


@pytest.mark.parametrize("what", ["code", "puppet", "damage"])
def test_results_of_something_else_are_not_used(tmp_path, store, monkeypatch, what):
    path = write_play(tmp_path)
    first = fan.load_play(path, on_disk=True)
    if what == "code":
        monkeypatch.setattr(result_cache, "results_fingerprint", lambda: "another version")
    elif what == "puppet":
        bob = tmp_path / "bob.yaml"
        bob.write_text(bob.read_text().replace("mass: 0.2", "mass: 0.3"))
    else:
        for file in store.files():
            np.savez(file, arr_0=np.frombuffer(b"[]", dtype=np.uint8))
    again = fan.load_play(path, on_disk=True)
    assert again.cache.n_computed == first.cache.n_computed


@pytest.mark.slow
def test_looks_and_pauses_are_kept(plays: Plays):
    cues = """
        {who: columbine, looks at: pierrot}
        {who: pierrot, does: bow}
        {who: pierrot, does: nod, name: nods}
    """
    first = plays.compiled(cues, on_disk=True)
    again = plays.compiled(cues, on_disk=True)
    assert first.cache.n_computed > 0 and first.settling_pauses
    assert again.cache.n_computed == 0
    assert (again.changes, again.settling_pauses) == (first.changes, first.settling_pauses)
    for name, motion in first.motions.items():
        assert np.array_equal(motion.coef, again.motions[name].coef)
    assert same(first.runs(), again.runs())
