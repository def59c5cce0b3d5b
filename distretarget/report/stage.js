// The stage: actors on a floor, in a view for each side or in one, through one camera; light, and shadows on the floor.
/* global THREE */

import {clamp, colourOf, onTheme, total} from './dom.js';
import {bend, bendable, bodyOf, materialsOf, SOFTWARE} from './bodies.js';
import {middleOf, Motion} from './motion.js';

const FIELD = 26, SLOPE = 2 * Math.tan(FIELD * Math.PI / 360); // of the camera, upwards [degrees], and per distance
const SAMPLES = 24; // frames from which the size of the view is found
const PERFORMERS = ['result', 'amber', 'violet', 'green'];
const COLOURS = {source: 'clay', copy: 'violet', result: 'result', prop: 'wood'};
const RESTS = 200; // a picture that has not changed for this time rests [ms]
const LABELS = 56; // height of the titles of views above bodies, and of the room below [pixels]
const NARROW = 560; // a stage narrower than this shows two of three sides at first [pixels]
export const MOST_VIEWS = 4; // of more sides one is shown at a time
const NEAR = 50; // largest distance of a click from the joint that it chooses [pixels]
const CLOSE = 1.3; // distance of the camera in a close view [body units]
const VEILED = 0.4; // opacity of a body under another one
const CELL = 0.25, BLOCK = 1; // of the grid, and of its stronger lines [body units]
const REACH = 7; // of the grid from its middle; fog hides it before [body units]
const LIFT = 0.001; // of shadows over the floor, and of the grid over shadows [body units]

/** The lines of a grid, in short pieces, as some drivers drop a line that begins behind the camera. */
function gridOf(cell, tone) {
  const corners = [];
  for (let across = -REACH; across <= REACH; across += cell) {
    for (let along = -REACH; along < REACH; along += BLOCK) {
      const end = along + BLOCK, y = 2 * LIFT;
      corners.push(across, y, along, across, y, end, along, y, across, end, y, across);
    }
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(corners), 3));
  return Object.assign(new THREE.LineSegments(geometry, new THREE.LineBasicMaterial()), {tone});
}

/** The part of the data that decides which bodies are on the stage, as a text to compare. */
const castOf = ({bodies, actors}) => JSON.stringify([bodies.map(({hash}) => hash), actors.map(
  ({side, role, body, parents, ends}) => [side, role, body, parents, ends])]);

/** The actors of some data, without motions; `sides` is the number of sides. */
async function actorsOf(data, sides) {
  const bodies = await Promise.all(data.bodies.map(bodyOf)), seen = Array(sides).fill(0);
  return data.actors.map(({name, side, role, body: number, centre, ends}) => {
    const body = bodies[number], place = seen[side]++;
    const tone = role === 'other' ? PERFORMERS[place % 4] : COLOURS[role];
    const plain = role === 'copy' || !body.inFile.length;
    const materials = plain ? [new THREE.MeshLambertMaterial()] : materialsOf(body);
    materials.forEach(one => { one.userData = {transparent: one.transparent, opacity: one.opacity}; });
    return {name, side, role, centre, ends, tone, plain, materials, mesh: bendable(body, materials),
      crown: body.crown};
  });
}

/** The point of a mesh that is seen at [0, 0]: `skin`, the joint that moves it most, or -1 for no point, and `at`, its
 * offset from that joint in the rest pose; `seen` are the projected vertices.
 */
function skinAt({geometry: {index: {array: corners}}, body}, seen) {
  const cross = ([x, y], [u, v]) => x * v - y * u, each = body.joints.length / seen.length;
  let found = null, front = Infinity;
  for (let t = 0; t < corners.length; t += 3) {
    const [a, b, c] = [seen[corners[t]], seen[corners[t + 1]], seen[corners[t + 2]]];
    const parts = [cross(b, c), cross(c, a), cross(a, b)], sum = parts[0] + parts[1] + parts[2];
    if (!sum || parts.some(part => part * sum < 0)) continue;
    const depth = (parts[0] * a[2] + parts[1] * b[2] + parts[2] * c[2]) / sum;
    if (depth < front) [front, found] = [depth, parts.map((part, k) => [corners[t + k], part / sum])];
  }
  if (!found) return {skin: -1, at: null};
  const {bind, joints, geometry: {attributes: {position: {array: rest}}}} = body;
  const skin = joints[each * found.toSorted(([, one], [, other]) => other - one)[0][0]];
  const place = k => total(found, ([corner, share]) => share * rest[3 * corner + k]) - bind[3 * skin + k];
  return {skin, at: [0, 1, 2].map(place)};
}

