"""Plant faults in clean clips, and count how often `distretarget audit` finds each.

    python benchmarks/planted_faults.py FOLDER ...

Each fault is planted in turn in all clips of people with 200 frames or more and no faults of their own. Prints a table:
the fault, the kind as which it should be found, and in how many clips it is.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget import Body, DistretargetError, read_bvh
from distretarget.measure.clip_faults import KINDS, Finding, find_faults
from distretarget.motion import MovingBones

sys.path.append(str(Path(__file__).resolve().parents[1] / "tools"))
from tables import table

LEAST = 200  # frames


def faults_of(motion):
    """The faults of a motion, by kind."""
    found = find_faults(motion)
    return {kind: each for kind, each in found.items() if each.value > KINDS[kind].limit}


def moved(motion, by):
    """The motion with its root moved by (frames, 3) [half body units, about leg lengths]."""
    return replace(motion, root_positions=motion.root_positions + 0.5 * Body.of_motion(motion).unit * by)


def turned(motion, role, degrees, frames):
    """The motion with the joint of a role turned in some frames."""
    joint, rotations = Body.of_motion(motion).roles[role], np.array(motion.rotations)
    rotations[frames, joint] = (
        Rotation.from_quat(rotations[frames, joint]) * Rotation.from_euler("XYZ", degrees, degrees=True)
    ).as_quat()
    return replace(motion, rotations=rotations)


def first_frames_in_rest_pose(motion, count=1):
    rotations = np.array(motion.rotations)
    rotations[:count] = [0.0, 0.0, 0.0, 1.0]
    path = np.array(motion.root_positions)
    path[:count] = [25.0 * Body.of_motion(motion).unit, path[0, 1], 0.0]
    return replace(motion, rotations=rotations, root_positions=path)


def at(motion, share):
    return int(share * len(motion))


def step_at(motion, share, vector):
    return np.where(np.arange(len(motion))[:, None] >= at(motion, share), vector, 0.0)


def dip(motion, seconds):
    """A bump, (frames, 1): 0, for some time up to 1 and back, and 0."""
    frames = round(seconds / motion.frame_time)
    path = np.zeros((len(motion), 1))
    path[60 : 60 + frames, 0] = np.hanning(frames)
    return path


def frames_of(motion, numbers):
    return motion[np.asarray(numbers, np.intp)]


def busiest(motion):
    """The frame before the largest steps."""
    steps = np.linalg.norm(np.diff(motion.positions, axis=0), axis=-1).mean(axis=1)
    return int(steps[10:-10].argmax()) + 10


def held_at(motion, seconds):
    here = busiest(motion)
    again = np.full(round(seconds / motion.frame_time), here)
    return frames_of(motion, [*range(here), *again, *range(here, len(motion))])


def stretched(motion):
    joint = Body.of_motion(motion).roles["leftHand"]
    bones = np.tile(motion.skeleton.offsets[joint], (len(motion), 1, 1))
    bones *= np.linspace(1.0, 1.3, len(motion))[:, None, None]
    return replace(motion, moving=MovingBones(np.array([joint]), bones))


def tip(degrees):
    """A rotation of the world about X; 90 degrees are as in a file with Z up in its data and Y up in its skeleton."""
    return Rotation.from_euler("x", degrees, degrees=True)


def mirrored_names(motion):
    swap = {"Left": "Right", "Right": "Left", "l": "r", "r": "l"}
    names = tuple(
        next((other + name[len(side) :] for side, other in swap.items() if name.startswith(side)), name)
        for name in motion.skeleton.names
    )
    return replace(motion, skeleton=replace(motion.skeleton, names=names))


PLANTED = {
    "T-pose in the first frame": ("first_pose", first_frames_in_rest_pose),
    "T-pose in the first five frames": ("first_pose", lambda m: first_frames_in_rest_pose(m, 5)),
    "a cut": ("cuts", lambda m: moved(m, step_at(m, 0.5, [0.8, 0.0, 0.3]))),
    "another place for a second": (
        "cuts",
        lambda m: moved(m, step_at(m, 0.5, [0.5, 0.0, 0.0]) - step_at(m, 0.8, [0.5, 0.0, 0.0])),
    ),
    "frames missing": (
        "cuts",
        lambda m: frames_of(
            moved(m, np.linspace([0.0] * 3, [2.0, 0.0, 0.0], len(m))), [*range(40), *range(150, len(m))]
        ),
    ),
    "an arm that leaps for a frame": ("jumps", lambda m: turned(m, "leftUpperArm", [0, 0, 50], at(m, 0.5))),
    "an arm that jumps and stays": ("jumps", lambda m: turned(m, "rightUpperArm", [0, 40, 0], slice(at(m, 0.6), None))),
    "a leg that leaps for a frame": ("jumps", lambda m: turned(m, "leftUpperLeg", [30, 0, 0], at(m, 0.4))),
    "a wrist that turns over": ("flips", lambda m: turned(m, "leftHand", [180, 0, 0], slice(at(m, 0.5), None))),
    "a head that turns round for a frame": ("flips", lambda m: turned(m, "head", [0, 180, 0], at(m, 0.3))),
    "half a second frozen": ("frozen", lambda m: held_at(m, 0.5)),
    "the last frame repeated to the end": ("frozen", lambda m: frames_of(m, [*range(busiest(m)), *[busiest(m)] * 60])),
    "every other frame repeated": ("repeated", lambda m: frames_of(m, np.arange(len(m)) // 2 * 2)),
    "a drift along the floor": (
        "skating",
        lambda m: moved(m, np.arange(len(m))[:, None] * m.frame_time * (np.ones(3) - Body.of_motion(m).up_vector)),
    ),
    "sunk into the floor for a while": (
        "below_floor",
        lambda m: moved(m, -dip(m, 0.6) * 0.25 * Body.of_motion(m).up_vector),
    ),
    "a path in another unit": ("off_floor", lambda m: replace(m, root_positions=100.0 * m.root_positions)),
    "a bone that stretches": ("stretching", stretched),
    "data with another axis up": ("up_axis", lambda m: m.rotated_about_origin(tip(90))),
    "a world tilted by 40 degrees": ("tilt", lambda m: m.rotated_about_origin(tip(40))),
    "left and right exchanged": ("sides", mirrored_names),
    "a single frame": ("unreadable", lambda m: m[:1]),
}


def clean_clips(folders):
    """Yield the motions of people in some folders that have no faults, without poses before the motion begins."""
    for path in sorted(path for folder in folders for path in Path(folder).rglob("*.bvh")):
        try:
            motion = read_bvh(path)
        except DistretargetError:
            continue
        if len(motion) < LEAST or Body.of_motion(motion).anatomy is None:
            continue
        begins = 2 * int(faults_of(motion).get("first_pose", Finding(0)).value)
        if not faults_of(motion[begins:]):
            yield motion[begins:]


def main():
    """Print the table."""
    clips = list(clean_clips(sys.argv[1:]))
    rows = []
    for fault, (kind, plant) in PLANTED.items():
        count = sum(kind in faults_of(plant(clip)) for clip in clips)
        rows.append((fault, f"`{kind}`", f"{count} of {len(clips)}"))
    print(table(("planted", "found as", "clips"), rows), end="")


if __name__ == "__main__":
    main()
