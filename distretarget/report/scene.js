// The player of a scene: all performers and props on both sides, such as source and result, and tables below it.

const BODY_COLOURS = ['b', 'e2', 'e1', 'stance'];
const SAMPLES = 24; // frames from which the size of the view is estimated
const scene = JSON.parse($('scene').textContent);
const frameCount = scene.frame_count;
const frameTime = scene.frame_time;
const state = {frame: 0, playing: false, speed: 1, draws: 0};
const camera = {azimuth: scene.facing, elevation: 0.18, zoom: 1, x: 0, y: 0, distance: 8};

/** A function (drawn frame, joint) => [x, y, z] for a body on one side. */
function unpacked({parents, offset, scale, positions}) {
  const numbers = new Int16Array(bytes(positions));
  return (frame, joint) => [0, 1, 2].map(
    axis => offset[axis] + scale[axis] * numbers[(frame * parents.length + joint) * 3 + axis]);
}

const bodies = scene.bodies.map(({name, prop, sides}, number) => ({
  name, colour: prop ? 'muted' : BODY_COLOURS[number % BODY_COLOURS.length],
  sides: sides.map(side => ({parents: side.parents, at: unpacked(side)})),
}));

/** The middle of all bodies on one side over the clip, and how far they reach from it. */
function roomOf(side) {
  const low = [Infinity, 0, Infinity], high = [-Infinity, 0, -Infinity];
  for (const {parents, at} of bodies.map(body => body.sides[side])) {
    for (let k = 0; k < SAMPLES; k++) {
      const frame = Math.floor(k * scene.drawn / SAMPLES);
      parents.forEach((_, joint) => at(frame, joint).forEach((x, axis) => {
        low[axis] = Math.min(low[axis], x);
        high[axis] = Math.max(high[axis], x);
      }));
    }
  }
  const across = Math.hypot(high[0] - low[0], high[2] - low[2]);
  return {centre: [(low[0] + high[0]) / 2, high[1] / 2, (low[2] + high[2]) / 2], high: high[1], across};
}

const rooms = [0, 1].map(roomOf);

function unitOf(box, {high, across}) {
  return Math.min(box.height / (1.3 * high), box.width / (1.2 * across));
}

function drawLine(context, from, to, name, width, dash = []) {
  context.strokeStyle = colour[name];
  context.lineWidth = width;
  context.setLineDash(dash);
  traceLine(context, from, to);
  context.stroke();
  context.setLineDash([]);
}

function drawSide(context, box, side) {
  context.save();
  context.beginPath();
  context.rect(box.x, box.y, box.width, box.height);
  context.clip();
  const room = rooms[side], project = projection(camera, box, room.centre, unitOf(box, room));
  const frame = Math.min(Math.floor(state.frame / scene.step), scene.drawn - 1);
  drawFloor(context, project, room.centre);
  context.lineCap = 'round';
  for (const body of bodies) {
    const {parents, at} = body.sides[side], places = parents.map((_, joint) => project(...at(frame, joint)));
    parents.forEach((upper, lower) => {
      const width = Math.max(1.5, 0.012 * places[lower][2]);
      if (upper >= 0) drawLine(context, places[upper], places[lower], body.colour, width);
    });
  }
  for (const [numbers, onLeft, onRight, first, end] of scene.lines) {
    if (frame < first || frame >= end) continue;
    const joints = [onLeft, onRight][side];
    const [from, to] = numbers.map((number, k) => bodies[number].sides[side].at(frame, joints[k]));
    const apart = Math.hypot(...from.map((x, axis) => x - to[axis]));
    drawLine(context, project(...from), project(...to), 'touch', 2, side && apart > 1.5 * scene.near ? [4, 3] : []);
  }
  context.fillStyle = colour.muted;
  context.font = '600 13px system-ui, sans-serif';
  context.fillText(scene.sides[side], box.x + 12, 22);
  context.restore();
}

function paintPlayer() {
  const {context, width, height} = fitted($('player'));
  [0, 1].forEach(side => drawSide(context, {x: side * width / 2, y: 0, width: width / 2, height}, side));
  context.fillStyle = colour.line;
  context.fillRect(width / 2, 12, 1, height - 24);
  showFrame();
}

/** A cell with a text, or, of the number of a frame, with a button that goes there. */
function cellOf(content) {
  if (typeof content === 'string') return element('td', {}, content);
  const go = {type: 'button', 'aria-label': `Go to frame ${content}`, on: {click: () => goTo(content)}};
  return element('td', {}, element('button', go, content));
}

function tableOf({title, columns, rows}) {
  return element('section', {}, element('h2', {}, title),
    element('div', {class: 'table'}, element('table', {},
      element('thead', {}, element('tr', {}, ...columns.map(name => element('th', {scope: 'col'}, name)))),
      element('tbody', {}, ...rows.map(cells => element('tr', {}, ...cells.map(cellOf)))))));
}

function start() {
  $('legend').append(
    ...bodies.map(body => element('span', {style: `color: var(--${body.colour})`}, body.name)));
  $('tables').append(...scene.tables.map(tableOf));
  const canvas = $('player');
  watchPointers(canvas, () => unitOf({height: canvas.clientHeight, width: canvas.clientWidth / 2}, rooms[0]));
  buildTransport();
  painted(canvas, paintPlayer);
  followTheme();
}

start();
