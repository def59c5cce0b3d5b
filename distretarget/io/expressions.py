"""Expressions: weights of morph targets, such as those of a face, by name, from an animation to a character's meshes.

A name is that of a morph target, in `extras.targetNames` of its mesh, as exporters write it (ARKit's 52 names, say); or
of an expression of a VRM model, which weighs morph targets; or, in a VRM animation, of an expression alone. Names that
differ in case only are the same, and those of VRM 0 are VRM 1.0's.
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
VRM_0 |= {"blink_l": "blinkLeft", "blink_r": "blinkRight"}  # VRM 1.0's names of expressions
PERCENT = 0.01  # VRM 0 has weights up to 100


class MorphTarget(NamedTuple):
    """A morph target of a mesh, and its weight where an expression is 1."""

    node: int  # at which the mesh hangs
    number: int
    weight: float


@dataclass(frozen=True, eq=False)
class Face:
    """The expressions that a character can have."""

    targets: Mapping[str, tuple[MorphTarget, ...]]  # by name in lower case
    shown: Mapping[int, Array]  # the weights that each node shows by itself, (targets,)

    def weights(self, expressions: Mapping[str, Array]) -> Mapping[int, Array]:
        """Return the weights of meshes, (frames, targets), by node, for expressions, (frames,), by name."""
        result: dict[int, Array] = {}
        begun = set()
        for name, values in expressions.items():
            for node, target, weight in self.targets.get(name.casefold(), ()):
                keys = result.setdefault(node, np.tile(self.shown[node], (len(values), 1)))
                keys[:, target] = weight * values + (keys[:, target] if (node, target) in begun else 0.0)
                begun.add((node, target))
        return result


def face_of(gltf: Gltf) -> Face:
    """Return the expressions that the character of a file can have, without what is not valid."""
    targets: dict[str, list[MorphTarget]] = defaultdict(list)
    shown, at_mesh = {}, defaultdict(list)
    for node, fields in enumerate(map(Node.entries, gltf.entries("nodes"))):
        if "mesh" not in fields:
            continue
        with suppress(DistretargetError):
            number, mesh = gltf.index("meshes", fields["mesh"]), gltf.entry("meshes", fields["mesh"])
            count = max((len(each.entries().listed("targets")) for each in mesh.listed("primitives")), default=0)
            weights = fields if "weights" in fields else mesh
            shown[node] = np.array(weights["weights"].numbers(count) if "weights" in weights else [0.0] * count)
            at_mesh[number].append(node)
            for place, name in enumerate(_target_names(mesh)[:count]):
                targets[name.casefold()].append(MorphTarget(node, place, 1.0))
    own = {*targets}
    with suppress(DistretargetError):
        for name, target in [*_vrm(gltf, at_mesh)]:
            if name.casefold() not in own and target.number < len(shown.get(target.node, ())):
                targets[name.casefold()].append(target)
    return Face({name: tuple(found) for name, found in targets.items()}, shown)


def _target_names(mesh: Fields) -> list[str]:
    """The names of a mesh's morph targets; extras may hold anything."""
    with suppress(DistretargetError):
        return [each.text() for each in mesh.inner("extras").listed("targetNames")]
    return []


def _vrm(gltf: Gltf, at_mesh: Mapping[int, list[int]]) -> Iterator[tuple[str, MorphTarget]]:
    """Yield the expressions of a VRM model, 1.0 or 0; `at_mesh` has the nodes at which each mesh hangs."""
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
            for node in at_mesh.get(gltf.index("meshes", bind.need("mesh")), ()):
                yield name, MorphTarget(node, bind.need("index").whole(), weight)


def find_expressions(gltf: Gltf, clip: str | None = None) -> Mapping[str, Curve]:
    """Return the curves of the expressions that the animation named `clip`, or the only one, moves, by name; their
    times are from the first frame of its motion on. Those that are 0 all the time and what is not valid are left out.
    """
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
                for place, name in enumerate(names):
                    curves.setdefault(name, replace(curve, keys=curve.keys[:, :, [place]]))
    first = min(starts.values(), default=0.0)
    return {name: replace(each, times=each.times - first) for name, each in curves.items() if each.keys.any()}
