"""The zoo: bodies of many shapes, with the traits that real rigs of people have.

`member("mouse")` is the skeleton of one body, `on_member("mouse", motion)` a motion of it, and `zoo.toml` the table of
all. Every body starts as an adult in T-pose, Y up, facing +Z [cm], and gets its traits one after the other.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation
from skeleton_edits import (
    LYING,
    bare,
    below_root,
    in_axes,
    only,
    places,
    roles,
    turned_below,
    with_axes,
    with_chain,
    with_offset,
    z_up,
)

from distretarget import Motion, Skeleton, load_target, retarget
from distretarget.body.anatomy import SIDES
from distretarget.skeleton import POSITION_CHANNELS

INWARDS = {"left": -1.0, "right": 1.0}  # along X
TABLES: Mapping[str, Any] = tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))
BUILDS, FACE, FINGERS, HANDS, HANDLES = (TABLES[name] for name in ("builds", "face", "fingers", "hands", "handles"))


# ---- the sample rigs: an adult of about 1.75 m (segment lengths: Winter, Biomechanics and Motor Control, 4.1)

RIGS = Path(__file__).resolve().parents[1] / "sample_bvh" / "rigs"
CONVENTIONS = ("mixamo", "xsens", "lafan1", "unreal")
RIG_POSES = ("T", "A")


def rig(convention: str, pose: str) -> Skeleton:
    """The skeleton of a convention in a rest pose [cm]; the root's OFFSET puts its feet on the floor.

    In "T" the arms point sideways, in "A" 45 degrees below the horizontal. "X" is the rest pose of LAFAN1's files, in
    which nobody can stand: see `LYING`.
    """
    if pose != "X":
        return load_target(RIGS / f"{convention}_{pose.lower()}.json").skeleton
    if convention != "lafan1":
        raise ValueError(f"only lafan1 has pose X, not {convention}")
    standing = rig("lafan1", "T")
    skeleton = with_axes(standing, LYING["X"].axes(standing))
    return skeleton.with_offsets(skeleton.offsets.round(6))


# ---- conventions: the names of the joints, and the order of the rotation channels


@dataclass(frozen=True, kw_only=True)
class Naming:
    """A convention's names for the joints of limbs and fingers, bones in the palm, and a root above the hips."""

    part: str = "{Left}{Part}"
    finger: str = "{Left}Hand{Part}{number}"
    palm: str = "{Left}InHand{Part}"
    root: str = "Reference"
    face: str = "{Part}"

    def name(self, pattern: str, side: str, part: str, number: int = 0) -> str:
        """A pattern filled in; `part` is the name without a side, such as "Heel" or "Thumb"."""
        sides = {"Left": side.capitalize(), "L": side[0].upper(), "l": side[0]}
        return pattern.format(**sides, Part=part, part=part.lower(), number=number)

    def limb(self, side: str, part: str) -> str:
        return self.name(self.part, side, part)


NAMING = {name: Naming(**patterns) for name, patterns in TABLES["conventions"].items()}
RENAMED = {
    convention: {
        old.format(Left=side): new.format(Left=side, L=side[0])
        for old, new in names.items()
        for side in ("Left", "Right")
    }
    for convention, names in TABLES["renamed"].items()
}
HAND = 17.5  # from the wrist to the End Site of a hand [cm]
NO_BODY = ("ik_", "twist")  # in the names of joints of the Unreal rig that are not part of the body


def adult(convention: str) -> Skeleton:
    """An adult with the names and rotation channels of a convention, hips as root, and hands that end in End Sites."""
    if convention in RENAMED:
        body = _renamed(rig("lafan1", "T"), RENAMED[convention])
    elif convention == "unreal":
        body = _on_hips(rig("unreal", "T"))
    else:
        body = rig(convention, "T")
    for side in SIDES:
        body = bare(body, roles(body)[f"{side}Hand"])
        body = with_chain(body, roles(body)[f"{side}Hand"], {}, end=(-INWARDS[side] * HAND, 0.0, 0.0))
    return body


