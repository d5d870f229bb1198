"""Puppets for other programs, and what these make of them. MuJoCo is needed only where it runs."""

from fantoccini.exchange.joints import Joint, all_joints
from fantoccini.exchange.mjcf_model import mjcf
from fantoccini.exchange.mujoco_puppet import MuJoCoPuppet
from fantoccini.exchange.mujoco_runs import mujoco_run

__all__ = ["Joint", "MuJoCoPuppet", "all_joints", "mjcf", "mujoco_run"]
