"""The builds of bodies in files: how thick they are."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from distretarget.body.body import Body
from distretarget.body.build import BUILDS, Build, Builds, average_build, capsules_of
from distretarget.errors import DistretargetError, FileError
from distretarget.io.input_file import InputFile, load_file
from distretarget.io.target_file import parse_full_target


def load_build(path: str | Path) -> Build:
    """Return the build of the body in a file: a character whose mesh shows it (GLB, glTF, VRM, FBX), or a skeleton file
    with radii; or an average build by its name: "adult", "child", "baby", "old", "thin", "fat" or "muscular". Any body
    that is recognised can have it.

    Raises:
        FileError: the file cannot be read, shows no thickness, or no human body is recognised in it; or no average
            build has this name.
        SkeletonFileError, BvhError: it is not valid.
    """
    if str(path) in BUILDS:
        return average_build(str(path))
    if not Path(path).suffix and not Path(path).exists():
        raise FileError(path, f"is neither a file nor an average build ({', '.join(BUILDS)})")
    return parse_build(load_file(path))


def parse_build(file: InputFile) -> Build:
    """Return the build of the body in a file as `load_build` does."""
    target = parse_full_target(file)
    body, mesh = Body.of(target.skeleton, target.motion), target.mesh()
    if body.anatomy is None:
        raise FileError(file.path, "shows no human body, so that another body cannot be as thick as it")
    if mesh is None and not target.radii:
        raise FileError(file.path, "does not show how thick its body is; expected a GLB, VRM or FBX with a mesh")
    return Build.of(body, capsules_of(body, mesh, target.radii))


def with_source(builds: Builds, file: InputFile) -> Builds:
    """Return the builds with that of the source, whose motion is in this file, where its mesh shows it."""
    if builds.source is not None or file.kind not in ("glTF", "FBX"):
        return builds
    with suppress(DistretargetError):
        return replace(builds, source=parse_build(file))
    return builds
