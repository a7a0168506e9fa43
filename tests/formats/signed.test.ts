/** Scenes of several files on servers that refuse requests without the right query. */
import assert from 'node:assert/strict';
import { createServer } from 'node:http';
import type { AddressInfo } from 'node:net';
import { after, before, beforeEach, test } from 'node:test';
import { partUrl } from '@gaussian-splat/core/fetch';
import {
  fetchScene,
  fileOpenerFor,
  readCoarsestLevel,
  readLodScene,
  readScene,
  SogFiles,
} from '@gaussian-splat/formats';
import { lodFolder } from '../support/lod-folder.js';
import { assertSameCloud } from './support/expect.js';
import { buildGltf } from './support/gltf-writer.js';
import { smallCloud } from './support/small-cloud.js';
import { writeSog } from './support/sog-writer.js';

const cloud = smallCloud(60, 1);
const folder = lodFolder(cloud, { levels: 2, boxes: 2, environment: smallCloud(7, 0, 3) });
const { json, buffer } = buildGltf([[{ cloud }]], [{ mesh: 0 }], [0]);
const gltf = (uri: string): Uint8Array =>
  new TextEncoder().encode(JSON.stringify({ ...json, buffers: [{ uri, byteLength: buffer.length }] }));
const FILES = new Map<string, Uint8Array>([
  ...Object.entries(writeSog(cloud)).map(([path, bytes]): [string, Uint8Array] => [`sog/${path}`, bytes]),
  ...[...folder.files].map(([path, bytes]): [string, Uint8Array] => [`lod/${path}`, bytes]),
  ['lod/lod-meta.json', folder.index],
  ['gltf/plain.gltf', gltf('a%20b.bin')],
  ['gltf/signed.gltf', gltf('a%20b.bin?own=1#here')],
  ['gltf/a b.bin', buffer],
]);

const QUERY = '?token=a%2Fb&expires=9';
const asked: string[] = [];
const server = createServer((request, response) => {
  asked.push(request.url!);
  const { pathname, search } = new URL(request.url!, 'http://x');
  const bytes = FILES.get(decodeURIComponent(pathname.slice(1)));
  if (search !== QUERY && search !== '?own=1') response.writeHead(403).end();
  else if (bytes) response.end(bytes);
  else response.writeHead(404).end();
});
let base = '';
before(async () => {
  await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
  base = `http://127.0.0.1:${(server.address() as AddressInfo).port}`;
});
after(() => {
  server.closeAllConnections();
  server.close();
});
beforeEach(() => void asked.splice(0));

const read = async (path: string) => {
  const url = `${base}/${path}${QUERY}`;
  return readScene(await fetchScene(url), { name: path, openFile: fileOpenerFor(url, () => ({ retries: 0 })) });
};

test('files that a scene names are asked for with its query', async () => {
  const paths = ['sog/meta.json', 'lod/lod-meta.json', 'gltf/plain.gltf'];
  for (const path of paths) assert.ok((await read(path)).count >= 60, path);
  assert.ok(asked.every((url) => url.endsWith(QUERY)));
});

test('box by box, too', async () => {
  const index = `${base}/lod/lod-meta.json${QUERY}`;
  const fetch = (url: string): Promise<Uint8Array> => fetchScene(url, { retries: 0 });
  const scene = readLodScene(await fetch(index), 'lod-meta.json', index);
  assert.ok((await readCoarsestLevel(scene, new SogFiles(), fetch, 'lod-meta.json')).count > 0);
});

test('a buffer of a glTF keeps a query of its own', async () => {
  assertSameCloud(await read('gltf/signed.gltf'), await read('gltf/plain.gltf'));
  assert.ok(asked.includes('/gltf/a%20b.bin?own=1'));
});

test('a query goes to no other server, and changes none that is there', () => {
  const scene = `https://x.test/a/scene.json${QUERY}#part`;
  const cases: [path: string, address: string][] = [
    ['b.webp', `https://x.test/a/b.webp${QUERY}`],
    ['../b.webp#d', `https://x.test/b.webp${QUERY}#d`],
    ['/b.webp', `https://x.test/b.webp${QUERY}`],
    ['b.webp?c=1', 'https://x.test/a/b.webp?c=1'],
    ['https://x.test/b.webp', `https://x.test/b.webp${QUERY}`],
    ['https://y.test/b.webp', 'https://y.test/b.webp'],
    ['//y.test/b.webp', 'https://y.test/b.webp'],
    ['http://x.test/b.webp', 'http://x.test/b.webp'],
    ['blob:https://x.test/1-2', 'blob:https://x.test/1-2'],
    ['data:,b', 'data:,b'],
  ];
  for (const [path, address] of cases) assert.equal(partUrl(path, scene).href, address, path);
  assert.equal(partUrl('b.webp', 'https://x.test/a/scene.json').href, 'https://x.test/a/b.webp');
});

test('the files of a scene are on its own server, under any name', () => {
  const bound = { min: [0, 0, 0], max: [1, 1, 1] };
  const addressOf = (path: string): string => {
    const index = { lodLevels: 1, filenames: [path], tree: { bound, lods: { 0: { file: 0, count: 1 } } } };
    const bytes = new TextEncoder().encode(JSON.stringify(index));
    return readLodScene(bytes, 'lod-meta.json', `https://x.test/a/lod-meta.json${QUERY}`).boxes[0].runs[0].url;
  };
  const paths = [
    '//y.test/meta.json',
    '///y.test/b',
    '/\\\\y.test/b',
    '\\\\y.test/b',
    'https://y.test/b',
    'https:y.test',
    '/b',
    '../..//y.test/b',
  ];
  for (const path of paths) assert.equal(new URL(addressOf(path)).origin, 'https://x.test', path);
  assert.equal(addressOf('/b/meta.json'), `https://x.test/b/meta.json${QUERY}`);
});
