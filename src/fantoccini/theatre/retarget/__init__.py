"""Retargeting: hanging poses and motions of a puppet nearest to a captured clip.

Parts are those of a person, such as the left elbow. A mapping says which joint of the skeleton, and
a figure which body of the puppet, is which part. A hanging pose is the pose at rest for given
driven coordinates q_K, the ends and lengths of strings.
"""

from fantoccini.theatre.retarget.deviations import LimbBend, PartError, PartLoss
from fantoccini.theatre.retarget.drafting import draft_mapping
from fantoccini.theatre.retarget.figure import Figure, figure_of
from fantoccini.theatre.retarget.following import (
    MAX_ACCELERATION,
    MAX_ERROR,
    MAX_SPEED,
    FollowResult,
    FollowStatus,
    follow_clip,
)
from fantoccini.theatre.retarget.gesturing import (
    CLIP_END_MARK,
    CLIP_START_MARK,
    ClipGesture,
    TooShortError,
    clip_gesture,
    place_on_spot,
)
from fantoccini.theatre.retarget.mapping import (
    DOUBTFUL,
    PARTS,
    MappingFile,
    RecognisedJoints,
    find_mapping,
    load_mapping,
    mapping_names,
    mapping_schema,
    recognise,
)
from fantoccini.theatre.retarget.placing import PartTargets
from fantoccini.theatre.retarget.retargeting import (
    PlacedClip,
    RetargetedClip,
    place_clip,
    retarget_clip,
)

__all__ = [
    "CLIP_END_MARK",
    "CLIP_START_MARK",
    "DOUBTFUL",
    "MAX_ACCELERATION",
    "MAX_ERROR",
    "MAX_SPEED",
    "PARTS",
    "ClipGesture",
    "Figure",
    "FollowResult",
    "FollowStatus",
    "LimbBend",
    "MappingFile",
    "PartError",
    "PartLoss",
    "PartTargets",
    "PlacedClip",
    "RecognisedJoints",
    "RetargetedClip",
    "TooShortError",
    "clip_gesture",
    "draft_mapping",
    "figure_of",
    "find_mapping",
    "follow_clip",
    "load_mapping",
    "mapping_names",
    "mapping_schema",
    "place_clip",
    "place_on_spot",
    "recognise",
    "retarget_clip",
]
