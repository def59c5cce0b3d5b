// Bodies: meshes and tapered capsules as geometry that three.js bends by the joints of a motion.
/* global THREE */

import {unpacked} from './motion.js';

/** Whether the browser draws without a graphics card. */
export const SOFTWARE = (() => {
  const gl = document.createElement('canvas').getContext('webgl'), told = gl?.getExtension('WEBGL_debug_renderer_info');
  const name = told ? gl.getParameter(told.UNMASKED_RENDERER_WEBGL) : '';
  gl?.getExtension('WEBGL_lose_context')?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
})();
const [ROUND, STEPS] = SOFTWARE ? [9, 3] : [18, 6]; // sides of a capsule, and rings of each of its ends
const THIN = 5; // sides of a bone
const BONE = 0.012; // radius below which a capsule is a bone without skin [body units]

/** The geometry of a body in its rest pose, with the places of its joints there as `bind`, (joints, 3), and what its
 * file says of its materials.
 */
export async function bodyOf(data) {
  const bind = await unpacked(data.bind, Float32Array), {materials = []} = data.mesh || {};
  const images = await Promise.all(materials.map(({image}) => image && loaded(image)));
  const geometry = data.mesh ? await meshOf(data.mesh) : await capsulesOf(data);
  return {bind, materials, images, geometry, crown: crownOf(geometry, bind)};
}

/** How far the skin reaches above the highest joint of the rest pose. */
function crownOf(geometry, bind) {
  geometry.computeBoundingBox();
  const top = bind.reduce((highest, x, k) => (k % 3 === 1 ? Math.max(highest, x) : highest), 0);
  return Math.max(geometry.boundingBox.max.y - top, 0);
}

/** A texture of an image, or null where the browser cannot read it. */
async function loaded(address) {
  const image = Object.assign(new Image(), {src: address});
  try {
    await image.decode();
  } catch {
    return null;
  }
  return Object.assign(new THREE.Texture(image), {flipY: false, colorSpace: THREE.SRGBColorSpace,
    wrapS: THREE.RepeatWrapping, wrapT: THREE.RepeatWrapping, needsUpdate: true});
}

/** The materials of a body as its file states them; a single plain one where it states none. */
export function materialsOf({materials, images}) {
  if (!materials.length) return [new THREE.MeshLambertMaterial()];
  return materials.map(({colour, mode, cutoff, two_sided: both}, k) => new THREE.MeshLambertMaterial({
    color: new THREE.Color(...colour), map: images[k] || null, alphaTest: mode === 'MASK' ? cutoff : 0,
    opacity: mode === 'BLEND' ? colour[3] : 1, transparent: mode === 'BLEND', ...both && {side: THREE.DoubleSide}}));
}

async function meshOf({vertices, normals, joints, weights, triangles, offset, scale, materials, uv}) {
  const places = Float32Array.from(await unpacked(vertices, Uint16Array), (x, k) => offset[k % 3] + scale * x);
  const geometry = new THREE.BufferGeometry();
  const attributes = [['position', places, 3, false], ['normal', await unpacked(normals, Int8Array), 3, true],
    ['skinIndex', await unpacked(joints, Uint16Array), 4, false],
    ['skinWeight', await unpacked(weights, Uint16Array), 4, true]];
  for (const [name, ...rest] of attributes) geometry.setAttribute(name, new THREE.BufferAttribute(...rest));
  if (uv) geometry.setAttribute('uv', new THREE.BufferAttribute(await unpacked(uv, Float32Array), 2));
  geometry.setIndex(new THREE.BufferAttribute(await unpacked(triangles, Uint32Array), 1));
  let start = 0;
  materials.forEach(({triangles: count}, k) => {
    geometry.addGroup(start, 3 * count, k);
    start += 3 * count;
  });
  return geometry;
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
  const parts = data.carriers.map((carrier, k) => {
    const [from, to] = [0, 3].map(end => new THREE.Vector3().fromArray(ends, 6 * k + end));
    const along = to.clone().sub(from), length = along.length(), thin = radii[2 * k] < BONE;
    const part = new THREE.LatheGeometry(
      outline(length, radii[2 * k], radii[2 * k + 1], thin ? 1 : STEPS), thin ? THIN : ROUND);
    const turn = new THREE.Quaternion(), {count} = part.attributes.position;
    if (length > 0) turn.setFromUnitVectors(new THREE.Vector3(0, 1, 0), along.divideScalar(length));
    part.applyQuaternion(turn).translate(from.x, from.y, from.z);
    const joints = Uint16Array.from({length: 4 * count}, (_, place) => (place % 4 ? 0 : carrier));
    const weights = Float32Array.from({length: 4 * count}, (_, place) => (place % 4 ? 0 : 1));
    part.setAttribute('skinIndex', new THREE.BufferAttribute(joints, 4));
    part.setAttribute('skinWeight', new THREE.BufferAttribute(weights, 4));
    return part;
  });
  return parts.length ? THREE.mergeGeometries(parts) : new THREE.BufferGeometry();
}

/** A mesh of a body that `pose` bends as a motion is placed. */
export function skinnedBody({bind, geometry}, materials) {
  const joints = Array.from({length: bind.length / 3}, () => new THREE.Bone());
  const inverses = joints.map((_, k) => new THREE.Matrix4().makeTranslation(
    -bind[3 * k], -bind[3 * k + 1], -bind[3 * k + 2]));
  const mesh = new THREE.SkinnedMesh(geometry, materials.length > 1 ? materials : materials[0]);
  mesh.bindMode = 'detached';
  mesh.bind(new THREE.Skeleton(joints, inverses), new THREE.Matrix4());
  Object.assign(mesh, {castShadow: true, frustumCulled: false});
  return mesh;
}

const place = new THREE.Vector3(), turn = new THREE.Quaternion(), unscaled = new THREE.Vector3(1, 1, 1);

/** Bends a mesh as a motion is placed. */
export function bend(mesh, {positions, rotations}) {
  mesh.skeleton.bones.forEach((bone, k) => bone.matrixWorld.compose(
    place.fromArray(positions, 3 * k), turn.fromArray(rotations, 4 * k), unscaled));
}
