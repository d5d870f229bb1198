"""Import of models of other programs as puppet files.

MJCF is the format of the simulator MuJoCo, URDF that of robots in ROS.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fantoccini.base import ExchangeError, StateError, UnknownNameError, is_number
from fantoccini.dynamics.mujoco import library
from fantoccini.model.puppet import QUANTITIES
from fantoccini.output.exchange.draft import Draft, written_numbers
from fantoccini.output.exchange.imported import ImportedPuppet
from fantoccini.output.exchange.mjcf_bodies import BodyConverter, CompiledModel
from fantoccini.output.exchange.mjcf_copies import attached_models
from fantoccini.output.exchange.mjcf_includes import (
    asset_folders,
    line_of_error,
    with_includes,
    with_line_number,
    write_element_lines,
)
from fantoccini.output.exchange.mjcf_rest import add_notes, add_shapes
from fantoccini.output.exchange.mjcf_strings import add_constraints, add_tendons
from fantoccini.output.exchange.model_file import ROOTS, ModelFile, line_in_message, read_model

_DEFAULT_MODEL_NAME = "MuJoCo Model"
"""Name that MuJoCo gives to models without one."""


def import_model(
    path: str | os.PathLike[str], keyframe: str | None = None, density: float | None = None
) -> ImportedPuppet:
    """Converts a model in MJCF or URDF to a puppet file.

    Joints keep their coordinates: apart from the differences in the report, accelerations equal
    those of the model's own program.

    Args:
        path: path of the model.
        keyframe: keyframe of an MJCF file in which the puppet starts; by default its zero pose.
        density: density of the solids of links without inertia in URDF [kg/m^3]. By default, if a
            joint would move no mass, that of water; else such links have no mass. The report
            names them.

    Raises:
        ExchangeError: the file is not a model, or has something that no puppet can have.
        StateError: the density is not positive, or the file is MJCF, where geoms have masses.
        MissingLibraryError: MJCF needs MuJoCo, URDF yourdfpy.
        UnknownNameError: there is no such keyframe.
    """
    file = read_model(path)
    if ROOTS[file.root] == "URDF":
        from fantoccini.output.exchange.urdf_model import urdf_puppet

        if keyframe is not None:
            raise UnknownNameError("keyframe", keyframe, ())
        _check_density(density)
        return urdf_puppet(file, density)
    if density is not None:
        text = f"density applies to URDF, and {file.name} is MJCF, whose geoms have masses"
        raise StateError(text)
    return mjcf_puppet(file, keyframe)


def _check_density(density: float | None) -> None:
    """Raises StateError if a density is given that a puppet file cannot have."""
    allowed = QUANTITIES["density"]
    if density is not None and not (
        is_number(density) and allowed.min_size <= density <= allowed.max_size
    ):
        raise StateError(
            f"the density is {density!s:.12}; allowed: {allowed.min_size:g} to "
            f"{allowed.max_size:g} {allowed.unit}"
        )


def mjcf_puppet(file: ModelFile, keyframe: str | None) -> ImportedPuppet:
    """Converts an MJCF file to a puppet file."""
    file = with_includes(file)
    models = attached_models(file)
    compiled = _compile_with_attached(file, keyframe, models)
    name = compiled.spec.modelname
    draft = Draft(file, "" if name == _DEFAULT_MODEL_NAME else name)
    m, flags = compiled.model, compiled.mujoco.mjtDisableBit
    weightless = m.opt.disableflags & int(flags.mjDSBL_GRAVITY)
    gravity = [0.0, 0.0, 0.0] if weightless else written_numbers(m.opt.gravity)
    if gravity != [0.0, 0.0, -9.81]:
        draft.other_keys["gravity"] = gravity
    converter = BodyConverter(compiled, draft)
    for model in models:
        draft.sources += (model.path, *model.included_files)
    for model in (file, *models):
        draft.sources += _asset_paths(model)
    add_tendons(converter)
    add_constraints(converter)
    add_shapes(converter)
    add_notes(converter, keyframe)
    for text in compiled.warnings:
        draft.note("mujoco", "", f"warns: {text[:300]}")
    return draft.finish([f"{draft.name}: converted from the MuJoCo model {file.path.name}."])


@dataclass(frozen=True)
class _MuJoCoError:
    """Error message of MuJoCo about a file, and the line in its text."""

    text: str
    line: int | None

    @property
    def first_line(self) -> str:
        """First line of the message, without the element."""
        return self.text.partition("\n")[0]

    def error_at(self, file: ModelFile) -> ExchangeError:
        lines = [part.strip() for part in self.text.splitlines() if part.strip()]
        text = "; ".join(lines)[:500] or "cannot be read"
        return file.error_at(f"MuJoCo says: {text}", self.line)


def _compile_spec(file: ModelFile) -> tuple[Any, Any] | _MuJoCoError:
    """MuJoCo's specification and model of a file, or the error."""
    mujoco, spec = library(), None
    try:
        spec = mujoco.MjSpec.from_file(str(file.path))
        if file.origins:
            write_element_lines(mujoco, file, spec)
        return spec, spec.compile()
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        message, line = str(error), line_in_message(str(error))
        if file.origins:
            if spec is None:
                line = line_of_error(mujoco, file, message)
            message = with_line_number(message, file.file_and_line(line)[1])
        return _MuJoCoError(message, line)


def _asset_paths(file: ModelFile) -> Iterator[Path]:
    """Possible paths of files that a model names, with and without the folders in their names."""
    folders = asset_folders(file)
    for element in file.elements:
        if file_name := element.attributes.get("file"):
            for name in dict.fromkeys((file_name, os.path.basename(file_name))):
                yield from (Path(folder, name) for folder in folders)


def _compile_with_attached(
    file: ModelFile, keyframe: str | None, models: Iterable[ModelFile]
) -> CompiledModel:
    """Compiled model of a file that may attach other models."""
    mujoco = library()
    with warnings.catch_warnings(record=True) as mujoco_warnings:
        warnings.simplefilter("always")
        result = _compile_spec(file)
        if isinstance(result, _MuJoCoError):
            for attached_model in models if result.line is None else ():
                attached_result = _compile_spec(attached_model)
                if (
                    isinstance(attached_result, _MuJoCoError)
                    and attached_result.first_line
                    and attached_result.first_line in result.text
                ):
                    raise attached_result.error_at(attached_model)
            raise result.error_at(file)
    spec, model = result
    names = [model.key(k).name for k in range(model.nkey)]
    if keyframe is not None and keyframe not in names:
        raise UnknownNameError("keyframe", keyframe, names)
    mocap_bodies = np.argsort(model.body_mocapid)[model.nbody - model.nmocap :]
    qpos, mocap_poses = (
        model.qpos0,
        np.hstack([model.body_pos[mocap_bodies], model.body_quat[mocap_bodies]]),
    )
    if keyframe is not None:
        k = names.index(keyframe)
        qpos = model.key_qpos[k]
        mocap_poses = np.hstack(
            [model.key_mpos[k].reshape(-1, 3), model.key_mquat[k].reshape(-1, 4)]
        )
    texts = tuple(" ".join(str(w.message).split()) for w in mujoco_warnings)
    return CompiledModel(mujoco, spec, model, np.array(qpos), mocap_poses, texts)
