"""Skinned characters as glTF files in memory, with the true places of their joints as known answers.

Nothing here uses the package's own code of glTF: json, struct and numpy alone.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from gltf_file import Gltf, glb
from scipy.spatial.transform import Rotation

from distretarget import Motion, Skeleton
from distretarget.body.anatomy import ARM, LEG
from distretarget.body.axes import axis_vector
from distretarget.numerics.quaternions import least_rotation

METRES = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "dm": 0.1, "in": 0.0254, "ft": 0.3048}
ARMATURE = np.diag([0.01, 0.01, 0.01, 1.0])
ARMATURE[:3, :3] = 0.01 * Rotation.from_euler("X", -90, degrees=True).as_matrix()
"""What stands above the joints of a character in cm, Z up, as exporters write it."""


@dataclass(frozen=True, eq=False)
class Bones:
    """The joints of a character in its bind pose, in the world of the file: Y up.

    Attributes:
        names: of the joints.
        parents: (joints,), -1 for roots; parents come first.
        positions: (joints, 3) [m].
    """

    names: tuple[str, ...]
    parents: np.ndarray
    positions: np.ndarray

    @classmethod
    def of(cls, skeleton: Skeleton, units: str = "cm", stand: bool = True) -> Bones:
        """The rest pose of a skeleton without its End Sites, whose file may not state units; it stands on the floor."""
        scale, turn = METRES[skeleton.units or units], _upright(skeleton)
        positions = scale * turn.apply(skeleton.rest_positions)
        if stand:
            positions[:, 1] -= positions[:, 1].min()
        joints = np.flatnonzero(~skeleton.end_sites)
        numbers = np.cumsum(~skeleton.end_sites) - 1
        parents = np.where(skeleton.parents[joints] < 0, -1, numbers[skeleton.parents[joints]])
        return cls(tuple(skeleton.names[joint] for joint in joints), parents, positions[joints])

    def renamed(self, names: Mapping[str, str] | Sequence[str]) -> Bones:
        """The same joints with other names: one each, or new by old."""
        if isinstance(names, Mapping):
            names = [names.get(name, name) for name in self.names]
        return replace(self, names=tuple(names))

    def turned(self, turn: Rotation) -> Bones:
        return replace(self, positions=turn.apply(self.positions))

    def children(self, joint: int) -> list[int]:
        return np.flatnonzero(self.parents == joint).tolist()

    def tips(self) -> np.ndarray:
        """(joints, 3), where the bone of each joint ends: at its children, or a little further than its parent's."""
        ends = np.empty_like(self.positions)
        for joint, parent in enumerate(self.parents):
            if below := self.children(joint):
                ends[joint] = self.positions[below].mean(axis=0)
            else:
                before = self.positions[parent] if parent >= 0 else self.positions[joint] - [0, 0.2, 0]
                ends[joint] = self.positions[joint] + 0.5 * (self.positions[joint] - before)
        short = np.linalg.norm(ends - self.positions, axis=1) < 1e-4
        ends[short] = self.positions[short] + [0, 0.03, 0]
        return ends

    def along_bones(self, roll: float | np.ndarray = 0.0) -> Rotation:
        """World rotations with Y along the bones, rolled about them [rad], as Blender and Mixamo have them."""
        along = self.tips() - self.positions
        least = Rotation.from_quat(least_rotation(np.tile([0.0, 1.0, 0.0], (len(along), 1)), along))
        return least * Rotation.from_rotvec(np.broadcast_to(roll, len(along))[:, None] * [0.0, 1.0, 0.0])


def _upright(skeleton: Skeleton) -> Rotation:
    """What brings the up axis of a skeleton onto Y."""
    return Rotation.from_quat(least_rotation(axis_vector(skeleton.up or "Y")[None], axis_vector("Y")[None])[0])


