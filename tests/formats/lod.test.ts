/** Streamed SOG box by box: which files are fetched, how often, and which of them are cached. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { setImmediate as turn } from 'node:timers/promises';
import { GaussianSplatError } from '@gaussian-splat/core';
import { readCoarsestLevel, readLodScene, readScene, SogFiles, type SogRun } from '@gaussian-splat/formats';
import { isLab } from '../support/extent.js';
import { lodFolder, pick, type LodFolder } from '../support/lod-folder.js';
import { assertHelpful, assertSameCloud } from './support/expect.js';
import { smallCloud } from './support/small-cloud.js';
import { writeSog } from './support/sog-writer.js';

const cloud = smallCloud(600, 1);
const sky = smallCloud(7, 0, 3);
const folder = lodFolder(cloud, { levels: 3, boxes: 4, environment: sky });
const INDEX = 'https://lod.test/a%20b/lod-meta.json';

/** A server of a folder that records its requests. */
class Server {
  readonly log: string[] = [];
  readonly signals: AbortSignal[] = [];
  /** Promises that answers wait for. */
  waits: Promise<void> = Promise.resolve();
  readonly #folder: LodFolder;

  constructor(source: LodFolder) {
    this.#folder = source;
  }

  readonly fetch = async (url: string, signal: AbortSignal): Promise<Uint8Array> => {
    const path = url.slice(INDEX.lastIndexOf('/') + 1);
    this.log.push(path);
    this.signals.push(signal);
    await this.waits;
    signal.throwIfAborted();
    const bytes = this.#folder.files.get(path);
    if (bytes) return bytes;
    throw new GaussianSplatError('network/status', {
      where: url,
      expected: 'a file',
      found: '404',
      remedy: 'upload it',
    });
  };

  /** Files whose description was fetched. */
  get described(): string[] {
    return this.log.filter((path) => path.endsWith('meta.json'));
  }
}

const scene = readLodScene(folder.index, 'lod-meta.json', INDEX);
const openFile = (path: string): Promise<Uint8Array> => Promise.resolve(folder.files.get(path)!);
const reading = (level: number | 'all'): ReturnType<typeof readScene> =>
  readScene(folder.index, { name: 'lod-meta.json', openFile, level });

test('the index in both dialects: boxes with their runs, the coarsest first, at absolute addresses', () => {
  assert.equal(scene.boxes.length, 4);
  assert.deepEqual(
    scene.boxes[1].runs.map(({ count, first, url, name }) => [count, first, url, name]),
    [
      [10, 10, 'https://lod.test/a%20b/2_0/meta.json', 'lod-meta.json, 2_0/meta.json'],
      [38, 38, 'https://lod.test/a%20b/1_0/meta.json', 'lod-meta.json, 1_0/meta.json'],
      [150, 150, 'https://lod.test/a%20b/0_0/meta.json', 'lod-meta.json, 0_0/meta.json'],
    ],
  );
  assert.equal(scene.environment?.url, 'https://lod.test/a%20b/env/meta.json');
  const old = readLodScene(lodFolder(cloud, { levels: 3, boxes: 4, isOld: true }).index, 'lod-meta.json', INDEX);
  assert.deepEqual(old, { ...scene, environment: undefined });
  const none = { ...JSON.parse(new TextDecoder().decode(folder.index)), environment: '' };
  assert.deepEqual(readLodScene(new TextEncoder().encode(JSON.stringify(none)), 'lod-meta.json', INDEX), old);
  const astray = JSON.stringify({
    ...JSON.parse(new TextDecoder().decode(folder.index)),
    environment: 'https://x.test/m',
  });
  const { environment } = readLodScene(new TextEncoder().encode(astray), 'lod-meta.json', INDEX);
  assert.equal(environment?.url, 'https://lod.test/a%20b/https%3A//x.test/m', 'no other server');
});

test('an index that names more splats than there can be is refused before anything is allocated for them', () => {
  const text = new TextDecoder().decode(folder.index).replaceAll(/"count":150/g, '"count":1e9');
  assert.throws(
    () => readLodScene(new TextEncoder().encode(text), 'lod-meta.json', INDEX),
    (error: GaussianSplatError) => error.code === 'decode/header' && /4,000,000,\d+/.test(error.message),
  );
});

