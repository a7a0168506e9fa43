/** Commands for several files: each has a row, broken files stop none, and a second call continues. */
import assert from 'node:assert/strict';
import { spawn, spawnSync } from 'node:child_process';
import {
  existsSync,
  mkdirSync,
  mkdtempSync,
  readFileSync,
  rmSync,
  statSync,
  symlinkSync,
  writeFileSync,
} from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, test } from 'node:test';
import { setTimeout } from 'node:timers/promises';
import type { ShDegree } from '@gaussian-splat/core';
import { writePly } from '../formats/support/ply-writer.js';
import { inriaColumns, rawSplats } from '../formats/support/splats.js';
import { isLab, onlyInLab } from '../support/extent.js';

const folder = mkdtempSync(join(tmpdir(), 'gs-batch-'));
after(() => rmSync(folder, { recursive: true }));
const inFolder = (...path: string[]): string => join(folder, ...path);

function command(...args: string[]): { status: number | null; text: string; progress: string } {
  const argv = [join(process.cwd(), 'packages/cli/bin/gaussian-splat.mjs'), ...args];
  const { status, stdout, stderr } = spawnSync(process.execPath, argv, { cwd: folder, encoding: 'utf8' });
  return { status, text: stdout + stderr, progress: stderr };
}

interface Row {
  file: string;
  out?: string;
  splats?: number;
  bytesBefore?: number;
  bytesAfter?: number;
  error?: string;
  code?: string;
}
const rowsOf = (out: string): Row[] =>
  (JSON.parse(readFileSync(inFolder(out, 'results.json'), 'utf8')) as { rows: Row[] }).rows;

/** Writes a folder of scenes, three of them broken, in sub-folders too. @returns Number of files. */
function makeScenes(count: number): number {
  rmSync(inFolder('scenes'), { recursive: true, force: true });
  mkdirSync(inFolder('scenes', 'more'), { recursive: true });
  for (let k = 0; k < count; k++) {
    const ply = writePly([{ name: 'vertex', columns: inriaColumns(rawSplats(20 + k, (k % 4) as ShDegree)) }]);
    const cut = [ply, ply.slice(0, -40), new Uint8Array(0), new TextEncoder().encode('<!doctype html>')];
    writeFileSync(inFolder('scenes', k % 2 ? 'more' : '', `scene-${k}.ply`), cut[k < 4 ? k : 0]);
  }
  writeFileSync(inFolder('scenes', 'notes.txt'), 'no scene');
  return count;
}

