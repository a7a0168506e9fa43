/** A device of Dawn in Node. Tests that use it run under `gpuEnvironment()` of scripts/lib. */
import { autotune } from '@gaussian-splat/renderer';
import { requestNodeAdapter } from '../../packages/cli/src/lib/node-gpu.mjs';
import { isFull } from './extent.js';

const devices = new Map<string, Promise<GPUDevice>>();

/**
 * Tests in Deno, `npm run lab -- wgpu`. Its driver on a machine without a GPU, lavapipe, truncates values that it blends into rgba16float: by 0.98 of a unit in the last place on average.
 * The self-test refuses such quads, and pages blend into rgba32float there; so do these tests.
 */
const IS_WGPU = 'Deno' in globalThis;
const ACCUMULATION = IS_WGPU ? 'rgba32float' : 'rgba16float';

/** One device for all tests of a file, at WebGPU's default limits and without any optional feature. Renderers on it draw as on any GPU that nothing is known of. */
export function nodeDevice(): Promise<GPUDevice> {
  return once('parallel', async () => {
    const device = await requestDevice();
    return IS_WGPU ? drawnWith(device, 'parallel') : device;
  });
}

/**
 * The same, for tests that are not about how stages divide their work: renderers on it have the stages and the sort that pages on SwiftShader have, which it compiles in
 * a tenth of the time. Images are the same.
 */
export function serialDevice(): Promise<GPUDevice> {
  return once('serial', async () => asOnSwiftShader(await requestDevice()));
}

/** A device whose renderers have from now on what {@link serialDevice} says. */
export function asOnSwiftShader(device: GPUDevice): Promise<GPUDevice> {
  return drawnWith(device, 'serial');
}

async function drawnWith(device: GPUDevice, threads: 'serial' | 'parallel'): Promise<GPUDevice> {
  const isBlendable = device.features.has('float32-blendable');
  const accumulation = isBlendable ? ACCUMULATION : 'rgba16float';
  const choice = JSON.stringify({ rasterizer: 'quads', accumulation, threads });
  await autotune(device, { store: { getItem: () => choice, setItem: () => undefined } });
  return device;
}

/** For tests that must pass however stages divide their work: {@link nodeDevice} in `npm test -- --full`, else {@link serialDevice}, since `variants.lab.test.ts` finds the images of both to be the same. */
export function anyDevice(): Promise<GPUDevice> {
  return isFull ? nodeDevice() : serialDevice();
}

async function requestDevice(): Promise<GPUDevice> {
  const requiredFeatures: GPUFeatureName[] = IS_WGPU ? ['float32-blendable'] : [];
  return (await requestNodeAdapter()).requestDevice({ requiredFeatures });
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

/** If several files run in this process, none of them ends the devices. The function returned ends them for all. */
export function keepNodeDevice(): () => Promise<void> {
  isKept = true;
  return endDevices;
}

async function endDevices(): Promise<void> {
  for (const device of await Promise.all(devices.values())) {
    await device.queue.onSubmittedWorkDone();
    device.destroy();
  }
  // Deno exits on its own, and cancels the test that runs when a process exits.
  if (!('Deno' in globalThis)) setImmediate(() => process.exit());
}
