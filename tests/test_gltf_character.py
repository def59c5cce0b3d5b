"""The character of an FBX file, written as GLB with its mesh and a motion."""

import json
import zlib

import numpy as np
import pygltflib
import pytest
from bodies import SAMPLES, person
from fbx_text import FPS_30, Y_UP, Z_UP, MeshOfNodes, Node, fbx
from program import succeeded

from distretarget import FileError, load_target, read_bvh, read_motion, retarget, write_motion

pytest.importorskip("ufbx")

CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
TO_Z_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # vectors are rows


def png():
    """A picture of one red pixel."""

    def chunk(kind, data):
        return len(data).to_bytes(4, "big") + kind + data + zlib.crc32(kind + data).to_bytes(4, "big")

    header = (1).to_bytes(4, "big") * 2 + bytes([8, 2, 0, 0, 0])
    parts = chunk(b"IHDR", header), chunk(b"IDAT", zlib.compress(b"\0\xff\0\0")), chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


def character(up="Y", image=""):
    """An FBX file in centimetres: a person with a little tetrahedron at each joint."""
    body = person()
    turn = np.eye(3) if up == "Y" else TO_Z_UP
    offsets, places = 100.0 * body.offsets @ turn, 100.0 * body.rest_positions @ turn
    nodes = [
        Node(name, int(parent), T=tuple(offset))
        for name, parent, offset in zip(body.names, body.parents, offsets, strict=True)
    ]
    count = len(nodes)
    binds = {joint: np.eye(4) for joint in range(count)}
    for joint in range(count):
        binds[joint][:3, 3] = places[joint] + offsets[0]
    vertices = np.concatenate([bind[:3, 3] + 2.0 * CORNERS for bind in binds.values()])
    triangles = np.concatenate([4 * joint + FACES for joint in range(count)])
    sides = vertices[triangles]
    flat = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    uv = np.tile([[0.0, 0.0], [1.0, 0.0], [0.0, 0.5]], (len(triangles), 1, 1))
    mesh = MeshOfNodes(
        binds, vertices, np.repeat(np.arange(count), 4), triangles, np.repeat(flat[:, None], 3, axis=1), uv, image=image
    )
    settings = {"UnitScaleFactor": 1.0, **(Y_UP if up == "Y" else Z_UP), **FPS_30}
    return fbx(nodes, mesh=mesh, settings=settings)


@pytest.fixture
def written(tmp_path):
    """Where a character is written, and a clip on it as GLB, by the axis that is up and the name of an image."""

    def write(up="Y", image="", ending=".glb"):
        path, out = tmp_path / "hero.fbx", tmp_path / f"out{ending}"
        path.write_bytes(character(up, image))
        return path, out, succeeded(SAMPLES / "wave.bvh", path, "-o", out)

    return write


def in_metres(places, up):
    return 0.01 * (places if up == "Y" else places @ np.linalg.inv(TO_Z_UP))


@pytest.mark.parametrize("up", ["Y", "Z"])
@pytest.mark.parametrize("ending", [".glb", ".gltf"])
def test_joints_and_mesh_are_where_they_are_on_the_fbx_file(written, up, ending):
    path, out, _ = written(up, ending=ending)
    target, found = load_target(path), load_target(out)
    result = retarget(read_bvh(SAMPLES / "wave.bvh"), target).motion
    motion = read_motion(out)
    assert motion.skeleton.names == result.skeleton.names
    np.testing.assert_allclose(motion.positions, in_metres(result.positions, up), atol=1e-4)
    own, other = target.mesh(), found.mesh()
    expected = in_metres(own.posed(result[50:51])[0][own.triangles], up)
    np.testing.assert_allclose(other.posed(motion[50:51])[0][other.triangles], expected, atol=1e-4)


def test_corners_keep_their_normals_and_places_on_images(written, tmp_path):
    (tmp_path / "skin.png").write_bytes(png())
    _, out, ran = written(image="textures\\\\skin.png")
    file = pygltflib.GLTF2().load_binary(str(out))
    (primitive,) = file.meshes[0].primitives
    data = file.binary_blob()

    def numbers(accessor, kind, width):
        entry = file.accessors[accessor]
        view = file.bufferViews[entry.bufferView]
        return np.frombuffer(data, kind, entry.count * width, view.byteOffset).reshape(-1, width)

    order = numbers(primitive.indices, "<u4", 1).ravel()
    places = numbers(primitive.attributes.POSITION, "<f4", 3)[order].reshape(-1, 3, 3)
    normals = numbers(primitive.attributes.NORMAL, "<f4", 3)[order].reshape(-1, 3, 3)
    flat = np.cross(places[:, 1] - places[:, 0], places[:, 2] - places[:, 0])
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    np.testing.assert_allclose(normals, np.repeat(flat[:, None], 3, axis=1), atol=1e-5)
    uv = numbers(primitive.attributes.TEXCOORD_0, "<f4", 2)[order].reshape(-1, 3, 2)
    np.testing.assert_allclose(uv, np.tile([[0.0, 1.0], [1.0, 1.0], [0.0, 0.5]], (len(uv), 1, 1)), atol=1e-6)
    (image,) = file.images
    view = file.bufferViews[image.bufferView]
    assert data[view.byteOffset : view.byteOffset + view.byteLength] == png()
    assert "base colours" in ran.stdout + ran.stderr


@pytest.mark.parametrize("content", [None, b"BM no picture of glTF"])
def test_an_image_that_cannot_be_kept_is_told(written, tmp_path, content):
    if content:
        (tmp_path / "skin.bmp").write_bytes(content)
    _, out, ran = written(image="skin.bmp")
    assert (
        f"an image of the FBX file is left out: 'skin.bmp' is {'neither' if content else 'not beside'}"
        in ran.stdout + ran.stderr
    )
    assert not pygltflib.GLTF2().load_binary(str(out)).images


def test_an_image_is_not_read_from_outside_the_folder(written, tmp_path):
    (tmp_path.parent / "secret.png").write_bytes(png())
    _, out, _ = written(image="../secret.png")
    assert not pygltflib.GLTF2().load_binary(str(out)).images


def test_without_a_mesh_it_is_refused(tmp_path):
    body = person()
    nodes = [
        Node(name, int(parent), T=tuple(100 * o))
        for name, parent, o in zip(body.names, body.parents, body.offsets, strict=True)
    ]
    path = tmp_path / "hero.fbx"
    path.write_bytes(fbx(nodes))
    motion = retarget(read_bvh(SAMPLES / "wave.bvh")[:2], load_target(path)).motion
    with pytest.raises(FileError, match=r"no mesh to write; write \.bvh"):
        write_motion(tmp_path / "out.glb", motion, path)
    assert not (tmp_path / "out.glb").exists()


def test_a_batch_writes_glb_of_an_fbx_file(tmp_path):
    path = tmp_path / "hero.fbx"
    path.write_bytes(character())
    succeeded("batch", SAMPLES / "wave.bvh", path, "-o", tmp_path / "all.glb", "--merge", "--jobs", 1)
    text = (tmp_path / "all.glb").read_bytes()
    assert [
        each["name"] for each in json.loads(text[20 : 20 + int.from_bytes(text[12:16], "little")])["animations"]
    ] == ["wave"]
