"""A writer of glTF by `pygltflib`, number by number, for comparisons with closed forms."""

from __future__ import annotations

import base64
import io
from pathlib import Path

import numpy as np
import pygltflib as gl
from PIL import Image

CORNERS = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]) / 2.0
SIDES = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
CUBE = np.array([t for a, b, c, d in SIDES for t in ((a, b, c), (a, c, d))])
"""Triangles of the unit cube, anticlockwise from outside."""
UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Rotation from glTF's axes, y up, to ours, z up."""

_TYPES = {1: gl.SCALAR, 2: gl.VEC2, 3: gl.VEC3, 4: gl.VEC4}
_KINDS = {
    "int8": 5120,
    "uint8": 5121,
    "int16": 5122,
    "uint16": 5123,
    "uint32": 5125,
    "float32": 5126,
}


class Writer:
    """A glTF file in preparation."""

    def __init__(self) -> None:
        self.gltf = gl.GLTF2(scenes=[gl.Scene(nodes=[])], scene=0)
        self.data = bytearray()

    def view(self, content: bytes, stride: int | None = None) -> int:
        """Add bytes to the buffer."""
        self.data += b"\0" * (-len(self.data) % 4)
        self.gltf.bufferViews.append(
            gl.BufferView(
                buffer=0, byteOffset=len(self.data), byteLength=len(content), byteStride=stride
            )
        )
        self.data += content
        return len(self.gltf.bufferViews) - 1

    def numbers(self, values: np.ndarray, normalized: bool = False) -> int:
        """Add an accessor."""
        values = np.ascontiguousarray(values)
        width = 1 if values.ndim == 1 else values.shape[1]
        self.gltf.accessors.append(
            gl.Accessor(
                bufferView=self.view(values.tobytes()),
                count=len(values),
                componentType=_KINDS[str(values.dtype)],
                type=_TYPES[width],
                normalized=normalized,
            )
        )
        return len(self.gltf.accessors) - 1

    def material(self, colour=(1.0, 1.0, 1.0), image: np.ndarray | None = None, **sampler) -> int:
        """Add a material of a linear colour, and of an image (height, width, 3)."""
        look = gl.PbrMetallicRoughness(baseColorFactor=[*colour, 1.0])
        if image is not None:
            stream = io.BytesIO()
            Image.fromarray(image).save(stream, "PNG")
            self.gltf.images.append(
                gl.Image(bufferView=self.view(stream.getvalue()), mimeType="image/png")
            )
            self.gltf.samplers.append(gl.Sampler(**sampler))
            self.gltf.textures.append(
                gl.Texture(source=len(self.gltf.images) - 1, sampler=len(self.gltf.samplers) - 1)
            )
            look.baseColorTexture = gl.TextureInfo(index=len(self.gltf.textures) - 1)
        self.gltf.materials.append(gl.Material(pbrMetallicRoughness=look))
        return len(self.gltf.materials) - 1

    def mesh(
        self,
        vertices=CORNERS,
        faces=CUBE,
        material: int | None = None,
        mode: int | None = None,
        **attributes: int,
    ) -> int:
        """Add a mesh of one primitive."""
        indices = None if faces is None else self.numbers(np.asarray(faces, "uint16").reshape(-1))
        corners = self.numbers(vertices.astype("float32"))
        primitive = gl.Primitive(
            attributes=gl.Attributes(POSITION=corners, **attributes),
            indices=indices,
            material=material,
            mode=mode,
        )
        self.gltf.meshes.append(gl.Mesh(primitives=[primitive]))
        return len(self.gltf.meshes) - 1

    def node(self, mesh: int | None = None, parent: int | None = None, **pose) -> int:
        """Add a node to the scene, or to another node."""
        self.gltf.nodes.append(gl.Node(mesh=mesh, **pose))
        k = len(self.gltf.nodes) - 1
        above = self.gltf.scenes[0].nodes if parent is None else self.gltf.nodes[parent].children
        above.append(k)
        return k

    def boxes(self, *boxes: tuple) -> None:
        """Add boxes: size, centre, in glTF's axes, and material if any."""
        mesh: dict[int | None, int] = {}
        for size, at, *material in boxes:
            look = material[0] if material else None
            if look not in mesh:
                mesh[look] = self.mesh(material=look)
            self.node(mesh[look], translation=list(at), scale=list(size))

    def save(self, path: Path) -> Path:
        """Write a .glb; or a .gltf with a file of numbers beside it."""
        if path.suffix == ".glb":
            self.gltf.buffers = [gl.Buffer(byteLength=len(self.data))]
            self.gltf.set_binary_blob(bytes(self.data))
            self.gltf.save_binary(str(path))
        else:
            name = path.with_suffix(".bin")
            name.write_bytes(self.data)
            self.gltf.buffers = [gl.Buffer(byteLength=len(self.data), uri=name.name)]
            self.gltf.save_json(str(path))
        return path

    def inline(self, path: Path) -> Path:
        """Write a .gltf that contains its numbers."""
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        self.gltf.buffers = [gl.Buffer(byteLength=len(self.data), uri=uri)]
        self.gltf.save_json(str(path))
        return path


def puppet(shapes: str, more: str = "") -> str:
    """A puppet of one free body; its shapes stand in line 6."""
    return (
        "puppet: p\nbodies:\n  - name: a\n    joint: {type: free}\n"
        f"    shapes:\n      - {shapes}\n{more}"
    )
