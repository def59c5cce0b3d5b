// The ground on which actors stand: light, the grid of the floor, and shadows on it.
/* global THREE */

import {colourOf} from './dom.js';

const CELL = 0.25, BLOCK = 1; // of the grid, and of its stronger lines [body units]
const REACH = 7; // of the grid from its middle; the air hides it before [body units]
const LIFT = 0.001; // of shadows over the floor, and of the grid over shadows [body units]

/** The lines of a grid, in short pieces, as some drivers drop a line that begins behind the camera. */
function gridOf(cell, tone) {
  const corners = [];
  for (let across = -REACH; across <= REACH; across += cell) {
    for (let along = -REACH; along < REACH; along += BLOCK) {
      for (const end of [along, along + BLOCK]) corners.push(across, 2 * LIFT, end);
      for (const end of [along, along + BLOCK]) corners.push(end, 2 * LIFT, across);
    }
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(corners), 3));
  return Object.assign(new THREE.LineSegments(geometry, new THREE.LineBasicMaterial()), {tone});
}

export class Ground {
  /** The ground of a scene, lit from the side that looks along `facing`. */
  constructor(scene, facing) {
    const light = new THREE.DirectionalLight(0xffffff, 2.1), {x, y, z} = light.position.setFromSphericalCoords(
      1, 0.51, facing + 0.7);
    this.sky = new THREE.HemisphereLight(0xffffff, 0xffffff, 1.7);
    this.grids = [gridOf(CELL, 'line-floor'), gridOf(BLOCK, 'line-strong')];
    this.dark = new THREE.MeshBasicMaterial({fog: false});
    this.flat = new THREE.Matrix4().set(1, -x / y, 0, 0, 0, 0, 0, LIFT, 0, -z / y, 1, 0, 0, 0, 0, 1);
    scene.add(light, light.target, this.sky, ...this.grids);
  }

  /** The shadow of a mesh: the mesh pressed flat along the light. */
  shadowOf({geometry}) {
    const shadow = Object.assign(new THREE.Mesh(geometry, this.dark), {matrixAutoUpdate: false, frustumCulled: false});
    shadow.matrix.copy(this.flat);
    return shadow;
  }

  /** Takes the colours of the page, and returns that of the air, into which the ground fades. */
  paint(scene) {
    const air = new THREE.Color(colourOf('stage'));
    scene.fog = new THREE.Fog(air, 1, 10);
    this.sky.groundColor.set(colourOf('stage-below'));
    this.dark.color.set(colourOf('shadow'));
    for (const {material, tone} of this.grids) material.color.set(colourOf(tone));
    return air;
  }

  /** Moves the grid with the world, whose origin is at a place. */
  moveTo(x, z) {
    for (const grid of this.grids) grid.position.set(x % BLOCK, 0, z % BLOCK);
  }
}
