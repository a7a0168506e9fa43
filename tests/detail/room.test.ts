/** Splat budgets on a device without memory for more: they keep the size that worked. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { setImmediate as turn } from 'node:timers/promises';
import { MemoryLedger } from '@gaussian-splat/renderer';
import { budgetBytes, hasMemory } from '@gaussian-splat/renderer/tools';
import { SplatBudgets, type BudgetedScene } from '../support/element/quality.js';
import { nodeDevice } from '../support/node-device.js';

/** Sizes of the buffers of a device, which refuses those of a probe: it must allocate 200 GB beside them. @returns sizes, and the end of it */
function refusing(device: GPUDevice): { readonly sizes: number[]; readonly stop: () => void } {
  const own = device.createBuffer.bind(device);
  const sizes: number[] = [];
  device.createBuffer = (descriptor) => {
    sizes.push(descriptor.size);
    device.createTexture({ size: [8192, 8192, 200], format: 'rgba32float', usage: 1 });
    return own(descriptor);
  };
  return { sizes, stop: () => Reflect.deleteProperty(device, 'createBuffer') };
}

test('a device says whether it has memory, and keeps none of it', async () => {
  const device = await nodeDevice();
  assert.equal(await hasMemory(device, 50e6), true);
  const { sizes, stop } = refusing(device);
  assert.equal(await hasMemory(device, 150e6 + 1), false);
  stop();
  assert.deepEqual(sizes, [2 ** 27, 4 * Math.ceil((150e6 + 1 - 2 ** 27) / 4)]);
});

test('splat budgets grow once the device has confirmed the memory, and stay as they are after a refusal', async () => {
  const device = await nodeDevice();
  const scene: BudgetedScene = {
    place: { memory: new MemoryLedger(), context: device },
    gaussians: { progress: { error: 0, budgetError: 5 } },
    detail: { detail: 1, splatBudget: 20_000, splatRange: [20_000, 1e6] },
    setDetail: (detail) => void Object.assign(scene, { detail }),
  };
  const budgets = new SplatBudgets(() => [scene]);
  let now = 0;
  const grow = async (): Promise<number | undefined> => {
    budgets.grow({ now: (now += 10_000), milliseconds: 2, targetMs: 13 });
    await device.queue.onSubmittedWorkDone();
    await turn();
    return scene.detail.splatBudget;
  };
  assert.equal(await grow(), 20_000, 'the device is asked');
  assert.equal(await grow(), 30_000);
  const { sizes, stop } = refusing(device);
  for (let k = 0; k < 5; k++) assert.equal(await grow(), 30_000);
  stop();
  assert.deepEqual(sizes, [4 * Math.ceil(budgetBytes(45_000) / 4)], 'it is asked once');
  assert.equal(await grow(), 30_000, 'and not again');
  budgets.reset();
  assert.equal(scene.detail.splatBudget, 20_000);
  await grow();
  assert.equal(await grow(), 30_000, 'another view may ask again');
});
