"""A scene: performers and props, and the contacts between them. Contacts of two performers are pairs of joints that
come near each other. A joint that touches a prop is drawn to where the placement of the prop takes its driver.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations, takewhile

import numpy as np
from scipy.spatial.transform import Rotation

from distretarget.baseline.rotation_copy import RootScale
from distretarget.body.anatomy import TRUNK_REGIONS
from distretarget.body.resting import REST_HEIGHT, REST_SPEED, joint_speeds
from distretarget.ik.springs import Springs, joined, no_springs
from distretarget.measure.gaps import TOUCH_DISTANCE
from distretarget.motion import Motion
from distretarget.numerics.joint_pairs import come_near, least_distances
from distretarget.numerics.moving import averaged
from distretarget.numerics.parallel import blocks_of
from distretarget.numerics.rotations import nearest_rotations
from distretarget.numerics.time_series import Shots, by_shot, median_of_three, run_means
from distretarget.numerics.vectors import Array, Numbers, farthest_points, lengths, level
from distretarget.objectives.activation import FADE, ContactSettings, activation, activation_window
from distretarget.objectives.clip import Clip
from distretarget.objectives.contact_pairs import pair_stiffness
from distretarget.objectives.contact_terms import share_across
from distretarget.objectives.supports import RESTS, ROOT_BLEND
from distretarget.pipeline.performer import Performer
from distretarget.scene.props import PlacedProp, Placement, nearest_places
from distretarget.skin.capsules import IS_ARM, SEGMENTS

Both = tuple[Array, Array]  # of two performers

RELATIVE_STIFFNESS = 0.3  # of a pair across bodies to one within a body at D = `settings.reach`; larger at less D ...
NEAREST = 0.01  # ... until D is about this
LEAST_STIFFNESS = 0.05  # pairs with less are left out
NO_STIFFNESS = 1e-12  # added to a stiffness matrix so that it is never singular
REGION_POINTS = 9  # most joints of a region that may touch others
FREE_WEIGHT = 1e-6  # least weight of a prop's free placement, beside those of the joints that hold it
LEVER = 0.02  # the rotation of a joint that holds a prop weighs as much as a point at this distance [body units]
TRUNK_COMPLIANCE = 0.2  # of a trunk, which leans to another performer; that of a limb is its length [body units]
# (segments + 1,), whether a segment rests on its skin. Arms are left to `scene.skin`; the last entry is for no segment.
RESTS_ON_SKIN = np.array([not IS_ARM[number] and "foot" not in name for number, name in enumerate(SEGMENTS)] + [False])
OVER = 0.3  # a joint is over a prop if the direction out of the prop has at least this cosine to the vertical ...
REACHED_WITHIN = 0.5  # and the prop is nearer than this [leg lengths]
MOVING = 1e-3  # weight of frames in which a joint still moves, as while somebody sits down


@dataclass(frozen=True, eq=False)
class ContactPoints:
    """The joints of a performer that may touch another performer or a prop."""

    joints: Numbers  # (points,), of the target
    regions: Numbers  # (points,), the region of the body of each
    source: Array  # (frames, points, 3), positions of their drivers [source file units]
    reach: Array  # (points,), path lengths from the pelvis to them in the source [source file units]
    target_reach: Array  # (points,), the same on the target [target file units]
    shots: Shots  # (frames,), the shots of the clip


@dataclass(frozen=True, eq=False, kw_only=True)
class PerformerContacts:
    """The pairs of joints of two performers that are near each other: an entry for each pair and frame."""

    frames: Numbers  # (entries,), the frame
    joints: Numbers  # (2, entries), the joint of each performer
    f: Array  # (entries,), the activation, 0 to 1
    w: Array  # (entries,), the stiffness
    vectors: Array  # (entries, 3), from the second to the first joint in the source, scaled [target file units]

    def gaps(self, one: Array, other: Array) -> Both:
        """(entries,) each: the distance of the two joints at positions (frames, joints, 3), and the wanted one."""
        u, v = self.joints
        return lengths(one[self.frames, u] - other[self.frames, v]), lengths(self.vectors)

    def springs(self, separate: Both, now: Both, compliances: Both, units: tuple[float, float]) -> list[Springs]:
        """Return the springs on each performer, in its body units: one per joint, with the summed energy of its pairs.
        `separate` and `now` are positions, solved without each other and at present; joints close gaps in proportion to
        `compliances`, (frames, joints).
        """

        def of_pairs(values: Both) -> list[Array]:
            return [each[self.frames, joints] for each, joints in zip(values, self.joints, strict=True)]

        (a, b), (c, d), (own, other) = of_pairs(separate), of_pairs(now), of_pairs(compliances)
        change = a - b + self.f[:, None] * (self.vectors - (a - b)) - (c - d)
        length = lengths(self.vectors)
        e = self.vectors / np.maximum(length, 1e-12)[:, None]
        share = (own / (own + other))[:, None]
        drawn = zip(self.joints, units, (c + share * change, d - (1.0 - share) * change), strict=True)
        return [
            self._summed(joints, share_across((length / unit) ** 2), e, place / unit, len(now[0]))
            for joints, unit, place in drawn
        ]

    def _summed(self, joints: Numbers, k: Array, e: Array, places: Array, count: int) -> Springs:
        """One spring per joint at the equilibrium of its pairs, that draw it to `places`: A = w (kI + (1 - k)ee^T)."""
        touches = np.bincount(joints) > 0
        drawn, column = np.flatnonzero(touches), np.cumsum(touches) - 1
        cell = self.frames * len(drawn) + column[joints]

        def summed(values: Array) -> Array:
            return np.bincount(cell, values, count * len(drawn)).astype(np.float64).reshape(count, len(drawn))

        across, along = self.w * k, self.w * (1.0 - k)
        pull = along * (e * places).sum(axis=1)
        A = summed(across)[..., None, None] * np.eye(3)
        Ay = np.stack([summed(across * places[:, i] + pull * e[:, i]) for i in range(3)], axis=-1)
        for i, j in zip(*np.tril_indices(3), strict=True):
            A[..., i, j] += summed(along * e[:, i] * e[:, j])
            A[..., j, i] = A[..., i, j]
        balanced = np.linalg.solve(A + NO_STIFFNESS * np.eye(3), Ay[..., None])[..., 0]
        return Springs(drawn, np.full(len(drawn), -1), np.asarray(balanced, np.float64), A)


def find_performer_contacts(
    one: ContactPoints, other: ContactPoints, scale: RootScale, up: Array, frame_time: float, settings: ContactSettings
) -> PerformerContacts:
    """Return the pairs of joints of two performers whose distance, over the mean length of both paths to the pelvis, is
    below `settings.reach`. Vectors have the `scale` of the world, or the ratio of path lengths as in Eq. (1) if
    smaller: hands that touch stay together where longer legs make the world larger.
    """
    found, lead = [], settings.blend / frame_time
    margin, shots = activation_window(lead), one.shots + other.shots  # a new shot at the cuts of either
    path = (one.reach[:, None] + other.reach) / 2.0
    near_u, near_v = np.nonzero(path > 0)
    for block in blocks_of(len(one.source)):
        first = max(block.start - margin, 0)
        inside = slice(block.start - first, block.stop - first)
        a, b = (points.source[first : block.stop + margin] for points in (one, other))
        on = come_near(a, b, near_u, near_v, (settings.reach + FADE) * path[near_u, near_v])
        u, v = near_u[on], near_v[on]
        around = shots[first : block.stop + margin]
        D, least = least_distances(a, b, u, v, path[u, v], around)
        f = activation(least, around, lead, settings.reach)[inside] if len(u) else D[inside]
        D = D[inside] / 2.0  # over both paths, for the stiffness
        w = pair_stiffness(f, D, (u, v + len(one.joints)), len(one.joints) + len(other.joints), settings)
        w *= relative_stiffness(D, settings)
        frames, pairs = np.nonzero(w > LEAST_STIFFNESS)
        u, v = u[pairs], v[pairs]
        d = a[inside][frames, u] - b[inside][frames, v]
        found.append((frames + block.start, u, v, f[frames, pairs], w[frames, pairs], d))
    frames, u, v, f, w, d = (np.concatenate(columns) for columns in zip(*found, strict=True))
    of_paths = (one.target_reach[u] + other.target_reach[v]) / (one.reach[u] + other.reach[v])
    vectors = np.minimum(of_paths / scale.level, 1.0)[:, None] * scale.places(d, up)
    joints = np.stack([one.joints[u], other.joints[v]])
    return PerformerContacts(frames=frames, joints=joints, f=f, w=w, vectors=vectors)


def relative_stiffness(D: Array, settings: ContactSettings) -> Array:
    """The stiffness of pairs across bodies, by normalised distance; larger if nearer: hands differ in size."""
    return RELATIVE_STIFFNESS * (settings.reach + NEAREST) / (D + NEAREST)


@dataclass(frozen=True, eq=False, kw_only=True)
class PropContacts:
    """The joints of a performer that come near a prop."""

    joints: Numbers  # (joints,), of the target
    source: Array  # (frames, joints, 3), positions of their drivers [source file units]
    distances: Array  # (frames, joints), of the drivers from the nearest point of the prop [source file units]
    f: Array  # (frames, joints), the activation, 0 to 1
    A: Array  # (frames, joints, 3, 3), the stiffness
    rises: Array  # (frames, joints, 3), offsets upwards, for bodies with thicker skin below [target file units]

    def places(self, placement: Placement) -> Array:
        """(frames, joints, 3), the wanted positions of the joints on the prop [target file units]."""
        return placement(self.source) + self.rises

    def springs(self, placement: Placement, clip: Clip) -> Springs:
        """The springs that draw the joints to their places on the prop, frames first."""
        copied = clip.copy_on_path(self.joints)
        places = copied + self.f[..., None] * (self.places(placement) - copied)
        return Springs(self.joints, np.full(len(self.joints), -1), places / clip.unit, self.A)

    def gaps(self, now: Array, prop: Array, scale: float) -> tuple[Array, Array]:
        """(frames, joints) each: the distances of joints from the prop, both (frames, n, 3), and the wanted ones."""
        return _nearest_distances(now[:, self.joints], prop), scale * self.distances + lengths(self.rises)


def find_prop_contacts(
    points: ContactPoints, prop: Array, leg: float, free: Array, frame_time: float, settings: ContactSettings
) -> PropContacts:
    """Return the joints that come near a prop, (frames, points, 3), relative to the length of a `leg`; joints of one
    region share their stiffness. `free`, (frames, points), scales activations; 0 while a joint rests elsewhere.
    """
    distances = _nearest_distances(points.source, prop)
    D = distances / leg
    without_spikes = by_shot(median_of_three, points.shots, D)
    f = activation(without_spikes, points.shots, settings.blend / frame_time, settings.reach) * free
    on = np.flatnonzero(f.any(axis=0))
    ends = np.arange(len(on)), len(on) + points.regions[on]
    f, D, distances = f[:, on], D[:, on], distances[:, on]
    count = len(on) + int(points.regions.max(initial=0)) + 1
    w = relative_stiffness(D, settings) * pair_stiffness(f, D, ends, count, settings)
    w *= share_across((distances / (2.0 * leg)) ** 2)
    A = w[..., None, None] * np.eye(3)
    source = points.source[:, on]
    return PropContacts(joints=points.joints[on], source=source, distances=distances, f=f, A=A, rises=0.0 * source)


def _nearest_distances(joints: Array, prop: Array) -> Array:
    """(frames, joints), the distance of each joint from the nearest point of a prop, (frames, points, 3)."""
    distances = np.empty(joints.shape[:2])
    for block in blocks_of(len(joints)):
        distances[block] = lengths(joints[block][:, :, None] - prop[block][:, None]).min(axis=-1)
    return distances


@dataclass(frozen=True, eq=False)
class SceneContacts:
    """Performers and props, and the contacts between them."""

    performers: tuple[Performer, ...]  # as they are solved, one by one
    props: tuple[PlacedProp, ...]
    between: Mapping[tuple[int, int], PerformerContacts]  # by the numbers of two performers
    on_props: Mapping[tuple[int, int], PropContacts]  # by the numbers of a performer and a prop
    compliances: tuple[Array, ...]  # of each performer, (frames, joints), see `joint_compliance`

    def placements(self, now: Sequence[Motion]) -> list[Placement]:
        """The placement of each prop for the present motions of the performers."""
        return [self._placement(number, prop, now) for number, prop in enumerate(self.props)]

    def _placement(self, number: int, prop: PlacedProp, now: Sequence[Motion]) -> Placement:
        """The best fit of a prop to all joints that hold it (Kabsch); their turns are relative to the rotation copy."""
        holds, free = [], prop.free
        for i, grips in prop.grips.items():
            clip, near = self.performers[i].clip, self.on_props[i, number]
            for column in np.flatnonzero(np.isin(near.joints, grips)):
                joint = near.joints[column]
                copied, turned = (Rotation.from_quat(each.world_rotations[:, joint]) for each in (clip.copy, now[i]))
                turn, place = (turned * copied.inv()).as_matrix(), now[i].positions[:, joint]
                holds.append((near.f[:, column], near.source[:, column], place, turn, LEVER * clip.unit))
        if not holds:
            return free
        weight, source, places, turns, levers = zip(*holds, strict=True)
        loose = np.maximum(1.0 - np.max(weight, axis=0), FREE_WEIGHT)
        weights = np.stack([loose, *weight])[..., None]
        a = np.stack([0.0 * free.centre, *(free.scale * (each - free.centre) for each in source)])
        b = np.stack([free.place, *places])
        middle_a, middle_b = ((weights * x).sum(axis=0) / weights.sum(axis=0) for x in (a, b))
        H = np.einsum("hfi,hfj->fij", weights * (b - middle_b), a - middle_a)
        H += (max(levers) ** 2 * loose)[:, None, None] * np.eye(3)
        for share, turn, lever in zip(weight, turns, levers, strict=True):
            H += (lever**2 * share)[:, None, None] * turn
        best = nearest_rotations(H)
        return Placement(free.centre, middle_b - np.einsum("fij,fj->fi", best, middle_a), best, free.scale)

    def springs(self, now: Sequence[Motion], separate: Sequence[Motion] | None = None) -> list[Springs]:
        """Return the springs on performers; without `separate`, those to other performers have no stiffness."""
        start = separate or now
        springs = [no_springs(len(one.clip)) for one in self.performers]
        for (i, j), near in self.between.items():
            one, other = self.performers[i], self.performers[j]
            positions = (start[i].positions, start[j].positions), (now[i].positions, now[j].positions)
            compliances = self.compliances[i], self.compliances[j]
            of_both = near.springs(*positions, compliances, (one.clip.unit, other.clip.unit))
            for number, each in zip((i, j), of_both, strict=True):
                springs[number] = joined(springs[number], each if separate else each._replace(A=0.0 * each.A))
        return [joined(*both) for both in zip(springs, self.springs_to_props(now), strict=True)]

    def springs_to_props(self, now: Sequence[Motion], props: Container[int] | None = None) -> list[Springs]:
        """Return the springs from each performer to props, all or those with the numbers `props`."""
        springs, places = [no_springs(len(one.clip)) for one in self.performers], self.placements(now)
        for (i, k), touching in self.on_props.items():
            if props is None or k in props:
                springs[i] = joined(springs[i], touching.springs(places[k], self.performers[i].clip))
        return springs

    def gap_error(self, now: Sequence[Motion]) -> float:
        """The mean |gap - wanted gap| of all contacts [leg lengths]; 0 if nothing touches."""
        placements, measured = self.placements(now), []
        for (i, j), near in self.between.items():
            leg = 0.5 * (self.performers[i].clip.leg + self.performers[j].clip.leg)
            measured.append((*near.gaps(now[i].positions, now[j].positions), leg))
        for (i, k), touching in self.on_props.items():
            place, leg = placements[k], self.performers[i].clip.leg
            points = place(self.props[k].motion.positions)
            measured.append((*touching.gaps(now[i].positions, points, place.scale), leg))
        errors = [np.abs(gaps - wanted)[wanted < TOUCH_DISTANCE * leg] / leg for gaps, wanted, leg in measured]
        return float(np.concatenate(errors).mean()) if any(map(len, errors)) else 0.0


def common_shots(performers: Sequence[Performer]) -> Shots:
    """(frames,), the shots of a scene: a new one begins at a cut in the clip of any performer."""
    return np.asarray(np.sum([one.clip.shots for one in performers], axis=0))


def copy_on_path(one: Performer) -> Motion:
    """Return the rotation copy with its root on the performer's path."""
    return replace(one.clip.copy, root_positions=one.clip.root)


