"""Turns, shaking and pops of a result that the rotation copy does not have and that no contact or support explains."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter

from distretarget.body.anatomy import SIDES
from distretarget.body.body import Body
from distretarget.measure.comparison import INSTANT, Comparison
from distretarget.measure.contacts import Contacts
from distretarget.measure.metrics import Track
from distretarget.measure.skin_depths import LIMBS
from distretarget.motion import Motion
from distretarget.numerics.moving import largest
from distretarget.numerics.parallel import blocks_of
from distretarget.numerics.time_series import Shots, usual_steps
from distretarget.numerics.vectors import Array, Flags, lengths

NOT_TURNED = ("head", "upperChest", "chest", "leftHand", "rightHand")  # roles whose rotations contacts need not change
SINKS = 2.0  # a copied arm needs no change if it sinks in by less than this [% of height]
AROUND = 0.75  # an arm may turn for this long before and after frames in which it needs to [s]
LASTS = 0.1  # shaking is a median over this time before and after [s]
FAR = 4.0  # a joint pops if its step relative to the copy is larger than this [% of leg length in INSTANT] ...
SUDDEN = 3.0  # ... and than this many times the usual step
JUMP = 2.0  # a step of the source larger than `FAR` and than this many times the usual one is an error of the data


def find_turned(copy: Motion, result: Motion, body: Body) -> Track:
    """The angles of head, chest and hands to the rotation copy, (frames, parts) [degrees]."""
    joints = body.anatomy.joints(*NOT_TURNED) if body.anatomy else []
    angles = [_angles(copy, result, joint) for joint in joints]
    return Track(_columns(angles, len(result)), parts=result.skeleton.keys_of(joints))


def find_pops(copy: Motion, result: Motion, body: Body, shots: Shots) -> Array:
    """(frames - 1, joints), the step of each joint relative to the copy where it is a pop [% of leg length in
    `INSTANT`]; else 0, as outside the body, at a cut between `shots`, (frames,), and where the source itself jumps.
    """
    pops, same_shot = np.zeros((max(len(result) - 1, 0), len(result.skeleton))), np.diff(shots) == 0
    joints, scale = np.flatnonzero(body.regions.of_joint >= 0), 100 * INSTANT / (body.leg * result.frame_time)
    for block in blocks_of(len(pops)):
        first = max(block.start - 2, 0)
        frames, rows = slice(first, block.stop + 3), slice(block.start - first, block.stop - first)
        of_copy, of_result = (np.diff(each.positions_in(frames)[:, joints], axis=0) for each in (copy, result))
        copied, added = scale * lengths(of_copy), scale * lengths(of_result - of_copy)
        counts = same_shot[block] & ~_sudden(copied, JUMP)[rows].any(axis=1)
        pops[block, joints] = np.where(_sudden(added, SUDDEN)[rows] & counts[:, None], added[rows], 0.0)
    return pops


def _sudden(steps: Array, times: float) -> Flags:
    """(frames, joints), whether steps are larger than `FAR` and than so many times the usual step."""
    return np.asarray((steps > FAR) & (steps > times * usual_steps(steps)))


def find_arm_deviation(
    copy: Motion, result: Motion, body: Body, of_copy: Comparison, of_result: Comparison, free: Flags | bool = False
) -> Track:
    """The angles of upper arms to the rotation copy, or to the source's directions if larger, (frames, arms) [degrees].
    They count while the arm touches nothing in the source, only feet rest there, and the copied forearm and hand do not
    sink in; and not in frames that are `free`, (frames,), where the user changed contacts.
    """
    sides = [side for side in SIDES if f"{side}UpperArm" in body.roles]
    joints = body.anatomy.joints(*(f"{side}UpperArm" for side in sides)) if body.anatomy else []
    keys = result.skeleton.keys_of(joints)
    off = of_result.tracks["direction_error"]
    errors = [off.values[:, np.array(off.parts) == key].max(axis=1, initial=0.0) for key in keys]
    angles = [np.maximum(_angles(copy, result, joint), each) for joint, each in zip(joints, errors, strict=True)]
    counts = _columns([~_may_turn(of_copy, side, result.frame_time, free) for side in sides], len(result)) > 0
    return Track(_columns(angles, len(result)), counts, keys)


def find_shaking(copy: Motion, result: Motion, body: Body, shots: Shots) -> Array:
    """(frames - 2, joints), how much farther than in the copy each joint is from the midpoint of the frames around [%
    of leg length]: the median over `LASTS`, since a single jump is no shaking. For frame times above `INSTANT` it is
    scaled as the distance of a smooth path is; 0 outside the body and at a cut between `shots`, (frames,).
    """
    joints, off = np.flatnonzero(body.regions.of_joint >= 0), np.zeros((max(len(result) - 2, 0), len(result.skeleton)))
    for block in blocks_of(len(off)):
        frames = slice(block.start, block.stop + 2)
        paths = (motion.positions_in(frames)[:, joints] for motion in (result, copy))
        result_off, copy_off = (lengths(x[1:-1] - 0.5 * (x[:-2] + x[2:])) for x in paths)
        off[block, joints] = np.maximum(result_off - copy_off, 0.0)
    cuts = np.diff(shots) != 0
    off[cuts[:-1] | cuts[1:]] = 0.0
    span = 2 * round(LASTS / result.frame_time) + 1
    percent = 100.0 * min(INSTANT / result.frame_time, 1.0) ** 2 / body.leg
    for joint in joints:  # one by one, for which scipy has a faster filter
        off[:, joint] = percent * median_filter(off[:, joint], span, mode="nearest")
    return off


def _columns(values: list[Array] | list[Flags], frames: int) -> Array:
    """(frames, n), values of (frames,) each as columns."""
    return np.stack(values, axis=1).astype(np.float64) if values else np.zeros((frames, 0))


def _angles(copy: Motion, result: Motion, joint: int) -> Array:
    """(frames,), the angles between the world rotations of a joint [degrees]."""
    cosine = np.abs((copy.world_rotations_of(joint) * result.world_rotations_of(joint)).sum(axis=1))
    return np.asarray(np.degrees(2.0 * np.arccos(np.minimum(cosine, 1.0))))


def _may_turn(of_copy: Comparison, side: str, frame_time: float, free: Flags | bool) -> Flags:
    """(frames,), whether an arm may turn: within `AROUND` of frames in which it has a reason to."""
    reason, own = _touching(of_copy.contacts, side), [limb.startswith(side) for limb in LIMBS]
    reason |= of_copy.others_rest.any(axis=1) | free
    depths, touches = (of_copy.tracks[key] for key in ("skin_depth", "skin_gap"))
    if len(depths.values):
        reason |= (depths.values[:, own].max(axis=1) >= SINKS) | touches.weights[:, own].any(axis=1)
    reach = int(min(AROUND / frame_time, len(reason)))
    return np.asarray(largest(reason.astype(np.float64)[:, None], reach)[:, 0] > 0.0)


def _touching(contacts: Contacts, side: str) -> Flags:
    """(frames,), whether an arm is in a self-contact of the source."""
    names = contacts.candidates.names
    arms = [
        any(part.startswith(side) and part.endswith(("hand", "arm")) for part in name.split(" - ")) for name in names
    ]
    touching = np.zeros(len(contacts.strides), bool)
    touching[contacts.frame[np.array(arms, bool)[contacts.regions]]] = True
    return touching
