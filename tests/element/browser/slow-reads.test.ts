/** Several scenes on a machine that reads slowly: what the server is asked for. */
import { GaussianSplatElement } from '@gaussian-splat/element';
import { itInLab } from '../../support/extent-in-pages.js';
import { assert, assertEqual, show, until } from './support/harness.js';

type SceneLoader = (typeof GaussianSplatElement)['sceneLoader'];
const original = GaussianSplatElement.sceneLoader;
const Loader = original.constructor as new (spawn: () => Worker) => SceneLoader;

const SCRIPT = new URL('/packages/element/dist/loading/scene-worker.js', location.href).href;
/** A worker that is busy for one more second each time it says that it reads. */
const SLOW = `
  import ${JSON.stringify(SCRIPT)};
  const post = self.postMessage.bind(self);
  self.postMessage = (message, transfer) => {
    post(message, transfer);
    for (const end = performance.now() + 1000; message.type === 'reading' && performance.now() < end;);
  };`;
const SLOW_URL = URL.createObjectURL(new Blob([SLOW], { type: 'text/javascript' }));
/** Splats of 32 bytes: above the size from which a file is handed on. */
const SPLATS = 10_000;

let workers: Worker[] = [];
let reading: Worker[] = [];

function slowWorker(): Worker {
  const worker = new Worker(SLOW_URL, { type: 'module' });
  workers.push(worker);
  worker.addEventListener('message', ({ data }: MessageEvent<{ type: string }>) => {
    if (data.type === 'reading') reading.push(worker);
  });
  return worker;
}

/** Puts a scene on the server, and shows it several times, each at an address of its own. */
async function showSeveral(folder: string, count: number): Promise<GaussianSplatElement[]> {
  const bytes = new DataView(new ArrayBuffer(32 * SPLATS));
  for (let i = 0; i < SPLATS; i++) {
    [Math.sin(i), Math.cos(3 * i), Math.sin(7 * i), 0.02, 0.02, 0.02].forEach((value, k) =>
      bytes.setFloat32(32 * i + 4 * k, value, true),
    );
    [200, 90, 40, 255, 255, 128, 128, 128].forEach((value, k) => bytes.setUint8(32 * i + 24 + k, value));
  }
  const names = Array.from({ length: count }, (_, i) => `/net/kept/${folder}/${i}.splat`);
  for (const name of names) await fetch(name, { method: 'PUT', body: bytes.buffer });
  return names.map((src) => show({ src, 'interaction-prompt': 'none' }));
}

async function assertAskedOnce(folder: string, elements: readonly GaussianSplatElement[]): Promise<void> {
  await Promise.all(elements.map((element) => element.ready));
  assertEqual(
    elements.map(({ loaded, error, stats }) => [loaded, error, stats?.splats]),
    elements.map(() => [true, null, SPLATS]),
    'scenes',
  );
  const log = (await (await fetch(`/net/kept/${folder}/log`)).json()) as string[];
  assertEqual(log.toSorted(), elements.map((_, i) => `${i}.splat`).toSorted(), 'requests');
}

describe('scenes that are read for seconds', () => {
  beforeEach(() => {
    workers = [];
    reading = [];
    GaussianSplatElement.sceneLoader = new Loader(slowWorker);
  });
  afterEach(() => {
    GaussianSplatElement.sceneLoader = original;
  });

  itInLab('are asked for once each, and read by several workers', async () => {
    const folder = `slow-${performance.timeOrigin}`;
    await assertAskedOnce(folder, await showSeveral(folder, 6));
    assert(workers.length > 1 && workers.length <= 7, `${workers.length} workers`);
  });

  itInLab('are asked for once each, although the browser ends a worker that reads', async () => {
    const folder = `ended-${performance.timeOrigin}`;
    const elements = await showSeveral(folder, 4);
    // The first worker downloads; what it downloads for others would be lost.
    await until(() => reading.some((worker) => worker !== workers[0]), 'a worker that reads');
    Worker.prototype.terminate.call(reading.find((worker) => worker !== workers[0])!);
    await assertAskedOnce(folder, elements);
  });
});
