"""Python and YAML blocks of the README and the docs work.

The `python` blocks of a page run one after the other, as a reader would type them, in an empty
folder. A `yaml` block that names a file in its first line (`# arm.yaml`, or for inputs `# lift.yaml
for marionette_bar`) is that file, such as a problem or a task; any other is a part to add to the
first puppet file of the page.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from tests.cli.command import fantoccini

import fantoccini as fan
from fantoccini.base.documents.located import read_file, validate
from fantoccini.base.documents.yaml_text import read_text
from fantoccini.lab.identification.schema import RecordFile
from fantoccini.model import puppet, scene
from fantoccini.model.puppet import Puppet
from fantoccini.stand import AxisMap
from fantoccini.theatre.retarget import load_mapping

pytestmark = [pytest.mark.slow, pytest.mark.long]

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def blocks(page: Path, language: str) -> list[str]:
    """The fenced blocks of a page in a language."""
    text = page.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


def with_blocks(language: str) -> list[Path]:
    return [page for page in PAGES if blocks(page, language)]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("page", with_blocks("python"), ids=lambda p: p.stem)
def test_the_python_of_a_page_runs(page, folder, capsys):
    names: dict[str, object] = {"__name__": "__page__"}
    for block in blocks(page, "python"):
        exec(compile(block, str(page), "exec"), names)


@pytest.mark.parametrize("page", with_blocks("yaml"), ids=lambda p: p.stem)
def test_the_files_of_a_page_are_read_and_run(page, folder):
    first: Puppet | None = None
    for block in blocks(page, "yaml"):
        title = re.match(r"# (\w+\.yaml)(?: for (\w+))?$", block, flags=re.MULTILINE)
        if title is None:
            assert first is not None
            puppet.loads(json.dumps(joined(first.model_dump(exclude_unset=True), block)))
        elif re.search("^gesture:", block, flags=re.MULTILINE):
            (folder / title[1]).write_text(block, encoding="utf-8")
            assert fan.theatre.load_gesture(performer(first, title[2]), folder / title[1]).uses
        elif re.search("^score:", block, flags=re.MULTILINE):
            (folder / title[1]).write_text(block, encoding="utf-8")
            assert fan.load_score(performer(first, title[2]), folder / title[1])
        elif re.search("^play:", block, flags=re.MULTILINE):
            (folder / title[1]).write_text(block, encoding="utf-8")
            assert fan.theatre.verify_play(fan.load_play(folder / title[1]))
        elif re.search("^mapping:", block, flags=re.MULTILINE):
            (folder / title[1]).write_text(block, encoding="utf-8")
            assert load_mapping(folder / title[1]).joints
        elif re.search("^record:", block, flags=re.MULTILINE):
            (folder / title[1]).write_text(block, encoding="utf-8")
            assert validate(RecordFile, read_file(folder / title[1])).unknown
        elif re.search("^stand:", block, flags=re.MULTILINE):
            (folder / title[1]).write_text(block, encoding="utf-8")
            stand = fan.stand.load_stand(folder / title[1])
            assert AxisMap.from_stand(stand, fan.load(stand.puppet_path).coordinates).axes
        elif re.search("^problem:", block, flags=re.MULTILINE):
            (folder / title[1]).write_text(block, encoding="utf-8")
            assert fan.control.solve(fan.control.load_problem(folder / title[1]), seed=0)
        elif re.search("^task:", block, flags=re.MULTILINE):
            (folder / title[1]).write_text(block, encoding="utf-8")
            assert fan.optimise(fan.control.load_task(folder / title[1])).holds
        elif title[2]:
            (folder / title[1]).write_text(block, encoding="utf-8")
            marionette = getattr(fan.puppets, title[2])()
            inputs = fan.Input.load(marionette, folder / title[1])
            fan.simulate(marionette, marionette.rest(), inputs)
        else:
            first = scene.loads(block, title[1])
            puppet_of_page = fan.Marionette(first)
            if block.startswith(f"# {title[1]}\nscene:"):
                puppet_of_page.state()  # a ball in the air has no rest
            else:
                puppet_of_page.rest()


def performer(of_page: Puppet | None, name: str | None) -> fan.Marionette:
    """Puppet of a gesture or score: as its title or its page says, or the marionette."""
    if name is None and of_page is not None:
        return fan.Marionette(of_page)
    marionette: fan.Marionette = getattr(fan.puppets, name or "marionette")()
    return marionette


def joined(whole: dict, part: str) -> dict:
    """A puppet's data with a part of a file added: lists and mappings are extended."""
    for key, value in read_text(part).data.items():
        old = whole.get(key)
        if isinstance(value, list):
            value = [*(old or ()), *value]
        elif key == "pose":
            value = {**(old or {}), **value}
        whole[key] = value
    return whole


def test_the_readmes_commands_run(folder):
    page = ROOT / "README.md"
    for block in blocks(page, "yaml"):
        (folder / block.split()[1]).write_text(block, encoding="utf-8")
    lines = [line for block in blocks(page, "sh") for line in block.splitlines()]
    commands = [line.split()[1:] for line in lines if line.startswith("fantoccini ")]
    for command in commands:
        done = fantoccini(*command)
        assert done.exit_code == 0, (command, done.stderr)
    written = {path.name for path in folder.iterdir()}
    assert written == {
        "pendulum.yaml",
        "pendulum.npz",
        "pendulum.png",
        "pendulum.html",
        "plan.png",
        "jumps.mp4",
    }


def test_the_readme_opens_with_the_two_commands():
    first = blocks(ROOT / "README.md", "(?:sh|console)?")[0]
    assert [line.split("#")[0].strip() for line in first.splitlines()] == ["make demo", "make test"]
