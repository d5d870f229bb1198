"""Reflection of one half of a puppet into the other, on plain data.

With the reflection S, diagonal with one -1 and two 1, mirror images are S p of points, S R S of
rotations and S I S of inertias. The axis a of a rotation is a pseudo-vector: its mirror image is
-S a, so that equal angles are mirror images.

A twin is the mirror image of a part; its name has the other word, such as ``left`` for ``right``. A
drive moves a coordinate by a motor towards its command.
"""

from __future__ import annotations

from typing import Any

from fantoccini.base.documents import Finding, Path, owner_of

SIGNS = {"xy": (1, 1, -1), "yz": (-1, 1, 1), "xz": (1, -1, 1)}
_INDEX = {"x": 0, "y": 1, "z": 2}


def twin_name(name: str, word: str, twin_word: str) -> str:
    """Name of the mirrored twin: that of the part itself if it does not contain the token."""
    return name.replace(word, twin_word)


def reflected(data: dict[str, Any]) -> tuple[dict[str, Any], list[Finding]]:
    """A puppet's data with its mirror applied.

    Args:
        data: plain data of a valid puppet.

    Returns:
        The data with twins after the originals and without ``mirror``, and mistakes.
    """
    if "mirror" not in data:
        return data, []
    mirror = data["mirror"]
    reflection = Reflection(mirror["plane"], mirror["from"], mirror["to"])
    mirrored = {key: value for key, value in data.items() if key != "mirror"}
    sections = {
        "bodies": reflection.body,
        "strings": reflection.string,
        "springs": reflection.spring,
    }
    for key, reflect in sections.items():
        if key in data:
            twins = [
                reflect(item, (key, i))
                for i, item in enumerate(data[key])
                if mirror["from"] in item["name"]
            ]
            mirrored[key] = [*data[key], *twins]
    if "drives" in data:
        mirrored["drives"] = [reflection.drive(drive) for drive in data["drives"]]
    if isinstance(data.get("contact"), dict):
        mirrored["contact"] = reflection.contact(data["contact"])
    if "rig" in data:
        mirrored["rig"] = reflection.rig(data["rig"])
    if "pose" in data:
        mirrored["pose"] = reflection.pose(data["pose"]) | data["pose"]
    return mirrored, reflection.findings


