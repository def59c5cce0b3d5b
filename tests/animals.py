"""Animals, props, and rigs in which a person is a child of another joint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from bodies import tree_of

from distretarget import Motion, Skeleton
from distretarget.skeleton import POSITION_CHANNELS, ROTATION_CHANNELS

Joints = Mapping[str, tuple[str, tuple[float, float, float]]]
"""Per name the parent, "" for the root, and the offset."""

DOG: Joints = {
    "Hips": ("", (0, 52, 0)),
    "Spine": ("Hips", (0, 2, 14)),
    "Spine1": ("Spine", (0, 2, 16)),
    "Spine2": ("Spine1", (0, 1, 16)),
    "Neck": ("Spine2", (0, 6, 10)),
    "Head": ("Neck", (0, 14, 12)),
    "Head_End": ("Head", (0, -2, 18)),
    **{
        f"{side}{part}": (above if above in ("Hips", "Spine2") else f"{side}{above}", (sign * x, y, z))
        for side, sign in (("Left", 1), ("Right", -1))
        for part, above, (x, y, z) in (
            ("Shoulder", "Spine2", (5, -2, 4)),
            ("Arm", "Shoulder", (2, -12, 6)),
            ("ForeArm", "Arm", (0, -16, -6)),
            ("Hand", "ForeArm", (0, -18, 2)),
            ("Hand_End", "Hand", (0, -3, 5)),
            ("UpLeg", "Hips", (6, -3, -4)),
            ("Leg", "UpLeg", (0, -18, 7)),
            ("Foot", "Leg", (0, -17, -9)),
            ("ToeBase", "Foot", (0, -12, 3)),
            ("ToeBase_End", "ToeBase", (0, -2, 5)),
        )
    },
    "Tail1": ("Hips", (0, 1, -8)),
    "Tail2": ("Tail1", (0, -4, -10)),
    "Tail2_End": ("Tail2", (0, -6, -9)),
}
"""A dog with the names of people's joints [cm]: Y up, facing +Z."""

OWN = {
    "Hips": "croup",
    "Spine": "loin",
    "Spine1": "back",
    "Spine2": "withers",
    "Neck": "nape",
    "Head": "skull",
    "Shoulder": "Scapula",
    "Arm": "Humerus",
    "ForeArm": "Radius",
    "Hand": "Forepaw",
    "UpLeg": "Femur",
    "Leg": "Tibia",
    "Foot": "Hock",
    "ToeBase": "Hindpaw",
}
"""What a dog's joints are called, sides apart."""


def rig_of(joints: Joints) -> Skeleton:
    """The skeleton; names that end in "_End" are End Sites."""
    names = tuple(joints)
    parents = [names.index(parent) if parent else -1 for parent, _ in joints.values()]
    ends = [name for name in names if name.endswith("_End")]
    return tree_of([offset for _, offset in joints.values()], names, parents, ends)


def dog(*, own_names: bool = True) -> Skeleton:
    """A dog on its four legs, with names for dogs or those of HumanIK."""
    body = rig_of(DOG)
    return replace(body, names=tuple(map(_dogs, body.names))) if own_names else body


def _dogs(name: str) -> str:
    plain = name.removesuffix("_End")
    part = plain.removeprefix("Left").removeprefix("Right")
    return plain.removesuffix(part) + OWN.get(part, part) + name.removeprefix(plain)


def sword() -> Skeleton:
    """A sword, along +Y [cm]."""
    return rig_of({"grip": ("", (0, 0, 0)), "guard": ("grip", (0, 18, 0)), "blade_End": ("guard", (0, 80, 0))})


def camera() -> Skeleton:
    """A camera on a crane [cm]."""
    offsets = {"crane": (0, 0, 0), "boom": (0, 150, 0), "pan": (0, 0, 200), "tilt": (0, 5, 0), "lens_End": (0, 0, 12)}
    return rig_of(dict(zip(offsets, zip(("", *offsets), offsets.values(), strict=False), strict=True)))


def on_a_root(motion: Motion, name: str) -> Motion:
    """The motion below one more joint that stays at the origin; its root's positions become those of a joint."""
    body = motion.skeleton
    skeleton = Skeleton(
        names=(name, *body.names),
        parents=np.concatenate([[-1], body.parents + 1]),
        offsets=np.concatenate([np.zeros((1, 3)), body.offsets]),
        channels=(POSITION_CHANNELS + ROTATION_CHANNELS, *body.channels),
        end_sites=np.concatenate([[False], body.end_sites]),
    )
    still = np.tile([0.0, 0.0, 0.0, 1.0], (len(motion), 1, 1))
    return Motion.of_translations(
        skeleton,
        np.concatenate([np.zeros((len(motion), 1, 3)), motion.translations], axis=1),
        np.concatenate([still, motion.rotations], axis=1),
        motion.frame_time_text,
    )
