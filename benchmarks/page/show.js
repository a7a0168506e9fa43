/** Results for people: a table with small bars, and everything else as JSON. */
import { adapterName } from '../run/environment.js';

/** An element with these properties and children. */
export const element = (name, properties = {}, children = []) => {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
};

const byId = (id) => document.getElementById(id);

export function showProgress(text) {
  byId('status').textContent = `${text}…`;
  window.onBenchProgress?.(text);
}

export function showError(error) {
  byId('status').textContent = `It did not work: ${error.message ?? error}`;
}

const number = (value, digits = 2) => (value === undefined ? '' : value.toFixed(digits));
const both = (summary) => (summary ? `${number(summary.p50)} / ${number(summary.p95)}` : '');

/** Column titles and what stands in them for a result. Milliseconds unless the title says otherwise. */
const COLUMNS = [
  ['what', ({ configuration }) => configuration.name],
  ['splats', ({ configuration }) => configuration.splats.toLocaleString('en')],
  ['visible', ({ statistics }) => statistics?.visible.toLocaleString('en') ?? ''],
  ['size, path', ({ configuration: c }) => `${c.width}×${c.height}, ${c.path}`],
  ['in a row p50 / p95', ({ burst }) => both(burst)],
  ['wall p50 / p95', ({ wall }) => both(wall)],
  ['empty', ({ empty }) => number(empty?.p50)],
  ['with its order', ({ sortedWall }) => both(sortedWall)],
  ['GPU span p50 / p95', ({ span }) => both(span)],
  ['CPU p50 / p95', ({ cpu }) => both(cpu)],
  ['bytes a splat', ({ bytes }) => bytes?.perSplat ?? ''],
];

/** Quantity that the bars compare. */
const costOf = ({ burst, wall }) => burst?.p50 ?? wall?.p50;

export function showResults(results, report) {
  const max = Math.max(...results.map((result) => costOf(result) ?? 0));
  const head = element(
    'tr',
    {},
    [...COLUMNS, ['stages', 0]].map(([title]) => element('th', { textContent: title })),
  );
  const rows = results.map((result) => rowOf(result, max));
  byId('results').replaceChildren(element('table', {}, [element('thead', {}, [head]), element('tbody', {}, rows)]));
  if (!report) return;
  byId('status').textContent = `Done on ${adapterName(report.environment.adapter)}. Times in milliseconds.`;
  byId('json').textContent = JSON.stringify(report, (name, value) => (name === 'images' ? undefined : value), 2);
  byId('raw').hidden = false;
}

function rowOf(result, max) {
  if (result.error) {
    const message = element('td', { colSpan: COLUMNS.length, textContent: result.error.split('\n')[0] });
    return element('tr', { className: 'failed' }, [element('td', { textContent: result.configuration.name }), message]);
  }
  const cells = COLUMNS.map(([, text]) => element('td', { textContent: text(result) }));
  return element('tr', {}, [...cells, element('td', {}, [barOf(result, max)])]);
}

const HUES = [32, 200, 140, 280, 0, 60, 320];

/** A bar as long as the cost, divided by stages where they are known. */
function barOf(result, max) {
  const stages = Object.entries(result.stages ?? {}).map(([label, { p50 }]) => [label, p50]);
  const parts = stages.length > 0 ? stages : [['all', costOf(result) ?? 0]];
  const total = parts.reduce((sum, [, ms]) => sum + ms, 0) || 1;
  const length = (100 * (costOf(result) ?? 0)) / (max || 1);
  const bar = element('div', { className: 'bar' });
  bar.append(
    ...parts.map(([label, ms], i) => {
      const part = element('span', { title: `${label}: ${ms.toFixed(3)} ms` });
      part.style.width = `${(length * ms) / total}%`;
      part.style.background = `hsl(${HUES[i % HUES.length]} 60% 55%)`;
      return part;
    }),
  );
  return bar;
}