def _renamed(skeleton: Skeleton, names: Mapping[str, str]) -> Skeleton:
    """The skeleton with other names; End Sites are named after their parents."""
    new = {name: names.get(name, name) for name in skeleton.names}
    ends = {f"{name}_End": f"{other}_End" for name, other in new.items()}
    return replace(skeleton, names=tuple(ends.get(name, new[name]) for name in skeleton.names))


def _on_hips(skeleton: Skeleton) -> Skeleton:
    """The Unreal rig, Y up, without helpers and root; the pelvis takes over the root's channels and place."""
    y_up = replace(skeleton, offsets=skeleton.offsets[:, [0, 2, 1]] * (1, 1, -1), up="Y")
    kept = [joint for joint, name in enumerate(y_up.names) if joint and not any(word in name for word in NO_BODY)]
    body = only(with_offset(y_up, 1, y_up.offsets[0] + y_up.offsets[1]), kept)
    return replace(body, channels=(skeleton.channels[0], *body.channels[1:]))


# ---- builds


def with_build(skeleton: Skeleton, build: str) -> Skeleton:
    """The skeleton with the proportions of one of `BUILDS`."""
    joints = roles(skeleton)
    special = {"": list(range(len(skeleton))), "crown": skeleton.subtree(joints["head"])[1:]}
    for part, factor in BUILDS[build].items():
        scaled = special[part] if part in special else [joints[side + part] for side in SIDES]
        skeleton = with_offset(skeleton, scaled, skeleton.offsets[scaled] * np.asarray(factor))
    return skeleton


# ---- fingers

FOREARM = 26.6  # the forearm that `FINGERS` fit [cm]
METACARPAL = 0.3  # where the bone in the palm begins between wrist and knuckle [0 to 1]


def with_fingers(skeleton: Skeleton, fingers: str, naming: Naming) -> Skeleton:
    """The body, in T-pose and without fingers, with the fingers of one of `HANDS` on both hands."""
    if fingers == "none":
        return skeleton
    for side in SIDES:
        skeleton = bare(skeleton, roles(skeleton)[f"{side}Hand"])
        for finger in HANDS[fingers]:
            skeleton = _with_finger(skeleton, side, finger, naming, palm=fingers == "metacarpals" and finger != "Thumb")
    return skeleton


def _with_finger(skeleton: Skeleton, side: str, finger: str, naming: Naming, *, palm: bool) -> Skeleton:
    """The skeleton with a finger of three bones, and a bone in the palm before them if `palm`."""
    hand = roles(skeleton)[f"{side}Hand"]
    size = skeleton.lengths[hand] / FOREARM * np.array([-INWARDS[side], 1.0, 1.0])
    knuckle, direction, lengths = FINGERS[finger]
    bones = size * np.multiply.outer(lengths, direction)
    first = size * np.array(knuckle)
    offsets = {naming.name(naming.palm, side, finger): METACARPAL * first} if palm else {}
    joints = [(1 - METACARPAL) * first if palm else first, *bones[:2]]
    offsets |= {naming.name(naming.finger, side, finger, k): offset for k, offset in enumerate(joints, start=1)}
    return with_chain(skeleton, hand, offsets, end=bones[2])


# ---- feet, both changed in T-pose

HIGH = np.radians(43)  # downward slope of the foot bone of a high ankle [rad]
HEEL = -0.4  # the heel behind the ankle [lengths of the foot bone]
TOES = np.linspace(0.25, -0.25, 5)  # inward offsets, big toe first [lengths of the foot bone]
SOLE = 0.01  # height of the lowest joint of the feet over the floor [body heights]


def high_ankle(skeleton: Skeleton, side: str, _naming: Naming) -> Skeleton:
    """The foot bone steep and the toes flat, as in a shoe with a high heel."""
    toe = roles(skeleton)[f"{side}Toes"]
    return with_offset(skeleton, toe, skeleton.lengths[toe] * np.array([0.0, -np.sin(HIGH), np.cos(HIGH)]))


