/** `gaussian-splat detail` of scenes larger than its memory: cells, parts, lists of files; the bytes are those of one run. */
import assert from 'node:assert/strict';
import { spawn, spawnSync } from 'node:child_process';
import { existsSync, mkdtempSync, readdirSync, readFileSync, rmSync, statSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, test } from 'node:test';
import { setTimeout } from 'node:timers/promises';
import type { GaussianCloud } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';
import { changeFormat } from '@gaussian-splat/optimize';
import { checkManifest } from '@gaussian-splat/renderer';
import { blocksOf } from '../../packages/cli/src/lib/detail/inputs.mjs';
import { openSpool } from '../../packages/cli/src/lib/detail/spool.mjs';
import { writePly } from '../formats/support/ply-writer.js';
import { inriaColumns, rawSplats, type RawSplats } from '../formats/support/splats.js';
import { onlyInLab, someOf } from '../support/extent.js';

const folder = mkdtempSync(join(tmpdir(), 'gs-parts-'));
after(() => rmSync(folder, { recursive: true }));
const inFolder = (...path: string[]): string => join(folder, ...path);

const BIN = 'packages/cli/bin/gaussian-splat.mjs';
function detail(...args: string[]): { status: number | null; text: string } {
  const { status, stdout, stderr } = spawnSync(process.execPath, [BIN, 'detail', ...args], { encoding: 'utf8' });
  return { status, text: stdout + stderr };
}

function write(name: string, raw: RawSplats): string {
  writeFileSync(inFolder(name), writePly([{ name: 'vertex', columns: inriaColumns(raw) }]));
  return inFolder(name);
}

/** Splats of several shells, so that chunks are padded between them. */
function farSplats(count: number, degree: number): RawSplats {
  const raw = rawSplats(count, degree);
  const positions = raw.positions.map((place, k) =>
    k % 150 === 0 ? place.map((x) => Math.fround(x * 10 ** (2 + ((k / 150) % 4)))) : place,
  );
  return { ...raw, positions };
}

/** Files of a folder with their bytes. */
function filesOf(path: string): Map<string, Buffer> {
  const names = readdirSync(path, { recursive: true, encoding: 'utf8' }).filter((name) =>
    statSync(join(path, name)).isFile(),
  );
  return new Map(names.sort().map((name) => [name, readFileSync(join(path, name))]));
}

function assertSame(found: string, expected: string): void {
  const [own, others] = [filesOf(found), filesOf(expected)];
  assert.deepEqual([...own.keys()], [...others.keys()]);
  for (const [name, bytes] of own) assert.ok(bytes.equals(others.get(name)!), `${found}/${name}`);
}

/** Memory for cells of 4,096 splats. */
const SMALL = ['--memory', '302MB'];

test('cells, and parts in any order, have the bytes of a scene in one piece', () => {
  const scene = write('far.ply', farSplats(20_100, 1));
  for (const format of someOf(['--quantized', '--exact'], 1)) {
    const [whole, cells] = [inFolder(`whole${format}`), inFolder(`cells${format}`)];
    assert.equal(detail(scene, '--out', whole, format).status, 0);
    const { status, text } = detail(scene, '--out', cells, format, ...SMALL);
    assert.equal(status, 0, text);
    assert.match(text, /in [56] cells of 4096/);
    assertSame(cells, whole);
  }
  const parts = inFolder('parts');
  for (const part of ['2/2', '1/2'])
    assert.equal(detail(scene, '--out', parts, '--quantized', ...SMALL, '--part', part).status, 0);
  // A scheduler may run a finished job again.
  for (let run = 0; run < 2; run++)
    assert.equal(detail(scene, '--out', parts, '--quantized', ...SMALL, '--join').status, 0);
  assertSame(parts, inFolder('whole--quantized'));
  const manifest = checkManifest(JSON.parse(readFileSync(join(parts, 'detail.json'), 'utf8')), 'detail.json');
  assert.equal(manifest.splats, 20_100);
});

