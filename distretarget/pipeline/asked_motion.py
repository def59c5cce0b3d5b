"""A performer as the user asks: with contacts dropped and made, parts planted and directions kept."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from distretarget.ik.poses import Mapper, Poses
from distretarget.motion import Motion
from distretarget.objectives.asked_springs import how_far_off, nearer, with_wishes
from distretarget.objectives.asking import Wishes
from distretarget.objectives.contact import solve_contact
from distretarget.pipeline.performer import Performer

Array = NDArray[np.float64]


NOTICED = 1.5  # what is farther off than this is worth a warning [cm]
ROUNDS = 4  # in which gaps of skins that are asked for come nearer


def as_asked(performer: Performer, wishes: Wishes) -> Performer:
    """Return a performer with its clip and supports as a user asks."""
    skins, undersides = performer.match.skins, performer.match.undersides
    supports = with_wishes(performer.supports, wishes, skins, undersides)
    return replace(performer, clip=replace(performer.clip, asked=wishes.asked), supports=supports, wishes=wishes)


def solve_as_asked(performer: Performer, wishes: Wishes, mapper: Mapper) -> tuple[Performer, Poses]:
    """Solve a clip as a user asks: where skins are to touch, again and again from what their gaps were off."""
    skins = performer.match.skins
    rounds = ROUNDS if skins and wishes.asked.touches else 1
    for number in range(rounds):
        asked = as_asked(performer, wishes)
        poses = solve_contact(asked.clip, asked.supports, asked.settings, mapper=mapper)
        if skins and number < rounds - 1:
            solved = asked.posed(poses)
            wishes = nearer(wishes, solved, asked.with_own_skin(solved), skins)
    return asked, poses


def unmet(performer: Performer, wishes: Wishes, posed: Motion) -> Iterator[str]:
    """Yield how far off contacts and distances are in a motion, for those that are not met."""
    for wish in wishes.wishes:
        off = how_far_off(wishes, wish, posed, performer.match.skins)
        if off is not None and off.max() > NOTICED:
            name, worst = " - ".join(wish.named), int(off.argmax())
            yield f"{name} is up to {off[worst]:.1f} cm off what is asked, at frame {worst}"


def spliced(without: Motion, asked: Motion, share: Array) -> Motion:
    """Return the motion `without` what is asked where the share, (frames,), is 0, the other where it is 1, and what
    lies between them elsewhere.
    """
    share = share[:, None]
    roots = np.where(
        share > 0.0, (1.0 - share) * without.root_positions + share * asked.root_positions, without.root_positions
    )
    roots = np.where(share < 1.0, roots, asked.root_positions)
    a, b, w = without.rotations, asked.rotations, share[..., None]
    same = np.where((a * b).sum(axis=-1, keepdims=True) < 0.0, -1.0, 1.0)
    mixed = (1.0 - w) * a + w * same * b
    mixed /= np.maximum(np.linalg.norm(mixed, axis=-1, keepdims=True), 1e-12)
    rotations = np.where(w <= 0.0, a, np.where(w >= 1.0, b, mixed))
    return replace(without, root_positions=roots, rotations=rotations)
