// Matrices of D for all pairs at the current frame: in A, in B, and the difference B − A.

/** 256 colours that blend the given ones in order, as 32-bit pixels. */
function ramp(names) {
  const stops = names.map(name => colour[name].match(/[\d.]+/g).map(Number));
  const pixels = new Uint8ClampedArray(4 * 256);
  for (let k = 0; k < 256; k++) {
    const place = k / 255 * (stops.length - 1), low = Math.min(Math.floor(place), stops.length - 2);
    const share = place - low;
    for (let c = 0; c < 3; c++) pixels[4 * k + c] = stops[low][c] * (1 - share) + stops[low + 1][c] * share;
    pixels[4 * k + 3] = 255;
  }
  return new Uint32Array(pixels.buffer);
}

const LIMIT = Math.max(drawing.largest_difference, 0.01);
const OF_D = {colours: ['near', 'middle', 'far'], low: '0', high: '1', words: ['touching', 'stretched']};
const MATRICES = [
  {...OF_D, title: 'A', caption: 'D in A', value: k => A.D[k]},
  {...OF_D, title: 'B', caption: 'D in B', value: k => B.D[k]},
  {colours: ['minus', 'zero', 'plus'], low: `−${shown(LIMIT)}`, high: `+${shown(LIMIT)}`,
    words: ['B nearer', 'farther'], title: 'B − A', caption: 'Difference B − A',
    value: k => ((B.D[k] - A.D[k]) / LIMIT + 1) / 2},
];

function paintMatrix(canvas, matrix, store) {
  const {context, width} = fitted(canvas);
  if (!pointCount || width < 1) return;
  distances(A, state.frame);
  distances(B, state.frame);
  if (matrix.version !== colour.version) Object.assign(matrix, {version: colour.version, ramp: ramp(matrix.colours)});
  const own = store.getContext('2d'), image = own.createImageData(pointCount, pointCount);
  const pixels = new Uint32Array(image.data.buffer);
  for (let k = 0; k < pixels.length; k++) {
    const value = matrix.value(k);
    if (!Number.isNaN(value)) pixels[k] = matrix.ramp[Math.round(clamp(value, 0, 1) * 255)];
  }
  own.putImageData(image, 0, 0);
  context.imageSmoothingEnabled = false;
  context.drawImage(store, 0, 0, width, width);
  const cell = width / pointCount;
  context.strokeStyle = colour.touch;
  context.lineWidth = 1;
  if (cell >= 4) {
    for (const [i, j, keptInB] of contactsAt(state.frame)) {
      if (matrix.title === 'B' && !keptInB) context.setLineDash([2, 2]);
      for (const [row, at] of [[i, j], [j, i]]) {
        context.strokeRect(at * cell + 0.5, row * cell + 0.5, cell - 1, cell - 1);
      }
      context.setLineDash([]);
    }
  }
  if (state.pair) drawCross(context, width, cell);
}

function drawCross(context, width, cell) {
  const [row, at] = state.pair;
  context.strokeStyle = colour.mark;
  context.lineWidth = 1;
  context.strokeRect(-2, row * cell, width + 4, cell);
  context.strokeRect(at * cell, -2, cell, width + 4);
  context.lineWidth = 2.5;
  context.strokeRect(at * cell, row * cell, cell, cell);
}

function watchMatrix(canvas) {
  canvas.addEventListener('pointermove', event => {
    const box = canvas.getBoundingClientRect();
    const cellAt = part => clamp(Math.floor(part * pointCount), 0, pointCount - 1);
    choose([cellAt((event.clientY - box.top) / box.height), cellAt((event.clientX - box.left) / box.width)]);
  });
  const steps = {ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0]};
  canvas.addEventListener('keydown', event => {
    const step = steps[event.key];
    if (!step || !pointCount) return;
    event.preventDefault();
    event.stopPropagation();
    const from = state.pair || [0, 0];
    choose(from.map((point, k) => clamp(point + step[k], 0, pointCount - 1)));
  });
  canvas.addEventListener('focus', () => { if (!state.pair && pointCount) choose([0, 0]); });
}

function buildMatrices() {
  for (const matrix of MATRICES) {
    const store = document.createElement('canvas');
    store.width = store.height = Math.max(pointCount, 1);
    const canvas = element('canvas', {tabindex: '0', role: 'application', 'aria-describedby': 'cell',
      'aria-label': `Normalised distances ${matrix.title}; arrow keys go from pair to pair`});
    watchMatrix(canvas);
    painted(canvas, () => paintMatrix(canvas, matrix, store));
    const stops = matrix.colours.map(name => `var(--${name})`).join();
    $('matrices').append(element('figure', {},
      element('figcaption', {}, term(matrix.caption, D_MEANS)), canvas,
      element('div', {class: 'scale'}, element('span', {}, matrix.low),
        element('i', {style: `background: linear-gradient(to right, ${stops})`}),
        element('span', {}, matrix.high)),
      element('div', {class: 'scale ends'}, ...matrix.words.map(word => element('span', {}, word)))));
  }
  const hint = 'Point at a cell, or focus a matrix and use the arrow keys: its joints are named here and marked in the '
    + 'player. Framed cells are contacts in A.';
  painted($('cell'), () => { $('cell').textContent = state.pair ? pairText(state.pair, state.frame) : hint; });
}
