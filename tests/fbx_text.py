"""FBX files for tests, written as text: nodes, keys, skins and bind poses, as few words as readers accept."""

from dataclasses import dataclass, field

import numpy as np

SECOND = 46_186_158_000  # the unit of time of FBX
PROPERTIES = {"T": "Lcl Translation", "R": "Lcl Rotation", "S": "Lcl Scaling"}
Y_UP = {"UpAxis": 1, "UpAxisSign": 1, "FrontAxis": 2, "FrontAxisSign": 1, "CoordAxis": 0, "CoordAxisSign": 1}
Z_UP = {"UpAxis": 2, "UpAxisSign": 1, "FrontAxis": 1, "FrontAxisSign": -1, "CoordAxis": 0, "CoordAxisSign": 1}
FPS_30 = {"TimeMode": 6}


@dataclass
class Node:
    """A node: its parent's index, the vectors `T`, `R` and `S`, and properties such as {"PreRotation": (0, 90, 0)}."""

    name: str
    parent: int = -1
    T: tuple = (0.0, 0.0, 0.0)
    R: tuple = (0.0, 0.0, 0.0)
    S: tuple = (1.0, 1.0, 1.0)
    kind: str = "LimbNode"
    properties: dict = field(default_factory=dict)


@dataclass
class Stack:
    """An animation: {(node, "T", axis): (times [s], values)}, and its span of time [s]."""

    name: str
    curves: dict = field(default_factory=dict)
    span: tuple = (0.0, 1000.0)


@dataclass
class MeshOfNodes:
    """A mesh whose vertices each move with one node, bound where the nodes are in the world, {node: (4, 4)}. Each
    corner has a normal and a place on the image of its material.
    """

    binds: dict
    vertices: np.ndarray  # (vertices, 3), in the world
    of_vertex: np.ndarray  # (vertices,), the node of each
    triangles: np.ndarray  # (triangles, 3)
    normals: np.ndarray  # (triangles, 3, 3)
    uv: np.ndarray  # (triangles, 3, 2)
    colour: tuple = (0.2, 0.4, 0.6)
    image: str = ""  # the name of a file beside this one


def fbx(nodes, stacks=(), skin=None, pose=None, settings=None, mesh=None):
    """The bytes of a file; `skin` and `pose` give nodes their world matrices, {node: (4, 4)}."""
    settings = {"UnitScaleFactor": 1.0, **Y_UP, **FPS_30} if settings is None else settings
    objects, links = [], []
    for number, node in enumerate(nodes):
        objects.append(_node(number, node))
        links.append(f'C: "OO",{_id(number)},{_id(node.parent) if node.parent >= 0 else 0}')
        if node.kind in ("LimbNode", "Null"):
            flag = "Skeleton" if node.kind == "LimbNode" else "Null"
            objects.append(
                f'NodeAttribute: {9000 + number}, "NodeAttribute::", "{node.kind}" {{ TypeFlags: "{flag}" }}'
            )
            links.append(f'C: "OO",{9000 + number},{_id(number)}')
    for number, stack in enumerate(stacks):
        _add_stack(objects, links, 1_000_000 * (number + 1), stack, nodes)
    if skin is not None:
        _add_skin(objects, links, skin)
    if mesh is not None:
        _add_mesh(objects, links, mesh)
    if pose is not None:
        entries = " ".join(f"PoseNode: {{ Node: {_id(node)} Matrix: {_array(m.T)} }}\n" for node, m in pose.items())
        objects.append(f'Pose: 8000, "Pose::", "BindPose" {{ Type: "BindPose"\nVersion: 100\n{entries} }}')
    return "\n".join(
        [
            "; FBX 7.4.0 project file",
            "FBXHeaderExtension: { FBXHeaderVersion: 1003",
            " FBXVersion: 7400 }",
            f"GlobalSettings: {{ Version: 1000\n {_properties(settings)} }}",
            "Objects: {",
            *objects,
            "}",
            "Connections: {",
            *links,
            "}",
            "",
        ]
    ).encode()


def _id(number):
    return 1000 + number


def _node(number, node):
    values = {"RotationActive": 1, "InheritType": 1, **node.properties}
    values |= {PROPERTIES[letter]: getattr(node, letter) for letter in PROPERTIES}
    return f'Model: {_id(number)}, "Model::{node.name}", "{node.kind}" {{ Version: 232\n {_properties(values)} }}'


def _properties(values):
    lines = []
    for name, value in values.items():
        kind = name if name.startswith("Lcl") else "Vector3D" if np.ndim(value) else "double"
        kind = "int" if isinstance(value, int) else "KTime" if name.startswith("Local") else kind
        numbers = ",".join(map(repr, map(float, value))) if np.ndim(value) else repr(value)
        lines.append(f'P: "{name}", "{kind}", "", "A",{numbers}')
    return "Properties70: {\n" + "\n".join(lines) + "\n}"


def _array(values):
    values = np.ravel(values).tolist()
    return f"*{len(values)} {{ a: {','.join(map(repr, values))} }}"


