"""The contact objective: keeps self-contacts and supports, and otherwise the rotations of the rotation copy.

Per frame it minimises, over the rotations of a body of rigid bones and the displacement of its root,

    1/2 sum over near pairs     w r^T (k I + (1 - k) e e^T) r,    r = x_u - x_v - delta_uv       (`contact_pairs`)
  + 1/2 sum over parts          h_p |v_p|^2                                                      (`part_stiffness`)
  + 1/2 sum over resting joints r^T A_f r,                        r = x_f - place_f              (`supports`)
  + 1/2 sum over joints below   k_j depth_j^2                     the height they keep above     (`floor`)
  + 1/2                         ROOT_STIFFNESS |root - its path|^2

A pair is pulled to a difference vector, not only to a distance, so that limbs do not swap sides. In a frame without
contacts and supports the result is the rotation copy. A frame depends on a few frames around it, and on the places of
resting joints, which are averaged over about the whole rest.

A flip is a lasting change of a part's deviation from the rotation copy that is faster than `FLIP_SPEED`. Frames around
a flip get a moving average (raised cosine); spikes of one or two frames do not. Nothing is averaged across cuts.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from distretarget.body.axes import perpendicular
from distretarget.ik.articulation import Articulation
from distretarget.ik.pose_solver import CopiedBones, Workspace
from distretarget.ik.poses import Mapper, Poses, Progress, ignore_progress, solve_in_chunks, subtree_lengths
from distretarget.ik.springs import joined, room_for_springs
from distretarget.numerics.joint_paths import steps_along
from distretarget.numerics.moving import averaged
from distretarget.numerics.parallel import blocks_of
from distretarget.numerics.time_series import Shots, slices_of, widened
from distretarget.numerics.vectors import Array, Numbers, cross, lengths, normalised
from distretarget.objectives.activation import ContactSettings, SelfContact
from distretarget.objectives.clip import Clip
from distretarget.objectives.contact_pairs import ContactSearch
from distretarget.objectives.contact_terms import ContactFrames, solve_contact_frames
from distretarget.objectives.resting_joints import within_reach
from distretarget.objectives.supports import STIFFNESS as SUPPORT_STIFFNESS
from distretarget.objectives.supports import Supports, support_springs

BASE_STIFFNESS = 0.04  # of a part's rotation, per body unit of its bones
ADDED_LENGTH = 1.0  # added to the length of a part's bones, so that hands, fingers and eyes are stiff too [body units]
TRUNK_FACTOR = 40.0  # the pelvis, which carries the whole body, is this much stiffer: arms bend before the spine
END_FACTOR = 5.0  # head, hands and feet are this much stiffer than other parts: arms and legs move them to contacts
LOOSE_FACTOR = 0.1  # undriven fingers, which only the floor moves, are this much softer: they bend before the hand
FIXED_STIFFNESS = 1e6  # of joints above the pelvis, so that the body does not tip over about a root on the floor
ROOT_STIFFNESS = 300.0  # of the root's path, so that contacts and feet hardly move the hips
STRAIGHT = 0.05  # knees of the copy that bend by less than this are straight [rad] ...
SLIGHT = 0.01  # ... and are bent for the solver: thigh and shin are turned by up to this [rad]
FLIP_SPEED = 60.0 * math.radians(4.0)  # [rad/s]
HELD_FLIP_SPEED = 60.0 * math.radians(10.0)  # of parts above a joint at rest, which smoothing would move [rad/s]
BLEND = 0.15  # deviations are averaged over this time before and after a flip [s] ...
LANDING_BLEND = 0.1  # ... and over this where the floor stops a part
TOLERANCE = 1e-6  # a frame is solved when the search direction is shorter, in the metric of the curvature


def solve_contact(
    clip: Clip,
    supports: Supports,
    settings: ContactSettings,
    *,
    mapper: Mapper = map,
    progress: Progress = ignore_progress,
) -> Poses:
    """Return the poses that minimise the contact objective in every frame of a clip, solved in chunks by `mapper`;
    `progress` is called with numbers of solved frames.
    """
    margin = SelfContact.of(settings, clip.frame_time).window
    solve = partial(_solve_frames, settings=settings)
    poses = solve_in_chunks(solve, clip, within_reach(clip, supports), margin, mapper, progress)
    smooth_flips(poses.v, held_parts(clip, supports, settings), clip.shots, clip.frame_time)
    smooth_landings(poses.v, clip.loose_parts, clip.shots, clip.frame_time)
    return poses


def smooth_flips(v: Array, held: Array, shots: Shots, frame_time: float) -> None:
    """Smooth the flips of all parts in poses (frames, parts + 1, 3), in place; `held`, (frames, parts), is 1 while a
    joint below a part rests on something, blended to 0; `frame_time` is in [s].
    """
    reach = round(BLEND / frame_time)
    for shot, of_shot in ((v[frames], held[frames]) for frames in slices_of(shots)):
        parts = np.flatnonzero(_flips(shot, FLIP_SPEED * frame_time)[:, :-1].any(axis=0))
        if len(parts):
            lasting = _without_spikes(shot[:, parts])
            free, fast = (
                widened(np.maximum(flips, np.roll(flips, 1, axis=0)), reach)
                for flips in (_flips(lasting, speed * frame_time) for speed in (FLIP_SPEED, HELD_FLIP_SPEED))
            )
            share = np.maximum(fast, free * (1.0 - of_shot[:, parts]))[..., None]
            shot[:, parts] += share * (averaged(lasting, reach) - shot[:, parts])


def smooth_landings(v: Array, parts: Numbers, shots: Shots, frame_time: float) -> None:
    """Smooth the floor impacts of `parts` that only the floor moves, in poses (frames, parts + 1, 3), in place."""
    for shot in map(v.__getitem__, slices_of(shots)):
        moved = parts[shot[:, parts].any(axis=(0, 2))]
        if len(moved):
            shot[:, moved] = averaged(shot[:, moved], round(LANDING_BLEND / frame_time))


def _flips(v: Array, limit: float) -> Array:
    """(frames, parts), 1 where v, (frames, parts, 3), changes by more than `limit` [rad] to the next frame, else 0."""
    return np.pad((steps_along(v) > limit).astype(float), ((0, 1), (0, 0)))


def _without_spikes(v: Array) -> Array:
    """The geometric median of v over five frames: the deviation with the least summed distance to the others. Unlike a
    median of components it does not depend on the axes.
    """
    padded = np.pad(v, ((2, 2), (0, 0), (0, 0)), mode="edge")
    around = np.stack([padded[first : first + len(v)] for first in range(5)])
    chosen = np.argmin([lengths(around - one).sum(axis=0) for one in around], axis=0)
    return np.asarray(np.take_along_axis(around, chosen[None, ..., None], axis=0)[0])


def held_parts(clip: Clip, supports: Supports, settings: ContactSettings) -> Array:
    """Return 1 while a joint below a part rests or touches a performer or a prop, blended to 0, (frames, parts)."""
    held = np.zeros((len(clip), clip.parts.max() + 1))
    holds = [*supports.touches]
    holds += zip(supports.joints.tolist(), supports.weights.T, strict=True) if settings.foot_lock else ()
    for joint, weight in holds:
        for part in {*clip.parts[[*clip.skeleton.to_root(joint)[1:]]].tolist()}:
            np.maximum(held[:, part], weight, out=held[:, part])
    return held


def part_stiffness(clip: Clip) -> Array:
    """h: (parts + 1,), the stiffness of each part's rotation, and last that of the root's path.

    It grows with the length of a part's bones and, far more, with the share of the body's bone lengths below the part.
    Bones that lead to no driven joint, such as those of a tail, do not count in that share.
    """
    skeleton, legs, parts = clip.skeleton, clip.target_legs, clip.parts
    carrier = parts[skeleton.parents[1:]]
    carried = subtree_lengths(skeleton, clip.driven)
    share = np.divide(carried, carried[0], out=np.zeros_like(carried), where=carried[0] > 0)
    bones, largest_share = np.zeros((2, parts.max() + 1))
    np.add.at(bones, carrier, skeleton.lengths[1:] / clip.unit)
    np.maximum.at(largest_share, carrier, share[skeleton.parents[1:]])
    stiffness = BASE_STIFFNESS * (bones + ADDED_LENGTH) * (1.0 + TRUNK_FACTOR * largest_share)
    feet = {joint for leg in legs or () for joint in (leg.ankle, leg.toe)}
    ends = [joint for joint, inside in enumerate(clip.regions.inside("head", "hand")) if inside or joint in feet]
    loose = clip.loose_parts
    firm = {*parts[[joint for joint in ends if skeleton.children[joint]]].tolist()} - {*loose.tolist()}
    stiffness[[*firm]] *= END_FACTOR
    stiffness[loose] *= LOOSE_FACTOR
    if legs:
        pelvis = skeleton.common_ancestor(leg.hip for leg in legs)
        above = [joint for joint in skeleton.to_root(pelvis) if parts[joint] != parts[pelvis]]
        stiffness[parts[above]] = FIXED_STIFFNESS
    return np.append(stiffness, ROOT_STIFFNESS)


def _solve_frames(clip: Clip, supports: Supports, frames: slice, settings: ContactSettings) -> Poses:
    """Solve some frames of a clip."""
    unit = clip.unit
    body = Articulation(clip.skeleton.parents, clip.parts, part_stiffness(clip))
    contacts = ContactSearch.of(clip, settings)
    bones, root = _with_bent_knees(clip, supports), np.ascontiguousarray(clip.root / unit)
    bones /= unit
    firmness = settings.foot_lock * SUPPORT_STIFFNESS
    count = frames.stop - frames.start
    v, log = np.zeros((count, len(body.stiffness), 3)), np.zeros((4, count))
    work = Workspace.of(body)
    for solved in blocks_of(count):
        block = slice(frames.start + solved.start, frames.start + solved.stop)
        held = supports[block]
        near = contacts.near(block, held)
        held_springs = support_springs(held, body, bones[block], unit, firmness)
        springs = joined(held_springs, held.scene_springs, held.user_springs)
        room = room_for_springs(len(near.a) + len(springs.a) + len(held.floor.joints))
        given = ContactFrames(near, springs, held.floor, room)
        solve_contact_frames(body, CopiedBones(bones[block], root[block]), given, TOLERANCE, v, solved.start, log, work)
    v[:, -1] *= unit
    return Poses(v, log)


def _with_bent_knees(clip: Clip, supports: Supports) -> Array:
    """(frames, joints, 3), the bones of the rotation copy with straight knees slightly bent towards where the foot
    points, ankles in place, in legs whose foot rests elsewhere than in the copy. Otherwise no small force on the foot
    towards the hips would bend a straight leg; it would stay straight up to a larger force, and then snap.
    """
    bones = clip.copy.bones
    for support, leg in zip(range(0, supports.feet, 2), clip.target_legs or (), strict=False):
        leg_bones = [joint for joint in clip.skeleton.to_root(leg.ankle) if clip.skeleton.lengths[joint] > 0.0]
        if leg.toe == leg.ankle or len(leg_bones) < 2:
            continue
        shin, thigh, foot = (bones[:, joint] for joint in (*leg_bones[:2], leg.toe))
        off = lengths(supports.places[:, support] - clip.copy_on_path(np.array([leg.ankle]))[:, 0])
        share = supports.weights[:, support] * np.minimum(off, SLIGHT * lengths(shin))
        down = normalised(shin)
        forward = normalised(perpendicular(foot, down))
        bend = lengths(cross(normalised(thigh), down)) / STRAIGHT
        aside = (share * np.maximum(1.0 - bend**2, 0.0))[:, None] * forward
        thigh += aside
        shin -= aside
    return bones
