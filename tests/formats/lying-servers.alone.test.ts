/**
 * Servers that are slow, silent, broken or lie: a download ends with the right bytes or a named error, in bounded time and with a bounded number of requests, and never with two files in one.
 * SECURITY.md: "Downloads end", "Files that change are not mixed".
 */
import assert from 'node:assert/strict';
import { createServer, type IncomingMessage, type ServerResponse } from 'node:http';
import type { AddressInfo } from 'node:net';
import { after, before, beforeEach, mock, test } from 'node:test';
import { gzipSync } from 'node:zlib';
import { GaussianSplatError } from '@gaussian-splat/core';
import { openUrl } from '@gaussian-splat/core/onnx';
import { fetchRange, fetchScene, type FetchSceneOptions } from '@gaussian-splat/formats';
import { fetchBytes } from '../../packages/generator/src/runtime/fetch-bytes.js';
import { someOf } from '../support/extent.js';

const CONTENT = Uint8Array.from({ length: 300_000 }, (_, i) => (i * i) >> 7);
const OTHER = CONTENT.map((byte) => byte ^ 1);
const BREAK = 100_000;
/** Factor by which waiting is shorter here. */
const HASTE = 12;
const MAX_BYTES = 2_000_000;

type Answer = (response: ServerResponse, from: number, request: IncomingMessage) => void;

let requests = 0;

const whole = (response: ServerResponse, headers = {}): void =>
  void response.writeHead(200, { 'Content-Length': CONTENT.length, ...headers }).end(CONTENT);

/** The first bytes, and then the connection breaks. */
function broken(response: ServerResponse, headers: object = { ETag: '"a"' }, bytes = BREAK): void {
  response.writeHead(200, { 'Content-Length': CONTENT.length, ...headers });
  response.write(CONTENT.subarray(0, bytes), () => setImmediate(() => response.destroy()));
}

/** Breaks the connection, and answers later requests in its own way. */
const then =
  (answer: (response: ServerResponse, from: number) => void, headers?: object): Answer =>
  (response, from) =>
    requests === 1 ? broken(response, headers) : answer(response, from);

const part = (response: ServerResponse, from: number, content: Uint8Array, headers: object = { ETag: '"a"' }): void => {
  const range = `bytes ${from}-${CONTENT.length - 1}/${CONTENT.length}`;
  const rest = content.subarray(from);
  response.writeHead(206, { 'Content-Length': rest.length, 'Content-Range': range, ...headers }).end(rest);
};

/** The requested range, or the whole file without a range. */
const partOr =
  (answer: (response: ServerResponse, from: number) => void) =>
  (response: ServerResponse, from: number): void =>
    from > 0 ? answer(response, from) : whole(response);

const silence = (response: ServerResponse, bytes: number): void => {
  response.writeHead(200, { 'Content-Length': CONTENT.length });
  response.write(CONTENT.subarray(0, bytes));
};

/** Made beforehand: while this process does, the server and its clock stand still. */
const BOMB = gzipSync(new Uint8Array(2e7));

