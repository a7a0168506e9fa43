/** The code of the self-test is refused at first: a device is not left without variants because of that. */
import assert from 'node:assert/strict';
import { register } from 'node:module';
import { after, test } from 'node:test';
import { autotune, deviceDescriptor, pickInitialVariants } from '@gaussian-splat/renderer';
import { requestNodeAdapter } from '../../packages/cli/src/lib/node-gpu.mjs';
import { endNodeDevice } from '../support/node-device.js';

after(endNodeDevice);

/** Requests of the module that fail. */
const REFUSED = 4;

register(`data:text/javascript,${encodeURIComponent(`
  let left = ${REFUSED};
  export function resolve(specifier, context, next) {
    if (specifier === './timing.js' && left-- > 0) throw new Error('refused');
    return next(specifier, context);
  }
`)}`); // prettier-ignore

test('a choice whose code was refused is made again, by each way that asks for it', async () => {
  const adapter = await requestNodeAdapter();
  const device = await adapter.requestDevice(deviceDescriptor(adapter));
  const kept = JSON.stringify({ rasterizer: 'quads', accumulation: 'rgba16float', threads: 'serial' });
  const options = { store: { getItem: () => kept, setItem: () => undefined } };
  for (const choose of [autotune, pickInitialVariants, autotune, pickInitialVariants])
    await assert.rejects(choose(device, options), { code: 'network/unreachable' });
  assert.equal((await pickInitialVariants(device, options)).threads, 'serial');
  assert.equal(await autotune(device), await autotune(device), 'the choice is made once');
  await device.queue.onSubmittedWorkDone();
  device.destroy();
});
