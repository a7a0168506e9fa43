/** Our renderer as a subject (see measure.js): one configuration of it, drawing into an off-screen texture. */
import { PassTimer, Viewpoint, World } from '@gaussian-splat/renderer';
import { watchOptions } from './levers.js';
import { readPixels } from './read-pixels.js';

const DISPLAY = 'rgba8unorm';
const PRECISE = 'rgba32float';

export class OwnRenderer {
  #device;
  #viewpoint;
  #gaussians;
  #timer;
  #target;
  #unread;

  /**
   * @param upload {{buffers: GaussianBuffers[], ignored: string[]}} the scene; it stays yours.
   * @param configuration {{options, resolutionScale, width, height}}
   */
  constructor(device, { buffers, ignored = [] }, { options, resolutionScale, width, height }) {
    const watched = watchOptions(resolutionScale === 1 ? options : { resolutionScale, ...options });
    this.#device = device;
    this.#gaussians = buffers;
    const world = new World();
    for (const scene of buffers) world.add({ scene });
    this.#viewpoint = new Viewpoint(device, world, { settings: watched.options });
    this.#unread = () => [...watched.unread(), ...ignored];
    this.#target = makeTarget(device, DISPLAY, { width, height });
    if (device.features.has('timestamp-query')) {
      this.#timer = new PassTimer(device);
      this.readTimes = () => this.#timer.read();
    }
  }

  draw(camera, timed) {
    this.#drawInto(this.#target, camera, timed ? this.#timer : undefined);
  }

  submitNothing() {
    this.#device.queue.submit([this.#device.createCommandEncoder({ label: 'bench.nothing' }).finish()]);
  }

  finish() {
    return this.#device.queue.onSubmittedWorkDone();
  }

  /**
   * One view over black, before any rounding to 8 bits: [height, width, 4] premultiplied float32.
   * @param before cameras that lead to it: the view is then shown as that frame of the movement, not as a still image
   */
  async capture(camera, before = []) {
    const target = makeTarget(this.#device, PRECISE, camera);
    try {
      for (const step of before) await this.#drawWhole(target, step);
      if (before.length > 0) this.#drawInto(target, camera);
      else await this.#drawWhole(target, camera);
      return await readPixels(this.#device, target);
    } finally {
      target.destroy();
    }
  }

  /** Facts that only this configuration can report after it has drawn. */
  async facts() {
    const scene = this.#gaussians.reduce((sum, { byteLength }) => sum + byteLength, 0);
    const splats = this.#gaussians.reduce((sum, { count }) => sum + count, 0);
    const renderer = this.#viewpoint.byteLength;
    return {
      splats,
      shDegree: this.#gaussians[0]?.shDegree,
      rasterizer: this.#viewpoint.rasterizer,
      statistics: await this.#viewpoint.stats(),
      bytes: { scene, renderer, perSplat: Number(((scene + renderer) / splats).toFixed(1)) },
      ignoredOptions: this.#unread(),
    };
  }

  close() {
    this.#viewpoint.destroy();
    this.#timer?.destroy();
    this.#target.destroy();
  }

  /** Draws until there was room for everything. */
  async #drawWhole(target, camera) {
    this.#drawInto(target, camera);
    for (let tries = 0; tries < 3 && !(await this.#hadRoom()); tries++) this.#drawInto(target, camera);
  }

  async #hadRoom() {
    const { overflow, pairOverflow } = await this.#viewpoint.stats();
    if (overflow + pairOverflow === 0) return true;
    // Asking makes room.
    return this.#viewpoint.isComplete();
  }

  #drawInto(target, camera, timer) {
    this.#viewpoint.draw(camera, { target, timer });
  }
}

function makeTarget(device, format, { width, height }) {
  const usage = GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.COPY_SRC | GPUTextureUsage.STORAGE_BINDING;
  return device.createTexture({ label: 'bench.target', size: [width, height], format, usage });
}
