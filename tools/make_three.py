"""Make the one vendored file of the player, `distretarget/report/three.min.js`, from a release of three.js.

    python tools/make_three.py [NODE_MODULES]

NODE_MODULES is a folder of npm packages with three and esbuild in the versions below; by default npm downloads them.
The file is one script that defines THREE, with the parts that the player imports and their dependencies; the licence is
beside it. `--check` exits with 1 if the file is not the one that this script made.
"""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
import tempfile
from pathlib import Path

THREE, ESBUILD = "0.187.0", "0.28.2"
SHA256 = "6cbcfc32e43c465c728c2388ce2b8ab4e6953206fc284f4443172206e6b9909f"
REPORT = Path(__file__).resolve().parents[1] / "distretarget" / "report"
FILE, LICENCE = REPORT / "three.min.js", REPORT / "three.LICENSE.txt"
BANNER = f"/*! three.js {THREE}, MIT licence, https://threejs.org: see three.LICENSE.txt */"
CORE = """
WebGLRenderer, Scene, PerspectiveCamera, Group, Color, Fog, HemisphereLight, DirectionalLight, BufferGeometry,
BufferAttribute, LatheGeometry, PlaneGeometry, LineSegments, LineBasicMaterial, Mesh, Sprite, SpriteMaterial,
MeshLambertMaterial, MeshBasicMaterial, CanvasTexture, Texture, RepeatWrapping, SRGBColorSpace, DoubleSide,
Vector2, Vector3, Quaternion, Matrix4
"""  # of three.js itself, as the script exports it
ADDONS = {
    "OrbitControls": "controls/OrbitControls",
    "Line2": "lines/Line2",
    "mergeGeometries": "utils/BufferGeometryUtils",
    "LineGeometry": "lines/LineGeometry",
    "LineMaterial": "lines/LineMaterial",
}
OPTIONS = "--bundle --minify --format=iife --global-name=THREE --target=es2022 --legal-comments=none"


def bundle(modules: Path) -> bytes:
    """Return the script made from the packages in a folder."""
    for package, wanted in (("three", THREE), ("esbuild", ESBUILD)):
        found = json.loads((modules / package / "package.json").read_text("utf-8"))["version"]
        if found != wanted:
            sys.exit(f"{modules / package} has version {found}; expected {wanted}")
    lines = [f"export {{ {CORE} }} from 'three';"]
    lines += [f"export {{ {name} }} from 'three/addons/{place}.js';" for name, place in ADDONS.items()]
    made = subprocess.run(
        [modules / "esbuild" / "bin" / "esbuild", *OPTIONS.split(), f"--banner:js={BANNER}"],
        input="\n".join(lines).encode(),
        cwd=modules.parent,
        stdout=subprocess.PIPE,
        check=True,
    )
    return made.stdout


def main(modules: Path) -> None:
    """Write the script and its licence."""
    made = bundle(modules)
    found = hashlib.sha256(made).hexdigest()
    FILE.write_bytes(made)
    LICENCE.write_bytes((modules / "three" / "LICENSE").read_bytes())
    print(f"{FILE.name}: {len(made)} bytes, SHA-256 {found}{'' if found == SHA256 else ': write it into this script'}")


if __name__ == "__main__":
    if sys.argv[1:] == ["--check"]:
        sys.exit(hashlib.sha256(FILE.read_bytes()).hexdigest() != SHA256)
    if sys.argv[1:]:
        main(Path(sys.argv[1]).resolve())
    else:
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run(["npm", "install", "--prefix", folder, f"three@{THREE}", f"esbuild@{ESBUILD}"], check=True)
            main(Path(folder) / "node_modules")
