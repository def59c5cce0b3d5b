"""Places of a body that can be touched: whichever part of a place is touched, the contact is kept."""

from __future__ import annotations

import numpy as np

from distretarget.skin.capsules import SEGMENTS

# (segments,), the place of each: the head, the trunk with the thighs, where bodies differ, the legs, and both arms
PLACE_OF = np.array(
    [
        ("head" in name or "neck" in name)
        + 2 * ("shin" in name or "foot" in name)
        + (3 + name.startswith("right")) * ("arm" in name or "hand" in name)
        for name in SEGMENTS
    ]
)
