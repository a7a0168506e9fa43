/** A large PLY, whose rows several workers read and pack while they arrive. */
import { GaussianSplatElement } from '@gaussian-splat/element';
import type { PackedGaussians } from '@gaussian-splat/renderer';
import type * as sceneWorker from '../../../packages/element/src/loading/scene-worker.js';
import type { PartListener } from '../../support/element/loading.js';
import { assert, assertEqual, nextEvent, show, showLoaded } from './support/harness.js';

const SPLATS = 200_000;
const FILE = `/net/large-ply/scene.ply?n=${SPLATS}`;
const request = (url: string) =>
  ({ url: new URL(url, location.href).href, credentials: 'same-origin', sh: 'auto' }) as const;
const signal = new AbortController().signal;
const ignore = (): void => undefined;

type SceneLoader = (typeof GaussianSplatElement)['sceneLoader'];
const original = GaussianSplatElement.sceneLoader;
const Loader = original.constructor as new (spawn: () => Worker) => SceneLoader;
const SCRIPT = '/packages/element/dist/loading/scene-worker.js';

/** The words of each splat as text, in an order that does not depend on the order of splats. */
function splatsOf({ geometry, sh, count }: PackedGaussians): string[] {
  const [first, second] = [geometry.length / count, sh.length / count];
  return Array.from({ length: count }, (_, i) =>
    [...geometry.subarray(first * i, first * (i + 1)), ...sh.subarray(second * i, second * (i + 1))].join(),
  ).sort();
}

function assertSame(found: PackedGaussians, expected: PackedGaussians): void {
  const facts = ({ count, shDegree, shPrecision, origin, droppedCount, chunks }: PackedGaussians): unknown => [
    ...[count, shDegree, shPrecision, origin, droppedCount],
    chunks.length,
  ];
  assertEqual(facts(found), facts(expected), 'facts');
  const splats = splatsOf(expected);
  assert(
    splatsOf(found).every((splat, i) => splat === splats[i]),
    'splats differ',
  );
}

describe('a large PLY', () => {
  let expected: PackedGaussians;
  before(async () => {
    // One thread without helpers.
    const { runOnPage } = (await import(SCRIPT)) as typeof sceneWorker;
    const whole = await runOnPage('load', request(FILE), signal, { onProgress: ignore });
    assert('packed' in whole && whole.packed, 'a scene');
    expected = whole.packed;
    assertEqual(expected.droppedCount, Math.ceil(SPLATS / 16_911) * 17 - 3, 'splats that are of no use');
  });
  before(() => void Object.defineProperty(navigator, 'hardwareConcurrency', { value: 8, configurable: true }));
  after(() => void Reflect.deleteProperty(navigator, 'hardwareConcurrency'));
  afterEach(() => {
    GaussianSplatElement.sceneLoader = original;
  });

  it('is packed by several workers into the splats that one makes, with previews before, under a limit of time, too', async () => {
    const spawned: Worker[] = [];
    const loader = new Loader(() => {
      const worker = new Worker(SCRIPT, { type: 'module' });
      spawned.push(worker);
      return worker;
    });
    const previews: number[] = [];
    const start = performance.now();
    const limited = { ...request(`${FILE}&gate=previews`), limits: { maxSeconds: 240 } };
    const scene = await loader.load(limited, signal, ignore, ({ packed }) => {
      console.log(`preview of ${packed.count} after ${(performance.now() - start).toFixed(0)} ms`);
      previews.push(packed.count);
      void fetch('/net/open/previews');
    });
    assert(spawned.length > 1, `${spawned.length} workers`);
    assert(previews.length > 0 && previews[0] < SPLATS, 'a preview');
    assertSame(scene.packed, expected);
  });

  it('is packed also where helpers die in the middle of it', async () => {
    const spawned: Worker[] = [];
    const loader = new Loader(() => {
      const worker = new Worker(SCRIPT, { type: 'module' });
      spawned.push(worker);
      return worker;
    });
    let isKilled = false;
    const scene = await loader.load(request(`${FILE}&gate=helpers`), signal, (loaded) => {
      if (loaded < 20e6 || isKilled || spawned.length === 1) return;
      isKilled = true;
      void fetch('/net/open/helpers');
      for (const helper of spawned.slice(1)) helper.terminate();
    });
    assert(isKilled && spawned.length > 1, 'helpers were there');
    assertSame(scene.packed, expected);
  });

  it('comes in parts that are the whole, also if helpers die while its blocks are sorted', async () => {
    const spawned: Worker[] = [];
    const loader = new Loader(() => {
      const worker = new Worker(SCRIPT, { type: 'module' });
      spawned.push(worker);
      return worker;
    });
    let joined: PackedGaussians | undefined;
    const onPart: PartListener = (part) => {
      if ('head' in part) {
        const { count } = part.head;
        const [geometry, sh] = [expected.geometry, expected.sh].map((words) => new Uint32Array(words.length));
        joined = { ...part.head, geometry, sh, chunks: new Float32Array(8 * Math.ceil(count / 256)) };
        spawned[1]?.terminate();
      } else {
        const { start = 0, geometry = [], sh = [], chunks = [] } = part.portion;
        joined!.geometry.set(geometry, (expected.geometry.length / expected.count) * start);
        joined!.sh.set(sh, (expected.sh.length / expected.count) * start);
        joined!.chunks.set(chunks);
      }
    };
    const scene = await loader.ask('load', request(FILE), signal, { onPart });
    assert(!('packed' in scene) && joined, 'a scene whose splats came before it');
    assertSame(joined, expected);
  });

  it('is packed also where no helper comes', async () => {
    let isFirst = true;
    const loader = new Loader(() => {
      const script = isFirst ? SCRIPT : '/net/status/404';
      isFirst = false;
      return new Worker(script, { type: 'module' });
    });
    const scene = await loader.load(request(FILE), signal, ignore);
    assertSame(scene.packed, expected);
  });

  it('that is cut short is an error with a name', async () => {
    const element = show({ src: '/net/short-ply/scene.ply' });
    await element.ready;
    assertEqual(element.error?.reason, 'decode/truncated');
  });

  it('of more splats than the page allows is refused by name', async () => {
    const { sceneLimits } = GaussianSplatElement;
    GaussianSplatElement.sceneLimits = { maxSplats: SPLATS - 1 };
    const element = show({ src: FILE });
    await element.ready;
    GaussianSplatElement.sceneLimits = sceneLimits;
    assertEqual(element.error?.reason, 'out-of-memory/budget');
  });

  it('is seen in part early, and never keeps the page from its work for long', async () => {
    await showLoaded();
    let longest = 0;
    const observer = new PerformanceObserver((list) => {
      for (const { duration } of list.getEntries()) longest = Math.max(longest, duration);
    });
    observer.observe({ entryTypes: ['longtask'] });
    let workers = 0;
    GaussianSplatElement.sceneLoader = new Loader(() => {
      workers++;
      return new Worker(SCRIPT, { type: 'module' });
    });
    const element = show({ src: `${FILE}&gate=early` });
    const start = performance.now();
    await nextEvent(element, 'preview');
    const first = performance.now() - start;
    void fetch('/net/open/early');
    await element.ready;
    assert(element.loaded, element.error?.message ?? 'loaded');
    console.log(
      `preview after ${first.toFixed(0)} ms, all after ${(performance.now() - start).toFixed(0)} ms; longest task ${longest.toFixed(0)} ms`,
    );
    observer.disconnect();
    assertEqual(element.stats?.splats, expected.count, 'splats');
    assert(workers > 1, `shared by ${workers} workers, with the limits that every page has`);
  });
});
