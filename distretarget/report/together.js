'use strict';
// The player of a scene: all performers and props on both sides, such as source and result.

const COLOURS = ['--b', '--e2', '--e1', '--stance'];
const GRID = 0.25;
const DISTANCE = 8;
const $ = id => document.getElementById(id);
const scene = JSON.parse($('scene').textContent);
const view = {frame: 0, playing: false, azimuth: scene.facing, elevation: 0.18, zoom: 1};
let clock = 0, before = 0, waiting = false;

function unpacked({offset, scale, positions}, joints) {
  const bytes = Uint8Array.from(atob(positions), character => character.charCodeAt(0)).buffer;
  const numbers = new Int16Array(bytes);
  return (frame, joint) => [0, 1, 2].map(
    axis => offset[axis] + scale[axis] * numbers[(frame * joints + joint) * 3 + axis]);
}

const bodies = scene.bodies.map(({name, parents, sides, prop}, number) => ({
  name, parents, prop, sides: sides.map((side, k) => unpacked(side, parents[k].length)),
  colour: getComputedStyle(document.documentElement).getPropertyValue(
    prop ? '--muted' : COLOURS[number % COLOURS.length]),
}));

/** The middle of all bodies on one side over the clip, and how far they reach from it. */
function room(side) {
  const low = [Infinity, 0, Infinity], high = [-Infinity, 0, -Infinity];
  for (const body of bodies) {
    for (let k = 0; k < 24; k++) {
      const frame = Math.floor(k * scene.drawn / 24);
      body.parents[side].forEach((_, joint) => body.sides[side](frame, joint).forEach((x, axis) => {
        low[axis] = Math.min(low[axis], x);
        high[axis] = Math.max(high[axis], x);
      }));
    }
  }
  const across = Math.hypot(high[0] - low[0], high[2] - low[2]);
  return {centre: [(low[0] + high[0]) / 2, high[1] / 2, (low[2] + high[2]) / 2], high: high[1], across};
}

const rooms = [0, 1].map(room);

function projection(box, {centre, high, across}) {
  const [ca, sa] = [Math.cos(view.azimuth), Math.sin(view.azimuth)];
  const [ce, se] = [Math.cos(view.elevation), Math.sin(view.elevation)];
  const unit = Math.min(box.height / (1.3 * high), box.width / (1.2 * across)) * view.zoom;
  return ([x, y, z]) => {
    const dx = x - centre[0], dy = y - centre[1], dz = z - centre[2];
    const ahead = sa * dx + ca * dz;
    const size = unit * DISTANCE / (DISTANCE - ce * ahead - se * dy);
    return [box.x + box.width / 2 + (ca * dx - sa * dz) * size, box.height / 2 - (ce * dy - se * ahead) * size, size];
  };
}

function line(context, from, to, style, width, dash = []) {
  context.strokeStyle = style;
  context.lineWidth = width;
  context.setLineDash(dash);
  context.beginPath();
  context.moveTo(from[0], from[1]);
  context.lineTo(to[0], to[1]);
  context.stroke();
  context.setLineDash([]);
}

function drawFloor(context, project, centre, style) {
  const [west, south] = [Math.round(centre[0] / GRID), Math.round(centre[2] / GRID)];
  for (let k = -8; k <= 8; k++) {
    for (const [a, b, c, d] of [[k, -8, k, 8], [-8, k, 8, k]]) {
      line(context, project([(west + a) * GRID, 0, (south + b) * GRID]),
        project([(west + c) * GRID, 0, (south + d) * GRID]), style, 1);
    }
  }
}

function drawSide(context, box, side, style) {
  context.save();
  context.beginPath();
  context.rect(box.x, 0, box.width, box.height);
  context.clip();
  const project = projection(box, rooms[side]), frame = Math.min(Math.floor(view.frame / scene.step), scene.drawn - 1);
  drawFloor(context, project, rooms[side].centre, style('--line'));
  context.lineCap = 'round';
  for (const body of bodies) {
    const at = body.parents[side].map((_, joint) => project(body.sides[side](frame, joint)));
    body.parents[side].forEach((upper, lower) => {
      if (upper >= 0) line(context, at[upper], at[lower], body.colour, Math.max(1.5, 0.012 * at[lower][2]));
    });
  }
  for (const [numbers, onLeft, onRight, first, end] of scene.lines) {
    if (frame < first || frame >= end) continue;
    const joints = [onLeft, onRight][side];
    const [from, to] = numbers.map((number, k) => bodies[number].sides[side](frame, joints[k]));
    const apart = Math.hypot(...from.map((x, axis) => x - to[axis]));
    const dash = side && apart > 1.5 * scene.near ? [4, 3] : [];
    line(context, project(from), project(to), style('--touch'), 2, dash);
  }
  context.fillStyle = style('--muted');
  context.font = '600 13px system-ui, sans-serif';
  context.fillText(scene.sides[side], box.x + 12, 22);
  context.restore();
}

