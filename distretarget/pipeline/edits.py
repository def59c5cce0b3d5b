"""Edits of a clip before it is retargeted: trimmed, at another speed, mirrored, turned, and as a loop."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.transform import Rotation

from distretarget.body.anatomy import SIDES, opposite
from distretarget.body.axes import AHEAD, axis_vector, nearest_axis, perpendicular
from distretarget.body.body import Body
from distretarget.checks import brief_repr, check_kind, check_number
from distretarget.errors import MotionError, SettingsError
from distretarget.motion import Motion
from distretarget.numerics.vectors import Array, Numbers, lengths, normalised
from distretarget.skeleton import Skeleton

SAME = 1e-9  # bones whose mirrored directions differ by less are the same
SEAM = 0.3  # a loop is bent for this long before and after its seam, or for a third of its length if that is less [s]
# The path of a loop closes if the body ends this near to where it began, facing about the same way.
STAYS = 0.5  # [leg lengths]
FACES = 45.0  # [degrees]
SAME_TIME = 0.1  # times that differ by less are the same, as files round the time between frames [frames]
LONGEST = 1e6  # [s]
SPEEDS = (1e-3, 1e3)  # the lowest and the highest
MOST_TURN = 3600.0  # ten times round [degrees]
Time = float | str
"""A time of a clip [s], or the number of a frame, from 0 on, as in "90f"."""


def mirrored(motion: Motion, across: Array | None = None) -> Motion:
    """Return a motion as in an upright mirror through the origin: each joint moves as its partner on the other side.

    `across`, (3,), is the unit vector along which the world is mirrored; by default the left of the body's rest pose.

    Partners are found by the anatomy, and else by positions in the rest pose. A joint without one keeps its rotations.
    On bodies whose sides differ, bones have the mirrored directions of their partners. Mirrored twice, a motion is the
    same.

    Raises:
        MotionError: no human body is recognised, so that left and right are unknown.
    """
    body, skeleton = Body.of_motion(motion), motion.skeleton
    if not len(motion):
        return motion
    roles = _roles(body, skeleton)
    left = _left(skeleton, roles)
    across = normalised(perpendicular(left, body.up_vector)) if across is None else across
    in_rest, in_world = _reflection(left), _reflection(across)
    partners = find_partners(skeleton, roles, in_rest)
    before, local = _matrices(motion.world_rotations), _matrices(motion.rotations)
    world = np.zeros_like(before)
    for joint, partner in enumerate(partners.tolist()):
        parent = skeleton.parents[joint]
        if partner < 0:
            world[:, joint] = world[:, parent] @ local[:, joint]
        else:
            world[:, joint] = in_world @ before[:, partner] @ in_rest @ _to_partner(skeleton, joint, partners, in_rest)
            local[:, joint] = np.swapaxes(world[:, parent], 1, 2) @ world[:, joint] if joint else world[:, joint]
    rotations = Rotation.from_matrix(local.reshape(-1, 3, 3)).as_quat().reshape(motion.rotations.shape)
    translations = motion.translations
    moved = translations.copy()
    moved[:, 0] = translations[:, 0] @ in_world
    if motion.moving is not None:
        for joint, partner in enumerate(partners):
            if joint and partner >= 0:
                stretch = (translations[:, partner] - skeleton.offsets[partner]) @ in_rest
                moved[:, joint] = skeleton.offsets[joint] + stretch
    return Motion.of_translations(skeleton, moved, rotations, motion.frame_time_text)


def _matrices(rotations: Array) -> Array:
    """(frames, joints, 3, 3), rotations, (frames, joints, 4), as matrices."""
    return np.asarray(Rotation.from_quat(rotations.reshape(-1, 4)).as_matrix().reshape(*rotations.shape[:2], 3, 3))


def find_partners(skeleton: Skeleton, roles: Mapping[str, int], reflection: Array) -> Numbers:
    """Return the joint on the other side of each joint, itself in the middle, and -1 where there is none, (joints,).
    `roles` are the known joints, and `reflection`, (3, 3), exchanges the sides of the rest pose.
    """
    other = {joint: roles.get(opposite(role)) for role, joint in roles.items()}
    rest, partners = skeleton.rest_positions, np.full(len(skeleton), -1)
    middles = np.array([rest[[*skeleton.subtree(joint)]].mean(axis=0) for joint in range(len(skeleton))])
    partners[0] = 0
    for joint in range(len(skeleton)):
        partner = partners[joint]
        if partner < joint:  # none, or found with its partner
            continue
        one, two = (list(skeleton.children[each]) for each in (joint, partner))
        if not one or not two:
            continue
        places = [middles[each] - rest[at] for each, at in ((one, joint), (two, partner))]
        off = lengths(places[0][:, None] @ reflection - places[1][None])
        for i, a in enumerate(one):
            for k, b in enumerate(two):
                if other.get(a, b) != b or other.get(b, a) != a:
                    off[i, k] = skeleton.longest_path * 1e3
        for own, others in zip(*linear_sum_assignment(off), strict=True):
            if off[own, others] < skeleton.longest_path:
                partners[one[own]], partners[two[others]] = two[others], one[own]
    return partners


def _roles(body: Body, skeleton: Skeleton) -> dict[str, int]:
    """The joints of a skeleton, by their roles in its body."""
    numbers = {key: joint for joint, key in enumerate(skeleton.keys)}
    return {role: numbers[body.skeleton.keys[joint]] for role, joint in body.roles.items()}


def _left(skeleton: Skeleton, roles: Mapping[str, int]) -> Array:
    """(3,), the unit vector to the left of a body in its rest pose, by paired joints; a MotionError without these."""
    rest, across = skeleton.rest_positions, np.zeros(3)
    for role, joint in roles.items():
        if role.startswith(SIDES[0]) and opposite(role) in roles:
            across += rest[joint] - rest[roles[opposite(role)]]
    if not across.any():
        raise MotionError("shows no human body, so that there is no left and right to exchange")
    axis, cosine = nearest_axis(normalised(across))
    return axis_vector(axis) if cosine > AHEAD else normalised(across)


def _reflection(normal: Array) -> Array:
    """(3, 3), the reflection at the plane through the origin with a unit normal, (3,)."""
    return np.asarray(np.eye(3) - 2.0 * np.outer(normal, normal))


def _to_partner(skeleton: Skeleton, joint: int, partners: Numbers, reflection: Array) -> Array:
    """(3, 3), the rotation of a joint in the rest pose that turns its bones to the mirrored ones of its partner."""
    below = [child for child in skeleton.children[joint] if partners[child] >= 0]
    own = normalised(skeleton.offsets[below])
    goal = normalised(skeleton.offsets[partners[below]]) @ reflection
    known = own.any(axis=1) & goal.any(axis=1)
    if not known.any() or np.abs(own - goal)[known].max() < SAME:
        return np.eye(3)
    return np.asarray(Rotation.align_vectors(goal[known], own[known])[0].as_matrix())


@dataclass(frozen=True, kw_only=True, repr=False)
class Edits:
    """Edits of a clip, in the order in which they are made.

    Attributes:
        start: the start of the part that is kept; None for that of the clip.
        end: the end of the part that is kept; None for that of the clip.
        speed: how many times as fast it is.
        mirror: whether left and right are exchanged.
        turn: to the left about the vertical through the origin [degrees].
        loop: whether its end leads to its start.

    Raises:
        SettingsError: a value has the wrong type, or is out of bounds.
    """

    start: Time | None = None
    end: Time | None = None
    speed: float = 1.0
    mirror: bool = False
    turn: float = 0.0
    loop: bool = False

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        for name in ("start", "end"):
            if getattr(self, name) is not None:
                _seconds(name, getattr(self, name), 1.0)
        check_number("speed", self.speed, *SPEEDS)
        check_number("turn", self.turn, -MOST_TURN, MOST_TURN)
        for name in ("mirror", "loop"):
            check_kind(name, getattr(self, name), bool)

    def of(self, motion: Motion) -> Motion:
        """Return the edited motion; errors as in the functions."""
        return self.together([motion])[0]

    def together(self, performers: Sequence[Motion], props: Sequence[Motion] = ()) -> list[Motion]:
        """Return the edited motions of performers, then of props, in one world: mirrored and turned like the first,
        with loops of its `carry`; props of one frame are only turned. A SettingsError if props are to be mirrored.
        """
        if self.mirror and props:
            raise SettingsError("props have no left and right to mirror; leave out mirror, or the props")
        motions = [*performers, *props]
        moving = [k < len(performers) or len(motion) > 1 for k, motion in enumerate(motions)]

        def over_time(edit: Callable[[Motion], Motion]) -> list[Motion]:
            return [edit(motion) if moves else motion for motion, moves in zip(motions, moving, strict=True)]

        motions = over_time(partial(trimmed, start=self.start, end=self.end))
        if self.speed != 1.0:
            motions = over_time(partial(at_speed, factor=self.speed))
        if self.mirror:
            body, skeleton = Body.of_motion(motions[0]), motions[0].skeleton
            left = _left(skeleton, _roles(body, skeleton))
            motions = over_time(partial(mirrored, across=normalised(perpendicular(left, body.up_vector))))
        if self.turn:
            up = Body.of_motion(motions[0]).up_vector
            motions = [turned(motion, self.turn, up) for motion in motions]
        if self.loop:
            motions = over_time(partial(looped, carry=carry_of(motions[0])))
        return motions

    def of_values(self, values_at: Callable[[Array], Array], frames: int, frame_time: float) -> Array:
        """Values, (frames, n), along an edited motion; `values_at` gives those at times of the clip, (frames,) [s]."""
        first = 0 if self.start is None else _first_frame(_seconds("start", self.start, frame_time), frame_time)
        values = values_at(frame_time * (first + self.speed * np.arange(frames, dtype=float)))
        if not self.loop:
            return values
        steps = np.stack([values[-1] - values[-2], values[1] - values[0]])
        return np.asarray(values + _bends(values[0] - values[-1], steps, _seam(frames, frame_time), frames))


NO_EDITS = Edits()


def trimmed(motion: Motion, start: Time | None = None, end: Time | None = None) -> Motion:
    """Return the frames of a motion from `start` to `end`, both included; None for its own.

    Raises:
        MotionError: it has no frame there.
        SettingsError: `start` or `end` is no time.
    """
    if start is None and end is None:
        return motion
    last = (len(motion) - 1) * motion.frame_time
    first = 0.0 if start is None else _seconds("start", start, motion.frame_time)
    stop = last if end is None else _seconds("end", end, motion.frame_time)
    some = motion[_first_frame(first, motion.frame_time) : int(np.floor(stop / motion.frame_time + SAME_TIME)) + 1]
    if not len(some):
        raise MotionError(f"has no frame from {first:g} to {stop:g} s; it lasts {max(last, 0.0):g} s")
    return some


def _first_frame(time: float, frame_time: float) -> int:
    """The first frame from a time on [s]."""
    return max(int(np.ceil(time / frame_time - SAME_TIME)), 0)


def _seconds(name: str, time: Time, frame_time: float) -> float:
    text = str(time).strip()
    is_frame = text.endswith("f") and text[:-1].isdecimal()
    try:
        seconds = int(text[:-1]) * frame_time if is_frame else float(text)
    except ValueError:
        seconds = np.nan
    if isinstance(time, bool) or not 0.0 <= seconds <= LONGEST:
        raise SettingsError(f"{name} is {time!r}; expected seconds from 0, or the number of a frame, such as '90f'")
    return seconds


def at_speed(motion: Motion, factor: float) -> Motion:
    """Return a motion that is `factor` times as fast, with the same time between frames.

    Raises:
        MotionError: it would have far more frames than it has.
        SettingsError: the factor is out of bounds.
    """
    check_number("factor", factor, *SPEEDS)
    faster = replace(motion, frame_time_text=f"{motion.frame_time / factor:.9g}")
    return faster.resampled(motion.frame_time_text)


def turned(motion: Motion, degrees: float, up: Array | None = None) -> Motion:
    """Return a motion turned to the left about the vertical through the origin: about `up`, (3,), or the body's own."""
    up = Body.of_motion(motion).up_vector if up is None else up
    return motion.rotated_about_origin(Rotation.from_rotvec(np.radians(degrees) * up))


