"""Builds the compiled functions into a wheel, or for an editable installation into the package.

The environment variable DISTRETARGET_PLATFORM names another platform than this machine's, such as darwin-aarch64.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from packaging.tags import platform_tags

OTHER = os.environ.get("DISTRETARGET_PLATFORM", "")


class LibraryHook(BuildHookInterface):
    """The library of `distretarget.numerics.build`, in the wheel."""

    def dependencies(self) -> list[str]:
        """Return what links the library where the system's compiler cannot."""
        return [] if shutil.which("cc") and not OTHER else ["ziglang==0.17.1"]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build the library, and say what the wheel is for."""
        sys.path.insert(0, self.root)
        from distretarget.numerics.build import PLATFORMS

        package = Path("distretarget", "numerics")
        self._scratch = tempfile.TemporaryDirectory()
        folder = Path(self.root, package) if version == "editable" else Path(self._scratch.name)
        command = [sys.executable, "-m", "distretarget.numerics.build", str(folder), *filter(None, [OTHER])]
        if status := subprocess.run(command, cwd=self.root).returncode:
            raise SystemExit(status)
        if version != "editable":
            build_data["force_include"] |= {str(path): str(package / path.name) for path in folder.iterdir()}
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{PLATFORMS[OTHER].wheel if OTHER else next(platform_tags())}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:  # noqa: ARG002
        """Remove what was built apart from the wheel."""
        self._scratch.cleanup()
