"""Puppets: the one schema, read from files or built in Python."""

from fantoccini.puppet.chain import Chain
from fantoccini.puppet.contact import Contact, ContactPair
from fantoccini.puppet.drive import (
    PD,
    ComputedTorque,
    Control,
    DirectCurrent,
    Drive,
    Friction,
    Motor,
    Servo,
    StepperMotor,
)
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
    "PD",
    "Attachment",
    "Body",
    "Box",
    "Capsule",
    "Chain",
    "ComputedTorque",
    "Cone",
    "Contact",
    "ContactPair",
    "Control",
    "DirectCurrent",
    "Drag",
    "Drive",
    "Ellipsoid",
    "Friction",
    "Joint",
    "JointSpring",
    "Limits",
    "Mesh",
    "Mirror",
    "Motor",
    "Number",
    "Obstacle",
    "Orientation",
    "Parameter",
    "Puppet",
    "Servo",
    "Shape",
    "Sphere",
    "Spring",
    "StepperMotor",
    "String",
    "Twist",
    "json_schema",
    "load",
    "loads",
    "value_of",
]
