"""The sample scenes: two performers who touch each other, or a performer and a prop."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from sample_body import (
    FPS,
    FRAME_TIME,
    OFFSET,
    SIDES,
    SIGN,
    STANDING,
    WRIST_HEIGHT,
    Foot,
    Place,
    Points,
    Track,
    Trunk,
    aimed_arm,
    bump,
    clock,
    columns,
    cosine,
    eased,
    flat_hand,
    hand,
    held,
    motion,
    on_side,
    trunk,
    turned,
)
from sample_motions import hanging_arm, planted_feet, standing_trunk
from scipy.spatial.transform import Rotation

from distretarget import Grip, Motion, Prop, Skeleton
from distretarget.io.obj import parse_obj, static_prop
from distretarget.skeleton import POSITION_CHANNELS, ROTATION_CHANNELS

NEAREST = ""  # in place of a joint: the nearest point of a prop
DURATION = 2.6  # [s]
OTHER = {"Left": "Right", "Right": "Left"}
POINTING = hand(fingers=[0.0, 0.0, 1.0], palm=[-1.0, 0.0, 0.0])  # a left hand, the thumb up
UPRIGHT = hand(fingers=[0.0, 1.0, 0.1], palm=[0.0, -0.1, 1.0])  # a left hand, the palm forward
ABOVE = hand(fingers=[0.1, -0.3, 0.9], palm=[0.0, -1.0, -0.3])  # a left hand on a shoulder
GRIP = 24.0  # from the middle of the staff to either hand [cm]
SEAT = 46.0  # height of the chair's seat [cm]
TABLE = 92.0  # height of the table [cm]


class Contact(NamedTuple):
    """Two points that touch from frame `first` to frame `last`, both included."""

    one: tuple[int, str]  # the number of a performer, or of a prop counted after them, and a joint, or `NEAREST`
    other: tuple[int, str]
    first: int
    last: int


class SampleScene(NamedTuple):
    """Performers, props, and their contacts."""

    performers: Mapping[str, Motion]
    contacts: list[Contact]
    props: tuple[Prop, ...] = ()


class Reach(NamedTuple):
    """The goal of a hand in the performer's own world."""

    wrist: ArrayLike  # its places, (frames, 3) or (3,) [cm]
    hand: Rotation
    weight: ArrayLike = 1.0  # (frames,), 0 where the arm hangs
    elbow: ArrayLike = (0.0, -1.0, -0.3)  # its direction, (3,)


def performer(t: Track, trunk: Trunk, reaches: Mapping[str, Reach], feet: Mapping[str, Foot] | None = None) -> Motion:
    """A standing body whose hands reach for these goals, by side."""
    arms = {side: hanging_arm(t, 0.2 * number) for number, side in enumerate(SIDES)}
    for side, reach in reaches.items():
        wrist = np.broadcast_to(np.asarray(reach.wrist, float), (len(t), 3))
        arm = aimed_arm(side, trunk.chest(), (wrist, reach.hand), reach.elbow)
        arms[side] = arms[side].blended(arm, np.broadcast_to(reach.weight, len(t)))
    return motion(trunk, arms, feet or planted_feet(t, width=22, toe_out=9))


def opposite(points: ArrayLike, gap: float) -> Points:
    """Points in the world of a performer who stands `gap` [cm] away, face to face."""
    return np.asarray(points, float) * (-1.0, 1.0, -1.0) + (0.0, 0.0, gap)


def facing(source: Motion, gap: float) -> Motion:
    """The motion of a performer who stands `gap` [cm] away, face to face, in the world of the other."""
    rotations = np.array(source.rotations)
    rotations[:, 0] = (turned(yaw=180.0) * Rotation.from_quat(rotations[:, 0])).as_quat()
    return replace(source, root_positions=opposite(source.root_positions, gap), rotations=rotations)


def on_body(place: Place, offset: ArrayLike, gap: float) -> Points:
    """(frames, 3), a point fixed to a part of the body, in the world of a performer `gap` [cm] away, face to face."""
    position, rotation = place
    return opposite(position + rotation.apply(offset), gap)


def shoulder(side: str, offset: ArrayLike) -> Points:
    """(3,), a point of a shoulder, from the top of the chest."""
    return OFFSET[side + "Collar"] + OFFSET[side + "Shoulder"] + offset


