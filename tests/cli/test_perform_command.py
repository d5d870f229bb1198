"""`fantoccini perform` serves a page and exchanges OSC messages until Ctrl-C."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from pythonosc.osc_message_builder import OscMessageBuilder
from pythonosc.osc_packet import OscPacket
from tests.cli.command import fantoccini
from tests.perform.short_play import PLAY

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]


def test_a_show_is_directed_by_messages_until_ctrl_c(tmp_path):
    (tmp_path / "short.yaml").write_text(PLAY, encoding="utf-8")
    receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    receiver.bind(("127.0.0.1", 0))
    receiver.settimeout(30.0)
    path = os.pathsep.join([str(ROOT / "src"), os.environ.get("PYTHONPATH", "")])
    process = subprocess.Popen(
        [
            sys.executable,
            "-c",
            "from fantoccini.app.cli import main; main()",
            "perform",
            "short.yaml",
            "--port",
            "0",
            "--no-browser",
            "--osc-in",
            "0",
            "--osc-out",
            f"127.0.0.1:{receiver.getsockname()[1]}",
        ],
        env={**os.environ, "PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
    )
    watch = threading.Timer(180.0, process.kill)
    watch.start()
    stderr_text = ""
    while "press Ctrl-C to stop" not in stderr_text and (line := process.stderr.readline()):
        stderr_text += line
    osc_in_address = re.search(r"OSC messages are received at 127\.0\.0\.1:(\d+)", stderr_text)
    assert osc_in_address is not None, stderr_text
    receiver.sendto(OscMessageBuilder("/go").build().dgram, ("127.0.0.1", int(osc_in_address[1])))
    addresses = [OscPacket(receiver.recv(65536)).messages[0].message.address for _ in range(2)]
    process.send_signal(signal.SIGINT)
    process.communicate()
    watch.cancel()
    receiver.close()
    assert addresses == ["/act", "/cue/1/start"]
    assert process.returncode == 0


def test_messages_are_not_sent_to_port_0(tmp_path):
    """Port 0 means any free port for incoming messages, so it cannot be a destination."""
    (tmp_path / "short.yaml").write_text(PLAY, encoding="utf-8")
    done = fantoccini("perform", tmp_path / "short.yaml", "--osc-in", "0", "--osc-out", "::1:0")
    assert done.exit_code == 2
    message = " ".join(done.stderr.split())
    assert "found port 0 in '::1:0'; needed: 1 to 65535" in message and "--osc-out" in message
