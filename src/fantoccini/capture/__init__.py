"""Motion capture: skeletons and their motion from BVH files."""

from fantoccini.capture.bvh import clip_names, load_bvh
from fantoccini.capture.skeleton import Capture, Skeleton

__all__ = ["Capture", "Skeleton", "clip_names", "load_bvh"]
