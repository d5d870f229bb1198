"""Ctrl-C of `fantoccini stand stream` in a process of its own, on emulated controllers."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from tests.cli.command import fantoccini
from tests.stand.hoist import HOIST, STAND, lift

import fantoccini as fan
from fantoccini.app.cli import stand_motion, stand_sending
from fantoccini.stand import (
    Emulator,
    GrblMachine,
    Receiver,
    gcode,
    gcode_lines,
    grbl_settings,
    sending,
)
from fantoccini.stand.sending import REPEAT_TIME

pytestmark = [
    pytest.mark.medium,
    pytest.mark.long,
    pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals, no SIGINT"),
]
ROOT = Path(__file__).resolve().parents[2]
PATIENT_COMMAND = (
    "from fantoccini.stand import sending; sending.MAX_DELAY = 5.0; "
    "from fantoccini.app.cli import main; main()"
)
"""The command line, on a machine that may be busy."""
PACE = 0.02
"""Duration of a line of the emulated GRBL [s]; 80 lines take 1.6 s."""


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stream")
    (folder / "hoist.yaml").write_text(HOIST)
    text = "puppet: hoist.yaml\n" + STAND.replace("    speed: 1\n", "    speed: 2\n").lstrip()
    (folder / "stand.yaml").write_text(text.replace("TORQUE", "0.5"))
    lift(fan.load(folder / "hoist.yaml")).save(folder / "run.npz")
    return folder


def points_of(files, kind):
    run = fan.Trajectory.load(files / "run.npz")
    return fan.stand.set_points(files / "stand.yaml", run, controller=kind)


class Process:
    """A running stream and its output."""

    def __init__(self, files, *arguments):
        path = os.pathsep.join([str(ROOT / "src"), os.environ.get("PYTHONPATH", "")])
        self.process = subprocess.Popen(
            [
                sys.executable,
                "-c",
                PATIENT_COMMAND,
                "stand",
                "stream",
                "stand.yaml",
                "run.npz",
                *map(str, arguments),
            ],
            env={**os.environ, "PYTHONPATH": path},
            stdin=subprocess.PIPE,
            text=True,
            cwd=files,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        self.watch = threading.Timer(120.0, self.process.kill)
        self.watch.start()
        self.stderr = ""

    def interrupt(self):
        self.process.send_signal(signal.SIGINT)

    def read_until(self, words):
        """Read until the output contains these words."""
        while words not in self.stderr:
            line = self.process.stderr.readline()
            assert line, self.stderr
            self.stderr += line

    def end(self, given=None):
        """Exit code and output of the process."""
        out, stderr = self.process.communicate(given)
        self.watch.cancel()
        return self.process.returncode, out, self.stderr + stderr


@contextmanager
def streaming(files, *arguments):
    process = Process(files, *arguments)
    try:
        yield process
    finally:
        process.process.kill()
        process.watch.cancel()


def wait_until(condition):
    end = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.005)


def machine_of(points):
    return GrblMachine(grbl_settings(points.map.stand, points.controller, points.rate))


def test_two_ctrl_c_stop_grbl_and_it_resumes_from_the_line(files):
    points = points_of(files, "grbl")
    lines = [line.text for line in gcode_lines(gcode(points))]
    with Emulator(machine_of(points), pace=PACE) as emulator:
        machine = emulator.machine
        options = ("--controller", "grbl", "--port", emulator.port)
        with streaming(files, *options) as process:
            wait_until(lambda: len(emulator.lines) > 30)
            process.interrupt()
            process.read_until("Ctrl-C stops\n")
            time.sleep(0.1)
            assert emulator.held
            n_taken = len(emulator.lines)
            time.sleep(5 * PACE)
            assert len(emulator.lines) == n_taken < len(lines)
            process.interrupt()
            code, _, stderr = process.end()
        time.sleep(0.1)
        assert code == 130
        assert emulator.resets == 1 and not emulator.held
        stopped_at = machine.positions(np.array([np.inf]))[0, 0]
        # The controller still knows its position: the end of its last move.
        assert machine.position[0] == stopped_at
        p = 1e3 * points.motion.position[:, 0]
        assert np.min(p) < stopped_at < np.max(p)
        assert re.search(r"line \d+: 'G1X\S+': stopped here", stderr)
        line = re.search(r"continue with --from-line (\d+)", stderr)[1]
        number = gcode_lines(gcode(points))[n_taken - 1].number
        assert int(re.search(r"accepted all lines up to (\d+)", stderr)[1]) == number
        assert 1 < number - int(line) <= points.controller.planner
        begun = machine.time
        with streaming(files, *options, "--from-line", line) as process:
            code, out, stderr = process.end()
        assert code == 0, stderr
        assert "characters in transit" in out
    machine.finish()
    assert machine.position[0] == pytest.approx(p[-1], abs=0.02)
    # It continues from its position, without a jump, and no move is missing.
    assert machine.positions(np.array([begun]))[0, 0] == stopped_at
    t = np.linspace(begun, machine.time, 5000)
    at = machine.positions(t)[:, 0]
    top = 1e3 * np.max(np.abs(points.motion.velocity))
    assert np.max(np.abs(np.diff(at))) < 1.2 * top * (t[1] - t[0]) + 2.0 * 0.02  # and two steps
    assert np.min(at) == pytest.approx(np.min(p), abs=0.02)


@pytest.mark.parametrize("event", ["restarts", "is unplugged"])
def test_a_controller_that_restarts_or_is_unplugged_is_noticed_at_once(files, event):
    points = points_of(files, "grbl")
    with Emulator(machine_of(points), pace=PACE) as emulator:
        options = ("--controller", "grbl", "--port", emulator.port)
        with streaming(files, *options) as process:
            wait_until(lambda: len(emulator.lines) > 40)
            last_line, begun = gcode_lines(gcode(points))[len(emulator.lines) - 1], time.monotonic()
            if event == "restarts":
                terminal = os.open(emulator.port, os.O_WRONLY | os.O_NOCTTY)
                os.write(terminal, b"\x18")
                os.close(terminal)
            else:
                emulator.unplug()
            code, _, stderr = process.end()
            seconds = time.monotonic() - begun
    assert code == 1 and "Traceback" not in stderr
    assert (
        "controller restarted" in stderr if event == "restarts" else "connection is lost" in stderr
    )
    assert seconds < 15.0  # much less than the 30 s of a silent controller
    line = int(re.search(r"continue with --from-line (\d+)", stderr)[1])
    assert 0 < last_line.number - line <= points.controller.planner + 4


class RealTimeMachine(GrblMachine):
    """A controller that acknowledges the end of its program when its moves have ended."""

    def answer(self, text):
        begun, answer = self.time, super().answer(text)
        if text == "M2":
            time.sleep(self.time - begun)
        return answer


def test_a_long_move_to_the_parking_position_is_no_silence(files, monkeypatch):
    stand = (files / "stand.yaml").read_text() + "    home: {towards: min, at: 0.2, speed: 0.1}\n"
    (files / "home.yaml").write_text(stand)
    points = points_of(files, "grbl")
    machine = RealTimeMachine(grbl_settings(points.map.stand, points.controller, points.rate))
    monkeypatch.setattr(stand_sending, "MAX_SILENCE", 0.5)
    with Emulator(machine) as emulator:
        arguments = ("home.yaml", "run.npz", "--controller", "grbl", "--park")
        monkeypatch.chdir(files)
        done = fantoccini("stand", "stream", *arguments, "--port", emulator.port)
    assert done.exit_code == 0, done.stderr
    assert machine.position[0] == pytest.approx(202.0, abs=0.02)  # 2 mm off the switch


def test_the_ports_of_a_stand_are_read_once(files, monkeypatch):
    calls, serial_ports = [], stand_sending.serial_ports

    def counted(*arguments):
        calls.append(arguments)
        return serial_ports(*arguments)

    for module in (stand_motion, stand_sending):
        monkeypatch.setattr(module, "serial_ports", counted)
    arguments = (files / "stand.yaml", files / "run.npz", "--controller", "grbl", "--dry-run")
    assert fantoccini("stand", "stream", *arguments).exit_code == 0
    assert len(calls) == 1


def test_enter_resumes_without_loss(files):
    points = points_of(files, "grbl")
    with Emulator(machine_of(points), pace=PACE) as emulator:
        options = ("--controller", "grbl", "--port", emulator.port)
        with streaming(files, *options) as process:
            wait_until(lambda: len(emulator.lines) > 20)
            process.interrupt()
            process.read_until("paused at line")
            assert len(emulator.lines) < 70
            code, _, stderr = process.end("\n")
        assert code == 0, stderr
        assert emulator.lines == [line.text for line in gcode_lines(gcode(points))]
        assert emulator.resets == 0


@pytest.mark.parametrize("kind", ["osc", pytest.param("artnet", marks=pytest.mark.slow)])
def test_two_ctrl_c_hold_the_last_position_and_packets_resume_from_the_time(files, kind):
    points = points_of(files, kind)
    unit = points.axes[0].counts_per_unit
    with Receiver(points.map.stand, points.controller, "127.0.0.1", 0) as stand:
        options = ("--controller", kind, "--to", "{}:{}".format(*stand.address))
        with streaming(files, *options) as process:
            wait_until(lambda: len(stand) > 40)
            process.interrupt()
            process.read_until("Ctrl-C stops\n")
            before = len(stand)
            wait_until(lambda: len(stand) > before + 10)  # the position is repeated
            held = stand.steps[before:, 0]
            process.interrupt()
            code, _, stderr = process.end()
        assert code == 130
        assert np.all(held == held[0])
        wait_until(lambda: stand.silent)
        sent = len(stand)
        assert stand.stops == 1 and stand.steps[-1, 0] == held[0]
        t = float(re.search(r"continue with --from-time (\S+)", stderr)[1])
        assert "stopped here" in stderr and 0.1 < t < 1.5
        p = points.motion.position[:, 0]
        # Rounded down by up to 1 ms, at 0.8 m/s.
        assert held[0] / unit == pytest.approx(np.interp(t, points.motion.t, p), abs=1.1e-3)
        with streaming(files, *options, "--from-time", t) as process:
            code, out, stderr = process.end()
        assert code == 0, stderr
        assert "they must already be there" in stderr
        assert "packets to 127.0.0.1:" in out
        wait_until(lambda: stand.silent)
    again = stand.steps[sent:, 0] / unit
    assert again[0] == pytest.approx(held[0] / unit, abs=1.1e-3)
    assert again[-1] == pytest.approx(p[-1], abs=1.0 / unit)
    assert stand.n_unreadable == 0
    rest = round(REPEAT_TIME * points.rate)
    assert np.all(again[:rest] == again[0]) and np.ptp(again) > 0.05


def test_enter_resumes_over_the_network(files):
    points = points_of(files, "osc")
    with Receiver(points.map.stand, points.controller, "127.0.0.1", 0) as stand:
        options = ("--controller", "osc", "--to", "{}:{}".format(*stand.address))
        with streaming(files, *options) as process:
            wait_until(lambda: len(stand) > 40)
            process.interrupt()
            process.read_until("paused at t = ")
            code, _, stderr = process.end("\n")
        assert code == 0, stderr
        time.sleep(0.1)
    p = stand.steps[:, 0] / points.axes[0].counts_per_unit
    assert p[-1] == pytest.approx(
        points.motion.position[-1, 0], abs=1.0 / points.axes[0].counts_per_unit
    )
    assert np.min(p) == pytest.approx(np.min(points.motion.position), abs=2e-3)


def test_a_receiver_lost_in_a_hold_ends_the_prompt(files):
    """Nobody presses Enter, and the input does not end."""
    points = points_of(files, "osc")
    with Receiver(points.map.stand, points.controller, "127.0.0.1", 0) as stand:
        options = ("--controller", "osc", "--to", "{}:{}".format(*stand.address))
        process = Process(files, *options)
        wait_until(lambda: len(stand) > 20)
        process.interrupt()
        process.read_until("Ctrl-C stops\n")
    try:
        assert process.process.wait(20.0) == 1
        _, _, stderr = process.end()
    finally:
        process.process.kill()
        process.watch.cancel()
    assert re.search(r"t = \d\.\d+ s: not sent: Connection refused", stderr)
    assert "continue with --from-time" in stderr


def test_the_end_of_input_stops(files):
    """A stream without a terminal stops: nobody can continue it."""
    points = points_of(files, "osc")
    with Receiver(points.map.stand, points.controller, "127.0.0.1", 0) as stand:
        options = ("--controller", "osc", "--to", "{}:{}".format(*stand.address))
        with streaming(files, *options) as process:
            wait_until(lambda: len(stand) > 20)
            process.process.stdin.close()
            process.process.stdin = None
            process.interrupt()
            code, _, stderr = process.end()
    assert code == 130 and "--from-time" in stderr


def test_a_missing_receiver_is_reported(files):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
    done = fantoccini(
        "stand",
        "stream",
        files / "stand.yaml",
        files / "run.npz",
        "--controller",
        "artnet",
        "--to",
        f"127.0.0.1:{port}",
    )
    assert done.exit_code == 1
    assert "t = 0.000 s: not sent: Connection refused" in done.stderr
    assert "--from-time" not in done.stderr  # nothing moved


def test_a_dry_run_sends_nothing(files):
    points = points_of(files, "artnet")
    with Receiver(points.map.stand, points.controller, "127.0.0.1", 0) as stand:
        done = fantoccini(
            "stand",
            "stream",
            files / "stand.yaml",
            files / "run.npz",
            "--controller",
            "artnet",
            "--dry-run",
            "--to",
            "{}:{}".format(*stand.address),
            "--from-time",
            "0.5",
        )
        time.sleep(0.1)
    assert len(stand) == stand.n_unreadable == 0
    rows = [re.fullmatch(r"(\S+) 1=(\d+)", line).groups() for line in done.stdout.splitlines()]
    t, value = np.array(rows, float).T
    np.testing.assert_allclose(t, np.arange(20, 61) / 40.0)
    np.testing.assert_allclose(
        0.2 + 0.7 * value / 65535, points.motion.position[20:, 0], atol=0.7 / 65535
    )


@pytest.mark.parametrize(
    "kind, option, message",
    [
        ("osc", ("--port", "a"), "applies to G-code, and the controller is osc"),
        ("osc", ("--from-line", "3"), "applies to G-code"),
        ("grbl", ("--to", "127.0.0.1:9000"), "applies to osc and artnet, but this stand has grbl"),
        ("grbl", ("--from-time", "1"), "applies to osc, artnet or several controllers"),
        ("artnet", ("--to", "nowhere"), "needed: HOST:PORT"),
        ("artnet", ("--to", "nowhere", "--dry-run"), "needed: HOST:PORT"),
        ("artnet", ("--to", "127.0.0.1:0"), "found port 0"),
        ("grbl", (), "names no port; needed: --port PORT"),
    ],
)
def test_options_of_the_other_kind_are_refused(files, kind, option, message):
    done = fantoccini(
        "stand", "stream", files / "stand.yaml", files / "run.npz", "--controller", kind, *option
    )
    assert done.exit_code == 2
    assert message in " ".join(done.stderr.split())


def test_a_missing_port_is_reported_before_the_run_is_read(files):
    arguments = (files / "stand.yaml", files / "no run.npz", "--controller", "grbl")
    done = fantoccini("stand", "stream", *arguments, "--port", "/dev/none")
    assert done.exit_code == 1
    assert "there is no serial port /dev/none" in " ".join(done.stderr.split())


@pytest.mark.parametrize("dry", [(), ("--dry-run",)])
def test_a_time_beyond_the_end_is_refused(files, dry):
    done = fantoccini(
        "stand",
        "stream",
        files / "stand.yaml",
        files / "run.npz",
        "--controller",
        "osc",
        "--from-time",
        "100",
        *dry,
    )
    assert done.exit_code == 1 and not done.stdout
    assert "found 100 s to continue from; the set points last 1.5 s" in done.stderr


def test_a_broadcast_address_is_refused(files):
    done = fantoccini(
        "stand",
        "stream",
        files / "stand.yaml",
        files / "run.npz",
        "--controller",
        "osc",
        "--to",
        "255.255.255.255:9000",
    )
    assert done.exit_code == 1
    assert "all machines of a network would hear it" in done.stderr


@pytest.mark.parametrize("kind", ["osc", "artnet"])
def test_the_emulator_of_packets_has_no_rate(files, kind):
    done = fantoccini(
        "stand",
        "emulate",
        files / "stand.yaml",
        "--controller",
        kind,
        "--rate",
        "20",
        "--listen",
        "no.such.host.invalid:1",
    )
    assert done.exit_code == 2
    assert f"applies to G-code, and the controller is {kind}" in " ".join(done.stderr.split())


def test_the_emulated_stand_of_packets_writes_positions_of_its_motors(files, monkeypatch):
    monkeypatch.setattr(sending, "MAX_DELAY", 5.0)
    path = os.pathsep.join([str(ROOT / "src"), os.environ.get("PYTHONPATH", "")])
    emulated = subprocess.Popen(
        [
            sys.executable,
            "-c",
            "from fantoccini.app.cli import main; main()",
            "stand",
            "emulate",
            "stand.yaml",
            "--controller",
            "osc",
            "--listen",
            "127.0.0.1:0",
            "--out",
            "motors.csv",
        ],
        env={**os.environ, "PYTHONPATH": path},
        text=True,
        cwd=files,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    watch = threading.Timer(120.0, emulated.kill)
    watch.start()
    address = emulated.stdout.readline().strip()
    done = fantoccini(
        "stand",
        "stream",
        files / "stand.yaml",
        files / "run.npz",
        "--controller",
        "osc",
        "--to",
        address,
    )
    assert done.exit_code == 0
    _, stderr = emulated.communicate()
    watch.cancel()
    assert emulated.returncode == 0 and re.search(r"\d+ packets in \d\.\d+ s, 0 wrong", stderr)
    table = np.genfromtxt(files / "motors.csv", delimiter=",", names=True)
    points = points_of(files, "osc")
    t = np.arange(100) / 100.0 + 0.2
    begun = round(REPEAT_TIME * points.rate) / points.rate
    at = np.interp(t + begun, table["t_s"], table["winch"])
    wanted = 1e3 * np.interp(t, points.motion.t, points.motion.position[:, 0])
    # In millimetres, by the receiver's clock, at up to 1.5 m/s: most packets come within 30 ms.
    assert np.percentile(np.abs(at - wanted), 80) < 45.0
