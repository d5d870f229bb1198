"""Motion capture on puppets: hanging poses and motions that come nearest to a clip."""

from fantoccini.retarget.figure import Figure, figure_of
from fantoccini.retarget.following import Followed, FollowStatus, PartError, follow_clip
from fantoccini.retarget.gesturing import ClipGesture, clip_gesture, place_on_spot
from fantoccini.retarget.mapping import (
    MappingFile,
    find_mapping,
    load_mapping,
    mapping_names,
    mapping_schema,
)
from fantoccini.retarget.placing import Placing
from fantoccini.retarget.retargeting import Placed, Retargeted, place_clip, retarget_clip

__all__ = [
    "ClipGesture", "Figure", "FollowStatus", "Followed", "MappingFile", "PartError", "Placed",
    "Placing", "Retargeted", "clip_gesture", "figure_of", "find_mapping", "follow_clip",
    "load_mapping", "mapping_names", "mapping_schema", "place_clip", "place_on_spot",
    "retarget_clip",
]  # fmt: skip