/** Frees the memory of an object on the graphics card. */
function freed({geometry, material}) {
  geometry?.dispose();
  for (const one of [material ?? []].flat()) {
    one.map?.dispose();
    one.normalMap?.dispose();
    one.dispose();
  }
}

class Ground {
  constructor(scene) {
    this.light = new THREE.DirectionalLight(0xffffff, 2.1);
    this.sky = new THREE.HemisphereLight(0xffffff, 0xffffff, 1.7);
    this.grid = new THREE.Group().add(gridOf(CELL, 'line-floor'), gridOf(BLOCK, 'line-strong'));
    this.dark = new THREE.MeshBasicMaterial({fog: false});
    this.flat = new THREE.Matrix4();
    scene.add(this.light, this.light.target, this.sky, this.grid);
  }

  /** Lights it from beside the direction `facing`, an angle about y. */
  face(facing) {
    const {x, y, z} = this.light.position.setFromSphericalCoords(1, 0.51, facing + 0.7);
    this.flat.set(1, -x / y, 0, 0, 0, 0, 0, LIFT, 0, -z / y, 1, 0, 0, 0, 0, 1);
  }

  /** The shadow of a mesh: the mesh pressed flat along the light. */
  shadowOf({geometry}) {
    const shadow = Object.assign(new THREE.Mesh(geometry, this.dark), {matrixAutoUpdate: false, frustumCulled: false});
    shadow.matrix.copy(this.flat);
    return shadow;
  }

  /** Takes the colours of the page, and returns that of the fog, into which the ground fades. */
  paint(scene) {
    const fog = new THREE.Color(colourOf('stage'));
    scene.fog = new THREE.Fog(fog, 1, 10);
    this.sky.groundColor.set(colourOf('stage-below'));
    this.dark.color.set(colourOf('shadow'));
    for (const {material, tone} of this.grid.children) material.color.set(colourOf(tone));
    return fog;
  }
}

export class Stage {
  /** An empty stage for sides with these titles; of many only the `first` is shown. `repaint` is called when the camera
   * moves.
   */
  constructor(canvas, {sides, first = 0}, repaint) {
    this.sides = sides.map(title => ({title, shown: true, group: new THREE.Group(), actors: []}));
    if (canvas.clientWidth < NARROW && sides.length === 3) this.sides[1].shown = false;
    if (sides.length > MOST_VIEWS) this.sides.forEach((side, k) => { side.shown = k === first; });
    Object.assign(this, {canvas, repaint, actors: [], facing: 0, overlaid: false, follow: true, framed: '',
      drawn: -Infinity});
    this.renderer = new THREE.WebGLRenderer({canvas: this.canvas, antialias: !SOFTWARE});
    this.renderer.setScissorTest(true);
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(FIELD, 1, 0.05, 100);
    this.controls = new THREE.OrbitControls(this.camera, this.canvas);
    Object.assign(this.controls, {minDistance: 0.15, maxDistance: 40, maxPolarAngle: 1.75});
    this.controls.addEventListener('change', this.repaint);
    this.ground = new Ground(this.scene);
    this.scene.add(...this.sides.map(({group}) => group));
    onTheme(() => this.paint());
  }

  /** Shows the motions of some data, with new actors if they are others than before; returns whether they are. The old
   * ones stay until all is loaded, and the camera keeps its position relative to the actors.
   */
  async take(data) {
    const cast = castOf(data), isNew = cast !== this.cast, turned = data.facing - this.facing;
    const actors = isNew ? await actorsOf(data, this.sides.length) : this.actors;
    const keys = data.actors.map(({hash}) => `${hash} ${data.frame_time}`);
    const motions = await Promise.all(data.actors.map((one, k) => (
      keys[k] === actors[k].key ? actors[k].motion : Motion.of(one, data.frame_time))));
    actors.forEach((actor, k) => {
      if (actor.motion !== motions[k]) actor.mesh.bent = -1;
      Object.assign(actor, {motion: motions[k], key: keys[k]});
    });
    Object.assign(this, {frames: data.frames, facing: data.facing});
    if (isNew) this.engage(actors);
    for (const side of this.sides) side.room = this.measured(side);
    if (!this.cast) this.look(0.5, 0.2);
    else if (isNew) this.turn(turned);
    this.cast = cast;
    return isNew;
  }