def find_scene_contacts(performers: Sequence[Performer], props: Sequence[PlacedProp]) -> SceneContacts:
    """Find all contacts. Supports on a prop that nobody holds move onto it; those on moving things are weakened."""
    points = [_contact_points(one) for one in performers]
    between, on_props, supported = {}, {}, []
    for i, j in combinations(range(len(performers)), 2):
        one, clip = performers[i], performers[i].clip
        scale = RootScale(clip.scale.level, (clip.scale.height + performers[j].clip.scale.height) / 2.0)
        between[i, j] = find_performer_contacts(points[i], points[j], scale, clip.up, clip.frame_time, one.settings)
    for i, one in enumerate(performers):
        moving = [(near.frames, near.joints[both.index(i)], near.f) for both, near in between.items() if i in both]
        for k, prop in enumerate(props):
            near = on_props[i, k] = _prop_contacts(one, points[i], prop, prop.grips.get(i, ()))
            if prop.grips:
                frames, columns = np.nonzero(near.f)
                moving.append((frames, near.joints[columns], near.f[frames, columns]))
            else:
                near = on_props[i, k] = replace(near, rises=rises_over(one, near, prop))
                one = _resting_on(seated(one, near, prop), near, prop.free)
        supported.append(_yielding(one, moving))
    return SceneContacts(tuple(supported), tuple(props), between, on_props, tuple(map(joint_compliance, supported)))


