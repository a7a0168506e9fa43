/** Streamed SOG whose parts are bundles (`.sog`) in place of folders. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { strToU8, zipSync } from 'fflate';
import { readCoarsestLevel, readLodScene, readScene, SogFiles } from '@gaussian-splat/formats';
import { lodFolder } from '../support/lod-folder.js';
import { assertSameCloud, expectRefusal } from './support/expect.js';
import { smallCloud } from './support/small-cloud.js';

const folder = lodFolder(smallCloud(400, 1), { levels: 2, boxes: 2, environment: smallCloud(7, 0, 3) });
const INDEX = 'https://lod.test/a/lod-meta.json';

/** The files of one folder, packed. `inner` is the folder within the archive. */
function pack(name: string, inner = '', level: 0 | 6 = 0): Uint8Array {
  const own = [...folder.files].filter(([path]) => path.startsWith(`${name}/`));
  return zipSync(Object.fromEntries(own.map(([path, bytes]) => [inner + path.slice(name.length + 1), bytes])), {
    level,
  });
}

const bundled = strToU8(new TextDecoder().decode(folder.index).replaceAll('/meta.json', '.sog'));
const FILES = new Map([
  ['0_0.sog', pack('0_0')],
  ['1_0.sog', pack('1_0', 'within/', 6)],
  ['env.sog', pack('env')],
]);

const plain = (path: string): Promise<Uint8Array> => Promise.resolve(folder.files.get(path)!);
const open = (path: string): Promise<Uint8Array> => Promise.resolve(FILES.get(path)!);

test('a scene of bundles is that of folders, as a whole and at every level', async () => {
  for (const level of [0, 1, 'all'] as const) {
    assertSameCloud(
      await readScene(bundled, { name: 'lod-meta.json', openFile: open, level }),
      await readScene(folder.index, { name: 'lod-meta.json', openFile: plain, level }),
    );
  }
  const archive = zipSync({ 'lod-meta.json': bundled, ...Object.fromEntries(FILES) });
  assertSameCloud(
    await readScene(archive, { name: 'a.zip' }),
    await readScene(folder.index, { name: 'lod-meta.json', openFile: plain }),
  );
});

test('box by box, with one request for a bundle', async () => {
  const asked: string[] = [];
  const fetchFrom = (files: ReadonlyMap<string, Uint8Array>) => (url: string) => {
    const path = url.slice('https://lod.test/a/'.length);
    asked.push(path);
    return Promise.resolve(files.get(path)!);
  };
  const read = async (index: Uint8Array, files: ReadonlyMap<string, Uint8Array>) => {
    const scene = readLodScene(index, 'lod-meta.json', INDEX);
    const [kept, fetch] = [new SogFiles(), fetchFrom(files)];
    return [
      await readCoarsestLevel(scene, kept, fetch, 'lod-meta.json'),
      await kept.read(scene.boxes[1].runs[1], fetch),
    ] as const;
  };
  const found = await read(bundled, FILES);
  assert.deepEqual(asked.sort(), ['0_0.sog', '1_0.sog', 'env.sog']);
  (await read(folder.index, folder.files)).forEach((cloud, k) => assertSameCloud(found[k], cloud));
});

test('a bundle without a scene, or a damaged one, is reported by its name', async () => {
  const with1 = (bytes: Uint8Array) => ({
    name: 'lod-meta.json',
    openFile: (path: string) => (path === '1_0.sog' ? Promise.resolve(bytes) : open(path)),
    level: 1,
  });
  const empty = with1(zipSync({ 'readme.txt': strToU8('x'), '__MACOSX/meta.json': strToU8('x') }));
  await expectRefusal(bundled, 'decode/unknown-format', /1_0\.sog.*meta\.json.*"readme\.txt"/, empty);
  await expectRefusal(bundled, 'decode/truncated', /1_0\.sog, byte/, with1(FILES.get('1_0.sog')!.subarray(0, 900)));
  const nested = with1(zipSync({ '1_0.sog': FILES.get('1_0.sog')! }));
  await expectRefusal(bundled, 'decode/unknown-format', /1_0\.sog/, nested);
});
