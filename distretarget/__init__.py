"""Retarget motion to another body by normalised joint distances.

from distretarget import load_target, read_motion, retarget, write_motion

result = retarget(read_motion("walk.bvh"), load_target("hero.glb"))
write_motion("hero_walk.glb", result.motion, "hero.glb", name="walk")
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from distretarget.public import *  # noqa: F403
else:

    def __getattr__(name):
        """Import all public names when the first one is used: `distretarget --help` uses none."""
        public = vars(import_module("distretarget.public"))
        names = [each for each in public if not each.startswith("_")]
        if name not in (*names, "__all__"):
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return names if name == "__all__" else public[name]

    def __dir__():
        return [*globals(), *__getattr__("__all__")]