class Reflection:
    """Mirror images of the parts of a puppet.

    Attributes:
        findings: mistakes about parameters whose mirror image would have the opposite sign.
    """

    def __init__(self, plane: str, word: str, twin_word: str):
        self.signs, self.word, self.twin_word = SIGNS[plane], word, twin_word
        self.findings: list[Finding] = []

    def name(self, name: str) -> str:
        return twin_name(name, self.word, self.twin_word)

    def contact(self, contact: dict[str, Any]) -> dict[str, Any]:
        """Contact rules with the twins' pairs first, so that the originals override them."""
        pairs = contact.get("pairs", [])
        twins = [p | {"between": [self.name(n) for n in p["between"]]} for p in pairs]
        twins = [twin for twin, pair in zip(twins, pairs, strict=True) if twin != pair]
        return contact | {"pairs": [*twins, *pairs]} if twins else contact

    def rig(self, rig: dict[str, Any]) -> dict[str, Any]:
        """A rig with the twins of its limbs and strings, if it does not list them itself."""
        mirrored = dict(rig)
        for key in ("carrying", "looking", "trunk"):
            if key in rig:
                mirrored[key] = self.with_twins(rig[key])
        limbs = rig.get("limbs", [])
        listed_chains = [limb["bodies"] for limb in limbs]
        twins = [self.limb(limb) for limb in limbs]
        if limbs:
            mirrored["limbs"] = [
                *limbs,
                *(twin for twin in twins if twin["bodies"] not in listed_chains),
            ]
        return mirrored

    def limb(self, limb: dict[str, Any]) -> dict[str, Any]:
        opposite_side = {"left": "right", "right": "left"}
        mirrored = limb | {
            key: [self.name(n) for n in limb[key]] for key in ("bodies", "strings") if key in limb
        }
        if "side" in limb:
            mirrored["side"] = opposite_side.get(limb["side"], limb["side"])
        return mirrored | {"end": self.vector(limb["end"])}

    def with_twins(self, names: list[str]) -> list[str]:
        """The names, followed by those of their twins that are missing."""
        return list(dict.fromkeys([*names, *map(self.name, names)]))

    def body(self, body: dict[str, Any], path: Path = ()) -> dict[str, Any]:
        out = body | {"name": self.name(body["name"])}
        if "parent" in body:
            out["parent"] = self.name(body["parent"])
        if "joint" in body:
            out["joint"] = self.joint(body["joint"], (*path, "joint"))
        if "shapes" in body:
            out["shapes"] = [self.shape(s) for s in body["shapes"]]
        if "com" in body:
            out["com"] = self.vector(body["com"], (*path, "com"))
        if len(body.get("inertia", ())) == 6:
            x, y, z = self.signs
            signs = (1, 1, 1, x * y, x * z, y * z)
            out["inertia"] = self.with_signs(body["inertia"], signs, (*path, "inertia"))
        return out

    def joint(self, joint: dict[str, Any], path: Path = ()) -> dict[str, Any]:
        out = dict(joint)
        if "name" in joint:
            out["name"] = self.name(joint["name"])
        if "axis" in joint:
            is_revolute = joint["type"] == "revolute"
            out["axis"] = (
                self.pseudo_vector(joint["axis"]) if is_revolute else self.vector(joint["axis"])
            )
        if "at" in joint:
            out["at"] = self.vector(joint["at"], (*path, "at"))
        if "orientation" in joint:
            out["orientation"] = self.orientation(joint["orientation"])
        for key in ("cone", "twist"):
            if key in joint:
                axes = {k: self.vector(v) for k, v in joint[key].items() if k in ("axis", "of")}
                out[key] = joint[key] | axes
        if "twist" in joint:
            bounds = {"lower": joint["twist"].get("upper"), "upper": joint["twist"].get("lower")}
            for side, bound in bounds.items():
                out["twist"].pop(side, None)
                if bound is not None:
                    out["twist"][side] = 0.0 - bound
        return out

    def shape(self, shape: dict[str, Any]) -> dict[str, Any]:
        out = shape | {k: self.vector(shape[k]) for k in ("at", "from", "to") if k in shape}
        if "orientation" in shape:
            out["orientation"] = self.orientation(shape["orientation"])
        if shape["type"] == "mesh":
            out["scale"] = self.vector(shape.get("scale", [1.0, 1.0, 1.0]))
        return out

    def orientation(self, orientation: dict[str, Any]) -> dict[str, Any]:
        """S R S: the axis of the rotation is a pseudo-vector."""
        if "quaternion" in orientation:
            return {"quaternion": self.rotation(orientation["quaternion"])}
        if "rpy" in orientation:
            return {"rpy": self.pseudo_vector(orientation["rpy"])}
        return orientation | {"axis": self.pseudo_vector(orientation["axis"])}

    def rotation(self, quaternion: list[float]) -> list[float]:
        return [quaternion[0], *self.pseudo_vector(quaternion[1:])]

    def string(self, string: dict[str, Any], path: Path = ()) -> dict[str, Any]:
        points = [self.point(a, (*path, "path", k)) for k, a in enumerate(string["path"])]
        return string | {"name": self.name(string["name"]), "path": points}

    def spring(self, spring: dict[str, Any], path: Path = ()) -> dict[str, Any]:
        ends = [self.point(a, (*path, "between", k)) for k, a in enumerate(spring["between"])]
        return spring | {"name": self.name(spring["name"]), "between": ends}

    def drive(self, drive: dict[str, Any]) -> dict[str, Any]:
        """A drive on its coordinates and their twins."""
        on = drive["on"]
        twins = [
            self.name(owner) + coordinate[len(owner) :]
            for coordinate in on
            if self.word in (owner := owner_of(coordinate))
        ]
        return drive | {"on": [*on, *(coordinate for coordinate in twins if coordinate not in on)]}

    def point(self, attachment: dict[str, Any], path: Path = ()) -> dict[str, Any]:
        out = dict(attachment)
        for key in ("body", "parent"):
            if key in attachment:
                out[key] = self.name(attachment[key])
        for key in ("at", "world"):
            if key in attachment:
                out[key] = self.vector(attachment[key], (*path, key))
        return out

    def pose(self, pose: dict[str, Any]) -> dict[str, Any]:
        """Start values of the twins; x, y, z are coordinates in the (mirrored) joint frame."""
        out = {}
        for key, value in pose.items():
            owner = owner_of(key)
            suffix = key[len(owner) + 1 :]
            if self.word not in owner:
                continue
            if suffix == "rotation":
                value = self.rotation(value)
            elif suffix in _INDEX and self.signs[_INDEX[suffix]] < 0:
                value = 0.0 - value
            out[self.name(owner) + key[len(owner) :]] = value
        return out

    def vector(self, vector: list[Any], path: Path = ()) -> list[Any]:
        return self.with_signs(vector, self.signs, path)

    def pseudo_vector(self, vector: list[Any]) -> list[Any]:
        return self.with_signs(vector, tuple(-s for s in self.signs), ())

    def with_signs(self, numbers: list[Any], signs: tuple[int, ...], path: Path) -> list[Any]:
        out = []
        for k, (number, sign) in enumerate(zip(numbers, signs, strict=True)):
            if sign < 0 and isinstance(number, dict):
                name = number["parameter"]
                text = f"the mirror image needs -{name}; write out both halves instead"
                self.findings.append(((*path, k), text))
            out.append(0.0 - number if sign < 0 and not isinstance(number, dict) else number)
        return out