def _add_stack(objects, links, first, stack, nodes):
    span = {name: round(time * SECOND) for name, time in zip(("LocalStart", "LocalStop"), stack.span, strict=True)}
    objects.append(
        f'AnimationStack: {first}, "AnimStack::{stack.name}", "" {{ {_properties(span)} }}'.replace('"int"', '"KTime"')
    )
    objects.append(f'AnimationLayer: {first + 1}, "AnimLayer::Base", "" {{ }}')
    links.append(f'C: "OO",{first + 1},{first}')
    groups = {}
    for (node, letter, axis), (times, values) in stack.curves.items():
        if (node, letter) not in groups:
            group = groups[node, letter] = first + 10 + len(groups)
            still = _properties(
                {f"d|{each}": value for each, value in zip("XYZ", getattr(nodes[node], letter), strict=True)}
            )
            objects.append(f'AnimationCurveNode: {group}, "AnimCurveNode::{letter}", "" {{ {still} }}')
            links.append(f'C: "OO",{group},{first + 1}')
            links.append(f'C: "OP",{group},{_id(node)}, "{PROPERTIES[letter]}"')
        group = groups[node, letter]
        curve = first + 500_000 + 3 * group % 100_000 + "XYZ".index(axis)
        ticks = [round(time * SECOND) for time in times]
        objects.append(
            f'AnimationCurve: {curve}, "AnimCurve::", "" {{ Default: 0\n KeyVer: 4008\n KeyTime: {_array(ticks)}\n'
            f" KeyValueFloat: {_array(np.float64(values))}\n KeyAttrFlags: *1 {{ a: 4 }}\n"
            f" KeyAttrDataFloat: *4 {{ a: 0,0,0,0 }}\n KeyAttrRefCount: *1 {{ a: {len(ticks)} }}\n }}"
        )
        links.append(f'C: "OP",{curve},{group}, "d|{axis}"')


def _add_skin(objects, links, skin):
    objects += [
        'Geometry: 7000, "Geometry::", "Mesh" { Vertices: *9 { a: 0,0,0,1,0,0,0,1,0 }\n'
        " PolygonVertexIndex: *3 { a: 0,1,-3 }\n }",
        'Model: 7001, "Model::Mesh", "Mesh" { Version: 232\n }',
        'Deformer: 7002, "Deformer::", "Skin" { Version: 101\n }',
    ]
    links += ['C: "OO",7001,0', 'C: "OO",7000,7001', 'C: "OO",7002,7000']
    for node, matrix in skin.items():
        _add_cluster(objects, links, node, matrix, np.array([0]))


def _add_cluster(objects, links, node, matrix, vertices):
    cluster = 7100 + node
    objects.append(
        f'Deformer: {cluster}, "SubDeformer::", "Cluster" {{ Version: 100\n'
        f" Indexes: {_array(vertices)}\n Weights: {_array(np.ones(len(vertices)))}\n"
        f" Transform: {_array(np.linalg.inv(matrix).T)}\n TransformLink: {_array(matrix.T)}\n }}"
    )
    links += [f'C: "OO",{cluster},7002', f'C: "OO",{_id(node)},{cluster}']


def _add_mesh(objects, links, mesh):
    corners = np.array(mesh.triangles)
    ends = np.where(np.arange(3) == 2, -corners - 1, corners)  # of a face
    layers = "".join(
        f'LayerElement{kind}: 0 {{ Version: 101\n MappingInformationType: "ByPolygonVertex"\n'
        f' ReferenceInformationType: "Direct"\n {name}: {_array(values)}\n }}\n'
        for kind, name, values in (("Normal", "Normals", mesh.normals), ("UV", "UV", mesh.uv))
    )
    listed = "".join(f'LayerElement: {{ Type: "LayerElement{kind}"\n TypedIndex: 0\n }}\n' for kind in ("Normal", "UV"))
    objects += [
        f'Geometry: 7000, "Geometry::", "Mesh" {{ Vertices: {_array(mesh.vertices)}\n'
        f" PolygonVertexIndex: {_array(ends)}\n {layers} Layer: 0 {{ Version: 100\n {listed} }}\n }}",
        'Model: 7001, "Model::Mesh", "Mesh" { Version: 232\n }',
        'Deformer: 7002, "Deformer::", "Skin" { Version: 101\n }',
        f'Material: 7003, "Material::Skin", "" {{ Version: 102\n ShadingModel: "phong"\n '
        f"{_properties({'DiffuseColor': mesh.colour})} }}".replace('"Vector3D"', '"Color"'),
    ]
    links += ['C: "OO",7001,0', 'C: "OO",7000,7001', 'C: "OO",7002,7000', 'C: "OO",7003,7001']
    if mesh.image:
        objects.append(
            f'Texture: 7004, "Texture::Skin", "" {{ Type: "TextureVideoClip"\n FileName: "{mesh.image}"\n'
            f' RelativeFilename: "{mesh.image}"\n }}'
        )
        links.append('C: "OP",7004,7003, "DiffuseColor"')
    for node, matrix in mesh.binds.items():
        _add_cluster(objects, links, node, matrix, np.flatnonzero(mesh.of_vertex == node))