def joint_compliance(one: Performer) -> Array:
    """(frames, joints) [target file units]: the trunk's, plus the limb's length up to the joint unless it rests."""
    clip, skeleton = one.clip, one.clip.skeleton
    trunk = np.isin(np.append(clip.regions.names, ""), TRUNK_REGIONS)[clip.regions.of_joint]
    limbs = [[*takewhile(lambda each: not trunk[each], skeleton.to_root(joint))] for joint in range(len(skeleton))]
    length = np.array([skeleton.paths_from(limb[0])[limb[-1]] if limb else 0.0 for limb in limbs])
    held = np.zeros((len(clip), len(skeleton)))
    for support, joint in enumerate(one.supports.joints):
        held[:, limbs[joint]] = np.maximum(held[:, limbs[joint]], one.supports.weights[:, support, None])
    return np.asarray(length * (1.0 - held) + TRUNK_COMPLIANCE * clip.unit)


def _contact_points(one: Performer) -> ContactPoints:
    """The joints of a performer that may touch, a few of each region."""
    matching, distances = one.match.matching, one.clip.distances
    skeleton = matching.source.skeleton
    regions = matching.regions.of_joint[distances.targets]
    chosen: list[int] = []
    for region in range(len(matching.regions.names)):
        points = np.flatnonzero(regions == region)
        tau = skeleton.paths_among(distances.sources[points])
        chosen += points[farthest_points(tau, REGION_POINTS)].tolist() if len(points) else []
    sources, joints = distances.sources[chosen], distances.targets[chosen]
    return ContactPoints(
        joints=joints,
        regions=regions[chosen],
        source=matching.source_motion.positions[:, sources],
        reach=skeleton.paths_from(matching.drivers.item(matching.pelvis))[sources],
        target_reach=matching.target.skeleton.paths_from(matching.pelvis)[joints],
        shots=one.clip.shots,
    )


