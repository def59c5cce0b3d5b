"""Write the target skeletons of four conventions, each in T-pose and A-pose.

    python tools/make_rigs.py [FOLDER]

FOLDER is `sample_bvh/rigs` by default. Every run writes the same bytes.

The bodies are adults of about 1.75 m; segment lengths are near Winter's fractions of body height (Biomechanics and
Motor Control of Human Movement, figure 4.1), and each convention splits them in its own way.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from skeleton_edits import along_x, places, turned_below, with_chain, z_up

from distretarget import Skeleton
from distretarget.io.target_file import skeleton_to_json

Convention = Literal["mixamo", "xsens", "lafan1", "unreal"]
Pose = Literal["T", "A", "X"]
Row = tuple[str, str, NDArray[np.float64]]
"""Name, parent and offset of a joint."""

RIGS = Path(__file__).resolve().parents[1] / "sample_bvh" / "rigs"
CONVENTIONS: tuple[Convention, ...] = ("mixamo", "xsens", "lafan1", "unreal")
POSES: tuple[Pose, ...] = ("T", "A")
LOWERED = 45.0  # how far the arms of an A-pose hang below the horizontal [degrees]
POSITIONS = ("Xposition", "Yposition", "Zposition")

FINGERS = {
    "Thumb": ((2.6, -1.3, 2.7), (0.72, -0.34, 0.6), (4.4, 3.2, 2.6)),
    "Index": ((9.3, 0.0, 2.7), (1.0, 0.0, 0.06), (4.2, 2.5, 2.2)),
    "Middle": ((9.4, 0.2, 0.5), (1.0, 0.0, 0.0), (4.6, 2.9, 2.3)),
    "Ring": ((8.9, 0.1, -1.6), (1.0, 0.0, -0.05), (4.2, 2.7, 2.3)),
    "Pinky": ((8.2, -0.3, -3.5), (0.99, 0.0, -0.12), (3.3, 2.0, 1.9)),
}
"""Per finger: the offset of the knuckle from the wrist, the direction, and the lengths of the three bones [cm]."""


@dataclass(frozen=True, kw_only=True)
class Body:
    """A body in T-pose with the joint names of a convention, in centimetres, Y up, facing +Z, the left side at +X.

    Attributes:
        chains: in file order. A line has a joint, and its descendants with their offsets, each below the one before.
            Chains without an empty line between them are a group; one with * in its names is written once for each
            side, here for the left. The line "fingers" stands for the chains of five fingers.
        sides: for each side, the text that replaces * in names, and the sign of x.
        upper_arm: the joint that an A-pose turns down.
        axes: of the rotation channels, in order.
        prefix: of all names.
        fingers: the hand, and the names of the three joints of a finger and of their end.
        tip: how far an End Site is beyond the end of a finger [cm]; by default the end is the End Site.
        up: the axis that points up. With "Z", the body faces -Y.
        handles: joints at the places of others, as (name, parent, the joint whose place it has).
        sliding: joints below the root that have position channels; so have the handles.
    """

    chains: str
    sides: Mapping[str, int]
    upper_arm: str
    axes: str
    prefix: str = ""
    fingers: tuple[str, str, str] = ("", "", "")
    tip: float = 0.0
    up: str = "Y"
    handles: tuple[tuple[str, str, str], ...] = ()
    sliding: tuple[str, ...] = ()

    def rows(self) -> Iterator[Row]:
        """All joints but the handles."""
        for group in self.chains.strip().split("\n\n"):
            rows = [row for line in group.splitlines() for row in self._chain(line)]
            for side, sign in self.sides.items() if "*" in group else [("", 1)]:
                for name, parent, offset in rows:
                    yield self._named(name, side), self._named(parent, side), offset * (sign, 1, 1)

    def _named(self, name: str, side: str) -> str:
        return name and self.prefix + name.replace("*", side)

    def _chain(self, line: str) -> Iterator[Row]:
        """The joints of a line."""
        if line == "fingers":
            yield from self._finger_rows()
            return
        parent, *joints = line.split(" > ")
        for joint in joints:
            name, *offset = joint.split()
            yield name, parent.strip("-"), np.array(offset, float)
            parent = name

    def _finger_rows(self) -> Iterator[Row]:
        hand, joint, end = self.fingers
        for finger, (knuckle, direction, lengths) in FINGERS.items():
            offsets = [np.array(knuckle), *(length * np.array(direction) for length in lengths)]
            parent = hand
            for number, (pattern, offset) in enumerate(zip([joint] * 3 + [end], offsets, strict=True), start=1):
                name = pattern.format(Finger=finger, finger=finger.lower(), number=number)
                yield name, parent, offset
                parent = name
            if self.tip:
                yield f"{parent}_End", parent, self.tip * np.array(direction)


MIXAMO = Body(
    chains="""
