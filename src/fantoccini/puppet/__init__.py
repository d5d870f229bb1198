"""Puppets: the one schema, read from files or built in Python."""

from fantoccini.puppet.chain import Chain
from fantoccini.puppet.files import json_schema, load, loads
from fantoccini.puppet.joint import Cone, Joint, JointSpring, Limits, Twist
from fantoccini.puppet.schema import Attachment, Body, Drag, Mirror, Puppet, Spring, String
from fantoccini.puppet.shapes import (
    Box,
    Capsule,
    Ellipsoid,
    Mesh,
    Obstacle,
    Shape,
    Sphere,
)
from fantoccini.puppet.values import Number, Orientation, Parameter, value_of

__all__ = [
    "Attachment",
    "Body",
    "Box",
    "Capsule",
    "Chain",
    "Cone",
    "Drag",
    "Ellipsoid",
    "Joint",
    "JointSpring",
    "Limits",
    "Mesh",
    "Mirror",
    "Number",
    "Obstacle",
    "Orientation",
    "Parameter",
    "Puppet",
    "Shape",
    "Sphere",
    "Spring",
    "String",
    "Twist",
    "json_schema",
    "load",
    "loads",
    "value_of",
]
