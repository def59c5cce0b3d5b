// The camera of a player: its pointers, its projection, and the floor that it sees. The world has y up, the floor at 0,
// and a unit of about a body's height.

const GRID = 0.25;

function turned(camera, dx, dy) {
  camera.azimuth -= dx * 0.008;
  camera.elevation = clamp(camera.elevation + dy * 0.008, -0.2, 1.5);
}

function zoomed(camera, factor) {
  camera.zoom = clamp(camera.zoom * factor, 0.2, 20);
}

/** A function (x, y, z) => [column, row, pixels of one unit there] for a box with `centre` in its middle; `pixels` is
 * the size of a unit at zoom 1.
 */
function projection(camera, box, centre, pixels) {
  const {azimuth, elevation, zoom, distance} = camera;
  const [ca, sa, ce, se] = [Math.cos(azimuth), Math.sin(azimuth), Math.cos(elevation), Math.sin(elevation)];
  const unit = pixels * zoom;
  const middle = box.x + box.width / 2 + camera.x * unit, centreRow = box.y + box.height / 2 + camera.y * unit;
  return (x, y, z) => {
    const dx = x - centre[0], dy = y - centre[1], dz = z - centre[2];
    const across = ca * dx - sa * dz, ahead = sa * dx + ca * dz;
    const size = unit * distance / (distance - ce * ahead - se * dy);
    return [middle + across * size, centreRow - (ce * dy - se * ahead) * size, size];
  };
}

/** One pointer turns or moves the view, two zoom and move it; `pixelsOfUnit` returns the size of a unit at zoom 1. */
function watchPointers(canvas, pixelsOfUnit) {
  const down = new Map();
  const spread = () => {
    const [p, q] = [...down.values()];
    return {x: (p.x + q.x) / 2, y: (p.y + q.y) / 2, apart: Math.hypot(p.x - q.x, p.y - q.y) || 1};
  };
  const move = (dx, dy) => {
    const unit = pixelsOfUnit() * camera.zoom;
    camera.x += dx / unit;
    camera.y += dy / unit;
  };
  canvas.addEventListener('pointerdown', event => {
    canvas.setPointerCapture(event.pointerId);
    down.set(event.pointerId, {x: event.clientX, y: event.clientY});
  });
  canvas.addEventListener('pointermove', event => {
    const last = down.get(event.pointerId);
    if (!last) return;
    const old = down.size === 2 ? spread() : null;
    const [dx, dy] = [event.clientX - last.x, event.clientY - last.y];
    Object.assign(last, {x: event.clientX, y: event.clientY});
    if (old) {
      const now = spread();
      zoomed(camera, now.apart / old.apart);
      move(now.x - old.x, now.y - old.y);
    } else if (event.shiftKey || event.buttons & 2) {
      move(dx, dy);
    } else {
      turned(camera, dx, dy);
    }
    repaint();
  });
  for (const type of ['pointerup', 'pointercancel']) {
    canvas.addEventListener(type, event => down.delete(event.pointerId));
  }
  canvas.addEventListener('contextmenu', event => event.preventDefault());
  canvas.addEventListener('wheel', event => {
    event.preventDefault();
    zoomed(camera, Math.exp(-event.deltaY * 0.0015));
    repaint();
  }, {passive: false});
}

/** Makes the straight line between two points on the screen the path of a context. */
function traceLine(context, from, to) {
  context.beginPath();
  context.moveTo(from[0], from[1]);
  context.lineTo(to[0], to[1]);
}

/** Draws the floor as a grid that fades out around `centre`. */
function drawFloor(context, project, centre) {
  const [column, row, size] = project(centre[0], 0, centre[2]);
  const fade = context.createRadialGradient(column, row, size * 0.3, column, row, size * 1.6);
  fade.addColorStop(0, colour.line);
  fade.addColorStop(1, colour.line.replace('rgb(', 'rgba(').replace(')', ', 0)'));
  context.strokeStyle = fade;
  context.lineWidth = 1;
  context.beginPath();
  const [west, south] = [Math.round(centre[0] / GRID), Math.round(centre[2] / GRID)];
  for (let k = -8; k <= 8; k++) {
    for (const ends of [[k, -8, k, 8], [-8, k, 8, k]]) {
      context.moveTo(...project((west + ends[0]) * GRID, 0, (south + ends[1]) * GRID).slice(0, 2));
      context.lineTo(...project((west + ends[2]) * GRID, 0, (south + ends[3]) * GRID).slice(0, 2));
    }
  }
  context.stroke();
}