@dataclass(frozen=True, eq=False)
class Performance:
    """Where the joints of a character are, and how they have turned in the world since the bind pose.

    Attributes:
        turns: (frames, joints, 4).
        positions: (frames, joints, 3) [m].
        times: (frames,) [s].
    """

    turns: np.ndarray
    positions: np.ndarray
    times: np.ndarray

    @classmethod
    def of(cls, motion: Motion, units: str = "cm") -> Performance:
        """The performance by `Bones.of` of a motion's skeleton."""
        scale, turn = METRES[motion.skeleton.units or units], _upright(motion.skeleton)
        joints = np.flatnonzero(~motion.skeleton.end_sites)
        turns = turn * Rotation.from_quat(motion.world_rotations[:, joints]) * turn.inv()
        positions = scale * turn.apply(motion.positions[:, joints].reshape(-1, 3)).reshape(len(motion), -1, 3)
        return cls(turns.as_quat(), positions, motion.frame_time * np.arange(len(motion)))

    @classmethod
    def swaying(
        cls, bones: Bones, frames: int = 20, angle: float = 0.5, seed: int = 0, rate: float = 30
    ) -> Performance:
        """Every joint turns smoothly by up to about `angle` [rad], and roots move along."""
        draw = np.random.default_rng(seed)
        joints = len(bones.names)
        phases = np.linspace(0, 3, frames)[:, None, None] + draw.uniform(0, 6, (joints, 3))
        own = Rotation.from_rotvec((angle * np.sin(phases) * draw.uniform(-1, 1, (joints, 3))).reshape(-1, 3))
        own = own.as_matrix().reshape(frames, joints, 3, 3)
        turns, positions = own.copy(), np.tile(bones.positions, (frames, 1, 1))
        for joint, parent in enumerate(bones.parents):
            if parent < 0:
                positions[:, joint] += 0.2 * np.sin(phases[:, joint])
                continue
            turns[:, joint] = turns[:, parent] @ own[:, joint]
            along = turns[:, parent] @ (bones.positions[joint] - bones.positions[parent])
            positions[:, joint] = positions[:, parent] + along
        quaternions = Rotation.from_matrix(turns.reshape(-1, 3, 3)).as_quat().reshape(frames, joints, 4)
        return cls(quaternions, positions, np.arange(frames) / rate)

    def __getitem__(self, frames: slice) -> Performance:
        return Performance(self.turns[frames], self.positions[frames], self.times[frames])

    def turned(self, turn: Rotation) -> Performance:
        """The performance of `Bones.turned`."""
        turns = turn * Rotation.from_quat(self.turns) * turn.inv()
        return replace(self, turns=turns.as_quat(), positions=self.positions @ turn.as_matrix().T)


@dataclass(frozen=True, eq=False)
class Mesh:
    """A skinned mesh in the bind pose, in the world of the file.

    Attributes:
        points: (points, 3) [m].
        triangles: (triangles, 3).
        joints: (points, 4), of `Bones`.
        weights: (points, 4), each row adds up to 1.
        normals: (points, 3), or None.
        colour: its material's.
    """

    points: np.ndarray
    triangles: np.ndarray
    joints: np.ndarray
    weights: np.ndarray
    normals: np.ndarray | None = None
    colour: tuple[float, float, float] = (0.7, 0.6, 0.5)


