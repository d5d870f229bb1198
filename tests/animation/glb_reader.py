"""Evaluates glTF animations, written from the specification; `pygltflib` parses the file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pygltflib

_TYPES = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
_WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""Rotation from our axes, z up, to glTF's, y up."""


@dataclass(frozen=True)
class Sampler:
    """Keys of one property.

    Attributes:
        t: (K,) [s].
        values: (K, n), or (K, 3, n) for cubic splines.
        interpolation: ``LINEAR`` or ``CUBICSPLINE``.
        quaternion: whether the values are quaternions, which are normalised.
    """

    t: np.ndarray
    values: np.ndarray
    interpolation: str
    quaternion: bool

    def at(self, times: np.ndarray) -> np.ndarray:
        """(T, n) values at times (T,), computed as in appendix C of the specification."""
        times = np.clip(times, self.t[0], self.t[-1])
        k = np.clip(np.searchsorted(self.t, times, side="right") - 1, 0, len(self.t) - 2)
        d = (self.t[k + 1] - self.t[k])[:, None]
        s = (times - self.t[k])[:, None] / d
        if self.interpolation == "CUBICSPLINE":
            v, b = self.values[k, 1], self.values[k, 2]
            w, a = self.values[k + 1, 1], self.values[k + 1, 0]
            x = (
                (2 * s**3 - 3 * s**2 + 1) * v
                + d * (s**3 - 2 * s**2 + s) * b
                + (3 * s**2 - 2 * s**3) * w
                + d * (s**3 - s**2) * a
            )
            return x / np.linalg.norm(x, axis=1, keepdims=True) if self.quaternion else x
        v, w = self.values[k], self.values[k + 1]
        if not self.quaternion:
            return v + s * (w - v)
        dot = np.sum(v * w, axis=1, keepdims=True)
        a = np.arccos(np.minimum(np.abs(dot), 1.0))
        flat = a < 1e-9
        a = np.where(flat, 1.0, a)
        x = np.sin(a * (1 - s)) / np.sin(a) * v + np.sign(dot) * np.sin(a * s) / np.sin(a) * w
        return np.where(flat, v, x)


class Player:
    """Player of a file.

    Attributes:
        gltf: the file, read by `pygltflib`.
        samplers: (name of the node, property) -> sampler.
    """

    def __init__(self, path: Path):
        self.gltf = pygltflib.GLTF2().load(str(path))
        self._blob = self.gltf.binary_blob()
        self.names = [node.name for node in self.gltf.nodes]
        self.parents = {
            child: k for k, node in enumerate(self.gltf.nodes) for child in node.children or []
        }
        self.samplers: dict[tuple[str, str], Sampler] = {}
        for animation in self.gltf.animations:
            for channel in animation.channels:
                sampler = animation.samplers[channel.sampler]
                t = self._numbers(sampler.input)[:, 0].astype(float)
                values = self._numbers(sampler.output).astype(float)
                cubic = sampler.interpolation == "CUBICSPLINE"
                values = values.reshape(len(t), *((3,) if cubic else ()), -1)
                target = channel.target
                self.samplers[self.names[target.node], target.path] = Sampler(
                    t, values, sampler.interpolation, target.path == "rotation"
                )

    def matrices(self, name: str, times: np.ndarray) -> np.ndarray:
        """(T, 4, 4) of a node in the world."""
        k = self.names.index(name)
        node = self.gltf.nodes[k]
        local_matrices = np.tile(np.eye(4), (len(times), 1, 1))
        local_matrices[:, :3, :3] = _matrices(self._value(name, "rotation", node.rotation, times))
        local_matrices[:, :3, :3] *= self._value(name, "scale", node.scale, times)[:, None]
        local_matrices[:, :3, 3] = self._value(name, "translation", node.translation, times)
        if k in self.parents:
            local_matrices = self.matrices(self.names[self.parents[k]], times) @ local_matrices
        return local_matrices

    def vertices(self, name: str, times: np.ndarray) -> np.ndarray:
        """(T, n, 3) of a skinned mesh in the world [m]."""
        node = self.gltf.nodes[self.names.index(name)]
        mesh = self.gltf.meshes[node.mesh]
        primitive = mesh.primitives[0]
        places = np.tile(self._numbers(primitive.attributes.POSITION), (len(times), 1, 1))
        if primitive.targets:
            weights = self._value(name, "weights", mesh.weights, times)
            for k, target in enumerate(primitive.targets):
                shape = self._numbers(target["POSITION"])
                places = places + weights[:, k, None, None] * shape
        places = np.concatenate([places, np.ones((*places.shape[:2], 1))], axis=2)
        skin = self.gltf.skins[node.skin]
        assert skin.inverseBindMatrices is None
        bones = [self.matrices(self.names[joint], times) for joint in skin.joints]
        joints = self._numbers(primitive.attributes.JOINTS_0)
        weights = self._numbers(primitive.attributes.WEIGHTS_0)
        out = np.zeros(places.shape)
        for n, (js, ws) in enumerate(zip(joints, weights, strict=True)):
            for j, w in zip(js, ws, strict=True):
                out[:, n] += w * (bones[j] @ places[:, n, :, None])[..., 0]
        return out[..., :3]

    def _value(self, name: str, path: str, default: list | None, times: np.ndarray) -> np.ndarray:
        if (name, path) in self.samplers:
            return self.samplers[name, path].at(times)
        identity = {"rotation": [0, 0, 0, 1], "scale": [1, 1, 1], "translation": [0, 0, 0]}
        return np.tile(identity[path] if default is None else default, (len(times), 1)).astype(
            float
        )

    def _numbers(self, accessor: int) -> np.ndarray:
        accessor_entry = self.gltf.accessors[accessor]
        view = self.gltf.bufferViews[accessor_entry.bufferView]
        width = _WIDTHS[accessor_entry.type]
        kind = np.dtype(_TYPES[accessor_entry.componentType])
        assert view.byteStride in (None, width * kind.itemsize)
        start = view.byteOffset + accessor_entry.byteOffset
        count = accessor_entry.count * width
        return np.frombuffer(self._blob, kind, count, start).reshape(accessor_entry.count, width)


def _matrices(xyzw: np.ndarray) -> np.ndarray:
    x, y, z, w = xyzw.T
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], -1),
            np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], -1),
            np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], -1),
        ],
        -2,
    )
