import assert from 'node:assert/strict';
import { createServer, type RequestListener, type Server } from 'node:http';
import type { AddressInfo } from 'node:net';
import { gzipSync } from 'node:zlib';
import { after, before, test } from 'node:test';
import { GaussianSplatError } from '@gaussian-splat/core';
import { GrowingBytes } from '../../packages/formats/src/bytes.js';
import { fetchScene } from '@gaussian-splat/formats';
import { assertSameNumbers } from './support/expect.js';

const CONTENT = Uint8Array.from({ length: 300_000 }, (_, i) => (i * i) >> 7);

const ROUTES: Readonly<Record<string, RequestListener>> = {
  '/whole': (_, response) => response.writeHead(200, { 'Content-Length': CONTENT.length }).end(CONTENT),
  '/chunked': (_, response) => {
    response.writeHead(200);
    response.write(CONTENT.subarray(0, 1000));
    setTimeout(() => response.end(CONTENT.subarray(1000)), 20);
  },
  '/gzip': (_, response) => {
    const body = gzipSync(CONTENT);
    response.writeHead(200, { 'Content-Encoding': 'gzip', 'Content-Length': body.length }).end(body);
  },
  '/empty': (_, response) => response.writeHead(200, { 'Content-Length': 0 }).end(),
  '/broken': (_, response) => {
    response.writeHead(200, { 'Content-Length': CONTENT.length });
    response.write(CONTENT.subarray(0, 100_000), () => setTimeout(() => response.destroy(), 20));
  },
  '/endless': (_, response) => {
    response.writeHead(200, { 'Content-Length': CONTENT.length });
    response.write(CONTENT.subarray(0, 100_000));
  },
  // Breaks after every 70,000 bytes, and knows ranges.
  '/resumable': ranged('"a"'),
  // Breaks once, and knows no ranges.
  '/anew': (_, response) => {
    response.writeHead(200, { 'Content-Length': CONTENT.length });
    if (requests++ > 0) return void response.end(CONTENT);
    response.write(CONTENT.subarray(0, 100_000), () => setTimeout(() => response.destroy(), 20));
  },
  // Breaks before the first byte of its body, once.
  '/bodiless': (_, response) => {
    response.writeHead(200, { 'Content-Length': CONTENT.length }).flushHeaders();
    if (requests++ > 0) return void response.end(CONTENT);
    setTimeout(() => response.destroy(), 20);
  },
  // Breaks in a transfer of unknown length, once.
  '/unknown': (_, response) => {
    response.writeHead(200).write(CONTENT.subarray(0, 100_000));
    if (requests++ > 0) return void response.end(CONTENT.subarray(100_000));
    setTimeout(() => response.destroy(), 20);
  },
  // Breaks, and has no time for two requests.
  '/busy': (request, response) => {
    if (requests === 1 || requests === 2)
      return void (requests++, response.writeHead(requests === 2 ? 503 : 429).end());
    requests++;
    ranged('"b"')(request, response);
  },
  // Changes between two requests.
  '/changing': ranged(() => `"${requests++}"`),
  '/private': (_, response) => response.writeHead(403).end('no'),
  '/failing': (_, response) => response.writeHead(503).end(),
};

let requests = 0;

/** Answers ranges, and breaks every connection after 70,000 bytes. */
function ranged(tag: string | (() => string)): RequestListener {
  return (request, response) => {
    const from = Number(/^bytes=(\d+)-$/.exec(request.headers.range ?? '')?.[1] ?? 0);
    const rest = CONTENT.subarray(from);
    response.writeHead(from > 0 ? 206 : 200, {
      'Content-Length': rest.length,
      ETag: typeof tag === 'string' ? tag : tag(),
      ...(from > 0 && { 'Content-Range': `bytes ${from}-${CONTENT.length - 1}/${CONTENT.length}` }),
    });
    if (rest.length <= 70_000) return void response.end(rest);
    response.write(rest.subarray(0, 70_000), () => setTimeout(() => response.destroy(), 20));
  };
}

let server: Server;
let base: string;

before(async () => {
  server = createServer((request, response) => {
    const route = ROUTES[request.url ?? ''] ?? ((_, response) => response.writeHead(404).end('not here'));
    route(request, response);
  });
  await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
  base = `http://127.0.0.1:${(server.address() as AddressInfo).port}`;
});

after(() => {
  server.closeAllConnections();
  server.close();
});

/** Downloads and returns the content with the progress that was reported. */
async function download(url: string): Promise<{ bytes: Uint8Array; progress: [number, number | undefined][] }> {
  const progress: [number, number | undefined][] = [];
  const bytes = await fetchScene(url, { onProgress: (loaded, total) => progress.push([loaded, total]) });
  return { bytes, progress };
}

