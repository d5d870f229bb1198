"""Pages of the executed examples: source, printed output and pictures."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from docs.site.links import ROOT

FOLDER = ROOT / "examples"
CACHE = ROOT / "build" / "examples"
PICTURES = (".png", ".svg", ".gif")


@dataclass(frozen=True)
class Executed:
    """An executed example.

    Attributes:
        file: source file.
        output: printed output.
        files: files written to ``out``.
    """

    file: Path
    output: str
    files: tuple[Path, ...]

    @property
    def text(self) -> str:
        """The docstring as Markdown."""
        return self.file.read_text(encoding="utf-8").split('"""')[1].strip().replace("``", "`")

    @property
    def title(self) -> str:
        """The file's name in words."""
        return re.sub(r"^\d+_", "", self.file.stem).replace("_", " ").capitalize()

    @property
    def summary(self) -> str:
        """The docstring's first paragraph, without the list of files."""
        return self.text.split("\n\n")[0].split("Writes out/")[0].strip()

    @property
    def pictures(self) -> tuple[Path, ...]:
        return tuple(file for file in self.files if file.suffix in PICTURES)

    def page(self) -> str:
        """The example's page."""
        code = self.file.read_text(encoding="utf-8").split('"""', 2)[2].strip()
        data = "".join(
            f"## {path.name}\n\n```yaml\n{path.read_text(encoding='utf-8').strip()}\n```\n\n"
            for path in sorted(FOLDER.glob("*.yaml"))
            if f'"{path.name}"' in code
        )
        pictures = "\n\n".join(f"![{p.stem}]({p.name})" for p in self.pictures)
        return (
            f"# {self.title}\n\n{self.text}\n\nRun it: `python examples/{self.file.name}`\n\n"
            f"## Source\n\n```python\n{code}\n```\n\n"
            f"## Output\n\n```text\n{self.output.rstrip()}\n```\n\n{pictures}\n\n{data}"
        )


def execute(file: Path) -> Executed:
    """Runs an example in an empty folder, or returns its cached result.

    Raises:
        RuntimeError: The example failed; the message ends with its traceback.
    """
    folder = CACHE / f"{file.stem}-{key(file)}"
    if not (folder / "output.txt").exists():
        for old in CACHE.glob(f"{file.stem}-*"):
            shutil.rmtree(old)
        folder.mkdir(parents=True)
        environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
        done = subprocess.run(
            [sys.executable, str(file)], cwd=folder, env=environment, capture_output=True, text=True
        )
        if done.returncode:
            raise RuntimeError(f"examples/{file.name} failed:\n{done.stderr}")
        (folder / "output.txt").write_text(done.stdout, encoding="utf-8")
    files = sorted(path for path in (folder / "out").rglob("*") if path.is_file())
    return Executed(file, (folder / "output.txt").read_text(encoding="utf-8"), tuple(files))


def key(file: Path) -> str:
    """Hash of everything that determines an example's result: itself, its data, the package."""
    digest = hashlib.sha256(file.read_bytes())
    package = (path for path in (ROOT / "src").rglob("*") if "__pycache__" not in path.parts)
    for path in sorted([*FOLDER.glob("*.yaml"), *package]):
        if path.is_file():
            digest.update(str(path.relative_to(ROOT)).encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def index(examples: list[Executed]) -> str:
    """The list of all examples, each with its first picture."""
    cards = []
    for example in examples:
        picture = (
            f"![{example.title}]({example.pictures[0].name})\n\n    " if example.pictures else ""
        )
        summary = " ".join(example.summary.split())
        cards.append(
            f"-   {picture}**[{example.title}]({example.file.stem}.md)**\n\n    {summary}\n"
        )
    return (
        "# Examples\n\nPick the example nearest to your problem and change it. Each is one file "
        "that runs by itself; the output and the pictures were made when this site was built.\n\n"
        '<div class="grid cards" markdown>\n\n' + "\n".join(cards) + "\n</div>\n"
    )
