"""Beats of a performance."""

from __future__ import annotations

import pytest

from fantoccini.theatre.perform.tempo import Tempo


def test_beats_are_continuous_where_the_tempo_changes():
    tempo = Tempo(120.0)
    assert tempo.beat == 0.5 and tempo.beat_number(1.25) == 2.5
    assert tempo.next_beat_time(1.25) == 1.5 and tempo.next_beat_time(1.5) == 1.5
    tempo.set(60.0, 1.25)
    assert tempo.beat_number(1.25) == 2.5
    assert tempo.next_beat_time(1.25) == pytest.approx(1.75)


def test_taps_give_tempo_and_phase():
    tempo = Tempo(90.0)
    for k in range(5):
        tempo.tap(10.03 + 0.3 * k, 100.0 + 0.6 * k)  # the performance at half speed
    assert tempo.bpm == pytest.approx(100.0)
    assert tempo.next_beat_time(10.03 + 1.2) == pytest.approx(10.03 + 1.2)
    assert tempo.beat_number(10.03 + 1.2) == round(tempo.beat_number(10.03 + 1.2))
    # After a pause a tap counts as the first: it sets the beat, not the tempo.
    tempo.tap(30.0, 130.0)
    assert tempo.bpm == pytest.approx(100.0)
    assert tempo.next_beat_time(30.0) == 30.0


def test_a_tempo_is_one_that_can_be_tapped():
    tempo = Tempo(1.0)
    assert tempo.bpm == 30.0
    tempo.tap(0.0, 0.0)
    tempo.tap(0.01, 0.01)
    assert tempo.bpm == 240.0
    tempo.tap(0.01, 0.01)
    with pytest.raises(ValueError, match="bpm"):
        tempo.set(float("nan"), 0.0)
