"""A model in the form sent to another process or machine: the text of its puppet.

The compiled libraries are not sent; the other machine has them in its cache, or builds them.
"""

from __future__ import annotations

from dataclasses import dataclass

from fantoccini.model.puppet import Puppet
from fantoccini.motion import mesh_files, restored


@dataclass(frozen=True)
class PortablePuppet:
    """A puppet as plain data.

    Attributes:
        name: name of the puppet.
        text: puppet file as YAML.
        meshes: mesh file -> content.
    """

    name: str
    text: str
    meshes: dict[str, bytes]

    @classmethod
    def from_puppet(cls, puppet: Puppet) -> PortablePuppet:
        """A puppet as plain data."""
        return cls(puppet.name, puppet.to_yaml(), mesh_files(puppet))

    def puppet(self) -> Puppet:
        """The puppet, restored."""
        return restored(self.text, f"<{self.name}>", self.meshes)
