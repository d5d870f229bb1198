"""Retargeting: hanging poses and motions of a puppet nearest to a captured clip."""

from fantoccini.theatre.retarget.deviations import Loss, PartError
from fantoccini.theatre.retarget.drafting import draft_mapping
from fantoccini.theatre.retarget.figure import Figure, figure_of
from fantoccini.theatre.retarget.following import (
    ACCELERATION,
    MAX_ERROR,
    SPEED,
    Followed,
    FollowStatus,
    follow_clip,
)
from fantoccini.theatre.retarget.gesturing import (
    BEGINS,
    OVER,
    ClipGesture,
    TooShortError,
    clip_gesture,
    place_on_spot,
)
from fantoccini.theatre.retarget.mapping import (
    DOUBTFUL,
    PARTS,
    MappingFile,
    Recognised,
    find_mapping,
    load_mapping,
    mapping_names,
    mapping_schema,
    recognise,
)
from fantoccini.theatre.retarget.placing import Placing
from fantoccini.theatre.retarget.retargeting import (
    PlacedClip,
    Retargeted,
    place_clip,
    retarget_clip,
)

__all__ = [
    "ACCELERATION",
    "BEGINS",
    "DOUBTFUL",
    "MAX_ERROR",
    "OVER",
    "PARTS",
    "SPEED",
    "ClipGesture",
    "Figure",
    "FollowStatus",
    "Followed",
    "Loss",
    "MappingFile",
    "PartError",
    "PlacedClip",
    "Placing",
    "Recognised",
    "Retargeted",
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
