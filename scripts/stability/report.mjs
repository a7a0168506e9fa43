/** docs/stability.md, its charts and figures.json, which the demo reads: published results, and later measurements. */
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { root } from '../lib/run.mjs';
import { mergePages, mergeRuns, titleOf } from './figures.mjs';
import { readHeaders } from './headers.mjs';
import { lineChart } from './line-chart.mjs';
import { catalogTable, describeRuns, pagesTable } from './tables.mjs';

const CHARTS = [
  {
    file: 'popping',
    row: 'S1',
    title: 'An order that is some degrees old: error it causes',
    x: 'degrees turned since the order was made',
    marks: [
      { x: 2.6, name: 'Spark' },
      { x: 8.1, name: 'antimatter15, GaussianSplats3D' },
    ],
    line: { y: 59, name: '59 dB' },
    log: true,
  },
  {
    file: 'distance',
    row: 'S7',
    title: 'Distance from the origin of the world',
    x: 'units',
    log: true,
    line: { y: 59, name: '59 dB' },
  },
  {
    file: 'key-bits',
    row: 'S8',
    title: 'Bits of the depth key, ten splats far behind',
    x: 'bits',
    line: { y: 59, name: '59 dB' },
  },
  {
    file: 'zoom',
    row: 'S21',
    title: 'Zooming out: to the same image drawn 8 times as large',
    x: 'times smaller',
    log: true,
  },
];

/** Adds runs and reports of pages (see figures.mjs) to the published ones, and writes everything again. */
export function writeReport({ runs, pages }) {
  const folder = join(root, 'docs/stability');
  const file = join(folder, 'figures.json');
  const published = JSON.parse(readFileSync(file, 'utf8'));
  const data = {
    runs: mergeRuns([...published.runs, ...runs]),
    pages: mergePages([...published.pages, ...pages]),
  };
  writeFileSync(file, `${JSON.stringify(data, null, 1)}\n`);
  for (const chart of CHARTS) drawCurves(chart, data.runs, folder);
  const page = join(root, 'docs/stability.md');
  const text = readFileSync(page, 'utf8');
  const begin = text.indexOf(MARK);
  if (begin < 0) throw new Error(`docs/stability.md has no line ${MARK}, behind which the report goes`);
  writeFileSync(page, `${text.slice(0, begin)}${MARK}\n\n${markdown({ rows: readHeaders(), ...data })}`);
}

const MARK = '<!-- figures -->';

/** Draws the curves of the first adapter that ran the whole recipe, or else of the first that has any. */
function drawCurves({ file, row: id, ...options }, runs, folder) {
  const able = runs.filter(({ rows }) => rows[id]?.curves.length > 0);
  const run = able.find(({ rows }) => rows[id].figures.every(({ isFull }) => isFull)) ?? able[0];
  if (run === undefined) return;
  const title = `${options.title} (${titleOf(run.adapter)})`;
  writeFileSync(join(folder, `${file}.svg`), lineChart(run.rows[id].curves, { y: 'dB', ...options, title }));
}

function markdown({ rows, runs, pages }) {
  const measured = `Limits kept of limits tested; an asterisk marks the short recipe. ${describeRuns(runs, rows)}\n`;
  const parts = ['## Rows\n', measured, catalogTable(rows, runs)];
  if (pages.length > 0) parts.push('## Peers\n', PEERS, pagesTable(pages));
  return parts.join('\n');
}

const PEERS =
  'PSNR in dB to the reference (S2: bytes that differ), one page of Chromium, 8 bits. Bold is below the limit of 55 dB (S3: 50). The first row is an ordinary scene, because a peer’s default image follows its own rules on any scene.\n';