test('a folder with three broken files: the others are written, the three are named, and a second call does nothing', () => {
  const count = makeScenes(isLab ? 50 : 7);
  const args = ['optimize', 'scenes', '--format-only', '--as', 'spz', '--out', 'small'];
  const first = command(...args);
  assert.equal(first.status, 1, first.text);
  assert.match(first.text, new RegExp(`${count - 3} of ${count} files written`));
  const rows = rowsOf('small');
  assert.equal(rows.length, count);
  const failed = rows.filter(({ error }) => error);
  assert.deepEqual(failed.map(({ file }) => file).sort(), ['more/scene-1.ply', 'more/scene-3.ply', 'scene-2.ply']);
  for (const { file, code } of failed) {
    assert.match(code ?? '', /^decode\//, file);
    assert.ok(first.text.includes(file));
  }
  for (const { file, out, splats, bytesBefore, bytesAfter } of rows.filter(({ error }) => !error)) {
    assert.equal(out, file.replace('.ply', '.spz'));
    assert.equal(splats, 20 + Number(/\d+/.exec(file)), file);
    assert.equal(statSync(inFolder('scenes', file)).size, bytesBefore);
    assert.equal(statSync(inFolder('small', out)).size, bytesAfter);
  }
  const times = rows.map(
    ({ out = '' }) => existsSync(inFolder('small', out)) && statSync(inFolder('small', out)).mtimeMs,
  );
  const again = command(...args);
  assert.equal(again.status, 1);
  assert.equal(again.progress, '', 'no file is processed again');
  assert.deepEqual(rowsOf('small'), rows);
  assert.deepEqual(
    rows.map(({ out = '' }) => existsSync(inFolder('small', out)) && statSync(inFolder('small', out)).mtimeMs),
    times,
  );

  // A replaced input, a lost output and another option are processed again, and nothing else.
  const ply = writePly([{ name: 'vertex', columns: inriaColumns(rawSplats(33, 2)) }]);
  writeFileSync(inFolder('scenes', 'scene-2.ply'), ply);
  rmSync(inFolder('small', 'scene-4.spz'));
  const third = command(...args);
  assert.equal(third.progress.trim().split('\n').length, 2, third.progress);
  assert.equal(rowsOf('small').find(({ file }) => file === 'scene-2.ply')?.splats, 33);
  const page = readFileSync(inFolder('small', 'index.html'), 'utf8');
  assert.match(page, /data-src="more\/scene-5\.spz"/);
});

test(
  'a second call replaces folders of changed scenes and of an ended run, and reads neither its outputs nor links to above',
  { skip: onlyInLab },
  async () => {
    const write = (name: string, count: number): void =>
      writeFileSync(
        inFolder('cases', name),
        writePly([{ name: 'vertex', columns: inriaColumns(rawSplats(count, 0)) }]),
      );
    // A folder that the user created stays.
    mkdirSync(inFolder('cases', 'c'), { recursive: true });
    writeFileSync(inFolder('cases', 'c', 'notes.txt'), 'of the user');
    ['a.ply', 'b.ply'].forEach((name) => write(name, 300));
    symlinkSync('.', inFolder('cases', 'loop'));
    const args = ['detail', 'cases', '--quantized', '--out', 'cases'];
    const argv = [join(process.cwd(), 'packages/cli/bin/gaussian-splat.mjs'), ...args];
    const ended = spawn(process.execPath, argv, { cwd: folder, stdio: 'ignore' });
    while (!existsSync(inFolder('cases', 'b')) && ended.exitCode === null) await setTimeout(2);
    ended.kill('SIGKILL');
    assert.equal(command(...args).status, 0);
    const splatsIn = (): unknown[] => rowsOf('cases').map(({ file, splats }) => [file, splats]);
    assert.deepEqual(splatsIn(), [['a.ply', 300], ['b.ply', 300]]); // prettier-ignore
    write('a.ply', 400);
    write('c.ply', 300);
    command(...args);
    const { status, text } = command(...args);
    assert.equal(status, 1, text);
    assert.ok(existsSync(inFolder('cases', 'c', 'notes.txt')));
    assert.deepEqual(splatsIn(), [['a.ply', 400], ['b.ply', 300], ['c.ply', undefined]]); // prettier-ignore
  },
);

test('an option that is wrong for one file alone stops no other', { skip: onlyInLab }, () => {
  mkdirSync(inFolder('sizes'));
  [200, 300].forEach((count) =>
    writeFileSync(
      inFolder('sizes', `${count}.ply`),
      writePly([{ name: 'vertex', columns: inriaColumns(rawSplats(count, 0)) }]),
    ),
  );
  const { status, text } = command('detail', 'sizes', '--quantized', '--tile=2x1', '--out=tiled');
  assert.equal(status, 1, text);
  assert.match(text, /1 of 2 files written/);
  assert.match(rowsOf('tiled')[0].error ?? '', /more than 256 splats, found .*200\.ply/);
});

test(
  'patterns and lists of files; what cannot begin ends with status 2 and writes nothing',
  { skip: onlyInLab },
  () => {
    makeScenes(7);
    const pattern = command('optimize', 'scenes/**/scene-[56].ply', '--format-only', '--out', 'none');
    assert.match(pattern.text, /expected scenes, found none/);
    assert.equal(pattern.status, 2);
    const two = command(
      'optimize',
      'scenes/*-?.ply',
      'scenes/more/scene-5.ply',
      '--format-only',
      '--as=glb',
      '--out=glb',
    );
    assert.deepEqual(
      rowsOf('glb').map(({ out }) => out),
      ['scene-0.glb', 'scene-2.glb', 'scene-4.glb', 'scene-6.glb', 'scene-5.glb'],
      two.text,
    );
    const wrong: readonly [RegExp, ...string[]][] = [
      [/--as: expected \.sog, .* found "gif"/, 'optimize', 'scenes', '--format-only', '--as', 'gif', '--out', 'no'],
      [/--out is missing/, 'floor', 'scenes'],
      [/--as: expected with several files/, 'floor', 'scenes/scene-0.ply', '--as', 'floor', '--out', 'a.floor'],
      [/--report: expected with one file/, 'optimize', 'scenes', '--min-psnr=40', '--report=a.json', '--out=no'],
      [/expected a SCENE/, 'detail', '--out', 'no'],
      [/one of --min-psnr/, 'optimize', 'scenes', '--out', 'no'],
      [/There is no file none\.ply/, 'floor', 'none.ply', 'scenes', '--out', 'no'],
    ];
    for (const [sentence, ...args] of wrong) {
      const { status, text } = command(...args);
      assert.equal(status, 2, text);
      assert.match(text, sentence);
      assert.doesNotMatch(text, /\n {4}at /);
    }
  },
);

test(
  'a catalogue of a folder: scenes are copied, each with a link, and broken ones have their error',
  { skip: onlyInLab },
  () => {
    makeScenes(5);
    const { status, text } = command('page', 'scenes', 'site', '--no-serve');
    assert.equal(status, 1, text);
    const page = readFileSync(inFolder('site', 'index.html'), 'utf8');
    assert.equal(rowsOf('site').find(({ file }) => file === 'scene-0.ply')?.splats, 20);
    assert.match(page, /data-tag="gaussian-splat" data-src="scene-0\/scene-0\.ply"/);
    assert.ok(existsSync(inFolder('site', 'scene-0', 'scene-0.ply')));
    assert.ok(existsSync(inFolder('site', 'cdn', 'gaussian-splat.min.js')));
    assert.equal(existsSync(inFolder('site', 'scene-0', 'index.html')), false);
    assert.equal(page.match(/data-src/g)?.length, 2 + 1);
    assert.match(page, /<td>scene-2\.ply<\/td>.*decode\/|<td>scene-2\.ply<\/td>.*empty/);
  },
);
