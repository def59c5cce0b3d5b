"""The bodies of the sample rigs: the names that four conventions give to joints, and their places in a T-pose.

Centimetres, Y up, facing +Z, the left side at +X. Limbs are written for the left side. The bodies are adults of about
1.75 m; segment lengths are near Winter's fractions of body height (Biomechanics and Motor Control of Human Movement,
figure 4.1), and each convention splits them in its own way.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

Offset = tuple[float, float, float]
Chain = tuple[str, Mapping[str, Offset]]
"""The parent of a chain, and the offsets of its joints by name, each joint the child of the one before."""

FINGERS: Mapping[str, tuple[Offset, Offset, Offset]] = {
    "Thumb": ((2.6, -1.3, 2.7), (0.72, -0.34, 0.6), (4.4, 3.2, 2.6)),
    "Index": ((9.3, 0.0, 2.7), (1.0, 0.0, 0.06), (4.2, 2.5, 2.2)),
    "Middle": ((9.4, 0.2, 0.5), (1.0, 0.0, 0.0), (4.6, 2.9, 2.3)),
    "Ring": ((8.9, 0.1, -1.6), (1.0, 0.0, -0.05), (4.2, 2.7, 2.3)),
    "Pinky": ((8.2, -0.3, -3.5), (0.99, 0.0, -0.12), (3.3, 2.0, 1.9)),
}
"""Per finger: the offset of the knuckle from the wrist, the direction, and the lengths of the three bones [cm]."""


@dataclass(frozen=True, kw_only=True)
class Body:
    """A body with the joint names of a convention.

    Attributes:
        sides: for each side, the text that replaces {side} in names, and the sign of x.
        groups: chains in file order; a group with {side} in its names is written once for each side.
        upper_arm: the joint that an A-pose turns down.
        axes: of the rotation channels, in order.
        up: the axis that points up. With "Z", the body faces -Y.
        handles: joints at the places of others, as (name, parent, the joint whose place it has).
        sliding: joints below the root that have position channels; so have the handles.
    """

    sides: Mapping[str, int]
    groups: tuple[tuple[Chain, ...], ...]
    upper_arm: str
    axes: str
    up: str = "Y"
    handles: tuple[tuple[str, str, str], ...] = ()
    sliding: tuple[str, ...] = ()


def _fingers(hand: str, pattern: str, last: str, tip: float = 0.0) -> tuple[Chain, ...]:
    """Five fingers, with joints named by `pattern` and ends by `last`, and with an End Site `tip` [cm] beyond the end
    if `tip` is not 0.
    """
    chains: list[Chain] = []
    for finger, (knuckle, direction, lengths) in FINGERS.items():
        names = [_named(pattern, finger, number) for number in (1, 2, 3)] + [_named(last, finger, 4)]
        bones = [_along(direction, length) for length in lengths]
        chain = dict(zip(names, [knuckle, *bones], strict=True))
        if tip:
            chain[f"{names[-1]}_End"] = _along(direction, tip)
        chains.append((hand, chain))
    return tuple(chains)


def _named(pattern: str, finger: str, number: int) -> str:
    return pattern.format(side="{side}", Finger=finger, finger=finger.lower(), number=number)


def _along(direction: Offset, length: float) -> Offset:
    x, y, z = direction
    return length * x, length * y, length * z


MIXAMO = Body(
    sides={"Left": 1, "Right": -1},
    groups=(
        (
            (
                "",
                {
                    "mixamorig:Hips": (0, 96.0, 0),
                    "mixamorig:Spine": (0, 9.6, -1.1),
                    "mixamorig:Spine1": (0, 11.3, -0.9),
                    "mixamorig:Spine2": (0, 12.9, -0.4),
                    "mixamorig:Neck": (0, 14.5, 0.2),
                    "mixamorig:Head": (0, 9.4, 2.2),
                    "mixamorig:HeadTop_End": (0, 20.2, 1.6),
                    "mixamorig:HeadTop_End_End": (0, 1.0, 0),
                },
            ),
        ),
        (
            (
                "mixamorig:Spine2",
                {
                    "mixamorig:{side}Shoulder": (5.9, 11.4, 0.2),
                    "mixamorig:{side}Arm": (12.4, -0.5, -1.6),
                    "mixamorig:{side}ForeArm": (28.4, 0, 0),
                    "mixamorig:{side}Hand": (26.6, 0, 0),
                },
            ),
            *_fingers(
                "mixamorig:{side}Hand",
                "mixamorig:{side}Hand{Finger}{number}",
                "mixamorig:{side}Hand{Finger}{number}",
                tip=1.0,
            ),
        ),
        (
            (
                "mixamorig:Hips",
                {
                    "mixamorig:{side}UpLeg": (9.1, -5.3, 0.4),
                    "mixamorig:{side}Leg": (0.3, -41.9, 0.6),
                    "mixamorig:{side}Foot": (0.2, -40.8, -2.2),
                    "mixamorig:{side}ToeBase": (0.6, -5.9, 13.2),
                    "mixamorig:{side}Toe_End": (0.2, -0.7, 6.4),
                    "mixamorig:{side}Toe_End_End": (0, 0, 1.0),
                },
            ),
        ),
    ),
    upper_arm="mixamorig:{side}Arm",
    axes="XYZ",
)

XSENS = Body(
    sides={"Right": -1, "Left": 1},
    groups=(
        (
            (
                "",
                {
                    "Hips": (0, 92.6, 0),
                    "Chest": (0, 9.4, -1.2),
                    "Chest2": (0, 10.6, 0.4),
                    "Chest3": (0, 9.8, 0),
                    "Chest4": (0, 9.8, 0),
                    "Neck": (0, 13.6, 0),
                    "Head": (0, 9.2, 0.4),
                    "Head_End": (0, 18.6, 0.4),
                },
            ),
        ),
        (
            (
                "Chest4",
                {
                    "{side}Collar": (3.1, 8.2, 0),
                    "{side}Shoulder": (14.6, 0, 0),
                    "{side}Elbow": (30.6, 0, 0),
                    "{side}Wrist": (25.2, 0, 0),
                    "{side}Wrist_End": (18.8, 0, 0),
                },
            ),
        ),
        (
            (
                "Hips",
                {
                    "{side}Hip": (8.5, 0, 0),
                    "{side}Knee": (0, -43.6, 0),
                    "{side}Ankle": (0, -41.2, 0),
                    "{side}Toe": (0, -5.6, 15.6),
                    "{side}Toe_End": (0, -1.0, 5.6),
                },
            ),
        ),
    ),
    upper_arm="{side}Shoulder",
    axes="YXZ",
)

LAFAN1 = Body(
    sides={"Left": 1, "Right": -1},
    groups=(
        (("", {"Hips": (0, 93.6, 0)}),),
        (
            (
                "Hips",
                {
                    "{side}UpLeg": (10.0, 0.1, 1.8),
                    "{side}Leg": (0, -43.3, 0),
                    "{side}Foot": (0, -42.2, 0),
                    "{side}Toe": (0, -5.8, 15.9),
                    "{side}Toe_End": (0, -0.8, 5.4),
                },
            ),
        ),
        (
            (
                "Hips",
                {
                    "Spine": (0, 6.9, -2.6),
                    "Spine1": (0, 12.5, 0),
                    "Spine2": (0, 12.3, 0),
                    "Neck": (0, 22.8, 0),
                    "Head": (0, 10.6, 0),
                    "Head_End": (0, 14.8, 0),
                },
            ),
        ),
        (
            (
                "Spine2",
                {
                    "{side}Shoulder": (5.9, 16.8, -1.4),
                    "{side}Arm": (11.3, 0, 0),
                    "{side}ForeArm": (31.8, 0, 0),
                    "{side}Hand": (24.9, 0, 0),
                    "{side}Hand_End": (17.2, 0, 0),
                },
            ),
        ),
    ),
    upper_arm="{side}Arm",
    axes="ZYX",
)

UNREAL = Body(
    sides={"l": 1, "r": -1},
    groups=(
        (
            (
                "",
                {
                    "root": (0, 0, 0),
                    "pelvis": (0, 96.6, -1.0),
                    "spine_01": (0, 10.3, 0.8),
                    "spine_02": (0, 17.7, 0.4),
                    "spine_03": (0, 12.8, -1.6),
                    "neck_01": (0, 15.4, -1.4),
                    "head": (0, 8.9, 2.0),
                    "head_End": (0, 16.2, 1.2),
                },
            ),
        ),
        (
            (
                "spine_03",
                {
                    "clavicle_{side}": (3.7, 10.9, 0.8),
                    "upperarm_{side}": (14.8, -3.3, -2.2),
                    "lowerarm_{side}": (29.8, 0, 0),
                    "hand_{side}": (26.4, 0, 0),
                },
            ),
            *_fingers("hand_{side}", "{finger}_0{number}_{side}", "{finger}_03_{side}_End"),
            ("upperarm_{side}", {"upperarm_twist_01_{side}": (0.5, 0, 0)}),
            ("lowerarm_{side}", {"lowerarm_twist_01_{side}": (13.6, 0, 0)}),
        ),
        (
            (
                "pelvis",
                {
                    "thigh_{side}": (9.2, -1.5, 0.6),
                    "calf_{side}": (0.8, -43.9, 0.4),
                    "foot_{side}": (0.6, -43.0, -3.0),
                    "ball_{side}": (1.0, -6.3, 15.0),
                    "ball_{side}_End": (0.3, -0.7, 6.8),
                },
            ),
            ("thigh_{side}", {"thigh_twist_01_{side}": (0.4, -22.0, 0.2)}),
            ("calf_{side}", {"calf_twist_01_{side}": (0.3, -20.5, -1.4)}),
        ),
    ),
    upper_arm="upperarm_{side}",
    axes="XYZ",
    up="Z",
    handles=(
        ("ik_foot_root", "root", "root"),
        ("ik_foot_l", "ik_foot_root", "foot_l"),
        ("ik_foot_r", "ik_foot_root", "foot_r"),
        ("ik_hand_root", "root", "root"),
        ("ik_hand_gun", "ik_hand_root", "hand_r"),
        ("ik_hand_l", "ik_hand_gun", "hand_l"),
        ("ik_hand_r", "ik_hand_gun", "hand_r"),
    ),
    sliding=("pelvis",),
)

BODIES: Mapping[str, Body] = {"mixamo": MIXAMO, "xsens": XSENS, "lafan1": LAFAN1, "unreal": UNREAL}
