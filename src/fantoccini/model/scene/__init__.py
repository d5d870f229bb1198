"""Scenes: several puppets, props, obstacles and a floor, assembled into one puppet."""

from fantoccini.model.scene.assembly import assembled
from fantoccini.model.scene.files import json_schema, load, loads
from fantoccini.model.scene.schema import Member, Prop, Scene

__all__ = ["Member", "Prop", "Scene", "assembled", "json_schema", "load", "loads"]
