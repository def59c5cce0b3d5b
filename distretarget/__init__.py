"""Retarget BVH motion to another body by normalised joint distances.

from distretarget import load_target, read_bvh, retarget, write_bvh

result = retarget(read_bvh("walk.bvh"), load_target("hero.json"))
write_bvh("walk_hero.bvh", result.motion)
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from distretarget.public import *  # noqa: F403
else:

    def __getattr__(name):
        """Import all public names when the first is used, and return it: `distretarget --help` uses none."""
        public = import_module("distretarget.public")
        if not hasattr(public, name):
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(public, name)

    def __dir__():
        return [*globals(), *__getattr__("__all__")]
