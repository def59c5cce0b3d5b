"""The settings of the contact objective: everything that shapes its result."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

from distretarget.body.resting import REST_HEIGHT, REST_SPEED
from distretarget.errors import SettingsError


@dataclass(frozen=True, kw_only=True)
class ContactSettings:
    """The settings of the contact objective; the default values serve every clip and body.

    Stiffness values and factors have no unit: only their ratios matter. D is the distance of two joints over the length
    of the path between them, Eq. (1); a body unit is twice the target's leg length, about its height. `docs/method.md`
    has the equations.

    Attributes:
        close: [D] up to this distance a pair of joints is kept near with full strength.
        apart: [D] from this distance on a pair is ignored; a larger value keeps more pairs, and changes the motion
            more.
        least_path: [joints] a pair needs at least this path size |P|: joints near each other along the tree make no
            contact.
        pair_stiffness: [-] stiffness of a pair at D = `close`: a larger value keeps contacts better and turns more
            bones.
        touch: [D] added to the distance that the stiffness of a pair is divided by, so that pairs that touch are at
            most `close / touch` times as stiff.
        direction_range: [body units] pairs nearer than about this keep their direction as well as their distance.
        lead: [s] a pair sets in during twice this time before a contact, and fades during twice this time after it;
            longer is smoother.
        base_stiffness: [-] stiffness of the rotation copy's rotations, per body unit of bones.
        added_length: [body units] added to the length of a part's bones, so that hands, fingers and eyes are stiff too.
        trunk_factor: [-] how much stiffer a part becomes that carries the whole body; a larger value leaves more to the
            arms.
        foot_factor: [-] how much stiffer the feet are than other parts.
        loose_factor: [-] how stiff parts are that only the floor moves, such as fingers that nothing drives, against
            others: they give way before the hand does.
        fixed_stiffness: [-] stiffness of the parts above the pelvis, so that a root on the floor does not tip the body
            over.
        root_stiffness: [-] stiffness of the root's path: a larger value keeps contacts and feet from moving the hips.
        support_stiffness: [-] stiffness of the place of a joint that rests, which comes before everything else; 0
            leaves all joints free.
        floor_stiffness: [-] stiffness with which joints are kept from going under the floor; 0 lets them.
        jump_speed: [rad/s] a part whose deviation changes faster than this (600 degrees/s) jumps from one solution to
            another.
        jump_blend: [s] a jump is replaced by a mean over this time before and after each frame; so is what only
            the floor moves.
        tolerance: [-] a frame is solved when the search direction is shorter than this in the metric of the curvature:
            nothing shakes, and cuts between chunks of a clip cannot be seen.
        rest_speed: [leg lengths/s] a joint that rests on the floor is slower than this.
        rest_height: [leg lengths] a joint that rests on the floor is no higher than this above the lowest joint.
        support_blend: [s] a joint goes to its place over twice this time before it rests, and leaves it over twice this
            time after.
        approach_speed: [leg lengths/s] a joint other than a foot takes longer where its place is far from the rotation
            copy's, so that it goes there at about this speed ...
        longest_blend: [s] ... but no longer than twice this time.

    Raises:
        SettingsError: a value is negative or not finite, zero where it divides, or two limits are in the wrong order.
    """

    close: float = 0.13
    apart: float = 0.18
    least_path: int = 5
    pair_stiffness: float = 60.0
    touch: float = 0.005
    direction_range: float = 0.08
    lead: float = 0.36
    base_stiffness: float = 0.04
    added_length: float = 1.0
    trunk_factor: float = 40.0
    foot_factor: float = 5.0
    loose_factor: float = 0.1
    fixed_stiffness: float = 1e6
    root_stiffness: float = 300.0
    support_stiffness: float = 5000.0
    floor_stiffness: float = 500.0
    jump_speed: float = 60.0 * math.radians(10.0)
    jump_blend: float = 0.1
    tolerance: float = 1e-6
    rest_speed: float = REST_SPEED
    rest_height: float = REST_HEIGHT
    support_blend: float = 0.16
    approach_speed: float = 0.5
    longest_blend: float = 0.6

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not isinstance(value, int | float) or not 0 <= value < math.inf:
                raise SettingsError(f"{name} is {value!r}; it has to be a finite number, not less than 0")
        for name in ("touch", "direction_range", "tolerance", "approach_speed"):
            if getattr(self, name) == 0:
                raise SettingsError(f"{name} is 0; it has to be more than 0")
        if not self.support_blend <= self.longest_blend:
            raise SettingsError(
                f"support_blend is {self.support_blend} and longest_blend is {self.longest_blend}; support_blend must "
                "not be more than longest_blend"
            )
        if not self.close < self.apart:
            raise SettingsError(f"close is {self.close} and apart is {self.apart}; close has to be less than apart")


DEFAULT_SETTINGS = ContactSettings()
