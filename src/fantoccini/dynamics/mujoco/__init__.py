"""A puppet as MJCF, and its run in MuJoCo.

MJCF is the XML format of the simulator MuJoCo. A wire is a string that also pushes. q_D are the
dynamic coordinates and q_K the driven ones: ends and lengths of strings, driven joints.
"""

from fantoccini.dynamics.mujoco.joints import Joint, all_joints
from fantoccini.dynamics.mujoco.mjcf_model import mjcf
from fantoccini.dynamics.mujoco.mujoco_puppet import MuJoCoPuppet, library
from fantoccini.dynamics.mujoco.mujoco_runs import mujoco_run

__all__ = ["Joint", "MuJoCoPuppet", "all_joints", "library", "mjcf", "mujoco_run"]
