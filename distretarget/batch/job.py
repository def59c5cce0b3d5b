"""One clip for a worker: what it gets, what it does, and what it returns; it has no access to files."""

from __future__ import annotations

import pickle
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import PurePath

from distretarget.batch.alignment_spread import alignment_text
from distretarget.batch.recipe import Recipe
from distretarget.batch.record import VERSION, ManifestRecord
from distretarget.batch.time_limit import OverTime, time_limit
from distretarget.character.nodes import Animation
from distretarget.contact_entries import NO_CONTACTS, ContactList
from distretarget.errors import DistretargetError
from distretarget.io.bvh_writer import bvh_parts, refusals
from distretarget.io.files import encoded_parts
from distretarget.io.input_file import InputFile
from distretarget.io.motion_file import parse_motion
from distretarget.io.motion_writer import OUTPUTS, character_animation
from distretarget.io.target_file import TargetFile, with_source
from distretarget.io.vrma import vrma
from distretarget.matching.unmatched import others_without_source, parts_without_source
from distretarget.measure.metrics import in_columns
from distretarget.numerics.parallel import thread_limit
from distretarget.pipeline.result import RetargetResult, labels_of
from distretarget.pipeline.retargeting import retarget_onto
from distretarget.report.clip_page import run_page
from distretarget.report.diff_document import About

Output = bytes | Animation


@dataclass(frozen=True)
class Packed:
    """The file of a target as it goes to workers, each of which unpacks it once for all clips."""

    content: bytes

    @classmethod
    def of(cls, target: TargetFile) -> Packed:
        """Return the file of a target, packed."""
        return cls(pickle.dumps(target))

    @property
    def file(self) -> TargetFile:
        """The file of the target."""
        return _unpacked(self.content)


@lru_cache(maxsize=4)
def _unpacked(content: bytes) -> TargetFile:
    file: TargetFile = pickle.loads(content)
    return file


@dataclass(frozen=True)
class Job:
    """A clip to retarget.

    Attributes:
        source: the file of the clip.
        target: the file of the target.
        recipe: how to retarget the clip.
        record: what the manifest says of it while it is not done.
        outputs: the paths of the results in the folder of results, that of `record` first.
        contacts: what is said of its contacts.
        about: what its report says; None for no report.
        time_limit: [s]; None for none.
        threads: of a long clip, which would keep one core busy when all others are done; None for the usual number.
    """

    source: InputFile
    target: Packed
    recipe: Recipe
    record: ManifestRecord
    outputs: tuple[str, ...]
    contacts: ContactList = NO_CONTACTS
    about: About | None = None
    time_limit: float | None = None
    threads: int | None = None

    def failed(self, reason: str) -> Result:
        """Return the result of a clip that failed; the reason names the file."""
        return Result({**self.record, "error": " ".join(reason.split())})


@dataclass(frozen=True)
class Result:
    """What became of a clip: its record and, if it is done, the content of its outputs and the HTML of its report.

    Of an output that is a character's file it has the animation alone.
    """

    record: ManifestRecord
    outputs: Mapping[str, Output] = field(default_factory=dict)
    report: str = ""


def convert(job: Job) -> Result:
    """Retarget a clip; the result has the error, if any."""
    started = time.perf_counter()
    path = job.source.path
    if job.record["version"] != VERSION:
        return job.failed(f"{path}: a worker runs version {VERSION}, this is {job.record['version']}")
    try:
        with time_limit(job.time_limit), thread_limit(job.threads):
            result = _converted(job)
    except DistretargetError as error:
        result = job.failed(str(error))
    except OverTime:
        result = job.failed(f"{path}: took longer than the limit of {job.time_limit:g} s; the next run tries it again")
    except MemoryError:
        result = job.failed(f"{path}: out of memory")
    except Exception as error:  # one clip must not stop the others
        result = job.failed(f"{path}: unexpected {type(error).__name__}: {error}; please report this")
    result.record["seconds"] = round(time.perf_counter() - started, 3)
    return result


def _converted(job: Job) -> Result:
    recipe, target = job.recipe, job.target.file
    motion, lost = parse_motion(job.source, recipe.reading.clip, recipe.reading.fps)
    builds = recipe.builds if recipe.options.skin == "none" else with_source(recipe.builds, job.source)
    result = retarget_onto(
        motion,
        target,
        source=job.source.path,
        map_file=recipe.map_file,
        options=recipe.options,
        builds=builds,
        contacts=job.contacts,
    )
    outputs = _outputs(job, target, result)
    is_bvh = any(OUTPUTS[PurePath(name).suffix] == "BVH" for name in outputs)
    refused = refusals(result.motion.skeleton) if is_bvh else ()
    record: ManifestRecord = {
        **job.record,
        "status": "done",
        "frames": len(result.motion),
        "metrics": in_columns(result.metrics),
        "verdict": result.verdict,
        "warnings": [*lost, *result.warnings],
        "notes": [*parts_without_source(result.matching), *others_without_source(result.matching), *refused],
        "alignment": alignment_text(result.matching),
    }
    return Result(record, outputs, run_page(result, job.about, target.target, job.source) if job.about else "")


def _outputs(job: Job, target: TargetFile, result: RetargetResult) -> dict[str, Output]:
    """The contents of the results of a clip, by their names."""
    writing = job.recipe.writing
    clip = writing.clip(result.motion, PurePath(job.outputs[0]).stem, result.world.up_vector)

    def made(name: str) -> Output:
        match OUTPUTS[PurePath(name).suffix]:
            case "BVH":
                return b"".join(encoded_parts(bvh_parts(clip.motion)))
            case "character":
                return character_animation(target, clip)
            case "VRMA":
                return b"".join(vrma(clip.motion, clip.name, clip.extras))
            case "arrays":
                return writing.arrays(replace(clip, labels=labels_of(result)))

    return {name: made(name) for name in job.outputs}
