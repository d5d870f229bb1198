"""Exports puppets as MJCF and simulates them in MuJoCo. Only simulations need MuJoCo installed."""

from fantoccini.exchange.joints import Joint, all_joints
from fantoccini.exchange.mjcf_model import mjcf
from fantoccini.exchange.mujoco_puppet import MuJoCoPuppet
from fantoccini.exchange.mujoco_runs import mujoco_run

__all__ = ["Joint", "MuJoCoPuppet", "all_joints", "mjcf", "mujoco_run"]
