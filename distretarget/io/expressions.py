"""Expressions: morph target weights by name (of a face, say), taken from an animation to a character's meshes.

A name is that of a morph target, in `extras.targetNames` of its mesh, as exporters write it (ARKit's 52 names, say); of
an expression of a VRM model, which sets the weights of several morph targets; or of an expression in a VRM animation.
Case does not matter, and VRM 0's names are translated to VRM 1.0's.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from distretarget.character.animations import choose_animation
from distretarget.character.nodes import Curve
from distretarget.errors import DistretargetError
from distretarget.io.gltf import Gltf
from distretarget.io.gltf_scene import (
    FLOATS,
    KINDS,
    animation_names,
    moves_face,
    named_expressions,
    nodes_of_expressions,
    read_curve,
)
from distretarget.io.json_node import Fields, Node
from distretarget.numerics.vectors import Array

VRM_0 = {"joy": "happy", "sorrow": "sad", "fun": "relaxed", "a": "aa", "i": "ih", "u": "ou", "e": "ee", "o": "oh"}
VRM_0 |= {"blink_l": "blinkLeft", "blink_r": "blinkRight"}  # VRM 1.0's name of an expression by VRM 0's
PERCENT = 0.01  # weights of VRM 0 go up to 100


class MorphTarget(NamedTuple):
    """A morph target of a node's mesh, and its weight while the expression is 1."""

    node: int
    number: int  # its index in the mesh
    weight: float


@dataclass(frozen=True, eq=False)
class Face:
    """The expressions that a character can have."""

    targets: Mapping[str, tuple[MorphTarget, ...]]  # by name in lower case
    rest_weights: Mapping[int, Array]  # by node, without an animation, (targets,)

    def weights(self, expressions: Mapping[str, Array]) -> Mapping[int, Array]:
        """Return morph target weights by node, (frames, targets), for weights of expressions by name, (frames,)."""
        result: dict[int, Array] = {}
        written = set()
        for name, values in expressions.items():
            for node, target, weight in self.targets.get(name.casefold(), ()):
                keys = result.setdefault(node, np.tile(self.rest_weights[node], (len(values), 1)))
                keys[:, target] = weight * values + (keys[:, target] if (node, target) in written else 0.0)
                written.add((node, target))
        return result


def face_of(gltf: Gltf) -> Face:
    """Return the expressions that the character of a file can have, without invalid ones."""
    targets: dict[str, list[MorphTarget]] = defaultdict(list)
    rest_weights, nodes_of_mesh = {}, defaultdict(list)
    for node, fields in enumerate(map(Node.entries, gltf.entries("nodes"))):
        if "mesh" not in fields:
            continue
        with suppress(DistretargetError):
            number, mesh = gltf.index("meshes", fields["mesh"]), gltf.entry("meshes", fields["mesh"])
            count = max((len(each.entries().listed("targets")) for each in mesh.listed("primitives")), default=0)
            weights = fields if "weights" in fields else mesh
            rest_weights[node] = np.array(weights["weights"].numbers(count) if "weights" in weights else [0.0] * count)
            nodes_of_mesh[number].append(node)
            for index, name in enumerate(_target_names(mesh)[:count]):
                targets[name.casefold()].append(MorphTarget(node, index, 1.0))
    morphs = {*targets}
    with suppress(DistretargetError):
        for name, target in [*_vrm(gltf, nodes_of_mesh)]:
            if name.casefold() not in morphs and target.number < len(rest_weights.get(target.node, ())):
                targets[name.casefold()].append(target)
    return Face({name: tuple(found) for name, found in targets.items()}, rest_weights)


def _target_names(mesh: Fields) -> list[str]:
    """The names of a mesh's morph targets; extras may hold anything."""
    with suppress(DistretargetError):
        return [each.text() for each in mesh.inner("extras").listed("targetNames")]
    return []


def _vrm(gltf: Gltf, nodes_of_mesh: Mapping[int, list[int]]) -> Iterator[tuple[str, MorphTarget]]:
    """Yield the names of a VRM model's expressions, 1.0 or 0, each with the morph targets that it sets."""
    for name, expression in named_expressions(gltf, "VRMC_vrm"):
        for bind in map(Node.entries, expression.listed("morphTargetBinds")):
            node = gltf.index("nodes", bind.need("node"))
            yield name, MorphTarget(node, bind.need("index").whole(), bind.read("weight", Node.number, 1.0))
    groups = gltf.document.inner("extensions").inner("VRM").inner("blendShapeMaster").listed("blendShapeGroups")
    for group in map(Node.entries, groups):
        preset, name = (group.read(key, Node.text, "") for key in ("presetName", "name"))
        name = VRM_0.get(preset, preset) if preset not in ("", "unknown") else name
        for bind in map(Node.entries, group.listed("binds")):
            weight = PERCENT * bind.read("weight", Node.number, 100.0)
            for node in nodes_of_mesh.get(gltf.index("meshes", bind.need("mesh")), ()):
                yield name, MorphTarget(node, bind.need("index").whole(), weight)


def find_expressions(gltf: Gltf, clip: str | None = None) -> Mapping[str, Curve]:
    """Return the weight curves of expressions by name, from the animation `clip`, without invalid and zero ones."""
    number = choose_animation(gltf.path, animation_names(gltf), clip)
    if number is None or not moves_face(gltf, number):
        return {}
    animation, stand_ins = gltf.entries("animations")[number].entries(), nodes_of_expressions(gltf)
    samplers, starts = animation.listed("samplers"), dict[int, float]()
    curves: dict[str, Curve] = {}
    for channel in map(Node.entries, animation.listed("channels")):
        with suppress(DistretargetError):
            target = channel.inner("target")
            path, node = target.need("path").text(), gltf.index("nodes", target.need("node"))
            sampler = samplers[channel.need("sampler").index(len(samplers) - 1, "samplers")].entries()
            if path in KINDS and (times := gltf.index("accessors", sampler.need("input"))) not in starts:
                starts[times] = gltf.numbers(sampler["input"], "SCALAR", FLOATS)[0]
            names = [stand_ins[node]] if path == "translation" and node in stand_ins else []
            if path == "weights":
                names = _target_names(gltf.entry("meshes", gltf.entries("nodes")[node].entries().need("mesh")))
            if names:
                curve = read_curve(gltf, sampler, KINDS.get(path, "SCALAR"), len(names))
                for index, name in enumerate(names):
                    curves.setdefault(name, replace(curve, keys=curve.keys[:, :, [index]]))
    first = min(starts.values(), default=0.0)
    return {name: replace(each, times=each.times - first) for name, each in curves.items() if each.keys.any()}