test('a tree with more boxes below one node, and runs of one file, than a call has arguments is read, box by box and whole', async () => {
  const count = 140_000;
  const bound = { min: [0, 0, 0], max: [1, 1, 1] };
  const children = Array.from({ length: count }, (_, k) => ({ bound, lods: { 0: { file: 0, offset: k, count: 1 } } }));
  const meta = { version: 1, lodLevels: 1, filenames: ['0_0/meta.json'], tree: { bound, children } };
  const index = new TextEncoder().encode(JSON.stringify(meta));
  const countOfWhole = async (): Promise<number> => {
    const splats = pick(smallCloud(1, 0), new Array<number>(count).fill(0));
    const files = new Map(Object.entries(writeSog(splats)).map(([path, bytes]) => [`0_0/${path}`, bytes]));
    const openFile = (path: string): Promise<Uint8Array> => Promise.resolve(files.get(path)!);
    return (await readScene(index, { name: 'lod-meta.json', openFile })).count;
  };
  assert.deepEqual(
    readLodScene(index, 'lod-meta.json', INDEX).boxes.map(({ runs: [{ first }] }) => first),
    [...Array(count).keys()],
  );
  if (isLab) assert.equal(await countOfWhole(), count);
});

test('the coarsest runs and the environment are what the reader of whole scenes finds, and no other file is fetched', async () => {
  const server = new Server(folder);
  const found = await readCoarsestLevel(scene, new SogFiles(), server.fetch, 'lod-meta.json');
  assertSameCloud({ ...found, levelRuns: undefined }, await reading(2));
  assert.deepEqual(
    found.levelRuns!.map(({ count, node }) => [node, count]),
    [...scene.boxes.map(({ runs }, box) => [box, runs[0].count]), [4, 7]],
  );
  assert.deepEqual(server.described.sort(), ['2_0/meta.json', 'env/meta.json']);
});

test('a run is the part of its file, and runs that are asked for together share one reading', async () => {
  const server = new Server(folder);
  const files = new SogFiles();
  const whole = await reading(0);
  const runs = scene.boxes.map(({ runs: own }) => own[2]);
  const found = await Promise.all(runs.map((run) => files.read(run, server.fetch)));
  found.forEach((part, box) => {
    const { first, count } = runs[box];
    assertSameCloud(
      part,
      pick(
        whole,
        Array.from({ length: count }, (_, k) => first + k),
      ),
    );
  });
  assert.deepEqual(server.described, ['0_0/meta.json']);
  const again = await files.read(runs[2], server.fetch);
  assertSameCloud(again, found[2]);
  assert.equal(server.described.length, 1, 'kept');
  // Cached arrays are not those that were returned.
  again.positions.fill(NaN);
  assertSameCloud(await files.read(runs[2], server.fetch), found[2]);
});

test('a limited number of bytes is kept, of the files used last; the last file at any size', async () => {
  const server = new Server(folder);
  const bytesOf = async (run: SogRun): Promise<number> => {
    const { positions, scales, rotations, opacities, sh } = await new SogFiles().open(run, server.fetch);
    return [positions, scales, rotations, opacities, sh].reduce((sum, { byteLength }) => sum + byteLength, 0);
  };
  const [coarse, middle, fine] = scene.boxes[0].runs;
  const files = new SogFiles((await bytesOf(middle)) + (await bytesOf(fine)));
  const asked = async (run: SogRun): Promise<boolean> => {
    const before = server.log.length;
    await files.read(run, server.fetch);
    return server.log.length > before;
  };
  assert.equal(await asked(middle), true);
  assert.equal(await asked(fine), true);
  assert.equal(await asked(middle), false, 'two are kept');
  assert.equal(await asked(coarse), true);
  assert.equal(await asked(middle), false);
  assert.equal(await asked(coarse), false);
  assert.equal(await asked(fine), true, 'it was used before the others');
  assert.equal(await asked(coarse), false);
  assert.equal(await asked(middle), true);
  const none = new SogFiles(0);
  server.log.length = 0;
  await none.read(fine, server.fetch);
  await none.read(fine, server.fetch);
  assert.equal(server.described.length, 1);
});

