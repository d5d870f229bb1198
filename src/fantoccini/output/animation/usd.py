"""OpenUSD (.usda, .usdc): z up, metres; each body is a prim under its parent's prim.

A prim is an object of the file, with a pose that may change over time; a link is a body on its
joint. A solid is a shape of a body or an obstacle.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdShade, Vt

from fantoccini.base import Array, Status, rotation
from fantoccini.model.tree import WORLD
from fantoccini.output.animation.pieces import (
    ROUGHNESS,
    Piece,
    floor_piece,
    hex_digits,
    linear_colour,
    named_solids,
    solid_piece,
)
from fantoccini.output.animation.scene import AnimatedScene, Line
from fantoccini.output.animation.spans import Spans, StringSamples
from fantoccini.output.animation.strands import RINGS_PER_SPAN, STRING_COLOUR, STRING_RADIUS
from fantoccini.output.view import LIGHT

_MIN_CHANGE = 1e-8
"""Change of a value below which it is written as constant [m or 1]."""


def write(scene: AnimatedScene, path: Path) -> None:
    """Writes a scene; time codes are frames."""
    assert scene.fps is not None
    t = scene.frames(scene.fps)
    writer = _Writer(scene, Usd.Stage.CreateNew(str(path)), np.rint((t - t[0]) * scene.fps))
    writer.write()
    writer.stage.Save()


class _Writer:
    """Writer of a scene to a stage.

    Attributes:
        time_codes: (T,) time codes of the frames.
    """

    def __init__(self, scene: AnimatedScene, stage: Any, time_codes: Array):
        self.scene, self.stage, self.time_codes = scene, stage, time_codes
        self.run = scene.run.resample(scene.frames(scene.fps or 0.0))
        self._materials: dict[tuple[float, ...], Any] = {}
        self._materials_path: Any = None
        self._names: set[str] = set()

    def write(self) -> None:
        """Writes the whole scene."""
        scene, stage = self.scene, self.stage
        UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
        UsdGeom.SetStageMetersPerUnit(stage, 1.0)
        stage.SetTimeCodesPerSecond(scene.fps)
        stage.SetFramesPerSecond(scene.fps)
        stage.SetStartTimeCode(self.time_codes[0])
        stage.SetEndTimeCode(self.time_codes[-1])
        if scene.run.status is not Status.DONE:
            stage.GetRootLayer().comment = f"the run stopped early: {scene.run.status.message}"
        root = self._define_prim(UsdGeom.Xform, "", scene.tree.name)
        stage.SetDefaultPrim(root.GetPrim())
        prims = {WORLD: root}
        for k in scene.links:
            parent_path = prims[scene.parents[k]].GetPath()
            prims[k] = self._define_prim(UsdGeom.Xform, parent_path, scene.tree.links[k].name)
            motion = scene.motion(k, self.run)
            self._set_over_time(
                prims[k].AddTranslateOp(), [Gf.Vec3d(*x) for x in motion.r.tolist()]
            )
            turns = rotation.continuous(motion.q).tolist()
            self._set_over_time(_add_orientation(prims[k]), [Gf.Quatd(*x) for x in turns])
        for name, solid in named_solids(scene):
            parent_path = prims[solid.link].GetPath()
            self._add_piece(
                parent_path, name, solid_piece(solid), solid.colour, solid.most_detailed.colours
            )
        if scene.geometry.ground and scene.complete:
            self._add_piece(root.GetPath(), "floor", floor_piece(scene), LIGHT.lower_background)
        samples = StringSamples.from_run(scene, self.run, self.run.t, np.arange(len(self.run)))
        for line in scene.lines:
            self._add_line(root.GetPath(), line, Spans.of_line(scene, line, samples))

    def _define_prim(self, schema: Any, parent_path: Any, name: str) -> Any:
        """New prim with a name that is valid in USD; another name becomes its display name."""
        valid_name = Tf.MakeValidIdentifier(name)
        while f"{parent_path}/{valid_name}" in self._names:
            valid_name += "_"
        self._names.add(f"{parent_path}/{valid_name}")
        prim = schema.Define(self.stage, f"{parent_path}/{valid_name}")
        if valid_name != name:
            prim.GetPrim().SetDisplayName(name)
        return prim

    def _set_over_time(self, attribute: Any, values: list[Any]) -> None:
        """Sets a value for each frame, or a single one if it is constant."""
        first = np.array(_flat(values[0]))
        if all(np.abs(np.array(_flat(x)) - first).max() <= _MIN_CHANGE for x in values):
            attribute.Set(values[0])
            return
        for code, value in zip(self.time_codes, values, strict=True):
            attribute.Set(value, float(code))

    def _add_piece(
        self, parent_path: Any, name: str, piece: Piece, colour: Array, colours: Array | None = None
    ) -> None:
        """Adds a surface in one colour, or with a colour for each face."""
        surface = piece.surface
        mesh = self._define_prim(UsdGeom.Mesh, parent_path, name)
        mesh.AddTranslateOp().Set(Gf.Vec3d(*piece.r.tolist()))
        _add_orientation(mesh).Set(Gf.Quatd(*piece.q.tolist()))
        if np.any(piece.scale != 1.0):
            mesh.AddScaleOp().Set(Gf.Vec3f(*piece.scale.tolist()))
        mesh.CreatePointsAttr(_vectors(surface.vertices))
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray([3] * len(surface.faces)))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray(surface.faces.ravel().tolist()))
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
        mesh.CreateExtentAttr(_vectors(np.array([low, high])))
        if surface.normals is not None:
            mesh.CreateNormalsAttr(_vectors(surface.normals))
            mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
        if colours is None:
            self._set_colour(mesh, colour)
            return
        values = [Gf.Vec3f(*linear_colour(c)) for c in colours]
        mesh.CreateDisplayColorAttr(Vt.Vec3fArray(values))
        mesh.GetDisplayColorPrimvar().SetInterpolation(UsdGeom.Tokens.uniform)
        for k, shade in enumerate(np.unique(colours, axis=0)):
            face_indices = np.flatnonzero(np.all(colours == shade, axis=1)).tolist()
            binding = UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim())
            subset = binding.CreateMaterialBindSubset(f"colour{k + 1}", Vt.IntArray(face_indices))
            UsdShade.MaterialBindingAPI.Apply(subset.GetPrim()).Bind(self._material(shade))

    def _add_line(self, parent_path: Any, line: Line, spans: Spans) -> None:
        """Adds a string as a curve with moving points."""
        curve = self._define_prim(UsdGeom.BasisCurves, parent_path, line.name)
        rings = 2 if spans.slack_length is None else RINGS_PER_SPAN
        points = spans.curves(rings)
        # Spans meet in one point.
        points = np.concatenate(
            [points[:, :1, :1], *(points[:, s : s + 1, 1:] for s in range(points.shape[1]))], axis=2
        )[:, 0]
        width = 2.0 * STRING_RADIUS * self.scene.geometry.size
        curve.CreateTypeAttr(UsdGeom.Tokens.linear)
        curve.CreateCurveVertexCountsAttr(Vt.IntArray([points.shape[1]]))
        curve.CreateWidthsAttr(Vt.FloatArray([width]))
        curve.SetWidthsInterpolation(UsdGeom.Tokens.constant)
        self._set_over_time(curve.CreatePointsAttr(), [_vectors(x) for x in points])
        boxes = np.stack([points.min(axis=1) - width, points.max(axis=1) + width], axis=1)
        self._set_over_time(curve.CreateExtentAttr(), [_vectors(x) for x in boxes])
        self._set_colour(curve, STRING_COLOUR if line.colour is None else line.colour)

    def _set_colour(self, prim: Any, colour: Array) -> None:
        """Sets the material, and the colour for programs without materials."""
        prim.CreateDisplayColorAttr(Vt.Vec3fArray([Gf.Vec3f(*linear_colour(colour))]))
        UsdShade.MaterialBindingAPI.Apply(prim.GetPrim()).Bind(self._material(colour))

    def _material(self, colour: Array) -> Any:
        """Material of a colour, created once and named after the colour."""
        linear = linear_colour(colour)
        if tuple(linear) not in self._materials:
            root = self.stage.GetDefaultPrim().GetPath()
            if self._materials_path is None:
                self._materials_path = self._define_prim(UsdGeom.Scope, root, "materials").GetPath()
            material = self._define_prim(
                UsdShade.Material, self._materials_path, f"colour_{hex_digits(colour)}"
            )
            path = material.GetPath()
            shader = UsdShade.Shader.Define(self.stage, f"{path}/surface")
            shader.CreateIdAttr("UsdPreviewSurface")
            shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(*linear))
            shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(ROUGHNESS)
            material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
            self._materials[tuple(linear)] = material
        return self._materials[tuple(linear)]


def _add_orientation(prim: Any) -> Any:
    """Orientation in doubles: USD takes the arc cosine of w, which loses half of the digits."""
    return prim.AddOrientOp(UsdGeom.XformOp.PrecisionDouble)


def _vectors(values: Array) -> Any:
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values, dtype=np.float32))


def _flat(value: Any) -> Any:
    if isinstance(value, Gf.Quatd):
        return [value.GetReal(), *value.GetImaginary()]
    return value
