"""Motion capture on puppets: hanging poses and motions that come nearest to a clip."""

from fantoccini.retarget.figure import Figure, figure_of
from fantoccini.retarget.following import Followed, FollowStatus, PartError, follow_clip
from fantoccini.retarget.mapping import (
    MappingFile,
    find_mapping,
    load_mapping,
    mapping_names,
    mapping_schema,
)
from fantoccini.retarget.placing import Placing
from fantoccini.retarget.retargeting import Retargeted, retarget_clip

__all__ = [
    "Figure", "FollowStatus", "Followed", "MappingFile", "PartError", "Placing", "Retargeted",
    "figure_of", "find_mapping", "follow_clip", "load_mapping", "mapping_names", "mapping_schema",
    "retarget_clip",
]  # fmt: skip
