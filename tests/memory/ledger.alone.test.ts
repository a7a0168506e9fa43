/** The ledger of GPU memory: its declarations equal the allocations, and it refuses before anything is allocated. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { GaussianSplatError } from '@gaussian-splat/core';
import { DynamicGaussians, GaussianBuffers, MemoryLedger, packGaussians } from '@gaussian-splat/renderer';
import { passesSelfTest } from '@gaussian-splat/renderer/stages';
import { bytesPerSplat } from '@gaussian-splat/renderer/tools';
import { smallCloud } from '../formats/support/small-cloud.js';
import { writeTensors, type TensorSpec } from '../support/generator-tensors.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';

const SPEC: TensorSpec = {
  layout: 'split',
  shape: 'log-scale',
  color: 'channel-major',
  opacity: 'logit',
  quaternionOrder: 'xyzw',
  dtype: 'float32',
};

test('what is declared is what the buffers take', async () => {
  const device = await serialDevice();
  const ledger = MemoryLedger.of(device);
  for (const degree of [0, 1, 2, 3] as const) {
    for (const sh of ['int8', 'float16'] as const) {
      const gaussians = await GaussianBuffers.upload(device, packGaussians(smallCloud(512, degree), { sh }));
      assert.equal(gaussians.byteLength, 512 * bytesPerSplat(degree, sh));
      assert.equal(ledger.bytes, gaussians.byteLength);
      gaussians.destroy();
      gaussians.destroy();
      assert.equal(ledger.bytes, 0);
    }
  }
});

test('room for what a generator writes is declared, and given back', async () => {
  const device = await serialDevice();
  const ledger = MemoryLedger.of(device);
  const gaussians = await DynamicGaussians.create(device, writeTensors(smallCloud(512, 1), SPEC).layout);
  assert.equal(ledger.bytes, 512 * bytesPerSplat(1, 'float16'));
  gaussians.destroy();
  assert.equal(ledger.bytes, 0);
});

test('a scene beyond the budget is refused before the device allocates', async () => {
  const device = await serialDevice();
  const ledger = MemoryLedger.of(device);
  const packed = packGaussians(smallCloud(512, 1), { sh: 'int8' });
  ledger.budgetBytes = 1.5 * 512 * bytesPerSplat(1, 'int8');
  const first = await GaussianBuffers.upload(device, packed);
  const created: string[] = [];
  const createBuffer = device.createBuffer.bind(device);
  device.createBuffer = (descriptor) => (created.push(descriptor.label ?? ''), createBuffer(descriptor));
  await assert.rejects(GaussianBuffers.upload(device, packed), (error: unknown) => {
    assert.ok(error instanceof GaussianSplatError);
    assert.equal(error.code, 'out-of-memory/budget');
    assert.match(error.message, /scene of 512 splats: expected at most \d+ bytes \(0\.0 MB\).*gaussian-splat optimize/);
    return true;
  });
  assert.deepEqual(created, []);
  device.createBuffer = createBuffer;
  await assert.rejects(
    DynamicGaussians.create(device, writeTensors(smallCloud(512, 1), SPEC).layout),
    /generated scene of up to 512 splats: expected at most \d+ bytes \(0\.0 MB\) left of/,
  );
  first.destroy();
  (await GaussianBuffers.upload(device, packed)).destroy();
  ledger.budgetBytes = Infinity;
});

test('what was allocated before a refusal of the device is freed, and its bytes are given back', async () => {
  const device = await serialDevice();
  const createBuffer = device.createBuffer.bind(device);
  const open = new Set<GPUBuffer>();
  for (const make of [
    () => GaussianBuffers.upload(device, packGaussians(smallCloud(512, 1), { sh: 'int8' })),
    () => DynamicGaussians.create(device, writeTensors(smallCloud(512, 1), SPEC).layout),
  ]) {
    let made = 0;
    device.createBuffer = (descriptor) => {
      if (++made === 3) throw new Error('refused');
      const buffer = createBuffer(descriptor);
      const destroy = buffer.destroy.bind(buffer);
      buffer.destroy = () => {
        open.delete(buffer);
        return destroy();
      };
      open.add(buffer);
      return buffer;
    };
    await assert.rejects(
      make(),
      (error: unknown) => error instanceof GaussianSplatError && error.code === 'out-of-memory/allocation',
    );
    device.createBuffer = createBuffer;
    assert.deepEqual([made, open.size, MemoryLedger.of(device).bytes], [3, 0, 0]);
  }
});

after(endNodeDevice);

test('memory that is soon unused is released before an allocation is refused, and no more of it than necessary', () => {
  const ledger = new MemoryLedger();
  ledger.budgetBytes = 100;
  const kept = ledger.reserve('kept', 20);
  const given: string[] = [];
  for (const name of ['first', 'second', 'third']) {
    const reservation = ledger.reserve(name, 20);
    const giveBack = (): void => {
      given.push(name);
      ledger.releasable.delete(giveBack);
      reservation.release();
    };
    ledger.releasable.set(giveBack, 0);
  }
  ledger.reserve('beside', 20);
  assert.deepEqual(given, []);
  ledger.reserve('large', 35);
  assert.deepEqual(given, ['first', 'second']);
  assert.throws(() => ledger.reserve('too large', 70), /at most 25 bytes/);
  assert.deepEqual(given, ['first', 'second', 'third']);
  assert.equal(kept.bytes, 20);
});

test('what is no number of bytes is refused by name, and the sum stays one', async () => {
  const ledger = MemoryLedger.of(await serialDevice());
  const before = ledger.bytes;
  for (const bytes of [NaN, -1])
    assert.throws(
      () => ledger.reserve('a scene', bytes),
      (error: unknown) => error instanceof GaussianSplatError && error.code === 'argument/value',
    );
  assert.equal(ledger.bytes, before);
});

test('a budget without room does not make the self-test fail', async () => {
  const device = await serialDevice();
  const ledger = MemoryLedger.of(device);
  let given = 0;
  ledger.releasable.set(() => given++, 1000);
  ledger.budgetBytes = ledger.bytes;
  assert.ok(await passesSelfTest(device, { threads: 'serial', rasterizer: 'quads' }));
  assert.equal(given, 0, 'off-screen scenes are kept');
});
