"""Write `docs/interop.md`: how far other programs find the joints of written files from where this package has them.

    DISTRETARGET_NODE=FOLDER DISTRETARGET_BLENDER=PYTHON python tools/make_interop.py

FOLDER is where `npm install three assimpjs @babylonjs/core @babylonjs/loaders` was run, PYTHON that of an environment
with the package bpy. A program that is missing gets its reason into the table.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))
from interop.judged import CASES, FRAMES, farthest, written
from interop.readers import READERS, Reader
from tables import table

PAGE = Path(__file__).resolve().parents[1] / "docs" / "interop.md"
TEXT = """\
# Other programs

Written by `tools/make_interop.py`. Other programs read files that `distretarget` has written, and the
positions that they compute for the joints are compared with those of `distretarget`, over {frames} frames. The table
has the largest distance between the two, in heights of the body. `tests/interop/` asks for less than 1e-4.

{table}
What to know:

- three.js cannot play joints with a colon in their names, such as `mixamorig:Hips`: `--strip-namespace` writes `Hips`.
  The files above are written so.
- Position channels below the root, which rigs for game engines have, are added to the OFFSET by three.js and refused by
  pybvh. Blender, assimp, Babylon.js and bvhio replace the OFFSET by them, as `distretarget` does.
- Blender turns files to its own axes as it imports them, Z up. With "Forward: Y, Up: Z" it leaves them as they are. Its
  first frame is frame 1.
- assimp's numbers have 6 digits.

The tests of a program are skipped, with the reason, where it is missing. To run them all:

```text
npm install three assimpjs @babylonjs/core @babylonjs/loaders        in a folder outside the project
python3.11 -m venv blender && blender/bin/pip install bpy            likewise
DISTRETARGET_NODE=FOLDER DISTRETARGET_BLENDER=blender/bin/python .venv/bin/pytest tests/interop
```
"""


def cells(reader: Reader) -> Iterator[str]:
    """The cells of a reader: how far it finds joints in each file, or why it cannot be asked."""
    yield reader.name
    for case in CASES:
        if reason := reader.missing():
            yield reason
        else:
            with tempfile.TemporaryDirectory() as folder:
                yield f"{farthest(reader, *written(case, Path(folder))):.0e}"


def page() -> str:
    """The text of the page."""
    return TEXT.format(frames=FRAMES, table=table(["", *CASES], map(cells, READERS)))


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8", newline="\n")