test(
  'a killed part is done again; --join names what is missing; coded files are the same',
  { timeout: 300_000, skip: onlyInLab },
  async () => {
    const scene = write('more.ply', farSplats(20_100, 0));
    const [once, out] = [inFolder('once'), inFolder('killed')];
    const args = [scene, '--out', out, ...SMALL];
    assert.equal(detail(scene, '--out', once, ...SMALL).status, 0);
    const child = spawn(process.execPath, [BIN, 'detail', ...args, '--part', '1/1'], { stdio: 'ignore' });
    const isAt = (cell: number): boolean => existsSync(join(out, 'unfinished', `cell-00000${cell}.top`));
    while (!isAt(0)) await setTimeout(2);
    child.kill('SIGKILL');
    await new Promise((ended) => child.once('exit', ended));
    assert.equal(isAt(5), false, 'killed before its end');
    const early = detail(...args, '--join');
    assert.equal(early.status, 1);
    assert.match(early.text, /of 6 cells are missing/);
    assert.match(detail(...args, '--degree', '0', '--quantized', '--join').text, /is of other files or options/);
    const time = statSync(join(out, 'unfinished', 'cell-000000.top')).mtimeMs;
    assert.equal(detail(...args, '--part', '1/2').status, 0);
    assert.equal(
      statSync(join(out, 'unfinished', 'cell-000000.top')).mtimeMs,
      time,
      'a finished cell is not built again',
    );
    assert.equal(detail(...args, '--part', '2/2').status, 0);
    const joined = detail(...args, '--join');
    assert.equal(joined.status, 0, joined.text);
    assertSame(out, once);
    assert.deepEqual(readdirSync(out).sort(), ['detail.json', 'pages']);
  },
);

test('parts that begin at once in containers, whose processes have the same number, have one plan; --join begins none', async () => {
  const path = write('containers.ply', rawSplats(20_000, 0));
  const unfinished = inFolder('containers', 'unfinished');
  const options = { degree: 0, geometry: 'quantized', maxBytes: 1e9, facts: [] };
  // The second machine has more memory, for larger cells.
  const spools = await Promise.all(
    [2, 4].map((merges) => openSpool(unfinished, [{ path }], { ...options, divide: () => ({ merges }) })),
  );
  assert.deepEqual(spools[0], spools[1]);
  assert.equal(spools[0].count, 20_000);
  assert.deepEqual(readdirSync(unfinished).sort(), ['plan.json', 'rows']);
  const other = { ...options, facts: [1], divide: () => ({ merges: 2 }) };
  await assert.rejects(openSpool(unfinished, [{ path }], other), /of other files or options, or of another version/);
  const { status, text } = detail(path, '--out', inFolder('mistyped'), '--join');
  assert.equal(status, 1);
  assert.match(text, /expected cells of parts, found none/);
  assert.equal(existsSync(inFolder('mistyped')), false);
});

test('steps of several cells are measured once, and all parts have them', { skip: onlyInLab }, () => {
  // Small splats, because SwiftShader measures.
  const raw = rawSplats(9_000, 0);
  const logScales = raw.logScales.map((sizes) => sizes.map((size) => Math.fround(size / 2 - 3)));
  const scene = write('measured.ply', { ...raw, logScales });
  const views = inFolder('views.json');
  const view = { width: 64, height: 48, K: [60, 0, 32, 0, 60, 24, 0, 0, 1] };
  const worldToCamera = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 20, 0, 0, 0, 1];
  writeFileSync(views, JSON.stringify({ views: Array.from({ length: 8 }, () => ({ ...view, worldToCamera })) }));
  assert.match(
    detail(scene, '--out', inFolder('asked'), ...SMALL, '--views', views).text,
    /--views: expected a scene that fits into --memory/,
  );
  const args = [...SMALL, '--min-psnr', '38'];
  const [once, parts, usual] = [inFolder('measured-once'), inFolder('measured-parts'), inFolder('measured-usual')];
  const { status, text } = detail(scene, '--out', once, ...args);
  assert.equal(status, 0, text);
  assert.match(text, /in 3 cells of 4096/);
  const [, decibels] = /([\d.]+) dB to the middle of the scene/.exec(text)!;
  assert.ok(Number(decibels) >= 38 && Number(decibels) < 40, text);
  const measured = [];
  for (const part of ['2/2', '1/2']) {
    const { text: own } = detail(scene, '--out', parts, ...args, '--part', part);
    measured.push(/dB in held-out views/.test(own));
  }
  assert.deepEqual(measured, [true, false], 'parts that measure');
  assert.equal(detail(scene, '--out', parts, ...args, '--join').status, 0);
  assertSame(parts, once);
  assert.equal(detail(scene, '--out', usual, ...SMALL).status, 0);
  const bytesOf = (path: string): number => [...filesOf(path).values()].reduce((sum, { length }) => sum + length, 0);
  console.log(`${bytesOf(usual)} bytes with the usual steps, ${bytesOf(once)} with those of 38 dB`);
  assert.ok(bytesOf(once) < 0.9 * bytesOf(usual), `${bytesOf(once)} of ${bytesOf(usual)} bytes`);
});

