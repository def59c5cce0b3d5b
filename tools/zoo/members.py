"""The members of the zoo, each with its traits, and the skeleton that has them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache

from distretarget.skeleton import Skeleton
from zoo.build import Build, with_build
from zoo.conventions import NAMING, Convention, adult
from zoo.feet import FEET, Foot, standing
from zoo.hands import Fingers, with_fingers
from zoo.helpers import HELPERS, Helper
from zoo.poses import Pose, posed
from zoo.roots import ROOTS, Root


@dataclass(frozen=True, kw_only=True)
class Member:
    """The traits of a body; by default an adult with flat feet, without fingers, hips the root.

    Attributes:
        convention: which gives the joints their names, and the rotation channels their order.
        pose: the rest pose.
        builds: the proportions that differ from an adult's.
        foot, fingers, root: their shapes.
        helpers: joints that are no part of the body.
        up: the axis that points up; a body with "Z" faces -Y.
    """

    convention: Convention
    pose: Pose = "T"
    builds: tuple[Build, ...] = ()
    foot: Foot = "flat"
    fingers: Fingers = "none"
    root: Root = "hips"
    helpers: tuple[Helper, ...] = ()
    up: str = "Y"


MEMBERS: Mapping[str, Member] = {
    "mixamo": Member(convention="mixamo", fingers="five"),
    "xsens": Member(convention="xsens", pose="A"),
    "lafan1": Member(convention="lafan1", pose="X"),
    "cmu": Member(convention="cmu"),
    "bandai": Member(convention="bandai", pose="A", root="floor"),
    "unreal": Member(
        convention="unreal", pose="A", fingers="metacarpals", root="floor", helpers=("twist", "ik"), up="Z"
    ),
    "arms_down": Member(convention="xsens", pose="I"),
    "heels": Member(convention="xsens", foot="high ankle"),
    "heel_bones": Member(convention="mixamo", pose="A", foot="heel bone"),
    "tiptoe": Member(convention="cmu", foot="toes down"),
    "no_toes": Member(convention="lafan1", pose="A", foot="no toe"),
    "five_toes": Member(convention="unreal", foot="five toes", fingers="five", up="Z"),
    "three_fingers": Member(convention="cmu", pose="I", fingers="three"),
    "twisted": Member(convention="lafan1", helpers=("twist",)),
    "kimono": Member(convention="bandai", root="floor", helpers=("sleeves", "skirt")),
    "swordsman": Member(convention="mixamo", pose="I", fingers="five", helpers=("sword", "hair")),
    "puppet": Member(convention="lafan1", pose="A", root="above"),
    "centre_of_mass": Member(convention="xsens", root="offset child"),
    "child": Member(convention="mixamo", builds=("child",)),
    "giant": Member(convention="lafan1", pose="X", builds=("giant",)),
    "short_arms": Member(convention="cmu", pose="A", builds=("short arms",)),
    "wide_hips": Member(convention="xsens", builds=("wide hips",)),
    "thin": Member(convention="bandai", pose="I", builds=("thin",), root="floor"),
    "mouse": Member(
        convention="mixamo", builds=("big head", "short legs", "wide hips"), foot="high ankle", fingers="three"
    ),
    "samurai": Member(
        convention="unreal",
        pose="A",
        builds=("giant", "short arms"),
        fingers="five",
        root="floor",
        helpers=("twist", "sleeves", "skirt", "hair", "sword", "ik"),
        up="Z",
    ),
}


@cache
def member(name: str) -> Skeleton:
    """The skeleton of a member of the zoo [cm]."""
    return skeleton_of(MEMBERS[name])


def skeleton_of(traits: Member) -> Skeleton:
    """The skeleton with these traits [cm]; the root's OFFSET puts its feet on the floor."""
    naming = NAMING[traits.convention]
    body = adult(traits.convention)
    for build in traits.builds:
        body = with_build(body, build)
    body = FEET[traits.foot](with_fingers(body, traits.fingers, naming), naming)
    body = ROOTS[traits.root](posed(standing(body), traits.pose), naming)
    for helper in traits.helpers:
        body = HELPERS[helper](body, naming)
    return _z_up(body) if traits.up == "Z" else body


def _z_up(skeleton: Skeleton) -> Skeleton:
    """The body turned from Y up, facing +Z, to Z up, facing -Y."""
    return replace(skeleton, offsets=skeleton.offsets[:, [0, 2, 1]] * (1, -1, 1), up="Z")