def _prop_contacts(one: Performer, points: ContactPoints, prop: PlacedProp, holders: Sequence[int]) -> PropContacts:
    """The contacts of a performer with a prop. Standing feet are not drawn to it, nor regions that hold it alone."""
    supports = one.supports
    free = np.ones((len(one.clip), len(points.joints)))
    for support, region in enumerate(supports.regions[: supports.feet]):
        free[:, points.regions == region] *= 1.0 - supports.weights[:, support, None]
    leg = one.clip.leg_lengths[0] or one.match.matching.source.unit
    near = find_prop_contacts(points, prop.motion.positions, leg, free, one.clip.frame_time, one.settings)
    regions = one.clip.regions.of_joint
    left_out = np.isin(regions[near.joints], regions[[*holders]])
    if sum(map(len, prop.grips.values())) > 1:
        left_out &= ~np.isin(near.joints, holders)
    return replace(near, A=np.where(left_out[:, None, None], 0.0, near.A))


def _resting_on(one: Performer, near: PropContacts, free: Placement) -> Performer:
    """Move the places of supports, except feet, that touch a prop which nobody holds to the prop."""
    supports, places, on_prop = one.supports, np.array(one.supports.places), near.places(free)
    for support in range(supports.feet, len(supports.joints)):
        for column in np.flatnonzero(near.joints == supports.joints[support]):
            places[:, support] += near.f[:, column, None] * (on_prop[:, column] - places[:, support])
    return replace(one, supports=replace(supports, places=places))


