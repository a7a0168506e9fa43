/** The report of `npm run stability -- --report` as the page shows it: charts, rows with others beside ours, and every row of the catalogue. */
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { root } from '../../../scripts/lib/run.mjs';

const CHARTS = { S1: 'popping', S7: 'distance', S8: 'key-bits', S21: 'zoom' };

export default function stability() {
  const { rows, curves, peers } = JSON.parse(readFileSync(join(root, 'docs/stability/figures.json'), 'utf8'));
  const charts = Object.entries(CHARTS).filter(([row]) => curves.some((curve) => curve.row === row));
  return {
    charts: charts.map(([row, file]) => ({ row, file, title: rows.find(({ id }) => id === row).title })),
    peers: peers && describePeers(peers),
    rows: rows.map(describeRow),
  };
}

const number = (value) => String(typeof value === 'number' ? Number(value.toPrecision(4)) : value);

function describePeers({ adapter, rows }) {
  return {
    adapter: adapter === 'google swiftshader' || !adapter ? 'SwiftShader' : adapter,
    subjects: rows[0].results.map(({ subject }) => subject),
    rows: rows.map(({ row, title, least, results }) => ({
      id: row === '-' ? '' : row,
      title,
      limit: least ? `${least} dB` : '0 bytes',
      results: results.map(({ figure, unit, passes, error }) => ({
        text: error ?? `${number(figure)} ${unit}`,
        passes,
      })),
    })),
  };
}

function describeRow({ id, title, fails, recipe, passes, figures }) {
  return {
    ...{ id, title, fails, recipe, passes },
    anchor: id.toLowerCase(),
    isWhole: figures.length > 0 && figures.every(({ isFull }) => isFull),
    figures: figures.map((figure) => ({
      what: figure.what,
      measured: `${number(figure.value)} ${figure.unit}`,
      limit: limitOf(figure),
      isKept: isKept(figure),
      recipe: figure.isFull ? 'whole' : 'a part',
    })),
    summary: summaryOf(figures),
  };
}

function limitOf({ atLeast, atMost }) {
  const parts = [atLeast !== undefined && `at least ${atLeast}`, atMost !== undefined && `at most ${atMost}`];
  return parts.filter(Boolean).join(', ');
}

const hasLimit = ({ atLeast, atMost }) => atLeast !== undefined || atMost !== undefined;
const isKept = ({ value, atLeast = -Infinity, atMost = Infinity }) => value >= atLeast && value <= atMost;

/** What a reader wants to know of a row before opening it. Rows without figures pass or fail as tests. */
function summaryOf(figures) {
  const limited = figures.filter(hasLimit);
  if (limited.length === 0) return figures.length === 0 ? 'a test without figures' : `${figures.length} figures`;
  const kept = limited.filter(isKept).length;
  if (kept === limited.length) return kept === 1 ? 'its limit kept' : `all ${kept} limits kept`;
  return `${kept} of ${limited.length} limits kept`;
}
