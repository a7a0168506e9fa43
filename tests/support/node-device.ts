/** A device of Dawn in Node. Tests that use it run under `gpuEnvironment()` of scripts/lib. */
import { autotune } from '@gaussian-splat/renderer';
import { requestNodeAdapter } from '../../packages/cli/src/lib/node-gpu.mjs';
import { isFull } from './extent.js';

const devices = new Map<string, Promise<GPUDevice>>();

/** One device for all tests of a file, at WebGPU's default limits and without any optional feature. Renderers on it draw as on any GPU that nothing is known of. */
export function nodeDevice(): Promise<GPUDevice> {
  return once('parallel', requestDevice);
}

/**
 * The same, for tests that are not about how stages share their work: renderers on it have the stages and the sort that pages on SwiftShader have, which it compiles in
 * a tenth of the time. Pictures are the same.
 */
export function serialDevice(): Promise<GPUDevice> {
  return once('serial', async () => asOnSwiftShader(await requestDevice()));
}

/** A device whose renderers have from now on what {@link serialDevice} says. */
export async function asOnSwiftShader(device: GPUDevice): Promise<GPUDevice> {
  const choice = JSON.stringify({
    rasterizer: 'quads',
    accumulation: 'rgba16float',
    threads: 'serial',
    sort: 'serial',
  });
  await autotune(device, { store: { getItem: () => choice, setItem: () => undefined } });
  return device;
}

/** For what must hold however stages share their work: {@link nodeDevice} in `npm test -- --full`, else {@link serialDevice}, since `variants.test.ts` finds the pictures of both to be the same. */
export function anyDevice(): Promise<GPUDevice> {
  return isFull ? nodeDevice() : serialDevice();
}

async function requestDevice(): Promise<GPUDevice> {
  return (await requestNodeAdapter()).requestDevice();
}

function once(kind: string, request: () => Promise<GPUDevice>): Promise<GPUDevice> {
  const known = devices.get(kind);
  if (known !== undefined) return known;
  const requested = request();
  devices.set(kind, requested);
  return requested;
}

let isKept = false;

/**
 * For `after` of every file that uses a device: Dawn keeps Node alive, and a process that ends while the GPU still works was seen to crash.
 */
export async function endNodeDevice(): Promise<void> {
  if (!isKept) await endDevices();
}

/** Where several files share this process, none of them ends the devices; the function returned does so for all. */
export function keepNodeDevice(): () => Promise<void> {
  isKept = true;
  return endDevices;
}

async function endDevices(): Promise<void> {
  for (const device of await Promise.all(devices.values())) {
    await device.queue.onSubmittedWorkDone();
    device.destroy();
  }
  // Deno ends by itself, and cancels the test that runs when a process exits.
  if (!('Deno' in globalThis)) setImmediate(() => process.exit());
}