  /** Puts actors on the stage in place of those before. */
  engage(actors) {
    this.ground.face(this.facing);
    for (const side of this.sides) {
      side.group.traverse(freed);
      side.group.clear();
      side.actors = actors.filter(actor => this.sides[actor.side] === side);
      side.group.add(...side.actors.map(({mesh}) => mesh), ...side.actors.map(({mesh}) => this.ground.shadowOf(mesh)));
      side.veiled = undefined;
    }
    this.actors = actors;
    this.paint();
  }

  /** Turns the camera about its target, from above to the left [rad]. */
  turn(angle) {
    const {camera: {position}, controls} = this;
    position.sub(controls.target).applyAxisAngle(this.camera.up, angle).add(controls.target);
    controls.update();
  }

  /** Takes the colours of the page. */
  paint() {
    this.renderer.setClearColor(this.ground.paint(this.scene));
    for (const {materials, plain, tone} of this.actors) if (plain) materials[0].color.set(colourOf(tone));
    this.repaint();
  }

  /** The middle of the performers of a side at a frame, on the floor: [x, z]. */
  centre({actors}, frame) {
    const leads = actors.filter(({role}) => role !== 'prop'), seen = leads.length ? leads : actors;
    actors.forEach(({motion}) => motion.place(frame));
    const [x, , z] = middleOf(seen.map(({motion, centre}) => [motion, centre]));
    return [x, z];
  }

  /** The width and height of the view of a side [body units], and its middle over the clip, [x, z]. */
  measured(side) {
    const middle = [0, 0];
    let wide = 0, high = 0;
    for (let k = 0; k < SAMPLES; k++) {
      const [x, z] = this.centre(side, Math.round(k * (this.frames - 1) / (SAMPLES - 1)));
      for (const {motion: {positions: p}, crown} of side.actors) {
        for (let at = 0; at < p.length; at += 3) {
          wide = Math.max(wide, Math.hypot(p[at] - x, p[at + 2] - z));
          high = Math.max(high, p[at + 1] + crown);
        }
      }
      middle[0] += x / SAMPLES;
      middle[1] += z / SAMPLES;
    }
    return {across: clamp(2 * wide + 0.15, 0.7, 20), high: clamp(high + 0.06, 0.5, 20), middle};
  }

  /** The largest room of the sides that are shown. */
  get room() {
    const most = name => Math.max(...this.views.flat().map(({room}) => room[name]));
    return {across: most('across'), high: most('high')};
  }

  get views() {
    const seen = this.sides.filter(({shown}) => shown);
    return this.overlaid ? [seen] : seen.map(side => [side]);
  }

  /** Looks at the whole room from a direction, angles from the front about y and upwards [rad]; undoes pan and zoom. */
  look(azimuth, elevation) {
    const target = this.controls.target.set(0, 0.48 * this.room.high, 0);
    this.camera.position.setFromSphericalCoords(1, Math.PI / 2 - elevation, this.facing + azimuth).add(target);
    this.framed = '';
    this.repaint();
  }

  /** Looks closely at the middle of joints of the last side, at a frame; at the whole room if there are none. */
  approach(frame, joints) {
    if (!joints.length) return this.look(0.5, 0.2);
    const side = this.sides.at(-1), {camera, controls} = this, [{motion}] = side.actors;
    this.place(side, frame, [side]);
    const middle = new THREE.Vector3(...middleOf(joints.map(joint => [motion, joint]))).add(side.group.position);
    camera.position.sub(controls.target).setLength(CLOSE).add(middle);
    controls.target.copy(middle);
    controls.update();
  }

  /** Moves the camera away until the whole room is in view, if the views have changed since the last time. */
  frame(aspect) {
    if (this.framed === aspect.toFixed(2)) return;
    this.framed = aspect.toFixed(2);
    const {room: {high, across}, controls: {target}} = this;
    const away = Math.max((1 + LABELS / this.canvas.clientHeight) * high, across / aspect) / SLOPE + 0.3 * across;
    this.camera.position.sub(target).setLength(away).add(target);
    this.controls.update();
  }

  /** Pixels per pixel of the page. Without a graphics card a moving picture has fewer than one at rest. */
  sharpness(playing) {
    if (!SOFTWARE) return Math.min(devicePixelRatio, 2);
    const now = performance.now(), moving = playing || now - this.drawn < RESTS;
    clearTimeout(this.waiting);
    if (moving && !playing) this.waiting = setTimeout(this.repaint, 1.5 * RESTS);
    this.drawn = now;
    return !moving ? 2 : this.views.length > 1 ? 0.75 : 1;
  }

