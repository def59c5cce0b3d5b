"""Target bodies for the benchmarks: a clip's own skeleton with some bones scaled, chosen by the names of the joints."""

from __future__ import annotations

import re

import numpy as np

from distretarget import Skeleton

# The part of the body that a bone belongs to, by the name of its lower joint; the first pattern that matches counts.
PARTS = {
    "hand": r"finger|thumb|index|mid|ring|pinky|metacarp|(hand|wrist)_?end",
    "foot": r"toe|metatars|(foot|ankle)_?end",
    "upper arm": r"forearm|elbow|lowerarm|lowarm",
    "forearm": r"hand|wrist",
    "shoulders": r"arm|shoulder|shldr|collar|clavicle",
    "shin": r"foot|ankle",
    "hips": r"upleg|upperleg|thigh|hip|buttock|pelvis\.",
    "thigh": r"leg|knee|shin|calf",
    "trunk": r"spine|back|abdomen|chest|neck|head|torso|waist",
}
LEGS = ("thigh", "shin", "foot")
ARMS = ("upper arm", "forearm", "hand")

# Factors on the lengths of the bones of each part; other bones keep their lengths.
TARGETS: dict[str, dict[str, float]] = {
    "spine +60 %": {"trunk": 1.6},
    "forearm and hand +50 %": {"forearm": 1.5, "hand": 1.5},
    "lower legs -30 %": {"shin": 0.7},
    "child": {**dict.fromkeys(LEGS, 0.6), **dict.fromkeys(ARMS, 0.7), "trunk": 0.85},
    "H": {"thigh": 1.5, "shin": 1.1, "hips": 1.35, "shoulders": 1.2, "upper arm": 0.7, "forearm": 0.95, "trunk": 1.15},
}
ARMS_AND_LEGS = {**dict.fromkeys(ARMS, 1.3), **dict.fromkeys(LEGS, 0.8)}


def part_of(name: str) -> str | None:
    """The part of the body that the bone above a joint belongs to, by the joint's name; None for an unknown name."""
    return next((part for part, pattern in PARTS.items() if re.search(pattern, name.lower())), None)


def edited(skeleton: Skeleton, factors: dict[str, float]) -> Skeleton:
    """The skeleton with the bones of each part scaled by its factor."""
    scale = [factors.get(part_of(name) or "", 1.0) for name in skeleton.names]
    return skeleton.with_lengths(skeleton.lengths * np.array(scale))
