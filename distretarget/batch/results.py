"""The folder of results: what is done in it, how a result gets into it, and how one that is not kept goes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, partial
from pathlib import Path

from distretarget.batch.keep import Condition
from distretarget.batch.manifest import Manifest
from distretarget.batch.record import ManifestRecord
from distretarget.io.files import check_inside, hash_of, hash_of_file, make_folder, write_whole
from distretarget.io.gltf_writer import Parts


@dataclass(frozen=True)
class Results:
    """A folder of results.

    Attributes:
        folder: where it is.
        overwrite: whether to make again what is done, and to replace files that no batch made.
        keep: clips that fail this condition are left out.
        read_only: whether nothing is to be written, not even a manifest.
    """

    folder: Path
    overwrite: bool = False
    keep: Condition | None = None
    read_only: bool = False

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
        for path, name in ((self.folder / name, name) for name in outputs if not self.overwrite):
            self.manifest.check_replaceable(record, path, hash_of_file(path), name)

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
                    self.manifest.check_replaceable(record, path, there, name)
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
