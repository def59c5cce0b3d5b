"""The sample clips in which more than the feet rest on the world, each made by a function."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np
from numpy.typing import ArrayLike
from sample_body import (
    ANKLE_HEIGHT,
    AT_REST,
    FORWARD,
    FPS,
    OFFSET,
    SHANK,
    SIDES,
    SIGN,
    STANDING,
    THIGH,
    WRIST_HEIGHT,
    Arm,
    Foot,
    Place,
    Points,
    Track,
    Trunk,
    aimed_arm,
    blend,
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
    straight_arm,
    swung_arm,
    trunk,
    turned,
    within_reach,
)
from sample_motions import hanging_arm, planted_feet
from scipy.interpolate import make_interp_spline

from distretarget import Motion
from distretarget.numerics.vectors import normalised

FLOOR, WORLD = "floor", "world"
CLEARANCE = 1e-6  # a time this near to a frame counts as that frame [frames]
HAND, FOOT = ("Wrist", "Wrist_End"), ("Ankle", "Toe", "Toe_End")  # joints that rest together
KNEE_HEIGHT, INSTEP_HEIGHT = 5.5, 6.0  # of knee and ankle that rest on the floor [cm]
ABOVE_FLOOR = 20.0  # joints that rest higher rest on a wall or a rung [cm]


@dataclass(frozen=True)
class Support:
    """A joint or End Site that stands still from frame `first` to `last`, both included, on `FLOOR` or in `WORLD`."""

    joint: str
    first: int
    last: int
    kind: str


@dataclass(frozen=True)
class Sample:
    """A clip and all its supports."""

    motion: Motion
    supports: list[Support]


@dataclass(frozen=True)
class Rest:
    """A place in the world [cm], and the time for which a hand or a foot rests there [s]."""

    start: float
    end: float
    place: ArrayLike

    def weight(self, t: Track, approach: float, leave: float | None = None) -> Track:
        """1 during the rest, 0 until `approach` before and from `leave` after [s]; `leave` is `approach` by default."""
        return held(t, self.start - approach, self.start, self.end, self.end + (approach if leave is None else leave))

    def reached(self, t: Track, free: Points, seconds: float) -> Points:
        """The path `free`, (frames, 3), blended to the place of the rest over `seconds` before and after."""
        return free + self.weight(t, seconds)[:, None] * (np.asarray(self.place) - free)


def supports(t: Track, sides: Iterable[str], joints: Iterable[str], rests: Iterable[Rest]) -> list[Support]:
    """The supports of joints that rest at the same time, on one side, both or neither (""), two frames or longer."""
    table = []
    for side, joint, rest in product(sides, joints, rests):
        first = int(np.ceil(max(rest.start, 0.0) * FPS - CLEARANCE))
        last = int(np.floor(min(rest.end, t[-1]) * FPS + CLEARANCE))
        if first < last:
            table.append(Support(side + joint, first, last, FLOOR if rest.place[1] < ABOVE_FLOOR else WORLD))
    return table


def supports_of_sides(t: Track, joints: Iterable[str], rests: Mapping[str, Sequence[Rest]]) -> list[Support]:
    """The supports of joints that rest together, with the rests of each side."""
    return [support for side in SIDES for support in supports(t, [side], joints, rests[side])]


def stepped(t: Track, rests: Sequence[Rest], arc: ArrayLike = (0.0, 0.0, 0.0)) -> Points:
    """A path, (frames, 3), that stays at each place and moves on to the next; `arc` is added half-way."""
    keys = [time for rest in rests for time in (rest.start, rest.end)]
    places = np.repeat([rest.place for rest in rests], 2, axis=0)
    path = columns(*(eased(t, keys, values) for values in places.T))
    for before, after in pairwise(rests):
        path += bump(t, before.end, after.start)[:, None] * np.asarray(arc)
    return path


# ---- a cartwheel to the left; the second half is the first half mirrored, backwards in time

WHEEL = 3.4  # duration [s]
MIDDLE = 157.5  # where the body is upside down, along the way to the left [cm]
UPSIDE_DOWN = 102.3  # height of the pelvis at half-time [cm]
SWING = 0.45  # of a leg between the floor and the air, and of the first and the last step [s]
# Keys of the first half: time [s], how far the pelvis has turned [degrees], its way to the left and its height [cm].
KEYS = np.array(
    [[0.45, 0.0, 30.0, STANDING - 3.0], [0.95, 42.0, 42.0, 86.7], [1.25, 106.0, 86.2, 85.2], [1.45, 147.5, 120.2, 94.5]]
)


def cartwheel() -> Sample:
    """A cartwheel: left hand, right hand, right foot, left foot, and the right foot closes."""
    t = clock(WHEEL)
    hands = {"Left": Rest(1.25, 1.88, (135.0, WRIST_HEIGHT, 4.0))}
    hands["Right"] = _backwards(hands["Left"])
    left = [Rest(-1.0, 0.5, (40.0, ANKLE_HEIGHT, -4.0)), Rest(0.95, 1.3, (75.0, ANKLE_HEIGHT, -4.0))]
    right = [Rest(-1.0, 1.0, (20.0, ANKLE_HEIGHT, -4.0))]
    feet = {"Left": [*left, *map(_backwards, right)], "Right": [*right, *map(_backwards, reversed(left))]}
    turn = _wheel_track(t, 1, 180.0, 360.0)
    way, height = _wheel_track(t, 2, MIDDLE, 2 * MIDDLE), _wheel_track(t, 3, UPSIDE_DOWN, 0.0)
    pelvis = turned(pitch=3.0, roll=-turn)
    bend = turned(pitch=2.0, roll=eased(t, [0.7, 1.25, 1.7, 2.15, 2.7], [0, -42, 0, 42, 0]))
    look = pelvis * bend * turned(pitch=-12 * held(t, 0.6, 1.2, 2.2, 2.8))
    body = trunk(columns(way, height, 0.0), pelvis, bend, look)
    arms = {side: _wheeling_arm(t, side, body.chest(), hands[side]) for side in SIDES}
    legs = {side: _wheeling_foot(t, side, body, turn, feet[side]) for side in SIDES}
    table = supports_of_sides(t, HAND, {side: [rest] for side, rest in hands.items()})
    return Sample(motion(body, arms, legs), table + supports_of_sides(t, FOOT, feet))


def _backwards(rest: Rest) -> Rest:
    """The rest mirrored into the second half, for the other side."""
    x, y, z = rest.place
    return Rest(WHEEL - rest.end, WHEEL - rest.start, (2 * MIDDLE - x, y, z))


def _wheel_track(t: Track, column: int, middle: float, whole: float) -> Track:
    """A spline through the keys, and the keys backwards in the second half; subtracted from `whole` unless it is 0."""
    times = [*KEYS[:, 0], WHEEL / 2, *(WHEEL - KEYS[::-1, 0])]
    first = KEYS[:, column]
    second = whole - first[::-1] if whole else first[::-1]
    spline = make_interp_spline(times, [*first, middle, *second], k=5, bc_type=(AT_REST, AT_REST))
    return spline(np.clip(t, times[0], times[-1]))


def _wheeling_arm(t: Track, side: str, chest: Place, rest: Rest) -> Arm:
    """An arm that rises from the side of the body to over the head, supports it, and is lowered at the end."""
    rotation = chest[1]
    raised = held(t, 0.05, 0.75, WHEEL - 0.75, WHEEL - 0.05)
    lift = np.radians(12 + 148 * raised)
    fingers = columns(np.sin(lift), -np.cos(lift), 0.12)
    outer = columns(-np.cos(lift) * raised, -np.sin(lift), raised - 1.2)
    free = on_side(side, hand(fingers, palm=columns(raised - 1, 0.0, raised)))
    early = Rest(rest.start - 0.08, rest.end + 0.08, rest.place)
    turn = blend(rotation * free, on_side(side, flat_hand(168.0)), early.weight(t, 0.3))
    wrist = rest.reached(t, straight_arm(side, chest, normalised(fingers), 0.94), 0.3)
    return aimed_arm(side, chest, (wrist, turn), rotation.apply(on_side(side, outer)))


def _wheeling_foot(t: Track, side: str, body: Trunk, turn: Track, rests: list[Rest]) -> Foot:
    """A foot that rests at its places; in between, a straight leg swings it about the hip."""
    sign, hip = SIGN[side], body.hip(side)
    free = held(t, 0.75, 1.35, WHEEL - 1.35, WHEEL - 0.75)
    angle = -turn + sign * (3 + 42 * free)
    leg = way = columns(angle, 0.967 * (THIGH + SHANK), 0.0)  # angle [degrees], length, and how far ahead
    level, roll = 0.0, 0.0
    for rest in rests:
        round_once = 0.0 if rest.start < WHEEL / 2 else -360.0  # the body has gone round in the second half
        across, up, ahead = (np.asarray(rest.place) - hip).T
        placed = columns(np.degrees(np.arctan2(across, -up)) + round_once, np.hypot(across, up), ahead)
        way = way + rest.weight(t, SWING)[:, None] * (placed - leg)
        weight = rest.weight(t, 0.25)
        level, roll = level + weight, roll + weight * round_once
    swing, length, ahead = way.T
    ankle = hip + columns(np.sin(np.radians(swing)) * length, -np.cos(np.radians(swing)) * length, ahead)
    step = bump(t, 0.5, 0.5 + SWING) if side == "Left" else bump(t, WHEEL - 0.5 - SWING, WHEEL - 0.5)
    return Foot(
        within_reach(hip, ankle + columns(0.0, 6.0 * step, 0.0), THIGH + SHANK),
        turned(roll=(1 - level) * angle + roll) * turned(pitch=40 * free * (1 - level) ** 2, yaw=sign * 12.0),
        knee=body.local["Hips"].apply([0.25 * sign, 0.0, 1.0]),
    )


# ---- steps up a ladder: hands and feet go from rung to rung in turn

CLIMB = 4.8  # duration [s]
SPACING = 28.0  # of the rungs [cm]
LADDER = 44.0  # before the middle of the body [cm]
GRIP = (17.0, 1.0, LADDER - 3.0)  # the left wrist, from the height of its rung
FOOTHOLD = (9.0, ANKLE_HEIGHT, LADDER - OFFSET["LeftToe"][2])  # the left ankle, likewise
FLOOR_PLACE = (9.0, ANKLE_HEIGHT, 10.0)  # the left ankle on the floor
PALM = hand(fingers=[-0.1, 0.55, 0.82], palm=[0.0, -0.82, 0.55])
# Rungs that are held, and when the hand or the foot arrives and leaves [s]; rung 0 is the floor.
GRIPS = {"Left": ((5, -1.0, 1.45), (7, 2.15, CLIMB)), "Right": ((5, -1.0, 0.3), (6, 0.8, 3.3), (8, 3.95, CLIMB))}
FOOTHOLDS = {"Left": ((0, -1.0, 0.65), (1, 1.25, 3.1), (3, 3.75, CLIMB)), "Right": ((0, -1.0, 1.6), (2, 2.3, CLIMB))}


def climb_ladder() -> Sample:
    """From the floor up to the second and third rung."""
    t = clock(CLIMB)
    height = STANDING - 3.0 + eased(t, [1.5, 2.6, 2.95, 4.1], [0, 26.0, 26.0, 52.0])
    aside = eased(t, [0.2, 0.7, 1.4, 1.9, 2.6, 3.2, 3.9, 4.6], [0, -2.5, -2.5, 3.0, 3.0, -3.0, -3.0, 0])
    pelvis = turned(pitch=6.0, yaw=-0.8 * aside, roll=0.8 * aside)
    bend = turned(pitch=3.0 + 0.5 * cosine(t, 2.4), yaw=1.2 * aside, roll=-aside)
    look = turned(pitch=-14 + 4 * bump(t, 0.5, 1.4) + 10 * bump(t, 2.9, 3.9), yaw=aside)
    body = trunk(columns(aside, height, eased(t, [0.4, 2.2], [0.0, 5.0])), pelvis, bend, look)
    arms, feet, grips, steps = {}, {}, {}, {}
    for side in SIDES:
        grips[side] = [_on_rung(side, GRIP, *grip) for grip in GRIPS[side]]
        steps[side] = [_on_rung(side, FOOTHOLD if step[0] else FLOOR_PLACE, *step) for step in FOOTHOLDS[side]]
        wrist = stepped(t, grips[side], arc=(0.0, 2.0, -9.0))
        arms[side] = aimed_arm(side, body.chest(), (wrist, on_side(side, PALM)), on_side(side, [0.5, -1.0, -0.2]))
        ankle = stepped(t, steps[side], arc=on_side(side, (2.0, 4.0, -14.0)))
        feet[side] = Foot(ankle, on_side(side, turned(yaw=14.0)))
    return Sample(motion(body, arms, feet), supports_of_sides(t, HAND, grips) + supports_of_sides(t, FOOT, steps))


def _on_rung(side: str, place: ArrayLike, rung: int, start: float, end: float) -> Rest:
    """A rest at a place given for the left side, relative to a rung, or mirrored for the right side."""
    return Rest(start, end, on_side(side, np.add(place, (0.0, rung * SPACING, 0.0))))


# ---- a crawl on hands and knees: a hand and the knee of the other side move together

STRIDE = 44.0  # how far a hand or a knee moves in a cycle [cm]
CYCLE = 72 / FPS  # [s]
CYCLES = 3
AIR = 0.44  # part of the cycle for which a hand or a knee moves
INSTEP = 150.0  # turn of a foot whose back lies on the floor, from the standing foot [degrees]
HAND_AHEAD = 44.0  # of the wrist before the knee of the same side, both in the middle of their stance [cm]


def crawl() -> Sample:
    """Three cycles of a crawl."""
    t = clock(CYCLES * CYCLE)
    late = {"Left": 0.0, "Right": 0.5}
    knees = {side: _crawling_rests(t, side, late[side], 9.5, KNEE_HEIGHT, 0.0) for side in SIDES}
    hands = {side: _crawling_rests(t, side, 0.5 - late[side], 19.0, WRIST_HEIGHT, HAND_AHEAD) for side in SIDES}
    below = {side: stepped(t, knees[side]) for side in SIDES}
    body = _crawling_trunk(t, below)
    arms, legs = {}, {}
    for side in SIDES:
        place = stepped(t, hands[side], arc=(0.0, 7.0, 0.0)), on_side(side, flat_hand(12.0))
        arms[side] = aimed_arm(side, body.chest(), place, elbow=on_side(side, [0.35, 0.3, -1.0]))
        legs[side] = _crawling_leg(t, body.hip(side), below[side], knees[side])
    table = supports_of_sides(t, ("Knee", *FOOT), knees) + supports_of_sides(t, HAND, hands)
    return Sample(motion(body, arms, legs), table)


def _crawling_rests(t: Track, side: str, late: float, outward: float, height: float, ahead: float) -> list[Rest]:
    """The rests of a hand or a knee in all cycles; `late` is when its first swing begins, as a part of the cycle."""
    rests = []
    for cycle in range(-2, CYCLES + 1):
        start, end = cycle + late + AIR, cycle + late + 1
        if end >= 0 and start * CYCLE <= t[-1]:
            place = (SIGN[side] * outward, height, ahead + STRIDE * (start + end) / 2)
            rests.append(Rest(start * CYCLE, end * CYCLE, place))
    return rests


def _crawling_trunk(t: Track, below: dict[str, Points]) -> Trunk:
    """A trunk that moves forward at constant speed, each hip one thigh away from its knee."""
    phase = t / CYCLE
    sway = cosine(phase, 1.0, 0.72)
    pitch, yaw = 83 + 0.8 * cosine(phase, 0.5, 0.1), 4 * cosine(phase, 1.0, 0.5)
    height, roll = np.full(len(t), 50.0), np.zeros(len(t))
    for _ in range(60):
        position = columns(1.6 * sway, height, STRIDE * phase + 4.0)
        pelvis = turned(yaw=yaw) * turned(roll=roll) * turned(pitch=pitch)
        rise = {}
        for side in SIDES:
            hip = position + pelvis.apply(OFFSET[side + "Hip"])
            across = np.sum((hip - below[side])[:, [0, 2]] ** 2, axis=1)
            rise[side] = below[side][:, 1] + np.sqrt(THIGH**2 - across) - hip[:, 1]
        height = height + (rise["Left"] + rise["Right"]) / 2
        roll = roll + np.degrees((rise["Left"] - rise["Right"]) / (2 * OFFSET["LeftHip"][0]))
    return trunk(position, pelvis, turned(pitch=8.0, yaw=-2 * yaw), turned(pitch=48.0, yaw=0.4 * yaw))


def _crawling_leg(t: Track, hip: Points, below: Points, rests: list[Rest]) -> Foot:
    """A kneeling leg that slides forward with knee and foot just above the floor."""
    lift = sum(bump(t, before.end, after.start) for before, after in pairwise(rests))
    up = columns(0.0, lift, 0.0)
    knee = hip + THIGH * normalised(below + 2.5 * up - hip)
    level = np.sqrt(SHANK**2 - (INSTEP_HEIGHT - KNEE_HEIGHT) ** 2)
    behind = below + np.array([0.0, INSTEP_HEIGHT - KNEE_HEIGHT, -level])
    ankle = knee + SHANK * normalised(behind + 3.0 * up - knee)
    return Foot(ankle, turned(pitch=INSTEP - 4 * lift), knee=knee - hip)


# ---- a hand on a wall: the palm stays while the body sways, and a foot steps back and forth

WALL = 5.0  # duration [s]
WALL_HAND = Rest(1.0, 4.0, (-24.0, 131.0, 52.0))  # of the right wrist; the palm touches the wall
WALL_PALM = on_side("Right", hand(fingers=[0.12, 1.0, 0.14], palm=[0.0, -0.14, 1.0]))


def hand_on_wall() -> Sample:
    """The right hand on a wall; the left foot steps back and forward again."""
    t = clock(WALL)
    near, back = (10.0, ANKLE_HEIGHT, -4.0), (12.0, ANKLE_HEIGHT, -30.0)
    left = [Rest(-1.0, 1.5, near), Rest(2.05, 2.95, back), Rest(3.5, WALL, near)]
    right = [Rest(0.0, WALL, on_side("Right", near))]
    lifted = bump(t, 1.5, 2.05) + bump(t, 2.95, 3.5)
    feet = {
        "Left": Foot(stepped(t, left, arc=(0.0, 5.0, 0.0)), turned(8 * lifted, 8.0), 8 * lifted),
        "Right": Foot(stepped(t, right), turned(yaw=-8.0)),
    }
    aside = eased(t, [0.3, 1.3, 2.2, 2.8, 4.0, 4.8], [0, -4.5, 2.5, -4.5, -2.0, 0])
    ahead = eased(t, [0.3, 1.2, 2.3, 2.8, 3.8, 4.8], [0, 3.0, -7.0, -6.0, 4.0, 0])
    lean = eased(t, [0.3, 1.2, 2.3, 3.8, 4.8], [0, 4.0, 7.0, 5.0, 0])
    position = columns(aside, STANDING - 1.3 - 0.4 * eased(t, [1.2, 2.3, 2.8, 3.8], [0, 7, 7, 0]), ahead)
    pelvis = turned(pitch=3 + 0.5 * lean, yaw=0.3 * aside, roll=0.3 * aside)
    bend = turned(pitch=2 + lean + 0.6 * cosine(t, 3.2), yaw=5 * bump(t, 0.4, 4.6), roll=-0.5 * aside)
    body = trunk(position, pelvis, bend, turned(pitch=4 + lean, yaw=-6 * bump(t, 0.3, 4.7)))
    rotation, fingers = body.chest()[1], normalised(np.array([0.12, -0.98, 0.08]))
    wrist = WALL_HAND.reached(t, straight_arm("Right", body.chest(), fingers, 0.94), 0.75)
    wrist = wrist - columns(0.0, 0.0, 7.0 * (bump(t, 0.25, 1.0) + bump(t, 4.0, 4.75)))
    free = rotation * on_side("Right", hand(fingers, [-1.0, 0.0, 0.0]))
    turn = blend(free, WALL_PALM, Rest(0.95, 4.05, WALL_HAND.place).weight(t, 0.6))
    arm = aimed_arm("Right", body.chest(), (wrist, turn), rotation.apply([-0.6, -0.7, -0.5]))
    table = supports(t, ["Right"], HAND, [WALL_HAND]) + supports_of_sides(t, FOOT, {"Left": left, "Right": right})
    return Sample(motion(body, {"Left": hanging_arm(t), "Right": arm}, feet), table)


# ---- a kneel: a step forward, the right knee comes to the floor, and the body rises and closes the step

KNEELING = 5.2  # duration [s]
STEP = 72.0  # [cm]
TIPTOE = 62.0  # the right foot's heel up while the knee rests [degrees]
KNEEL = (1.9, 3.1)  # when the right knee comes to rest and leaves [s]
TOE = np.array([-10.0, 0.0, -4.0]) + OFFSET["RightToe"] + (0.0, ANKLE_HEIGHT, 0.0)  # the right toe joint


def kneel() -> Sample:
    """A kneel on the right knee, and rise."""
    t = clock(KNEELING)
    left = [Rest(-1.0, 0.35, (10.0, ANKLE_HEIGHT, -4.0)), Rest(0.95, KNEELING, (10.0, ANKLE_HEIGHT, STEP - 4.0))]
    toes = [Rest(-1.0, 3.7, TOE), Rest(4.5, KNEELING, TOE + np.array([0.0, 0.0, STEP]))]
    heel = eased(t, [0.55, *KNEEL, 3.7, 4.45], [0, TIPTOE, TIPTOE, 58, 0])
    ankle = stepped(t, toes, arc=(0.0, 4.0, 0.0)) - turned(pitch=heel).apply(OFFSET["RightToe"])
    kneeling_ankle = ankle[round(KNEEL[0] / KNEELING * (len(t) - 1))]
    drop = KNEE_HEIGHT - kneeling_ankle[1]
    knee = Rest(*KNEEL, kneeling_ankle + np.array([0.0, drop, np.sqrt(SHANK**2 - drop**2)]))
    down = knee.weight(t, 1.0, 0.95)
    body = _kneeling_trunk(t, down, knee.place)
    aim = columns(0.0, 0.0, 1 - down) + down[:, None] * normalised(knee.place - body.hip("Right"))
    feet = {
        "Left": Foot(stepped(t, left, arc=(0.0, 6.0, 0.0)), turned(-12 * bump(t, 0.5, 0.95), 5.0)),
        "Right": Foot(ankle, turned(pitch=heel), heel, aim),
    }
    table = [
        *supports(t, ["Left"], FOOT, left),
        *supports(t, ["Right"], FOOT[1:], toes),
        *supports(t, ["Right"], ["Ankle"], [Rest(-1.0, 0.55, TOE), Rest(4.5, KNEELING, TOE), knee]),
        *supports(t, ["Right"], ["Knee"], [knee]),
    ]
    arms = {"Left": _balancing_arm(t, down, -8, 0.0), "Right": _balancing_arm(t, down, 8, 0.3)}
    return Sample(motion(body, arms, feet), table)


def _kneeling_trunk(t: Track, down: Track, knee: Points) -> Trunk:
    """A trunk whose right hip is one thigh away from the resting knee."""
    ahead = eased(t, [0.2, KNEEL[0] + 0.05, KNEEL[1] - 0.1, 4.75], [0, 46, 46, STEP])
    lean = bump(t, 0.7, 2.2) + bump(t, 2.9, 4.4)
    pelvis = turned(pitch=3 + 7 * lean, yaw=-4 * down)
    side = eased(t, [0.1, 0.5, 1.1, 4.0, 4.4, 5.1], [0, -3.0, 0, 0, 2.5, 0])
    free = eased(t, [0.2, 1.0, 3.8, 4.8], [STANDING - 2.0, 80, 80, STANDING - 2.0])
    hip = columns(side, 0.0, ahead) + pelvis.apply(OFFSET["RightHip"])
    across = (hip[:, 0] - knee[0]) ** 2 + (hip[:, 2] - knee[2]) ** 2
    kneeling = knee[1] + np.sqrt(np.maximum(THIGH**2 - across, 0.0)) - hip[:, 1]
    height = free + down * (kneeling - free)
    bend = turned(pitch=2 + 9 * lean + 0.6 * cosine(t, 2.6), yaw=4 * down)
    return trunk(columns(side, height, ahead), pelvis, bend, turned(pitch=4 + 12 * lean))


def _balancing_arm(t: Track, down: Track, swing: float, late: float) -> Arm:
    flexion = -3 + 14 * down + swing * held(t, 0.4, 0.9, 1.2, 1.8)
    elbow = 18 + 22 * down + 1.2 * cosine(t, 3.0, late)
    return swung_arm(flexion=flexion, abduction=9 + 5 * down, elbow=elbow, roll=18, pronation=8, wrist=8)


# ---- two push-ups: a straight body turns about the toes while hands and toes rest on the floor

LEG_LENGTH = 0.9996 * (THIGH + SHANK)  # of a leg stretched almost straight
TOE_PLACE = np.array([OFFSET["LeftHip"][0], 3.0, 0.0])  # where the left toe joint rests
HAND_PLACE = np.array([25.0, WRIST_HEIGHT, 126.0])  # where the left wrist rests


def push_up() -> Sample:
    """Two push-ups."""
    t = clock(4.4)
    depth = held(t, 0.4, 1.35, 1.45, 2.2) + held(t, 2.35, 3.2, 3.3, 4.1)
    tiptoe = 70 + 6 * depth
    ankle = TOE_PLACE - turned(pitch=tiptoe).apply(OFFSET["LeftToe"])
    rise = 16.7 - 12.7 * depth  # of the body in line with the legs, from the ankles towards the head [degrees]
    pelvis = turned(pitch=90 - rise - 2.5)
    legs = turned(pitch=90 - rise).apply([0.0, LEG_LENGTH, 0.0])
    bend = turned(pitch=2.0 + 2.0 * depth + 0.6 * cosine(t, 2.2))
    position = (ankle + legs - pelvis.apply(OFFSET["LeftHip"])) * (0, 1, 1)
    body = trunk(position, pelvis, bend, turned(pitch=62 - rise / 2 + 6 * depth))
    wrist = np.tile(HAND_PLACE, (len(t), 1))
    arm = aimed_arm("Left", body.chest(), (wrist, flat_hand(8.0)), elbow=[0.75, 0.35, -0.75])
    forward = pelvis.apply(FORWARD)
    feet = {side: Foot(on_side(side, ankle), turned(pitch=tiptoe), tiptoe, forward) for side in SIDES}
    table = supports(t, SIDES, (*HAND, *FOOT[1:]), [Rest(0.0, t[-1], HAND_PLACE)])
    return Sample(motion(body, dict.fromkeys(SIDES, arm), feet), table)


# ---- sitting down on the floor and getting up, with both hands on the floor behind the body

SITTING = 5.0  # duration [s]
SEAT = Rest(2.1, 3.2, (0.0, 17.0, -52.0))  # of the hips
SEAT_HAND = Rest(1.95, 3.35, (25.0, WRIST_HEIGHT, -74.0))  # of the left wrist


def sit() -> Sample:
    """Sit down on the floor, look around, and get up; the arms reach forward for balance, then back to the floor."""
    t = clock(SITTING)
    seated = held(t, 0.35, SEAT.start, SEAT.end, 4.75)
    back = held(t, 0.3, SEAT.start - 0.1, SEAT.end + 0.1, 4.7)
    x, height, behind = SEAT.place
    stooped = bump(t, 0.4, SEAT.start) + bump(t, SEAT.end, 4.8)
    pelvis = turned(pitch=3 - 33 * seated + 32 * stooped)
    bend = turned(pitch=2 + 3 * seated + 22 * stooped + 0.6 * cosine(t, 3.0))
    position = columns(x, STANDING - 3 + seated * (height - STANDING + 3), back * behind)
    body = trunk(position, pelvis, bend, turned(pitch=3 + 14 * stooped, yaw=18 * bump(t, 2.0, 3.3)))
    rotation = body.chest()[1]
    forward = np.radians(4 + 70 * (bump(t, 0.3, 1.9) + bump(t, 3.3, 4.8)))
    fingers = normalised(columns(0.14, -np.cos(forward), np.sin(forward)))
    free = rotation * hand(fingers, [-1.0, 0.0, 0.0])
    turn = blend(free, flat_hand(130.0), Rest(1.75, 3.5, SEAT_HAND.place).weight(t, 0.6))
    wrist = SEAT_HAND.reached(t, straight_arm("Left", body.chest(), fingers, 0.95), 0.75)
    arm = aimed_arm("Left", body.chest(), (wrist, turn), rotation.apply([0.35, 0.0, -1.0]))
    table = [
        *supports(t, SIDES, FOOT, [Rest(0.0, SITTING, (0.0, 0.0, 0.0))]),
        *supports(t, SIDES, HAND, [SEAT_HAND]),
        *supports(t, [""], ["Hips", "LeftHip", "RightHip"], [SEAT]),
    ]
    return Sample(motion(body, dict.fromkeys(SIDES, arm), planted_feet(t, width=26, toe_out=12)), table)


SUPPORTED: dict[str, Callable[[], Sample]] = {
    clip.__name__: clip for clip in (cartwheel, climb_ladder, crawl, hand_on_wall, kneel, push_up, sit)
}