/** Columns of clouds, one after the other, as bytes. */
const COLUMNS = ['positions', 'rotations', 'opacities', 'sh'] as const;
const bytesIn = (clouds: readonly GaussianCloud[], column: (typeof COLUMNS)[number]): Buffer =>
  Buffer.concat(
    clouds.map(({ [column]: { buffer, byteOffset, byteLength } }) => Buffer.from(buffer, byteOffset, byteLength)),
  );

test(
  'SPZ is read in blocks that are equal to the whole; other formats are read whole, within the memory',
  { skip: onlyInLab },
  async () => {
    const cloud = await readScene(readFileSync(write('wide.ply', rawSplats(70_000, 1))), { name: 'wide.ply' });
    for (const name of ['a.spz', 'a.glb']) {
      const { bytes } = await changeFormat(cloud, { name });
      writeFileSync(inFolder(name), bytes);
      const whole = await readScene(bytes, { name });
      const options = { temporary: inFolder('inflated'), maxBytes: 1e9 };
      const blocks: GaussianCloud[] = [];
      for await (const block of blocksOf({ path: inFolder(name) }, options)) blocks.push(block);
      for (const column of COLUMNS)
        assert.ok(bytesIn(blocks, column).equals(bytesIn([whole], column)), `${name} ${column}`);
      assert.equal(existsSync(inFolder('inflated')), false);
    }
    // The file is too large, or its splats are.
    const file = inFolder('a.glb');
    for (const [memory, found] of [
      ['301MB', /found \d+ MB\./],
      [`${300 + Math.ceil(statSync(file).size / 1e6)}MB`, /found more in its splats\./],
    ] as const) {
      const { status, text } = detail(file, '--out', inFolder('no'), '--memory', memory, '--quantized');
      assert.equal(status, 1);
      assert.match(text, /is read whole/);
      assert.match(text, found);
      assert.match(text, /Raise --memory/);
      assert.equal(existsSync(inFolder('no')), false);
    }
  },
);

test('a list of files with transforms is one scene, far from its origin too', async () => {
  write('left.ply', rawSplats(3000, 0, 5));
  write('right.ply', rawSplats(2000, 1, 6));
  const far = 4_000_000;
  const scenes = [
    { file: 'left.ply', transform: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, far, 0, 0, 1] },
    { file: 'right.ply', transform: [0, 0, -2, 0, 0, 2, 0, 0, 2, 0, 0, 0, far + 100, 0, 0, 1] },
  ];
  writeFileSync(inFolder('list.json'), JSON.stringify({ scenes }));
  const out = inFolder('list');
  const { status, text } = detail(inFolder('list.json'), '--out', out, '--quantized');
  assert.equal(status, 0, text);
  const { splats, shDegree, origin, bounds } = checkManifest(
    JSON.parse(readFileSync(join(out, 'detail.json'), 'utf8')),
    'detail.json',
  );
  assert.deepEqual([splats, shDegree], [5000, 1]);
  assert.ok(origin[0] > far - 20 && origin[0] < far + 120, String(origin));
  const right = await readScene(readFileSync(inFolder('right.ply')), { name: 'right.ply' });
  const depths = Array.from({ length: right.count }, (_, k) => 2 * right.positions[3 * k + 2] + far + 100);
  assert.ok(Math.abs(bounds.max[0] - Math.max(...depths)) < 1e-3, 'z becomes x, twice as far');

  const lists: readonly [RegExp, object][] = [
    [/scenes\[0\]\.file: there is no file/, { scenes: [{ file: 'none.ply' }] }],
    [/scenes\[0\]\.transform: expected 16 finite numbers/, { scenes: [{ file: 'left.ply', transform: [1, 2] }] }],
    [/an empty list/, { scenes: [] }],
  ];
  for (const [sentence, list] of someOf(lists, 1)) {
    writeFileSync(inFolder('bad.json'), JSON.stringify(list));
    const bad = detail(inFolder('bad.json'), '--out', inFolder('never'));
    assert.equal(bad.status, 2, bad.text);
    assert.match(bad.text, sentence);
  }
  const wrong: readonly [RegExp, ...string[]][] = [
    [/--part: expected I\/N/, '--part', '5/4'],
    [/--memory: expected a size/, '--memory', '12'],
    [/--tile: expected without --part/, '--tile', '2x2', '--join'],
  ];
  for (const [sentence, ...args] of someOf(wrong, 1))
    assert.match(detail(inFolder('left.ply'), '--out', inFolder('never'), ...args).text, sentence);
});
