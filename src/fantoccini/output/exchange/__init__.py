"""Import of MJCF and URDF models as puppet files.

MJCF is the format of the simulator MuJoCo, URDF that of robots in ROS. A wire is a string that also
pushes; a tendon is a string of MuJoCo, and a geom a shape.
"""

from fantoccini.output.exchange.imported import ImportedPuppet, ImportNote
from fantoccini.output.exchange.importing import import_model

__all__ = ["ImportNote", "ImportedPuppet", "import_model"]
