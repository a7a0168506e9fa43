/**
 * A streamed SOG costs no more than its bytes allow: one account for all files, and a message to the page that is as long as the index.
 * SECURITY.md: "The size of a file bounds its cost".
 */
import assert from 'node:assert/strict';
import { createServer, type Server } from 'node:http';
import type { AddressInfo } from 'node:net';
import { after, before, test } from 'node:test';
import { serialize } from 'node:v8';
import { strToU8, zipSync } from 'fflate';
import { LoadBudget, SogFiles } from '@gaussian-splat/formats';
import { openBoxes } from '../support/element/loading.js';
import { smallCloud } from '../formats/support/small-cloud.js';
import { writeSog } from '../formats/support/sog-writer.js';
import { writeWebp } from '../formats/support/webp-writer.js';

const SPLATS = 400;
const files = new Map<string, Uint8Array>();
let server: Server;
let base: string;

before(async () => {
  files.set('part.sog', zipSync(writeSog(smallCloud(SPLATS, 0))));
  server = createServer((request, response) => {
    const path = decodeURIComponent(new URL(request.url!, 'http://a').pathname);
    const bytes = files.get(path.split('/').at(-1)!);
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

const bound = { min: [0, 0, 0], max: [1, 1, 1] };

async function open(folder: string, filenames: readonly string[], boxes: number, levels = 1) {
  const lods = (k: number): object =>
    Object.fromEntries(
      Array.from({ length: levels }, (_, level) => [level, { file: k % filenames.length, offset: 0, count: 1 }]),
    );
  const tree = { bound, children: Array.from({ length: boxes }, (_, k) => ({ bound, lods: lods(k) })) };
  const index = strToU8(JSON.stringify({ version: 1, lodLevels: levels, filenames, tree }));
  files.set(`lod-meta.json`, index);
  const request = { url: `${base}/${folder}/lod-meta.json`, credentials: 'omit', sh: 'auto' } as const;
  const start = process.cpuUsage();
  const answer = await openBoxes(request, new AbortController().signal, { onProgress: () => undefined }).catch(
    (error: { code: string }) => error.code,
  );
  const { user, system } = process.cpuUsage(start);
  return { answer, bytes: index.length, cpuMs: (user + system) / 1000 };
}

/** The message to the page besides the splats, which are transferred. */
const messageBytes = (answer: Exclude<Awaited<ReturnType<typeof open>>['answer'], string>): number =>
  serialize({ ...answer, levels: { ...answer.levels, first: undefined } }).length;

for (const [name, path, boxes, levels] of [
  ['boxes', 'part.sog', 2_000, 1],
  ['levels', 'part.sog', 500, 16],
  ['letters of a path', `${'./'.repeat(1_000)}part.sog`, 2_000, 1],
] as const)
  test(`the message to the page carries each path once: ${name}`, async () => {
    const { answer, bytes } = await open(`m-${name[0]}`, [path], boxes, levels);
    assert.ok(typeof answer !== 'string', String(answer));
    const message = messageBytes(answer);
    assert.ok(message <= 4 * bytes + 10_000, `${message} bytes for ${bytes}`);
  });

test('paths that are longer than addresses may be are refused', async () => {
  assert.equal((await open('long', [`${'./'.repeat(100_000)}part.sog`], 1_000)).answer, 'decode/header');
});

test('many files that each cost little are charged to one account', async () => {
  const side = 256;
  const image = writeWebp(new Uint8Array(4 * side * side).fill(255), side, side);
  const meta = {
    ...{ version: 2, count: side * side, means: { mins: [0, 0, 0], maxs: [1, 1, 1], files: ['i', 'i'] } },
    ...{ scales: { codebook: [0.1], files: ['i'] }, quats: { files: ['i'] }, sh0: { codebook: [0.1], files: ['i'] } },
  };
  const bomb = zipSync({ 'meta.json': strToU8(JSON.stringify(meta)), i: image }, { level: 9 });
  const names = Array.from({ length: 300 }, (_, k) => `${k}.sog`);
  for (const name of names) files.set(name, bomb);
  const { answer, bytes, cpuMs } = await open('many', names, 300);
  assert.equal(answer, 'out-of-memory/budget', `${bomb.length} bytes each`);
  const arrived = bytes + 300 * bomb.length;
  assert.ok(cpuMs <= 1_000 + 4e-3 * arrived, `${cpuMs} ms for ${arrived} bytes`);
});

test('many honest files are read', async () => {
  const names = Array.from({ length: 60 }, (_, k) => `p${k}.sog`);
  for (const name of names) files.set(name, files.get('part.sog')!);
  assert.notEqual(typeof (await open('honest', names, 60)).answer, 'string');
});

test('a cached file raises the limit of its scene once', async () => {
  const sog = files.get('part.sog')!;
  const [budget, cache] = [new LoadBudget(0), new SogFiles()];
  const run = { url: 'https://a.example/part.sog', name: 'part.sog', first: 0, count: 1 };
  for (let k = 0; k < 3; k++) await cache.read(run, () => Promise.resolve(sog), undefined, budget);
  assert.equal(budget.arrived, sog.length);
});
