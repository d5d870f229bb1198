"""Scenes: several puppets, props, obstacles and a floor, assembled into one puppet.

A member is a puppet of a scene; its name begins the names of its parts. A prop is a free body.
"""

from fantoccini.model.scene.assembly import assembled
from fantoccini.model.scene.files import json_schema, load, loads
from fantoccini.model.scene.schema import Member, Prop, Scene

__all__ = ["Member", "Prop", "Scene", "assembled", "json_schema", "load", "loads"]
