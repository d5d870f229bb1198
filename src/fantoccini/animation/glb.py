"""glTF 2.0 in one file (.glb)."""

from __future__ import annotations

from pathlib import Path

from fantoccini.animation.scene import AnimatedScene


def write(scene: AnimatedScene, path: Path) -> None:
    """Writes a scene."""
    raise NotImplementedError
