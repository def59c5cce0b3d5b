"""The skeleton of Table I of the paper (Mucherino et al., FedCSIS 2017)."""

import numpy as np

from distretarget.skeleton import POSITION_CHANNELS, Skeleton

DEFAULT_ROTATIONS = ("Zrotation", "Xrotation", "Yrotation")
SPINE = (
    ("Chest", "Hips", 0.160),
    ("Chest2", "Chest", 0.179),
    ("Chest3", "Chest2", 0.069),
    ("Neck", "Chest3", 0.069),
    ("Head", "Neck", 0.106),
)
ARM = (
    ("Collar", "Chest3", 0.072),
    ("Shoulder", "Collar", 0.158),
    ("Elbow", "Shoulder", 0.273),
    ("Wrist", "Elbow", 0.258),
)
LEG = (("Hip", "Hips", 0.108), ("Knee", "Hip", 0.435), ("Ankle", "Knee", 0.453), ("Toe", "Ankle", 0.125))
DIRECTIONS = {"Knee": (0, -1, 0), "Ankle": (0, -1, 0), "Toe": (0, 0, 1)}


def table_one() -> Skeleton:
    """Its 22 joints in a T-pose, without End Sites [m]: Y up, facing Z, so that left is X."""
    bones = [(name, parent, length, (0, 1, 0)) for name, parent, length in SPINE]
    for side, x in (("Right", -1), ("Left", 1)):
        bones += [_limb_bone(side, x, *bone) for bone in (*ARM, *LEG)]
    names = ("Hips", *(name for name, *_ in bones))
    return Skeleton(
        names=names,
        parents=np.array([-1, *(names.index(parent) for _, parent, *_ in bones)]),
        offsets=np.array([(0, 0, 0), *(length * np.array(way) for *_, length, way in bones)]),
        channels=(POSITION_CHANNELS + DEFAULT_ROTATIONS, *[DEFAULT_ROTATIONS] * len(bones)),
        end_sites=np.zeros(len(names), bool),
        units="m",
        up="Y",
    )


def _limb_bone(side, x, name, parent, length):
    parent = parent if parent in ("Chest3", "Hips") else side + parent
    return side + name, parent, length, DIRECTIONS.get(name, (x, 0, 0))