def contact(one: tuple[int, str], other: tuple[int, str], start: float, end: float) -> Contact:
    """A contact between two times [s]."""
    return Contact(one, other, int(np.ceil(start * FPS)), int(np.floor(end * FPS)))


def _standing(t: Track, shift: float = 0.0, lean: float = 0.0) -> Trunk:
    """A trunk that leans by `lean` [degrees] and stands with the hips `shift` to the left."""
    return standing_trunk(t, shift + 0.0 * t, turned(pitch=2 + lean))


def _upright(t: Track, pelvis: ArrayLike, bend: ArrayLike, look: ArrayLike, ahead: ArrayLike = 0.0) -> Trunk:
    """A trunk with the hips `ahead` [cm], and each part pitched by an angle [degrees]."""
    position = columns(0.0, STANDING - 1.0 + 0 * t, ahead)
    return trunk(position, turned(pitch=pelvis), turned(pitch=bend), turned(pitch=look))


# ---- two performers


def handshake() -> SampleScene:
    """Two people shake their right hands, three times."""
    t, gap = clock(DURATION), 86.0
    start, end = 0.8, 1.9
    shake = 3.0 * held(t, start, start + 0.2, end - 0.2, end) * cosine(t, 0.35, start)
    wrist = columns(-1.5, 104 + shake, gap / 2 - 7)
    reach = {"Right": Reach(wrist, on_side("Right", POINTING), held(t, 0.15, start, end, 2.5))}
    lead, follower = (performer(t, _standing(t, shift), reach) for shift in (1.0, -1.5))
    joints = ["RightWrist_End", "RightWrist"]
    touches = [contact((0, one), (1, other), start, end) for one, other in zip(joints, joints[::-1], strict=True)]
    return SampleScene({"one": lead, "other": facing(follower, gap)}, touches)


def high_five() -> SampleScene:
    """Two people clap their right hands above their shoulders, for a tenth of a second."""
    t, gap = clock(2.0), 92.0
    start, end = 0.9, 1.0
    palm, weight = on_side("Right", UPRIGHT), held(t, 0.2, start, end, 1.8)
    reaches = [Reach((x, 150, gap / 2 - 1.5), palm, weight, (-0.4, -1.0, 0.0)) for x in (-10.0, 10.0)]
    lead, follower = (performer(t, _standing(t, 1.0), {"Right": reach}) for reach in reaches)
    touches = [contact((0, joint), (1, joint), start, end) for joint in ("RightWrist", "RightWrist_End")]
    return SampleScene({"one": lead, "other": facing(follower, gap)}, touches)


def waltz() -> SampleScene:
    """Two people in a closed hold sway from side to side."""
    t, gap = clock(DURATION), 40.0
    sway = 4.0 * cosine(t, 1.7)
    look = turned(pitch=2.0, yaw=14.0)
    lead, follower = standing_trunk(t, sway, look), standing_trunk(t, -sway, look)
    joined = columns(38 + sway, 128 + 2 * cosine(t, 1.1), gap / 2 - 1)
    level = hand(fingers=[0.9, 0.1, 0.35], palm=[-0.3, 0.0, 1.0])
    behind = on_side("Right", hand(fingers=[-0.9, 0.1, 0.4], palm=[-0.3, 0.0, -1.0]))
    above = hand(fingers=[0.2, -0.3, 0.9], palm=[0.0, -1.0, -0.3])
    back = on_body(follower.chest(), [12.0, -6.0, -9.0], gap)
    one = {"Left": Reach(joined, level, 1.0, (0.6, -0.8, -0.2)), "Right": Reach(back, behind, 1.0, (-1.0, -0.1, 0.0))}
    met = opposite(joined + columns(0.0, 0.0, 2.0), gap)
    top = on_body(lead.chest(), shoulder("Right", [1.0, 4.5, 2.0]), gap)
    other = {
        "Right": Reach(met, on_side("Right", level), 1.0, (-0.6, -0.8, -0.2)),
        "Left": Reach(top, above, 1.0, (1.0, -0.2, 0.0)),
    }
    ends = ((0, "LeftWrist"), (1, "RightWrist")), ((1, "LeftWrist"), (0, "RightShoulder"))
    touches = [contact(*pair, 0.0, t[-1]) for pair in ends]
    return SampleScene(
        {"lead": performer(t, lead, one), "follower": facing(performer(t, follower, other), gap)}, touches
    )


