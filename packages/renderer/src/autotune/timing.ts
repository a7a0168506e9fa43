/** Tests a device before its first frame: whether a variant is correct, and how fast it is. */
import { GaussianBuffers } from '../gaussian-buffers.js';
import { madeTogether, perDevice, TEXTURE_USAGE } from '../gpu/kernel.js';
import { QueueClock } from '../gpu/queue-clock.js';
import { Viewpoint } from '../viewpoint.js';
import { World } from '../world.js';
import type { PackedGaussians } from '../pack/pack.js';
import { faultsOf, PREFERRED, type Variants } from '../variants.js';
import { selfTestOf } from '../gpu/self-test-of.js';
import { expectedImage, faultOf, viewpointOf } from './self-test.js';
import { copiesOf, packSpheres, probeCamera, sphereCloud } from './spheres.js';

export { expectedImage };

/** Number of frames in one trial. */
export const FRAMES = 4;

/** A scene to time, and the image size in pixels. */
export interface TimingScene {
  readonly scene: () => PackedGaussians;
  readonly width: number;
  readonly height: number;
}

/**
 * Resolves to whether a variant passes the self-test. The result is cached for each device. The performance timeline
 * contains the duration as `gaussian-splat.self-test`, with the milliseconds that pipelines compile as `detail.compiling`.
 * @param format Format of the targets of later frames, whose pipelines are compiled meanwhile.
 * @param tested What is tested, if the variant is tested more than once.
 */
export const passes = (
  device: GPUDevice,
  variants: Variants,
  format?: GPUTextureFormat,
  tested = 'variants',
): Promise<boolean> =>
  perDevice(device, `right ${tested} ${JSON.stringify(variants)}`, async () => {
    selfTestOf(device).run ??= (what) => passes(device, PREFERRED, undefined, what);
    const start = performance.now();
    await madeTogether(device, () => prepare(device, variants, format ?? ANSWER_TARGET.format));
    const detail = { compiling: performance.now() - start };
    let fault: string | undefined = 'WebGPU calls of the self-test, which it refuses';
    const isKnown = await isValid(device, async () => (fault = await faultOf(device, variants)) === undefined);
    if (!isKnown) faultsOf(device).push(`The self-test finds errors of this GPU: ${fault}. Other variants draw.`);
    performance.measure('gaussian-splat.self-test', { start, detail });
    return isKnown;
  });

/** Starts to compile the pipelines of a first frame. */
function prepare(device: GPUDevice, variants: Variants, format: GPUTextureFormat): void {
  const renderer = new Viewpoint(device, new World(), { settings: variants });
  renderer.prepare([{}], format);
  renderer.destroy();
}

/** Resolves to whether a self-test passes without a WebGPU validation error. */
export async function isValid(device: GPUDevice, answer: () => Promise<boolean>): Promise<boolean> {
  device.pushErrorScope('validation');
  const isAnswer = await answer().catch(() => false);
  return (await device.popErrorScope().catch(() => undefined)) === null && isAnswer;
}

/** Texture properties of the self-test's target. */
export const ANSWER_TARGET = { format: 'rgba32float', usage: TEXTURE_USAGE.renderAttachment } as const;

/** Texture properties of a target that resembles a canvas. */
const PAGE_TARGET = {
  format: 'rgba8unorm',
  usage: TEXTURE_USAGE.renderAttachment | TEXTURE_USAGE.storageBinding,
} as const;

/** The smallest scene of the trials. */
const SMALL: TimingScene = {
  scene: () => copiesOf(packSpheres(sphereCloud(256, 0.46), 'int8'), 16),
  width: 320,
  height: 180,
};

/** Resolves to whether a variant passes the self-test and draws a small frame within `maxFrameMs` milliseconds. */
export async function isGoodStart(
  device: GPUDevice,
  variants: Variants,
  maxFrameMs: number,
  format?: GPUTextureFormat,
): Promise<boolean> {
  if (!(await passes(device, variants, format))) return false;
  const clock = await FrameClock.on(device);
  // Uses the target of the self-test, so that this trial compiles no pipeline of its own.
  return (await timeFrames(device, variants, SMALL, clock, ANSWER_TARGET)) <= maxFrameMs;
}

/** Resolves to the milliseconds of a frame, averaged over {@link FRAMES} consecutive frames. */
export async function timeFrames(
  device: GPUDevice,
  variants: Variants,
  { scene, width, height }: TimingScene,
  clock: FrameClock,
  target: { readonly format: GPUTextureFormat; readonly usage: number } = PAGE_TARGET,
): Promise<number> {
  const gaussians = await GaussianBuffers.upload(device, scene(), { isCounted: false });
  const renderer = viewpointOf(device, [gaussians], variants);
  const texture = device.createTexture({ label: 'gs.probe', size: [width, height], ...target });
  const camera = probeCamera(width, height);
  const draw = (): void => renderer.draw(camera, { target: texture });
  // The first frame also compiles pipelines, so its time is ignored.
  await clock.time(1, draw);
  const time = await clock.time(FRAMES, draw);
  texture.destroy();
  renderer.destroy();
  gaussians.destroy();
  return time;
}

/** Measures the duration of several consecutive frames, with a single wait for the queue. */
export class FrameClock {
  readonly #clock: QueueClock;

  static async on(device: GPUDevice): Promise<FrameClock> {
    const clock = QueueClock.of(device);
    await clock.calibrate();
    return new FrameClock(clock);
  }

  private constructor(clock: QueueClock) {
    this.#clock = clock;
  }

  /** Resolves to the milliseconds of a frame, averaged over the `count` frames that `draw` submits. */
  async time(count: number, draw: () => void): Promise<number> {
    const begin = performance.now();
    for (let frame = 0; frame < count; frame++) draw();
    const { now } = await this.#clock.done();
    return Math.max(0, now - begin - this.#clock.latency) / count;
  }
}