def box_mesh(bones: Bones, joints: Iterable[int] | None = None) -> Mesh:
    """A box along the bone of each joint, or of some, which follows this joint and at its start its parent a little."""
    points, triangles, indices, weights = [], [], [], []
    corners = np.array([(x, y, z) for y in (0, 1) for x, z in ((-1, -1), (1, -1), (1, 1), (-1, 1))], float)
    sides = [(0, 1, 2), (0, 2, 3), (4, 6, 5), (4, 7, 6)]
    for a in range(4):
        b = (a + 1) % 4
        sides += [(a, a + 4, b), (b, a + 4, b + 4)]
    tips, axes = bones.tips(), bones.along_bones().as_matrix()
    for joint in range(len(bones.names)) if joints is None else joints:
        length = np.linalg.norm(tips[joint] - bones.positions[joint])
        size = np.array([0.15 * length + 0.01, length, 0.15 * length + 0.01])
        triangles.append(np.array(sides) + 8 * len(points))
        points.append(bones.positions[joint] + (corners * size) @ axes[joint].T)
        parent = max(bones.parents[joint], 0)
        indices.append(np.tile([joint, parent, 0, 0], (8, 1)))
        share = np.where(corners[:, 1] == 0, 0.25 if parent != joint else 0.0, 0.0)
        weights.append(np.stack([1 - share, share, 0 * share, 0 * share], axis=1))
    indices, weights = np.concatenate(indices), np.concatenate(weights)
    return Mesh(np.concatenate(points), np.concatenate(triangles), np.where(weights > 0, indices, 0), weights)


def chunks(content: bytes) -> tuple[dict, bytes]:
    """The JSON and the binary chunk of a GLB file."""
    magic, version, length = struct.unpack_from("<4sII", content)
    assert (magic, version, length) == (b"glTF", 2, len(content))
    size, kind = struct.unpack_from("<II", content, 12)
    assert kind == 0x4E4F534A
    rest = content[20 + size :]
    return json.loads(content[20 : 20 + size]), rest[8 : 8 + struct.unpack_from("<I", rest)[0]] if rest else b""


def packed(document: dict | str, buffer: bytes = b"") -> bytes:
    """A GLB file of a document, or of the text of one, and a buffer."""
    text = document if isinstance(document, str) else json.dumps(document)
    return glb(text.encode(), buffer + bytes(-len(buffer) % 4))


