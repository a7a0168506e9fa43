/** Headers of files on servers: with Range, without, and with servers that get it wrong. */
import assert from 'node:assert/strict';
import { createServer, type IncomingMessage, type Server, type ServerResponse } from 'node:http';
import type { AddressInfo } from 'node:net';
import { after, before, test } from 'node:test';
import { GaussianSplatError } from '@gaussian-splat/core';
import { bytesSource, openUrl, readOnnxHeader, type OnnxHeader } from '@gaussian-splat/core/onnx';
import { fixtureBytes } from '../support/generators.js';

const SMALL = fixtureBytes('packed.onnx');
/** 280 MB: the fixture with one large initializer between its nodes and its inputs. */
const LARGE_BYTES = 280_000_000;
const large = largeModel(LARGE_BYTES);

/** A protobuf file whose weights are zeros that are never held in memory. */
function largeModel(weights: number): { readonly size: number; slice(start: number, end: number): Uint8Array } {
  const varint = (value: number): number[] =>
    value < 128 ? [value] : [(value % 128) + 128, ...varint(Math.floor(value / 128))];
  const field = (number: number, payload: readonly number[]): number[] => [
    ...varint(number * 8 + 2),
    ...varint(payload.length),
    ...payload,
  ];
  const text = (number: number, value: string): number[] => field(number, [...new TextEncoder().encode(value)]);
  const dims = (...sizes: number[]): number[] => sizes.flatMap((size) => field(1, [8, ...varint(size)]));
  const value = (name: string, ...sizes: number[]): number[] => [
    ...text(1, name),
    ...field(2, field(1, [8, 1, ...field(2, dims(...sizes))])),
  ];
  const tensorHead = [...text(8, 'weights'), ...varint(9 * 8 + 2), ...varint(weights)];
  const inputs = [...field(11, value('time', 1)), ...field(12, value('gaussians', 5_384_615, 13))];
  const initializer = [...varint(5 * 8 + 2), ...varint(tensorHead.length + weights), ...tensorHead];
  const nodes = field(1, [...text(1, 'time'), ...text(2, 'gaussians'), ...text(4, 'Add')]);
  const graphSize = nodes.length + initializer.length + weights + inputs.length;
  const before = [8, 8, ...varint(7 * 8 + 2), ...varint(graphSize), ...nodes, ...initializer];
  const behind = [...inputs, ...field(8, [16, 17]), ...field(14, [...text(1, 'gaussian_contract'), ...text(2, '{}')])];
  const size = before.length + weights + behind.length;
  const byteAt = (at: number): number =>
    at < before.length ? before[at] : at >= size - behind.length ? behind[at - size + behind.length] : 0;
  return {
    size,
    slice: (start, end) => Uint8Array.from({ length: Math.min(end, size) - start }, (_, i) => byteAt(start + i)),
  };
}

type Route = (request: IncomingMessage, response: ServerResponse) => unknown;
type Content = { readonly size: number; slice(start: number, end: number): Uint8Array };
const inMemory = (bytes: Uint8Array): Content => ({
  size: bytes.length,
  slice: (start, end) => bytes.subarray(start, end),
});

function ranged(content: Content, { hideSize = false, lieAfter = Infinity } = {}): Route {
  let answers = 0;
  return (request, response) => {
    const [, first, last] = /bytes=(\d+)-(\d+)/.exec(request.headers.range ?? '') ?? [];
    const total = hideSize ? '*' : content.size;
    if (request.method === 'HEAD') return response.writeHead(200, { 'Content-Length': content.size }).end();
    if (first === undefined) return response.writeHead(200).end(content.slice(0, content.size));
    const start = Number(first);
    if (start >= content.size) return response.writeHead(416).end();
    const bytes = content.slice(start, Number(last) + 1);
    const lies = ++answers > lieAfter;
    const range = `bytes ${start}-${start + bytes.length - 1}/${lies ? 5 : total}`;
    return response.writeHead(206, { 'Content-Range': range, 'Content-Length': bytes.length }).end(bytes);
  };
}

const whole: Route = (_, response) => response.writeHead(200).end(SMALL);
const status =
  (code: number): Route =>
  (_, response) =>
    response.writeHead(code).end('no');
const ROUTES: Readonly<Record<string, Route>> = {
  '/large.onnx': ranged(large),
  '/large-hidden.onnx': ranged(large, { hideSize: true }),
  '/small.onnx': ranged(inMemory(SMALL)),
  '/changing.onnx': ranged(inMemory(SMALL), { lieAfter: 1 }),
  '/whole.onnx': whole,
  '/refusing.onnx': (request, response) => (request.headers.range ? status(416) : whole)(request, response),
  '/page.onnx': (_, response) => response.writeHead(200).end('<!doctype html><title>Not found</title>'),
  '/empty.onnx': (_, response) => response.writeHead(200).end(),
  '/private.onnx': status(403),
  '/endless.onnx': (_, response) => {
    const more = (): void => {
      while (!response.destroyed && response.write(new Uint8Array(65_536)));
    };
    response.writeHead(200).on('drain', more);
    more();
  },
  '/broken.onnx': (_, response) => {
    response.writeHead(200, { 'Content-Length': 5000 });
    response.write(SMALL.subarray(0, 1000), () => setTimeout(() => response.destroy(), 20));
  },
};

