"""The settings of the contact objective that an animator may want to change; all others are constants."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

from distretarget.checks import brief
from distretarget.errors import SettingsError


@dataclass(frozen=True, kw_only=True, repr=False)
class ContactSettings:
    """How strongly self-contacts and foot lock act; the defaults suit every clip and body.

    Attributes:
        strength: [-] stiffness of contacts against the source's rotations; 2 is twice as stiff.
        reach: [-] two joints may be in contact up to this normalised distance D, Eq. (1), and fade out over the next
            0.05. A larger reach keeps more contacts and changes the motion more.
        blend: [s] a contact blends in over twice this time, and out over twice this time; longer is smoother.
        foot_lock: [-] how strongly feet and other resting joints are held in place; 1 is usual, 0 leaves them free.

    Raises:
        SettingsError: a value is no finite number, or less than 0.
    """

    strength: float = 1.0
    reach: float = 0.13
    blend: float = 0.36
    foot_lock: float = 1.0

    __repr__ = brief

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not isinstance(value, int | float) or not 0 <= value < math.inf:
                raise SettingsError(f"{name} is {value!r}; it has to be a finite number, not less than 0")


DEFAULT_SETTINGS = ContactSettings()
