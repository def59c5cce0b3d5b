// Elements, numbers, colours and explanations.

export const $ = id => document.getElementById(id);

/** An element with attributes, listeners under `on`, and children; a string becomes text, never markup. */
export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name === 'on') Object.entries(value).forEach(([type, listener]) => made.addEventListener(type, listener));
    else made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

/** A button with a text that does something. */
export function button(text, click, attributes = {}) {
  return element('button', {type: 'button', on: {click}, ...attributes}, text);
}

/** The JSON that stands in the page under a name. */
export function embedded(name) {
  return JSON.parse($(name).textContent);
}

/** A number with three digits, for people to read; a dash where there is none. */
export function shown(value) {
  if (value === null || value === undefined || Number.isNaN(value)) return '–';
  if (value === 0) return '0';
  const size = Math.abs(value);
  if (size < 1e-4) return value > 0 ? '<0.0001' : '>−0.0001';
  const digits = clamp(2 - Math.floor(Math.log10(Number(size.toPrecision(3)))), 0, 4);
  return value.toFixed(digits).replace('-', '−');
}

export function counted(number, what) {
  return `${number.toLocaleString('en')} ${what}${number === 1 ? '' : 's'}`;
}

export function clamp(value, low, high) {
  return Math.min(high, Math.max(low, value));
}

/** The elements of a list of names, each with its text. */
export function terms(pairs) {
  return pairs.flatMap(([name, text]) => [element('dt', {}, name), element('dd', {}, text)]);
}

/** Rows of facts about the page below its title. */
export function showFacts(facts) {
  $('facts').append(...facts.map(pair => element('div', {}, ...terms([pair]))));
}

// ---- colours, which the style sheet defines for both themes

export const themed = [];

/** The colour that the style sheet calls by a name. */
export function colourOf(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

/** Calls `paint` now and whenever the colours change. */
export function onTheme(paint) {
  themed.push(paint);
  paint();
}

function isDark() {
  const chosen = document.documentElement.dataset.theme;
  return chosen ? chosen === 'dark' : matchMedia('(prefers-color-scheme: dark)').matches;
}

function setTheme(theme) {
  if (theme) document.documentElement.dataset.theme = theme;
  $('theme').textContent = isDark() ? 'Light' : 'Dark';
  $('theme').setAttribute('aria-label', `Use ${isDark() ? 'light' : 'dark'} colours`);
  themed.forEach(paint => paint());
}

/** Sets the theme, and follows the button, the system and the printer from then on. */
export function followTheme() {
  const root = document.documentElement, before = {};
  setTheme();
  $('theme').addEventListener('click', () => setTheme(isDark() ? 'light' : 'dark'));
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => setTheme());
  addEventListener('beforeprint', () => {
    Object.assign(before, {theme: root.dataset.theme, open: $('glossary')?.open});
    setTheme('light');
    if ($('glossary')) $('glossary').open = true;
  });
  addEventListener('afterprint', () => {
    delete root.dataset.theme;
    setTheme(before.theme);
    if ($('glossary')) $('glossary').open = before.open;
  });
}

// ---- explanations, by mouse and by keyboard

/** A word whose explanation shows when it is pointed at or focused. */
export function term(text, explanation) {
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