Carry = tuple[Rotation, Array]
"""The turn and the shift, (3,), that carry one round of a loop to the next: about the vertical, and along the floor."""


def looped(motion: Motion, carry: Carry | None = None) -> Motion:
    """Return a motion whose last frame leads to its first without a jump: near both ends, poses and speeds are blended
    to the means of the two ends.

    From round to round the body is moved and turned by `carry`, that of another motion or by default its own.

    Raises:
        MotionError: it has under four frames.
    """
    if len(motion) < 4:
        raise MotionError(f"has {len(motion)} frames; a loop takes at least 4")
    on = carry_of(motion) if carry is None else carry
    count = len(motion)
    seam = _seam(count, motion.frame_time)
    rotations = [Rotation.from_quat(motion.rotations[:, joint]) for joint in range(len(motion.skeleton))]
    translations = np.swapaxes(motion.translations, 0, 1).copy()
    for joint, turns in enumerate(rotations):
        turn = on[0] if joint == 0 else Rotation.identity()
        ahead = turn * turns[[0, 1]]  # the next round
        off = (turns[-1].inv() * ahead[0]).as_rotvec()
        speeds = np.stack([(turns[-2].inv() * turns[-1]).as_rotvec(), (ahead[0].inv() * ahead[1]).as_rotvec()])
        bend = _bends(off, speeds, seam, count)
        rotations[joint] = turns * Rotation.from_rotvec(bend)
        moves = translations[joint]
        next_round = on[0].apply(moves[:2]) + on[1] if joint == 0 else moves[:2]
        steps = np.stack([moves[-1] - moves[-2], next_round[1] - next_round[0]])
        bend = _bends(next_round[0] - moves[-1], steps, seam, count)
        if joint == 0:
            bend[: count // 2] = on[0].inv().apply(bend[: count // 2])
        translations[joint] = moves + bend
    quaternions = np.stack([turns.as_quat() for turns in rotations], axis=1)
    return Motion.of_translations(motion.skeleton, np.swapaxes(translations, 0, 1), quaternions, motion.frame_time_text)


def _seam(frames: int, frame_time: float) -> int:
    """The number of frames that a loop is bent for on each side of its seam."""
    return min(round(SEAM / frame_time), frames // 3)


def _bends(off: Array, speeds: Array, seam: int, frames: int) -> Array:
    """(frames, n), offsets that make the step to the next round, `off`, (n,), the mean of the steps around it,
    `speeds`, (2, n). Each side takes half of the surplus, and half of the change of speed, and both fade smoothly.
    """
    usual = speeds.mean(axis=0)
    gap, jump = 0.5 * (off - usual), 0.5 * (speeds[1] - speeds[0])
    t = np.arange(seam) / max(seam, 1)
    place = (1.0 - t) ** 3 * (1.0 + 3.0 * t + 6.0 * t**2)  # 1 at the seam, and 0 with its derivatives at its end
    speed = seam * t * (1.0 - t) ** 3 * (1.0 + 3.0 * t)  # of slope 1 a frame at the seam
    fades = np.outer(place, gap), np.outer(speed, jump)
    bends = np.zeros((frames, len(off)))
    bends[:seam] = -fades[0] - fades[1]
    bends[frames - seam :] = (fades[0] - fades[1])[::-1]
    return bends


def carry_of(motion: Motion) -> Carry:
    """Return the carry of a motion to its next round; none if it ends about where and how it began."""
    body = Body.of_motion(motion)
    up = body.up_vector
    first, last = (Rotation.from_quat(motion.rotations[frame, 0]) for frame in (0, -1))
    vector = (last * first.inv()).as_rotvec()
    heading = vector @ up
    shift = motion.root_positions[-1] - motion.root_positions[0]
    shift = shift - (shift @ up) * up
    if lengths(shift) < STAYS * body.leg and abs(np.degrees(heading)) < FACES:
        return Rotation.identity(), np.zeros(3)
    turn = Rotation.from_rotvec(heading * up)
    place = np.array(motion.root_positions[0])
    return turn, place + shift - turn.apply(place)
