"""Uses of viser's private members are in one module, and are checked."""

from __future__ import annotations

import ast
from pathlib import Path
from types import SimpleNamespace

import pytest
import viser

import fantoccini.app
from fantoccini.app.pages import viser_private
from fantoccini.app.pages.server import Server
from fantoccini.app.pages.viser_private import ViserError
from fantoccini.output.view.theme import LIGHT

APP = Path(fantoccini.app.__file__).parent


def test_the_installed_viser_is_a_checked_one():
    assert viser.__version__ in viser_private.CHECKED_VERSIONS


def test_private_members_are_used_in_one_module_only():
    """Elsewhere nothing is imported from viser's private modules, and `_names` belong to `self`."""
    wrong = []
    files = {file for folder in ("web", "pages", "live") for file in (APP / folder).glob("*.py")}
    assert len(files) > 25
    for file in files - {Path(viser_private.__file__)}:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("viser"):
                wrong.append(f"{file.name}:{node.lineno} from {node.module}")
            if isinstance(node, ast.Attribute) and node.attr.startswith("_"):
                public = node.attr.startswith("__") or getattr(node.value, "id", "") == "self"
                wrong += [] if public else [f"{file.name}:{node.lineno} .{node.attr}"]
    assert wrong == []


@pytest.mark.parametrize(
    ("name", "changed", "missing"),
    [
        ("USED_MEMBERS", ("gui._gone", "gui._gui_input_handle_from_uuid"), "ViserServer.gui._gone"),
        ("USED_MESSAGES", ("GoneMessage", "GuiUpdateMessage"), "_messages.GoneMessage"),
    ],
)
def test_a_viser_without_the_used_members_is_refused(monkeypatch, name, changed, missing):
    monkeypatch.setattr(viser_private, name, changed)
    versions = f"viser {viser.__version__} cannot be used: it has no {missing}; fantoccini works "
    with pytest.raises(ViserError, match=versions):
        Server("toy", LIGHT, port=0)


def test_a_viser_with_another_server_is_refused(monkeypatch):
    """Its requests would not be filtered."""
    stopped = []
    server = SimpleNamespace(stop=lambda: stopped.append(True))
    monkeypatch.setattr(viser, "ViserServer", lambda *_, **__: server)
    with pytest.raises(ViserError, match="does not serve through websockets"):
        viser_private.start_server("127.0.0.1", 0, "toy", lambda handler: handler, lambda *_: None)
    assert stopped == [True]


def test_a_viser_without_its_page_is_refused(monkeypatch, tmp_path):
    monkeypatch.setattr(viser, "__file__", str(tmp_path / "__init__.py"))
    with pytest.raises(ViserError, match=r"it has no .*index\.html"):
        viser_private.client_page()
