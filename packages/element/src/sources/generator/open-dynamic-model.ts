/**
 * Opens generators. The module is loaded only for them: only it and post-view.ts depend on `@gaussian-splat/generator`.
 */
import { SPLAT_FILTERS } from '@gaussian-splat/core';
import { Generator, setRuntimeLocation, type GeneratorModel, type ModelSource } from '@gaussian-splat/generator';
import { DynamicGaussians } from '@gaussian-splat/renderer';
import { pickInitialVariants } from '@gaussian-splat/renderer';
import { LoadedGaussians } from '../../gpu/loaded-gaussians.js';
import { limitScenes } from '../../gpu/memory-budget.js';
import { images as frames, unlessWrong } from '../../gpu/initial-frames.js';
import type { ProgressListener } from '../../loading/protocol.js';
import type { OpenSource } from '../source-kind.js';
import { inputsOf } from './inputs.js';
import type { DynamicModel, DynamicRequest } from './dynamic-model.js';
import { InputImages } from './input-images.js';
import { fetchBeside, readsHeaders } from './model-files.js';
import { gpuCheckOf, offerPanel } from './of-element.js';
import { StateReader } from './read-state.js';
import { RunWatch } from './run-watch.js';
import { waitForImages, type WaitingPlace } from './wait-for-images.js';
import type { Vector3 } from '@gaussian-splat/core';
import type { Contract } from '@gaussian-splat/core/contract';
import { modelMemory } from '@gaussian-splat/core/onnx';
import { parseUp } from '../../viewer/camera/grammar.js';
import type { SceneBounds } from '../../viewer/camera/settings.js';
import type { GeneratorMemoryDetail } from '../../viewer/events.js';

/** Maximum size of a contract in bytes. */
const MAX_CONTRACT = 2 ** 20;

/**
 * Returns the bounds that a contract declares for the centers of the Gaussians, which also serve as those of the
 * subject; undefined if it declares none.
 */
export function declaredBounds(contract: Contract): SceneBounds | undefined {
  const { bounds } = contract;
  if (bounds === undefined) return undefined;
  const { min, max } = bounds;
  const center = [0, 1, 2].map((axis) => (min[axis] + max[axis]) / 2) as [number, number, number];
  const sides = [0, 1, 2].map((axis) => max[axis] - min[axis]);
  // Centers rarely fill the corners of a box, so the sphere with 90 % of them is smaller than the one around the box.
  // The sphere of a long subject still contains both of its ends.
  const radius = Math.max(0.7 * Math.hypot(...sides), ...sides) / 2 || 1;
  return { min, max, center, radius, up: upOf(contract) };
}

/** Returns the up direction that a contract declares, as a unit vector; undefined if it declares none. */
export const upOf = ({ coordinates }: Contract): Vector3 | undefined =>
  parseUp(coordinates?.up?.replace('+', '') ?? '') ?? undefined;

/**
 * Fraction of the progress that follows the download of a generator: compiling the runtime, creating a session, and the
 * first run. The duration of these steps is unknown, so the progress stays below 1 until the first frame.
 */
const WARM_UP = 0.25;

/** Opens the scene of a generator. */
export const open: OpenSource = async (request, options, acquiring) => {
  const lease = await acquiring;
  const { signal, onProgress, beforeUpload, memoryBudget, submissions } = options;
  let live: DynamicModel | undefined;
  try {
    signal.throwIfAborted();
    limitScenes(lease.device, memoryBudget);
    const starting = pickInitialVariants(lease.device, frames()).catch(unlessWrong);
    starting.catch(() => undefined);
    live = await openDynamicModel(
      { ...options.live(), ...request, memoryBudget },
      lease.device,
      signal,
      (loaded, total) => onProgress(loaded, total, total && ((1 - WARM_UP) * loaded) / total),
      starting.then(() => options),
    );
    await starting;
    beforeUpload(live.gaussians.byteLength);
    return new LoadedGaussians(lease, live.gaussians, live.bounds, submissions, { live });
  } catch (error) {
    live?.close();
    live?.gaussians.destroy();
    throw error;
  }
};

/**
 * Opens a generator and waits for its first run. Rejects with GaussianSplatError, or the signal's reason.
 * @param place Resolves with the place where an empty scene is shown until the image inputs arrive.
 */