async function expectFailure(url: string, code: string, message: RegExp): Promise<void> {
  await assert.rejects(fetchScene(url), (error: unknown) => {
    assert.ok(error instanceof GaussianSplatError, String(error));
    assert.equal(error.code, code);
    assert.match(error.message, message);
    return true;
  });
}

test('a file of known length: progress ends at the total', async () => {
  const { bytes, progress } = await download(`${base}/whole`);
  assertSameNumbers(bytes, CONTENT);
  assert.deepEqual(progress.at(-1), [CONTENT.length, CONTENT.length]);
  progress.forEach(([loaded, total], k) => {
    assert.equal(total, CONTENT.length);
    assert.ok(loaded > (progress[k - 1]?.[0] ?? 0), `${loaded} is progress`);
  });
});

test('without a length, or with that of a compressed transfer, the total is unknown', async () => {
  for (const path of ['/chunked', '/gzip']) {
    const { bytes, progress } = await download(`${base}${path}`);
    assertSameNumbers(bytes, CONTENT, path);
    assert.equal(progress.at(-1)?.[0], CONTENT.length);
    for (const [, total] of progress) assert.equal(total, undefined, path);
  }
});

test('an empty file, a URL object and a data: URL', async () => {
  assert.equal((await fetchScene(`${base}/empty`)).length, 0);
  assert.equal((await fetchScene(new URL(`${base}/whole`))).length, CONTENT.length);
  assert.deepEqual(await fetchScene('data:;base64,AQID'), Uint8Array.of(1, 2, 3));
});

test('HTTP errors say the status, the address and what to do', async () => {
  await expectFailure(`${base}/missing.ply`, 'network/status', /missing\.ply: .*404 \(Not Found\)\. Check the path/);
  await expectFailure(`${base}/private`, 'network/status', /403 .*public read access/);
  await expectFailure(`${base}/failing`, 'network/status', /503 .*Try again later/);
});

test('no server, and text that is no URL', async () => {
  await expectFailure(
    'http://127.0.0.1:1/scene.ply',
    'network/unreachable',
    /127\.0\.0\.1:1.*Access-Control-Allow-Origin/,
  );
  await expectFailure('http://[', 'network/url', /address "http:\/\/\[".*absolute URL/);
  await expectFailure('scene.ply', 'network/url', /expected an absolute URL/);
});

test('a connection that breaks says how much came', async () => {
  await expectFailure(`${base}/broken`, 'network/interrupted', /byte 100,000: expected 300,000 bytes/);
});

test('a connection that breaks is taken up where it stopped', async () => {
  const seen: number[] = [];
  const options = { retries: 4, onArrival: (bytes: Uint8Array) => void seen.push(bytes.length) };
  assertSameNumbers(await fetchScene(`${base}/resumable`, options), CONTENT);
  assert.ok(
    seen.every((length, k) => length > (seen[k - 1] ?? 0)),
    'bytes only ever become more',
  );
  // Four breaks: what gets farther each time is not given up.
  assertSameNumbers(await fetchScene(`${base}/resumable`, { retries: 1 }), CONTENT);
  await assert.rejects(fetchScene(`${base}/resumable`, { retries: 0 }), /network\/interrupted/);
});

for (const [route, what] of [
  ['bodiless', 'before the first byte'],
  ['unknown', 'in a transfer of unknown length'],
  ['busy', 'to a server that then has no time for a while'],
]) {
  test(`a connection that breaks ${what} is taken up again`, async () => {
    requests = 0;
    assertSameNumbers(await fetchScene(`${base}/${route}`), CONTENT);
    requests = 0;
    await assert.rejects(fetchScene(`${base}/${route}`, { retries: 0 }), /network\/interrupted/);
  });
}

test('an outage of a second, and one that does not end', async (context) => {
  const { fetch } = globalThis;
  let downUntil = Infinity;
  context.mock.method(globalThis, 'fetch', async (...given: Parameters<typeof fetch>) => {
    if (requests++ > 0 && performance.now() < downUntil) throw new TypeError('fetch failed');
    return fetch(...given);
  });
  requests = 0;
  downUntil = performance.now() + 1000;
  assertSameNumbers(await fetchScene(`${base}/resumable`), CONTENT);
  requests = 0;
  downUntil = Infinity;
  await expectFailure(`${base}/resumable`, 'network/interrupted', /byte 70,000: expected 300,000 bytes/);
  assert.equal(requests, 4, 'the first, and three without a response');
});

