/** Figures of the stability catalog from several machines: the contents of a file, the choice between two runs, and their comparison. */
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { scriptModule } from './load.js';

interface Figure {
  readonly what: string;
  readonly value: number;
  readonly isFull: boolean;
}
interface Run {
  readonly adapter: { readonly device: string; readonly description: string };
  readonly rows: Record<string, { date: string; passed?: boolean; figures: Figure[]; curves: object[] }>;
}

const { parseFigures, mergeRuns, mergePages, titleOf } = await scriptModule('stability/figures.mjs');
const { catalogTable, describeRuns, subjectsOf } = await scriptModule('stability/tables.mjs');

const swiftShader = { vendor: 'google', architecture: 'swiftshader', device: 'x', description: 'driver 5' };
const card = { vendor: 'nvidia', architecture: '', device: 'nvidia-h200', description: 'NVIDIA: 580' };
const lines = (...entries: object[]) => entries.map((entry) => `${JSON.stringify(entry)}\n`).join('');
const figure = (row: string, what: string, value: number, isFull = true) => ({
  ...{ row, what, value, isFull },
  atLeast: 59,
  unit: 'dB',
});
const parse = (...entries: object[]): Run[] => parseFigures(lines(...entries), 'file');

test('a figures file says who measured, and when; without that it is refused', () => {
  const [first, second, ...more] = parse(
    { date: '2026-01-01T00:00:00Z', adapter: card },
    figure('S1', 'a', 60),
    { row: 'S1', chart: 'curve', points: [[1, 2]] },
    { row: 'S1', passed: false },
    { date: '2026-01-02T00:00:00Z', adapter: swiftShader },
    figure('S2', 'b', 61),
  );
  assert.equal(more.length, 0);
  assert.deepEqual(first.rows.S1, {
    date: '2026-01-01T00:00:00Z',
    figures: [{ what: 'a', value: 60, isFull: true, atLeast: 59, unit: 'dB' }],
    curves: [{ name: 'curve', points: [[1, 2]] }],
    passed: false,
  });
  assert.equal(second.rows.S2.date, '2026-01-02T00:00:00Z');
  assert.throws(() => parse(figure('S1', 'a', 60)), /expected a line of the adapter first/);
});

test('the latest run of an adapter counts for each row, in any order of files', () => {
  const old = parse(
    { date: '2026-01-01T00:00:00Z', adapter: { ...card, description: 'NVIDIA: 570' } },
    ...[figure('S1', 'a', 60), figure('S1', 'gone', 60), figure('S2', 'b', 61)],
  );
  const late = parse({ date: '2026-01-03T00:00:00Z', adapter: card }, figure('S1', 'a', 62));
  const other = parse({ date: '2026-01-02T00:00:00Z', adapter: swiftShader }, figure('S1', 'a', 70));
  for (const runs of [
    [...old, ...late, ...other],
    [...other, ...late, ...old],
  ]) {
    const merged: Run[] = mergeRuns(runs);
    assert.deepEqual(
      merged.map(({ adapter }) => titleOf(adapter)),
      ['SwiftShader', 'NVIDIA H200'],
    );
    const { adapter, rows } = merged[1];
    assert.equal(adapter.description, 'NVIDIA: 580', 'a new driver is no other adapter');
    assert.deepEqual(
      rows.S1.figures.map(({ what, value }) => [what, value]),
      [['a', 62]],
    );
    assert.equal(rows.S2.figures[0].value, 61, 'rows that were not run again stay');
  }
});

test('the table of rows has a column for each adapter, and shows short recipes and failures', () => {
  const runs: Run[] = mergeRuns([
    ...parse({ date: '2026-01-01T00:00:00Z', adapter: swiftShader }, figure('S1', '20 frames', 60, false)),
    ...parse(
      { date: '2026-01-01T00:00:00Z', adapter: card },
      ...[figure('S1', '200 frames', 61), { row: 'S1', passed: false }],
    ),
  ]);
  const text = catalogTable([{ id: 'S1', title: 'Popping', file: 'tests/a.ts' }], runs);
  assert.match(text, /\| test \| failure \| SwiftShader \| NVIDIA H200 \|/);
  assert.match(text, /\| \[S1\]\(\.\.\/tests\/a\.ts\) \| Popping \| 1\/1\* \| \*\*failed\*\*, 1\/1 \|/);
  assert.match(describeRuns(runs, [{ id: 'S1' }]), /NVIDIA H200 \(NVIDIA: 580, 2026-01-01\): failed: S1\./);
});

test('reports of the page: one of our columns for each adapter, and a run without peers keeps theirs', () => {
  const page = (adapter: string, ...subjects: string[]) => ({
    adapter,
    rows: [
      {
        row: 'S1',
        title: 't',
        least: 55,
        results: subjects.map((subject) => ({ subject, figure: 60, unit: 'dB', passes: true })),
      },
    ],
  });
  const first = page('google swiftshader', 'ours', 'Spark');
  const merged = mergePages([first, page('nvidia', 'ours'), page('google swiftshader', 'ours')]);
  assert.equal(merged[0], first);
  assert.deepEqual(
    subjectsOf(merged).map(({ name }: { name: string }) => name),
    ['ours', 'ours, nvidia', 'Spark'],
  );
});

test('the published figures are runs of named adapters, each row with the day of its run', () => {
  const file = new URL('../../docs/stability/figures.json', import.meta.url);
  const { runs } = JSON.parse(readFileSync(file, 'utf8')) as { runs: Run[] };
  assert.deepEqual(mergeRuns(runs), runs);
  for (const { rows } of runs) for (const { date } of Object.values(rows)) assert.ok(!Number.isNaN(Date.parse(date)));
});
