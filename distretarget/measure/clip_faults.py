"""What is wrong with a clip as it is, without a target: cuts, jumps, frozen frames, bones that stretch, and so on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from distretarget.body.body import Body
from distretarget.measure.clip_feet import faults_of_feet
from distretarget.measure.faults import Finding, Findings
from distretarget.motion import Motion
from distretarget.numerics.joint_paths import steps_along
from distretarget.numerics.time_series import Shots, spans_of
from distretarget.numerics.vectors import lengths

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

MOST = 0.3  # at a cut the median step of the joints is at least this share of their mean step
LONE = 0.25  # frames before a cut are a pose by themselves if they last up to this [s]
FAR = 0.04  # a joint jumps if it goes farther than this in a frame [leg lengths], and as far as at ...
FAST = 4.0  # this speed [leg lengths / s], ...
TURN = np.radians(90.0)  # and flips if it turns farther [rad], ...
SUDDEN = 4.0  # and this many times as far as in the frames around
SAME = 1e-7  # joints that move less in a frame stay where they are [leg lengths]
AT_ONCE = 0.1  # a body that moves faster than this, on average over its joints, does not stop at once [leg lengths / s]
MOVING = 0.05  # and one that moves faster than this does not stand still for a frame [leg lengths / s]
HOLD = 0.1  # equal frames for longer than this are frozen, for less repeated [s]


def find_faults(motion: Motion) -> Findings:
    """Return what is wrong with a motion, by kind; kinds that cannot be measured are missing."""
    if len(motion) < 2:
        return {"unreadable": Finding(1.0, None, "has fewer than two frames")}
    body = Body.of_motion(motion)
    leg = 0.5 * body.unit
    if leg <= 0:
        return {"unreadable": Finding(1.0, None, "has no bone with a length")}
    joints = np.flatnonzero((body.regions.of_joint >= 0) & ~body.skeleton.end_sites)
    steps = steps_along(motion.positions, joints) / leg
    findings = _still(steps, motion.frame_time)
    own = np.insert(steps.max(axis=1, initial=0.0) >= SAME, 0, True)  # the frames that do not repeat the one before
    shots = _shots(motion[own], body)[np.cumsum(own) - 1]
    findings |= _cuts(shots, motion.frame_time)
    begins = 2 * int(findings["first_pose"].value)  # it may take as many frames to settle
    if len(motion) - begins > 1 and len(joints):
        settled, kept = motion[begins:], np.flatnonzero(own[begins:])
        found = faults_of_feet(settled, body, shots[begins:], joints) | {"stretching": _stretching(settled, body, leg)}
        findings |= {kind: _at(each, np.arange(begins, len(motion))) for kind, each in found.items()}
        found = _of_steps(settled[kept], body, joints, shots[begins:][kept])
        findings |= {kind: _at(each, begins + kept) for kind, each in found.items()}
    contradicts = body.up_at_rest is not None and body.found_up not in (None, body.up_at_rest)
    findings["up_axis"] = Finding(float(contradicts), None, f"{body.found_up} is up" if contradicts else "")
    findings["sides"] = Finding(float(body.left_is_left is False))
    return findings


def _at(found: Finding, frames: NDArray[np.intp]) -> Finding:
    """A finding in some frames of a clip, whose numbers are given."""
    return found if found.frame is None else replace(found, frame=int(frames[found.frame]))


def _of_steps(motion: Motion, body: Body, joints: NDArray[np.intp], shots: Shots) -> Findings:
    """Joints that jump or flip, in a motion without repeated frames."""
    if len(motion) < 2:
        return {"jumps": Finding(0.0), "flips": Finding(0.0)}
    steps, inside = steps_along(motion.positions, joints) / (0.5 * body.unit), np.diff(shots) == 0
    far = max(FAR, FAST * motion.frame_time)
    return {
        "jumps": _sudden(steps, far, inside, joints, body),
        "flips": _sudden(_turns(motion, joints), TURN, inside, joints, body),
    }


def _shots(motion: Motion, body: Body) -> Shots:
    """The shot of each frame, (frames,); a limb that jumps alone makes no cut."""
    if len(motion) < 2:
        return np.zeros(len(motion), np.intp)
    edges = np.diff(body.shots_of(motion)) != 0
    steps = steps_along(motion.positions, np.flatnonzero(body.regions.of_joint >= 0))
    edges &= np.median(steps, axis=1) > MOST * steps.mean(axis=1)
    return np.insert(np.cumsum(edges), 0, 0).astype(np.intp)


def _cuts(shots: Shots, frame_time: float) -> Findings:
    """Frames before the motion begins, and cuts after that."""
    edges = np.flatnonzero(np.diff(shots)) + 1
    long = max(LONE / frame_time, 1.0)
    begins = 0
    for edge in edges:
        if edge - begins > long:
            break
        begins = int(edge)
    later = edges[edges > begins]
    first = int(later[0]) if len(later) else None
    return {"first_pose": Finding(begins, 0 if begins else None), "cuts": Finding(len(later), first)}


def _sudden(steps: Array, far: float, inside: Flags, joints: NDArray[np.intp], body: Body) -> Finding:
    """The number of frames to which a joint goes farther than `far`, and `SUDDEN` times as far as around; `steps` are
    (frames - 1, joints), those at cuts are not `inside`.
    """
    padded = np.pad(np.where(inside[:, None], steps, 0.0), ((2, 2), (0, 0)), "reflect" if len(steps) > 2 else "edge")
    far_steps = (steps > far) & inside[:, None]
    far_steps[[0, -1]] = False  # nothing shows how the body moves before and after
    frames, some = np.nonzero(far_steps)
    around = np.sort([padded[frames + k, some] for k in (0, 1, 3, 4)], axis=0)[1:3].mean(axis=0)
    sudden = steps[frames, some] > SUDDEN * around
    frames, some = frames[sudden], some[sudden]
    if not len(frames):
        return Finding(0.0)
    worst = int(steps[frames, some].argmax())
    name = body.skeleton.keys[joints[some[worst]]]
    return Finding(float(len(np.unique(frames))), int(frames[worst]) + 1, name)


def _turns(motion: Motion, joints: NDArray[np.intp]) -> Array:
    """(frames - 1, joints), how far each joint turns against its parent to the next frame [rad]."""
    rotations = motion.rotations[:, joints]
    cosine = np.abs((rotations[1:] * rotations[:-1]).sum(axis=-1))
    return np.asarray(2.0 * np.arccos(np.minimum(cosine, 1.0)))


def _still(steps: Array, frame_time: float) -> Findings:
    """Equal frames in the middle of a movement: for long, and for a few frames."""
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
    return {"frozen": Finding(frozen, first), "repeated": Finding(share, first_repeated)}


def _stretching(motion: Motion, body: Body, leg: float) -> Finding:
    """The largest change of the length of a bone from its usual one [% of leg]."""
    if motion.moving is None:
        return Finding(0.0)
    of_body = body.regions.of_joint[motion.moving.joints] >= 0
    joints = motion.moving.joints[of_body & (body.regions.of_joint[body.skeleton.parents[motion.moving.joints]] >= 0)]
    if not len(joints):
        return Finding(0.0)
    bones = lengths(motion.moving.translations[:, motion.moving.joints.searchsorted(joints)])
    changes = np.abs(bones - np.median(bones, axis=0))
    frame, bone = np.unravel_index(changes.argmax(), changes.shape)
    return Finding(100.0 * float(changes[frame, bone]) / leg, int(frame), body.skeleton.keys[joints[bone]])