@dataclass
class Character(Gltf):
    """A skinned character.

    Attributes:
        bones: its joints in the bind pose: the known answer.
        joints: (joints,), the node of each of them.
        parents: the parent of each node.
        bind: (nodes, 4, 4), where each node is in the bind pose [m].
    """

    bones: Bones = None
    joints: list[int] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    bind: list[np.ndarray] = field(default_factory=list)
    matrices: bool = False

    def node(self, name: str, parent: int, world: np.ndarray, **entry: object) -> int:
        """Append a node, given by where it is in the world in the bind pose, and return its number."""
        local = np.linalg.inv(self.bind[parent]) @ world if parent >= 0 else world
        number = self.add("nodes", name=name or None, **self._transform(local), **entry)
        self.parents.append(parent)
        self.bind.append(np.asarray(world, float))
        if parent >= 0:
            self.document["nodes"][parent].setdefault("children", []).append(number)
        else:
            self.document["scenes"][0]["nodes"].append(number)
        return number

    def _transform(self, local: np.ndarray) -> dict:
        if self.matrices:
            return {"matrix": local.T.ravel().tolist()}
        translation, rotation, scale = parts(local)
        properties = {
            "translation": (translation, [0, 0, 0]),
            "rotation": (rotation, [0, 0, 0, 1]),
            "scale": (np.full(3, scale), [1, 1, 1]),
        }
        return {
            name: value.tolist() for name, (value, usual) in properties.items() if np.abs(value - usual).max() > 1e-12
        }

    def worlds(self, performance: Performance) -> np.ndarray:
        """(frames, nodes, 4, 4), where each node is in a performance [m]: others go with the joint above them."""
        moves = np.tile(np.eye(4), (len(performance.times), len(self.parents), 1, 1))
        turns = Rotation.from_quat(performance.turns).as_matrix()
        numbers = {node: joint for joint, node in enumerate(self.joints)}
        for node, parent in enumerate(self.parents):
            if node in numbers:
                joint = numbers[node]
                moves[:, node, :3, :3] = turns[:, joint]
                moves[:, node, :3, 3] = performance.positions[:, joint] - turns[:, joint] @ self.bones.positions[joint]
            elif parent >= 0:
                moves[:, node] = moves[:, parent]
        return moves @ np.array(self.bind)

    def locals(self, performance: Performance) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Translations, (frames, nodes, 3), rotations, (frames, nodes, 4), scales, (frames, nodes), to the parent."""
        worlds = self.worlds(performance)
        local = worlds.copy()
        for node, parent in enumerate(self.parents):
            if parent >= 0:
                local[:, node] = np.linalg.inv(worlds[:, parent]) @ worlds[:, node]
        return parts(local)

    def show(self, performance: Performance, frame: int = 0) -> None:
        """Let the nodes show a frame of a performance instead of the bind pose; the skins stay as they are."""
        translations, rotations, scales = self.locals(performance[frame : frame + 1])
        for node in self.joints:
            entry = self.document["nodes"][node]
            for name in ("matrix", "translation", "rotation", "scale"):
                entry.pop(name, None)
            local = np.eye(4)
            local[:3, :3] = scales[0, node] * Rotation.from_quat(rotations[0, node]).as_matrix()
            local[:3, 3] = translations[0, node]
            entry |= self._transform(local)

    def skin(
        self,
        mesh: Mesh,
        parent: int = -1,
        world: np.ndarray | None = None,
        *,
        joints: Iterable[int] | None = None,
        space: np.ndarray | None = None,
        skeleton: int | None = None,
        name: str = "Body",
    ) -> int:
        """Append a skinned mesh and return its node.

        Args:
            mesh: the mesh.
            parent: the node below which it hangs.
            world: where its node is; where its parent is if None. By glTF the node does not move the mesh.
            joints: the joints that the skin lists, in their order; those that it needs if None.
            space: the space of the mesh's points, (4, 4) [m]: `world` if None.
            skeleton: the node that the skin names as its root.
            name: of node, mesh and skin.
        """
        if world is None:
            world = self.bind[parent] if parent >= 0 else np.eye(4)
        space = world if space is None else space
        listed = np.unique(mesh.joints[mesh.weights > 0]).tolist() if joints is None else list(joints)
        binds = np.linalg.inv(np.array([self.bind[self.joints[joint]] for joint in listed])) @ space
        binds[:, 3] = [0, 0, 0, 1]
        order = {joint: number for number, joint in enumerate(listed)}
        own = np.vectorize(lambda joint: order.get(joint, 0))(mesh.joints).astype("u2")
        back = np.linalg.inv(space)
        attributes = {"POSITION": self.accessor(_moved(back, mesh.points), bounds=True, target=34962)}
        if mesh.normals is not None:
            normals = mesh.normals @ back[:3, :3].T
            normals /= np.linalg.norm(normals, axis=1, keepdims=True)
            attributes["NORMAL"] = self.accessor(normals, target=34962)
        attributes["JOINTS_0"] = self.accessor(own, "u2", target=34962)
        attributes["WEIGHTS_0"] = self.accessor(mesh.weights.astype("f4"), target=34962)
        skin = self.add(
            "skins",
            name=name,
            joints=[self.joints[joint] for joint in listed],
            inverseBindMatrices=self.accessor(binds),
            skeleton=skeleton,
        )
        return self.node(name, parent, world, mesh=self._mesh(name, mesh, attributes), skin=skin)

    def rigid(self, name: str, joint: int, offset: Sequence[float] = (0, 0.1, 0), size: float = 0.1) -> int:
        """Append a mesh without a skin that hangs on a joint, such as a hat, and return its node."""
        one = Bones((name,), np.array([-1]), np.zeros((1, 3)))
        mesh = box_mesh(one)
        mesh = replace(mesh, points=size * mesh.points / np.abs(mesh.points).max(), colour=(0.2, 0.3, 0.8))
        world = np.eye(4)
        world[:3, 3] = self.bones.positions[joint] + offset
        attributes = {"POSITION": self.accessor(mesh.points, bounds=True, target=34962)}
        return self.node(name, self.joints[joint], world, mesh=self._mesh(name, mesh, attributes))

    def _mesh(self, name: str, mesh: Mesh, attributes: dict) -> int:
        colour = {"baseColorFactor": [*mesh.colour, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.9}
        material = self.add("materials", name=name, pbrMetallicRoughness=colour, doubleSided=True)
        triangles = self.accessor(mesh.triangles.reshape(-1).astype("u4"), "u4", target=34963)
        primitive = {"attributes": attributes, "indices": triangles, "material": material}
        return self.add("meshes", name=name, primitives=[primitive])

    def animate(
        self,
        name: str,
        performance: Performance,
        interpolation: str = "LINEAR",
        *,
        rotations: str = "f4",
        all_translations: bool = False,
        scales: bool = False,
        stride: int | None = None,
        sparse: bool = False,
        still: bool = True,
        flipped: bool = False,
    ) -> int:
        """Append an animation whose keys are the frames of a performance, and return its number.

        Args:
            name: of the animation.
            performance: what it shows.
            interpolation: of all channels; the tangents of CUBICSPLINE are 0.
            rotations: the type of their numbers: "f4", or "i2" or "i1", which are normalized and coarse.
            all_translations: whether every joint has a channel of translation, or the root alone.
            scales: whether there are channels of scale as well, constant.
            stride: of the rotations, as in `accessor`.
            sparse: of the rotations, as in `accessor`.
            still: whether joints that do not turn have a channel.
            flipped: whether every other rotation is stored as -q.
        """
        shifts, turns, sizes = self.locals(performance)
        times = self.accessor(performance.times, bounds=True)
        channels, samplers = [], []

        def channel(node: int, path: str, values: np.ndarray, dtype: str = "f4", **more: object) -> None:
            if interpolation == "CUBICSPLINE":
                values = np.stack([0 * values, values, 0 * values], axis=1).reshape(-1, values.shape[1])
            output = self.accessor(values, dtype, **more)
            samplers.append({"input": times, "output": output, "interpolation": interpolation})
            channels.append({"sampler": len(samplers) - 1, "target": {"node": node, "path": path}})

        for joint, node in enumerate(self.joints):
            quaternions = smooth(turns[:, node])
            if flipped:
                quaternions = quaternions * np.where(np.arange(len(quaternions)) % 2, -1, 1)[:, None]
            if still or np.ptp(quaternions, axis=0).max() > 1e-9:
                channel(node, "rotation", quaternions, rotations, stride=stride, sparse=sparse)
            if all_translations or self.bones.parents[joint] < 0:
                channel(node, "translation", shifts[:, node])
            if scales:
                channel(node, "scale", np.tile(sizes[:, node, None], (1, 3)))
        return self.add("animations", name=name or None, channels=channels, samplers=samplers)


def parts(matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Translations (..., 3), rotations (..., 4) and uniform scales (...) of matrices (..., 4, 4)."""
    scales = np.cbrt(np.linalg.det(matrices[..., :3, :3]))
    rotations = Rotation.from_matrix(matrices[..., :3, :3] / scales[..., None, None]).as_quat()
    return matrices[..., :3, 3], rotations, scales