- > Hips 0 96 0 > Spine 0 9.6 -1.1 > Spine1 0 11.3 -0.9 > Spine2 0 12.9 -0.4 > Neck 0 14.5 0.2 > Head 0 9.4 2.2 > \
HeadTop_End 0 20.2 1.6 > HeadTop_End_End 0 1 0

Spine2 > *Shoulder 5.9 11.4 0.2 > *Arm 12.4 -0.5 -1.6 > *ForeArm 28.4 0 0 > *Hand 26.6 0 0
fingers

Hips > *UpLeg 9.1 -5.3 0.4 > *Leg 0.3 -41.9 0.6 > *Foot 0.2 -40.8 -2.2 > *ToeBase 0.6 -5.9 13.2 > \
*Toe_End 0.2 -0.7 6.4 > *Toe_End_End 0 0 1
""",
    sides={"Left": 1, "Right": -1},
    upper_arm="*Arm",
    axes="XYZ",
    prefix="mixamorig:",
    fingers=("*Hand", "*Hand{Finger}{number}", "*Hand{Finger}{number}"),
    tip=1.0,
)
XSENS = Body(
    chains="""
- > Hips 0 92.6 0 > Chest 0 9.4 -1.2 > Chest2 0 10.6 0.4 > Chest3 0 9.8 0 > Chest4 0 9.8 0 > Neck 0 13.6 0 > \
Head 0 9.2 0.4 > Head_End 0 18.6 0.4

Chest4 > *Collar 3.1 8.2 0 > *Shoulder 14.6 0 0 > *Elbow 30.6 0 0 > *Wrist 25.2 0 0 > *Wrist_End 18.8 0 0

Hips > *Hip 8.5 0 0 > *Knee 0 -43.6 0 > *Ankle 0 -41.2 0 > *Toe 0 -5.6 15.6 > *Toe_End 0 -1 5.6
""",
    sides={"Right": -1, "Left": 1},
    upper_arm="*Shoulder",
    axes="YXZ",
)
LAFAN1 = Body(
    chains="""
- > Hips 0 93.6 0

Hips > *UpLeg 10 0.1 1.8 > *Leg 0 -43.3 0 > *Foot 0 -42.2 0 > *Toe 0 -5.8 15.9 > *Toe_End 0 -0.8 5.4

Hips > Spine 0 6.9 -2.6 > Spine1 0 12.5 0 > Spine2 0 12.3 0 > Neck 0 22.8 0 > Head 0 10.6 0 > Head_End 0 14.8 0

Spine2 > *Shoulder 5.9 16.8 -1.4 > *Arm 11.3 0 0 > *ForeArm 31.8 0 0 > *Hand 24.9 0 0 > *Hand_End 17.2 0 0
""",
    sides={"Left": 1, "Right": -1},
    upper_arm="*Arm",
    axes="ZYX",
)
UNREAL = Body(
    chains="""
- > root 0 0 0 > pelvis 0 96.6 -1 > spine_01 0 10.3 0.8 > spine_02 0 17.7 0.4 > spine_03 0 12.8 -1.6 > \
neck_01 0 15.4 -1.4 > head 0 8.9 2 > head_End 0 16.2 1.2