def lift() -> SampleScene:
    """One person lifts the other by the chest."""
    t, gap = clock(DURATION), 34.0
    start, end = 0.7, 2.0
    rise = 18.0 * held(t, start, 1.2, 1.5, end)
    up = columns(0.0, rise, 0.0)
    lead, still = _standing(t, 0.0, 4.0), _standing(t)
    follower = Trunk(still.position + up, still.local)
    feet = {
        side: Foot(foot.ankle + up, foot.rotation * turned(pitch=1.6 * rise))
        for side, foot in planted_feet(t, width=20, toe_out=8).items()
    }
    weight = held(t, 0.1, start, end, 2.5)
    grip = hand(fingers=[-0.1, 0.1, 1.0], palm=[-1.0, 0.0, 0.0])
    one, other, touches = {}, {}, []
    for side, sign in SIGN.items():
        ribs = on_body(follower.chest(), [-sign * 15.0, -10.0, 4.0], gap)
        one[side] = Reach(ribs, on_side(side, grip), weight, (sign, -0.6, 0.0))
        place = on_body(lead.chest(), shoulder(OTHER[side], [0.0, 4.5, 2.0]), gap)
        other[side] = Reach(place, on_side(side, ABOVE), weight, (sign, -0.5, 0.0))
        touches.append(contact((1, f"{side}Wrist"), (0, f"{OTHER[side]}Shoulder"), start, end))
    motions = {"lead": performer(t, lead, one), "follower": facing(performer(t, follower, other, feet), gap)}
    return SampleScene(motions, touches)


def push() -> SampleScene:
    """One person pushes the other at both shoulders, who sways back."""
    t, gap = clock(DURATION), 60.0
    start, end = 0.7, 1.9
    back = 5.0 * bump(t, start, end)
    one = _upright(t, 3 + back, 3 + 0.5 * back, 3, ahead=back)
    look = 2 + eased(t, [0.6, 1.2], [0, 3])
    other = _upright(t, 3 - 0.6 * back, 2 - 0.6 * back, look, ahead=-0.4 * back)
    weight = held(t, 0.1, start, end, 2.5)
    reaches, touches = {}, []
    for side, sign in SIGN.items():
        place = on_body(other.chest(), shoulder(OTHER[side], [0.0, -3.0, 4.5]), gap)
        reaches[side] = Reach(place, on_side(side, UPRIGHT), weight, (sign, -0.8, -0.2))
        touches.append(contact((0, f"{side}Wrist"), (1, f"{OTHER[side]}Shoulder"), start, end))
    return SampleScene({"one": performer(t, one, reaches), "other": facing(performer(t, other, {}), gap)}, touches)


# ---- a performer and a prop


def staff() -> SampleScene:
    """A staff in both hands goes up and down and tilts."""
    t = clock(DURATION)
    middle = columns(0.0, 118 + 10 * cosine(t, 1.3), 30.0)
    turn = turned(roll=25.0 * cosine(t, 1.9))
    fist = hand(fingers=[0.1, 0.0, 1.0], palm=[0.0, -1.0, 0.0])
    reaches = {
        side: Reach(middle + turn.apply([sign * GRIP, 0.0, 0.0]), on_side(side, fist), 1.0, (0.8 * sign, -0.8, -0.1))
        for side, sign in SIGN.items()
    }
    points = [(x, 0.0, 0.0) for x in (0.0, -80.0, -50.0, -GRIP, GRIP, 50.0, 80.0)]
    prop = stick("staff", points, middle, turn, "LeftWrist", "RightWrist")
    touches = [contact((0, grip.joint), (1, NEAREST), 0.0, t[-1]) for grip in prop.held_by]
    return SampleScene({"performer": performer(t, _upright(t, 3, 3, 6), reaches)}, touches, (prop,))