test('two files are read at a time, and those that all callers have canceled are not read at all', async () => {
  const server = new Server(folder);
  let go!: () => void;
  server.waits = new Promise((resolve) => (go = resolve));
  const files = new SogFiles();
  const [coarse, middle, fine] = scene.boxes[0].runs;
  const [first, second, third] = [new AbortController(), new AbortController(), new AbortController()];
  const outcome = (run: SogRun, { signal }: AbortController): Promise<string> =>
    files.read(run, server.fetch, signal).then(
      () => 'read',
      (error: Error) => error.name,
    );
  const asked = [outcome(fine, first), outcome(fine, second), outcome(middle, second), outcome(coarse, third)];
  await turn();
  assert.deepEqual(server.described, ['0_0/meta.json', '1_0/meta.json']);
  second.abort();
  assert.equal(await asked[1], 'AbortError', 'at once, though the server has not answered');
  assert.equal(await asked[2], 'AbortError');
  assert.deepEqual(
    server.signals.map(({ aborted }) => aborted),
    [false, true],
    'the first file is still waited for by another',
  );
  third.abort();
  assert.equal(await asked[3], 'AbortError');
  go();
  assert.equal(await asked[0], 'read');
  await turn();
  assert.ok(!server.described.includes('2_0/meta.json'), 'given up before its turn');
  assert.equal(await outcome(middle, new AbortController()), 'read');
});

test('a run beyond its file, a missing file and a run without visible splats are reported by name, and may be requested again', async () => {
  const refusal = async (work: Promise<unknown>, where = 'meta.json'): Promise<GaussianSplatError> => {
    const error = await work.then(
      () => assert.fail('no error'),
      (reason: unknown) => reason,
    );
    assert.ok(error instanceof GaussianSplatError);
    assertHelpful(error, where);
    return error;
  };
  const [run] = scene.boxes[3].runs.slice(-1);
  const server = new Server(folder);
  const files = new SogFiles();
  const beyond = await refusal(files.read({ ...run, count: 151 }, server.fetch));
  assert.equal(beyond.code, 'decode/corrupt');
  assert.match(beyond.message, /0_0\/meta\.json, splats 450 to 601.*600 splats/s);
  const lost = new Server({ ...folder, files: new Map([...folder.files].filter(([path]) => !path.includes('quats'))) });
  const fresh = new SogFiles();
  assert.equal((await refusal(fresh.read(run, lost.fetch), 'quats')).code, 'network/status');
  assert.equal((await fresh.read(run, server.fetch)).count, 150, 'once it is there');
  const faint = lodFolder({ ...cloud, scales: cloud.scales.map(() => 1e-20) }, { levels: 1, boxes: 2 });
  const [{ runs }] = readLodScene(faint.index, 'lod-meta.json', INDEX).boxes;
  const nothing = await refusal(new SogFiles().read(runs[0], new Server(faint).fetch));
  assert.equal(nothing.code, 'decode/empty');
  assert.match(nothing.message, /splats 0 to 300/);
  const broken = readCoarsestLevel(
    scene,
    new SogFiles(),
    new Server({ ...folder, files: new Map() }).fetch,
    'lod-meta.json',
  );
  assert.equal((await refusal(broken)).code, 'network/status');
});

test('the coarsest level of a large scene is visible before any other is fetched, also if the whole scene is read', async () => {
  const large = lodFolder(smallCloud(60_000, 0), { levels: 2, boxes: 2, environment: sky });
  const log: string[] = [];
  let [previewed, fetched] = [0, 0];
  const found = await readScene(large.index, {
    name: 'lod-meta.json',
    openFile: (path) => {
      log.push(path);
      return Promise.resolve(large.files.get(path)!);
    },
    onPreview: ({ count }) => {
      assert.equal(previewed, 0, 'one preview');
      [previewed, fetched] = [count, log.length];
    },
  });
  assert.equal(previewed, 15_000 + 7);
  assert.ok(log.slice(0, fetched).every((path) => /^(1_0|env)\//.test(path)));
  assert.equal(found.count, 60_000 + 7);
  assert.equal(log.filter((path) => path.endsWith('meta.json')).length, 3, 'the environment once');
});
