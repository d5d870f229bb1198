"""The names of the package, and where each is defined."""

from . import (
    capture as capture,
    cast as cast,
    gaits as gaits,
    gestures as gestures,
    pathfinding as pathfinding,
    perform as perform,
    plays as plays,
    retarget as retarget,
    script as script,
)
from .capture import (
    Capture as Capture,
    Skeleton as Skeleton,
    clip_names as clip_names,
    load_bvh as load_bvh,
)
from .gaits import Gait as Gait, find_gait as find_gait, footfalls as footfalls
from .gestures import (
    Conductor as Conductor,
    Gesture as Gesture,
    Score as Score,
    gesture_names as gesture_names,
    load_gesture as load_gesture,
    load_score as load_score,
    rehearse as rehearse,
)
from .perform import (
    Balance as Balance,
    Handle as Handle,
    LivePlay as LivePlay,
    Performance as Performance,
    Recording as Recording,
)
from .plays import (
    Play as Play,
    Verification as Verification,
    load_play as load_play,
    verify_play as verify_play,
)
from .retarget import (
    FollowResult as FollowResult,
    RetargetedClip as RetargetedClip,
    follow_clip as follow_clip,
    retarget_clip as retarget_clip,
)
from .script import play_schema as play_schema
