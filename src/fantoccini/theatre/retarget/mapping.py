"""Mappings: the joints of a skeleton that are the parts of a person, and of a puppet.

The parts are named in :data:`PARTS`; hips and shoulders give the trunk.

A mapping file names the joint of each part. A joint is doubtful if another one may be the part.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from pydantic import Field, field_validator

from fantoccini.base import Array, FileError, Mistake, StateError, did_you_mean
from fantoccini.base.documents import (
    Document,
    Kind,
    Model,
    Name,
    Place,
    document_schema,
    raise_if_any,
    read_document,
    unknown_names,
    validation_error,
)
from fantoccini.theatre.capture import Skeleton
from fantoccini.theatre.retarget.finding import Doubt, guess_joints
from fantoccini.theatre.retarget.naming import END_SUFFIX, plain_names

_FOLDER = Path(__file__).parent / "mappings"
DOUBTFUL = "doubtful"
"""Word that marks a note about a joint that may be wrong."""
_MAX_LISTED_JOINTS = 60
"""Largest number of joints that an error lists."""
SIDES = ("left", "right")
_SIDE_PARTS = ("shoulder", "elbow", "hand", "hip", "knee", "foot")
PARTS = ("head", *(f"{part}_{side}" for side in SIDES for part in _SIDE_PARTS))
"""Parts of a person that a mapping names."""
BODIES = (
    "trunk",
    "head",
    *(f"{limb}_{side}" for side in SIDES for limb in ("upper_arm", "forearm", "thigh", "shin")),
)
"""Parts of a puppet that a mapping may name."""
LIMBS = (
    ("shoulder", "elbow", "hand", "upper_arm", "forearm"),
    ("hip", "knee", "foot", "thigh", "shin"),
)
"""Start, middle and end of a limb, and the bodies between them."""


class BodyFile(Model):
    """A body of the puppet, and its end."""

    body: str
    """Name of the body."""
    end: Place | None = None
    """End in the body's frame, for the head, forearms and shins: the hand, the foot [m]."""


class MappingFile(Document):
    """Joints of a skeleton, by part of a person."""

    kind: ClassVar = Kind("mapping", "a mapping has the keys `mapping` and `joints`", _FOLDER)

    mapping: Name
    """Name of the mapping."""
    about: str = ""
    """Origin of the skeletons."""
    joints: dict[str, str]
    """Part -> joint; a prefix that nearly all joints have (``mixamorig:``) may be omitted."""
    puppet: dict[str, BodyFile] = Field(default_factory=dict)
    """Part -> body, if its name differs from that of the bundled marionette."""

    @field_validator("joints")
    @classmethod
    def _check_parts(cls, joints: dict[str, str]) -> dict[str, str]:
        raise_if_any(unknown_names(joints, PARTS, "{} is no part"))
        if missing := [part for part in PARTS if part not in joints]:
            raise validation_error(
                f"found no {', '.join(missing)}; needed: all of {', '.join(PARTS)}"
            )
        for part, joint in joints.items():
            if list(joints.values()).count(joint) > 1:
                raise validation_error(
                    f"found {joint!r} twice, as {part} as well; needed: a joint each"
                )
        return joints

    @field_validator("puppet")
    @classmethod
    def _check_bodies(cls, puppet: dict[str, BodyFile]) -> dict[str, BodyFile]:
        raise_if_any(unknown_names(puppet, BODIES, "{} is no part"))
        return puppet

    def find(self, skeleton: Skeleton) -> dict[str, int]:
        """Part -> index of its joint; parts without a unique joint are left out."""
        lower_names = [name.lower() for name in skeleton.names]
        lower_plain_names = [name.lower() for name in plain_names(skeleton.names)]
        indices = {}
        for part, joint in self.joints.items():
            lower_name = joint.lower()
            searched_names = lower_names if lower_name in lower_names else lower_plain_names
            if searched_names.count(lower_name) == 1:
                indices[part] = searched_names.index(lower_name)
        return indices


