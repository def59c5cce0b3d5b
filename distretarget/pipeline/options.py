"""The options of retargeting, checked in one place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from distretarget.baseline.engine_root import RootFollows
from distretarget.baseline.world import RootOffset
from distretarget.checks import brief_repr, check_choice, check_number
from distretarget.objectives.resting_joints import Environment
from distretarget.skeleton import AXES, LARGEST, SMALLEST

Objective = Literal["contact", "paper"]
HoldMode = Literal["hold", "feet", "free"]
SkinMode = Literal["auto", "average", "none"]
OBJECTIVES: tuple[Objective, ...] = get_args(Objective)
CHOICES: dict[str, tuple[str | None, ...]] = {
    "objective": OBJECTIVES,
    "supports": get_args(HoldMode),
    "environment": get_args(Environment),
    "skin": get_args(SkinMode),
    "source_up": (*AXES, None),
    "target_up": (*AXES, None),
    "root_offset": (*get_args(RootOffset), None),
    "root_follows": (*get_args(RootFollows), None),
}


@dataclass(frozen=True, kw_only=True, repr=False)
class Options:
    """How to retarget a clip.

    Attributes:
        objective: "contact" keeps self-contacts, supports and otherwise the source's rotations; "paper" minimises
            Eq. (2) of Mucherino, Goncalves, Bernardin, Hoyet, Multon, "A Distance-Based Approach for Human Posture
            Simulations", FedCSIS 2017.
        supports: which joints are held in place while they rest on the world: "hold", feet (foot lock) and all others;
            "feet", foot lock alone; "free", none. The paper's objective has no such term.
        environment: where rails, walls, rungs and other still objects are in the target's world, apart from the floor:
            "body", where the target's limbs meet them on average; "scaled", where they are in the source, scaled like
            the root's path.
        skin: how thick the target is, so that skin touches and does not sink in: "auto", as its mesh or the radii in
            its file show; "average", as an average body of the age that its bones show; "none", not at all, as a target
            with neither mesh nor radii: distances count from joint to joint. The paper's objective has no such term.
        root_scale: target units per source unit of the root's path; the ratio of leg lengths if not given.
        source_up: the up axis of the source's file ("Y", "-Z", ...); detected if not given (`world`).
        target_up: the up axis of the target's file.
        root_offset: whether position channels of the source's root replace its OFFSET or add to it; detected if not
            given.
        root_follows: what a root on the floor of the target follows: "pelvis", projected onto the floor; "source", the
            source's own root; or "nothing", it stays at the origin. Detected if not given (`engine_root`); no effect on
            other targets.

    Raises:
        SettingsError: a value is not one of the choices, or has the wrong type.
    """

    objective: Objective = "contact"
    supports: HoldMode = "hold"
    environment: Environment = "body"
    skin: SkinMode = "auto"
    root_scale: float | None = None
    source_up: str | None = None
    target_up: str | None = None
    root_offset: RootOffset | None = None
    root_follows: RootFollows | None = None

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        for name, choices in CHOICES.items():
            check_choice(name, getattr(self, name), choices)
        if self.root_scale is not None:
            check_number("root_scale", self.root_scale, SMALLEST, LARGEST)


DEFAULT_OPTIONS = Options()
