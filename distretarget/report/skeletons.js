// Bodies, floor and contacts on a canvas.

// Direction error of a bone of B, relative to its own build [degrees], shown by colour, by thickness and by dashes.
const LEVELS = [
  {below: 3, name: 'under 3°', colour: 'e0', width: 1, dash: null},
  {below: 8, name: '3–8°', colour: 'e1', width: 1.25, dash: null},
  {below: 20, name: '8–20°', colour: 'e2', width: 1.5, dash: [2, 5]},
  {below: Infinity, name: 'over 20°', colour: 'e3', width: 1.8, dash: [6, 4]},
];
const NOT_SHARED = {name: 'not in A', colour: 'muted', width: 0.55, dash: null};
const OF_A = {colour: 'a', width: 1, dash: null};
const OVER_B = {...OF_A, width: 0.4};
const BONE = 0.024;
const SAMPLES = 48; // frames from which the size of the view is estimated

function levelOf(degrees) {
  return degrees === null ? NOT_SHARED : LEVELS.find(level => degrees < level.below);
}

/** Draws one bone: a halo that separates it from what is behind, its colour, and the dashes of its level. */
function drawBone(context, from, to, look) {
  const thick = Math.max(1.5, BONE * look.width * (from[2] + to[2]) / 2);
  traceLine(context, from, to);
  for (const [style, width, dash] of [
    [colour.panel, thick + Math.min(2.5, thick * 0.5), []],
    [colour[look.colour], thick, []],
    [colour.panel, thick * 0.4, look.dash],
  ]) {
    if (!dash) continue;
    context.strokeStyle = style;
    context.lineWidth = width;
    context.lineCap = width > thick ? 'butt' : 'round';
    context.setLineDash(dash);
    context.stroke();
  }
  context.setLineDash([]);
}

/** Draws a body, the farthest bones first. */
function drawBody(context, motion, project, lookOf) {
  const {x} = motion, at = [];
  for (let k = 0; k < x.length; k += 3) at.push(project(x[k], x[k + 1], x[k + 2]));
  const order = motion.bones.map(bone => [at[bone[0]][2] + at[bone[1]][2], bone]).sort((p, q) => p[0] - q[0]);
  for (const [, bone] of order) drawBone(context, at[bone[0]], at[bone[1]], lookOf(bone));
  context.fillStyle = colour.panel;
  for (const joint of motion.points) {
    const [column, row, size] = at[joint];
    if (BONE * size < 5) continue;
    context.beginPath();
    context.arc(column, row, BONE * 0.22 * size, 0, 7);
    context.fill();
  }
  return at;
}

function drawShadow(context, motion, project) {
  const {x} = motion;
  context.strokeStyle = colour.shadow;
  context.lineWidth = Math.max(2, BONE * 1.3 * project(x[0], 0, x[2])[2]);
  context.lineCap = context.lineJoin = 'round';
  context.beginPath();
  for (const [upper, lower] of motion.bones) {
    context.moveTo(...project(x[3 * upper], 0, x[3 * upper + 2]).slice(0, 2));
    context.lineTo(...project(x[3 * lower], 0, x[3 * lower + 2]).slice(0, 2));
  }
  context.stroke();
}

/** Draws a ring around each joint that rests in A: on the floor for those of the feet, at its height for others. */
function drawSupports(context, motion, project, frame) {
  context.strokeStyle = colour.stance;
  context.lineWidth = 2;
  motion.resting.forEach((joint, k) => {
    if (!restsAt(k, frame)) return;
    const isFoot = drawing.passing.length > 0 && k < 4;
    const x = motion.x[3 * joint], y = isFoot ? 0 : motion.x[3 * joint + 1], z = motion.x[3 * joint + 2];
    context.beginPath();
    for (let step = 0; step <= 24; step++) {
      const angle = step * Math.PI / 12;
      context.lineTo(...project(x + 0.055 * Math.cos(angle), y, z + 0.055 * Math.sin(angle)).slice(0, 2));
    }
    context.stroke();
  });
}

