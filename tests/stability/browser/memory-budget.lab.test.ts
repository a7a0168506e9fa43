/** S12 in the page: a scene over the budget of memory is an error with a code, and the page lives on; see ../default-limits.ts. */
import '@gaussian-splat/element';
import { GaussianSplatElement } from '@gaussian-splat/element';
import { MemoryLedger } from '@gaussian-splat/renderer';
import {
  assert,
  assertEqual,
  COMPASS,
  devices,
  nextEvent,
  show,
  showLoaded,
  until,
} from '../../element/browser/support/harness.js';

describe('S12: a budget of memory', () => {
  it('refuses a scene by name before it is allocated, and shows the next one that fits', async () => {
    await showLoaded();
    const device = devices[devices.length - 1];
    const create = device.createBuffer.bind(device);
    const labels: string[] = [];
    device.createBuffer = (descriptor) => {
      labels.push(descriptor.label ?? '');
      return create(descriptor);
    };
    const before = GaussianSplatElement.memoryBudget;
    GaussianSplatElement.memoryBudget = 100;
    try {
      const element = show({ src: `${COMPASS}?large` });
      await nextEvent(element, 'error');
      assertEqual([element.error?.code, element.error?.reason], ['out-of-memory', 'out-of-memory/budget'], 'codes');
      assert(/at most 100 bytes .*found \d+ bytes/.test(element.error?.message ?? ''), String(element.error?.message));
      assertEqual(
        labels.filter((label) => label.startsWith('gs.gaussians')),
        [],
        'buffers of the scene',
      );
      GaussianSplatElement.memoryBudget = 1_000_000;
      element.setAttribute('src', `${COMPASS}?again`);
      await element.ready;
      assert(element.loaded, 'the next scene is shown');
    } finally {
      GaussianSplatElement.memoryBudget = before;
      device.createBuffer = create;
    }
  });
});

/** Memory of the machine as the browser reports it during a call: gigabytes, or undefined as in Safari. */
async function onMachineOf(gigabytes: number | undefined, action: () => Promise<void>): Promise<void> {
  Object.defineProperty(navigator, 'deviceMemory', { configurable: true, value: gigabytes });
  try {
    await action();
  } finally {
    delete (navigator as { deviceMemory?: number }).deviceMemory;
  }
}

/** The machine with twice the given number of bytes. */
const machineFor = (bytes: number): number => bytes / 2 ** 29;

const ledger = (): MemoryLedger => MemoryLedger.of(devices[devices.length - 1]);

describe('S12: all scenes of a page together', () => {
  let one = 0;
  // Elements of the test before keep their scenes for a second.
  beforeEach(() => until(() => ledger().bytes === 0, 'an empty ledger'));
  before(async () => {
    await until(() => ledger().bytes === 0, 'an empty ledger');
    const element = await showLoaded();
    one = ledger().bytes;
    element.remove();
    assert(one > 0, 'a scene takes memory');
  });

  it('refuses the scene for which the others leave no room, and shows it once one of them is gone', async () => {
    await onMachineOf(machineFor(1.5 * one), async () => {
      const first = await showLoaded();
      const second = show({ src: `${COMPASS}?second` });
      await nextEvent(second, 'error');
      assertEqual(second.error?.reason, 'out-of-memory/budget', 'reason');
      assert(/left of a budget of/.test(second.error?.message ?? ''), String(second.error?.message));
      assert(first.loaded, 'the first is still there');
      // A removed element keeps its scene for a while, unless others lack the room.
      first.remove();
      second.setAttribute('src', `${COMPASS}?third`);
      await second.ready;
      assert(second.loaded, String(second.error?.message));
      assertEqual(ledger().bytes, one, 'bytes');
    });
  });

  it('exchanges a scene for another where there is room for one alone', async () => {
    await onMachineOf(machineFor(1.5 * one), async () => {
      const element = await showLoaded();
      for (const src of [`${COMPASS}?a`, `${COMPASS}?b`]) {
        element.setAttribute('src', src);
        await element.ready;
        assert(element.loaded, String(element.error?.message));
      }
      assertEqual(ledger().releasable.size, 0, 'scenes that may be given back');
    });
  });

  it('takes the word of the page for more', async () => {
    const before = GaussianSplatElement.memoryBudget;
    GaussianSplatElement.memoryBudget = 3 * one;
    try {
      await onMachineOf(machineFor(1.5 * one), async () => {
        await showLoaded();
        await showLoaded({ src: `${COMPASS}?second` });
        assertEqual(ledger().budgetBytes, 3 * one, 'budget');
      });
    } finally {
      GaussianSplatElement.memoryBudget = before;
    }
  });

  it('budgets 512 MB for a phone that does not report its memory, no limit for a computer', async () => {
    const real = globalThis.matchMedia;
    for (const [isCoarse, bytes] of [
      [true, 2 ** 29],
      [false, Infinity],
    ] as const) {
      globalThis.matchMedia = (query) =>
        query === '(pointer: coarse)' ? { ...real(query), matches: isCoarse } : real(query);
      try {
        await onMachineOf(undefined, async () => {
          const element = await showLoaded({ src: `${COMPASS}?${isCoarse}` });
          assertEqual(String(ledger().budgetBytes), String(bytes), 'budget');
          element.remove();
        });
      } finally {
        globalThis.matchMedia = real;
      }
    }
  });
});

describe('S12: off-screen scenes', () => {
  beforeEach(() => until(() => ledger().bytes === 0, 'an empty ledger'));
  afterEach(() => {
    document.querySelectorAll('.far').forEach((element) => element.remove());
    scrollTo(0, 0);
  });

  it('are dropped for others, and come back in the viewport without an event', async () => {
    const first = await showLoaded();
    const one = ledger().bytes;
    // A quarter of the page's limit is less than one scene.
    await onMachineOf(machineFor(3.5 * one), async () => {
      const far = document.createElement('div');
      far.className = 'far';
      far.style.height = '4000px';
      document.body.append(far);
      const second = show({ src: `${COMPASS}?second` });
      far.after(second);
      second.scrollIntoView();
      await second.ready;
      assert(second.loaded, String(second.error?.message));
      assertEqual(ledger().bytes, one, 'bytes while the second is visible');
      assert(first.loaded, 'for the page the first is there');
      const events: string[] = [];
      for (const type of ['loadstart', 'load-start', 'progress', 'load', 'error', 'contextlost'])
        first.addEventListener(type, () => events.push(type));
      scrollTo(0, 0);
      await until(() => first.stats?.renderer !== undefined && first.stats.bytes.scene > 0, 'the first is back');
      const blob = await first.toBlob();
      assert(blob.size > 1000, `an image of ${blob.size} bytes`);
      assertEqual(events, [], 'events');
      assertEqual(ledger().bytes, one, 'bytes while the first is visible');
      second.scrollIntoView();
      await until(() => second.stats !== null && first.stats === null, 'the second in place of the first');
      const box = first.getBoundingBox();
      assert(box && box.max.x > box.min.x, 'the box of an off-screen scene');
      const image = await first.toBlob();
      assertEqual(image.size, blob.size, 'bytes of an image that is saved off-screen');
    });
  });
});