def heel_bone(skeleton: Skeleton, side: str, naming: Naming) -> Skeleton:
    """A joint at the heel, on the floor behind the ankle."""
    toe = roles(skeleton)[f"{side}Toes"]
    heel = (0.0, skeleton.offsets[toe, 1], HEEL * skeleton.lengths[toe])
    return with_chain(skeleton, roles(skeleton)[f"{side}Foot"], {naming.limb(side, "Heel"): heel})


def toes_down(skeleton: Skeleton, side: str, _naming: Naming) -> Skeleton:
    """Foot and toes in line with the shin, straight down."""
    below = skeleton.subtree(roles(skeleton)[f"{side}Foot"])[1:]
    return with_offset(skeleton, below, skeleton.lengths[below, None] * np.array([0.0, -1.0, 0.0]))


def no_toe(skeleton: Skeleton, side: str, _naming: Naming) -> Skeleton:
    """No joint below the ankle; its End Site is at the place of the toe."""
    place = skeleton.offsets[roles(skeleton)[f"{side}Toes"]]
    skeleton = bare(skeleton, roles(skeleton)[f"{side}Foot"])
    return with_chain(skeleton, roles(skeleton)[f"{side}Foot"], {}, end=place)


def five_toes(skeleton: Skeleton, side: str, naming: Naming) -> Skeleton:
    """Five toes below the ball of the foot."""
    toe = roles(skeleton)[f"{side}Toes"]
    length, tip = skeleton.lengths[toe], skeleton.offsets[skeleton.children[toe][0]]
    skeleton = bare(skeleton, toe)
    for number, aside in enumerate(TOES, start=1):
        offset = tip * 0.2 + (INWARDS[side] * aside * length, 0.0, 0.0)
        name = naming.limb(side, f"ToePhalanx{number}")
        skeleton = with_chain(skeleton, roles(skeleton)[f"{side}Toes"], {name: offset}, end=0.8 * tip)
    return skeleton


FEET: Mapping[str, Callable[[Skeleton, str, Naming], Skeleton]] = {
    "flat": lambda skeleton, _side, _naming: skeleton,
    "high ankle": high_ankle,
    "heel bone": heel_bone,
    "toes down": toes_down,
    "no toe": no_toe,
    "five toes": five_toes,
}


def standing(skeleton: Skeleton) -> Skeleton:
    """The body on the floor, by its root's OFFSET; the lowest joint of the feet just above the floor."""
    heights = places(skeleton)[:, 1]
    return with_offset(skeleton, 0, skeleton.offsets[0] + (0.0, SOLE * np.ptp(heights) - heights.min(), 0.0))


# ---- rest poses

POSES: Mapping[str, float] = {"T": 0.0, "A": 45.0, "I": 85.0}  # the arms, below the horizontal [degrees]


def posed(skeleton: Skeleton, pose: str) -> Skeleton:
    """The skeleton, given in T-pose, with its arms as in a rest pose that stands."""
    for side in SIDES:
        turn = Rotation.from_euler("Z", INWARDS[side] * POSES.get(pose, 0.0), degrees=True)
        skeleton = turned_below(skeleton, roles(skeleton)[f"{side}UpperArm"], turn)
    return skeleton


# ---- roots: the hips themselves, or a joint above them in the tree

OVERHEAD = np.array([0.0, 1.2, 0.0])  # height of a root over the head [body heights]
BESIDE = np.array([0.0, 0.03, 0.06])  # a root from its child, the hips [body heights]


def _fixed_hips(skeleton: Skeleton, naming: Naming, start: ArrayLike, away: NDArray[np.float64]) -> Skeleton:
    """A root that alone has position channels, `away`, (3,) [body heights], from a place, (3,)."""
    rotations = tuple(channel for channel in skeleton.channels[0] if channel not in POSITION_CHANNELS)
    return below_root(skeleton, naming.root, start + away * places(skeleton)[:, 1].max(), rotations)


