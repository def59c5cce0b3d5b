// Elements, numbers and colours.

export const $ = id => document.getElementById(id);

/** An element, given or made by its tag, with attributes, listeners under `on`, and children; a string becomes text,
 * never markup.
 */
export function element(tag, {on = {}, ...attributes} = {}, ...children) {
  const made = typeof tag === 'string' ? document.createElement(tag) : tag;
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  for (const [type, listener] of Object.entries(on)) made.addEventListener(type, listener);
  made.append(...children);
  return made;
}

/** A button with a text, and what a click calls. */
export function button(text, click, attributes = {}) {
  return element('button', {type: 'button', on: {click}, ...attributes}, text);
}

/** The JSON data of a name in the page. */
export const embedded = name => JSON.parse($(name).textContent);

/** A number with three significant digits; a dash if there is none. */
export function shown(value) {
  if (value === null || value === undefined || Number.isNaN(value)) return '–';
  if (value === 0) return '0';
  const size = Math.abs(value);
  if (size < 1e-4) return value > 0 ? '<0.0001' : '>−0.0001';
  const digits = clamp(2 - Math.floor(Math.log10(Number(size.toPrecision(3)))), 0, 4);
  return value.toFixed(digits).replace('-', '−');
}

export const counted = (number, what) => `${number.toLocaleString('en')} ${what}${number === 1 ? '' : 's'}`;

export const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

/** The sum of `numberOf` over a list. */
export const total = (list, numberOf) => list.reduce((sum, one) => sum + numberOf(one), 0);

/** The elements of a description list, from pairs of a name and a text. */
export const terms = pairs => pairs.flatMap(([name, text]) => [element('dt', {}, name), element('dd', {}, text)]);

/** Shows facts below the title of the page, from pairs of a name and a text. */
export function showFacts(facts) {
  $('facts').append(...facts.map(pair => element('div', {}, ...terms([pair]))));
}

// ---- colours, each of which the style sheet defines for light and dark pages

export const themed = [];
const colours = new Map(), probe = document.body.appendChild(element('i', {hidden: ''}));

/** The colour of a name in the style sheet. */
export function colourOf(name) {
  if (!colours.has(name)) {
    probe.style.color = `var(--${name})`;
    colours.set(name, getComputedStyle(probe).color);
  }
  return colours.get(name);
}

/** Calls `paint` now and whenever the colours change. */
export function onTheme(paint) {
  themed.push(paint);
  paint();
}

/** Takes light or dark colours, and follows the button, the system and the printer from then on. */
export function followTheme() {
  const {style} = document.documentElement, dark = matchMedia('(prefers-color-scheme: dark)');
  const use = theme => {
    style.colorScheme = theme;
    const other = theme === 'dark' ? 'light' : 'dark';
    $('theme').textContent = theme === 'dark' ? 'Light' : 'Dark';
    $('theme').setAttribute('aria-label', `Use ${other} colours`);
    colours.clear();
    themed.forEach(paint => paint());
  };
  const useSystem = () => use(dark.matches ? 'dark' : 'light');
  const print = (theme, open) => {
    before = style.colorScheme;
    use(theme);
    if ($('glossary')) $('glossary').open = open;
  };
  let before = '';
  useSystem();
  $('theme').addEventListener('click', () => use(style.colorScheme === 'dark' ? 'light' : 'dark'));
  dark.addEventListener('change', useSystem);
  addEventListener('beforeprint', () => print('light', true));
  addEventListener('afterprint', () => print(before, false));
}
