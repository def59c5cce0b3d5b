// The ground on which actors stand: light, a floor that takes their shadows, and its grid.
/* global THREE */

import {SOFTWARE} from './bodies.js';
import {colourOf} from './dom.js';

const CELL = 0.25; // of the grid [body units]

export class Ground {
  /** The ground of a scene whose actors are within `reach`, lit from the side that looks along `facing`. */
  constructor(scene, reach, facing) {
    const light = new THREE.DirectionalLight(0xffffff, 2.1);
    light.position.setFromSphericalCoords(3.2 * reach + 0.5, 0.51, facing + 0.7);
    light.castShadow = true;
    light.shadow.mapSize.setScalar(SOFTWARE ? 512 : 1024);
    Object.assign(light.shadow, {radius: 3, normalBias: 0.012});
    Object.assign(light.shadow.camera, {left: -reach, right: reach, top: reach, bottom: -reach, far: 8 * reach});
    this.sky = new THREE.HemisphereLight(0xffffff, 0xffffff, 1.7);
    const plane = new THREE.PlaneGeometry(2.2 * reach, 2.2 * reach).rotateX(-Math.PI / 2);
    this.floor = new THREE.Mesh(plane, new THREE.ShadowMaterial({depthWrite: false}));
    this.floor.position.set(-light.position.x, 0, -light.position.z).setLength(0.3 * reach);
    this.floor.receiveShadow = true;
    this.grids = [[CELL, 'line-floor'], [4 * CELL, 'line-strong']].map(([cell, tone]) => {
      const grid = new THREE.GridHelper(80 * CELL, Math.round(80 * CELL / cell));
      Object.assign(grid.material, {transparent: true, vertexColors: false});
      return Object.assign(grid, {tone});
    });
    scene.add(light, light.target, this.sky, this.floor, ...this.grids);
  }

  /** Takes the colours of the page, and returns that of the air, into which the ground fades. */
  paint(scene) {
    const air = new THREE.Color(colourOf('stage'));
    scene.fog = new THREE.Fog(air, 1, 10);
    this.sky.groundColor.set(colourOf('stage-below'));
    this.floor.material.opacity = Number(colourOf('shadow-opacity'));
    for (const {material, tone} of this.grids) material.color.set(colourOf(tone));
    return air;
  }

  /** Moves the grid with the world, whose origin is at a place. */
  moveTo(x, z) {
    for (const grid of this.grids) grid.position.set(x % (4 * CELL), 0.001, z % (4 * CELL));
  }
}
