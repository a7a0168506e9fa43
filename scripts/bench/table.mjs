/** A benchmark's report as text. */
import { adapterName } from '../../benchmarks/run/environment.js';

const ms = (summary) => (summary ? summary.p50.toFixed(summary.p50 < 10 ? 2 : 1) : '');

const COLUMNS = [
  ['', ({ configuration }) => configuration.name],
  ['splats', ({ configuration }) => String(configuration.splats)],
  ['visible', ({ statistics }) => String(statistics?.visible ?? '')],
  ['path', ({ configuration: { path, width, height } }) => `${path} ${width}x${height}`],
  ['burst', ({ burst }) => ms(burst)],
  ['wall', ({ wall }) => ms(wall)],
  ['p95', ({ wall }) => (wall ? wall.p95.toFixed(1) : '')],
  ['ordered', ({ sortedWall }) => ms(sortedWall)],
  ['empty', ({ empty }) => ms(empty)],
  ['GPU', ({ span }) => ms(span)],
  ['CPU', ({ cpu }) => (cpu ? cpu.p50.toFixed(2) : '')],
  ['B/splat', ({ bytes }) => String(bytes?.perSplat ?? '')],
];

/** Medians in milliseconds, one line for each configuration. */
export function benchTable({ environment, results }) {
  const { adapter, versions } = environment;
  const rows = results.map((result) =>
    result.error ? [result.configuration.name, result.error.split('\n')[0]] : COLUMNS.map(([, text]) => text(result)),
  );
  const all = [COLUMNS.map(([title]) => title), ...rows.filter((row) => row.length > 2)];
  const widths = COLUMNS.map((_, k) => Math.max(...all.map((row) => row[k].length)));
  const line = (row) =>
    row.length > 2
      ? row.map((cell, k) => (k === 0 ? cell.padEnd(widths[k]) : cell.padStart(widths[k]))).join('  ')
      : row.join(': ');
  return [
    `${adapterName(adapter)}; ${versions.commit}; PlayCanvas ${versions.playcanvas}, Spark ${versions.spark}`,
    'Milliseconds, medians. burst: a frame of 40 in a row, queue drained once; wall: one frame alone; p95: of wall;',
    'ordered: until drawn in the order of its own camera; empty: a submission of nothing; GPU: first pass begins to last one ends.',
    '',
    ...[COLUMNS.map(([title]) => title), ...rows].map(line),
  ].join('\n');
}
