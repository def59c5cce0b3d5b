// The document, the drawing data, the state of the page, and distances.

const report = JSON.parse($('document').textContent);
const drawing = JSON.parse($('drawing').textContent);
const frameCount = report.frame_count;
const frameTime = report.frame_time || 1 / 30;

/** The namespace that all names share, with its colon, as in `mixamorig:Hips`; the page omits it. */
function namespaceOf(names) {
  const first = names[0].slice(0, names[0].lastIndexOf(':') + 1);
  return names.every(name => name.startsWith(first)) ? first : '';
}

function unpacked(motion) {
  motion.positions = new Int16Array(bytes(motion.positions));
  motion.tau = new Float32Array(bytes(motion.tau));
  motion.joints = motion.names.length;
  motion.namespace = namespaceOf(motion.names);
  motion.names = motion.names.map(name => name.slice(motion.namespace.length));
  motion.count = motion.positions.length / motion.joints / 3;
  motion.x = new Float32Array(motion.joints * 3);
  motion.D = new Float32Array(motion.points.length ** 2);
  motion.bones = motion.parents.map((upper, lower) => [upper, lower]).slice(1);
  return motion;
}

const A = unpacked(drawing.a), B = unpacked(drawing.b);
const pointCount = A.points.length;
const strideBits = new Uint8Array(bytes(drawing.strides));
const contactLimits = new Uint8Array(bytes(drawing.limits));
const rests = new Uint8Array(bytes(drawing.rests));
const boneErrors = new Uint8Array(bytes(drawing.bone_errors));

/** The state of the page; `pair` is the chosen pair of joints as two indices of points, or null. */
const state = {frame: 0, playing: false, speed: 1, pair: null, overlaid: false, follow: true, draws: 0};

/** Writes the positions of the joints at a frame to motion.x: (joints, 3), y up. */
function place(motion, frame) {
  const drawn = Math.min(Math.floor(frame / drawing.step), motion.count - 1);
  if (motion.placed === drawn) return;
  motion.placed = drawn;
  const first = drawn * motion.joints * 3, {x, positions, offset, scale} = motion;
  for (let k = 0; k < x.length; k++) x[k] = offset[k % 3] + scale[k % 3] * positions[first + k];
}

/** D of all points at a frame, (points, points); nan where the path between two has no length. */
function distances(motion, frame) {
  place(motion, frame);
  const {x, D, tau, points} = motion;
  if (motion.measured === motion.placed) return D;
  motion.measured = motion.placed;
  for (let i = 0; i < pointCount; i++) {
    for (let j = 0; j <= i; j++) {
      const u = 3 * points[i], v = 3 * points[j], k = i * pointCount + j;
      const length = Math.hypot(x[u] - x[v], x[u + 1] - x[v + 1], x[u + 2] - x[v + 2]);
      D[k] = D[j * pointCount + i] = i === j ? 0 : tau[k] > 0 ? length / tau[k] : NaN;
    }
  }
  return D;
}

/** Whether one of the joints that rest in some frame, the k-th, rests in A at a frame. */
function restsAt(k, frame) {
  const row = Math.ceil(B.resting.length / 8);
  return (rests[frame * row + (k >> 3)] >> (k & 7) & 1) === 1;
}

/** Whether A stands or walks at a frame: then feet and shins, which pass each other, do not count as touching. */
function strides(frame) {
  return (strideBits[frame >> 3] >> (frame & 7) & 1) === 1;
}

/** The D of two points over the D below which they touch; 1 or more if they never do. */
function near(D, k) {
  return contactLimits[k] ? 255 * D[k] / (drawing.near * contactLimits[k]) : 1;
}

/** The regions that touch in A at a frame, by their nearest points: [point, point, whether these are near in B]. */
function contactsAt(frame) {
  const a = distances(A, frame), b = distances(B, frame), nearest = new Map();
  const passing = strides(frame) ? drawing.passing : [];
  for (let i = 0; i < pointCount; i++) {
    for (let j = 0; j < i; j++) {
      const k = i * pointCount + j, [p, q] = [drawing.regions[i], drawing.regions[j]].sort((one, other) => one - other);
      if (!(near(a, k) < 1) || Number.isNaN(b[k]) || passing.some(pair => pair[0] === p && pair[1] === q)) continue;
      const key = `${p} ${q}`, [oldI, oldJ] = nearest.get(key) || [i, j];
      if (near(a, k) <= near(a, oldI * pointCount + oldJ)) nearest.set(key, [i, j]);
    }
  }
  return [...nearest.values()].map(([i, j]) => [i, j, b[i * pointCount + j] < drawing.near]);
}

/** How far a bone of B is off the direction that A gives it on that body [degrees]; null if A has no such bone. */
function directionError([, lower]) {
  const coded = boneErrors[B.placed * B.joints + lower];
  return coded === 255 ? null : coded / 2;
}

function pairName([i, j]) {
  return `${B.names[B.points[i]]} – ${B.names[B.points[j]]}`;
}

/** A pair of points in words: its joints' names in both motions, and its distances at a frame. */
function pairText([i, j], frame) {
  const k = i * pointCount + j, a = distances(A, frame)[k], b = distances(B, frame)[k];
  const other = `${A.names[A.points[i]]} – ${A.names[A.points[j]]}`;
  const name = pairName([i, j]), difference = b - a;
  const called = other === name ? name : `${name} (in A: ${other})`;
  const more = `${difference > 0 ? '+' : ''}${shown(difference)}`;
  const contact = contactsAt(frame).find(([p, q]) => p === Math.max(i, j) && q === Math.min(i, j));
  const touching = contact ? (contact[2] ? ', contact' : ', contact lost') : '';
  return `${called}: D in A ${shown(a)}, in B ${shown(b)}, difference ${more}${touching}`;
}

function choose(pair) {
  state.pair = pair;
  repaint();
}