/** `right`, or the code of the error. */
const SERVERS: Readonly<Record<string, [outcome: string, answer: Answer]>> = {
  'the whole file': ['right', (response) => whole(response)],
  'no length': ['right', (response) => void response.writeHead(200).end(CONTENT)],
  'gzip with a length': [
    'right',
    (response) => void response.writeHead(200, { 'Content-Encoding': 'gzip' }).end(gzipSync(CONTENT)),
  ],
  'no answer': ['network/unreachable', () => undefined],
  'headers, then silence': ['network/interrupted', (response) => void (silence(response, 0), response.flushHeaders())],
  'a part, then silence': ['network/interrupted', (response) => silence(response, BREAK)],
  'a byte at a time': [
    'network/interrupted',
    (response) => {
      silence(response, 1);
      const timer = setInterval(() => response.write(new Uint8Array(1)), 20);
      response.on('close', () => clearInterval(timer));
    },
  ],
  'a byte a connection': [
    'network/interrupted',
    (response, from) => {
      const end = Math.max(from, requests) + 1;
      if (from === 0) return broken(response, { ETag: '"a"' }, 2000 + requests);
      response.writeHead(206, {
        ...{ ETag: '"a"', 'Content-Range': `bytes ${from}-${CONTENT.length - 1}/${CONTENT.length}` },
        'Content-Length': CONTENT.length - from,
      });
      response.write(CONTENT.subarray(from, end + 1025), () => setImmediate(() => response.destroy()));
    },
  ],
  'a body without end': [
    'out-of-memory/budget',
    (response) => {
      response.writeHead(200);
      const more = (): void => void (response.destroyed || response.write(CONTENT, () => setImmediate(more)));
      more();
    },
  ],
  'a length beyond the limit': [
    'out-of-memory/budget',
    (response) => void response.writeHead(200, { 'Content-Length': 1e15 }).write(CONTENT),
  ],
  'a bomb of gzip': [
    'out-of-memory/budget',
    (response) => void response.writeHead(200, { 'Content-Encoding': 'gzip' }).end(BOMB),
  ],
  'gzip that is none': [
    'network/interrupted',
    (response) => void response.writeHead(200, { 'Content-Encoding': 'gzip' }).end(CONTENT),
  ],
  'a length that is too long': [
    'network/interrupted',
    (response) => {
      response.writeHead(200, { 'Content-Length': CONTENT.length + 1 });
      response.write(CONTENT, () => response.destroy());
    },
  ],
  'a break, and the rest': ['right', then((response, from) => part(response, from, CONTENT))],
  'a break, and the rest under a weak tag': [
    'right',
    then((response, from) => part(response, from, CONTENT, { ETag: 'W/"a"' }), { ETag: 'W/"a"' }),
  ],
  'a break, and a date for a tag': [
    'right',
    then((response, from) => part(response, from, CONTENT, { 'Last-Modified': 'then' }), { 'Last-Modified': 'then' }),
  ],
  'a break, and all again': ['right', then((response) => whole(response))],
  'a break, and the rest of another file under the same tag': [
    'right',
    then(partOr((response, from) => part(response, from, OTHER))),
  ],
  'a break, and the rest of another file under another tag': [
    'right',
    then(partOr((response, from) => part(response, from, OTHER, { ETag: '"b"' }))),
  ],
  'a break, and the rest of another file without tags': [
    'right',
    then(
      partOr((response, from) => part(response, from, OTHER, {})),
      {},
    ),
  ],
  'a break, and a part from elsewhere': ['right', then(partOr((response, from) => part(response, from + 5, CONTENT)))],
  'a break, and a part of garbage': [
    'right',
    then(partOr((response) => void response.writeHead(206, { ETag: '"a"', 'Content-Range': 'x' }).end('garbage'))),
  ],
  'a break, and the rest of a file of another length': [
    'right',
    then(
      partOr((response, from) => {
        const range = `bytes ${from}-${CONTENT.length + 4999}/${CONTENT.length + 5000}`;
        const rest = Buffer.concat([CONTENT.subarray(from), new Uint8Array(5000)]);
        response.writeHead(206, { ETag: '"a"', 'Content-Length': rest.length, 'Content-Range': range }).end(rest);
      }),
    ),
  ],
  'a break, and less than the rest': [
    'network/interrupted',
    then((response, from) => {
      const range = `bytes ${from}-${CONTENT.length - 1}/${CONTENT.length}`;
      response.writeHead(206, { ETag: '"a"', 'Content-Range': range }).end(CONTENT.subarray(from, from + 500));
    }),
  ],
  'a break, and an empty part': ['right', then(partOr((response) => void response.writeHead(206).end()))],
  'a break, and no such part': ['right', then(partOr((response) => void response.writeHead(416).end()))],
  'a break, and 503 for ever': ['network/interrupted', then((response) => void response.writeHead(503).end())],
  'a break, and silence': ['network/interrupted', then(() => undefined)],
  '429 twice': ['right', (response) => (requests < 3 ? void response.writeHead(429).end() : whole(response))],
  '429 for ever': ['network/status', (response) => void response.writeHead(429, { 'Retry-After': '9999' }).end()],
  '503 for ever': ['network/status', (response) => void response.writeHead(503).end()],
  'an unexpected part': [
    'network/status',
    (response) =>
      void response
        .writeHead(206, { 'Content-Range': `bytes 0-${BREAK - 1}/${CONTENT.length}` })
        .end(CONTENT.subarray(0, BREAK)),
  ],
  'nothing, and status 204': ['network/status', (response) => void response.writeHead(204).end()],
  'status 404': ['network/status', (response) => void response.writeHead(404).end('<html>')],
  'status 500': ['network/status', (response) => void response.writeHead(500).end()],
  'a redirect to itself': [
    'network/unreachable',
    (response, _, request) => void response.writeHead(302, { Location: request.url }).end(),
  ],
  'a redirect to data': [
    'network/unreachable',
    (response) => void response.writeHead(302, { Location: 'data:,a' }).end(),
  ],
  'another protocol': ['network/unreachable', (response) => void response.socket?.end('SSH-2.0-x\r\n')],
};

const names = Object.keys(SERVERS);
const server = createServer((request, response) => {
  const [, ofTest, name] = (request.url ?? '').split('/').map(Number);
  // A request that an earlier test gave up may arrive after that test.
  if (ofTest === testNumber) requests++;
  const from = Number(/^bytes=(\d+)-$/.exec(request.headers.range ?? '')?.[1] ?? 0);
  SERVERS[names[name]][1](response, from, request);
});
let origin = '';
let testNumber = 0;

/** The address of a server in `SERVERS`, of its own in each test. */
const address = (k: number): string => `${origin}/${testNumber}/${k}`;

before(async () => {
  await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
  origin = `http://127.0.0.1:${(server.address() as AddressInfo).port}`;
  const { setTimeout } = globalThis;
  const now = performance.now.bind(performance);
  mock.method(globalThis, 'setTimeout', (work: (...given: unknown[]) => void, ms = 0, ...given: unknown[]) =>
    setTimeout(work, ms / HASTE, ...given),
  );
  mock.method(performance, 'now', () => now() * HASTE);
});