async function openDynamicModel(
  request: DynamicRequest,
  device: GPUDevice,
  signal: AbortSignal,
  onProgress: ProgressListener,
  place: Promise<WaitingPlace>,
): Promise<DynamicModel> {
  if (request.runtimeLocation !== null) setRuntimeLocation(new URL(request.runtimeLocation, document.baseURI));
  let firstFailure: unknown;
  let isOpen = false;
  const { listeners } = request;
  const generator = await Generator.open(await sourcesOf(request, signal), device, {
    signal,
    onProgress,
    onFrame: ({ state }) => {
      if (isOpen) listeners.onFrame(state.timeSeconds ?? 0);
      watch?.frameMade();
    },
    onError: (error) => (isOpen ? listeners.onError(error) : (firstFailure = error)),
    gpuCheck: gpuCheckOf(request),
    onFallback: (reason) => {
      listeners.onFallback(reason);
      listeners.onInput();
    },
  });
  let watch: RunWatch | undefined;
  // The generator is closed at once if the signal is aborted before it is open.
  signal.addEventListener('abort', () => !isOpen && generator.close(), { once: true });
  let gaussians: DynamicGaussians | undefined;
  let images: InputImages | undefined;
  try {
    const { models, model } = generator;
    for (const { notes, url } of models) for (const note of notes) console.warn(`<gaussian-splat>: ${url}: ${note}.`);
    gaussians = await DynamicGaussians.create(device, model.layout, {
      ...(model.contract.filter ? SPLAT_FILTERS[model.contract.filter] : { antialiased: model.contract.antialiased }),
      memoryBudget: request.memoryBudget,
    });
    generator.sink = gaussians;
    // Another source may have replaced this one meanwhile.
    signal.throwIfAborted();
    request.element.dispatchEvent(
      new CustomEvent('generator-memory', { detail: memoryOf(models, gaussians.byteLength) }),
    );
    const { onInput: onChange, onError } = listeners;
    const { credentials } = request;
    const whenIdle = (): Promise<void> => generator.idle;
    images = new InputImages(device, models, new Set(), { credentials, signal, onChange, onError, whenIdle });
    const live = liveModel(generator, gaussians, images, request);
    const declared = declaredBounds(model.contract);
    images.update(request.state().images);
    await images.settled();
    signal.throwIfAborted();
    offerPanel(request.element);
    if (!images.areComplete) await waitForImages(live, model, images, { request, signal, place: await place });
    signal.throwIfAborted();
    live.request(request.state(), request.camera(declared));
    await generator.idle;
    signal.throwIfAborted();
    if (firstFailure !== undefined) throw asError(firstFailure);
    let bounds = declared ?? (await live.readBounds!());
    signal.throwIfAborted();
    isOpen = true;
    watch = new RunWatch(gaussians, {
      where: model.header.name,
      idle: whenIdle,
      onError,
      onBounds: (now, isFirst) => {
        // Declared bounds contain the Gaussians of all times. A sample replaces them only if the previous one had no
        // visible Gaussians.
        if (declared === undefined || isFirst) bounds = { ...now, up: upOf(model.contract) };
        if (isFirst) void (request.element as Framed).updateFraming?.();
      },
    });
    watch.frameMade();
    const { attribution, license } = model.contract;
    return {
      ...live,
      ...((attribution || license) && { credits: { attribution, license } }),
      get bounds() {
        return bounds;
      },
      close: () => {
        watch?.close();
        live.close();
      },
    };
  } catch (error) {
    generator.close();
    images?.destroy();
    gaussians?.destroy();
    throw error;
  }
}

/** Returns the memory of all models of a chain, as far as it is known before the first run. */
function memoryOf(models: readonly GeneratorModel[], gaussianBytes: number): GeneratorMemoryDetail {
  const all = models.map(({ header }) => modelMemory(header));
  const sizes = all.flatMap(({ largestKnownTensorBytes }) => largestKnownTensorBytes ?? []);
  return {
    weightBytes: all.reduce((sum, { weightBytes }) => sum + weightBytes, 0),
    largestKnownTensorBytes: sizes.length > 0 ? Math.max(...sizes) : null,
    unknownTensors: all.reduce((sum, { unknownTensors }) => sum + unknownTensors, 0),
    gaussianBytes,
  };
}

function liveModel(
  generator: Generator,
  gaussians: DynamicGaussians,
  images: InputImages,
  { listeners, ownsControls }: DynamicRequest,
): Omit<DynamicModel, 'bounds'> {
  const { models, model } = generator;
  const up = upOf(model.contract);
  const reader = new StateReader(models, listeners.onError);
  let isClosed = false;
  return {
    gaussians,
    generator,
    inputs: inputsOf(models),
    settable: reader.settable,
    readBounds: async () => ({ ...(await gaussians.readBounds()), up }),
    duration: models.some(takesTime)
      ? (models.find(({ contract }) => contract.duration !== undefined)?.contract.duration ?? Infinity)
      : NaN,
    request: (state, camera) => {
      images.update(state.images);
      reader.checkPose(state);
      // Several images and the pose of their cameras belong together, so no run may mix old and new ones. When the last
      // image has arrived, a frame requests the run again.
      if (images.isLoading) return;
      generator.request(reader.read(state, camera, images.tensors, ownsControls() ? [] : null));
      // A state that is shown already is not run, and a run that fails shows none. A seek ends in both cases.
      void generator.idle.then(() => isClosed || listeners.onShown(state.timeSeconds));
    },
    close: () => {
      isClosed = true;
      generator.close();
      images.destroy();
    },
  };
}

/** Returns the sources of all models of a chain. The contract that the page sets is that of the first model. */
async function sourcesOf(request: DynamicRequest, signal: AbortSignal): Promise<ModelSource[]> {
  const { url, chain = [], credentials } = request;
  const contract = await contractOf(request, signal);
  const openHeader = readsHeaders(request.loader, request.limits);
  return [{ url, credentials, contract, openHeader }, ...chain.map((next) => ({ url: next, credentials, openHeader }))];
}

async function contractOf(request: DynamicRequest, signal: AbortSignal): Promise<unknown> {
  const { credentials } = request;
  // Templates may write an empty attribute, which counts as none: as an address it would refer to the page.
  const contract = typeof request.contract === 'string' ? request.contract.trim() : request.contract;
  if (typeof contract !== 'string' || contract === '' || contract.startsWith('{')) return contract || undefined;
  const remedy = 'check the address in the attribute contract, or leave it out';
  const options = { credentials, signal };
  const bytes = await fetchBeside(contract, options, MAX_CONTRACT, 'the contract that the attribute names', remedy);
  return new TextDecoder().decode(bytes);
}

/**
 * Returns whether a model depends on the time. If none does, there is nothing to play. An input of role `frame` needs
 * `fps`, which relates frames to time.
 */
const takesTime = ({ contract: { inputs, fps } }: GeneratorModel): boolean =>
  Object.values(inputs).some(({ role }) => role === 'time' || (role === 'frame' && fps !== undefined));

/** An element that may frame its scene; a child element has no such method. */
interface Framed extends HTMLElement {
  updateFraming?(): Promise<void>;
}

const asError = (error: unknown): Error => (error instanceof Error ? error : new Error(String(error)));
