// Figures of each frame as curves that share the player's frame.

// `least` is what the axis goes to at least: what is smaller is nothing to look at.
const CURVES = [
  {name: 'Stress × 1000', term: 'stress', worst: 2, lines: [['stress', 'b']], factor: 1000, least: 0.1},
  {name: 'Contact error', term: 'contact_error', worst: 2, lines: [['contact_error', 'b']], factor: 1, least: 0.002,
    none: 'no contacts in A'},
  {name: 'Direction error, °', term: 'direction_error', worst: 2, lines: [['direction_error', 'b']], factor: 1,
    least: 0.2, none: 'no bones in common'},
  {name: 'Slide, legs/s', term: 'slide', worst: 2, lines: [['slide_a', 'a'], ['slide_b', 'b']], factor: 1,
    least: 0.01, none: 'no feet at rest in A'},
  {name: 'Jerk, sizes/s³', term: 'jerk', lines: [['jerk_a', 'a'], ['jerk_b', 'b']], factor: 1, least: 0.1,
    none: 'fewer than four frames'},
  {name: 'Bone error, %', term: 'bone_error', worst: 1, lines: [['bone_error', 'b']], factor: 100, least: 0.01},
];
const FLAT = 1e-9; // a bone error below this is rounding, and is drawn as 0

/** A figure of the clip or of a frame in its unit on the page; null where nothing was to be measured. */
function figureOf(row, field, factor) {
  const value = row[field];
  return value === null ? null : Math.abs(value * factor) < FLAT ? 0 : value * factor;
}

function column(field, factor) {
  return report.frames.map(row => figureOf(row, field, factor));
}

function xOf(frame, width) {
  return 1 + (frameCount > 1 ? frame / (frameCount - 1) : 0.5) * (width - 2);
}

/** The curves of one figure; a value that stands alone between gaps is a dot. */
function drawLines(context, width, height, columns, top) {
  const y = value => height - 2 - Math.min(value / top, 1) * (height - 8);
  columns.forEach(({values, name}) => {
    context.strokeStyle = colour[name];
    context.lineWidth = name === 'a' ? 1.25 : 1.6;
    context.lineJoin = context.lineCap = 'round';
    context.setLineDash(name === 'a' ? [1, 3] : []);
    context.beginPath();
    let inside = false;
    values.forEach((value, frame) => {
      if (value === null) inside = false;
      else if (inside) context.lineTo(xOf(frame, width), y(value));
      else {
        context.moveTo(xOf(frame, width) - 0.4, y(value));
        context.lineTo(xOf(frame, width) + 0.4, y(value));
        inside = true;
      }
    });
    context.stroke();
  });
  context.setLineDash([]);
}

/** A canvas that is drawn anew only when its size or the colours change. */
function kept(draw) {
  const store = document.createElement('canvas');
  let key = '';
  return (context, width, height) => {
    const ratio = window.devicePixelRatio || 1, wanted = `${width} ${height} ${ratio} ${colour.version}`;
    if (width < 1 || height < 1) return;
    if (wanted !== key) {
      key = wanted;
      Object.assign(store, {width: Math.round(width * ratio), height: Math.round(height * ratio)});
      const own = store.getContext('2d');
      own.scale(ratio, ratio);
      draw(own, width, height);
    }
    context.drawImage(store, 0, 0, width, height);
  };
}

/** Where an axis ends: at the largest value, but below a few that are far beyond all others and would flatten them. */
function axisTop(values, most, least) {
  const usual = [...values].sort((p, q) => p - q)[Math.floor(0.98 * (values.length - 1))];
  return usual > least && most > 5 * usual ? 1.5 * usual : most;
}

function buildCurve(curve) {
  const columns = curve.lines.map(([field, name]) => ({values: column(field, curve.factor), name}));
  const known = columns.flatMap(({values}) => values).filter(value => value !== null);
  const most = known.reduce((p, q) => Math.max(p, q), curve.least);
  const top = axisTop(known, most, curve.least);
  const end = top < most ? `${shown(top)}+` : shown(top);
  const canvas = element('canvas', {role: 'img', 'aria-label': `${curve.name} over time, axis to ${end}`});
  const readout = element('output', {class: 'readout'});
  const two = columns.length > 1;
  const background = kept((context, width, height) => {
    context.fillStyle = colour.line;
    context.fillRect(0, height - 1, width, 1);
    if (known.length) drawLines(context, width, height, columns, top);
  });
  painted(canvas, () => {
    const {context, width, height} = fitted(canvas);
    background(context, width, height);
    const x = xOf(state.frame, width);
    context.fillStyle = colour.mark;
    context.fillRect(x - 0.75, 0, 1.5, height);
    readout.replaceChildren(...columns.flatMap(({values, name}) => {
      const value = values[state.frame];
      if (value !== null) {
        context.beginPath();
        context.arc(x, height - 2 - Math.min(value / top, 1) * (height - 8), 3, 0, 7);
        context.fill();
      }
      const letter = two ? element('small', {class: `of-${name}`}, name.toUpperCase()) : '';
      return [letter, element('b', {}, shown(value))];
    }));
  });
  dragFrames(canvas);
  const none = known.length ? '' : element('span', {class: 'none'}, curve.none || 'nothing to measure');
  $('curves').append(element('figure', {class: 'curve'},
    element('figcaption', {}, term(curve.name, TERMS[curve.term]), readout),
    element('div', {class: 'plot'}, canvas, none),
    element('div', {class: 'axis', 'aria-hidden': 'true'},
      ...(known.length ? [end, '0'] : []).map(text => element('span', {}, text)))));
}

/** Pressing or dragging on an element as wide as the clip goes to the frame there. */
function dragFrames(target) {
  const go = event => {
    const box = target.getBoundingClientRect();
    goTo((event.clientX - box.left) / box.width * (frameCount - 1));
  };
  target.addEventListener('pointerdown', event => {
    target.setPointerCapture(event.pointerId);
    go(event);
  });
  target.addEventListener('pointermove', event => { if (event.buttons) go(event); });
}
