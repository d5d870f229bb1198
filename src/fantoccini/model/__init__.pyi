"""The names of the package, and where each is defined."""

from . import meshes as meshes, puppet as puppet, scene as scene, tree as tree
from .body_map import (
    BodyMap as BodyMap,
    Doubt as Doubt,
    Head as Head,
    Limb as Limb,
    rig_of as rig_of,
)
from .puppet import (
    PD as PD,
    Attachment as Attachment,
    Body as Body,
    Box as Box,
    Capsule as Capsule,
    Chain as Chain,
    ComputedTorque as ComputedTorque,
    Cone as Cone,
    Contact as Contact,
    ContactPair as ContactPair,
    Control as Control,
    DirectCurrent as DirectCurrent,
    Drag as Drag,
    Drive as Drive,
    Ellipsoid as Ellipsoid,
    Friction as Friction,
    Joint as Joint,
    JointSpring as JointSpring,
    Limits as Limits,
    Mesh as Mesh,
    Mirror as Mirror,
    Motor as Motor,
    Obstacle as Obstacle,
    Puppet as Puppet,
    Rig as Rig,
    Servo as Servo,
    Shape as Shape,
    Sphere as Sphere,
    Spring as Spring,
    StepperMotor as StepperMotor,
    String as String,
    Twist as Twist,
    json_schema as json_schema,
    load as load,
    loads as loads,
)
from .scene import Member as Member, Prop as Prop, Scene as Scene
from .tree import Size as Size, measure as measure
