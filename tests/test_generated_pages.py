"""Generated pages name their command, and contain nothing specific to a machine.

`tests/test_site.py` checks their links and pictures.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from docs import gallery

ROOT = Path(__file__).resolve().parents[1]
COMMANDS = {
    "benchmarks": "bench",
    "contact-measured": "stage-report",
    "gallery": "gallery",
    "growth": "growth-report",
    "long-runs": "long-runs-report",
    "planning-measured": "bench-plan",
    "reduction": "reports",
    "strings": "strings-report",
}
"""Page -> target of the Makefile."""


@pytest.mark.parametrize(("page", "command"), COMMANDS.items())
def test_a_page_names_the_command_that_writes_it(page, command):
    text = " ".join((ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8").split())
    assert f"make {command}" in text
    assert re.search(rf"^{command}:", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M)
    assert str(ROOT) not in text and not re.search(r"(?<![\w.])/(home|root|tmp|work)\b", text)


def test_the_gallery_is_fresh():
    assert gallery.PAGE.read_text(encoding="utf-8") == gallery.page()
