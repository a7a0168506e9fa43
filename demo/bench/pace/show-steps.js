/** The steps of a load as a table. */

const made = (name, properties = {}, children = []) => {
  const element = Object.assign(document.createElement(name), properties);
  element.append(...children);
  return element;
};

const COLUMNS = [
  ['step', ({ step }) => step],
  ['elements, pixels', ({ elements, width, height }) => `${elements} × ${width}×${height}`],
  ['target, ms', ({ target }) => target],
  ['load: whole picture / target', ({ load }) => load],
  ['span p50 · p95 / target', ({ span }) => `${span.p50} · ${span.p95}`],
  ['interval p50 · p95, ms', ({ interval }) => `${interval.p50} · ${interval.p95}`],
  ['reversals', ({ reversals }) => reversals],
  ['levels', ({ levels }) => levels.map(({ at, level }) => `${level} (${at} ms)`).join(', ')],
  ['true image after, ms', ({ restMs }) => restMs],
  ['to toBlob(), dB', ({ picture }) => picture ?? ''],
];

/** @param report the whole of it, once all is measured */
export function showSteps(steps, report) {
  const head = COLUMNS.map(([title]) => made('th', { textContent: title }));
  const rows = steps.map((step) => COLUMNS.map(([, text]) => made('td', { textContent: text(step) })));
  const table = made('table', {}, [
    made('thead', {}, [made('tr', {}, head)]),
    made(
      'tbody',
      {},
      rows.map((cells) => made('tr', {}, cells)),
    ),
  ]);
  document.getElementById('results').replaceChildren(table);
  if (!report) return;
  document.getElementById('status').textContent = 'Done.';
  document.getElementById('json').textContent = JSON.stringify(report, null, 1);
  document.getElementById('raw').hidden = false;
}
