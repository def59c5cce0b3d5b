// Marks on the stage: what touches, what rests, where skin sinks in, and the paths of hands and feet.
/* global THREE */

import {colourOf} from './dom.js';
import {levelAt, offAt} from './timeline.js';

const PATH = 32, PAST = 0.8; // points of a path, and the time that it goes back [s]
const ON_FLOOR = 0.12; // supports that are lower rest on the floor [body units]
const MOST = 12; // marks of a side at a time

/** A texture of a disc that fades from its middle, or of a ring. */
function spotTexture(ring) {
  const canvas = document.createElement('canvas'), context = canvas.getContext('2d');
  canvas.width = canvas.height = 64;
  const fade = context.createRadialGradient(32, 32, 0, 32, 32, 32);
  const stops = ring ? [[0.72, 0], [0.78, 1], [0.9, 1], [0.96, 0]] : [[0, 1], [0.35, 0.75], [1, 0]];
  for (const [at, alpha] of stops) fade.addColorStop(at, `rgba(255, 255, 255, ${alpha})`);
  context.fillStyle = fade;
  context.fillRect(0, 0, 64, 64);
  return new THREE.CanvasTexture(canvas);
}

/** Shows marks for the rows of a timeline, and paths, on a stage. */
export class Marks {
  constructor(stage, rows) {
    Object.assign(this, {stage, rows, shown: true, trails: false});
    const textures = {ring: spotTexture(true), glow: spotTexture(false)};
    const flat = new THREE.PlaneGeometry(1, 1).rotateX(-Math.PI / 2);
    this.textures = textures;
    for (const side of stage.sides) {
      const made = (count, mark) => Array.from({length: count}, () => {
        const one = Object.assign(mark(), {visible: false, renderOrder: 2});
        side.group.add(one);
        return one;
      });
      side.spots = made(MOST, () => new THREE.Sprite(new THREE.SpriteMaterial({depthTest: false, fog: false})));
      side.rings = made(MOST, () => new THREE.Mesh(flat, new THREE.MeshBasicMaterial(
        {transparent: true, depthWrite: false, fog: false})));
      side.paths = side.actors.flatMap(actor => actor.ends.map(joint => {
        const geometry = new THREE.LineGeometry().setPositions(new Float32Array(3 * PATH));
        const line = new THREE.Line2(geometry, new THREE.LineMaterial({linewidth: 3, transparent: true, opacity: 0.8}));
        side.group.add(line);
        return Object.assign(line, {visible: false, frustumCulled: false, actor, joint});
      }));
    }
  }

  /** The middle of the joints of a row on a side. */
  static at(points, actors) {
    const sum = [0, 0, 0];
    for (const [number, joint] of points) {
      const x = actors[number].motion.positions;
      for (let axis = 0; axis < 3; axis++) sum[axis] += x[3 * joint + axis] / points.length;
    }
    return sum;
  }

  update(frame, frameTime) {
    const {stage} = this;
    stage.actors.forEach(({motion}) => motion.place(frame));
    stage.sides.forEach((side, number) => {
      const judged = side.actors[0].role === 'result' || number === stage.sides.length - 1;
      const seen = this.shown && (judged || !stage.overlaid);
      const active = this.rows.filter(({codes, kind, points}) => (
        seen && codes[frame] && points[number]?.length && (judged || kind !== 'skin')));
      for (const [marks, kinds] of [[side.rings, ['support']], [side.spots, ['contact', 'skin']]]) {
        const own = active.filter(({kind}) => kinds.includes(kind));
        marks.forEach((mark, k) => {
          mark.visible = k < own.length;
          if (!mark.visible) return;
          const {points, spots} = own[k], [[actor]] = points[number];
          const shown = spots && spots[frame] ? [[actor, spots[frame]]] : points[number];
          this.put(mark, own[k], Marks.at(shown, stage.actors), judged, frame);
        });
      }
    });
    if (this.trails) this.drawPaths(frame, frameTime);
    for (const {paths} of stage.sides) paths.forEach(line => { line.visible = this.trails; });
  }

  put(mark, row, [x, y, z], judged, frame) {
    const onFloor = row.kind === 'support' && y < ON_FLOOR, glows = row.kind === 'skin';
    mark.position.set(x, onFloor ? 0.004 : y, z);
    mark.scale.setScalar({contact: 0.05, skin: 0.15, support: onFloor ? 0.3 : 0.12}[row.kind]);
    mark.material.color.set(colourOf(glows ? 'over' : judged ? levelAt(row, frame) : 'muted'));
    mark.material.opacity = glows ? Math.min((offAt(row, frame) / row.limit) ** 2, 1) : 1;
    mark.material.map = this.textures[glows ? 'glow' : 'ring'];
  }

  drawPaths(frame, frameTime) {
    const step = Math.max(PAST / frameTime / (PATH - 1), 1);
    for (const {paths, shown} of this.stage.sides) {
      if (!shown) continue;
      for (const actor of new Set(paths.map(line => line.actor))) {
        const own = paths.filter(line => line.actor === actor);
        for (let k = 0; k < PATH; k++) {
          actor.motion.place(Math.max(Math.round(frame - (PATH - 1 - k) * step), 0));
          for (const {geometry, joint} of own) {
            const {array} = geometry.attributes.instanceStart.data, x = actor.motion.positions;
            for (let axis = 0; axis < 3; axis++) {
              if (k < PATH - 1) array[6 * k + axis] = x[3 * joint + axis];
              if (k) array[6 * k - 3 + axis] = x[3 * joint + axis];
            }
          }
        }
        for (const line of own) {
          line.geometry.attributes.instanceStart.data.needsUpdate = true;
          line.material.color.set(colourOf(actor.tone));
        }
      }
    }
  }
}
