"""Plant visible faults in good results, and list the metrics that then go over their limits.

    python benchmarks/planted_in_results.py [CHARACTER] [--markdown FILE]

Prints a table: the fault, the metrics over their limits if it is planted in the result, and if it is planted in the
rotation copy from which the solver starts, where the solver may repair it. CHARACTER is the sample's by default.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import click
import numpy as np
from clips import HERO, SAMPLES, markdown_option
from scipy.spatial.transform import Rotation
from tables import publish, table

from distretarget import Motion, load_target, read_bvh, retarget
from distretarget.baseline.rotation_copy import RootScale
from distretarget.matching.matching import Matching
from distretarget.measure.metrics import METRICS
from distretarget.numerics.vectors import angles_between, level, normalised
from distretarget.objectives import clip
from distretarget.pipeline.result import RetargetResult

Array = np.ndarray


class Stage:
    """A result, with what planting faults needs: its motion and all frames; the joints by role and the height of the
    target [file units]; and the unit vectors up, and to the left and ahead of the body in the first frame, (3,) each.
    """

    def __init__(self, result: RetargetResult) -> None:
        self.result, self.motion, self.frames = result, result.motion, np.arange(len(result.motion))
        self.roles, self.height = result.matching.target.roles, result.matching.target.height
        legs = (self.roles[f"{side}UpperLeg"] for side in ("left", "right"))
        left, right = (self.motion.positions[0, joint] for joint in legs)
        self.up = result.world.up_vector
        self.left = normalised(level(left - right, self.up))
        self.ahead = np.cross(self.left, self.up)

    def turned(self, joint: int | str, turns: Array, frames: Array | None = None) -> Motion:
        """The motion with a joint turned in the world by rotation vectors, (3,) or (frames, 3) [degrees]."""
        joint = self.roles[joint] if isinstance(joint, str) else joint
        frames = self.frames if frames is None else frames
        world = Rotation.from_quat(self.motion.world_rotations_of(joint)[frames])
        own = Rotation.from_quat(self.motion.rotations[frames, joint])
        rotations = np.array(self.motion.rotations)
        turn = world.inv() * Rotation.from_rotvec(np.broadcast_to(turns, (len(frames), 3)), degrees=True) * world
        rotations[frames, joint] = (own * turn).as_quat()
        return replace(self.motion, rotations=rotations)

    def on(self, motion: Motion) -> Stage:
        """The stage with another motion."""
        return Stage(replace(self.result, motion=motion))

    def moved(self, by: Array) -> Motion:
        """The motion with its root moved, by (3,) or (frames, 3) [file units]."""
        return replace(self.motion, root_positions=self.motion.root_positions + by)

    def late(self, roles: tuple[str, ...], frames: int) -> Motion:
        """The motion with the rotations of some joints delayed by a number of frames."""
        rotations, before = np.array(self.motion.rotations), np.maximum(self.frames - frames, 0)
        for role in roles:
            rotations[:, self.roles[role]] = rotations[before, self.roles[role]]
        return replace(self.motion, rotations=rotations)

    def hand_moved(self, side: str, by: Array) -> Motion:
        """The motion with a hand moved by (3,) [file units], by shoulder and elbow; its world rotation stays."""
        stage, hand = self, self.roles[f"{side}Hand"]
        goal = self.motion.positions[:, hand] + by
        rotation = Rotation.from_quat(self.motion.world_rotations_of(hand))
        for role in ("LowerArm", "UpperArm") * 12:
            at, end = (stage.motion.positions[:, joint] for joint in (self.roles[side + role], hand))
            axis, angle = np.cross(end - at, goal - at), angles_between(end - at, goal - at)
            stage = stage.on(stage.turned(side + role, np.degrees(angle)[:, None] * normalised(axis)))
        world = Rotation.from_quat(stage.motion.world_rotations_of(hand))
        return stage.turned(hand, (rotation * world.inv()).as_rotvec(degrees=True))

    def crouched(self, degrees: float) -> Motion:
        """The motion with knees more bent, and hips lower so that the ankles stay in place."""
        stage, ankles = self, [self.roles[f"{side}Foot"] for side in ("left", "right")]
        for side in ("left", "right"):
            for part, share in (("UpperLeg", -1.0), ("LowerLeg", 2.0), ("Foot", -1.0)):
                stage = stage.on(stage.turned(f"{side}{part}", share * degrees * self.left))
        lower = (stage.motion.positions[:, ankles] - self.motion.positions[:, ankles]).mean(axis=1)
        return stage.moved(-lower)

    def mirrored(self) -> Motion:
        """The motion with rotations of left and right limbs exchanged, for rest poses that are symmetric."""
        rotations = np.array(self.motion.rotations)
        across = np.array([1.0, -1.0, -1.0, 1.0])  # mirrored across the plane between left and right, X to the left
        for role, joint in self.roles.items():
            other = role.replace("left", "?").replace("right", "left").replace("?", "right")
            rotations[:, joint] = self.motion.rotations[:, self.roles[other]] * across
        return replace(self.motion, rotations=rotations)


def _shaking(stage: Stage, degrees: float) -> Array:
    """Rotation vectors of one angle about random axes, (frames, 3) [degrees]."""
    axes = np.random.default_rng(1).normal(size=(len(stage.motion), 3))
    return degrees * axes / np.linalg.norm(axes, axis=1)[:, None]


def _along_floor(stage: Stage, share: float) -> Motion:
    """The motion with a share of the path along the floor."""
    path = stage.motion.positions[:, stage.roles["hips"]]
    return stage.moved((share - 1.0) * level(path - path[0], stage.up))


Fault = tuple[str, Callable[[Stage], Motion]]
"""A clip, and a function that plants a fault in its result."""
ARM = ("Shoulder", "UpperArm", "LowerArm", "Hand")
FAULTS: dict[str, Fault] = {
    "root 3 % of height lower": ("walk", lambda s: s.moved(-0.03 * s.height * s.up)),
    "root 2 % of height higher": ("walk", lambda s: s.moved(0.02 * s.height * s.up)),
    "a foot's toes 20 degrees up": ("squat", lambda s: s.turned("leftFoot", -20.0 * s.left)),
    "a foot 20 degrees on its edge": ("squat", lambda s: s.turned("leftFoot", 20.0 * s.ahead)),
    "a foot points 20 degrees aside": ("squat", lambda s: s.turned("leftFoot", 20.0 * s.up)),
    "a hand's contact 5 % of height aside": (
        "hands_on_hips",
        lambda s: s.hand_moved("right", -0.05 * s.height * s.left),
    ),
    "a contact 5 frames late": ("clap", lambda s: s.late(tuple(f"right{part}" for part in ARM), 5)),
    "an upper arm 4 % of height in the trunk": ("walk", lambda s: s.turned("leftUpperArm", -18.0 * s.ahead)),
    "a hand 3 % of height in the belly": ("hands_on_hips", lambda s: s.hand_moved("left", -0.03 * s.height * s.left)),
    "a head 30 degrees down": ("squat", lambda s: s.turned("head", 30.0 * s.left)),
    "a pop of an elbow": (
        "wave",
        lambda s: s.turned("leftLowerArm", 40.0 * s.ahead, s.frames[len(s.motion) // 2 :][:1]),
    ),
    "jitter of 0.5 degrees in a contact": ("hands_on_hips", lambda s: s.turned("leftUpperArm", _shaking(s, 0.5))),
    "left and right exchanged": ("wave", lambda s: s.mirrored()),
    "half the path": ("walk", lambda s: _along_floor(s, 0.5)),
    "a drift of 0.1 leg lengths a second": (
        "squat",
        lambda s: s.moved(np.outer(s.frames * s.motion.frame_time, 0.05 * s.height * s.left)),
    ),
    "a crouch": ("squat", lambda s: s.crouched(15.0)),
    "palms turned by 90 degrees": ("clap", lambda s: s.turned("rightHand", 90.0 * s.up)),
    "a trunk that leans by 20 degrees": ("wave", lambda s: s.turned("spine", 20.0 * s.left)),
    "an arm 25 degrees out without need": ("walk", lambda s: s.turned("leftUpperArm", 25.0 * s.ahead)),
    "legs 10 degrees apart": ("walk", lambda s: s.turned("leftUpperLeg", 10.0 * s.ahead)),
    "legs that pass through each other": ("squat", lambda s: s.turned("leftUpperLeg", -14.0 * s.ahead)),
    "hips that shake": ("walk", lambda s: s.moved(np.outer(0.003 * s.height * (-1.0) ** (s.frames // 2), s.left))),
}


@cache
def stage_of(character: Path, sample: str) -> Stage:
    """The result of a sample on a character."""
    return Stage(retarget(read_bvh(SAMPLES / f"{sample}.bvh"), load_target(character)))


def newly_over(result: RetargetResult, before: RetargetResult) -> set[str]:
    """The keys of metrics over their limits in a result that were within them before, or less than half as large."""
    values, earlier = (each.metrics["result"] for each in (result, before))
    over = {metric.key for metric in METRICS if metric.over_limit(result.metrics)}
    known = {metric.key for metric in METRICS if metric.over_limit(before.metrics)}
    return {key for key in over if key not in known or values[key] > 2.0 * earlier[key]}


def seen(character: Path, fault: Fault) -> set[str]:
    """The keys of metrics that go over their limits if a fault is planted in a result."""
    sample, plant = fault
    stage = stage_of(character, sample)
    return newly_over(replace(stage.result, motion=plant(stage)), stage.result)


def seen_of_solver(character: Path, fault: Fault) -> set[str]:
    """The same if the fault is planted in the rotation copy from which the solver starts."""
    (sample, plant), right = fault, clip.rotation_copy
    stage = stage_of(character, sample)

    def wrong(matching: Matching, scale: RootScale) -> Motion:
        match = replace(stage.result.baseline.match, matching=matching)
        baseline = replace(stage.result.baseline, match=match)
        return plant(Stage(replace(stage.result, baseline=baseline, motion=right(matching, scale))))

    clip.rotation_copy = wrong
    try:
        return newly_over(retarget(read_bvh(SAMPLES / f"{sample}.bvh"), load_target(character)), stage.result)
    finally:
        clip.rotation_copy = right


@click.command(help=__doc__)
@click.argument("character", type=click.Path(exists=True, path_type=Path), default=HERO)
@markdown_option
def main(character: Path, page: Path | None) -> None:
    """Print the table."""
    rows = [
        (name, *map(_listed, (seen(character, fault), seen_of_solver(character, fault))))
        for name, fault in FAULTS.items()
    ]
    publish({"planted in results": table(("fault", "in the result", "in the rotation copy"), rows)}, page)


def _listed(keys: set[str]) -> str:
    """Keys in the order of the registry; a dash for none."""
    return ", ".join(f"`{metric.key}`" for metric in METRICS if metric.key in keys) or "-"


if __name__ == "__main__":
    main()
