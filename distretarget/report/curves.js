// The figures of each frame as curves over time, marked at the frame of the player.

const FLAT = 1e-9; // values of a figure below this are rounding errors, and are shown as 0

/** A figure of the clip or of a frame, times the factor of the page; null where nothing was to be measured. */
function valueOf(row, field, factor) {
  const value = row[field];
  return value === null ? null : Math.abs(value * factor) < FLAT ? 0 : value * factor;
}

function column(field, factor) {
  return report.frames.map(row => valueOf(row, field, factor));
}

function xOf(frame, width) {
  return 1 + (frameCount > 1 ? frame / (frameCount - 1) : 0.5) * (width - 2);
}

/** Draws the curves of one figure; a single value between gaps becomes a dot. */
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

/** A function that draws a picture, and repeats the work only when its size or the colours change. */
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

/** Where an axis ends: at the largest value, or lower if a few values far above all others would flatten the curve. */
function axisTop(values, most, least) {
  const usual = [...values].sort((p, q) => p - q)[Math.floor(0.98 * (values.length - 1))];
  return usual > least && most > 5 * usual ? 1.5 * usual : most;
}

function buildCurve(figure) {
  const {key, factor, judged} = figure, least = figure.least * factor;
  const lines = [...judged === 'value' ? [] : [[`${key}_source`, 'a']], [key, 'b']];
  const columns = lines.map(([field, name]) => ({values: column(field, factor), name}));
  const known = columns.flatMap(({values}) => values).filter(value => value !== null);
  const most = known.reduce((p, q) => Math.max(p, q), least);
  const top = axisTop(known, most, least);
  const end = top < most ? `${shown(top)}+` : shown(top);
  const canvas = element('canvas', {role: 'img', 'aria-label': `${nameOf(figure)} over time, axis to ${end}`});
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
  const none = known.length ? '' : element('span', {class: 'none'}, figure.missing || 'nothing to measure');
  $('curves').append(element('figure', {class: 'curve'},
    element('figcaption', {}, term(nameOf(figure), figure.explanation), readout),
    element('div', {class: 'plot'}, canvas, none),
    element('div', {class: 'axis', 'aria-hidden': 'true'},
      ...(known.length ? [end, '0'] : []).map(text => element('span', {}, text)))));
}

/** Pressing or dragging on an element, whose width stands for the whole clip, goes to the frame at that place. */
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
