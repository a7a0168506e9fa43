/** docs/stability.md and its charts, and the same for the demo, from what the last run measured. */
import { mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { root } from '../lib/run.mjs';
import { readHeaders } from './headers.mjs';
import { lineChart } from './line-chart.mjs';

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
    title: 'Zooming out: to the same picture drawn 8 times as large',
    x: 'times smaller',
    log: true,
  },
];

/**
 * @param run.lines figures and curves, as tests/stability/support/row.ts writes them
 * @param run.peers report of run-peers.mjs, if there is one
 */
export function writeReport({ lines, peers }) {
  const folder = join(root, 'docs/stability');
  mkdirSync(folder, { recursive: true });
  const figures = lines.filter((line) => line.what !== undefined);
  const curves = lines.filter((line) => line.chart !== undefined);
  const data = {
    rows: readHeaders().map((header) => ({ ...header, figures: figures.filter(({ row }) => row === header.id) })),
    curves,
    peers,
  };
  writeFileSync(join(folder, 'figures.json'), `${JSON.stringify(data, null, 1)}\n`);
  const drawn = CHARTS.filter(({ row }) => curves.some((curve) => curve.row === row));
  for (const { file, row, ...options } of drawn) {
    const own = curves.filter((curve) => curve.row === row).map(({ chart, points }) => ({ name: chart, points }));
    writeFileSync(join(folder, `${file}.svg`), lineChart(own, { y: 'dB', ...options }));
  }
  const page = join(root, 'docs/stability.md');
  const text = readFileSync(page, 'utf8');
  const begin = text.indexOf('<!-- figures -->');
  if (begin < 0) throw new Error('docs/stability.md has no line <!-- figures -->, behind which the report goes');
  writeFileSync(page, `${text.slice(0, begin)}<!-- figures -->\n\n${markdown(data, drawn)}`);
}

function markdown({ rows, peers }, drawn) {
  const parts = drawn.map(({ file, title }) => `![${title}](stability/${file}.svg)\n`);
  if (peers) parts.push(peersTable(peers));
  parts.push('## The rows\n');
  for (const row of rows) {
    parts.push(`### ${row.id}. ${row.title}\n`);
    parts.push(`Who fails: ${row.fails}\n`);
    parts.push(`Recipe: ${row.recipe}\n`);
    parts.push(`Passes: ${row.passes}\n`);
    if (row.figures.length > 0) parts.push(`${figuresTable(row.figures)}\n`);
    parts.push(`Test: [${row.file}](../${row.file})\n`);
  }
  return `${parts.join('\n')}`;
}

function figuresTable(figures) {
  const limit = ({ atLeast, atMost }) =>
    [atLeast !== undefined && `at least ${atLeast}`, atMost !== undefined && `at most ${atMost}`]
      .filter(Boolean)
      .join(', ');
  const cells = figures.map(
    (figure) =>
      `| ${cell(figure.what)} | ${shown(figure.value)} ${figure.unit} | ${limit(figure)} | ${figure.isFull ? 'whole' : 'a part'} |`,
  );
  return ['| what | measured | limit | recipe |', '|---|---|---|---|', ...cells].join('\n');
}

function peersTable({ rows, adapter }) {
  const names = rows[0].results.map(({ subject }) => subject);
  const lines = [
    '## The same rows, with peers\n',
    `Same splats, same views, same criterion, in one page of Chromium (${adapter || 'SwiftShader'}), after rounding to 8 bits. Fails are in bold. The first row is no failure but a measure: a peer's default picture is that far from the reference on any scene, by its own\nrules of falloff and dilation; what a row adds is the difference to it. Our limits hold for the reference picture, which peers do not aim at.\n`,
    `| row | at least | ${names.join(' | ')} |`,
    `|---|---|${names.map(() => '---').join('|')}|`,
    ...rows.map(({ row, title, least, results }) => {
      const entry = ({ figure, unit, passes, error }) => {
        const text = error ? cell(error) : `${figure.toFixed(unit === 'dB' ? 1 : 0)} ${unit}`;
        return passes ? text : `**${text}**`;
      };
      return `| ${row}, ${cell(title)} | ${least === undefined ? '0 bytes' : `${least} dB`} | ${results.map(entry).join(' | ')} |`;
    }),
  ];
  return `${lines.join('\n')}\n`;
}

const cell = (text) => text.replace(/\|/g, '\\|').replace(/\s+/g, ' ');

function shown(value) {
  if (value === 'Infinity') return 'equal, infinitely many';
  if (typeof value !== 'number' || Number.isInteger(value)) return String(value);
  return Math.abs(value) < 0.01 ? value.toExponential(1) : String(Number(value.toPrecision(4)));
}
