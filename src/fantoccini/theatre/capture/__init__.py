"""Motion capture: skeletons and their motion from BVH files.

A skeleton is the tree of joints of the captured person, and a frame one instant of its motion.
"""

from fantoccini.theatre.capture.bvh import load_bvh
from fantoccini.theatre.capture.clip_files import bundled_clip_path, clip_names, clip_path
from fantoccini.theatre.capture.skeleton import Capture, Skeleton

__all__ = ["Capture", "Skeleton", "bundled_clip_path", "clip_names", "clip_path", "load_bvh"]