let server: Server;
let base: string;

before(async () => {
  server = createServer((request, response) => (ROUTES[request.url ?? ''] ?? status(404))(request, response));
  await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
  base = `http://127.0.0.1:${(server.address() as AddressInfo).port}`;
});

after(() => {
  server.closeAllConnections();
  server.close();
});

const expected = (): Promise<OnnxHeader> => readOnnxHeader(bytesSource(SMALL));
const sameFacts = (a: OnnxHeader, b: OnnxHeader): void => assert.deepEqual({ ...a, name: '' }, { ...b, name: '' });

test('280 MB take two requests and a few kilobytes', async (t) => {
  const source = await openUrl(`${base}/large.onnx`);
  const header = await readOnnxHeader(source);
  assert.equal(header.byteLength, large.size);
  assert.equal(header.metadata.get('gaussian_contract'), '{}');
  assert.deepEqual(header.outputs, [{ name: 'gaussians', dtype: 'float32', dims: [5_384_615, 13] }]);
  assert.equal(header.opsets.get('ai.onnx'), 17);
  assert.ok(header.initializerBytes > LARGE_BYTES);
  assert.equal(source.requests, 2);
  t.diagnostic(`${source.bytesReceived} bytes of ${large.size}`);
  assert.ok(source.bytesReceived < 70_000, `${source.bytesReceived} bytes`);
  assert.equal(source.whole, undefined);
});

test('a hidden Content-Range, as across origins, costs one request more', async () => {
  const source = await openUrl(`${base}/large-hidden.onnx`);
  assert.equal((await readOnnxHeader(source)).metadata.size, 1);
  assert.equal(source.requests, 3);
});

test('a file that fits into the first piece takes one request', async () => {
  const source = await openUrl(`${base}/small.onnx`);
  sameFacts(await readOnnxHeader(source), await expected());
  assert.equal(source.requests, 1);
});

test('after too many requests the file is fetched whole', async () => {
  const source = await openUrl(`${base}/small.onnx`, { chunk: 64, maxRequests: 3 });
  sameFacts(await readOnnxHeader(source), await expected());
  assert.deepEqual([source.requests, source.whole?.length], [4, SMALL.length]);
});

for (const [name, requests] of [
  ['whole', 1],
  ['refusing', 2],
] as const) {
  test(`a server without Range (${name}.onnx): the whole file, kept for the runtime`, async () => {
    const source = await openUrl(`${base}/${name}.onnx`);
    sameFacts(await readOnnxHeader(source), await expected());
    assert.equal(source.requests, requests);
    assert.deepEqual(source.whole, SMALL);
  });
}

test('a file that changes between two requests is fetched again as a whole', async () => {
  const source = await openUrl(`${base}/changing.onnx`, { chunk: 64 });
  sameFacts(await readOnnxHeader(source), await expected());
  assert.equal(source.whole?.length, SMALL.length);
});

for (const [path, code, message] of [
  ['/page.onnx', 'decode/html', /web page/],
  ['/empty.onnx', 'decode/unknown-format', /empty file/],
  ['/private.onnx', 'network/status', /403/],
  ['/missing.onnx', 'network/status', /404.*capital letters/],
  ['/broken.onnx', 'network/interrupted', /connection/],
] as const) {
  test(`${path}: ${code}`, async () => {
    const attempt = openUrl(base + path).then(readOnnxHeader);
    await assert.rejects(attempt, (error: unknown) => {
      assert.ok(error instanceof GaussianSplatError, String(error));
      assert.equal(error.code, code, error.message);
      assert.match(error.message, message);
      return true;
    });
  });
}

test('no server, no address, and a caller who gave up', async () => {
  const refused = (url: string, code: string): Promise<void> =>
    assert.rejects(openUrl(url), (error: unknown) => error instanceof GaussianSplatError && error.code === code);
  await refused('http://127.0.0.1:9/x.onnx', 'network/unreachable');
  await refused('x.onnx', 'network/url');
  await refused('http://user:secret@127.0.0.1:9/x.onnx', 'network/url');
  const aborted = openUrl(`${base}/small.onnx`, { signal: AbortSignal.abort(new Error('gave up')) });
  await assert.rejects(aborted, /gave up/);
});

test('a response beyond the limit is given up', async () => {
  const opening = openUrl(`${base}/endless.onnx`, { maxBytes: 1e6, signal: AbortSignal.timeout(10_000) });
  await assert.rejects(opening, { code: 'out-of-memory/budget' });
});
