"""A puppet as MJCF, and its run in MuJoCo."""

from fantoccini.dynamics.mujoco.joints import Joint, all_joints
from fantoccini.dynamics.mujoco.mjcf_model import mjcf
from fantoccini.dynamics.mujoco.mujoco_puppet import MuJoCoPuppet, library
from fantoccini.dynamics.mujoco.mujoco_runs import mujoco_run

__all__ = ["Joint", "MuJoCoPuppet", "all_joints", "library", "mjcf", "mujoco_run"]
