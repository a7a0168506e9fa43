/** Streamed scenes with WebGL 2: as much of them is loaded as fits, the coarsest first. */
import assert from 'node:assert/strict';
import { createServer, type Server } from 'node:http';
import type { AddressInfo } from 'node:net';
import { after, before, test } from 'node:test';
import type { GaussianCloud } from '@gaussian-splat/core';
import { DEFAULT_STEPS } from '@gaussian-splat/optimize/pages';
import { finestPages } from '@gaussian-splat/renderer/tools';
import { glBytes } from '@gaussian-splat/renderer/webgl';
import { deflate } from '../../packages/cli/src/lib/encoders.mjs';
import { loadScene, type LoadedScene } from '../support/element/loading.js';
import { smallCloud } from '../formats/support/small-cloud.js';
import { emptyList, putBelow, type PagePlace } from '../../packages/renderer/src/streaming/page-list.js';
import { detailFolder } from '../support/detail-folder.js';
import { lodFolder } from '../support/lod-folder.js';

const COUNT = 8_000;
const files = new Map<string, Uint8Array>();
let server: Server;
let base: string;
const cloud: GaussianCloud = smallCloud(COUNT, 1);

before(async () => {
  const put = (folder: string, all: ReadonlyMap<string, Uint8Array | ArrayBuffer>): void =>
    all.forEach((bytes, path) => files.set(`/${folder}/${path}`, new Uint8Array(bytes)));
  const coded = { steps: DEFAULT_STEPS, deflate };
  for (const [name, folder] of [
    ['coded', detailFolder(cloud, undefined, { geometry: 'quantized', coded })],
    ['plain', detailFolder(cloud, undefined, { geometry: 'quantized' })],
    ['copies', detailFolder(cloud, [[0, 0, 0], [10, 0, 0]], { geometry: 'quantized', coded })], // prettier-ignore
  ] as const) {
    put(name, folder.files);
    files.set(`/${name}/detail.json`, Buffer.from(JSON.stringify(folder.manifest)));
  }
  const lod = lodFolder(cloud, { levels: 3, boxes: 4 });
  put('lod', lod.files);
  files.set('/lod/lod-meta.json', lod.index);
  server = createServer((request, response) => {
    const bytes = files.get(new URL(request.url!, 'http://a').pathname);
    response.writeHead(bytes ? 200 : 404);
    response.end(bytes);
  });
  await new Promise<void>((resolve) => server.listen(0, resolve));
  base = `http://localhost:${(server.address() as AddressInfo).port}`;
});
after(() => {
  server.closeAllConnections();
  server.close();
});

async function load(path: string, streamBytes: number, previews: number[] = []): Promise<LoadedScene> {
  const request = { url: `${base}/${path}`, credentials: 'omit', sh: 'auto', streamBytes } as const;
  const onPreview = ({ packed }: LoadedScene): number => previews.push(packed.count);
  const scene = await loadScene(request, new AbortController().signal, { onProgress: () => undefined, onPreview });
  assert.ok('packed' in scene && scene.packed);
  return scene;
}

/** Coordinates along x, ascending. */
function along({ packed: { geometry, origin, count } }: LoadedScene): number[] {
  const floats = new Float32Array(geometry.buffer, geometry.byteOffset, geometry.length);
  return Array.from({ length: count }, (_, i) => floats[8 * i] + origin[0]).sort((a, b) => a - b);
}

const xs = Array.from({ length: COUNT }, (_, i) => cloud.positions[3 * i]).sort((a, b) => a - b);
function assertNear(found: readonly number[], expected: readonly number[]): void {
  assert.equal(found.length, expected.length);
  const worst = found.reduce((max, x, i) => Math.max(max, Math.abs(x - expected[i])), 0);
  assert.ok(worst < 0.01, `places differ by ${worst}`);
}

const ENOUGH = 1e9;
for (const path of ['coded/detail.json', 'plain/detail.json', 'lod/lod-meta.json']) {
  test(`${path}: where all of it fits, all of its finest level is drawn`, async () => {
    assertNear(along(await load(path, ENOUGH)), xs);
  });

  test(`${path}: within a budget it is as fine as fits, and covers the scene`, async () => {
    for (const memory of [0.2e6, 0.4e6]) {
      const scene = await load(path, memory);
      assert.ok(glBytes(scene.packed) <= memory, `${glBytes(scene.packed)} bytes in ${memory}`);
      assert.ok(scene.packed.count >= 500, `${scene.packed.count} splats`);
      const found = along(scene);
      // Parts that have no room for their next level stay as they are, four times as coarse.
      for (let tenth = 0; tenth < 10; tenth++) {
        const [low, high] = [xs[(COUNT / 10) * tenth], xs[(COUNT / 10) * (tenth + 1) - 1]];
        const share = found.filter((x) => x >= low && x <= high).length / found.length;
        assert.ok(share > 0.02, `${share} of the splats in the tenth from ${low} on`);
      }
    }
  });
}

test('copies of a tree stand at their places', async () => {
  const found = along(await load('copies/detail.json', ENOUGH));
  assertNear(found, [...xs, ...xs.map((x) => x + 10)]);
});

test('the coarsest pages are a preview', async () => {
  const previews: number[] = [];
  const { packed } = await load('coded/detail.json', ENOUGH, previews);
  assert.ok(previews.length >= 2 && previews[0] < packed.count / 8, previews.join());
  assert.deepEqual(
    previews,
    [...previews].sort((a, b) => a - b),
  );
});

test('a page that is missing or too short is said by name', async () => {
  const [path] = [...files.keys()].filter((file) => file.startsWith('/plain/') && !file.endsWith('.json'));
  const bytes = files.get(path)!;
  files.set(path, bytes.subarray(0, 100));
  await assert.rejects(load('plain/detail.json', ENOUGH), { code: 'decode/truncated' });
  files.delete(path);
  await assert.rejects(load('plain/detail.json', ENOUGH), { code: 'network/status' });
  files.set(path, bytes);
});

test('pages that add nothing are not read without end', () => {
  const count = 1_000_000;
  const chain = emptyList(new Uint32Array(count).fill(1));
  for (let page = 1; page < count; page++) putBelow(chain, page, page - 1, 0, 1);
  const place = (): PagePlace => ({ file: { file: 'a', chunks: 1, upper: 1 }, first: 0, chunks: 1 });
  const start = process.cpuUsage();
  const pages = finestPages({ ...chain, place, translate: () => [0, 0, 0] }, 100);
  const { user } = process.cpuUsage(start);
  assert.ok(pages.length <= 201, `${pages.length} pages`);
  assert.ok(user < 3e6, `${user / 1000} ms`);
});
