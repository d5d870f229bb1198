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
    empty_store = ArrayStore(str(tmp_path / "kept"))
    monkeypatch.setattr(result_cache, "RESULTS", empty_store)
    return empty_store


def are_equal(first: Runs, second: Runs) -> bool:
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
    verification = fan.theatre.verify_play(first)
    assert first.cache.n_computed > 0 and store.files()
    reloaded = fan.load_play(path, on_disk=True)
    second_verification = fan.theatre.verify_play(reloaded)
    assert reloaded.cache.n_computed == 0
    assert np.array_equal(first.score.gesture.coef, reloaded.score.gesture.coef)
    assert are_equal(first.runs(), reloaded.runs()) and are_equal(
        first.runs(exact=True), reloaded.runs(exact=True)
    )
    assert second_verification.run.columns().keys() == verification.run.columns().keys()
    for name, column in verification.run.columns().items():
        assert np.array_equal(second_verification.run[name], column, equal_nan=True), name
    uncached = fan.load_play(path)
    assert uncached.cache.n_computed > 0 and are_equal(uncached.runs(), reloaded.runs())


def test_a_changed_cue_costs_what_it_costs_with_the_version_before(tmp_path):
    path = write_play(tmp_path)
    in_memory, _ = fan.load_play(path), fan.load_play(path, on_disk=True)
    n_computed = in_memory.cache.n_computed
    write_play(tmp_path, CUES.replace("top: 2", "top: 2.2"))
    n_with_previous = fan.load_play(path, before=in_memory).cache.n_computed - n_computed
    reloaded = fan.load_play(path, on_disk=True)
    assert 0 < reloaded.cache.n_computed <= n_with_previous
    uncached = fan.load_play(path)
    assert reloaded.cache.n_computed < uncached.cache.n_computed
    assert np.array_equal(reloaded.score.gesture.coef, uncached.score.gesture.coef)
    assert are_equal(reloaded.runs(), uncached.runs())


def test_without_on_disk_nothing_is_written(tmp_path, store):
    fan.load_play(write_play(tmp_path))
    assert not store.files()


@pytest.mark.parametrize("change", ["code", "puppet", "damage"])
def test_results_of_something_else_are_not_used(tmp_path, store, monkeypatch, change):
    path = write_play(tmp_path)
    first = fan.load_play(path, on_disk=True)
    if change == "code":
        monkeypatch.setattr(result_cache, "results_fingerprint", lambda: "another version")
    elif change == "puppet":
        bob = tmp_path / "bob.yaml"
        bob.write_text(bob.read_text().replace("mass: 0.2", "mass: 0.3"))
    else:
        for file in store.files():
            np.savez(file, arr_0=np.frombuffer(b"[]", dtype=np.uint8))
    reloaded = fan.load_play(path, on_disk=True)
    assert reloaded.cache.n_computed == first.cache.n_computed


@pytest.mark.slow
def test_looks_and_pauses_are_kept(plays: Plays):
    cues = """
        {who: columbine, looks at: pierrot}
        {who: pierrot, does: bow}
        {who: pierrot, does: nod, name: nods}
    """
    first = plays.compile(cues, on_disk=True)
    reloaded = plays.compile(cues, on_disk=True)
    assert first.cache.n_computed > 0 and first.settling_pauses
    assert reloaded.cache.n_computed == 0
    assert (reloaded.changes, reloaded.settling_pauses) == (first.changes, first.settling_pauses)
    for name, motion in first.motions.items():
        assert np.array_equal(motion.coef, reloaded.motions[name].coef)
    assert are_equal(first.runs(), reloaded.runs())
