"""Models of other programs become puppet files."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from fantoccini.errors import UnknownNameError
from fantoccini.exchange.draft import Draft, numbers
from fantoccini.exchange.imported import Imported
from fantoccini.exchange.mjcf_bodies import Bodies, Compiled
from fantoccini.exchange.mjcf_copies import refuse_copies
from fantoccini.exchange.mjcf_includes import line_of_mistake, locate, told, with_includes
from fantoccini.exchange.mjcf_rest import add_notes, add_shapes
from fantoccini.exchange.mjcf_strings import add_constraints, add_tendons
from fantoccini.exchange.model_file import ROOTS, ModelFile, line_in, read_model
from fantoccini.exchange.mujoco_puppet import library

_UNNAMED = "MuJoCo Model"
"""MuJoCo's name for models without one."""


def import_model(path: str | os.PathLike[str], keyframe: str | None = None) -> Imported:
    """A model in MJCF or URDF as a puppet file.

    Joints keep their coordinates, so that accelerations are those of the model's own program
    wherever the report names nothing.

    Args:
        path: of the model.
        keyframe: of an MJCF file, that the puppet starts in; by default its zero pose.

    Raises:
        ExchangeError: the file is no model, or has what no puppet can have.
        MissingLibraryError: MJCF needs MuJoCo, URDF yourdfpy.
        UnknownNameError: there is no such keyframe.
    """
    file = read_model(path)
    if ROOTS[file.root] == "URDF":
        from fantoccini.exchange.urdf_model import urdf_puppet

        if keyframe is not None:
            raise UnknownNameError("keyframe", keyframe, ())
        return urdf_puppet(file)
    return mjcf_puppet(file, keyframe)


def mjcf_puppet(file: ModelFile, keyframe: str | None) -> Imported:
    """An MJCF file as a puppet file."""
    file = with_includes(file)
    refuse_copies(file)
    compiled = _compiled(file, keyframe)
    name = compiled.spec.modelname
    draft = Draft(file, "" if name == _UNNAMED else name)
    m, flags = compiled.model, compiled.mujoco.mjtDisableBit
    weightless = m.opt.disableflags & int(flags.mjDSBL_GRAVITY)
    gravity = [0.0, 0.0, 0.0] if weightless else numbers(m.opt.gravity)
    if gravity != [0.0, 0.0, -9.81]:
        draft.top["gravity"] = gravity
    bodies = Bodies(compiled, draft)
    draft.sources += _meshes(compiled.spec, file)
    add_tendons(bodies)
    add_constraints(bodies)
    add_shapes(bodies)
    add_notes(bodies, keyframe)
    for text in compiled.warnings:
        draft.note("mujoco", "", f"warns: {text[:300]}")
    return draft.finish([f"{draft.name}: made of the MuJoCo model {file.path.name}."])


def _meshes(spec: Any, file: ModelFile) -> Iterator[Path]:
    """Where the files of meshes may be."""
    for folder in dict.fromkeys(path.parent for path in (file.path, *file.others)):
        for mesh in spec.meshes:
            if mesh.file:
                yield folder / mesh.file
                yield folder / (spec.meshdir or "") / mesh.file


def _compiled(file: ModelFile, keyframe: str | None) -> Compiled:
    mujoco, spec = library(), None
    try:
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            spec = mujoco.MjSpec.from_file(str(file.path))
            if file.origins:
                locate(mujoco, file, spec)
            model = spec.compile()
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        said, line = str(error), line_in(str(error))
        if file.origins:
            if spec is None:
                line = line_of_mistake(mujoco, file, said)
            said = told(said, file.place(line)[1])
        lines = [part.strip() for part in said.splitlines() if part.strip()]
        text = "; ".join(lines)[:500] or "cannot be read"
        raise file.mistake(f"MuJoCo says: {text}", line) from None
    names = [model.key(k).name for k in range(model.nkey)]
    if keyframe is not None and keyframe not in names:
        raise UnknownNameError("keyframe", keyframe, names)
    held = np.argsort(model.body_mocapid)[model.nbody - model.nmocap :]
    qpos, mocap = model.qpos0, np.hstack([model.body_pos[held], model.body_quat[held]])
    if keyframe is not None:
        k = names.index(keyframe)
        qpos = model.key_qpos[k]
        mocap = np.hstack([model.key_mpos[k].reshape(-1, 3), model.key_mquat[k].reshape(-1, 4)])
    texts = tuple(" ".join(str(w.message).split()) for w in warned)
    return Compiled(mujoco, spec, model, np.array(qpos), mocap, texts)
