/**
 * Which servers manifests may name files on: SECURITY.md has the rule.
 * SECURITY.md: "Manifests name files of their own server".
 */
import assert from 'node:assert/strict';
import { createServer, type IncomingHttpHeaders, type Server, type ServerResponse } from 'node:http';
import type { AddressInfo } from 'node:net';
import { test } from 'node:test';
import { GaussianSplatError } from '@gaussian-splat/core';
import { fileRequest } from '@gaussian-splat/core/fetch';
import { fetchRange, fetchScene, fileOpenerFor, readScene } from '@gaussian-splat/formats';
import { smallCloud } from './support/small-cloud.js';
import { writeSog } from './support/sog-writer.js';

const manifest = { url: 'https://x.test/a/scene.json?v=1', credentials: 'include' } as const;

test('files beside a manifest are asked for as it was', () => {
  const cases: [path: string, url: string][] = [
    ['b.spz', 'https://x.test/a/b.spz?v=1'],
    ['../b c.spz', 'https://x.test/b%20c.spz?v=1'],
    ['/b.spz?c', 'https://x.test/b.spz?c'],
    ['https://x.test/b.spz', 'https://x.test/b.spz?v=1'],
    ['//x.test/b.spz?c', 'https://x.test/b.spz?c'],
  ];
  for (const [path, url] of cases) assert.deepEqual(fileRequest(path, manifest), { url, credentials: 'include' });
});

test('other servers are refused, unless the page allows them; they get no cookies', () => {
  const others = [
    'https://y.test/b',
    '//y.test/b',
    '/\\\\y.test/b',
    '\t//y.test/b',
    'http://x.test/b',
    'https://x.test:444/b',
  ];
  const foreign = ['data:,b', 'javascript:alert(1)', 'file:///etc/passwd', 'blob:https://y.test/1-2', 'blob:x'];
  for (const path of [...others, ...foreign]) {
    assert.throws(
      () => fileRequest(path, manifest),
      /x\.test.*or on servers that the page allows.*decode\/unsupported/,
      path,
    );
  }
  const allowed = fileRequest('//y.test/b', manifest, ['https://y.test']);
  assert.deepEqual(allowed, { url: 'https://y.test/b', credentials: 'omit' });
  assert.throws(() => fileRequest('https://y.test.z/b', manifest, ['https://y.test']), GaussianSplatError);
});

test('a manifest that is a file of the page names whole addresses of its server', () => {
  const own = { url: 'blob:https://x.test/1-2', credentials: 'same-origin' } as const;
  assert.equal(fileRequest('https://x.test/b.spz', own).url, 'https://x.test/b.spz');
  for (const path of ['b.spz', 'https://y.test/b.spz'])
    assert.throws(() => fileRequest(path, own), /serve the manifest/i);
  const local = { url: 'file:///a/scene.json', credentials: 'omit' } as const;
  assert.equal(fileRequest('b.spz', local).url, 'file:///a/b.spz');
  assert.throws(() => fileRequest('https://x.test/b.spz', local), GaussianSplatError);
});

interface Served {
  readonly origin: string;
  /** Addresses and headers of all requests. */
  readonly log: { readonly url: string; readonly headers: IncomingHttpHeaders }[];
}

/** Runs servers, which know all of them, for the time of a test. */
async function serving(
  answers: readonly ((path: string, response: ServerResponse, all: readonly Served[]) => void)[],
  run: (...all: Served[]) => Promise<void>,
): Promise<void> {
  const all: Served[] = [];
  const servers: Server[] = [];
  for (const answer of answers) {
    const log: Served['log'] = [];
    const server = createServer(({ url, headers }, response) => {
      log.push({ url: url!, headers });
      answer(new URL(url!, 'http://a').pathname, response, all);
    });
    await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
    all.push({ origin: `http://127.0.0.1:${(server.address() as AddressInfo).port}`, log });
    servers.push(server);
  }
  try {
    await run(...all);
  } finally {
    for (const server of servers) {
      server.closeAllConnections();
      server.close();
    }
  }
}

const redirect = (response: ServerResponse, location: string): void =>
  void response.writeHead(302, { Location: location }).end();

test('a redirect is the answer of the server that was asked: it moves neither later requests nor the signature', async () => {
  const files = new Map(Object.entries(writeSog(smallCloud(40, 1))));
  // As hosts with separate storage do: within the host first, then to the storage.
  await serving(
    [
      (path, response, [, storage]) =>
        path.startsWith('/moved/')
          ? redirect(response, `${storage.origin}${path.slice('/moved'.length)}`)
          : redirect(response, `/moved${path.slice('/scene'.length)}`),
      (path, response) => void response.writeHead(files.has(path.slice(1)) ? 200 : 404).end(files.get(path.slice(1))),
    ],
    async (host, storage) => {
      const url = `${host.origin}/scene/meta.json?signed=a`;
      const bytes = await fetchScene(url);
      const { count } = await readScene(bytes, { name: 'meta.json', openFile: fileOpenerFor(url, () => ({})) });
      assert.equal(count, 40);
      const names = [...files.keys()].sort();
      const asked = ({ log }: Served): string[] => log.map((request) => request.url).sort();
      assert.deepEqual(
        asked(host).filter((path) => path.startsWith('/scene/')),
        names.map((name) => `/scene/${name}?signed=a`),
      );
      assert.deepEqual(
        asked(storage),
        names.map((name) => `/${name}`),
      );
      const range = await fetchRange(`${host.origin}/scene/meta.json`, 0, 9);
      assert.deepEqual([...range.bytes], [...files.get('meta.json')!.subarray(0, 9)]);
    },
  );
});

test('a download that breaks behind a redirect resumes, without headers that the other server would have to allow', async () => {
  const content = Uint8Array.from({ length: 200_000 }, (_, i) => (i * i) >> 7);
  await serving(
    [
      (_, response, [, storage]) => redirect(response, `${storage.origin}/a.bin`),
      (_, response, [, { log }]) => {
        const { length } = content;
        const from = Number(/^bytes=(\d+)-$/.exec(log.at(-1)!.headers.range ?? '')?.[1] ?? 0);
        if (from > 0)
          return void response
            .writeHead(206, { ETag: '"a"', 'Content-Range': `bytes ${from}-${length - 1}/${length}` })
            .end(content.subarray(from));
        response.writeHead(200, { ETag: '"a"', 'Content-Length': length });
        response.write(content.subarray(0, length / 2), () => setImmediate(() => response.destroy()));
      },
    ],
    async (host, storage) => {
      const found = await fetchScene(`${host.origin}/a.bin`);
      assert.equal(Buffer.compare(found, content), 0);
      assert.deepEqual(
        storage.log.map(({ headers }) => [headers.range !== undefined, headers['if-range']]),
        [
          [false, undefined],
          [true, undefined],
        ],
      );
    },
  );
});
