// Marks on the stage of contacts, supports, skin inside, and joints; and the paths of hands and feet.
/* global THREE */

import {colourOf} from './dom.js';
import {middleOf} from './motion.js';
import {levelAt, offAt} from './timeline.js';

const PATH = 32, PAST = 0.8; // points of a path, and its duration [s]
const ON_FLOOR = 0.12; // supports lower than this rest on the floor [body units]
const NAMES = 2; // named joints of a side, at most
const NAMED = 0.1; // size of the mark of a named joint [body units]
const MOST = 12; // marks of a side, at most
const DOT = 0.032; // size of the mark of a coloured joint [body units]
// alpha by radius
const RING = [[0.72, 0], [0.78, 1], [0.9, 1], [0.96, 0]], GLOW = [[0, 1], [0.35, 0.75], [1, 0]];
const DISC = [[0.8, 1], [0.95, 0]];

/** A texture that is white where it is not transparent, with an alpha by radius. */
function spotTexture(stops) {
  const canvas = document.createElement('canvas'), context = canvas.getContext('2d');
  canvas.width = canvas.height = 64;
  const fade = context.createRadialGradient(32, 32, 0, 32, 32, 32);
  for (const [at, alpha] of stops) fade.addColorStop(at, `rgba(255, 255, 255, ${alpha})`);
  context.fillStyle = fade;
  context.fillRect(0, 0, 64, 64);
  return new THREE.CanvasTexture(canvas);
}

function trailOf(actor, joint) {
  const geometry = new THREE.LineGeometry().setPositions(new Float32Array(3 * PATH));
  const material = new THREE.LineMaterial({linewidth: 3, transparent: true, opacity: 0.8});
  return Object.assign(new THREE.Line2(geometry, material), {visible: false, frustumCulled: false, actor, joint});
}

/** Puts a mark of a size and colour at a joint of a motion; hides it if the joint is -1. */
function putAt(mark, {positions}, joint, size, colour) {
  mark.visible = joint >= 0;
  if (!mark.visible) return;
  mark.position.fromArray(positions, 3 * joint);
  mark.scale.setScalar(size);
  mark.material.color.set(colour);
}

/** Shows marks for the rows of a timeline, and paths, on a stage. */
export class Marks {
  constructor(stage) {
    Object.assign(this, {stage, rows: [], shown: true, trails: false, pairs: [], dots: [[], []]});
    Object.assign(this, {ring: spotTexture(RING), glow: spotTexture(GLOW), disc: spotTexture(DISC)});
  }

  /** Makes marks for new actors of the stage. */
  build() {
    const {stage} = this, flat = new THREE.PlaneGeometry(1, 1).rotateX(-Math.PI / 2);
    const many = (made, length = MOST) => (
      Array.from({length}, () => Object.assign(made(), {visible: false, renderOrder: 2})));
    const sprite = map => () => new THREE.Sprite(new THREE.SpriteMaterial({depthTest: false, fog: false, map}));
    for (const side of stage.sides) {
      side.spots = many(sprite(null));
      side.rings = many(() => new THREE.Mesh(flat, new THREE.MeshBasicMaterial(
        {transparent: true, depthWrite: false, fog: false})));
      side.paths = side.actors.flatMap(actor => actor.ends.map(joint => trailOf(actor, joint)));
      side.dots = many(sprite(this.disc), side.actors[0].motion.parents.length);
      side.named = many(sprite(this.ring), NAMES);
      side.group.add(...side.dots, ...side.named, ...side.spots, ...side.rings, ...side.paths);
    }
  }

  update(frame, frameTime) {
    const {stage, trails} = this;
    stage.actors.forEach(({motion}) => motion.place(frame));
    stage.sides.forEach((side, number) => {
      const isResult = side.actors[0].role === 'result' || number === stage.sides.length - 1;
      const seen = this.shown && (isResult || !stage.overlaid);
      const active = this.rows.filter(({codes, kind, points}) => (
        seen && codes[frame] && points[number]?.length && (isResult || kind !== 'skin')));
      for (const [marks, rests] of [[side.rings, true], [side.spots, false]]) {
        const own = active.filter(({kind}) => (kind === 'support') === rests);
        marks.forEach((mark, k) => {
          mark.visible = k < own.length;
          if (mark.visible) this.put(mark, own[k], own[k].points[number], isResult, frame);
        });
      }
      const end = side.actors[0].role === 'source' ? 0 : 1, [{motion}] = side.actors;
      side.named.forEach((mark, k) => putAt(mark, motion, this.pairs[k]?.[end] ?? -1, NAMED, colourOf('focus')));
      side.dots.forEach((mark, joint) => {
        const colour = this.dots[end][joint];
        putAt(mark, motion, colour ? joint : -1, DOT, colour);
      });
      side.paths.forEach(line => { line.visible = trails; });
      if (trails && side.shown) this.drawPaths(side.paths, frame, Math.max(PAST / frameTime / (PATH - 1), 1));
    });
  }

  /** Puts the mark of a row in the middle of `points`, [actor, joint] each; its colour shows the error of a result. */
  put(mark, row, points, isResult, frame) {
    const {kind, limit, spots: {[frame]: spot}} = row, joints = spot ? [[points[0][0], spot]] : points;
    const [x, y, z] = middleOf(joints.map(([actor, joint]) => [this.stage.actors[actor].motion, joint]));
    const onFloor = kind === 'support' && y < ON_FLOOR, glows = kind === 'skin';
    mark.position.set(x, onFloor ? 0.004 : y, z);
    mark.scale.setScalar({contact: 0.05, skin: 0.15, support: onFloor ? 0.3 : 0.12}[kind]);
    mark.material.color.set(colourOf(glows ? 'over' : isResult ? levelAt(row, frame) : 'muted'));
    mark.material.opacity = glows ? Math.min((offAt(row, frame) / limit) ** 2, 1) : 1;
    mark.material.map = glows ? this.glow : this.ring;
  }

  /** Draws the paths of joints up to a frame, in steps of some frames. */
  drawPaths(paths, frame, step) {
    for (let k = 0; k < PATH; k++) {
      for (const {geometry, actor: {motion}, joint} of paths) {
        motion.place(Math.max(Math.round(frame - (PATH - 1 - k) * step), 0));
        const {array} = geometry.attributes.instanceStart.data;
        const place = motion.positions.subarray(3 * joint, 3 * joint + 3);
        if (k < PATH - 1) array.set(place, 6 * k); // where a piece begins
        if (k) array.set(place, 6 * k - 3); // where the one before ends
      }
    }
    for (const {geometry, material, actor} of paths) {
      geometry.attributes.instanceStart.data.needsUpdate = true;
      material.color.set(colourOf(actor.tone));
    }
  }
}
