"""fantoccini show: pages, files, and its refusals."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import threading
from http.client import HTTPConnection
from pathlib import Path

import numpy as np
import pytest
from tests.cli.command import fantoccini, mistake
from tests.show.viewer import Viewer

import fantoccini as fan

pytestmark = [pytest.mark.medium, pytest.mark.long]

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """File of a run."""
    path = tmp_path_factory.mktemp("run") / "run.npz"
    marionette = fan.puppets.string_pendulum()
    fan.simulate(marionette, marionette.rest(), t_end=0.5).save(path)
    return path


class ShowProcess:
    """`fantoccini show` in a process of its own, and its output."""

    def __init__(self, *arguments: object, folder: Path):
        path = os.pathsep.join([str(ROOT / "src"), os.environ.get("PYTHONPATH", "")])
        self.process = subprocess.Popen(
            [
                sys.executable,
                "-c",
                "from fantoccini.app.cli import main; main()",
                "show",
                *map(str, arguments),
                "--no-browser",
            ],
            env={**os.environ, "PYTHONPATH": path},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=folder,
        )
        self.watch = threading.Timer(90.0, self.process.kill)
        self.watch.start()
        self.url = self.process.stdout.readline().strip()
        self.stderr = ""  # up to the last word before it waits
        while "press Ctrl-C to stop" not in self.stderr and (
            line := self.process.stderr.readline()
        ):
            self.stderr += line

    def end(self, by: int = signal.SIGINT) -> tuple[int, str]:
        """End by Ctrl-C or another signal: the exit code, and the text on stderr."""
        self.process.send_signal(by)
        _, stderr = self.process.communicate()
        self.watch.cancel()
        return self.process.returncode, self.stderr + stderr


def fetch(url: str) -> tuple[int, str]:
    host, port = re.fullmatch(r"http://([\d.]+):(\d+)", url).groups()
    connection = HTTPConnection(host, int(port), timeout=20)
    connection.request("GET", "/")
    response = connection.getresponse()
    return response.status, response.read().decode()


@pytest.mark.parametrize("what", ["puppet", "run"])
def test_a_page_is_served_until_ctrl_c(what, run, tmp_path):
    shown = ShowProcess(
        "string_pendulum" if what == "puppet" else run, "--port", 0, folder=tmp_path
    )
    try:
        status, body = fetch(shown.url)
    finally:
        code, stderr = shown.end()
    assert status == 200 and "<title>string_pendulum</title>" in body
    assert code == 0
    assert "Traceback" not in stderr and "press Ctrl-C to stop" in stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("by", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_recording_is_complete_after_any_end_of_the_program(by, tmp_path):
    if not hasattr(signal, by):
        pytest.skip(f"there is no {by} here")
    shown = ShowProcess("string_pendulum", "--port", 0, folder=tmp_path)
    try:
        with Viewer(shown.url) as viewer:
            viewer.press("Record")
            viewer.wait_for_text("recording 0.5 s")
    finally:
        number = getattr(signal, by)
        code, stderr = shown.end(number)
    (path,) = tmp_path.iterdir()  # no partial file beside it
    assert code == (0 if by == "SIGINT" else 128 + number), stderr
    assert "Traceback" not in stderr and f"wrote {path}" in stderr
    recording = fan.theatre.Recording.load(path)
    assert recording.duration >= 0.45
    assert np.array_equal(recording.replay().q_D, recording.trajectory.q_D)


def test_a_port_in_use_is_reported_and_the_next_free_one_used(tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen(1)
        port = taken.getsockname()[1]
        shown = ShowProcess("string_pendulum", "--port", port, folder=tmp_path)
        try:
            assert fetch(shown.url)[0] == 200
        finally:
            code, stderr = shown.end()
    assert code == 0
    assert f"port {port} is in use; the page is on port {shown.url.rpartition(':')[2]}" in stderr


def test_another_host_is_warned_of(tmp_path):
    shown = ShowProcess("string_pendulum", "--port", 0, "--host", "0.0.0.0", folder=tmp_path)
    _, stderr = shown.end()
    assert "anyone who can reach port" in stderr and "no password" in stderr


def test_changes_of_a_score_are_reported(tmp_path):
    score = tmp_path / "late.yaml"
    score.write_text(
        "score: late\nlanes: {head: [{gesture: nod}]}\n"
        "captions: [{at: 0, until: 100, text: One}]\n",
        encoding="utf-8",
    )
    shown = ShowProcess("marionette", "--port", 0, "--score", score, folder=tmp_path)
    _, stderr = shown.end()
    assert "late.yaml:3: captions[0]" in stderr and "the score ends" in stderr


def test_a_run_is_written_as_one_file(run, tmp_path):
    path = tmp_path / "run.html"
    result = fantoccini("show", run, "--html", path, "--theme", "dark", "--quiet")
    assert result.exit_code == 0, result.stderr
    text = path.read_text(encoding="utf-8")
    assert "__VISER_EMBED_DATA__" in text and "<title>string_pendulum</title>" in text
    assert 0.7e6 < path.stat().st_size < 1.3e6
    assert [p.name for p in tmp_path.iterdir()] == ["run.html"]


def test_a_plan_is_written_with_its_tree(tmp_path):
    plan, page = tmp_path / "plan.npz", tmp_path / "plan.html"
    assert fantoccini("plan", "arm3d_boxes", "--save", plan, "--quiet").exit_code == 0
    assert fantoccini("show", plan, "--html", page, "--quiet").exit_code == 0
    assert page.stat().st_size > 0.8e6


def test_mistakes_are_reported_with_their_places(run, tmp_path):
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text("puppet: wrong\nbodies: []\nstrings: 3\n", encoding="utf-8")
    assert "wrong.yaml:" in mistake("show", wrong)
    assert "no bundled puppet or scene with this name" in mistake("show", "marionete")
    assert "no such file" in mistake("show", tmp_path / "none.npz")
    other = tmp_path / "other.npz"
    np.savez(other, x=np.zeros(3))
    assert "is not a trajectory" in mistake("show", other)
    other.write_bytes(run.read_bytes()[:500])
    assert "is not an npz file of plain arrays" in mistake("show", other)
    assert "applies to runs (.npz) only" in mistake("show", "arm2d", "--html", tmp_path / "x.html")
    assert "allowed: .html" in mistake("show", run, "--html", tmp_path / "x.png")
    assert "--port" in mistake("show", run, "--port", "70000")
    assert "there is no folder" in mistake("show", "arm2d", "--record-to", tmp_path / "none")


def test_an_unusable_address_ends_the_command():
    result = fantoccini("show", "string_pendulum", "--host", "192.0.2.1", "--no-browser")
    assert result.exit_code == 1
    assert "no page can be served at 192.0.2.1, port 8080" in result.stderr


def test_a_problem_file_is_only_for_plans(tmp_path):
    pendulum = fan.puppets.string_pendulum()
    fan.simulate(pendulum, pendulum.rest(), t_end=0.02).save(tmp_path / "run.npz")
    for file in (tmp_path / "run.npz", "arm2d"):
        stderr = mistake("show", file, "--problem", "arm3d_boxes", "--no-browser")
        assert "is not a plan" in stderr and "arm3d_boxes" in stderr