def _yielding(one: Performer, moving: Sequence[tuple[Numbers, Numbers, Array]]) -> Performer:
    """Weaken supports off the floor in contacts with `moving` performers and props: (frames, joints, activations)."""
    clip, supports, reach = one.clip, one.supports, REST_HEIGHT * one.clip.leg_lengths[1]
    floor = clip.scale.heights(clip.source_floor)[:, None]
    touched = np.zeros((len(clip), len(clip.regions.names)))
    for frames, joints, f in moving:
        np.maximum.at(touched, (frames, clip.regions.of_joint[joints]), f)
    yields = np.where(supports.places @ clip.up - floor > 2.0 * reach, touched[:, supports.regions], 0.0)
    yields[:, : supports.feet] = 0.0
    return replace(one, supports=replace(supports, weights=supports.weights * (1.0 - yields)))


def rises_over(one: Performer, near: PropContacts, prop: PlacedProp) -> Array:
    """(frames, joints, 3), the `rises` of prop contacts [target file units]: skin below a joint gets as high over the
    prop as the source's, or onto it, constant over each rest. 0 for arms, feet, joints beside the prop, and without
    skin.
    """
    clip, undersides, rises = one.clip, one.match.undersides, np.zeros(near.source.shape)
    if undersides is None:
        return rises
    on = np.flatnonzero(RESTS_ON_SKIN[undersides.target.segments[near.joints]])
    joints, x, far = near.joints[on], near.source[:, on], REACHED_WITHIN * clip.leg_lengths[0]
    below = undersides.source.below(clip.source, clip.drivers[joints], clip.up)
    own_below = undersides.target.below(clip.copy, joints, clip.up)
    feet, out = nearest_places(prop.surface, prop.motion, x, far)
    above = np.minimum((x - feet) @ clip.up, below)
    higher = np.where(out @ clip.up > OVER, own_below - prop.free.scale * above, 0.0)
    moves = joint_speeds(clip.source, clip.drivers[joints], clip.shots) > REST_SPEED * clip.leg_lengths[0]
    weights = near.f[:, on] * np.where(moves, MOVING, 1.0)
    for column, each, weight in zip(on, higher.T, weights.T, strict=True):
        rises[:, column] = by_shot(run_means, clip.shots, each[:, None], weight) * clip.up
    return rises


