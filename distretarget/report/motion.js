// Packed arrays, and motions: positions and rotations of the joints of an actor in each frame.
/* global THREE */

import {total} from './dom.js';

/** The numbers of a packed array: base64 of compressed planes of bytes, the first bytes of all numbers first. */
export async function unpacked(text, Kind) {
  const coded = atob(text), packed = new Uint8Array(coded.length);
  for (let k = 0; k < coded.length; k++) packed[k] = coded.charCodeAt(k);
  const {readable, writable} = new DecompressionStream('deflate'), writer = writable.getWriter();
  writer.write(packed);
  writer.close();
  const planes = new Uint8Array(await new Response(readable).arrayBuffer());
  const size = Kind.BYTES_PER_ELEMENT, count = planes.length / size;
  return new Kind(planes.map((_, at) => planes[at % size * count + Math.floor(at / size)]).buffer);
}

const tip = new THREE.Vector3(), base = new THREE.Vector3();
const tipTurn = new THREE.Quaternion(), baseTurn = new THREE.Quaternion();

/** A motion, placed at one frame: `positions`, (joints, 3), and world `rotations`, (joints, 4), x y z w. */
export class Motion {
  /** The motion in the data of an actor, on a page with this time between frames [s]. */
  static async of(data, frameTime) {
    const {parents, turning, still, moving} = data, joints = parents.length;
    const [rows, path, fixed, offsets, translations] = await Promise.all([unpacked(data.rotations, Int16Array),
      ...[data.path, data.fixed, data.offsets, data.translations].map(text => unpacked(text, Float32Array))]);
    const count = path.length / 3;
    for (let k = 1; k < rows.length; k++) if (k % count) rows[k] += rows[k - 1];
    const [turns, fixes, slides] = [turning, still, moving].map(some => { // the number of each joint among some, or -1
      const numbers = new Int32Array(joints).fill(-1);
      some.forEach((joint, k) => { numbers[joint] = k; });
      return numbers;
    });
    return Object.assign(new Motion(), {parents, rows, path, fixed, offsets, translations, turns, fixes, slides, count,
      moving, rate: frameTime / data.frameTime / data.step, frame: -1, positions: new Float32Array(3 * joints),
      rotations: new Float32Array(4 * joints)});
  }

  /** Places the joints at a frame of the page; a motion that ends before keeps its last pose. */
  place(frame) {
    const at = Math.min(Math.floor(frame * this.rate + 1e-6), this.count - 1);
    if (at === this.frame) return;
    this.frame = at;
    this.parents.forEach((parent, joint) => this.placeJoint(joint, parent, at));
  }

  placeJoint(joint, parent, at) {
    const {positions, rotations, rows, count} = this, turn = this.turns[joint], slide = this.slides[joint];
    baseTurn.fromArray(rotations, 4 * Math.max(parent, 0));
    if (turn < 0) tipTurn.fromArray(this.fixed, 4 * this.fixes[joint]).premultiply(baseTurn);
    else tipTurn.set(...[0, 1, 2, 3].map(k => rows[(4 * turn + k) * count + at])).normalize();
    if (parent < 0) tip.fromArray(this.path, 3 * at);
    else {
      if (slide < 0) tip.fromArray(this.offsets, 3 * joint);
      else tip.fromArray(this.translations, 3 * (at * this.moving.length + slide));
      tip.applyQuaternion(baseTurn).add(base.fromArray(positions, 3 * parent));
    }
    tipTurn.toArray(rotations, 4 * joint);
    tip.toArray(positions, 3 * joint);
  }
}

/** The middle of some joints, each with its motion, [x, y, z]. */
export function middleOf(joints) {
  return [0, 1, 2].map(axis => total(joints, ([{positions}, joint]) => positions[3 * joint + axis]) / joints.length);
}
