/** `gaussian-splat detail`: readers accept its output, and it reports impossible requests at once. */
import assert from 'node:assert/strict';
import { spawnSync } from 'node:child_process';
import {
  existsSync,
  mkdirSync,
  mkdtempSync,
  readdirSync,
  readFileSync,
  rmSync,
  statSync,
  writeFileSync,
} from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, test } from 'node:test';
import { checkManifest } from '@gaussian-splat/renderer';
import { decodePage } from '@gaussian-splat/renderer/tools';
import { pageLayout } from '@gaussian-splat/renderer/stages';
import { writePly } from '../formats/support/ply-writer.js';
import { inriaColumns, rawSplats } from '../formats/support/splats.js';
import { isLab, onlyInLab, someOf } from '../support/extent.js';

const folder = mkdtempSync(join(tmpdir(), 'gs-detail-'));
after(() => rmSync(folder, { recursive: true }));

/** A scene file with a number of splats. */
function sceneOf(splats: number): string {
  const path = join(folder, `${splats}.ply`);
  writeFileSync(path, writePly([{ name: 'vertex', columns: inriaColumns(rawSplats(splats, 1)) }]));
  return path;
}

function detail(...args: string[]): { status: number | null; text: string } {
  const { status, stdout, stderr } = spawnSync(
    process.execPath,
    ['packages/cli/bin/gaussian-splat.mjs', 'detail', ...args],
    {
      encoding: 'utf8',
      timeout: isLab ? 1_200_000 : 240_000,
    },
  );
  return { status, text: stdout + stderr };
}

const RUNS = [
  [1, '--quantized'],
  [1500, '--exact', '--degree', '1'],
  [257, '--quantized'],
  [1500, '--quantized', '--tile', '2x3', '--spacing', '1e5'],
  [1500, '--quantized', '--degree', '0'],
] as const;
for (const [splats, ...options] of someOf(RUNS, 3)) {
  test(`${splats} splats ${options.join(' ')}: every file is as long as the manifest says`, () => {
    const out = join(folder, `out-${splats}-${options.join('')}`);
    const { status, text } = detail(sceneOf(splats), '--out', out, ...options);
    assert.equal(status, 0, text);
    const manifest = checkManifest(JSON.parse(readFileSync(join(out, 'detail.json'), 'utf8')), 'detail.json');
    assert.equal(manifest.geometry, options.includes('--exact' as never) ? undefined : 'quantized');
    assert.equal(manifest.splats, splats * (options.includes('--tile' as never) ? 6 : 1));
    for (const { file, chunks } of manifest.trees.flatMap(({ pages }) => pages)) {
      assert.equal(statSync(join(out, file)).size, 4 * pageLayout(manifest, chunks).total, file);
    }
  });
}

test(
  'by default files are coded, and the tool states how near they are to the scene',
  { skip: onlyInLab },
  async () => {
    const out = join(folder, 'coded');
    const { status, text } = detail(
      sceneOf(400),
      '--out',
      out,
      '--min-psnr',
      '40',
      '--score-views',
      '24',
      '--tile',
      '1x2',
    );
    assert.equal(status, 0, text);
    const manifest = checkManifest(JSON.parse(readFileSync(join(out, 'detail.json'), 'utf8')), 'detail.json');
    assert.equal(manifest.version, 4);
    for (const { file, chunks, upper } of manifest.trees.flatMap(({ pages }) => pages)) {
      const coded = { chunks, upper, shDegree: manifest.shDegree, coding: manifest.coding! };
      const words = await decodePage(file, new Uint8Array(readFileSync(join(out, file))), coded);
      assert.equal(words.byteLength, 4 * pageLayout(manifest, chunks).total, file);
    }
    assert.ok(Number(/([\d.]+) dB to the scene/.exec(text)?.[1]) >= 40, text);
  },
);

test('invalid arguments are reported in a line, without a stack trace, and at once', () => {
  const scene = sceneOf(300);
  const out = join(folder, 'never');
  const cases: [RegExp, ...string[]][] = [
    [/expected a SCENE/],
    [/--out is missing/, scene],
    [/is not a folder/, scene, '--out', scene],
    [/is not empty/, scene, '--out', folder],
    [/--spacing: expected a length/, scene, '--out', out, '--tile', '2x2', '--spacing', 'Infinity'],
    [/--spacing: expected a length/, scene, '--out', out, '--tile', '20x2', '--spacing', '1e38'],
    [/--min-psnr: expected 30 to 60/, scene, '--out', out, '--min-psnr', '70'],
    [/--score-views: expected a whole number from 24 to 2000/, scene, '--out', out, '--score-views', '5'],
    [/--min-psnr: expected without --quantized/, scene, '--out', out, '--quantized', '--min-psnr', '40'],
    [/--spacing: expected with --tile/, scene, '--out', out, '--spacing', '2'],
    [/--degree/, scene, '--out', out, '--degree', '4'],
    [/found no list "views"/, scene, '--out', out, '--views', 'package.json'],
  ];
  for (const [expected, ...args] of someOf(cases, 3)) {
    const { status, text } = detail(...args);
    assert.equal(status, 2, `${args.join(' ')}: ${text}`);
    assert.match(text, expected);
    assert.doesNotMatch(text, /\n {4}at /);
  }
  const tiny = join(folder, 'tiny');
  assert.match(detail(sceneOf(200), '--out', tiny, '--tile', '2x2').text, /more than 256 splats/);
  assert.equal(existsSync(tiny), false, 'a folder that is in the way of the next try');
  const { status, text } = detail(join(folder, 'missing.ply'), '--out', out);
  assert.equal(status, 1);
  assert.match(text, /missing\.ply/);
  assert.doesNotMatch(text, /\n {4}at /);
});

test(
  'a run that was ended early is no obstacle to the next, and what fails to be written leaves no pages',
  { skip: onlyInLab || process.platform === 'win32' },
  () => {
    const out = join(folder, 'ended');
    mkdirSync(join(out, 'pages'), { recursive: true });
    for (const name of ['scene-00000.bin', 'scene-00007.bin']) writeFileSync(join(out, 'pages', name), 'half');
    const again = detail(sceneOf(300), '--out', out, '--quantized');
    assert.equal(again.status, 0, again.text);
    assert.deepEqual(readdirSync(join(out, 'pages')), ['scene-00000.bin'], 'nothing of the earlier run is left');
    assert.match(detail(sceneOf(300), '--out', out).text, /is not empty/, 'a scene that is whole stays');

    const own = join(folder, 'own');
    mkdirSync(join(own, 'pages'), { recursive: true });
    writeFileSync(join(own, 'pages', 'diary.txt'), 'mine');
    assert.match(detail(sceneOf(300), '--out', own).text, /is not empty/);
    assert.equal(readFileSync(join(own, 'pages', 'diary.txt'), 'utf8'), 'mine');

    const full = join(folder, 'full');
    const command = `ulimit -f 8; exec "${process.execPath}" packages/cli/bin/gaussian-splat.mjs detail "${sceneOf(3000)}" --quantized --out "${full}"`;
    const { status, stderr } = spawnSync('bash', ['-c', command], { encoding: 'utf8' });
    assert.equal(status, 1, stderr);
    assert.match(stderr, /^EFBIG: file too large/m);
    assert.equal(existsSync(join(full, 'pages')), false);
  },
);
