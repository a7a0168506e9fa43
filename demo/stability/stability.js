/** Shows the report of `npm run stability -- --report`: data/figures.json and the charts beside it. */
const CHARTS = { S1: 'popping', S7: 'distance', S8: 'key-bits', S21: 'zoom' };

const place = (id) => document.querySelector(`#${id}`);

/** An element with text or other elements in it; nothing here is ever parsed as markup. */
function make(name, contents, attributes = {}) {
  const element = document.createElement(name);
  element.append(...[contents].flat());
  Object.assign(element, attributes);
  return element;
}

function table(head, rows) {
  const line = (kind, cells) =>
    make(
      'tr',
      cells.map((cell) => (cell instanceof Node ? cell : make(kind, String(cell)))),
    );
  return make('div', make('table', [line('th', head), ...rows.map((cells) => line('td', cells))]), {
    className: 'scroll',
    tabIndex: 0,
    role: 'group',
    ariaLabel: 'Figures',
  });
}

const number = (value) => (typeof value === 'number' ? Number(value.toPrecision(4)) : value);

function limitOf({ atLeast, atMost }) {
  return [atLeast !== undefined && `at least ${atLeast}`, atMost !== undefined && `at most ${atMost}`]
    .filter(Boolean)
    .join(', ');
}

function showPeers({ rows, adapter }) {
  const names = rows[0].results.map(({ subject }) => subject);
  const cell = ({ figure, unit, passes, error }) =>
    make('td', error ?? `${number(figure)} ${unit}`, { className: passes ? 'passes' : 'fails' });
  const lines = rows.map(({ row, title, least, results }) => [`${row}, ${title}`, least ?? 0, ...results.map(cell)]);
  place('peers').append(
    make('h2', 'The same rows, with others'),
    make('p', `${adapter || 'SwiftShader'}, after rounding to 8 bits; fails in bold.`),
  );
  place('peers').append(table(['row', 'limit', ...names], lines));
}

function showRow({ id, title, fails, recipe, passes, figures }) {
  const texts = [`Who fails: ${fails}`, `Recipe: ${recipe}`, `Passes: ${passes}`];
  place('rows').append(make('h2', `${id}. ${title}`), ...texts.map((text) => make('p', text)));
  if (figures.length === 0) return;
  const lines = figures.map((figure) => [
    figure.what,
    `${number(figure.value)} ${figure.unit}`,
    limitOf(figure),
    figure.isFull ? 'whole' : 'a part',
  ]);
  place('rows').append(table(['what', 'measured', 'limit', 'recipe'], lines));
}

try {
  const { rows, curves, peers } = await (await fetch('data/figures.json')).json();
  for (const [row, file] of Object.entries(CHARTS)) {
    if (curves.some((curve) => curve.row === row))
      place('charts').append(make('img', [], { src: `data/${file}.svg`, alt: `Chart of row ${row}` }));
  }
  if (peers) showPeers(peers);
  rows.forEach(showRow);
} catch (error) {
  place('status').textContent =
    `The report could not be read: ${error.message}. Run npm run stability -- --report, then npm run build.`;
}