  draw(frame, playing = false) {
    const {clientWidth: width, clientHeight: height} = this.canvas, views = this.views;
    if (width < 1 || height < 1 || !views.length) return;
    const ratio = this.sharpness(playing), size = this.renderer.getSize(new THREE.Vector2());
    if (size.x !== width || size.y !== height || this.renderer.getPixelRatio() !== ratio) {
      this.renderer.setPixelRatio(ratio);
      this.renderer.setSize(width, height, false);
    }
    const share = width / views.length;
    this.camera.aspect = share / height;
    this.camera.updateProjectionMatrix();
    this.frame(this.camera.aspect);
    for (const side of views.flat()) this.place(side, frame, views[0]);
    views.forEach((sides, k) => this.render(sides, this.camera, this.controls.target, [k * share, 0, share, height]));
  }

  /** The joint nearest to a place on the canvas, or -1, with `skinAt` the place and the role of their body; of overlaid
   * bodies that is the last.
   */
  jointAt(left, top) {
    const {clientWidth, clientHeight} = this.canvas, share = clientWidth / this.views.length;
    const view = Math.min(Math.floor(left / share), this.views.length - 1);
    const side = this.views[view].at(-1), [{role, motion: {positions}, mesh}] = side.actors;
    const place = new THREE.Vector3();
    const seen = places => Array.from({length: places.length / 3}, (_, k) => { // from the place, and how far away
      place.fromArray(places, 3 * k).add(side.group.position).project(this.camera);
      return [(place.x + 1) / 2 * share + view * share - left, (1 - place.y) / 2 * clientHeight - top, place.z];
    });
    const away = seen(positions).map(([x, y, z]) => Math.hypot(x, y) + z); // of joints at one place the nearer one
    const nearest = Math.min(...away);
    return {role, joint: nearest < NEAR ? away.indexOf(nearest) : -1,
      ...skinAt(mesh, seen(mesh.geometry.attributes.position.array))};
  }

  /** Draws sides into a box of the canvas, through a camera that looks at a place. */
  render(sides, camera, target, box) {
    const away = camera.position.distanceTo(target), {x, z} = sides.at(-1).group.position;
    for (const side of this.sides) side.group.visible = sides.includes(side);
    Object.assign(this.scene.fog, {near: away + 0.6, far: away + 6});
    this.ground.grid.position.set(x % BLOCK, 0, z % BLOCK); // it moves with the world
    this.renderer.setViewport(...box);
    this.renderer.setScissor(...box);
    this.renderer.render(this.scene, camera);
  }

  /** Draws a frame of the last side alone, from in front, on a 2D canvas. */
  snapshot(frame, picture) {
    const side = this.sides.at(-1), {high, across} = side.room, {width, height} = picture;
    const camera = new THREE.PerspectiveCamera(FIELD, width / height, 0.05, 100);
    const middle = new THREE.Vector3(0, 0.48 * high, 0), ratio = this.renderer.getPixelRatio();
    camera.position.setFromSphericalCoords(1.02 * high / SLOPE + 0.2 * across, 1.4, this.facing + 0.5).add(middle);
    camera.lookAt(middle);
    this.place(side, frame, [side]);
    this.render([side], camera, middle, [0, 0, width / ratio, height / ratio]);
    picture.getContext('2d').drawImage(this.canvas, 0, this.canvas.height - height, width, height, 0, 0, width, height);
  }

  /** Bends the actors of a side, and moves the side so that the view follows it. */
  place(side, frame, together) {
    const last = together.at(-1), veiled = this.overlaid && side !== last;
    const [x, z] = this.follow ? this.centre(side, frame) : (this.overlaid ? last : side).room.middle;
    side.group.position.set(-x, 0, -z);
    for (const {motion, mesh, materials} of side.actors) {
      motion.place(frame);
      if (mesh.bent !== motion.frame) bend(mesh, motion);
      mesh.bent = motion.frame;
      const veil = one => (veiled ? {transparent: true, opacity: VEILED} : one.userData);
      if (side.veiled !== veiled) materials.forEach(one => Object.assign(one, veil(one), {needsUpdate: true}));
    }
    side.veiled = veiled;
  }
}
