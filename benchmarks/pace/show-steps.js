/** The steps of a load as a table. */

import { element } from '../page/show.js';

const COLUMNS = [
  ['step', ({ step }) => step],
  ['elements, pixels', ({ elements, width, height }) => `${elements} × ${width}×${height}`],
  ['target, ms', ({ target }) => target],
  ['load: whole frame / target', ({ load }) => load],
  ['span p50 · p95 / target', ({ span }) => `${span.p50} · ${span.p95}`],
  ['interval p50 · p95, ms', ({ interval }) => `${interval.p50} · ${interval.p95}`],
  ['reversals', ({ reversals }) => reversals],
  ['levels', ({ levels }) => levels.map(({ at, level }) => `${level} (${at} ms)`).join(', ')],
  ['reference image after, ms', ({ restMs }) => restMs],
  ['to toBlob(), dB', ({ picture: image }) => image ?? ''],
];

/** @param report the whole of it, once all is measured */
export function showSteps(steps, report) {
  const head = COLUMNS.map(([title]) => element('th', { textContent: title }));
  const rows = steps.map((step) => COLUMNS.map(([, text]) => element('td', { textContent: text(step) })));
  const table = element('table', {}, [
    element('thead', {}, [element('tr', {}, head)]),
    element(
      'tbody',
      {},
      rows.map((cells) => element('tr', {}, cells)),
    ),
  ]);
  document.getElementById('results').replaceChildren(table);
  if (!report) return;
  document.getElementById('status').textContent = 'Done.';
  document.getElementById('json').textContent = JSON.stringify(report, null, 1);
  document.getElementById('raw').hidden = false;
}