ROOTS: Mapping[str, Callable[[Skeleton, Naming], Skeleton]] = {
    "hips": lambda skeleton, _naming: skeleton,
    # on the floor, with position channels at the hips too, as in Bandai Namco's files
    "floor": lambda skeleton, naming: below_root(skeleton, naming.root, np.zeros(3), skeleton.channels[0]),
    # over the head, like the hand of a puppeteer
    "above": lambda skeleton, naming: _fixed_hips(skeleton, naming, np.zeros(3), OVERHEAD),
    # above and before the hips, like a centre of mass
    "offset child": lambda skeleton, naming: _fixed_hips(skeleton, naming, skeleton.offsets[0], BESIDE),
}

# ---- helpers: joints that are not part of the body

TWISTED = {"UpperArm": "LowerArm", "LowerArm": "Hand", "UpperLeg": "LowerLeg", "LowerLeg": "Foot"}
PANELS = 8  # of the skirt


def twist(skeleton: Skeleton, naming: Naming) -> Skeleton:
    """A joint in the middle of each long bone, which can take a share of its twist."""
    for side in SIDES:
        for part, end in TWISTED.items():
            joints = roles(skeleton)
            middle = 0.5 * skeleton.offsets[joints[side + end]]
            skeleton = with_chain(skeleton, joints[side + part], {naming.limb(side, f"{part}_Twist"): middle})
    return skeleton


def sleeves(skeleton: Skeleton, naming: Naming) -> Skeleton:
    """Two joints that hang from each forearm."""
    for side in SIDES:
        forearm = roles(skeleton)[f"{side}LowerArm"]
        down = (0.0, -0.4 * skeleton.lengths[forearm], 0.0)
        offsets = {naming.limb(side, f"Sleeve{number}"): down for number in (1, 2)}
        skeleton = with_chain(skeleton, forearm, offsets, end=down)
    return skeleton


def skirt(skeleton: Skeleton, _naming: Naming) -> Skeleton:
    """Chains of two joints that hang from the hips all around."""
    joints = roles(skeleton)
    thigh = skeleton.lengths[joints["leftLowerLeg"]]
    for panel in range(PANELS):
        angle = 2 * np.pi * panel / PANELS
        around = np.array([np.sin(angle), 0.0, np.cos(angle)])
        down = thigh * (0.1 * around + (0.0, -0.5, 0.0))
        offsets = {f"Skirt{panel}_1": 0.35 * thigh * around, f"Skirt{panel}_2": down}
        skeleton = with_chain(skeleton, joints["hips"], offsets, end=down)
    return skeleton


def hair(skeleton: Skeleton, _naming: Naming) -> Skeleton:
    """A plait of three joints from the back of the head downwards."""
    head = roles(skeleton)["head"]
    size = skeleton.lengths[skeleton.children[head][0]]
    offsets = {"Hair1": (0.0, 0.6 * size, -0.5 * size), "Hair2": (0.0, -0.6 * size, -0.2 * size)}
    down = (0.0, -0.6 * size, 0.0)
    return with_chain(skeleton, head, {**offsets, "Hair3": down}, end=down)


def sword(skeleton: Skeleton, _naming: Naming) -> Skeleton:
    """A sword in the right hand that points forward."""
    hand = roles(skeleton)["rightHand"]
    blade = (0.0, 0.0, 3.0 * skeleton.lengths[hand])
    return with_chain(skeleton, hand, {"Sword": 0.3 * skeleton.offsets[hand]}, end=blade)


def ik(skeleton: Skeleton, _naming: Naming) -> Skeleton:
    """IK handles of an engine below the root, at the places of hands and feet."""
    joints, points = {"": 0, **roles(skeleton)}, places(skeleton)
    handles = {"root": (0, points[0])}
    for name, (parent, role) in HANDLES.items():
        number, place = handles[parent]
        handles[name] = len(skeleton), points[joints[role]]
        skeleton = with_chain(skeleton, number, {name: handles[name][1] - place})
    return skeleton


