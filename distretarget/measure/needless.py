"""Turns, shaking and pops of a result that copied rotations do not have and that no contact or support explains."""

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

HELD = ("head", "upperChest", "chest", "leftHand", "rightHand")  # what arms and legs carry to a contact as it is
SINKS = 2.0  # copied rotations by which a limb sinks in by less than this need no change [% of height]
AROUND = 0.75  # an arm may turn for this long before and after what it turns for [s]
LASTS = 0.1  # what shakes does so for this long before and after [s]
FAR = 4.0  # a joint pops if its deviation from the copy goes farther than this [% of leg length in INSTANT] ...
SUDDEN = 3.0  # ... and this many times its usual way
JUMP = 2.0  # a joint of the source that goes so far, and so many times its usual way, jumps: the data are wrong there


def find_turned(copy: Motion, result: Motion, body: Body) -> Track:
    """How far head, chest and hands are turned away from the rotation copy, (frames, parts) [degrees]."""
    joints = body.anatomy.joints(*HELD) if body.anatomy else []
    angles = [_angles(copy, result, joint) for joint in joints]
    return Track(_columns(angles, len(result)), parts=result.skeleton.keys_of(joints))


def find_pops(copy: Motion, result: Motion, body: Body, shots: Shots) -> Array:
    """(frames - 1, joints), how far the deviation of each joint of a result from its copy pops on the way to the next
    frame [% of leg length in `INSTANT`]; 0 where it does not pop.

    Joints outside the body, such as a root on the floor, do not pop, and no joint pops at a cut of the source between
    `shots`, (frames,), or where the source itself jumps.
    """
    pops, going_on = np.zeros((max(len(result) - 1, 0), len(result.skeleton))), np.diff(shots) == 0
    joints, scale = np.flatnonzero(body.regions.of_joint >= 0), 100 * INSTANT / (body.leg * result.frame_time)
    for block in blocks_of(len(pops)):
        first = max(block.start - 2, 0)
        frames, rows = slice(first, block.stop + 3), slice(block.start - first, block.stop - first)
        of_copy, of_result = (np.diff(each.positions_in(frames)[:, joints], axis=0) for each in (copy, result))
        own, off = scale * lengths(of_copy), scale * lengths(of_result - of_copy)
        goes_on = going_on[block] & ~_sudden(own, JUMP)[rows].any(axis=1)
        pops[block, joints] = np.where(_sudden(off, SUDDEN)[rows] & goes_on[:, None], off[rows], 0.0)
    return pops


def _sudden(steps: Array, times: float) -> Flags:
    """Which steps, (frames, joints), are farther than `FAR` and than so many times the usual."""
    return np.asarray((steps > FAR) & (steps > times * usual_steps(steps)))


def find_needless(
    copy: Motion, result: Motion, body: Body, of_copy: Comparison, of_result: Comparison, asked: Flags | bool = False
) -> Track:
    """How far upper arms are turned away from the rotation copy, or point elsewhere than the source's, without need,
    (frames, arms) [degrees]: while the arm touches nothing in the source, nothing but the feet rests there, and the
    copied forearm and hand do not sink in.

    `of_copy` and `of_result` are what was measured of the two; where a user asks for other contacts, `asked`,
    (frames,), arms may turn.
    """
    sides = [side for side in SIDES if f"{side}UpperArm" in body.roles]
    joints = body.anatomy.joints(*(f"{side}UpperArm" for side in sides)) if body.anatomy else []
    keys = result.skeleton.keys_of(joints)
    off = [_off_direction(of_result, key) for key in keys]
    angles = [np.maximum(_angles(copy, result, joint), each) for joint, each in zip(joints, off, strict=True)]
    needed = [_needed(of_copy, side, result.frame_time, asked) for side in sides]
    counts = _columns([~each for each in needed], len(result)) > 0
    return Track(_columns(angles, len(result)), counts, keys)


def find_shaking(copy: Motion, result: Motion, body: Body, shots: Shots) -> Array:
    """(frames - 2, joints), by how much more than in the rotation copy each joint of a result is off the middle between
    the frames before and after: the median over `LASTS` before and after, since a single jump is no shaking [% of leg
    length]. Joints outside the body and frames at a cut between `shots`, (frames,), count 0; frames that are farther
    apart than `INSTANT` count as much less as a smooth way bends more between them.
    """
    joints, off = np.flatnonzero(body.regions.of_joint >= 0), np.zeros((max(len(result) - 2, 0), len(result.skeleton)))
    for block in blocks_of(len(off)):
        frames = slice(block.start, block.stop + 2)
        own, copied = (_off_middle(motion.positions_in(frames)[:, joints]) for motion in (result, copy))
        off[block, joints] = np.maximum(own - copied, 0.0)
    cuts = np.diff(shots) != 0
    off[cuts[:-1] | cuts[1:]] = 0.0
    span = 2 * round(LASTS / result.frame_time) + 1
    percent = 100.0 * min(INSTANT / result.frame_time, 1.0) ** 2 / body.leg
    for joint in joints:  # one by one, for which scipy has a faster filter
        off[:, joint] = percent * median_filter(off[:, joint], span, mode="nearest")
    return off


def _off_middle(places: Array) -> Array:
    """(frames - 2, n), how far places, (frames, n, 3), are off the middle between the frames before and after."""
    return lengths(places[1:-1] - 0.5 * (places[:-2] + places[2:]))


def _columns(values: list[Array] | list[Flags], frames: int) -> Array:
    """(frames, values), each of (frames,) in a column."""
    return np.stack(values, axis=1).astype(np.float64) if values else np.zeros((frames, 0))


def _angles(copy: Motion, result: Motion, joint: int) -> Array:
    """(frames,), the angles between the world rotations of a joint [degrees]."""
    cosine = np.abs((copy.world_rotations_of(joint) * result.world_rotations_of(joint)).sum(axis=1))
    return np.asarray(np.degrees(2.0 * np.arccos(np.minimum(cosine, 1.0))))


def _off_direction(of_result: Comparison, key: str) -> Array:
    """(frames,), how far the bones below a joint are off the directions of the source's [degrees]."""
    off = of_result.tracks["direction_error"]
    return np.asarray(off.values[:, np.array(off.parts) == key].max(axis=1, initial=0.0))


def _needed(of_copy: Comparison, side: str, frame_time: float, asked: Flags | bool) -> Flags:
    """(frames,), whether an arm has something to turn for."""
    needed, own = _touching(of_copy.contacts, side), [limb.startswith(side) for limb in LIMBS]
    needed |= of_copy.others_rest.any(axis=1) | asked
    depths, touches = (of_copy.tracks[key] for key in ("skin_depth", "skin_gap"))
    if len(depths.values):
        needed |= (depths.values[:, own].max(axis=1) >= SINKS) | touches.weights[:, own].any(axis=1)
    reach = int(min(AROUND / frame_time, len(needed)))
    return np.asarray(largest(needed.astype(np.float64)[:, None], reach)[:, 0] > 0.0)


def _touching(contacts: Contacts, side: str) -> Flags:
    """(frames,), whether an arm is in a contact of the source."""
    names = contacts.candidates.names
    arms = [
        any(part.startswith(side) and part.endswith(("hand", "arm")) for part in name.split(" - ")) for name in names
    ]
    touching = np.zeros(len(contacts.strides), bool)
    touching[contacts.frame[np.array(arms, bool)[contacts.regions]]] = True
    return touching