def seated(one: Performer, near: PropContacts, prop: PlacedProp) -> Performer:
    """Return the performer with its path raised by the mean height that its joints lack to their places on a prop."""
    up, copied = one.clip.up, one.clip.copy_on_path(near.joints)
    weights = np.where(near.rises.any(axis=2), near.f, 0.0)
    if not weights.any():
        return one
    off = weights * ((near.places(prop.free) - copied) @ up)
    mean = off.sum(axis=1) / np.maximum(weights.sum(axis=1), 1.0)
    smooth = partial(averaged, reach=round(ROOT_BLEND / one.clip.frame_time))
    return moved_by(one, by_shot(smooth, one.clip.shots, mean)[:, None] * up)


def moved_by(one: Performer, by: Array) -> Performer:
    """Return the performer moved by `by`, (frames, 3) [target file units], its supports by the mean over each rest."""
    clip, supports = one.clip, one.supports
    if not by.any():
        return one
    rests, places = supports.weights >= RESTS, np.array(supports.places)
    for support in range(len(supports.joints)):
        is_foot = support < supports.feet
        resting = rests[:, [support, support ^ 1]].any(axis=1) if is_foot else rests[:, support]
        moved = level(by, clip.up) if is_foot else by
        places[:, support] += by_shot(run_means, clip.shots, moved, resting.astype(float))
    return replace(one, clip=clip.raised(by), supports=replace(supports, places=places))
