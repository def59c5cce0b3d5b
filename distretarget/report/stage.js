// The stage: actors on a floor, in a view for each side or in one, through one camera.
/* global THREE */

import {clamp, colourOf, onTheme} from './dom.js';
import {Ground} from './ground.js';
import {bend, bendable, bodyOf, materialsOf, SOFTWARE} from './bodies.js';
import {Motion} from './motion.js';

const SAMPLES = 24; // frames from which the size of the view is found
const PERFORMERS = ['result', 'amber', 'violet', 'green'];
const COLOURS = {source: 'clay', copy: 'violet', result: 'result', prop: 'wood'};
const RESTS = 200; // a picture that has been the same for so long rests [ms]
const NARROW = 560; // a stage with less pixels shows two of three sides at first
export const MOST_VIEWS = 4; // of more sides one is shown at a time
const VEILED = 0.4; // opacity of what another body is laid over

export class Stage {
  /** A stage with the actors of a page; `repaint` is called when the camera moves. */
  static async of(canvas, data, repaint) {
    const {facing, frames} = data;
    const stage = Object.assign(new Stage(), {canvas, facing, frames, overlaid: false, follow: true, framed: ''});
    const bodies = await Promise.all(data.bodies.map(bodyOf));
    stage.sides = data.sides.map(title => ({title, shown: true, group: new THREE.Group(), actors: []}));
    stage.actors = await Promise.all(data.actors.map(async (actor, number) => {
      const side = stage.sides[actor.side];
      const tone = actor.role === 'other' ? PERFORMERS[side.actors.length % 4] : COLOURS[actor.role];
      const body = bodies[actor.body], plain = actor.role === 'copy' || !body.materials.length;
      const materials = plain ? [new THREE.MeshLambertMaterial()] : materialsOf(body);
      materials.forEach(one => { one.userData = {transparent: one.transparent, opacity: one.opacity}; });
      const mesh = bendable(body, materials), {crown} = body;
      const made = {...actor, number, tone, mesh, materials, plain, crown};
      side.actors.push(made);
      side.group.add(mesh);
      made.motion = await Motion.of(actor, data.frame_time);
      return made;
    }));
    if (canvas.clientWidth < NARROW && stage.sides.length === 3) stage.sides[1].shown = false;
    if (stage.sides.length > MOST_VIEWS) stage.sides.forEach((side, k) => { side.shown = k === (data.first || 0); });
    stage.build(repaint);
    return stage;
  }

  build(repaint) {
    Object.assign(this, {repaint, drawn: -Infinity});
    this.renderer = new THREE.WebGLRenderer({canvas: this.canvas, antialias: !SOFTWARE});
    this.renderer.setScissorTest(true);
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(26, 1, 0.05, 100);
    this.controls = new THREE.OrbitControls(this.camera, this.canvas);
    Object.assign(this.controls, {minDistance: 0.15, maxDistance: 40, maxPolarAngle: 1.75});
    this.controls.addEventListener('change', repaint);
    for (const side of this.sides) side.room = this.measured(side);
    this.ground = new Ground(this.scene, this.facing);
    for (const {group, actors} of this.sides) group.add(...actors.map(({mesh}) => this.ground.shadowOf(mesh)));
    this.scene.add(...this.sides.map(({group}) => group));
    this.look(this.facing + 0.5, 0.2);
    onTheme(() => {
      this.paint();
      repaint();
    });
  }

  /** Takes the colours of the page. */
  paint() {
    this.renderer.setClearColor(this.ground.paint(this.scene));
    for (const {materials, plain, tone} of this.actors) if (plain) materials[0].color.set(colourOf(tone));
  }

