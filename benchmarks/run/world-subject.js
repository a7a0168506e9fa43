/** Scenes in one world as a subject (see measure.js), drawn into an off-screen texture. */
import { PassTimer, Viewpoint, World } from '@gaussian-splat/renderer';

export class WorldSubject {
  #device;
  #viewpoint;
  #timer;
  #target;
  #eachFrame;
  #frame = 0;

  /**
   * @param scenes {GaussianScene[]} they stay yours
   * @param how.eachFrame gets the world and the number of the frame that is drawn next
   */
  constructor(device, scenes, { width, height, settings, eachFrame = () => {} }) {
    this.#device = device;
    this.world = new World();
    for (const scene of scenes) this.world.add({ scene });
    this.#viewpoint = new Viewpoint(device, this.world, { settings });
    this.#eachFrame = eachFrame;
    const usage = GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.COPY_SRC | GPUTextureUsage.STORAGE_BINDING;
    this.#target = device.createTexture({ label: 'bench.target', size: [width, height], format: 'rgba8unorm', usage });
    if (device.features.has('timestamp-query')) {
      this.#timer = new PassTimer(device);
      this.readTimes = () => this.#timer.read();
    }
  }

  draw(camera, timed) {
    this.#eachFrame(this.world, this.#frame++);
    this.#viewpoint.draw(camera, { target: this.#target, timer: timed ? this.#timer : undefined });
  }

  submitNothing() {
    this.#device.queue.submit([this.#device.createCommandEncoder({ label: 'bench.nothing' }).finish()]);
  }

  finish() {
    return this.#device.queue.onSubmittedWorkDone();
  }

  /** Bytes of GPU memory between the stages, scenes not counted. */
  get byteLength() {
    return this.#viewpoint.byteLength;
  }

  async facts() {
    const scenes = this.world.placements.map(({ scene }) => scene);
    return {
      scenes: scenes.length,
      splats: scenes.reduce((sum, { count }) => sum + count, 0),
      bytes: { scene: scenes.reduce((sum, { byteLength }) => sum + byteLength, 0), viewpoint: this.byteLength },
      rasterizer: this.#viewpoint.rasterizer,
      statistics: await this.#viewpoint.stats(),
    };
  }

  close() {
    this.#viewpoint.destroy();
    this.#timer?.destroy();
    this.#target.destroy();
  }
}

/** Counts the buffers that a device is asked for from now on, and their bytes. */
export function countAllocations(device) {
  const own = Object.hasOwn(device, 'createBuffer');
  const createBuffer = device.createBuffer.bind(device);
  let work = { buffers: 0, bytes: 0 };
  device.createBuffer = (descriptor) => {
    work.buffers++;
    work.bytes += descriptor.size;
    return createBuffer(descriptor);
  };
  return {
    /** Requests since the last call. */
    take() {
      const taken = work;
      work = { buffers: 0, bytes: 0 };
      return taken;
    },
    stop() {
      if (!own) delete device.createBuffer;
    },
  };
}