beforeEach(() => {
  testNumber++;
  requests = 0;
});

after(() => {
  server.closeAllConnections();
  server.close();
});

/** Every other server; all of them in the laboratory. */
for (const name of someOf(names, Math.ceil(names.length / 2))) {
  const k = names.indexOf(name);
  const [outcome] = SERVERS[name];
  test(`${name}: ${outcome}`, { timeout: 500_000 }, async () => {
    const start = performance.now();
    const options: FetchSceneOptions = { maxBytes: MAX_BYTES };
    const found = await fetchScene(address(k), options).then(
      (bytes) => (Buffer.compare(bytes, CONTENT) === 0 ? 'right' : `${bytes.length} other bytes`),
      (error: unknown) => (error instanceof GaussianSplatError ? error.code : `unnamed: ${String(error)}`),
    );
    assert.equal(found, outcome);
    // Silence is borne four times for 30 s, with pauses of 1.75 s between; a machine that is busy counts as well.
    const took = performance.now() - start;
    assert.ok(took < 400_000, `${Math.round(took)} ms`);
    assert.ok(requests <= 25, `${requests} requests`);
  });
}

/** Asks a server for a range of bytes. The answer is a function of the number of the request. */
async function rangeFrom(
  answer: (response: ServerResponse, request: number) => void,
  tag?: string,
): Promise<{ found: string; requests: number; tag?: string | undefined }> {
  let asked = 0;
  const server = createServer((_, response) => answer(response, ++asked)).listen(0);
  const { port } = server.address() as AddressInfo;
  const found = await fetchRange(`http://localhost:${port}/a`, 0, 9, { tag }).then(
    (range) => ({ found: `${range.bytes.length} bytes`, tag: range.tag }),
    (error: GaussianSplatError) => ({ found: `${error.code}: ${error.found}` }),
  );
  server.closeAllConnections();
  server.close();
  return { ...found, requests: asked };
}
const nine = (response: ServerResponse, headers: object): void =>
  void response.writeHead(206, { 'Content-Range': 'bytes 0-8/20', ...headers }).end(CONTENT.subarray(0, 9));

test('ranges of two versions of a file are not mixed', async () => {
  const known = await rangeFrom((response) => nine(response, { ETag: '"a"', 'Last-Modified': 'Monday' }));
  assert.deepEqual(known, { found: '9 bytes', tag: '"a"', requests: 1 });
  assert.equal((await rangeFrom((response) => nine(response, { 'Last-Modified': 'Monday' }))).tag, 'Monday');
  const [same, other, none] = await Promise.all(
    ['"a"', '"b"', undefined].map((tag) => rangeFrom((response) => nine(response, tag ? { ETag: tag } : {}), '"a"')),
  );
  assert.equal(same.found, '9 bytes');
  assert.deepEqual(other, { found: 'network/changed: another version ("b")', requests: 1 });
  assert.equal(none.found, '9 bytes', 'a header that pages cannot read is no other version');
});

test('a short answer that does not say its range is asked for again', async () => {
  const { found, requests: asked } = await rangeFrom((response, request) => {
    response.writeHead(206, { 'Content-Length': 9 });
    if (request > 1) response.end(CONTENT.subarray(0, 9));
    else response.write(CONTENT.subarray(0, 5), () => setImmediate(() => response.destroy()));
  });
  assert.deepEqual([found, asked], ['9 bytes', 2]);
});

test('a time limit ends what is slow', async () => {
  const silent = address(names.indexOf('headers, then silence'));
  const limits = { maxSeconds: 0.2 };
  for (const fetched of [() => fetchScene(silent, limits), () => fetchRange(silent, 0, 9, limits)])
    await assert.rejects(fetched, /at most 0\.2 s, found more.*out-of-memory\/budget/);
});

test('memory that cannot be had is no broken connection', async () => {
  const onArrival = (): void => void new Uint8Array(2 ** 53);
  await assert.rejects(fetchScene(address(0), { onArrival }), /out-of-memory\/allocation/);
  assert.equal(requests, 1);
});

/** All downloads of the product besides those of scenes. */
const OTHERS: Readonly<Record<string, (url: string) => Promise<unknown>>> = {
  'headers of models': (url) => openUrl(url),
  'models, weights and the WebAssembly of the runtime': (url) => fetchBytes(url, { onProgress: () => undefined }),
  'contracts beside models': (url) => fetchBytes(url),
};

for (const [what, open] of Object.entries(OTHERS))
  test(`servers that never answer, stop or drip end ${what}, too`, { timeout: 500_000 }, async () => {
    const cases = someOf(['headers, then silence', 'no answer', 'a byte at a time', 'a part, then silence'], 2);
    const tried = cases.map(async (name) => {
      const k = names.indexOf(name);
      assert.ok(k >= 0, name);
      const found = await open(address(k)).then(
        () => 'right',
        (error: unknown) => (error instanceof GaussianSplatError ? error.code : `unnamed: ${String(error)}`),
      );
      assert.match(found, /^network\/(interrupted|unreachable)$/, name);
    });
    // Each of them mostly waits.
    await Promise.all(tried);
  });