function paint(now) {
  waiting = false;
  if (view.playing) {
    clock = (clock + Math.max(0, now - before) / 1000) % (scene.frame_count * scene.frame_time);
    view.frame = Math.min(Math.floor(clock / scene.frame_time + 1e-6), scene.frame_count - 1);
    before = now;
  }
  const canvas = $('player'), ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth, height = canvas.clientHeight;
  Object.assign(canvas, {width: Math.round(width * ratio), height: Math.round(height * ratio)});
  const context = canvas.getContext('2d'), styles = getComputedStyle(document.documentElement);
  context.scale(ratio, ratio);
  [0, 1].forEach(side => drawSide(
    context, {x: side * width / 2, width: width / 2, height}, side, name => styles.getPropertyValue(name)));
  $('slider').value = view.frame;
  $('now').textContent = `${view.frame} / ${scene.frame_count - 1} · ${(view.frame * scene.frame_time).toFixed(2)} s`;
  if (view.playing) repaint();
}

function repaint() {
  if (!waiting) requestAnimationFrame(paint);
  waiting = true;
}

function goTo(frame) {
  view.frame = Math.min(Math.max(Math.round(frame), 0), scene.frame_count - 1);
  clock = view.frame * scene.frame_time;
  repaint();
}

function setPlaying(playing) {
  view.playing = playing;
  before = performance.now();
  $('play').setAttribute('aria-label', playing ? 'Stop' : 'Play');
  $('play').classList.toggle('playing', playing);
  repaint();
}

function onKey(event) {
  const step = event.shiftKey ? 10 : 1;
  const keys = {
    ' ': () => setPlaying(!view.playing), ArrowLeft: () => goTo(view.frame - step),
    ArrowRight: () => goTo(view.frame + step), Home: () => goTo(0), End: () => goTo(scene.frame_count - 1),
  };
  if (!keys[event.key] || event.target.tagName === 'BUTTON' && event.key === ' ') return;
  event.preventDefault();
  keys[event.key]();
}

function addCell(row, content) {
  const cell = row.insertCell();
  if (typeof content === 'string') {
    cell.textContent = content;
    return;
  }
  const button = document.createElement('button');
  button.type = 'button';
  button.textContent = content;
  button.setAttribute('aria-label', `Go to frame ${content}`);
  button.addEventListener('click', () => goTo(content));
  cell.append(button);
}

function addTable({title, columns, rows}) {
  const section = document.createElement('section'), heading = document.createElement('h2');
  const frame = document.createElement('div'), table = document.createElement('table');
  heading.textContent = title;
  frame.className = 'table';
  const head = table.createTHead().insertRow(), body = table.createTBody();
  for (const column of columns) {
    const cell = document.createElement('th');
    cell.textContent = column;
    head.append(cell);
  }
  for (const cells of rows) {
    const row = body.insertRow();
    cells.forEach(content => addCell(row, content));
  }
  frame.append(table);
  section.append(heading, frame);
  $('tables').append(section);
}

function build() {
  for (const {name, colour} of bodies) {
    const item = document.createElement('span');
    item.textContent = name;
    item.style.color = colour;
    $('legend').append(item);
  }
  scene.tables.forEach(addTable);
  const player = $('player');
  player.addEventListener('pointerdown', event => player.setPointerCapture(event.pointerId));
  player.addEventListener('pointermove', event => {
    if (!event.buttons) return;
    view.azimuth -= event.movementX * 0.008;
    view.elevation = Math.min(Math.max(view.elevation + event.movementY * 0.008, -0.2), 1.5);
    repaint();
  });
  player.addEventListener('wheel', event => {
    event.preventDefault();
    view.zoom = Math.min(Math.max(view.zoom * Math.exp(-event.deltaY * 0.0015), 0.2), 20);
    repaint();
  }, {passive: false});
  $('slider').max = scene.frame_count - 1;
  $('slider').addEventListener('input', event => goTo(Number(event.target.value)));
  $('play').addEventListener('click', () => setPlaying(!view.playing));
  addEventListener('keydown', onKey);
  addEventListener('resize', repaint);
  repaint();
}

build();
