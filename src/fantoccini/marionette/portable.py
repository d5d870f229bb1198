"""How a model travels to another process or machine: as the text of its puppets.

The compiled libraries stay behind; the other machine has them in its cache, or makes them.
"""

from __future__ import annotations

from dataclasses import dataclass

from fantoccini.errors import StateError
from fantoccini.motion.archive import mesh_files, restored
from fantoccini.world import World


@dataclass(frozen=True)
class PortableWorld:
    """The puppets of a world as plain data.

    Attributes:
        name: of the world.
        puppets: YAML text of each puppet.
        meshes: of each puppet, mesh file -> content.
    """

    name: str
    puppets: tuple[str, ...]
    meshes: tuple[dict[str, bytes], ...]

    @classmethod
    def of(cls, world: World) -> PortableWorld:
        """A world as plain data.

        Raises:
            StateError: the world has an obstacle, floor or gravity that none of its puppets has.
        """
        puppets = world.puppets
        if World.of(*puppets, name=world.name) != world:
            raise StateError(
                f"the world {world.name} has obstacles, a floor or a gravity that its puppets do "
                "not have, and would lose them on the way; give them to a puppet"
            )
        texts = tuple(p.to_yaml() for p in puppets)
        return cls(world.name, texts, tuple(mesh_files(p) for p in puppets))

    def world(self) -> World:
        """The world again."""
        parts = zip(self.puppets, self.meshes, strict=True)
        made = [restored(text, f"<{self.name}>", meshes) for text, meshes in parts]
        return World.of(*made, name=self.name)
