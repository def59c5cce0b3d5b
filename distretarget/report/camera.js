// The projection from the world to the screen. The world has y up, the floor at 0, and a unit of about a body's height.

const DISTANCE = 6;
const SAMPLES = 48;

/** The width and height that the view needs for both bodies, from how far their joints are from their hips. */
function reach() {
  const wide = [], high = [];
  for (let k = 0; k < SAMPLES; k++) {
    for (const motion of [A, B]) {
      place(motion, Math.floor(k * frameCount / SAMPLES));
      const [x, , z] = hips(motion);
      let across = 0, top = 0;
      for (let joint = 0; joint < motion.joints; joint++) {
        across = Math.max(across, Math.hypot(motion.x[3 * joint] - x, motion.x[3 * joint + 2] - z));
        top = Math.max(top, motion.x[3 * joint + 1]);
      }
      wide.push(across);
      high.push(top);
    }
  }
  const most = values => values.sort((p, q) => p - q)[Math.floor(0.9 * (values.length - 1))];
  return {width: clamp(2.1 * most(wide), 0.65, 2), height: clamp(1.25 * most(high), 0.5, 2.5)};
}

/** How many pixels one unit takes at zoom 1. */
function unitOf(box) {
  return Math.min(box.height / room.height, box.width / room.width);
}

function newCamera() {
  return {azimuth: drawing.facing + 0.55, elevation: 0.15, zoom: 1, x: 0, y: 0};
}

function turned(camera, dx, dy) {
  camera.azimuth -= dx * 0.008;
  camera.elevation = clamp(camera.elevation + dy * 0.008, -0.2, 1.5);
}

function zoomed(camera, factor) {
  camera.zoom = clamp(camera.zoom * factor, 0.2, 20);
}

/** A function (x, y, z) => [column, row, pixels of one unit there] for a box; `centre` is the point in its middle. */
function projection(camera, box, centre) {
  const {azimuth, elevation, zoom} = camera;
  const [ca, sa, ce, se] = [Math.cos(azimuth), Math.sin(azimuth), Math.cos(elevation), Math.sin(elevation)];
  const unit = unitOf(box) * zoom;
  const middle = box.x + box.width / 2 + camera.x * unit, centreRow = box.y + box.height / 2 + camera.y * unit;
  return (x, y, z) => {
    const dx = x - centre[0], dy = y - centre[1], dz = z - centre[2];
    const across = ca * dx - sa * dz, ahead = sa * dx + ca * dz;
    const size = unit * DISTANCE / (DISTANCE - ce * ahead - se * dy);
    return [middle + across * size, centreRow - (ce * dy - se * ahead) * size, size];
  };
}
