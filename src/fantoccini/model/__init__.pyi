"""The names of the package, and where each is defined."""

from . import (
    meshes as meshes,
    puppet as puppet,
    scene as scene,
    tree as tree,
)
from .puppet import Puppet as Puppet
from .scene import (
    Member as Member,
    Prop as Prop,
    Scene as Scene,
)
