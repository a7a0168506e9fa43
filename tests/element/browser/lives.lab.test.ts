/** Long lives: many elements, many comings and goings, many losses; afterwards everything is as it was. */
import '@gaussian-splat/element';
import { GaussianSplatElement } from '@gaussian-splat/element';
import { executeServerCommand } from '@web/test-runner-commands';
import { sized } from '../../support/extent-in-pages.js';
import { holdings } from './support/ledger.js';
import {
  assert,
  assertEqual,
  COMPASS,
  delay,
  devices,
  FIXTURES,
  frames,
  nextEvent,
  show,
  showLoaded,
  until,
} from './support/harness.js';
import { isGreen, isRed, screenOf } from './support/screen.js';

/** Bytes of scripts, nodes and event listeners of the page after a collection of garbage. */
async function held(): Promise<{ heap: number; nodes: number; listeners: number }> {
  const heap = await executeServerCommand<number, undefined>('heap-size');
  const metrics = await executeServerCommand<Record<string, number>, undefined>('thread-metrics');
  return { heap, nodes: metrics.Nodes, listeners: metrics.JSEventListeners };
}

/** Bytes of code that the engine compiles meanwhile: 50 to 190 kB were seen, in short runs more than in long ones. */
const CODE_BYTES = 400_000;

/** The same moments in every run. */
function seeded(seed: number): () => number {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return state / 2 ** 32;
  };
}

async function withReleaseDelay(ms: number, work: () => Promise<void>): Promise<void> {
  const before = GaussianSplatElement.releaseDelay;
  GaussianSplatElement.releaseDelay = ms;
  try {
    await work();
    // Elements that are still in the page are removed now, without the delay of others.
    document.body.replaceChildren();
    await delay(300);
  } finally {
    GaussianSplatElement.releaseDelay = before;
  }
}

describe('a long life', () => {
  it('elements that come and go by the hundred leave the GPU and the heap as they were, on one device', async () => {
    // 100, or what `npm run lab -- lives` asks for.
    const cycles = Number(await (await fetch('/net/soak-cycles')).text());
    await withReleaseDelay(0, async () => {
      // It keeps the device, so that resources that the device shares do not count as created and destroyed.
      const resident = await showLoaded();
      const random = seeded(7);
      const elements: WeakRef<object>[] = [];
      const round = async (i: number): Promise<void> => {
        const element = show({ src: COMPASS, loading: 'eager', 'camera-controls': '', 'auto-rotate': '' });
        elements.push(new WeakRef(element));
        const hotspot = document.createElement('button');
        hotspot.slot = 'hotspot-a';
        hotspot.dataset.position = '0m 0m 1m';
        element.append(hotspot);
        // Some are shown, some are taken away somewhere on their way.
        if (i % 5 === 0) await element.ready;
        else await delay(20 * random());
        element.remove();
      };
      const settle = async (): Promise<void> => {
        await delay(400);
        await frames();
      };
      const count = devices.length;
      for (let i = 0; i < 0.1 * cycles; i++) await round(i);
      await settle();
      const gpuBefore = holdings();
      const some = Math.ceil(0.45 * cycles);
      for (let i = 0; i < some; i++) await round(i);
      await settle();
      const middle = await held();
      for (let i = 0; i < some; i++) await round(i);
      await settle();
      const [gpuAfter, last] = [holdings(), await held()];
      console.log(
        `${cycles} cycles: GPU ${gpuBefore.objects} objects, ${gpuBefore.bytes} bytes, then ${gpuAfter.objects}, ${gpuAfter.bytes}; ` +
          `in the middle ${JSON.stringify(middle)}, then ${JSON.stringify(last)}`,
      );
      assertEqual(gpuAfter, gpuBefore, 'GPU ledger');
      assertEqual(devices.length, count, 'devices');
      const [nodes, listeners] = [last.nodes - middle.nodes, last.listeners - middle.listeners];
      assert(nodes < some && listeners < some, `${some} cycles leave ${nodes} nodes and ${listeners} listeners`);
      // One element would be 7 KB: long runs find it here, short ones by its nodes.
      const bytes = last.heap - middle.heap;
      assert(bytes < CODE_BYTES + 1_000 * some, `the heap grows by ${bytes} bytes in ${some} cycles`);
      // The last one may still be on a stack.
      const alive = elements.filter((element) => element.deref()).length;
      assert(alive <= 1, `${alive} elements are still held`);
      assert((await screenOf(resident)).middleOf(isRed), 'the resident is still seen');
    });
  }).timeout(170_000);

  it('24 elements share one device, and give back all that they took', async () => {
    await withReleaseDelay(0, async () => {
      const resident = await showLoaded();
      const [before, count] = [holdings(), devices.length];
      const elements = Array.from({ length: 24 }, (_, i) =>
        show(
          { src: i % 2 ? `${FIXTURES}green.splat` : COMPASS, loading: 'eager' },
          'display: inline-block; width: 60px; height: 50px',
        ),
      );
      await Promise.all(elements.map((element) => element.ready));
      for (const [i, element] of elements.entries()) {
        assert(element.loaded, element.error?.message ?? `element ${i} is not loaded`);
      }
      assertEqual(devices.length, count, 'devices');
      assert(holdings().objects > before.objects + 24, `${holdings().objects} objects`);
      for (const i of [0, 1, 22, 23]) {
        elements[i].scrollIntoView();
        assert((await screenOf(elements[i])).middleOf(i % 2 ? isGreen : isRed), `element ${i} is seen`);
      }
      for (const element of elements) element.remove();
      await until(() => holdings().objects === before.objects, 'the ledger to come back');
      assertEqual(holdings(), before);
      assert(resident.loaded, 'the resident');
    });
  });

  it('losses of the device at random moments: a pair of events each, and the first frame each time', async () => {
    const element = await showLoaded({ 'camera-orbit': '25deg 65deg auto', 'interaction-prompt': 'none' });
    const image = await screenOf(element);
    const goal = element.getAttribute('camera-orbit') ?? '';
    const seen: string[] = [];
    for (const type of ['contextlost', 'contextrestored', 'error', 'load', 'emptied']) {
      element.addEventListener(type, () => seen.push(type));
    }
    const random = seeded(20);
    const losses = sized(8, 20);
    for (let i = 0; i < losses; i++) {
      const restored = nextEvent(element, 'contextrestored');
      // Every other time the camera is on its way: the loss falls between two frames of a motion.
      if (i % 2) element.cameraOrbit = `${Math.round(360 * random())}deg 80deg auto`;
      await delay(120 * random());
      devices[devices.length - 1].destroy();
      await restored;
      element.cameraOrbit = goal;
      element.jumpCameraToGoal();
      await frames(2);
      assertEqual((await screenOf(element)).differences(image), 0, `differing color values after loss ${i}`);
    }
    assertEqual(seen, Array.from({ length: losses }, () => ['contextlost', 'contextrestored']).flat(), 'events');
  }).timeout(120_000);
});
