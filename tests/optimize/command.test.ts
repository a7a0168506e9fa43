/** `gaussian-splat optimize` as users call it: refusals before any work, its output, and unchanged inputs. */
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import { linkSync, mkdtempSync, readdirSync, readFileSync, rmSync, symlinkSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { boundsOf, type Camera } from '@gaussian-splat/core';
import { encodingsFor, viewsAround } from '@gaussian-splat/optimize';
import { readScene } from '@gaussian-splat/formats';
import { writeWhole } from '../../packages/cli/src/lib/output-file.mjs';
import { smallCloud } from '../formats/support/small-cloud.js';
import { onlyInFull, onlyInLab, someOf } from '../support/extent.js';

const script = fileURLToPath(new URL('../../packages/cli/bin/gaussian-splat.mjs', import.meta.url));
const folder = mkdtempSync(join(tmpdir(), 'optimize-'));
after(() => rmSync(folder, { recursive: true }));

const cloud = smallCloud(300, 1);
const source = Buffer.from(await encodingsFor('a.ply')[0].write({ cloud, degrees: new Uint8Array(300).fill(1) }));
const scene = join(folder, 'scene.ply');
writeFileSync(scene, source);
const rows = (m: Camera['worldToCamera']): number[][] => [0, 1, 2, 3].map((row) => [...m].slice(4 * row, 4 * row + 4));
const views = viewsAround(boundsOf(cloud), 10, { width: 64, height: 36 }).map(
  ({ width, height, fx, fy, cx, cy, worldToCamera }) => ({
    ...{ width, height, worldToCamera: rows(worldToCamera) },
    K: [
      [fx, 0, cx],
      [0, fy, cy],
      [0, 0, 1],
    ],
  }),
);
const cameras = join(folder, 'views.json');
writeFileSync(cameras, JSON.stringify({ views }));

function command(...args: string[]): { status: number | null; said: string } {
  const { status, stdout, stderr } = spawnSync(process.execPath, [script, 'optimize', ...args], {
    encoding: 'utf8',
    cwd: folder,
  });
  return { status, said: stdout + stderr };
}

test('input files are never output files, under any name', () => {
  symlinkSync(scene, join(folder, 'link.ply'));
  linkSync(scene, join(folder, 'twin.ply'));
  const cases = [
    [['--out', 'scene.ply'], /--out: expected another file than SCENE/],
    [['--out', 'link.ply'], /--out: expected another file than SCENE/],
    [['--out', 'twin.ply'], /--out: expected another file than SCENE/],
    [['--out', 'a.glb', '--report', 'scene.ply'], /--report: expected another file than SCENE/],
    [['--out', 'a.glb', '--views', 'views.json', '--report', './views.json'], /--report: .* that of --views/],
    [['--out', 'a.glb', '--report', 'a.glb'], /--report: expected another file than that of --out/],
  ] as const;
  for (const [args, reason] of someOf<(typeof cases)[number]>(cases, 3)) {
    const { status, said } = command('scene.ply', '--min-psnr', '40', ...args);
    assert.equal(status, 2, said);
    assert.match(said, reason);
  }
  const gated = command('scene.ply', '--gate', 'views.json', '--out', 'a.glb', '--report', 'views.json');
  assert.equal(gated.status, 2, gated.said);
  assert.match(gated.said, /--report: .* that of --gate/);
  assert.deepEqual(readFileSync(scene), source);
});

test('what cannot be written or read is said before the work, for people', () => {
  writeFileSync(join(folder, 'cameras.json'), '{"cameras": []}');
  writeFileSync(join(folder, 'prose.json'), 'hello');
  const cases = [
    [['none.ply', '--out', 'nowhere/a.glb'], 2, /--out: the folder .*nowhere does not exist/],
    [['none.ply', '--out', 'a.glb', '--report', '.'], 2, /--report: .* is a folder/],
    [['none.ply', '--out', 'a.obj'], 2, /expected a name that ends in .*\[argument\/value\]/],
    [['none.ply', '--out', 'a.glb'], 1, /^ENOENT: no such file.*none\.ply'$/m],
    [['scene.ply', '--out', 'a.glb', '--views', 'cameras.json'], 2, /found no list "views"/],
    [['scene.ply', '--out', 'a.glb', '--views', 'prose.json'], 2, /prose\.json is not JSON/],
    [['scene.ply', '--out', 'a.glb', '--views', '.'], 1, /^EISDIR/m],
  ] as const;
  for (const [args, status, reason] of someOf<(typeof cases)[number]>(cases, 3)) {
    const found = command('--min-psnr', '40', ...args);
    assert.equal(found.status, status, found.said);
    assert.match(found.said, reason);
    assert.doesNotMatch(found.said, /\n {4}at /, 'no stack');
  }
});

/** One run, for it takes half a minute of CPU time: a broken file, and cameras that begin with a byte-order mark, the first as large as a photograph. */
test(
  'what it says of the written file is what a reader finds in it; splats that cannot be drawn are counted apart, and large views are drawn smaller',
  { skip: onlyInLab },
  async () => {
    const broken = Buffer.from(source);
    // The first coordinate of three rows.
    const row = (source.length - source.indexOf('end_header') - 11) / 300;
    for (const k of [0, 7, 299]) broken.writeFloatLE(NaN, source.length - row * (300 - k));
    // And a row of a mesh, which is not drawn.
    const text = broken.toString('latin1').replace('end_header', 'element face 1\nproperty float area\nend_header');
    writeFileSync(join(folder, 'broken.ply'), Buffer.from(`${text}mesh`, 'latin1'));
    const [first, ...others] = views;
    const [[fx, , cx], [, fy, cy], last] = first.K;
    const [across, down] = [9000 / first.width, 90 / first.height];
    const K = [[across * fx, 0, across * cx], [0, across * fy, down * cy], last];
    const large = { ...first, width: 9000, height: 90, K };
    writeFileSync(join(folder, 'marked.json'), `\ufeff${JSON.stringify({ views: [large, ...others] })}`);
    const { status, said } = command('broken.ply', '--min-psnr', '30', '--out', 'less.glb', '--views', 'marked.json');
    assert.equal(status, 0, said);
    const bytes = readFileSync(join(folder, 'less.glb'));
    const { count } = await readScene(bytes, { name: 'less.glb' });
    assert.match(said, /views +1 of 10 in fewer pixels, 1600 a side/);
    assert.match(said, /broken\.ply: 1 rows of "face" are left out/);
    assert.match(said, new RegExp(`splats +${count} of 297 \\(\\d+\\.\\d %\\); 3 unusable ones of the file left out`));
    assert.match(said, new RegExp(`bytes +${bytes.length} of ${text.length + 4} `));
    assert.match(said, /found +3\d\.\d\d dB in 4 held-out views together, \d\d\.\d\d dB in the worst/);
    assert.equal(readFileSync(join(folder, 'broken.ply'), 'latin1'), `${text}mesh`);
  },
);

/** Few splats and the fewest views, because the search measures each step in excerpts at the size of screens. */
test('SOG is tuned to the figure, or to the bytes, that are asked for', { skip: onlyInFull }, async () => {
  const few = smallCloud(40, 1);
  const file = await encodingsFor('a.ply')[0].write({ cloud: few, degrees: new Uint8Array(40).fill(1) });
  writeFileSync(join(folder, 'few.ply'), file);
  writeFileSync(join(folder, 'few.json'), JSON.stringify({ views: views.slice(0, 8) }));
  const asked = command('few.ply', '--min-psnr', '40', '--out', 'less.sog', '--views', 'few.json');
  assert.equal(asked.status, 0, asked.said);
  assert.match(asked.said, /SOG version 2, steps place/);
  assert.ok(Number(/found +([\d.]+) dB/.exec(asked.said)?.[1]) >= 40, asked.said);
  const { length } = readFileSync(join(folder, 'less.sog'));
  const max = Math.ceil(1.1 * length);
  const sized = command('few.ply', '--max-mb', String(max / 1e6), '--out', 'sized.sog', '--views', 'few.json');
  assert.equal(sized.status, 0, sized.said);
  assert.ok(readFileSync(join(folder, 'sized.sog')).length <= max, sized.said);
  const found = await readScene(readFileSync(join(folder, 'sized.sog')), { name: 'sized.sog' });
  assert.ok(found.count > 0);
  const both = command('few.ply', '--min-psnr', '40', '--max-mb', '1', '--out', 'less.sog');
  assert.equal(both.status, 2);
  assert.match(both.said, /one of --min-psnr, --max-mb, --gate and --format-only/);
});

test('--format-only keeps every splat in every format, without a GPU', async () => {
  const formats = ['a.usdz', 'a.usdc', 'a.glb', 'a.spz', 'a.ply', 'a.sog', 'streamed/lod-meta.json'];
  for (const out of someOf(formats, 2)) {
    const { status, said } = command('scene.ply', '--format-only', '--out', out, '--threads', '1');
    assert.equal(status, 0, said);
    assert.match(said, /splats +300, all of the scene\n/);
    assert.match(said, /the format alone has changed/);
    assert.doesNotMatch(said, /adapter/);
    if (out.endsWith('.json')) continue;
    const found = await readScene(readFileSync(join(folder, out)), { name: out });
    assert.deepEqual([found.count, found.shDegree], [300, 1], out);
  }
  const merged = command('scene.ply', '--format-only', '--merge', '--out', 'b.glb');
  assert.deepEqual([merged.status, /--merge: expected no --format-only/.test(merged.said)], [2, true], merged.said);
});

test('where writing fails, what was there stays', () => {
  const path = join(folder, 'there.glb');
  writeWhole(path, 'first');
  assert.throws(() => writeWhole(path, 5 as unknown as string));
  assert.equal(readFileSync(path, 'utf8'), 'first');
  writeWhole(path, 'second');
  assert.equal(readFileSync(path, 'utf8'), 'second');
  assert.deepEqual(
    readdirSync(folder).filter((name) => name.endsWith('.part')),
    [],
  );
});
