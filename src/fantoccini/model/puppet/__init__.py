"""The puppet schema: puppets read from files or built in Python.

A puppet is rigid bodies on joints, hung from strings. A driven coordinate is given as a function of
time: an end or length of a string, or a driven joint. A drive moves one by a motor towards a
command. A twin is the mirror image of a body, joint or string; a wire is a string that also pushes,
and a chain one with point masses and springs.
"""

from fantoccini.model.puppet import bundled_files, dump
from fantoccini.model.puppet.bundled_files import (
    bundled,
    named_file,
    names,
    path,
    performance,
    performances,
    scenes,
)
from fantoccini.model.puppet.chain import Chain
from fantoccini.model.puppet.contact import FLOOR, Contact, ContactPair, ContactRule, Group
from fantoccini.model.puppet.drive import (
    PD,
    ComputedTorque,
    Control,
    Count,
    DirectCurrent,
    Drive,
    Friction,
    Motor,
    Servo,
    StepperMotor,
)
from fantoccini.model.puppet.dump import plain
from fantoccini.model.puppet.elements import (
    Attachment,
    Body,
    Drag,
    Mirror,
    PoseValue,
    SolidInertia,
    Spring,
    String,
)
from fantoccini.model.puppet.files import json_schema, load, loads
from fantoccini.model.puppet.joint import Cone, Joint, JointSpring, Limits, Twist
from fantoccini.model.puppet.mirror import twin_name
from fantoccini.model.puppet.parts import named_parts
from fantoccini.model.puppet.quantities import QUANTITIES, Gravity, Mass, Place, Point, Vector
from fantoccini.model.puppet.rig import LimbKind, Rig, RigHead, RigLimb, Side
from fantoccini.model.puppet.schema import Puppet
from fantoccini.model.puppet.shapes import (
    MIN_MESH_VOLUME,
    AnyObstacle,
    AnyShape,
    Box,
    Capsule,
    Colour,
    Ellipsoid,
    Mesh,
    Obstacle,
    Shape,
    Sphere,
    UnitInertia,
    has_mass,
    load_mesh,
    shape_inertia,
    unclosed,
)
from fantoccini.model.puppet.words import WORDS
from fantoccini.model.puppet.written import is_number, items, parameters, word

__all__ = [
    "FLOOR",
    "MIN_MESH_VOLUME",
    "PD",
    "QUANTITIES",
    "WORDS",
    "AnyObstacle",
    "AnyShape",
    "Attachment",
    "Body",
    "Box",
    "Capsule",
    "Chain",
    "Colour",
    "ComputedTorque",
    "Cone",
    "Contact",
    "ContactPair",
    "ContactRule",
    "Control",
    "Count",
    "DirectCurrent",
    "Drag",
    "Drive",
    "Ellipsoid",
    "Friction",
    "Gravity",
    "Group",
    "Joint",
    "JointSpring",
    "LimbKind",
    "Limits",
    "Mass",
    "Mesh",
    "Mirror",
    "Motor",
    "Obstacle",
    "Place",
    "Point",
    "PoseValue",
    "Puppet",
    "Rig",
    "RigHead",
    "RigLimb",
    "Servo",
    "Shape",
    "Side",
    "SolidInertia",
    "Sphere",
    "Spring",
    "StepperMotor",
    "String",
    "Twist",
    "UnitInertia",
    "Vector",
    "bundled",
    "bundled_files",
    "dump",
    "has_mass",
    "is_number",
    "items",
    "json_schema",
    "load",
    "load_mesh",
    "loads",
    "named_file",
    "named_parts",
    "names",
    "parameters",
    "path",
    "performance",
    "performances",
    "plain",
    "scenes",
    "shape_inertia",
    "twin_name",
    "unclosed",
    "word",
]
