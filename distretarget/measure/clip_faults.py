"""Faults of a clip by itself, without a target: cuts, jumps, frozen frames, feet that skate, and so on.

Each kind of fault is one number with a limit; lengths are in leg lengths of the body, so that units do not matter.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.body.axes import Directions
from distretarget.body.body import Body
from distretarget.body.limbs import Leg
from distretarget.body.resting import feet_at_rest
from distretarget.motion import Motion
from distretarget.numerics.joint_paths import heights_of, steps_along
from distretarget.numerics.time_series import Shots, spans_of, usual_steps
from distretarget.numerics.vectors import Array, Flags, Numbers, lengths, level, normalised

MOST = 0.3  # at a cut the median step of the joints is at least this share of their mean step
LONE = 0.25  # frames before a cut that last no longer than this are a first pose [s]
FAR = 0.04  # a joint jumps if its step in a frame is larger than this [leg lengths], and than that at ...
FAST = 4.0  # this speed [leg lengths / s], ...
TURN = np.radians(90.0)  # and flips if it turns by more than this [rad], ...
SUDDEN = 4.0  # and by this many times as much as in the frames around
SAME = 1e-7  # joints that move less in a frame do not move [leg lengths]
AT_ONCE = 0.1  # a body that stops dead was faster than this, on average over its joints [leg lengths / s]
MOVING = 0.05  # a body is in the middle of a movement if it is faster than this [leg lengths / s]
HOLD = 0.1  # equal frames for longer than this are frozen, for less repeated [s]

LOW = 0.04  # a foot stands if ankle and toe are this near to their lowest heights [leg lengths] ...
LOWEST = 2.0  # which are this percentile of them [%],
LEVEL_SPEED = 0.1  # and rise or sink slower than this [leg lengths / s];
SLIDES = 0.35  # it skates if they are faster than this along the floor [leg lengths / s] ...
SKATE = 0.2  # for at least this time [s]
TERRAIN = 0.15  # feet that rest at heights that differ by more than this are not on one floor [leg lengths]
SPAN = 0.05  # speeds of feet are means over this time before and after a frame [s]
STILL = 0.1  # a foot joint slower than this stands on something [leg lengths / s]
SLOWEST = 1.0  # a longer frame time is an error, such as one in milliseconds [s]
LIKELY = 10  # resting frames of a foot joint that are needed to find the floor
STRAIGHT = 0.9  # the length, hip to ankle, from which on a leg is straight [leg lengths]
AGREE = np.radians(15)  # trunk and legs of a straight body are within this angle of the normal of its soles [rad]
LIES = np.radians(60)  # a body that leans farther than this lies [rad]
STANDS = 10  # standing frames that are needed to find the tilt


@dataclass(frozen=True)
class Kind:
    """A kind of fault."""

    meaning: str  # of its number
    unit: str = ""
    limit: float = 0.0  # a clip has the fault if the number is above this
    plain: bool = False  # whether the number is only 1, a fault, or 0


KINDS: Mapping[str, Kind] = {
    "unreadable": Kind("the file cannot be read, or has no motion", plain=True),
    "first_pose": Kind("frames of another pose, such as a T-pose, before the motion begins", "frames"),
    "cuts": Kind("cuts, at which all joints jump"),
    "jumps": Kind("frames in which a joint jumps, to another place or out and back", "frames"),
    "flips": Kind("frames in which a joint turns by more than 90 degrees", "frames"),
    "still": Kind("no joint moves in the whole clip", plain=True),
    "frozen": Kind("the longest time for which a moving body stops completely", "s", 0.1),
    "repeated": Kind("frames in the middle of a movement that repeat the frame before", "%", 1.0),
    "skating": Kind("the time for which a standing foot moves along the floor", "s", 0.3),
    "below_floor": Kind("the largest depth of joints below the floor on which feet rest", "% of leg", 8.0),
    "off_floor": Kind("the distance of the lowest joint from height 0", "legs", 3.0),
    "stretching": Kind("the change of a bone's length", "% of leg", 2.0),
    "up_axis": Kind("the axis up differs from that of the skeleton, or of most clips of the rig", plain=True),
    "tilt": Kind("the tilt of the world, found from soles, legs and trunk that lean together", "degrees", 15.0),
    "sides": Kind("joints named left are on the right", plain=True),
    "unit": Kind("the size of the body, relative to most clips of the rig, or the inverse", "times", 1.5),
    "frame_time": Kind("difference from the frame time of most clips of the rig; or the excess over 1 s", "%", 1.0),
    "duplicate": Kind("another clip has the same motion", plain=True),
}


@dataclass(frozen=True)
class Finding:
    """The number of a kind of fault in a clip, and where it is worst."""

    value: float
    frame: int | None = None
    where: str = ""  # the joint, or the other clip


Findings = dict[str, Finding]


def find_faults(motion: Motion) -> Findings:
    """Return the numbers of all faults of a motion, by kind; kinds that cannot be measured are missing."""
    if len(motion) < 2:
        return {"unreadable": Finding(1.0, None, "has fewer than two frames")}
    body = Body.of_motion(motion)
    leg = body.leg
    if leg <= 0:
        return {"unreadable": Finding(1.0, None, "has no bone with a length")}
    joints = np.flatnonzero((body.regions.of_joint >= 0) & ~body.skeleton.end_sites)
    steps = steps_along(motion.positions, joints) / leg
    findings = _still(steps, motion.frame_time)
    own = np.insert(steps.max(axis=1, initial=0.0) >= SAME, 0, True)  # the frames that do not repeat the one before
    shots = _shots(motion[own], body)[np.cumsum(own) - 1]
    findings |= _cuts(shots, motion.frame_time)
    begins = 2 * int(findings["first_pose"].value)  # after a first pose, the motion may take as long to settle
    if len(motion) - begins > 1 and len(joints):
        settled, changing = motion[begins:], np.flatnonzero(own[begins:])
        found = _of_feet(settled, body, shots[begins:], joints) | {"stretching": _stretching(settled, body, leg)}
        findings |= {kind: _in_clip(each, np.arange(begins, len(motion))) for kind, each in found.items()}
        found = _of_steps(settled[changing], body, joints, shots[begins:][changing])
        findings |= {kind: _in_clip(each, begins + changing) for kind, each in found.items()}
    contradicts = body.up_at_rest is not None and body.up_in_motion not in (None, body.up_at_rest)
    findings["up_axis"] = Finding(float(contradicts), None, f"{body.up_in_motion} is up" if contradicts else "")
    findings["sides"] = Finding(float(body.left_is_left is False))
    if motion.frame_time > SLOWEST:
        findings["frame_time"] = Finding(
            100.0 * (motion.frame_time / SLOWEST - 1.0), None, f"{motion.frame_time:.3g} s a frame"
        )
    return findings


def _in_clip(found: Finding, frames: Numbers) -> Finding:
    """A finding in a part of a clip, by the frames of the clip; `frames` are those of the part."""
    return found if found.frame is None else replace(found, frame=int(frames[found.frame]))


def _still(steps: Array, frame_time: float) -> Findings:
    """Equal frames: whether all are equal; the longest sudden stop; and those repeated within a movement."""
    speeds, equal = steps.mean(axis=1) / frame_time, steps.max(axis=1) < SAME
    frozen, repeated, first, first_repeated = 0.0, 0, None, None
    for start, end in spans_of(equal):
        sides = [speeds[start - 1] if start else 0.0, speeds[end] if end < len(speeds) else 0.0]
        if (end - start) * frame_time > HOLD:
            if max(sides) > AT_ONCE and (end - start) * frame_time > frozen:
                frozen, first = float((end - start) * frame_time), int(start)
        elif min(sides) > MOVING:
            repeated, first_repeated = repeated + end - start, first_repeated or int(start) + 1
    share = 100.0 * repeated / (len(steps) + 1)
    still = Finding(float(len(equal) > 0 and bool(equal.all())))
    return {"still": still, "frozen": Finding(frozen, first), "repeated": Finding(share, first_repeated)}


def _shots(motion: Motion, body: Body) -> Shots:
    """(frames,), the shot of each frame; at a cut most joints jump, not only a limb."""
    if len(motion) < 2:
        return np.zeros(len(motion), np.intp)
    edges = np.diff(body.shots_of(motion)) != 0
    steps = steps_along(motion.positions, np.flatnonzero(body.regions.of_joint >= 0))
    edges &= np.median(steps, axis=1) > MOST * steps.mean(axis=1)
    return np.insert(np.cumsum(edges), 0, 0).astype(np.intp)


def _cuts(shots: Shots, frame_time: float) -> Findings:
    """The numbers of frames of a first pose before the motion begins, and of cuts after that."""
    edges = np.flatnonzero(np.diff(shots)) + 1
    begins = 0
    for edge in edges:
        if edge - begins > max(LONE / frame_time, 1.0):
            break
        begins = int(edge)
    later = edges[edges > begins]
    first = int(later[0]) if len(later) else None
    return {"first_pose": Finding(begins, 0 if begins else None), "cuts": Finding(len(later), first)}


def _of_steps(motion: Motion, body: Body, joints: Numbers, shots: Shots) -> Findings:
    """Joints that jump or flip, in a motion without repeated frames."""
    if len(motion) < 2:
        return {"jumps": Finding(0.0), "flips": Finding(0.0)}
    steps, rotations = steps_along(motion.positions, joints) / body.leg, motion.rotations[:, joints]
    cosine = np.abs((rotations[1:] * rotations[:-1]).sum(axis=-1))
    turns = 2.0 * np.arccos(np.minimum(cosine, 1.0))  # against the parents [rad]
    far, inside = max(FAR, FAST * motion.frame_time), np.diff(shots) == 0
    return {"jumps": _sudden(steps, far, inside, joints, body), "flips": _sudden(turns, TURN, inside, joints, body)}


def _sudden(steps: Array, far: float, inside: Flags, joints: Numbers, body: Body) -> Finding:
    """The frames with a step, (frames - 1, joints), above `far` and `SUDDEN` times the usual one, `inside` a shot."""
    usual = usual_steps(np.where(inside[:, None], steps, 0.0))
    far_steps = (steps > far) & inside[:, None]
    far_steps[[0, -1]] = False  # one side of these is unknown
    frames, some = np.nonzero(far_steps & (steps > SUDDEN * usual))
    if not len(frames):
        return Finding(0.0)
    worst = int(steps[frames, some].argmax())
    name = body.skeleton.keys[joints[some[worst]]]
    return Finding(float(len(np.unique(frames))), int(frames[worst]) + 1, name)


def _stretching(motion: Motion, body: Body, leg: float) -> Finding:
    """The largest change of the length of a bone from its usual one [% of leg]."""
    if motion.moving is None:
        return Finding(0.0)
    of_body, moving = body.regions.of_joint >= 0, motion.moving.joints
    some = np.flatnonzero(of_body[moving] & of_body[body.skeleton.parents[moving]])
    if not len(some):
        return Finding(0.0)
    bones = lengths(motion.moving.translations[:, some])
    changes = np.abs(bones - np.median(bones, axis=0))
    frame, bone = np.unravel_index(changes.argmax(), changes.shape)
    return Finding(100.0 * float(changes[frame, bone]) / leg, int(frame), body.skeleton.keys[moving[some[bone]]])


def _of_feet(motion: Motion, body: Body, shots: Shots, joints: Numbers) -> Findings:
    """Faults of the feet, and of how the `joints` of a body stand over the floor."""
    if body.legs is None:
        return {}
    findings = {"off_floor": Finding(abs(body.lowest(body.up_vector)) / body.leg_length), "skating": Finding(0.0)}
    x, time = motion.positions, motion.frame_time
    speeds = [_mean_speeds(x[:, _foot_joints(foot)], time).max(axis=1) for foot in body.legs]
    findings["tilt"] = Finding(_tilt(motion, body, np.stack(speeds, axis=1) < STILL * body.leg_length))
    skates = np.stack([_skates(motion, body, foot, shots) for foot in body.legs], axis=1)
    spans = [(end - start, int(start), foot) for foot in (0, 1) for start, end in spans_of(skates[:, foot])]
    if spans:
        _, start, foot = max(spans, key=lambda span: span[0])
        findings["skating"] = Finding(
            float(skates.any(axis=1).sum() * time), start, body.skeleton.keys[body.legs[foot].ankle]
        )
    if (below := _below_floor(motion, body, joints)) is not None:
        findings["below_floor"] = below
    return findings


def _tilt(motion: Motion, body: Body, still: Flags) -> float:
    """How far the world is tilted [degrees]: the least mean lean of soles, legs and trunk while a foot is `still`,
    (frames, 2), under a straight leg, if all lean to the same side; else 0. On a slope only soles lean, in a bow only
    the trunk.
    """
    if body.legs is None or body.anatomy is None or not body.stands_at_rest:
        return 0.0
    trunk = Directions(body.anatomy, motion.positions).trunk
    ups: list[list[Array]] = [[], [], []]
    for leg, stays in zip(body.legs, still.T, strict=True):
        up_the_leg = motion.positions[:, leg.hip] - motion.positions[:, leg.ankle]
        stands = stays & (lengths(up_the_leg) > STRAIGHT * body.leg_length)
        if stands.any():
            normals = Rotation.from_quat(motion.world_rotations_of(leg.ankle)[stands]).apply(body.rest.axes[:, 1])
            for each, found in zip(ups, (normals, up_the_leg[stands], trunk[stands]), strict=True):
                each.append(found)
    if sum(map(len, ups[0])) < STANDS:
        return 0.0
    means = normalised(np.stack([np.concatenate(each).mean(axis=0) for each in ups]))
    apart = np.arccos(np.clip(means[1:] @ means[0], -1.0, 1.0))
    leans = np.arccos(np.clip(means @ body.up_vector, -1.0, 1.0))
    return float(np.degrees(leans.min())) if apart.max() < AGREE and leans.max() < LIES else 0.0


def _skates(motion: Motion, body: Body, foot: Leg, shots: Shots) -> Flags:
    """(frames,), whether a foot stands and moves along the floor."""
    ends, up, leg = _foot_joints(foot), body.up_vector, body.leg_length
    heights = heights_of(motion.positions, ends, up) / leg
    low = (heights - np.percentile(heights, LOWEST, axis=0) < LOW).all(axis=1)
    rises = _mean_speeds(heights[..., None], motion.frame_time).max(axis=1)
    along = _mean_speeds(level(motion.positions[:, ends], up) / leg, motion.frame_time).min(axis=1)
    skates: Flags = low & (rises < LEVEL_SPEED) & (along > SLIDES)
    reach = _reach(motion.frame_time)
    for edge in np.flatnonzero(np.diff(shots)) + 1:
        skates[max(edge - reach, 0) : edge + reach] = False
    for start, end in spans_of(skates):
        if (end - start) * motion.frame_time < SKATE:
            skates[start:end] = False
    return skates


def _below_floor(motion: Motion, body: Body, joints: Numbers) -> Finding | None:
    """The largest depth of joints below the floor while no foot stands lower; None without one level floor."""
    rests, up, leg = [*_rests(motion, body)], body.up_vector, body.leg_length
    if not rests or max(high - low for low, _, high in rests) > TERRAIN * leg:
        return None
    floor = min(usual for _, usual, _ in rests)
    ends = _foot_joints(*body.legs or ())
    lowest = heights_of(motion.positions, joints, up)
    stands = (_mean_speeds(motion.positions[:, ends], motion.frame_time) < STILL * leg) & (
        heights_of(motion.positions, ends, up) < floor - 0.01 * KINDS["below_floor"].limit * leg
    )
    lowest[stands.any(axis=1)] = np.inf
    frame, joint = np.unravel_index(lowest.argmin(), lowest.shape)
    depth = 100.0 * float(floor - lowest[frame, joint]) / leg
    return Finding(depth, int(frame), body.skeleton.keys[joints[joint]]) if depth > 0.0 else Finding(0.0)


def _rests(motion: Motion, body: Body) -> Iterator[tuple[float, float, float]]:
    """For each foot joint that rests often, its 10th, 50th and 90th percentile of heights at rest [file units]."""
    for foot in body.legs or ():
        rests = feet_at_rest(motion, foot, body.up_vector, body.leg_length)
        heights = heights_of(motion.positions, [foot.ankle, foot.toe], body.up_vector)
        for of_joint, at_rest in zip(heights.T, rests.T, strict=True):
            if at_rest.sum() >= LIKELY:
                low, usual, high = np.percentile(of_joint[at_rest], (10, 50, 90))
                yield float(low), float(usual), float(high)


def _foot_joints(*feet: Leg) -> Numbers:
    """Ankles and toes, each once."""
    return np.array(sorted({joint for foot in feet for joint in (foot.ankle, foot.toe)}), np.intp)


def _mean_speeds(paths: Array, frame_time: float) -> Array:
    """(frames, joints), the speeds of paths, (frames, joints, n), as means over `SPAN` before and after a frame."""
    frames, reach = np.arange(len(paths)), _reach(frame_time)
    before, after = np.maximum(frames - reach, 0), np.minimum(frames + reach, len(paths) - 1)
    times = np.maximum(after - before, 1) * frame_time
    return np.asarray(lengths(paths[after] - paths[before]) / times[:, None])


def _reach(frame_time: float) -> int:
    """`SPAN` in frames."""
    return max(round(SPAN / frame_time), 1)
