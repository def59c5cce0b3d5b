// Packed arrays, and motions: where the joints of an actor are in each frame.

/** The numbers of a packed array: base64 of compressed planes of bytes, the first bytes of all numbers first. */
export async function unpacked(text, Kind) {
  const coded = atob(text), packed = new Uint8Array(coded.length);
  for (let k = 0; k < coded.length; k++) packed[k] = coded.charCodeAt(k);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream('deflate'));
  const planes = new Uint8Array(await new Response(stream).arrayBuffer());
  const size = Kind.BYTES_PER_ELEMENT, count = planes.length / size, bytes = new Uint8Array(planes.length);
  for (let plane = 0; plane < size; plane++) {
    for (let k = 0; k < count; k++) bytes[k * size + plane] = planes[plane * count + k];
  }
  return new Kind(bytes.buffer);
}

/** Writes the product of two quaternions at places of arrays. */
function multiply(out, o, p, i, q, j) {
  const [a, b, c, d] = [p[i], p[i + 1], p[i + 2], p[i + 3]], [x, y, z, w] = [q[j], q[j + 1], q[j + 2], q[j + 3]];
  out[o] = d * x + a * w + b * z - c * y;
  out[o + 1] = d * y - a * z + b * w + c * x;
  out[o + 2] = d * z + a * y - b * x + c * w;
  out[o + 3] = d * w - a * x - b * y - c * z;
}

/** A motion as `place` shows it: `positions`, (joints, 3), and world `rotations`, (joints, 4), x y z w. */
export class Motion {
  /** The motion in the data of an actor, on a page with this time between frames [s]. */
  static async of(data, frameTime) {
    const motion = Object.assign(new Motion(), {parents: data.parents, turning: data.turning, still: data.still,
      moving: data.moving, rate: frameTime / data.frameTime / data.step, frame: -1});
    const {path, rotations, fixed, offsets, translations} = data;
    [motion.path, motion.rows, motion.fixed, motion.offsets, motion.translations] = await Promise.all([
      unpacked(path, Float32Array), unpacked(rotations, Int16Array), unpacked(fixed, Float32Array),
      unpacked(offsets, Float32Array), unpacked(translations, Float32Array)]);
    motion.count = motion.path.length / 3;
    for (let row = 0; row < motion.rows.length; row += motion.count) {
      for (let k = row + 1; k < row + motion.count; k++) motion.rows[k] += motion.rows[k - 1];
    }
    motion.joints = data.parents.length;
    motion.positions = new Float32Array(3 * motion.joints);
    motion.rotations = new Float32Array(4 * motion.joints);
    motion.turns = new Int32Array(motion.joints).fill(-1);
    motion.slides = new Int32Array(motion.joints).fill(-1);
    motion.fixes = new Int32Array(motion.joints);
    data.turning.forEach((joint, k) => { motion.turns[joint] = k; });
    data.moving.forEach((joint, k) => { motion.slides[joint] = k; });
    data.still.forEach((joint, k) => { motion.fixes[joint] = k; });
    return motion;
  }

  /** Places the joints at a frame of the clip; a motion that ends before keeps its last pose. */
  place(frame) {
    const at = Math.min(Math.floor(frame * this.rate + 1e-6), this.count - 1);
    if (at === this.frame) return;
    this.frame = at;
    for (let joint = 0; joint < this.joints; joint++) this.placeJoint(joint, at);
  }

  placeJoint(joint, at) {
    const {positions: x, rotations: q, rows, count} = this, parent = this.parents[joint], turn = this.turns[joint];
    if (turn < 0) multiply(q, 4 * joint, q, 4 * parent, this.fixed, 4 * this.fixes[joint]);
    else {
      const row = 4 * turn * count + at, [a, b, c, d] = [0, 1, 2, 3].map(k => rows[row + k * count]);
      const length = Math.hypot(a, b, c, d);
      q.set([a / length, b / length, c / length, d / length], 4 * joint);
    }
    if (parent < 0) {
      x.set(this.path.subarray(3 * at, 3 * at + 3), 3 * joint);
      return;
    }
    const slide = this.slides[joint], from = slide < 0 ? this.offsets : this.translations;
    const o = slide < 0 ? 3 * joint : 3 * (at * this.moving.length + slide);
    const [u, v, w] = [from[o], from[o + 1], from[o + 2]], p = 4 * parent;
    const [i, j, k, r] = [q[p], q[p + 1], q[p + 2], q[p + 3]];
    const tx = 2 * (j * w - k * v), ty = 2 * (k * u - i * w), tz = 2 * (i * v - j * u);
    x[3 * joint] = x[3 * parent] + u + r * tx + j * tz - k * ty;
    x[3 * joint + 1] = x[3 * parent + 1] + v + r * ty + k * tx - i * tz;
    x[3 * joint + 2] = x[3 * parent + 2] + w + r * tz + i * ty - j * tx;
  }
}
