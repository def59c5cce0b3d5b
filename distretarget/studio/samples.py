"""The samples that the studio offers: in the folders of the repository, and of a wheel in the package."""

from importlib.resources import files

from distretarget.errors import FileError

SAMPLES = {
    "clap.bvh": "sample_bvh",
    "walk.bvh": "sample_bvh",
    "hands_on_hips.bvh": "sample_bvh",
    "hero.glb": "sample_characters",
}  # and their folders; pyproject.toml says what a wheel has


def sample(name: str) -> bytes:
    """Return the content of a sample; a FileError if there is none of that name."""
    package = files("distretarget")
    for folder in (package, package / ".."):
        file = folder / SAMPLES.get(name, "") / name
        if name in SAMPLES and file.is_file():
            return file.read_bytes()
    raise FileError(name, f"is no sample; there are {', '.join(SAMPLES)}")
