"""A performer as the user asks: with contacts dropped and made, parts planted and directions kept."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from distretarget.body.build import average_for
from distretarget.ik.poses import Mapper, Poses
from distretarget.motion import Motion
from distretarget.numerics.vectors import lengths
from distretarget.objectives.asked_reach import brought_out, reached, with_looks
from distretarget.objectives.asked_springs import between, off_by, with_wishes
from distretarget.objectives.asking import Wish, Wishes, centimetres
from distretarget.objectives.contact import held_parts, solve_contact
from distretarget.objectives.skin import BodySkin, limbs_of
from distretarget.objectives.supports import Supports
from distretarget.pipeline.blending import blended
from distretarget.pipeline.performer import Performer
from distretarget.pipeline.result import RetargetResult

Array = NDArray[np.float64]
Ways = Sequence[Array | None]

NOTICED = 0.003  # what is farther off than this is told [heights]
SMOOTHING = 0.1  # what is asked changes is averaged over this time before and after [s]
ROUNDS = 2  # in which what is between parts is found
# In the end limbs close what is left, averaged over these times before and after [s], until all is nearer than `MET`
# [heights], or until what is left does not become less.
STEADY = (0.1, 0.05, 0.05, 0.03, 0.03, 0.02, 0.0, 0.0)
MET = 0.002


def dropping(performer: Performer, wishes: Wishes) -> Performer:
    """Return a performer without the contacts that wishes drop."""
    return replace(performer, clip=replace(performer.clip, drops=wishes.dropped)) if wishes.wishes else performer


def as_asked(performer: Performer, wishes: Wishes, ways: Ways = ()) -> Performer:
    """Return a performer as a user asks, in all frames in which what is asked sets in, holds or lets go."""
    made, match = wishes.made, performer.match
    ways = ways or [None] * len(made.wishes)
    supports = with_wishes(performer.supports, made, ways, match.skins, match.undersides)
    return replace(dropping(performer, wishes), supports=supports)


def asked_result(free: Performer, poses: Poses, wishes: Wishes, mapper: Mapper) -> RetargetResult:
    """Solve a clip as a user asks, and return its result; `poses` are those of the performer without what is made.

    What limbs have to reach for after a round tells the next one how to bring parts together.
    """
    made, ways = wishes.made, list[Array | None]()
    for _ in range(ROUNDS):
        asked = as_asked(free, wishes, ways)
        held = solve_contact(asked.clip, asked.supports, asked.settings, mapper=mapper)
        held = replace(held, v=poses.v + _steady(asked, held.v - poses.v))
        motion = met(asked, asked.posed(held), made)
        ways = [between(motion, wish.pair, asked.clip) if wish.pair else None for wish in made.wishes]
    log = np.where(made.share > 0.0, held.log, poses.log)
    posed = layered([made], free.with_own_skin(free.posed(poses)), motion)
    asked = replace(asked, supports=asked_supports(free.supports, asked.supports, made.share))
    return replace(asked.result(replace(poses, log=log), posed=posed), unmet=tuple(unmet(asked, made, posed)))


def _steady(performer: Performer, change: Array) -> Array:
    """What is asked changes poses by, (frames, parts + 1, 3), averaged over time where nothing rests below a part."""
    held = held_parts(performer.clip, performer.supports, performer.settings)
    held = np.concatenate([held, held.max(axis=1, keepdims=True)], axis=1)[..., None]
    return held * change + (1.0 - held) * performer.clip.averaged(change, SMOOTHING)


def asked_supports(free: Supports, asked: Supports, share: Array) -> Supports:
    """Return supports as asked where the share, (frames,), is 1, and as they are `free` where it is 0."""
    own, share = np.zeros_like(asked.weights), share[:, None]
    own[:, : len(free.joints)] = free.weights
    return replace(asked, weights=(1.0 - share) * own + share * asked.weights)


def met(asked: Performer, motion: Motion, wishes: Wishes) -> Motion:
    """Return a motion with its limbs and looks as a user asks; skin stays outside."""
    skins, body = asked.match.skins, asked.match.matching.target
    given = wishes, asked.supports, limbs_of(body), skins
    motion = with_looks(motion, wishes, body)
    thick = skins.target if skins else BodySkin.of(body, average_for(body).on(body))
    motion = brought_out(motion, *given[:3], thick, body)
    motion = asked.with_own_skin(reached(motion, *given, STEADY[0]))
    left, last = _farthest(asked, wishes, motion), np.inf
    for steady in STEADY:
        if left <= MET * body.height or left >= last:
            break
        motion, last = reached(motion, *given, steady), left
        left = _farthest(asked, wishes, motion)
    return with_looks(motion, wishes, body)


def _farthest(performer: Performer, wishes: Wishes, posed: Motion) -> float:
    """How far a motion is off what is asked, at most [file units]."""
    return float(max((off.max() for _, off in _off(performer, wishes, posed)), default=0.0))


def unmet(performer: Performer, wishes: Wishes, posed: Motion) -> Iterator[str]:
    """Yield how far off what is asked is in a motion, for what is not met; `performer` is as asked."""
    for wish, off in _off(performer, wishes, posed):
        if off.max() > NOTICED * performer.match.matching.target.height:
            name, worst = " - ".join(wish.entry.named), int(off.argmax())
            cm = centimetres(performer.clip.unit) * off[worst]
            yield f"{name} misses what was asked for by up to {cm:.1f} cm, at frame {worst}"


def _off(performer: Performer, wishes: Wishes, posed: Motion) -> Iterator[tuple[Wish, Array]]:
    """Yield wishes, and how far they are off in a motion where they are to be met, (frames,) [file units]."""
    clip = wishes.clip
    for wish in wishes.wishes:
        off = lengths(off_by(wishes, wish, posed, performer.supports, performer.match.skins)) * clip.unit
        yield wish, np.where(wish.frames & (wish.weight == 1.0), off, 0.0)


def layered(asked: Sequence[Wishes], without: Motion, held: Motion) -> Motion:
    """Return the motion `held` in the frames of all wishes, blended into that `without` them."""
    wishes = [wish for each in asked for wish in each.wishes]
    lead = np.max([wish.lead * wish.frames for wish in wishes], axis=0)
    share = np.max([each.share * each.on for each in asked], axis=0)
    shots = np.sum([each.clip.shots for each in asked], axis=0)  # a new shot at the cuts of any performer
    return blended(without, held, share, lead, shots)