def stick(name: str, points: Sequence[ArrayLike], place: Points, turn: Rotation, *holders: str) -> Prop:
    """A prop of points, (3,) each [cm], all fixed to the first, which is at a place, (frames, 3), in each frame."""
    skeleton = Skeleton(
        names=tuple(f"{name}{number or ''}" for number in range(len(points))),
        parents=np.append(-1, np.zeros(len(points) - 1, np.intp)),
        offsets=np.array(points, float),
        channels=(POSITION_CHANNELS + ROTATION_CHANNELS, *[()] * (len(points) - 1)),
        end_sites=np.arange(len(points)) > 0,
        units="cm",
        up="Y",
    )
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (len(place), len(points), 1))
    rotations[:, 0] = turn.as_quat()
    motion = Motion(skeleton, place, rotations, FRAME_TIME)
    return Prop(name=name, motion=motion, held_by=tuple(Grip(0, joint) for joint in holders))


def sit_on_chair() -> SampleScene:
    """A person sits down on a chair, with the hands above the knees, and stays."""
    t = clock(DURATION)
    down = held(t, 0.2, 1.4, 9.0, 10.0)
    stooped = bump(t, 0.2, 1.5)
    body = trunk(
        columns(0.0, STANDING - 3 + down * (SEAT + 9.0 - STANDING + 3), -40.0 * held(t, 0.2, 1.3, 9.0, 10.0)),
        turned(pitch=3 - 8 * down + 30 * stooped),
        turned(pitch=2 + 4 * down + 12 * stooped + 2.0 * cosine(t, 1.1)),
        turned(pitch=3 + 10 * stooped),
    )
    seat = _grid(np.linspace(-19.4, 19.4, 5), [SEAT], np.linspace(-61, -23, 5))
    back = _grid([-20.0, 0.0, 20.0], [60.0, 75.0, 90.0], [-63.0])
    legs = _grid([-20.0, 20.0], [0.0], [-60.0, -24.0])
    prop = Prop(name="chair", motion=standing_prop("chair", np.concatenate([seat, back, legs])))
    above = hand(fingers=[-0.1, -0.2, 1.0], palm=[0.0, -1.0, -0.2])
    reaches = {
        side: Reach((13.0 * sign, SEAT + 18.0, -10.0), on_side(side, above), down, (0.8 * sign, -0.6, -0.3))
        for side, sign in SIGN.items()
    }
    sitter = performer(t, body, reaches, planted_feet(t, width=26, toe_out=10))
    return SampleScene({"performer": sitter}, [contact((0, "LeftHip"), (1, NEAREST), 1.6, t[-1])], (prop,))


def drum_on_table() -> SampleScene:
    """Both hands drum on a table, by turns."""
    t, period, start = clock(DURATION), 0.6, 0.7
    raised = held(t, 0.1, start - 0.2, 2.3, 2.6)
    reaches, touches = {}, []
    for side, late in zip(SIDES, (0.0, period / 2), strict=True):
        strikes = [start + late + number * period for number in range(2)]
        up = 1.0 - sum(held(t, strike - 0.2, strike, strike + 0.06, strike + 0.25) for strike in strikes)
        place = columns(SIGN[side] * 16.0, TABLE + WRIST_HEIGHT + 12 * up, 30.0)
        reaches[side] = Reach(place, on_side(side, flat_hand(6.0)), raised, (SIGN[side], -0.2, -0.5))
        touches += [contact((0, f"{side}Wrist_End"), (1, NEAREST), strike, strike + 0.06) for strike in strikes]
    top = _grid([-48.0, -16.0, 16.0, 48.0], [TABLE], [18.0, 47.0, 60.0])
    legs = _grid([-48.0, 48.0], [0.0], [18.0, 60.0])
    prop = Prop(name="table", motion=standing_prop("table", np.concatenate([top, legs])))
    body = _upright(t, 4, 6 + cosine(t, 0.3), 14)
    return SampleScene({"performer": performer(t, body, reaches)}, touches, (prop,))


def standing_prop(name: str, points: Points) -> Motion:
    """A prop that stands still, with these points, (points, 3) [cm]."""
    return static_prop(parse_obj(obj_text(points), f"{name}.obj")[0], name)


def obj_text(points: Points) -> str:
    """The text of an OBJ file with these vertices, (points, 3)."""
    return "".join(f"v {x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in points)


def _grid(x: ArrayLike, y: ArrayLike, z: ArrayLike) -> Points:
    """(points, 3), all points with these coordinates."""
    return np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3).astype(float)


SCENES: dict[str, Callable[[], SampleScene]] = {
    scene.__name__: scene for scene in (handshake, high_five, waltz, lift, push, staff, sit_on_chair, drum_on_table)
}
