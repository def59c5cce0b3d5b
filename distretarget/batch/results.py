"""The folder of results: what is done in it, which results are kept, how they get into it and go, and how all of them
become animations of one file.
"""

from __future__ import annotations

import ast
import operator
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, cached_property, partial
from itertools import pairwise
from pathlib import Path, PurePath

from distretarget.batch.manifest import Manifest
from distretarget.batch.plan import MANIFEST, METRICS, Clip
from distretarget.batch.record import ManifestRecord
from distretarget.errors import SettingsError, closest
from distretarget.io.files import check_inside, hash_of, hash_of_file, make_folder, write_whole
from distretarget.io.gltf_writer import Parts
from distretarget.io.input_file import load_file
from distretarget.io.motion_file import parse_motion
from distretarget.io.motion_writer import OutputSettings, character_animation, with_animations
from distretarget.io.target_file import TargetFile
from distretarget.measure.metrics import COLUMNS

LONGEST = 1000  # condition [characters]
COMPARISONS: dict[type[ast.cmpop], Callable[[float, float], bool]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
NAMES = ("frames", "warnings", *COLUMNS)
FALSE, UNKNOWN, TRUE = 0.0, 0.5, 1.0  # "and" is the least of some values, "or" the largest, "not" 1 minus the value

Values = Mapping[str, float | None]


@dataclass(frozen=True)
class Condition:
    """A condition on the metrics of a clip, such as "contact_error < 0.01 and pop == 0"; a SettingsError if it is none.

    It has names of metrics, numbers, comparisons, and, or, not, and brackets; nothing else is evaluated. What was not
    measured in a clip, such as the error of contacts where nothing touches, decides nothing: a comparison with it is
    neither true nor false, and a clip is kept unless its condition is false. This is Kleene's logic of three values.
    """

    text: str

    def __post_init__(self) -> None:
        self._value(self._tree, dict.fromkeys(NAMES))

    @cached_property
    def _tree(self) -> ast.expr:
        if len(self.text) > LONGEST:
            raise SettingsError(f"keep has {len(self.text)} characters; expected up to {LONGEST}")
        try:
            return ast.parse(self.text.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise self._refusal from None

    @property
    def _refusal(self) -> SettingsError:
        return SettingsError(
            f"keep is {self.text!r}; expected comparisons of metrics and numbers with and, or, not, such as "
            "'contact_error < 0.01 and pop == 0'"
        )

    def fault(self, record: ManifestRecord) -> str:
        """Return why a clip fails the condition; empty if it does not."""
        counts: dict[str, float | None] = {"frames": record["frames"], "warnings": len(record["warnings"])}
        values = {**dict.fromkeys(COLUMNS), **record["metrics"], **counts}
        faults = []
        for part in self._false_parts(self._tree, values):
            names = dict.fromkeys(_known(each.id) for each in ast.walk(part) if isinstance(each, ast.Name))
            faults.append(
                f"{', '.join(f'{name} is {values[name]:.4g}' for name in names)}, expected {ast.unparse(part)}"
            )
        return "; ".join(faults)

    def _value(self, node: ast.expr, values: Values) -> float:
        """Whether a part of the condition is `TRUE`, `FALSE` or `UNKNOWN`."""
        match node:
            case ast.BoolOp(op=op, values=parts):
                decisive = min if isinstance(op, ast.And) else max
                return decisive([self._value(part, values) for part in parts])
            case ast.UnaryOp(op=ast.Not(), operand=part):
                return TRUE - self._value(part, values)
            case ast.Compare(left=left, ops=ops, comparators=others) if all(type(op) in COMPARISONS for op in ops):
                numbers = [self._operand(each, values) for each in (left, *others)]
                return min(
                    UNKNOWN if a is None or b is None else float(COMPARISONS[type(op)](a, b))
                    for op, (a, b) in zip(ops, pairwise(numbers), strict=True)
                )
        raise self._refusal

    def _operand(self, node: ast.expr, values: Values) -> float | None:
        match node:
            case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
                return value
            case ast.Name(id=name):
                if _known(name) not in NAMES:
                    raise SettingsError(f"keep has {name!r}, which is no metric; {closest(name, NAMES)}")
                return values[_known(name)]
        raise self._refusal

    def _false_parts(self, node: ast.expr, values: Values) -> Iterator[ast.expr]:
        """The parts, joined by "and", that make a part of the condition false; none if it is not."""
        if self._value(node, values) != FALSE:
            return
        if isinstance(node, ast.BoolOp) and isinstance(node.op, ast.And):
            for part in node.values:
                yield from self._false_parts(part, values)
        else:
            yield node


def _known(name: str) -> str:
    """The name of a metric, which may be given in the plural: pops."""
    return name if name in NAMES else name.removesuffix("s")


@dataclass(frozen=True)
class Results:
    """A folder of results."""

    folder: Path
    overwrite: bool = False  # whether to make again what is done, and to replace files that no batch made
    keep: Condition | None = None  # clips that fail it are left out
    read_only: bool = False  # whether nothing is to be written, not even a manifest

    @cached_property
    def manifest(self) -> Manifest:
        """The manifest; unless `read_only`, the first use makes folder and manifest."""
        return Manifest(self.folder, self.read_only)

    def known(self, record: ManifestRecord, outputs: Sequence[str]) -> ManifestRecord | None:
        """Return the record of a clip that needs no work: it is done, or was left out and would be again; else None."""
        if self.overwrite:
            return None
        if made := self.manifest.made(record, {name: hash_of_file(self.folder / name) for name in outputs}):
            return made
        left_out = self.manifest.left_out(record)
        return left_out if left_out and self._fault(left_out) else None

    def again(self, known: ManifestRecord, outputs: Sequence[str]) -> ManifestRecord | None:
        """Note that a clip needs no work; return its record if it is left out, None if it is done."""
        if self._fault(known):
            return self._leave_out(known, outputs)
        self.manifest.confirm(known["output"], known["output_hash"])
        return None

    def check_replaceable(self, record: ManifestRecord, outputs: Sequence[str]) -> None:
        """Raise a FileError if one of the results exists and may be replaced only with --overwrite."""
        for name in outputs if not self.overwrite else ():
            self.manifest.check_replaceable(record, name, hash_of_file(self.folder / name))

    def put(self, record: ManifestRecord, contents: Mapping[str, Parts]) -> ManifestRecord:
        """Put the results of a clip, by their paths in the folder, in place, unless it is left out, and return its
        record. Its line of the manifest comes just before the first result is put in place.

        Raises:
            FileError: a result cannot be written; then the first one is as before.
        """
        first, *others = contents
        if self._fault(record):
            return self._leave_out(record, (first, *others))
        hashes = {name: hash_of(*parts) for name, parts in contents.items()}
        record = {**record, "output_hash": hashes[first], "others": {name: hashes[name] for name in others}}
        for name in contents:
            check_inside(self.folder / name, self.folder)
        make_folder((self.folder / first).parent)
        with self.manifest.locked():
            add = cache(partial(self.manifest.add, record))  # once
            for name in (*others, first):
                path = self.folder / name
                there = hash_of_file(path)
                if there == hashes[name]:  # another run was faster
                    add()
                    continue
                if not self.overwrite:
                    self.manifest.check_replaceable(record, name, there)
                write_whole(path, contents[name], self.overwrite or there is not None, add)
        return record

    def _fault(self, record: ManifestRecord) -> str:
        """Why a clip is not kept; empty if it is."""
        return self.keep.fault(record) if self.keep else ""

    def _leave_out(self, record: ManifestRecord, outputs: Sequence[str]) -> ManifestRecord:
        """Say in the manifest that a clip is left out, and remove results of it that a batch has made."""
        fault = self._fault(record)
        if record["left_out"] == fault:
            return record
        gone: ManifestRecord = {**record, "status": "failed", "error": f"left out: {fault}", "left_out": fault}
        gone |= {"output_hash": "", "others": {}, "alignment": ""}
        with self.manifest.locked():
            for path, name in ((self.folder / name, name) for name in outputs):
                check_inside(path, self.folder)
                if self.manifest.has_made(name, hash_of_file(path)):
                    path.unlink(missing_ok=True)
            self.manifest.add(gone)
        return gone


def clips_folder(path: Path) -> Path:
    """Return the folder beside a file that keeps its clips as BVH, with a manifest, until the file is written; so an
    interrupted run continues where it stopped.
    """
    return path.with_name(f"{path.name}.clips")


def write_merged(
    path: Path, target: TargetFile, clips: Sequence[Clip], settings: OutputSettings, overwrite: bool
) -> int:
    """Write the character file with an animation for each clip that is done, in the order of their names, and return
    how many; if all are done, the folder of clips goes, and its manifest and metrics stay beside the file.

    An animation has its clip's name, or in a tree of folders its path in it.

    Raises:
        DistretargetError: the file cannot be written.
    """
    folder = clips_folder(path)
    done = [PurePath(clip.output) for clip in clips if (folder / clip.output).is_file()]
    animations = []
    for place in sorted(done, key=lambda place: place.with_suffix("")):
        motion, _ = parse_motion(load_file(folder / place))
        animations.append(character_animation(target, settings.clip(motion, place.with_suffix("").as_posix())))
    write_whole(path, with_animations(path, target, animations, settings.animations), overwrite)
    if len(done) == len(clips):
        for name in (MANIFEST, METRICS):
            with suppress(OSError):
                (folder / name).replace(path.with_name(f"{path.name}.{name}"))
        shutil.rmtree(folder, ignore_errors=True)
    return len(animations)
