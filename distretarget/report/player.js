// The large view and its buttons.

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
  showFrame();
  const {contacts} = report.frames[state.frame];
  $('player').setAttribute('aria-label', `A and B at frame ${state.frame}, ${contacts} contacts in A`);
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
  const direction = figureOf('direction_error');
  place(B, 0);
  const shared = B.bones.every(bone => directionError(bone) !== null);
  $('legend').append(
    element('span', {class: 'group'}, term(`${direction.label} of B`, direction.explanation),
      ...[...LEVELS, ...(shared ? [] : [NOT_SHARED])].map(level => item(bone(level), level.name))),
    element('span', {class: 'group'}, item(bone(OF_A), 'A'), item(drawn('touch'), 'contact'),
      item(drawn('touch lost'), 'lost in B'), item(drawn('ring'), 'foot at rest in A')),
  );
}

// ---- buttons

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

function buildPlayer() {
  buildTransport();
  toggle('overlaid', 'overlaid');
  toggle('follow', 'follow');
  look('front', {azimuth: drawing.facing});
  look('side', {azimuth: drawing.facing + Math.PI / 2});
  look('reset', {});
  const canvas = $('player'), width = () => canvas.clientWidth / (state.overlaid ? 1 : 2);
  watchPointers(canvas, () => unitOf({height: canvas.clientHeight, width: width()}));
  buildLegend();
  painted(canvas, paintPlayer);
}
