'use strict';
// Elements, numbers, colours, and the painting loop.

const $ = id => document.getElementById(id);

/** An element with attributes, listeners under `on`, and children; a string becomes text, never markup. */
function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name === 'on') Object.entries(value).forEach(([type, listener]) => made.addEventListener(type, listener));
    else made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

/** A number with three digits, for people to read; a dash where there is none. */
function shown(value) {
  if (value === null || value === undefined || Number.isNaN(value)) return '–';
  if (value === 0) return '0';
  const size = Math.abs(value);
  if (size < 1e-4) return value > 0 ? '<0.0001' : '>−0.0001';
  const digits = clamp(2 - Math.floor(Math.log10(Number(size.toPrecision(3)))), 0, 4);
  return value.toFixed(digits).replace('-', '−');
}

/** The bytes that a text in base64 stands for. */
function bytes(text) {
  return Uint8Array.from(atob(text), character => character.charCodeAt(0)).buffer;
}

function clamp(value, low, high) {
  return Math.min(high, Math.max(low, value));
}

// ---- colours, which the style sheet defines for both themes

const COLOURS = ['muted', 'line', 'panel', 'shadow', 'a', 'b', 'e0', 'e1', 'e2', 'e3', 'touch', 'mark', 'stance',
  'near', 'middle', 'far', 'minus', 'zero', 'plus'];
const colour = {};

function readColours() {
  const probe = document.body.appendChild(element('i'));
  for (const name of COLOURS) {
    probe.style.color = `var(--${name})`;
    colour[name] = getComputedStyle(probe).color;
  }
  probe.remove();
  colour.version = (colour.version || 0) + 1;
}

function isDark() {
  const chosen = document.documentElement.dataset.theme;
  return chosen ? chosen === 'dark' : matchMedia('(prefers-color-scheme: dark)').matches;
}

function setTheme(theme) {
  if (theme) document.documentElement.dataset.theme = theme;
  $('theme').textContent = isDark() ? 'Light' : 'Dark';
  $('theme').setAttribute('aria-label', `Use ${isDark() ? 'light' : 'dark'} colours`);
  readColours();
  repaint();
}

/** Sets the theme, and follows the button, the system and the printer from then on. */
function followTheme() {
  setTheme();
  $('theme').addEventListener('click', () => setTheme(isDark() ? 'light' : 'dark'));
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => setTheme());
  addEventListener('beforeprint', () => printing(true));
  addEventListener('afterprint', () => printing(false));
}

/** Makes the page light and opens its glossary, if it has one, for the printer; afterwards it is as before. */
function printing(on) {
  const root = document.documentElement, glossary = $('glossary') || {};
  if (on) {
    Object.assign(printing, {theme: root.dataset.theme, open: glossary.open});
    root.dataset.theme = 'light';
  } else if (printing.theme) root.dataset.theme = printing.theme;
  else delete root.dataset.theme;
  glossary.open = on || printing.open;
  readColours();
  paintAll();
}

// ---- canvases and the loop

/** Gives a canvas as many pixels as its box has on the screen; its context, and the size of the box [CSS pixels]. */
function fitted(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth, height = canvas.clientHeight;
  const columns = Math.round(width * ratio), rows = Math.round(height * ratio);
  if (canvas.width !== columns || canvas.height !== rows) Object.assign(canvas, {width: columns, height: rows});
  const context = canvas.getContext('2d');
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return {context, width, height};
}

const painters = [];
const seen = new IntersectionObserver(entries => {
  for (const entry of entries) painters.find(painter => painter.place === entry.target).visible = entry.isIntersecting;
  repaint();
}, {rootMargin: '50px'});

/** Calls `paint` for each frame and each change while the element `place` is on the screen. */
function painted(place, paint) {
  painters.push({place, paint, visible: false});
  seen.observe(place);
  new ResizeObserver(repaint).observe(place);
}

let waiting = false;

function repaint() {
  if (!waiting) requestAnimationFrame(tick);
  waiting = true;
}

function paintAll() {
  painters.forEach(painter => painter.paint());
}

// ---- explanations, by mouse and by keyboard

/** A word whose explanation shows when it is pointed at or focused. */
function term(text, explanation) {
  const word = element('span', {class: 'term', tabindex: '0', 'aria-describedby': 'tip'}, text);
  const show = () => {
    const tip = $('tip'), box = word.getBoundingClientRect();
    tip.textContent = explanation;
    tip.hidden = false;
    tip.style.left = `${clamp(box.left, 8, Math.max(8, innerWidth - tip.offsetWidth - 8))}px`;
    const below = box.bottom + 6 + tip.offsetHeight < innerHeight;
    tip.style.top = `${below ? box.bottom + 6 : box.top - 6 - tip.offsetHeight}px`;
  };
  const hide = () => { $('tip').hidden = true; };
  for (const [type, what] of [['mouseenter', show], ['focus', show], ['mouseleave', hide], ['blur', hide]]) {
    word.addEventListener(type, what);
  }
  word.addEventListener('keydown', event => { if (event.key === 'Escape') hide(); });
  return word;
}
