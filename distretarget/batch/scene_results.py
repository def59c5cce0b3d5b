"""The results of a scene among those of a folder of scenes, where a manifest says from what they were made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from distretarget.batch.manifest import Manifest, ManifestRecord, new_record
from distretarget.batch.plan import Clip
from distretarget.io.files import Content, encoded_parts, hash_of, hash_of_file, read_bytes, write_whole
from distretarget.io.motion_writer import DEFAULT_OUTPUT
from distretarget.io.target_file import TargetFile
from distretarget.scene.scene_file import SceneSetup


@dataclass(frozen=True, eq=False)
class SceneResults:
    """The files of results of a scene.

    Attributes:
        manifest: of the folder of results.
        records: the lines of files in the manifest, by their paths.
        overwrite: whether to make them again, and to replace files that no scene of this folder made.
    """

    manifest: Manifest
    records: Mapping[Path, ManifestRecord]
    overwrite: bool

    @classmethod
    def of(
        cls,
        manifest: Manifest,
        file: Path,
        setup: SceneSetup,
        target: TargetFile,
        paths: Sequence[Path],
        overwrite: bool,
    ) -> SceneResults:
        """Return the results of the scene in a file, whose first performer has this target.

        Raises:
            FileError: a file of the scene cannot be read.
        """
        content = hash_of(*(hash_of(read_bytes(path)).encode() for path in (file, *setup.inputs)))
        folder = manifest.path.parent
        records = {
            path: new_record(Clip(file, target, path.relative_to(folder), 0), asdict(DEFAULT_OUTPUT))
            | {"input_hash": content}
            for path in paths
        }
        return cls(manifest, records, overwrite)

    def are_done(self) -> bool:
        """Return whether an earlier run made all files from the same scene, unless they are to be made again."""
        files = self.records.items()
        return not self.overwrite and all(self.manifest.is_done(record, hash_of_file(path)) for path, record in files)

    def check_replaceable(self) -> None:
        """Raise a FileError if one of the files exists and may be replaced only with --overwrite."""
        for path, record in self.records.items():
            if not self.overwrite:
                self.manifest.check_replaceable(record, path, hash_of_file(path))

    def write(self, path: Path, parts: Content) -> None:
        """Write one of the files; its line of the manifest comes just before the file is put in place."""
        content = b"".join(encoded_parts(parts))
        record = self.records[path] | {"status": "done", "output_hash": hash_of(content)}
        with self.manifest.locked():
            self.check_replaceable()
            write_whole(path, content, overwrite=True, complete=lambda: self.manifest.add(record))
