/**
 * Loads that never end, and workers that die: no other load waits for them.
 * SECURITY.md: "An untrusted scene delays no other scene".
 */
import { GaussianSplatElement } from '@gaussian-splat/element';
import {
  assert,
  assertEqual,
  claimComing,
  COMPASS,
  delay,
  FIXTURES,
  show,
  showLoaded,
  until,
} from './support/harness.js';

type SceneLoader = (typeof GaussianSplatElement)['sceneLoader'];
const original = GaussianSplatElement.sceneLoader;
const Loader = original.constructor as new (spawn: () => Worker) => SceneLoader;

const SCRIPT = new URL('/packages/element/dist/loading/scene-worker.js', location.href).href;
/** Endless reads of the file `endless`, with a report (`reads`) or without, and one crash for the file `deadly`. */
const HOG = `
  import ${JSON.stringify(SCRIPT)};
  addEventListener('message', ({ data: { type, id, request } }) => {
    if (type !== 'load' || !request.url.includes('endless')) return;
    if (request.url.includes('reads')) postMessage({ type: 'reading', id });
    for (;;) Math.random();
  });`;
const HOG_URL = URL.createObjectURL(new Blob([HOG], { type: 'text/javascript' }));
const ENDLESS = `${COMPASS}?endless&reads`;
/** Longest that an honest scene may take more than alone, ms: others use the machine, too. */
const LIMIT_MS = 4_000;

/** Workers that live. */
let living: Worker[] = [];

function hogWorker(url = HOG_URL): Worker {
  const worker = new Worker(url, { type: 'module' });
  living.push(worker);
  const terminate = worker.terminate.bind(worker);
  worker.terminate = () => {
    living = living.filter((other) => other !== worker);
    terminate();
  };
  return worker;
}

/** Milliseconds, which the console gets, too. */
const timeOf = async (work: () => Promise<unknown>): Promise<number> => {
  const start = performance.now();
  await work();
  const time = performance.now() - start;
  console.log(`${time.toFixed(0)} ms`);
  return time;
};

describe('a scene that is never read to its end', () => {
  let alone = 0;
  beforeEach(async () => {
    living = [];
    GaussianSplatElement.sceneLoader = new Loader(() => hogWorker());
    await showLoaded();
    alone = await timeOf(() => showLoaded());
  });
  afterEach(() => {
    GaussianSplatElement.sceneLoader = original;
  });

  for (const [what, src] of [
    ['that says what it reads', ENDLESS],
    ['that says nothing', `${COMPASS}?endless`],
  ] as const) {
    it(`lets one pass that is set half a second later, in a worker ${what}`, async () => {
      const hostile = show({ src });
      await delay(500);
      const time = await timeOf(() => showLoaded());
      assert(time < alone + LIMIT_MS, `${time.toFixed(0)} ms; alone ${alone.toFixed(0)}`);
      hostile.remove();
    });
  }

  it('lets those pass that were set with it', async () => {
    const hostile = show({ src: ENDLESS });
    const time = await timeOf(() => Promise.all([showLoaded(), showLoaded({ src: `${FIXTURES}green.splat` })]));
    assert(time < 2 * alone + LIMIT_MS, `${time.toFixed(0)} ms; alone ${alone.toFixed(0)}`);
    assertEqual([hostile.loaded, hostile.error], [false, null], 'it is still being read');
    hostile.remove();
  });

  it('ends with its element: its worker, too', async () => {
    const before = living.length;
    const hostile = show({ src: ENDLESS });
    await delay(700);
    const [hog] = living.slice(before - 1);
    hostile.src = null;
    await until(() => !living.includes(hog), 'the end of the worker');
    const time = await timeOf(() => showLoaded());
    assert(time < alone + LIMIT_MS, `${time.toFixed(0)} ms; alone ${alone.toFixed(0)}`);
  });

  it('may be several at a time', async () => {
    const hostile = Array.from({ length: 3 }, (_, i) => show({ src: `${ENDLESS}&${i}` }));
    await delay(500);
    const time = await timeOf(() => showLoaded());
    // Loads that started together are distinguished one after the other.
    assert(time < alone + 3 * LIMIT_MS, `${time.toFixed(0)} ms; alone ${alone.toFixed(0)}`);
    for (const element of hostile) element.src = null;
    await until(() => living.length <= 2, `the end of their workers, of which ${living.length} live`);
  });
});

describe('a file that costs more than it weighs', () => {
  const files = [
    'zip-overlap-descriptions.zip',
    'webp-65536-groups.sog',
    'spz-bomb.spz',
    'lod-same-file-300.zip',
    'gltf-copies.glb',
    'ply-many-rest.ply',
  ];
  for (const name of files)
    it(`lets an honest scene pass: ${name}`, async function () {
      const address = `/net/attack/${name}`;
      if (!(await fetch(address)).ok) return this.skip();
      await showLoaded();
      const alone = await timeOf(() => showLoaded());
      const hostile = show({ src: address });
      await delay(500);
      const time = await timeOf(() => showLoaded());
      hostile.remove();
      // Time of the GPU's thread and of the main thread that it used cannot be recovered; here others use both.
      assert(time < alone + LIMIT_MS, `${time.toFixed(0)} ms; alone ${alone.toFixed(0)}`);
    });
});

describe('a worker that dies', () => {
  beforeEach(async () => {
    living = [];
    GaussianSplatElement.sceneLoader = new Loader(() => hogWorker(SCRIPT));
    await showLoaded();
  });
  afterEach(() => {
    GaussianSplatElement.sceneLoader = original;
  });

  it('without a word, while it loads: the load begins again in another', async () => {
    const element = show({ src: '/net/slow/compass.ply?ms=2500' });
    await delay(800);
    Worker.prototype.terminate.call(living[0]);
    const time = await timeOf(() => showLoaded());
    assert(time < 3_000, `the next load took ${time.toFixed(0)} ms`);
    await element.ready;
    assertEqual([element.loaded, element.error], [true, null], 'the one that was under way');
  });

  it('without a word, while it rests: the next load has another', async () => {
    Worker.prototype.terminate.call(living[0]);
    const time = await timeOf(() => showLoaded());
    assert(time < 3_000, `${time.toFixed(0)} ms`);
  });

  it('with an error, while several load: all begin again', async () => {
    const elements = [1, 2, 3].map((i) => show({ src: `/net/slow/compass.ply?ms=2000&${i}` }));
    await delay(600);
    living[0].dispatchEvent(new ErrorEvent('error', { message: 'out of memory', cancelable: true }));
    await Promise.all(elements.map((element) => element.ready));
    assertEqual(
      elements.map(({ error }) => error),
      [null, null, null],
      'errors',
    );
  });
});

describe("a worker's script that never comes", () => {
  it('is not waited for', async () => {
    await showLoaded();
    GaussianSplatElement.sceneLoader = new Loader(() => new Worker('/net/never/worker.js', { type: 'module' }));
    try {
      const time = await timeOf(() => showLoaded());
      assert(time < 2_500 + LIMIT_MS, `${time.toFixed(0)} ms`);
      assert((await timeOf(() => showLoaded())) < 1_500, 'nor by the next');
    } finally {
      GaussianSplatElement.sceneLoader = original;
    }
    await claimComing(/no worker could be started \(none has started within 2 s\).*slow/);
  });
});