def face(skeleton: Skeleton, naming: Naming) -> Skeleton:
    """Jaws and eyes instead of the crown, as in Character Creator, below a joint almost at the head [cm]."""
    head, names = roles(skeleton)["head"], naming.face.format
    skeleton = with_chain(bare(skeleton, head), head, {names(Part="FacialBone"): (0.0, -0.01, 0.01)})
    middle = len(skeleton) - 1
    for part, offset in FACE.items():
        skeleton = with_chain(skeleton, middle, {names(Part=part): offset})
    return skeleton


def jaw(skeleton: Skeleton, naming: Naming) -> Skeleton:
    """A jaw, forwards and downwards, as the only joint below the head [cm]."""
    head = roles(skeleton)["head"]
    offsets = {naming.face.format(Part="Jaw"): (0.0, -1.0, 3.0)}
    return with_chain(bare(skeleton, head), head, offsets, end=(0.0, -4.0, 7.0))


HELPERS: Mapping[str, Callable[[Skeleton, Naming], Skeleton]] = {
    helper.__name__: helper for helper in (twist, sleeves, skirt, hair, sword, ik, face, jaw)
}

# ---- the members


@dataclass(frozen=True)
class Member:
    """The traits of a body, by keys of `NAMING`, `POSES`, `BUILDS` and so on; with up "Z" it faces -Y."""

    convention: str
    pose: str = "T"
    builds: Sequence[str] = ()
    foot: str = "flat"
    fingers: str = "none"
    root: str = "hips"
    helpers: Sequence[str] = ()
    up: str = "Y"


MEMBERS = {name: Member(**traits) for name, traits in TABLES["members"].items()}


def member(name: str) -> Skeleton:
    """The skeleton of a member of the zoo [cm]; its feet are on the floor, by the root's OFFSET."""
    skeleton = _standing(MEMBERS[name])
    return with_axes(skeleton, axes) if (axes := _lying_axes(name)) else skeleton


def on_twin(name: str, motion: Motion) -> Motion:
    """A motion of the twin of a member of the zoo, without helpers and in a rest pose that stands, by rotation copy."""
    return retarget(motion, _standing(replace(MEMBERS[name], helpers=()))).rotation_copy


def on_member(name: str, motion: Motion) -> Motion:
    """The motion of a member of the zoo that equals that of its twin, `on_twin`."""
    skeleton, copy = _standing(MEMBERS[name]), on_twin(name, motion)
    plain, shared = copy.skeleton, [key for key in copy.skeleton.keys if key in skeleton.keys]
    joints, of_copy = ([body.index(key) for key in shared] for body in (skeleton, plain))
    rotations, translations = (np.tile(each, (len(copy), 1, 1)) for each in (skeleton.rest_rotations, skeleton.offsets))
    rotations[:, joints], translations[:, joints] = copy.rotations[:, of_copy], copy.translations[:, of_copy]
    whole = Motion.of_translations(skeleton, translations, rotations, copy.frame_time_text)
    return in_axes(whole, axes) if (axes := _lying_axes(name)) else whole


def _lying_axes(name: str) -> Rotation | None:
    """The axes of the joints of a member whose rest pose does not stand; None for one that stands."""
    traits = MEMBERS[name]
    return LYING[traits.pose].axes(_standing(traits)) if traits.pose in LYING else None


def _standing(traits: Member) -> Skeleton:
    """A body with these traits, in T-pose if its rest pose does not stand."""
    naming = NAMING[traits.convention]
    body = adult(traits.convention)
    for build in traits.builds:
        body = with_build(body, build)
    body = with_fingers(body, traits.fingers, naming)
    for side in SIDES:
        body = FEET[traits.foot](body, side, naming)
    body = ROOTS[traits.root](posed(standing(body), traits.pose), naming)
    for helper in traits.helpers:
        body = HELPERS[helper](body, naming)
    return z_up(body) if traits.up == "Z" else body
