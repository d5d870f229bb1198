"""The page of a stand's check."""

from __future__ import annotations

import pytest
from tests.stand.hoist import HOIST, STAND, lift

import fantoccini as fan
from fantoccini.base.errors import PictureError
from fantoccini.output import reports
from fantoccini.stand import check_stand, find_slower_tempo, loads_stand


@pytest.fixture(scope="module")
def checked():
    hoist = fan.loads(HOIST)
    text = STAND.replace("TORQUE", "0.05").replace("    speed: 1\n", "    speed: 2\n")
    text = text.replace("stand: one_winch", "about: <b>bold</b> & more\nstand: one_winch")
    return check_stand(loads_stand(text), lift(hoist), hoist)


def test_the_page_has_the_results_of_the_check(checked, tmp_path):
    path = reports.stand_report(checked, tmp_path / "page.html", find_slower_tempo(checked))
    text = path.read_text(encoding="utf-8")
    for words in (
        "verdict fails",
        "Remedies",
        "A slower tempo, simulated again",
        "Lost steps",
        "&lt;b&gt;bold&lt;/b&gt; &amp; more",
        "a motor with",
        "nothing was measured",
    ):
        assert words in text, words
    assert "<b>" not in text and "https://" not in text
    assert text.count("data:image/") == 3


def test_a_page_of_a_stand_without_failures(checked, tmp_path):
    again = check_stand(
        loads_stand(STAND.replace("TORQUE", "1").replace("speed: 1", "speed: 2")),
        checked.run,
        checked.marionette,
    )
    text = reports.stand_report(again, tmp_path / "page.html").read_text(encoding="utf-8")
    assert "verdict holds" in text and "Remedies" not in text


def test_errors_of_writing_a_page(checked, tmp_path):
    with pytest.raises(ValueError, match="ends in"):
        reports.stand_report(checked, tmp_path / "page.pdf")
    with pytest.raises(PictureError, match="no folder"):
        reports.stand_report(checked, tmp_path / "no" / "page.html")
