"""Skeletons of a person as programs name and build them, in three rest poses.

A row has a joint, its parent and its place; stars stand for a side. Hands hang along the arm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fantoccini.theatre.capture import Skeleton

POSES = {"T": (0.0, 1.0, 0.0), "A": (0.0, 0.7, -0.7), "down": (0.05, 0.08, -1.0)}
"""Direction of the left arm in a rest pose."""
_TRUNK = {
    "floor": (0.0, 0.0, 0.0),
    "hips": (0.0, 0.0, 0.98),
    "s1": (0.01, 0.0, 1.05),
    "s2": (0.0, 0.0, 1.18),
    "s3": (-0.02, 0.0, 1.32),
    "neck": (-0.02, 0.0, 1.48),
    "neck2": (-0.01, 0.0, 1.53),
    "head": (0.0, 0.0, 1.58),
    "crown": (0.02, 0.0, 1.75),
    "jaw": (0.05, 0.0, 1.6),
}
_LEFT = {
    "pelvis": (0.0, 0.02, 0.96),
    "hip": (0.0, 0.09, 0.93),
    "thigh": (0.0, 0.095, 0.72),
    "knee": (0.01, 0.1, 0.51),
    "shin": (-0.01, 0.1, 0.3),
    "ankle": (-0.03, 0.1, 0.09),
    "ball": (0.1, 0.11, 0.02),
    "toe": (0.16, 0.11, 0.02),
    "heel": (-0.07, 0.1, 0.01),
    "bust": (0.1, 0.08, 1.3),
    "eye": (0.08, 0.03, 1.65),
    "skirt": (0.0, 0.14, 0.95),
    "skirt2": (0.0, 0.18, 0.7),
    "skirt3": (0.0, 0.22, 0.4),
    "hair": (-0.08, 0.05, 1.68),
    "hair2": (-0.12, 0.06, 1.4),
    "hair3": (-0.13, 0.06, 1.1),
    "collar": (0.01, 0.03, 1.43),
    "deltoid": (0.0, 0.12, 1.44),
    "shoulder": (-0.01, 0.17, 1.43),
}
_ALONG_ARM = {
    "upper": 0.14,
    "elbow": 0.28,
    "fore": 0.41,
    "wrist": 0.54,
    "palm": 0.56,
    "knuckle": 0.63,
    "finger": 0.68,
    "tip": 0.71,
}
"""Distance from the shoulder [m]."""

UNREAL = """
root - floor
pelvis root hips
spine_01 pelvis s1
spine_02 spine_01 s2
spine_03 spine_02 s3
neck_01 spine_03 neck
head neck_01 head
clavicle_* spine_03 collar
upperarm_* clavicle_* shoulder
upperarm_twist_01_* upperarm_* upper
lowerarm_* upperarm_* elbow
lowerarm_twist_01_* lowerarm_* fore
hand_* lowerarm_* wrist
middle_01_* hand_* knuckle
middle_02_* middle_01_* finger
thigh_* pelvis hip
thigh_twist_01_* thigh_* thigh
calf_* thigh_* knee
foot_* calf_* ankle
ball_* foot_* ball
ik_foot_root root floor
ik_foot_* ik_foot_root ankle
ik_hand_root root floor
ik_hand_* ik_hand_root wrist
"""
VRM = """
J_Bip_C_Hips - hips
J_Bip_C_Spine J_Bip_C_Hips s1
J_Bip_C_Chest J_Bip_C_Spine s2
J_Bip_C_UpperChest J_Bip_C_Chest s3
J_Sec_*_Bust1 J_Bip_C_UpperChest bust
J_Bip_C_Neck J_Bip_C_UpperChest neck
J_Bip_C_Head J_Bip_C_Neck head
J_Adj_*_FaceEye J_Bip_C_Head eye
J_Sec_Hair1_* J_Bip_C_Head hair
J_Sec_Hair2_* J_Sec_Hair1_* hair2
J_Sec_Hair3_* J_Sec_Hair2_* hair3
J_Bip_*_Shoulder J_Bip_C_UpperChest collar
J_Bip_*_UpperArm J_Bip_*_Shoulder shoulder
J_Bip_*_LowerArm J_Bip_*_UpperArm elbow
J_Bip_*_Hand J_Bip_*_LowerArm wrist
J_Bip_*_Middle1 J_Bip_*_Hand knuckle
J_Bip_*_Middle2 J_Bip_*_Middle1 finger
J_Bip_*_UpperLeg J_Bip_C_Hips hip
J_Sec_*_SkirtSide1 J_Bip_*_UpperLeg skirt
J_Sec_*_SkirtSide2 J_Sec_*_SkirtSide1 skirt2
J_Sec_*_SkirtSide3 J_Sec_*_SkirtSide2 skirt3
J_Bip_*_LowerLeg J_Bip_*_UpperLeg knee
J_Bip_*_Foot J_Bip_*_LowerLeg ankle
J_Bip_*_ToeBase J_Bip_*_Foot ball
"""
UNITY = """
Hips - hips
Spine Hips s1
Chest Spine s2
UpperChest Chest s3
Neck UpperChest neck
Head Neck head
*Eye Head eye
*Shoulder UpperChest collar
*UpperArm *Shoulder shoulder
*LowerArm *UpperArm elbow
*Hand *LowerArm wrist
*MiddleProximal *Hand knuckle
*UpperLeg Hips hip
*LowerLeg *UpperLeg knee
*Foot *LowerLeg ankle
*Toes *Foot ball
"""
RIGIFY = """
spine - hips
spine.001 spine s1
spine.002 spine.001 s2
spine.003 spine.002 s3
spine.004 spine.003 neck
spine.005 spine.004 neck2
spine.006 spine.005 head
face spine.006 head
jaw face jaw
eye.* face eye
breast.* spine.003 bust
shoulder.* spine.003 collar
upper_arm.* shoulder.* shoulder
forearm.* upper_arm.* elbow
hand.* forearm.* wrist
palm.01.* hand.* palm
f_index.01.* palm.01.* knuckle
f_index.02.* f_index.01.* finger
pelvis.* spine hips
thigh.* spine hip
shin.* thigh.* knee
foot.* shin.* ankle
toe.* foot.* ball
heel.02.* foot.* heel
"""
DEFORM = """
DEF-spine - hips
DEF-spine.001 DEF-spine s1
DEF-spine.002 DEF-spine.001 s2
DEF-spine.003 DEF-spine.002 s3
DEF-spine.004 DEF-spine.003 neck
DEF-spine.005 DEF-spine.004 neck2
DEF-spine.006 DEF-spine.005 head
DEF-shoulder.* DEF-spine.003 collar
DEF-upper_arm.* DEF-shoulder.* shoulder
DEF-upper_arm.*.001 DEF-upper_arm.* upper
DEF-forearm.* DEF-upper_arm.*.001 elbow
DEF-forearm.*.001 DEF-forearm.* fore
DEF-hand.* DEF-forearm.*.001 wrist
DEF-f_middle.01.* DEF-hand.* knuckle
DEF-pelvis.* DEF-spine hips
DEF-thigh.* DEF-spine hip
DEF-thigh.*.001 DEF-thigh.* thigh
DEF-shin.* DEF-thigh.*.001 knee
DEF-shin.*.001 DEF-shin.* shin
DEF-foot.* DEF-shin.*.001 ankle
DEF-toe.* DEF-foot.* ball
"""
SMPL = """
Pelvis - hips
*_Hip Pelvis hip
*_Knee *_Hip knee
*_Ankle *_Knee ankle
*_Foot *_Ankle ball
Spine1 Pelvis s1
Spine2 Spine1 s2
Spine3 Spine2 s3
Neck Spine3 neck
Head Neck head
*_Collar Spine3 collar
*_Shoulder *_Collar shoulder
*_Elbow *_Shoulder elbow
*_Wrist *_Elbow wrist
*_Hand *_Wrist knuckle
"""
BIPED = """
Bip01 - hips
Bip01_Footsteps Bip01 floor
Bip01_Pelvis Bip01 hips
Bip01_Spine Bip01_Pelvis s1
Bip01_*_Thigh Bip01_Spine hip
Bip01_*_Calf Bip01_*_Thigh knee
Bip01_*_Foot Bip01_*_Calf ankle
Bip01_*_Toe0 Bip01_*_Foot ball
Bip01_Spine1 Bip01_Spine s2
Bip01_Neck Bip01_Spine1 neck
Bip01_Head Bip01_Neck head
Bip01_*_Clavicle Bip01_Neck collar
Bip01_*_UpperArm Bip01_*_Clavicle shoulder
Bip01_*_Forearm Bip01_*_UpperArm elbow
Bip01_*_ForeTwist Bip01_*_Forearm fore
Bip01_*_Hand Bip01_*_Forearm wrist
Bip01_*_Finger0 Bip01_*_Hand knuckle
Bip01_*_Finger01 Bip01_*_Finger0 finger
"""
DAZ = """
hip - hips
pelvis hip hips
*ThighBend pelvis hip
*ThighTwist *ThighBend thigh
*Shin *ThighTwist knee
*Foot *Shin ankle
*Metatarsals *Foot ball
*Toe *Metatarsals toe
abdomenLower hip s1
abdomenUpper abdomenLower s2
chestLower abdomenUpper s3
*Pectoral chestLower bust
chestUpper chestLower s3
*Collar chestUpper collar
*ShldrBend *Collar shoulder
*ShldrTwist *ShldrBend upper
*ForearmBend *ShldrTwist elbow
*ForearmTwist *ForearmBend fore
*Hand *ForearmTwist wrist
*Carpal1 *Hand palm
*Index1 *Carpal1 knuckle
neckLower chestUpper neck
neckUpper neckLower neck2
head neckUpper head
*Eye head eye
*Ear head eye
"""
ASF = """
root - hips
*hipjoint root hips
*femur *hipjoint hip
*tibia *femur knee
*foot *tibia ankle
*toes *foot ball
lowerback root hips
upperback lowerback s1
thorax upperback s2
lowerneck thorax neck
upperneck lowerneck neck2
head upperneck head
*clavicle thorax s3
*humerus *clavicle shoulder
*radius *humerus elbow
*wrist *radius wrist
*hand *wrist palm
*fingers *hand knuckle
*thumb *wrist palm
"""
BANDAI = """
joint_Root - floor
Hips joint_Root hips
Spine Hips s1
Chest Spine s3
Neck Chest neck
Head Neck head
Shoulder_* Chest collar
UpperArm_* Shoulder_* shoulder
LowerArm_* UpperArm_* elbow
Hand_* LowerArm_* wrist
UpperLeg_* Hips hip
LowerLeg_* UpperLeg_* knee
Foot_* LowerLeg_* ankle
Toes_* Foot_* ball
"""
MAKEHUMAN = """
root - hips
pelvis.* root pelvis
upperleg01.* pelvis.* hip
upperleg02.* upperleg01.* thigh
lowerleg01.* upperleg02.* knee
lowerleg02.* lowerleg01.* shin
foot.* lowerleg02.* ankle
toe1-1.* foot.* ball
toe1-2.* toe1-1.* toe
spine05 root s1
spine03 spine05 s2
spine01 spine03 s3
clavicle.* spine01 collar
shoulder01.* clavicle.* deltoid
upperarm01.* shoulder01.* shoulder
upperarm02.* upperarm01.* upper
lowerarm01.* upperarm02.* elbow
lowerarm02.* lowerarm01.* fore
wrist.* lowerarm02.* wrist
metacarpal1.* wrist.* palm
finger2-1.* metacarpal1.* knuckle
finger2-2.* finger2-1.* finger
breast.* spine03 bust
neck01 spine01 neck
neck02 neck01 neck2
head neck02 head
jaw head jaw
eye.* head eye
"""
MIXAMO = """
Hips - hips
Spine Hips s1
Spine1 Spine s2
Spine2 Spine1 s3
Neck Spine2 neck
Head Neck head
HeadTop_End Head crown
*Shoulder Spine2 collar
*Arm *Shoulder shoulder
*ForeArm *Arm elbow
*Hand *ForeArm wrist
*HandMiddle1 *Hand knuckle
*UpLeg Hips hip
*Leg *UpLeg knee
*Foot *Leg ankle
*ToeBase *Foot ball
"""


@dataclass(frozen=True)
class Convention:
    """Names of a program.

    Attributes:
        rows: joints.
        head: joint of the head.
        arm, leg: joints of shoulder, elbow, hand and of hip, knee, foot.
        sides: words for left and right.
        prefix: beginning of all names.
    """

    rows: str
    head: str
    arm: tuple[str, str, str]
    leg: tuple[str, str, str]
    sides: tuple[str, str]
    prefix: str = ""

    def joints(self) -> dict[str, str]:
        """Part -> joint."""
        joints = {"head": self.head}
        for side, word in zip(("left", "right"), self.sides, strict=True):
            for part, name in zip(("shoulder", "elbow", "hand"), self.arm, strict=True):
                joints[f"{part}_{side}"] = name.replace("*", word)
            for part, name in zip(("hip", "knee", "foot"), self.leg, strict=True):
                joints[f"{part}_{side}"] = name.replace("*", word)
        return {part: self.prefix + name for part, name in joints.items()}


_MIXAMO_ARM, _MIXAMO_LEG = ("*Arm", "*ForeArm", "*Hand"), ("*UpLeg", "*Leg", "*Foot")
_UNREAL_ARM, _UNREAL_LEG = ("upperarm_*", "lowerarm_*", "hand_*"), ("thigh_*", "calf_*", "foot_*")
_WORDS = ("Left", "Right")
CONVENTIONS = {
    "unreal": Convention(UNREAL, "head", _UNREAL_ARM, _UNREAL_LEG, ("l", "r")),
    "vrm": Convention(
        VRM,
        "J_Bip_C_Head",
        ("J_Bip_*_UpperArm", "J_Bip_*_LowerArm", "J_Bip_*_Hand"),
        ("J_Bip_*_UpperLeg", "J_Bip_*_LowerLeg", "J_Bip_*_Foot"),
        ("L", "R"),
    ),
    "unity": Convention(
        UNITY,
        "Head",
        ("*UpperArm", "*LowerArm", "*Hand"),
        ("*UpperLeg", "*LowerLeg", "*Foot"),
        _WORDS,
    ),
    "rigify": Convention(
        RIGIFY,
        "spine.006",
        ("upper_arm.*", "forearm.*", "hand.*"),
        ("thigh.*", "shin.*", "foot.*"),
        ("L", "R"),
    ),
    "rigify deform": Convention(
        DEFORM,
        "DEF-spine.006",
        ("DEF-upper_arm.*", "DEF-forearm.*", "DEF-hand.*"),
        ("DEF-thigh.*", "DEF-shin.*", "DEF-foot.*"),
        ("L", "R"),
    ),
    "smpl": Convention(
        SMPL,
        "Head",
        ("*_Shoulder", "*_Elbow", "*_Wrist"),
        ("*_Hip", "*_Knee", "*_Ankle"),
        ("L", "R"),
    ),
    "biped": Convention(
        BIPED.replace("Bip01_*_", "Bip01 * ").replace("Bip01_", "Bip01 "),
        "Bip01 Head",
        ("Bip01 * UpperArm", "Bip01 * Forearm", "Bip01 * Hand"),
        ("Bip01 * Thigh", "Bip01 * Calf", "Bip01 * Foot"),
        ("L", "R"),
    ),
    "biped, no blanks": Convention(
        BIPED,
        "Bip01_Head",
        ("Bip01_*_UpperArm", "Bip01_*_Forearm", "Bip01_*_Hand"),
        ("Bip01_*_Thigh", "Bip01_*_Calf", "Bip01_*_Foot"),
        ("L", "R"),
    ),
    "daz": Convention(
        DAZ,
        "head",
        ("*ShldrBend", "*ForearmBend", "*Hand"),
        ("*ThighBend", "*Shin", "*Foot"),
        ("l", "r"),
    ),
    "asf": Convention(
        ASF, "head", ("*humerus", "*radius", "*wrist"), ("*femur", "*tibia", "*foot"), ("l", "r")
    ),
    "bandai": Convention(
        BANDAI,
        "Head",
        ("UpperArm_*", "LowerArm_*", "Hand_*"),
        ("UpperLeg_*", "LowerLeg_*", "Foot_*"),
        ("L", "R"),
    ),
    "makehuman": Convention(
        MAKEHUMAN,
        "head",
        ("upperarm01.*", "lowerarm01.*", "wrist.*"),
        ("upperleg01.*", "lowerleg01.*", "foot.*"),
        ("L", "R"),
    ),
    "mixamo_": Convention(MIXAMO, "Head", _MIXAMO_ARM, _MIXAMO_LEG, _WORDS, "mixamorig_"),
    "mixamo:": Convention(MIXAMO, "Head", _MIXAMO_ARM, _MIXAMO_LEG, _WORDS, "mixamorig:"),
}


def skeleton_of(
    convention: Convention, pose: str = "T", up: str = "y", unit: float = 0.01
) -> Skeleton:
    """Skeleton with a rest pose; it looks along z if y is up, along -y if z is."""
    rows = [_split(line) for line in convention.rows.strip().splitlines()]
    names, parents, places = list[str](), list[int](), list[np.ndarray]()
    for name, parent, place in rows:
        sides = convention.sides if "*" in name else ("",)
        for side, mirrored in zip(sides, (1.0, -1.0), strict=False):
            above = parent.replace("*", side)
            names.append(name.replace("*", side))
            parents.append(-1 if above == "-" else names.index(above))
            places.append(_place(place, pose) * [1.0, mirrored, 1.0])
    leaves = [i for i in range(len(names)) if i not in parents]
    for i in leaves:
        names.append(f"{names[i]}.end")
        parents.append(i)
        direction = places[i] - places[parents[i]] + [1e-4, 0.0, 0.0]
        places.append(places[i] + 0.05 * direction / np.linalg.norm(direction))
    # x forward, y left, z up to the axes of the file.
    axes = {
        "y": np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]]),
        "z": np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
    }
    placed = np.array(places) @ axes[up].T / unit
    offsets = np.array(
        [p - placed[k] if k >= 0 else 0 * p for p, k in zip(placed, parents, strict=True)]
    )
    order = _in_file_order(parents)
    index = {k: i for i, k in enumerate(order)}
    return Skeleton(
        tuple(convention.prefix + names[k] for k in order),
        tuple(index[parents[k]] if parents[k] >= 0 else -1 for k in order),
        offsets[order],
    )


def _split(line: str) -> tuple[str, str, str]:
    """Joint, parent and place of a row; names of Biped have blanks."""
    words = line.split()
    if len(words) == 3:
        return words[0], words[1], words[2]
    middle = len(words) - 1
    cut = max(k for k in range(1, middle) if words[k] in ("Bip01", "-"))
    return " ".join(words[:cut]), " ".join(words[cut:middle]), words[-1]


def _place(place: str, pose: str) -> np.ndarray:
    if place in _TRUNK:
        return np.array(_TRUNK[place])
    if place in _LEFT:
        return np.array(_LEFT[place])
    direction = np.array(POSES[pose])
    return np.array(_LEFT["shoulder"]) + _ALONG_ARM[place] * direction / np.linalg.norm(direction)


def _in_file_order(parents: list[int]) -> list[int]:
    """Joints in the order of a file: each branch as a whole."""
    order, stack = list[int](), [k for k, parent in enumerate(parents) if parent < 0]
    while stack:
        joint = stack.pop()
        order.append(joint)
        stack += reversed([k for k, parent in enumerate(parents) if parent == joint])
    return order
