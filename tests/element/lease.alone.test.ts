/** Scenes that fail to open give their lease of the device back. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { setTimeout as delay } from 'node:timers/promises';

interface Lease {
  readonly release: () => void;
}
type WithLease = <T>(
  device: { acquire: () => Promise<Lease> },
  open: (lease: Promise<Lease>) => Promise<T>,
) => Promise<T>;
const { withLease } = (await import('../../packages/element/dist/gpu/shared-device.js')) as unknown as {
  withLease: WithLease;
};

/** A device whose lease comes after 10 ms, and the number of leases that are held. */
function countedDevice(): { device: { acquire: () => Promise<Lease> }; held: () => number } {
  let held = 0;
  const acquire = async (): Promise<Lease> => {
    await delay(10);
    held++;
    return { release: () => void held-- };
  };
  return { device: { acquire }, held: () => held };
}

test('a scene that opens keeps its lease', async () => {
  const { device, held } = countedDevice();
  assert.equal(await withLease(device, async (lease) => typeof (await lease).release), 'function');
  assert.equal(held(), 1);
});

test('one that fails before its lease has come, or after, gives it back', async () => {
  for (const waits of [false, true]) {
    const { device, held } = countedDevice();
    const opening = withLease(device, async (lease) => {
      if (waits) await lease;
      throw new Error('no scene');
    });
    await assert.rejects(opening, /no scene/);
    await delay(20);
    assert.equal(held(), 0, `waits: ${waits}`);
  }
});

test('a device that fails while code is still loading is no unhandled rejection', async (t) => {
  const unhandled: unknown[] = [];
  const note = (reason: unknown): void => void unhandled.push(reason);
  process.on('unhandledRejection', note);
  t.after(() => process.off('unhandledRejection', note));
  const device = { acquire: () => Promise.reject(new Error('no device')) };
  const opening = withLease(device, async (lease) => {
    await delay(10);
    return await lease;
  });
  await assert.rejects(opening, /no device/);
  assert.deepEqual(unhandled, []);
});
