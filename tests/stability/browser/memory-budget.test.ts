/** S12 in the page: a scene over the budget of memory is an error with a code, and the page lives on; see ../default-limits.ts. */
import '@gaussian-splat/element';
import { GaussianSplatElement } from '@gaussian-splat/element';
import {
  assert,
  assertEqual,
  COMPASS,
  devices,
  nextEvent,
  show,
  showLoaded,
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
