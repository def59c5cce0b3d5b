"""Causes of metrics over their limits, as far as the run itself shows them in that frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from distretarget.body.anatomy import SIDES
from distretarget.ik.spg import Effort
from distretarget.matching.matching import Matching
from distretarget.measure.metrics import Metric
from distretarget.motion import Motion
from distretarget.numerics.vectors import lengths
from distretarget.objectives.supports import RESTS, Supports

STRAIGHT = 0.99  # a limb whose end is farther than this from its top is straight [lengths of the limb]
SUDDEN = 0.02  # a support sets in or lets go where its weight changes by more than this to the next frame

# The keys of metrics by possible cause
OF_REACH = (  # a limb is too short
    "skin_gap",
    "foot_skate",
    "foot_height",
    "hips_height_largest",
    "support_skate",
    "support_height",
)
OF_RESTS = ("pop", "turn")  # a joint comes to rest, or leaves its rest
OF_HOLDS = ("skin_depth",)  # a support holds the limb
OF_ALIGNMENT = ("head_tilt", "palm_turn", "sole_tilt", "heading")  # the bodies do not stand in the aligned poses


@dataclass(frozen=True)
class LimbJoints:
    """An arm or a leg of the target."""

    name: str
    top: int  # the shoulder's or the hip's joint
    end: int  # the wrist or the ankle


@dataclass(frozen=True, eq=False)
class Causes:
    """A run, searched for the causes of faults in its result."""

    motion: Motion
    matching: Matching
    supports: Supports
    effort: Effort

    def of(self, metric: Metric, frame: int, part: str) -> str:
        """Return the cause of a metric over its limit in a frame and a part, in words; empty if none is found."""
        if metric.key == "not_converged":
            return f"the solver stopped after {self.effort.iterations[frame]} steps"
        if metric.key in OF_ALIGNMENT:
            bodies = {"source": self.matching.source, "target": self.matching.target}
            lie = [name for name, body in bodies.items() if not body.stands]
            return f"nobody can stand in the rest pose of the {' or the '.join(lie)}" if lie else ""
        joint = self._joint(part)
        limb = next((one for one in self.limbs if joint is not None and self._is_below(joint, one.top)), None)
        if joint is None or limb is None:
            return ""
        if metric.key in OF_REACH and self._is_below(joint, limb.end) and self.is_straight(limb, frame):
            return f"the {limb.name} is straight and reaches no farther"
        if metric.key in OF_RESTS:
            return self._of_rests(limb, frame)
        held = (one for one in self._supports_of(limb) if self.supports.weights[frame, one] >= RESTS)
        is_held = next((f"{self._key(support)} is held where it rests" for support in held), "")
        return is_held if metric.key in OF_HOLDS else ""

    def is_straight(self, limb: LimbJoints, frame: int) -> bool:
        """Whether a limb is straight in a frame."""
        x = self.motion[frame].positions[0]
        reach = self.motion.skeleton.paths_from(limb.top)[limb.end]
        return bool(lengths(x[limb.end] - x[limb.top]) >= STRAIGHT * reach)

    def leg_of(self, support: int) -> LimbJoints | None:
        """The leg of a support; None if this is not a foot joint."""
        return self.limbs[support // 2] if support < self.supports.feet else None

    def _of_rests(self, limb: LimbJoints, frame: int) -> str:
        """Which joint of a limb comes to rest or leaves its rest at a frame, in words; empty if none does."""
        changes = np.diff(self.supports.weights[max(frame - 1, 0) : frame + 2], axis=0)
        for support in self._supports_of(limb):
            if changes[:, support].max(initial=0.0) > SUDDEN:
                return f"{self._key(support)} comes to rest"
            if changes[:, support].min(initial=0.0) < -SUDDEN:
                return f"{self._key(support)} leaves its rest"
        return ""

    def _supports_of(self, limb: LimbJoints) -> Iterator[int]:
        return (k for k, joint in enumerate(self.supports.joints.tolist()) if self._is_below(joint, limb.top))

    def _key(self, support: int) -> str:
        return self.motion.skeleton.keys[int(self.supports.joints[support])]

    def _is_below(self, joint: int, above: int) -> bool:
        return above in self.motion.skeleton.to_root(joint)

    def _joint(self, part: str) -> int | None:
        """The joint of a part; None if there is none."""
        keys = self.motion.skeleton.keys
        if part in keys:
            return keys.index(part)
        side = part.partition(" ")[0]
        return next((limb.end for limb in self.limbs if limb.name == f"{side} arm"), None)

    @cached_property
    def limbs(self) -> list[LimbJoints]:
        """The legs of the target, then its arms."""
        body, legs = self.matching.target, self.matching.legs[1] if self.matching.legs else ()
        arms = ((side, arm) for side, arm in product(SIDES, body.arms) if arm.end == body.roles.get(f"{side}Hand"))
        ends = [(f"{side} leg", leg.hip, leg.ankle) for side, leg in zip(SIDES, legs, strict=False)]
        return [LimbJoints(*each) for each in (*ends, *((f"{side} arm", arm.top, arm.end) for side, arm in arms))]
