"""Build the extension for Blender: a zip that contains the wheels it needs.

    python tools/make_blender.py FOLDER [--platform linux-x64] [--wheel WHEEL]

numpy is part of Blender; scipy, click, tqdm and ufbx are downloaded for the platform and each Python of Blender, which
installs the wheels for its own. WHEEL is distretarget's for the platform; by default it is built here
(DISTRETARGET_PLATFORM builds others). In Blender: Edit > Preferences > Get Extensions > Install from Disk.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import tomllib
import zipfile
from pathlib import Path

import click

ROOT = Path(__file__).resolve().parents[1]
NEEDED = ("scipy", "click", "tqdm", "ufbx==0.0.5")  # besides numpy, which Blender has
PYTHONS = ("3.11", "3.13")  # of Blender 4.2 to 5.0, and from 5.1 on
PLATFORMS = {  # pip's names by Blender's
    "linux-x64": ("manylinux_2_28_x86_64", "manylinux_2_17_x86_64", "manylinux2014_x86_64"),
    "windows-x64": ("win_amd64",),
    "macos-arm64": ("macosx_14_0_arm64", "macosx_12_0_arm64"),
}
MANIFEST = """schema_version = "1.0.0"
id = "distretarget"
version = "{version}"
name = "distretarget"
tagline = "Retarget motion: hands that touch still touch, feet stay where they stand"
maintainer = "The distretarget developers"
type = "add-on"
website = "https://github.com/distretarget/distretarget"
tags = ["Animation", "Rigging"]
blender_version_min = "4.2.0"
license = ["SPDX:GPL-3.0-or-later"]
platforms = ["{platform}"]
wheels = [
{wheels}
]

[permissions]
files = "Read clips, and keep a job in a temporary folder while it runs"
"""


def download(folder: Path, platform: str) -> None:
    """Download the needed wheels for a platform and each Python."""
    systems = [word for name in PLATFORMS[platform] for word in ("--platform", name)]
    command = [sys.executable, "-m", "pip", "download", "-q", "--no-deps", "--only-binary=:all:", "-d", str(folder)]
    for python in PYTHONS:
        subprocess.run([*command, "--python-version", python, *systems, *NEEDED], check=True)


@click.command(help=__doc__)
@click.argument("folder", type=click.Path(path_type=Path, file_okay=False))
@click.option("--platform", type=click.Choice([*PLATFORMS]), default="linux-x64", show_default=True)
@click.option("--wheel", type=click.Path(exists=True, path_type=Path), help="The wheel of distretarget.")
def main(folder: Path, platform: str, wheel: Path | None) -> None:
    """Write the zip into a folder, and print its name and size."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        wheels = Path(name)
        download(wheels, platform)
        if wheel is None:
            subprocess.run([sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", name, str(ROOT)], check=True)
        files = sorted([*wheels.glob("*.whl"), *([wheel] if wheel else [])], key=lambda path: path.name)
        listed = "\n".join(f'  "./wheels/{path.name}",' for path in files)
        version = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["version"]
        manifest = MANIFEST.format(version=version, platform=platform, wheels=listed)
        path = folder / f"distretarget_blender_{platform}.zip"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("blender_manifest.toml", manifest)
            for source in sorted((ROOT / "blender").glob("*.py")):
                archive.write(source, source.name)
            for each in files:
                archive.write(each, f"wheels/{each.name}", zipfile.ZIP_STORED)
    print(f"{path}: {path.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
