// Bodies: meshes and tapered capsules as geometry, bent by the joints of a motion.
/* global THREE */

import {unpacked} from './motion.js';

/** Whether the browser draws without a graphics card. */
export const SOFTWARE = (() => {
  const gl = document.createElement('canvas').getContext('webgl'), info = gl?.getExtension('WEBGL_debug_renderer_info');
  const name = info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : '';
  gl?.getExtension('WEBGL_lose_context')?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
})();
const [ROUND, STEPS] = SOFTWARE ? [9, 3] : [18, 6]; // sides of a capsule, and rings of each of its ends
const THIN = 5; // sides of a bone
const BONE = 0.012; // radius below which a capsule is a bone without skin [body units]

/** A body in its rest pose: its geometry, the materials in its file, the positions of its joints as `bind`, (joints,
 * 3), and the joints that move each vertex, with their weights.
 */
export async function bodyOf(data) {
  const bind = await unpacked(data.bind, Float32Array), inFile = data.mesh?.materials ?? [];
  const images = await Promise.all(inFile.map(async ({image, normal_map: normals}) => ({
    map: await loaded(image, THREE.SRGBColorSpace), normalMap: await loaded(normals, '')})));
  const {geometry, joints, weights} = await (data.mesh ? meshOf(data.mesh) : capsulesOf(data));
  geometry.computeBoundingBox();
  const highest = bind.filter((_, k) => k % 3 === 1).reduce((p, q) => Math.max(p, q), 0); // joint
  return {inFile, images, geometry, joints, weights, bind, moves: new Float32Array(16 * bind.length / 3),
    crown: Math.max(geometry.boundingBox.max.y - highest, 0)}; // height of the skin above this joint
}

/** A texture of an image; null without one, or if the browser cannot read it. */
async function loaded(address, colorSpace) {
  if (!address) return null;
  const image = Object.assign(new Image(), {src: address});
  try {
    await image.decode();
  } catch {
    return null;
  }
  return Object.assign(new THREE.Texture(image), {flipY: false, colorSpace,
    wrapS: THREE.RepeatWrapping, wrapT: THREE.RepeatWrapping, needsUpdate: true});
}

/** The materials of a body as in its file. */
export function materialsOf({inFile, images}) {
  return inFile.map(({colour, mode, cutoff, two_sided: both}, k) => new THREE.MeshLambertMaterial({
    color: new THREE.Color(...colour), ...images[k], alphaTest: mode === 'MASK' ? cutoff : 0,
    opacity: mode === 'BLEND' ? colour[3] : 1, transparent: mode === 'BLEND', ...both && {side: THREE.DoubleSide}}));
}

async function meshOf({vertices, normals, joints, weights, triangles, offset, scale, materials, uv}) {
  const geometry = new THREE.BufferGeometry(), add = (name, array, size) => (
    geometry.setAttribute(name, new THREE.BufferAttribute(array, size)));
  add('position', Float32Array.from(await unpacked(vertices, Uint16Array), (x, k) => offset[k % 3] + scale * x), 3);
  add('normal', Float32Array.from(await unpacked(normals, Int8Array), x => x / 127), 3);
  if (uv) add('uv', await unpacked(uv, Float32Array), 2);
  geometry.setIndex(new THREE.BufferAttribute(await unpacked(triangles, Uint32Array), 1));
  let start = 0;
  materials.forEach(({triangles: count}, k) => {
    geometry.addGroup(start, 3 * count, k);
    start += 3 * count;
  });
  const shares = Float32Array.from(await unpacked(weights, Uint16Array), x => x / 65535);
  return {geometry, joints: await unpacked(joints, Uint16Array), weights: shares};
}

/** The outline of a tapered capsule along y, from its tip below to its tip above. */
function outline(length, first, last, steps) {
  const lean = Math.abs(first - last) < length ? Math.asin((first - last) / length) : first > last ? 1.57 : -1.57;
  const arc = (radius, height, from, to) => Array.from({length: steps + 1}, (_, k) => {
    const angle = from + (to - from) * k / steps;
    return new THREE.Vector2(Math.max(radius * Math.cos(angle), 0), height + radius * Math.sin(angle));
  });
  return [...arc(first, 0, -Math.PI / 2, lean), ...arc(last, length, lean, Math.PI / 2)];
}

/** One geometry of all capsules of a body, each moved by its carrier alone. */
async function capsulesOf(data) {
  const ends = await unpacked(data.ends, Float32Array), radii = await unpacked(data.radii, Float32Array);
  const parts = data.carriers.map((_, k) => {
    const [from, to] = [0, 3].map(end => new THREE.Vector3().fromArray(ends, 6 * k + end));
    const along = to.clone().sub(from), length = along.length(), thin = radii[2 * k] < BONE;
    const part = new THREE.LatheGeometry(
      outline(length, radii[2 * k], radii[2 * k + 1], thin ? 1 : STEPS), thin ? THIN : ROUND);
    const turn = new THREE.Quaternion();
    if (length > 0) turn.setFromUnitVectors(new THREE.Vector3(0, 1, 0), along.divideScalar(length));
    return part.applyQuaternion(turn).translate(from.x, from.y, from.z);
  });
  const joints = data.carriers.flatMap((carrier, k) => Array(parts[k].attributes.position.count).fill(carrier));
  const geometry = parts.length ? THREE.mergeGeometries(parts) : new THREE.PlaneGeometry(0, 0);
  return {geometry, joints, weights: joints.map(() => 1)};
}

/** A mesh of a body for `bend`. It is bent here, not by the graphics card, which may be emulated. */
export function bendable(body, materials) {
  const mesh = new THREE.Mesh(body.geometry.clone(), materials.length > 1 ? materials : materials[0]);
  return Object.assign(mesh, {body, frustumCulled: false});
}

const move = new THREE.Matrix4(), place = new THREE.Vector3(), rest = new THREE.Vector3();
const turn = new THREE.Quaternion(), unscaled = new THREE.Vector3(1, 1, 1);

/** Bends a mesh to the frame at which a motion is placed, by linear blend skinning. */
export function bend({geometry, body}, {positions, rotations}) {
  const {bind, moves: m, joints, weights} = body, {position, normal} = body.geometry.attributes;
  for (let k = 0; k < bind.length / 3; k++) {
    rest.fromArray(bind, 3 * k).applyQuaternion(turn.fromArray(rotations, 4 * k));
    move.compose(place.fromArray(positions, 3 * k).sub(rest), turn, unscaled).toArray(m, 16 * k);
  }
  const {position: places, normal: normals} = geometry.attributes, each = joints.length / position.count;
  const x = position.array, n = normal.array, y = places.array, o = normals.array;
  for (let i = 0, first = 0; i < x.length; i += 3, first += each) {
    y[i] = y[i + 1] = y[i + 2] = o[i] = o[i + 1] = o[i + 2] = 0;
    for (let at = first; at < first + each && weights[at]; at++) {
      const w = weights[at], k = 16 * joints[at];
      for (let row = 0; row < 3; row++) {
        const a = m[k + row], b = m[k + 4 + row], c = m[k + 8 + row];
        y[i + row] += w * (a * x[i] + b * x[i + 1] + c * x[i + 2] + m[k + 12 + row]);
        o[i + row] += w * (a * n[i] + b * n[i + 1] + c * n[i + 2]);
      }
    }
  }
  places.needsUpdate = normals.needsUpdate = true;
}
