/** Servers close connections that were kept: the request that meets a closed one is sent again, as browsers do (RFC 9112, 9.3.1). */
import assert from 'node:assert/strict';
import { createServer } from 'node:http';
import type { AddressInfo, Socket } from 'node:net';
import { test } from 'node:test';
import { openUrl, readOnnxHeader } from '@gaussian-splat/core/onnx';
import { fetchRange, fetchScene } from '@gaussian-splat/formats';
import { fetchBytes } from '../../packages/generator/src/runtime/fetch-bytes.js';
import { fixtureBytes } from '../support/generators.js';

const file = fixtureBytes('packed.onnx');

/** @returns How many requests met a closed connection, and how many were answered. */
async function served(requestsEach: number, run: (url: string) => Promise<unknown>) {
  const uses = new WeakMap<Socket, number>();
  const counts = { closed: 0, answered: 0 };
  const server = createServer((request, response) => {
    const { socket } = request;
    const use = (uses.get(socket) ?? 0) + 1;
    uses.set(socket, use);
    if (use > requestsEach) {
      counts.closed++;
      socket.resetAndDestroy();
      return;
    }
    counts.answered++;
    const [, first, last] = /bytes=(\d+)-(\d+)/.exec(request.headers.range ?? '') ?? [];
    if (first === undefined) return void response.end(file);
    const part = file.subarray(Number(first), Number(last) + 1);
    response.writeHead(206, { 'Content-Range': `bytes ${first}-${Number(first) + part.length - 1}/${file.length}` });
    response.end(part);
  });
  await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
  try {
    await run(`http://127.0.0.1:${(server.address() as AddressInfo).port}/a.onnx`);
  } finally {
    server.closeAllConnections();
    server.close();
  }
  return counts;
}

const TIMES = 4;

for (const [name, load] of [
  ['a whole file', async (url) => assert.deepEqual(await fetchScene(url), file)],
  ['a range', async (url) => assert.equal((await fetchRange(url, 8, 40, { retries: 0 })).bytes.length, 32)],
  ['a file of a model', async (url) => assert.deepEqual(await fetchBytes(url), file)],
  ['the header of a model', async (url) => void (await readOnnxHeader(await openUrl(url)))],
] as readonly [string, (url: string) => Promise<void>][])
  test(`${name} is requested again when the kept connection was closed`, async () => {
    const { closed, answered } = await served(1, async (url) => {
      for (let k = 0; k < TIMES; k++) await load(url);
    });
    assert.ok(closed > 0, 'no connection was kept');
    assert.ok(answered >= TIMES && closed <= answered, `${closed} closed, ${answered} answered`);
  });

test('a server that closes every connection is asked three times, and named', async () => {
  const counts = await served(0, (url) => assert.rejects(fetchScene(url, { retries: 0 }), /network\/unreachable/));
  assert.deepEqual(counts, { closed: 3, answered: 0 });
});