test('a connection on which nothing comes for half a minute counts as broken', async (context) => {
  context.mock.timers.enable({ apis: ['setTimeout'] });
  let pulls = 0;
  context.mock.method(globalThis, 'fetch', async (_: URL, { headers = {} }: RequestInit = {}) => {
    const from = Number(/=(\d+)-/.exec((headers as Record<string, string>).Range ?? '')?.[1] ?? 0);
    const body = new ReadableStream({
      pull: (stream) => {
        pulls++;
        if (from > 0) stream.enqueue(CONTENT.slice(from));
        if (from > 0) return stream.close();
        if (pulls === 1) stream.enqueue(CONTENT.slice(0, 2_000));
        return new Promise(() => undefined);
      },
    });
    const range = { 'Content-Range': `bytes ${from}-${CONTENT.length - 1}/${CONTENT.length}` };
    const length = { 'Content-Length': String(CONTENT.length - from), ETag: '"a"' };
    return new Response(body, { status: from > 0 ? 206 : 200, headers: { ...length, ...(from > 0 && range) } });
  });
  const fetched = fetchScene('http://host/a.ply');
  for (const ms of [29_000, 1_000, 250]) {
    await new Promise((resolve) => setImmediate(resolve));
    context.mock.timers.tick(ms);
  }
  for (let k = 0; k < 20; k++) await new Promise((resolve) => setImmediate(resolve));
  context.mock.timers.tick(250);
  assertSameNumbers(await fetched, CONTENT);
});

test('a connection that breaks to a server without ranges is started again, as long as it makes progress', async () => {
  requests = 0;
  assertSameNumbers(await fetchScene(`${base}/anew`), CONTENT);
  assert.equal(requests, 2);
  requests = 0;
  await assert.rejects(fetchScene(`${base}/anew`, { retries: 0 }), /network\/interrupted/);
});

test('a file that has changed meanwhile is not patched together', async () => {
  await expectFailure(
    `${base}/changing`,
    'network/interrupted',
    /300,000 bytes, found the end of the connection after/,
  );
});

test('if the HTTP stack hides a break, the length shows it', async (context) => {
  const short = () => new Response(CONTENT.slice(0, 10), { headers: { 'Content-Length': '20' } });
  context.mock.method(globalThis, 'fetch', async () => short());
  await expectFailure(
    'http://host/a.ply',
    'network/interrupted',
    /byte 10: expected 20 bytes, found the end .* after 10/,
  );
});

test('a body longer than announced has an unknown total from there on', async (context) => {
  const long = () => new Response(CONTENT.slice(0, 30), { headers: { 'Content-Length': '20' } });
  context.mock.method(globalThis, 'fetch', async () => long());
  const { bytes, progress } = await download('http://host/a.ply');
  assert.deepEqual([bytes.length, progress.at(-1)], [30, [30, undefined]]);
});

test('addresses with a password are refused without repeating it', async () => {
  await assert.rejects(fetchScene('http://me:secret@127.0.0.1:1/a.ply'), (error: unknown) => {
    assert.ok(error instanceof GaussianSplatError);
    assert.equal(error.code, 'network/url');
    assert.match(error.message, /127\.0\.0\.1:1\/a\.ply.*user name or password/);
    assert.ok(!error.message.includes('secret'), 'no password in the message');
    return true;
  });
});

test('aborting before, while waiting and while reading rejects with AbortError', async () => {
  await assert.rejects(fetchScene(`${base}/whole`, { signal: AbortSignal.abort() }), { name: 'AbortError' });
  const controller = new AbortController();
  const reading = fetchScene(`${base}/endless`, { signal: controller.signal, onProgress: () => controller.abort() });
  await assert.rejects(reading, (error: unknown) => error instanceof DOMException && error.name === 'AbortError');
});

test('a reason of the caller passes through', async () => {
  const reason = new Error('the element was removed');
  await assert.rejects(fetchScene(`${base}/whole`, { signal: AbortSignal.abort(reason) }), reason);
});

test('a large file of known length takes its own size of memory, and any length may be wrong', () => {
  const known = new GrowingBytes(300e6);
  known.append(new Uint8Array(2 ** 28));
  known.append(new Uint8Array(1000).fill(7));
  assert.deepEqual(
    [known.view().buffer.byteLength, known.length, known.view()[2 ** 28 + 999]],
    [300e6, 2 ** 28 + 1000, 7],
  );
  for (const expected of [0, 5, 1e15]) {
    const wrong = new GrowingBytes(expected);
    for (let k = 0; k < 100; k++) wrong.append(Uint8Array.of(k, k));
    assert.deepEqual(
      Array.from(wrong.view()),
      Array.from({ length: 200 }, (_, k) => k >> 1),
    );
  }
});
