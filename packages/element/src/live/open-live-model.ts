/** Loaded only when a generator is shown: everything that knows `@gaussian-splat/generator` is in this module. */
import { GaussianSplatError, type Bounds, type Camera, type Contract } from '@gaussian-splat/core';
import { Generator, setRuntimeLocation, type GeneratorState } from '@gaussian-splat/generator';
import { DynamicGaussians } from '@gaussian-splat/renderer';
import type { ProgressListener } from '../loading/protocol.js';
import type { LiveModel, LiveRequest, LiveState } from './live-model.js';

/** A generator, once its first run is in its Gaussians. Rejects with GaussianSplatError, or the signal's reason. */
export async function openLiveModel(
  request: LiveRequest,
  device: GPUDevice,
  signal: AbortSignal,
  onProgress: ProgressListener,
): Promise<LiveModel> {
  if (request.runtimeLocation !== null) setRuntimeLocation(new URL(request.runtimeLocation, document.baseURI));
  const { credentials, url } = request;
  const contract = await contractOf(request, signal);
  let firstFailure: unknown;
  let isOpen = false;
  const { listeners } = request;
  const generator = await Generator.open({ url, credentials, contract }, device, {
    signal,
    onProgress,
    onFrame: ({ state }) => isOpen && listeners.onFrame(state.timeSeconds ?? 0),
    onError: (error) => (isOpen ? listeners.onError(error) : (firstFailure = error)),
    onFallback: listeners.onFallback,
  });
  let gaussians: DynamicGaussians | undefined;
  try {
    const { layout, contract: found } = generator.model;
    for (const note of generator.model.notes) console.warn(`<gaussian-splat>: ${url}: ${note}.`);
    gaussians = await DynamicGaussians.create(device, layout, {
      antialiased: found.antialiased,
      memoryBudget: request.memoryBudget,
    });
    generator.sink = gaussians;
    generator.request(toState(request.state(), found, request.camera(declaredBounds(found))));
    await generator.idle;
    signal.throwIfAborted();
    if (firstFailure !== undefined) throw asError(firstFailure);
    const bounds = declaredBounds(found) ?? (await gaussians.readBounds());
    signal.throwIfAborted();
    isOpen = true;
    return liveModel(generator, gaussians, bounds);
  } catch (error) {
    generator.close();
    gaussians?.destroy();
    throw error;
  }
}

function liveModel(generator: Generator, gaussians: DynamicGaussians, bounds: Bounds): LiveModel {
  const { contract } = generator.model;
  return {
    gaussians,
    bounds,
    duration: contract.duration ?? Infinity,
    request: (state, camera) => generator.request(toState(state, contract, camera)),
    close: () => generator.close(),
  };
}

/** What the page says in the words of the generator. */
function toState({ timeSeconds, pose, controls }: LiveState, contract: Contract, camera: Camera): GeneratorState {
  const named: Record<string, number | readonly number[]> = {};
  for (const [name, binding] of Object.entries(contract.inputs)) {
    if (binding.role !== 'control') continue;
    const value = controls[name] ?? controls[name.toLowerCase()];
    if (value !== undefined) named[name] = value.length === 1 ? value[0] : value;
  }
  const shapeName = Object.keys(contract.inputs).find((name) => contract.inputs[name].role === 'shape') ?? '';
  const shape = controls[shapeName] ?? controls[shapeName.toLowerCase()];
  return { timeSeconds, camera, pose, controls: named, shape };
}

async function contractOf({ contract, credentials }: LiveRequest, signal: AbortSignal): Promise<unknown> {
  if (typeof contract !== 'string' || contract.trim().startsWith('{')) return contract || undefined;
  const url = new URL(contract, document.baseURI).href;
  const response = await fetch(url, { credentials, signal }).catch((cause: unknown) => {
    signal.throwIfAborted();
    throw noContract(url, (cause as Error).message);
  });
  if (!response.ok) throw noContract(url, `HTTP status ${response.status}`);
  return response.text();
}

const noContract = (url: string, found: string): GaussianSplatError =>
  new GaussianSplatError('network/status', {
    where: url.slice(0, 200),
    expected: 'the contract that the attribute names',
    found,
    remedy: 'check the address in the attribute contract, or leave it out',
  });

/** Bounds of the centres are those of the subject, too. */
function declaredBounds({ bounds }: Contract): Bounds | undefined {
  if (bounds === undefined) return undefined;
  const { min, max } = bounds;
  const center = [0, 1, 2].map((axis) => (min[axis] + max[axis]) / 2) as [number, number, number];
  const radius = Math.hypot(max[0] - min[0], max[1] - min[1], max[2] - min[2]) / 2 || 1;
  // Centres fill a box's corners seldom: the ball that 90 % of them are in is smaller than the one around the box.
  return { min, max, center, radius: radius * 0.7 };
}

const asError = (error: unknown): Error => (error instanceof Error ? error : new Error(String(error)));