@dataclass(frozen=True)
class RecognisedJoints:
    """Joints of a clip that are recognised without a mapping file.

    Attributes:
        mapping: a bundled mapping, or one found by the skeleton's shape.
        doubts: signs of errors; none if the names are those of a bundled mapping.
        by_shape: whether it was found by shape.
    """

    mapping: MappingFile
    doubts: tuple[Doubt, ...] = ()
    by_shape: bool = False

    def notes(self, name: str) -> tuple[str, ...]:
        """Sentences that say how the joints were found; none if by their names.

        Args:
            name: name of the clip.
        """
        if not self.by_shape:
            return ()
        joints = ", ".join(f"{part} {joint}" for part, joint in self.mapping.joints.items())
        warnings = (
            f"{name}: {DOUBTFUL}: {doubt}; to change it, write a mapping file with `fantoccini "
            "mapping` (--mapping)"
            for doubt in self.doubts
        )
        return f"{name}: Found by shape: {joints}", *warnings


def mapping_schema() -> dict[str, Any]:
    """JSON Schema of a mapping file, for editors."""
    return document_schema(MappingFile)


def mapping_names() -> tuple[str, ...]:
    """Names of the bundled mappings."""
    return MappingFile.kind.bundled


def load_mapping(path: str | os.PathLike[str]) -> MappingFile:
    """Mapping of a file.

    Args:
        path: path of the file, or the name of a bundled mapping (``poser``).

    Raises:
        FileError: the file has mistakes; all of them are listed, with their lines.
    """
    return read_document(path, MappingFile)


def find_mapping(skeleton: Skeleton, name: str = "clip") -> MappingFile:
    """Mapping of a skeleton: see :func:`recognise`, which also returns its doubts."""
    return recognise(skeleton, name).mapping


def recognise(
    skeleton: Skeleton, name: str = "clip", positions: Array | None = None
) -> RecognisedJoints:
    """Bundled mapping whose joints a skeleton has, or one found by its shape.

    Args:
        skeleton: skeleton with named joints.
        name: name of the clip, for the error.
        positions: (T, n, 3) positions of the joints in the clip, which show lengths and directions
            that some rest poses do not.

    Raises:
        FileError: no mapping fits, and no person has this shape; the message lists the parts that
            are missing from the best mapping.
    """
    mappings = [load_mapping(mapping_name) for mapping_name in mapping_names()]
    best = max(mappings, key=lambda mapping: len(mapping.find(skeleton)))
    indices = best.find(skeleton)
    if len(indices) == len(PARTS):
        return RecognisedJoints(best)
    try:
        guess = guess_joints(skeleton, positions)
    except StateError as error:
        missing = [part for part in PARTS if part not in indices]
        missing_text = f"; of {best.mapping} {', '.join(missing)} is missing" if indices else ""
        joints = [joint for joint in skeleton.names if not joint.endswith(END_SUFFIX)]
        ellipsis = " ..." if len(joints) > _MAX_LISTED_JOINTS else ""
        text = (
            f"no bundled mapping ({', '.join(mapping_names())}) has the names of the joints"
            f"{missing_text}; by their shape: {error}; give a mapping file (`fantoccini mapping` "
            f"writes one to fill in): the joints are "
            f"{', '.join(joints[:_MAX_LISTED_JOINTS])}{ellipsis}"
        )
        raise FileError([Mistake(name, None, "", text)]) from None
    names_by_part = {part: skeleton.names[guess.joints[part]] for part in PARTS}
    return RecognisedJoints(
        MappingFile(mapping="found", joints=names_by_part), guess.doubts, by_shape=True
    )


def joints_of(mapping: MappingFile, skeleton: Skeleton, name: str = "clip") -> dict[str, int]:
    """Part -> index of its joint.

    Args:
        mapping: joints of the parts.
        skeleton: skeleton with named joints.
        name: name of the clip, for the error.

    Raises:
        FileError: the skeleton lacks joints.
    """
    indices = mapping.find(skeleton)
    mistakes = [
        Mistake(
            name,
            None,
            f"joints.{part}",
            f"the skeleton has no joint {joint!r}, or several{did_you_mean(joint, skeleton.names)}",
        )
        for part, joint in mapping.joints.items()
        if part not in indices
    ]
    if mistakes:
        raise FileError(mistakes)
    return indices