spine_03 > clavicle_* 3.7 10.9 0.8 > upperarm_* 14.8 -3.3 -2.2 > lowerarm_* 29.8 0 0 > hand_* 26.4 0 0
fingers
upperarm_* > upperarm_twist_01_* 0.5 0 0
lowerarm_* > lowerarm_twist_01_* 13.6 0 0

pelvis > thigh_* 9.2 -1.5 0.6 > calf_* 0.8 -43.9 0.4 > foot_* 0.6 -43 -3 > ball_* 1 -6.3 15 > ball_*_End 0.3 -0.7 6.8
thigh_* > thigh_twist_01_* 0.4 -22 0.2
calf_* > calf_twist_01_* 0.3 -20.5 -1.4
""",
    sides={"l": 1, "r": -1},
    upper_arm="upperarm_*",
    axes="XYZ",
    fingers=("hand_*", "{finger}_0{number}_*", "{finger}_03_*_End"),
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
BODIES: Mapping[Convention, Body] = {"mixamo": MIXAMO, "xsens": XSENS, "lafan1": LAFAN1, "unreal": UNREAL}


def rig(convention: Convention, pose: Pose) -> Skeleton:
    """The skeleton of a convention with a rest pose [cm]; the root's OFFSET puts its feet on the floor.

    In "T" the arms point sideways, in "A" 45 degrees below the horizontal. "X" is the rest pose of LAFAN1's files, not
    a standing pose: see `along_x`. Only joints with siblings (thighs, lower spine, collar bones, neck) have their true
    offsets there.

    Raises:
        ValueError: pose "X" for another convention than lafan1.
    """
    if pose == "X" and convention != "lafan1":
        raise ValueError(f"only lafan1 has pose X, not {convention}")
    body = BODIES[convention]
    skeleton = _in_t_pose(body)
    if pose == "A":
        for side, sign in body.sides.items():
            arm = skeleton.index(body.prefix + body.upper_arm.replace("*", side))
            skeleton = turned_below(skeleton, arm, Rotation.from_euler("Z", -sign * LOWERED, degrees=True))
    if pose == "X":
        skeleton = along_x(skeleton)
    for name, parent, place in body.handles:
        points, number = places(skeleton), skeleton.index(parent)
        offset = points[skeleton.index(place)] - points[number]
        skeleton = with_chain(skeleton, number, {name: offset}, channels=skeleton.channels[0])
    skeleton = z_up(skeleton) if body.up == "Z" else skeleton
    return replace(skeleton, offsets=skeleton.offsets.round(6) + 0.0)


def _in_t_pose(body: Body) -> Skeleton:
    """The skeleton without handles, Y up; a joint named `<parent>_End` is an End Site."""
    names, parents, offsets = zip(*body.rows(), strict=True)
    ends = [name == f"{parent}_End" for name, parent in zip(names, parents, strict=True)]
    rotations = tuple(f"{axis}rotation" for axis in body.axes)
    return Skeleton(
        names=names,
        parents=np.array([names.index(parent) if parent else -1 for parent in parents]),
        offsets=np.array(offsets),
        channels=tuple(
            () if end else POSITIONS + rotations if name in (names[0], *body.sliding) else rotations
            for name, end in zip(names, ends, strict=True)
        ),
        end_sites=np.array(ends),
        units="cm",
        up="Y",
    )


def write_rigs(folder: Path) -> None:
    """Write all skeletons into a folder; replace files of the same names."""
    folder.mkdir(parents=True, exist_ok=True)
    for convention in CONVENTIONS:
        for pose in POSES:
            name = f"{convention}_{pose.lower()}"
            text = skeleton_to_json(rig(convention, pose), name)
            (folder / f"{name}.json").write_text(text, encoding="utf-8", newline="\n")


if __name__ == "__main__":
    write_rigs(Path(sys.argv[1]) if len(sys.argv) > 1 else RIGS)