  /** Where the performers of a side are at a frame, on the floor: [x, z]. */
  centre(side, frame) {
    const leads = side.actors.filter(({role}) => role !== 'prop'), sum = [0, 0];
    const seen = leads.length ? leads : side.actors;
    side.actors.forEach(({motion}) => motion.place(frame));
    for (const {motion, centre} of seen) {
      sum[0] += motion.positions[3 * centre] / seen.length;
      sum[1] += motion.positions[3 * centre + 2] / seen.length;
    }
    return sum;
  }

  /** How wide and high the view of a side has to be [body units], and its middle over the clip, [x, z]. */
  measured(side) {
    const middle = [0, 0];
    let wide = 0, high = 0;
    for (let k = 0; k < SAMPLES; k++) {
      const frame = Math.round(k * (this.frames - 1) / (SAMPLES - 1)), [x, z] = this.centre(side, frame);
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
    const rooms = this.views.flat().map(({room}) => room);
    return {across: Math.max(...rooms.map(room => room.across)), high: Math.max(...rooms.map(room => room.high))};
  }

  get views() {
    const seen = this.sides.filter(({shown}) => shown);
    return this.overlaid ? [seen] : seen.map(side => [side]);
  }

  /** Looks from a direction, angles from z about y and upwards [rad], at the whole room; pans and zooms are undone. */
  look(azimuth, elevation) {
    this.controls.target.set(0, 0.48 * this.room.high, 0);
    this.camera.position.setFromSphericalCoords(1, Math.PI / 2 - elevation, azimuth).add(this.controls.target);
    this.framed = '';
  }

  /** Goes so far away that the whole room is in view, where the views have changed since the last time. */
  frame(aspect) {
    if (this.framed === aspect.toFixed(2)) return;
    this.framed = aspect.toFixed(2);
    const slope = 2 * Math.tan(this.camera.fov * Math.PI / 360), {high, across} = this.room;
    const away = Math.max(1.1 * high, across / aspect) / slope + 0.3 * across;
    this.camera.position.sub(this.controls.target).setLength(away).add(this.controls.target);
    this.controls.update();
  }

  /** Pixels per pixel of the page. Without a graphics card a picture that moves has few; when it rests it gets more. */
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

  /** Draws sides into a box of the canvas, through a camera that looks at a place. */
  render(sides, camera, target, box) {
    const away = camera.position.distanceTo(target), {x, z} = sides.at(-1).group.position;
    for (const side of this.sides) side.group.visible = sides.includes(side);
    Object.assign(this.scene.fog, {near: away + 0.6, far: away + 6});
    this.ground.moveTo(x, z);
    this.renderer.setViewport(...box);
    this.renderer.setScissor(...box);
    this.renderer.render(this.scene, camera);
  }

  /** Draws a frame of the last side alone, from in front, on a 2D canvas. */
  snapshot(frame, picture) {
    const side = this.sides.at(-1), {high, across} = side.room, {width, height} = picture;
    const camera = new THREE.PerspectiveCamera(this.camera.fov, width / height, 0.05, 100);
    const middle = new THREE.Vector3(0, 0.48 * high, 0), ratio = this.renderer.getPixelRatio();
    const away = 1.02 * high / (2 * Math.tan(camera.fov * Math.PI / 360)) + 0.2 * across;
    camera.position.setFromSphericalCoords(away, 1.4, this.facing + 0.5).add(middle);
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
      if (side.veiled === veiled) continue;
      for (const one of materials) {
        Object.assign(one, veiled ? {transparent: true, opacity: VEILED} : one.userData, {needsUpdate: true});
      }
    }
    side.veiled = veiled;
  }

  /** Turns the camera by angles [rad], moves it by pixels, or zooms it by a factor. */
  orbit(azimuth, elevation) {
    this.controls.rotateLeft(azimuth);
    this.controls.rotateUp(elevation);
    this.controls.update();
  }

  pan(x, y) {
    this.controls.pan(x, y);
    this.controls.update();
  }

  zoom(factor) {
    this.camera.position.sub(this.controls.target).divideScalar(factor).add(this.controls.target);
    this.controls.update();
  }
}
