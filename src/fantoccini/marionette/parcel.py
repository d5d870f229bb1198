"""How a model travels to another process or machine: as the text of its puppets.

What was derived or compiled stays behind; the cache has it there, or it is made there.
"""

from __future__ import annotations

from dataclasses import dataclass

from fantoccini.errors import StateError
from fantoccini.motion.archive import mesh_files, restored
from fantoccini.puppet import Puppet
from fantoccini.world import World


@dataclass(frozen=True)
class Parcel:
    """The puppets of a world, ready to travel.

    Attributes:
        name: of the world.
        puppets: YAML text of each puppet.
        meshes: of each puppet, mesh file -> content.
    """

    name: str
    puppets: tuple[str, ...]
    meshes: tuple[dict[str, bytes], ...]

    @classmethod
    def of(cls, world: World) -> Parcel:
        """The parcel of a world.

        Raises:
            StateError: the world holds what none of its puppets does.
        """
        if World.of(*world.puppets, name=world.name) != world:
            raise StateError(
                f"the world {world.name} has obstacles, a floor or a gravity that its puppets do "
                "not have, and would lose them on the way; give them to a puppet"
            )
        puppets = world.puppets
        return cls(
            world.name,
            tuple(p.to_yaml() for p in puppets),
            tuple(mesh_files(p) for p in puppets),
        )

    def world(self) -> World:
        """The world again."""
        made: list[Puppet] = [
            restored(text, f"<{self.name}>", meshes)
            for text, meshes in zip(self.puppets, self.meshes, strict=True)
        ]
        return World.of(*made, name=self.name)
