"""Puppets in MuJoCo and back: exports and simulates them, and makes puppets of MJCF and URDF.

Importing URDF needs yourdfpy; everything else but the export needs MuJoCo.
"""

from fantoccini.exchange.imported import Imported, ImportNote
from fantoccini.exchange.importing import import_model
from fantoccini.exchange.joints import Joint, all_joints
from fantoccini.exchange.mjcf_model import mjcf
from fantoccini.exchange.mujoco_puppet import MuJoCoPuppet
from fantoccini.exchange.mujoco_runs import mujoco_run

__all__ = [
    "ImportNote",
    "Imported",
    "Joint",
    "MuJoCoPuppet",
    "all_joints",
    "import_model",
    "mjcf",
    "mujoco_run",
]
