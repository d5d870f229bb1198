"""Motion capture: skeletons and their motion from BVH files.

A skeleton is the tree of joints of the captured person, and a frame one instant of its motion.
"""

from fantoccini.theatre.capture.bvh import bundled_clip_path, clip_names, load_bvh
from fantoccini.theatre.capture.skeleton import Capture, Skeleton

__all__ = ["Capture", "Skeleton", "bundled_clip_path", "clip_names", "load_bvh"]
