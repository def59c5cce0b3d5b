// The large view, its controls and the keys.

let camera = newCamera();

function paintPlayer() {
  const {context, width, height} = fitted($('player'));
  const boxes = state.overlaid ? [{x: 0, y: 0, width, height}]
    : [{x: 0, y: 0, width: width / 2, height}, {x: width / 2, y: 0, width: width / 2, height}];
  const shownMotions = state.overlaid ? [[B, A]] : [[A], [B]];
  boxes.forEach((box, k) => drawScene(context, box, state.frame, shownMotions[k], camera));
  context.fillStyle = colour.line;
  if (!state.overlaid) context.fillRect(width / 2, 12, 1, height - 24);
  context.font = '600 13px system-ui, sans-serif';
  [['A', report.a.file, 'a', 12], ['B', report.b.file, 'b', state.overlaid ? width / 2 : width / 2 + 12]].forEach(
    ([letter, file, name, x]) => {
      context.fillStyle = colour[name];
      context.fillText(letter, x, 22);
      context.fillStyle = colour.muted;
      context.fillText(shortened(context, file, width / 2 - 44), x + 16, 22);
    });
  const row = report.frames[state.frame];
  $('slider').value = state.frame;
  $('slider').setAttribute('aria-valuetext', `frame ${state.frame} of ${frameCount - 1}, ${row.time.toFixed(2)} s`);
  $('now').textContent = `${state.frame} / ${frameCount - 1} · ${row.time.toFixed(2)} s`;
  $('player').setAttribute('aria-label', `A and B at frame ${state.frame}, ${row.contacts} contacts in A`);
  $('selected').textContent = state.pair ? pairText(state.pair, state.frame) : '';
}

function shortened(context, text, width) {
  let kept = text;
  while (kept.length > 4 && context.measureText(kept).width > width) kept = `${kept.slice(0, -2).replace(/…$/, '')}…`;
  return kept;
}

function buildLegend() {
  const bone = look => {
    const mark = element('canvas', {class: 'mark', 'aria-hidden': 'true'});
    painted(mark, () => {
      const {context, width, height} = fitted(mark);
      drawBone(context, [6, height / 2, 200], [width - 6, height / 2, 200], look);
    });
    return mark;
  };
  const item = (mark, text) => element('span', {class: 'item'}, mark, text);
  const drawn = kind => element('span', {class: `mark ${kind}`});
  place(B, 0);
  const shared = B.bones.every(bone => directionError(bone) !== null);
  $('legend').append(
    element('span', {class: 'group'}, term('B turned from A’s motion', figureOf('direction_error').explanation),
      ...[...LEVELS, ...(shared ? [] : [NOT_SHARED])].map(level => item(bone(level), level.name))),
    element('span', {class: 'group'}, item(bone(OF_A), 'A'), item(drawn('touch'), 'contact'),
      item(drawn('touch lost'), 'lost in B'), item(drawn('ring'), 'foot at rest in A')),
  );
}

// ---- pointers: one pointer turns or moves the view, two zoom and move it

function watchPointers(canvas) {
  const down = new Map();
  const spread = () => {
    const [p, q] = [...down.values()];
    return {x: (p.x + q.x) / 2, y: (p.y + q.y) / 2, apart: Math.hypot(p.x - q.x, p.y - q.y) || 1};
  };
  const move = (dx, dy) => {
    const width = canvas.clientWidth / (state.overlaid ? 1 : 2);
    const unit = unitOf({height: canvas.clientHeight, width}) * camera.zoom;
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

// ---- buttons and keys

function toggle(id, name) {
  $(id).addEventListener('click', () => {
    state[name] = !state[name];
    $(id).setAttribute('aria-pressed', state[name]);
    repaint();
  });
}

function look(id, view) {
  $(id).addEventListener('click', () => {
    camera = Object.assign(newCamera(), view);
    repaint();
  });
}

const KEYS = {
  ' ': () => setPlaying(!state.playing),
  ArrowLeft: event => goTo(state.frame - (event.shiftKey ? 10 : 1)),
  ArrowRight: event => goTo(state.frame + (event.shiftKey ? 10 : 1)),
  Home: () => goTo(0),
  End: () => goTo(frameCount - 1),
  '+': () => zoomed(camera, 1.2),
  '-': () => zoomed(camera, 1 / 1.2),
};

function onKey(event) {
  const tag = event.target.tagName;
  const taken = tag === 'SELECT' || event.key === ' ' && ['BUTTON', 'SUMMARY'].includes(tag);
  if (!KEYS[event.key] || taken || event.ctrlKey || event.metaKey || event.altKey) return;
  event.preventDefault();
  KEYS[event.key](event);
  repaint();
}

function buildPlayer() {
  $('slider').max = frameCount - 1;
  $('slider').disabled = $('play').disabled = frameCount < 2;
  $('slider').addEventListener('input', event => goTo(Number(event.target.value)));
  $('play').addEventListener('click', () => setPlaying(!state.playing));
  $('speed').addEventListener('change', event => { state.speed = Number(event.target.value); });
  toggle('overlaid', 'overlaid');
  toggle('follow', 'follow');
  look('front', {azimuth: drawing.facing});
  look('side', {azimuth: drawing.facing + Math.PI / 2});
  look('reset', {});
  addEventListener('keydown', onKey);
  watchPointers($('player'));
  buildLegend();
  painted($('player'), paintPlayer);
}
