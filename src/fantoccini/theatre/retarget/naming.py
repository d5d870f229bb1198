"""Names of joints: prefixes, sides, pieces of one bone, and parts of a person.

A twin is the mirror image of a joint: ``hand_l`` and ``hand_r``.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

END_SUFFIX = ".end"
"""Suffix of the end of a chain."""
_SIDE_WORDS = (("left", "right"), ("lft", "rgt"), ("l", "r"), ("左", "右"))
"""Words for the sides, left first; longer words come before those with which they begin."""
_WORD = re.compile(r"[A-Z]+(?![^\W\d_A-Z])|[A-Z]?[^\W\d_A-Z]+")
_PREFIX = re.compile(r"[^\W\d_]+\d*[ _.\-]+")
"""Beginning of a name, up to its first separator."""
_PREFIX_SHARE = 0.8
"""Least share of the names that begin with a prefix."""
_BONE_PIECE_WORDS = {"twist", "roll", "bend", "def", "part", "segment"}
"""Words of joints within a bone."""
_ACCESSORY_WORDS = {
    *("hair", "skirt", "cloth", "coat", "cape", "cloak", "scarf", "sleeve", "tail", "wing"),
    *("breast", "bust", "pectoral", "ear", "eye", "prop", "weapon", "sec", "ik", "pole"),
    *("face", "facial", "jaw", "tongue", "teeth", "target", "control", "ctrl"),
}
"""Words of joints that are no parts of a person."""
_PART_WORDS = {
    "head": ("head", "skull"),
    "shoulder": ("upperarm", "uparm", "armupper", "humerus", "shldr"),
    "elbow": ("forearm", "lowerarm", "lowarm", "loarm", "armlower", "elbow", "radius"),
    "hand": ("hand", "wrist"),
    "hip": ("thigh", "upperleg", "upleg", "legupper", "femur"),
    "knee": ("lowerleg", "lowleg", "loleg", "leglower", "knee", "shin", "calf", "tibia"),
    "foot": ("foot", "ankle"),
}
"""Names that each part has in every program that uses them; others, such as leg, have several."""
_LIMB_WORDS = {
    "arm": ("arm", "hand", "wrist", "shoulder", "shldr", "elbow", "clav", "collar", "humer"),
    "leg": ("leg", "foot", "thigh", "knee", "hip", "shin", "calf", "ankle", "toe", "femur"),
}


def plain_names(names: Sequence[str]) -> tuple[str, ...]:
    """Names without prefixes: those with a colon, and those that nearly all have (``Bip01 ``)."""
    plain = [name.rsplit(":", 1)[-1] for name in names]
    while True:
        prefixes = Counter(
            match[0] for name in plain if (match := _PREFIX.match(name)) and match[0] != name
        )
        prefix, count = prefixes.most_common(1)[0] if prefixes else ("", 0)
        if count < _PREFIX_SHARE * len(plain):
            return tuple(plain)
        plain = [name.removeprefix(prefix) if name != prefix else name for name in plain]


def side_of(name: str, twin: str) -> str:
    """Side of a joint, ``left`` or ``right``, from its name and its twin's; "" if neither."""
    lower_name, lower_twin = name.lower(), twin.lower()
    for left, right in _SIDE_WORDS:
        if _is_mirrored(lower_name, left, right, lower_twin):
            return "left"
        if _is_mirrored(lower_twin, left, right, lower_name):
            return "right"
    return ""


def _is_mirrored(name: str, word: str, replacement: str, twin: str) -> bool:
    """Whether a name with one occurrence of a word replaced is the twin's."""
    return any(
        name[: match.start()] + replacement + name[match.end() :] == twin
        for match in re.finditer(re.escape(word), name)
    )


def stem_of(name: str) -> str:
    """Name without numbers and words for pieces, the same for all joints within a bone.

    A helper (``__UpLeg_L``) lies between a bone and the one above it, and has another stem.
    """
    prefix = ["__"] if name.startswith("__") else []
    return " ".join(prefix + [word for word in _words(name) if word not in _BONE_PIECE_WORDS])


def is_accessory(name: str) -> bool:
    """Whether a joint belongs to a face, hair, clothes, props or controls."""
    return not _ACCESSORY_WORDS.isdisjoint(_words(name))


def part_of_name(name: str) -> str:
    """Part of a person of that name, without its side (``knee``); "" if the name is ambiguous."""
    joined = "".join(_words(name.removesuffix(END_SUFFIX)))
    sides = [side for pair in _SIDE_WORDS for side in pair]
    candidates = {joined, *(joined.removeprefix(side) for side in sides)}
    candidates |= {joined.removesuffix(side) for side in sides}
    for part, words in _PART_WORDS.items():
        if not candidates.isdisjoint(words):
            return part
    return ""


def limb_of_names(names: Sequence[str]) -> str:
    """Limb with joints of these names, ``arm`` or ``leg``; "" if the names are ambiguous."""
    joined_names = ["".join(_words(name)) for name in names]
    counts = {
        limb: sum(any(word in joined_name for word in words) for joined_name in joined_names)
        for limb, words in _LIMB_WORDS.items()
    }
    if counts["arm"] == counts["leg"]:
        return ""
    return max(counts, key=lambda limb: counts[limb])


def _words(name: str) -> list[str]:
    return [word.lower() for word in _WORD.findall(name)]