def smooth(quaternions: np.ndarray) -> np.ndarray:
    """Quaternions (frames, 4) with signs such that each is near the one before."""
    signs = np.where((quaternions[1:] * quaternions[:-1]).sum(axis=1) < 0, -1.0, 1.0)
    return quaternions * np.append(1.0, np.cumprod(signs))[:, None]


def _moved(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def character(
    bones: Bones,
    *,
    axes: Rotation | None = None,
    above: np.ndarray | None = None,
    scales: Mapping[int, float] | None = None,
    helpers: Iterable[int] = (),
    matrices: bool = False,
    meshes: Iterable[Mesh] | None = (),
    under: bool = True,
    mesh_world: np.ndarray | None = None,
    space: np.ndarray | None = None,
    all_joints: bool = True,
) -> Character:
    """A skinned character as a glTF file.

    Args:
        bones: its joints in the bind pose.
        axes: the world rotation of each joint in the bind pose; none turns if None, see `Bones.along_bones`.
        above: the matrix of a node "Armature" above the joints, such as `ARMATURE`; no such node if None.
        scales: uniform scales of single joints, which those below them share.
        helpers: joints that have a node which is no joint between them and their parent.
        matrices: whether nodes have a matrix instead of translation, rotation and scale.
        meshes: skinned meshes, each with a skin; one `box_mesh` if empty, no mesh and no skin if None.
        under: whether meshes hang below "Armature".
        mesh_world: where the nodes of the meshes are, (4, 4) [m]; where their parent is if None.
        space: the space of the points of the meshes, (4, 4) [m]; that of their nodes if None.
        all_joints: whether every skin lists all joints, or those that it needs.
    """
    made = Character(bones=bones, matrices=matrices)
    made.document |= {"scene": 0, "scenes": [{"nodes": []}]}
    top = -1 if above is None else made.node("Armature", -1, above)
    size = 1.0 if above is None else float(parts(above)[2])
    turns = np.tile(np.eye(3), (len(bones.names), 1, 1)) if axes is None else axes.as_matrix()
    sizes = np.empty(len(bones.names))
    for joint, (name, parent) in enumerate(zip(bones.names, bones.parents, strict=True)):
        sizes[joint] = (sizes[parent] if parent >= 0 else size) * (scales or {}).get(joint, 1.0)
        world = np.eye(4)
        world[:3, :3], world[:3, 3] = sizes[joint] * turns[joint], bones.positions[joint]
        node = made.joints[parent] if parent >= 0 else top
        if joint in set(helpers):
            between = made.bind[node].copy() if node >= 0 else np.eye(4)
            between[:3, :3] = between[:3, :3] @ Rotation.from_rotvec([0.3, -0.5, 0.7]).as_matrix()
            between[:3, 3] += 0.4 * (bones.positions[joint] - between[:3, 3]) + 0.02
            node = made.node(f"{name}_offset", node, between)
        made.joints.append(made.node(name, node, world))
    for number, mesh in enumerate([] if meshes is None else meshes or [box_mesh(bones)]):
        made.skin(
            mesh,
            top if under else -1,
            mesh_world,
            joints=range(len(bones.names)) if all_joints else None,
            name=f"Body{number or ''}",
            **({} if space is None else {"space": space}),
        )
    return made


TRUNK = ("Hips", "Chest", "Chest2", "Chest3", "Neck", "Head")
LIMBS = ("Collar", "Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle", "Toe")
PERSON = dict(zip(("hips", "spine", "chest", "upperChest", "neck", "head"), TRUNK, strict=True)) | {
    side.lower() + bone: side + joint
    for side in ("Left", "Right")
    for bone, joint in zip((*ARM, *LEG), LIMBS, strict=True)
}
"""The joints of the samples by VRM's names of bones."""


def as_vrm1(made: Character, humanoid: Mapping[str, str] = PERSON, *, springs: Iterable[str] = ()) -> Character:
    """Add what VRM 1.0 needs: bones of the humanoid, by names of joints, meta, and spring bones from some joints on."""
    made.uses("VRMC_vrm", "VRMC_springBone", "VRMC_materials_mtoon")
    for material in made.document.get("materials", []):
        toon = {"specVersion": "1.0", "shadeColorFactor": [0.4, 0.3, 0.3], "shadingToonyFactor": 0.9}
        material["extensions"] = {"VRMC_materials_mtoon": toon}
    bones = {bone: {"node": _node(made, joint)} for bone, joint in humanoid.items()}
    extensions = made.document.setdefault("extensions", {})
    extensions["VRMC_vrm"] = {
        "specVersion": "1.0",
        "meta": {
            "name": "a test",
            "version": "1",
            "authors": ["a test"],
            "licenseUrl": "https://vrm.dev/licenses/1.0/",
            "avatarPermission": "everyone",
        },
        "humanoid": {"humanBones": bones},
        "expressions": {"preset": {"happy": {"isBinary": True}}},
    }
    joints = [{"node": _node(made, joint), "stiffness": 1.5, "hitRadius": 0.02} for joint in springs]
    colliders = [{"node": made.joints[0], "shape": {"sphere": {"offset": [0, 0.1, 0], "radius": 0.1}}}]
    extensions["VRMC_springBone"] = {
        "specVersion": "1.0",
        "colliders": colliders,
        "colliderGroups": [{"name": "hips", "colliders": [0]}],
        "springs": [{"name": "swinging", "joints": joints, "colliderGroups": [0]}] if joints else [],
    }
    return made


def as_vrm0(made: Character, humanoid: Mapping[str, str] = PERSON) -> Character:
    """Add what VRM 0 needs. Its characters look to -Z, which `Bones.turned` has to see to."""
    made.uses("VRM")
    thumbs = {"ThumbProximal": "ThumbIntermediate", "ThumbMetacarpal": "ThumbProximal"}  # their names in VRM 0
    bones = []
    for bone, joint in humanoid.items():
        side = next((side for side in ("left", "right") if bone.startswith(side)), "")
        name = side + thumbs.get(bone[len(side) :], bone[len(side) :])
        bones.append({"bone": name, "node": _node(made, joint), "useDefaultValues": True})
    made.document.setdefault("extensions", {})["VRM"] = {
        "exporterVersion": "a test",
        "specVersion": "0.0",
        "meta": {"title": "a test", "version": "1", "author": "a test", "allowedUserName": "Everyone"},
        "humanoid": {"humanBones": bones, "hasTranslationDoF": False},
        "firstPerson": {"firstPersonBone": bones[0]["node"]},
        "blendShapeMaster": {"blendShapeGroups": []},
        "secondaryAnimation": {"boneGroups": [], "colliderGroups": []},
        "materialProperties": [
            {
                "name": material["name"],
                "shader": "VRM_USE_GLTFSHADER",
                "renderQueue": 2000,
                **{f"{kind}Properties": {} for kind in ("float", "vector", "texture")},
                **{f"{kind}Map": {} for kind in ("keyword", "tag")},
            }
            for material in made.document.get("materials", [])
        ],
    }
    return made


def as_vrma(made: Character, humanoid: Mapping[str, str] = PERSON) -> Character:
    """Add what a VRM animation needs to a character without meshes."""
    made.uses("VRMC_vrm_animation")
    bones = {bone: {"node": _node(made, joint)} for bone, joint in humanoid.items()}
    extension = {"specVersion": "1.0", "humanoid": {"humanBones": bones}}
    made.document.setdefault("extensions", {})["VRMC_vrm_animation"] = extension
    return made


def _node(made: Character, joint: str) -> int:
    return made.joints[made.bones.names.index(joint)]


LOOKING_BACK = Rotation.from_euler("Y", 180, degrees=True)
"""What turns a character that looks to +Z to where VRM 0 has it."""


def with_unknown_parts(made: Character) -> Character:
    """Add extensions and extras that nobody has heard of, some with what looks like numbers of nodes."""
    made.uses("ACME_wind")
    made.document.setdefault("extensions", {})["ACME_wind"] = {"nodes": [0, 1], "strength": 0.1234567890123456789}
    made.document["extras"] = {"ünïcode": "日本語 \u2603", "float": 1e-30, "nested": [{"a": [1, 2.50, None, True]}]}
    made.document["asset"]["extras"] = {"kept": [0.1, 1.0, 100000000000000000000]}
    for node in made.joints[:3]:
        made.document["nodes"][node]["extras"] = {"node": node}
    made.view(b"nobody refers to these bytes")
    return made
