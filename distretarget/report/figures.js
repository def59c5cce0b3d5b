// The figures of quality, whose registry the page has as data.

const FIGURES = JSON.parse($('registry').textContent);

function figuresAt(place) {
  return FIGURES.filter(({places}) => places.includes(place));
}

function figureOf(key) {
  return FIGURES.find(figure => figure.key === key);
}

/** The elements of a list of names, each with its text. */
function terms(pairs) {
  return pairs.flatMap(([name, text]) => [element('dt', {}, name), element('dd', {}, text)]);
}

/** What a figure is called, with the unit that the page shows it in. */
function nameOf({label, symbol}) {
  return symbol ? `${label}, ${symbol}` : label;
}