/** Draws lines between joints that touch in A; in B they are dashed where the joints do not touch. */
function drawContacts(context, motion, at, frame) {
  context.strokeStyle = colour.touch;
  for (const [i, j, kept] of contactsAt(frame)) {
    const from = at[motion.points[i]], to = at[motion.points[j]];
    context.setLineDash(motion === A || kept ? [] : [4, 3]);
    context.lineWidth = 1.25;
    traceLine(context, from, to);
    context.stroke();
  }
  context.setLineDash([]);
}

/** Draws rings around the two joints of the chosen pair, a line between them, and their names if `named`. */
function drawChosen(context, motion, at, box, named) {
  if (!state.pair) return;
  const joints = state.pair.map(point => motion.points[point]);
  const [from, to] = joints.map(joint => at[joint]);
  context.strokeStyle = context.fillStyle = colour.mark;
  context.lineWidth = 2;
  context.setLineDash([2, 3]);
  traceLine(context, from, to);
  context.stroke();
  context.setLineDash([]);
  context.font = '600 12px system-ui, sans-serif';
  const sign = from[1] <= to[1] ? -1 : 1;
  [from, to].forEach(([column, row], k) => {
    context.beginPath();
    context.arc(column, row, 7, 0, 7);
    context.stroke();
    if (!named || k && joints[0] === joints[1]) return;
    const name = motion.names[joints[k]], width = context.measureText(name).width;
    const x = clamp(column + 10, box.x + 4, box.x + box.width - width - 4);
    const y = row + 4 + (k ? -sign : sign) * 12;
    context.lineWidth = 4;
    context.strokeStyle = colour.panel;
    context.strokeText(name, x, y);
    context.fillText(name, x, y);
    context.strokeStyle = colour.mark;
    context.lineWidth = 2;
  });
}

function hips(motion) {
  const joint = drawing.pelvis[motion === A ? 0 : 1];
  return [motion.x[3 * joint], room.height * 0.43, motion.x[3 * joint + 2]];
}

/** The centre of the view: the hips, or, if it does not follow them, their place in the middle of the clip. */
function centreOf(motion, frame) {
  if (!state.follow && !motion.middle) {
    place(motion, frameCount >> 1);
    motion.middle = hips(motion);
  }
  place(motion, frame);
  return state.follow ? hips(motion) : motion.middle;
}

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
  return {azimuth: drawing.facing + 0.55, elevation: 0.15, zoom: 1, x: 0, y: 0, distance: 6};
}

const room = {width: 1, height: 1};
Object.assign(room, reach());

/** Draws one motion, or both overlaid, at a frame in a box of the canvas; overlaid, A is thinner. */
function drawScene(context, box, frame, motions, camera) {
  context.save();
  context.beginPath();
  context.rect(box.x, box.y, box.width, box.height);
  context.clip();
  const centres = motions.map(motion => centreOf(motion, frame));
  [A, B].forEach(motion => place(motion, frame));
  // A view that follows the hips puts both bodies in one place; otherwise each stands in its place in the world.
  const views = centres.map(
    centre => projection(camera, box, state.follow ? centre : centres[centres.length - 1], unitOf(box)));
  drawFloor(context, views[views.length - 1], centres[centres.length - 1]);
  motions.forEach((motion, k) => drawShadow(context, motion, views[k]));
  const look = {a: () => motions[0] === B ? OVER_B : OF_A, b: bone => levelOf(directionError(bone))};
  const places = motions.map((motion, k) => {
    drawSupports(context, motion, views[k], frame);
    const at = drawBody(context, motion, views[k], motion === A ? look.a : look.b);
    drawContacts(context, motion, at, frame);
    return at;
  });
  motions.forEach((motion, k) => drawChosen(context, motion, places[k], box, k === 0));
  context.restore();
}
