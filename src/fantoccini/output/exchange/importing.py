"""Models of other programs become puppet files."""

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
from fantoccini.output.exchange.draft import Draft, numbers
from fantoccini.output.exchange.imported import Imported
from fantoccini.output.exchange.mjcf_bodies import Bodies, Compiled
from fantoccini.output.exchange.mjcf_copies import attached_models
from fantoccini.output.exchange.mjcf_includes import (
    asset_folders,
    line_of_mistake,
    locate,
    told,
    with_includes,
)
from fantoccini.output.exchange.mjcf_rest import add_notes, add_shapes
from fantoccini.output.exchange.mjcf_strings import add_constraints, add_tendons
from fantoccini.output.exchange.model_file import ROOTS, ModelFile, line_in, read_model

_UNNAMED = "MuJoCo Model"
"""MuJoCo's name for models without one."""


def import_model(
    path: str | os.PathLike[str], keyframe: str | None = None, density: float | None = None
) -> Imported:
    """A model in MJCF or URDF as a puppet file.

    Joints keep their coordinates, so that accelerations are those of the model's own program
    wherever the report names nothing.

    Args:
        path: of the model.
        keyframe: of an MJCF file, that the puppet starts in; by default its zero pose.
        density: for the solids of links without inertia in URDF [kg/m^3]; by default that of water
            if a joint would move no mass, else such links have no mass. The report says which.

    Raises:
        ExchangeError: the file is no model, or has what no puppet can have.
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
    """Raises StateError unless a density is one that a puppet file may have, or None."""
    allowed = QUANTITIES["density"]
    if density is not None and not (
        is_number(density) and allowed.min_size <= density <= allowed.max_size
    ):
        raise StateError(
            f"the density is {density!s:.12}; allowed: {allowed.min_size:g} to "
            f"{allowed.max_size:g} {allowed.unit}"
        )


def mjcf_puppet(file: ModelFile, keyframe: str | None) -> Imported:
    """An MJCF file as a puppet file."""
    file = with_includes(file)
    models = attached_models(file)
    compiled = _compiled(file, keyframe, models)
    name = compiled.spec.modelname
    draft = Draft(file, "" if name == _UNNAMED else name)
    m, flags = compiled.model, compiled.mujoco.mjtDisableBit
    weightless = m.opt.disableflags & int(flags.mjDSBL_GRAVITY)
    gravity = [0.0, 0.0, 0.0] if weightless else numbers(m.opt.gravity)
    if gravity != [0.0, 0.0, -9.81]:
        draft.top["gravity"] = gravity
    bodies = Bodies(compiled, draft)
    for model in models:
        draft.sources += (model.path, *model.others)
    for model in (file, *models):
        draft.sources += _assets(model)
    add_tendons(bodies)
    add_constraints(bodies)
    add_shapes(bodies)
    add_notes(bodies, keyframe)
    for text in compiled.warnings:
        draft.note("mujoco", "", f"warns: {text[:300]}")
    return draft.finish([f"{draft.name}: made of the MuJoCo model {file.path.name}."])


@dataclass(frozen=True)
class _Said:
    """What MuJoCo says of a file, and the line in its text."""

    text: str
    line: int | None

    @property
    def first(self) -> str:
        """The mistake, without the element."""
        return self.text.partition("\n")[0]

    def mistake(self, file: ModelFile) -> ExchangeError:
        lines = [part.strip() for part in self.text.splitlines() if part.strip()]
        text = "; ".join(lines)[:500] or "cannot be read"
        return file.mistake(f"MuJoCo says: {text}", self.line)


def _read(file: ModelFile) -> tuple[Any, Any] | _Said:
    """MuJoCo's specification and model of a file."""
    mujoco, spec = library(), None
    try:
        spec = mujoco.MjSpec.from_file(str(file.path))
        if file.origins:
            locate(mujoco, file, spec)
        return spec, spec.compile()
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        said, line = str(error), line_in(str(error))
        if file.origins:
            if spec is None:
                line = line_of_mistake(mujoco, file, said)
            said = told(said, file.place(line)[1])
        return _Said(said, line)


def _assets(file: ModelFile) -> Iterator[Path]:
    """Where files that a model names may be, with and without the folders in their names."""
    folders = asset_folders(file)
    for element in file.elements:
        if given := element.attributes.get("file"):
            for name in dict.fromkeys((given, os.path.basename(given))):
                yield from (Path(folder, name) for folder in folders)


def _compiled(file: ModelFile, keyframe: str | None, models: Iterable[ModelFile]) -> Compiled:
    """MuJoCo's model of a file, which attaches others."""
    mujoco = library()
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        found = _read(file)
        if isinstance(found, _Said):
            for attached in models if found.line is None else ():
                own = _read(attached)
                if isinstance(own, _Said) and own.first and own.first in found.text:
                    raise own.mistake(attached)
            raise found.mistake(file)
    spec, model = found
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
