/**
 * Makes any WebGPU renderer of this page measurable: its device gets timestamps, every pass of a timed frame is
 * recorded, and its canvas is replaced by one permanent texture, so that neither a compositor nor a display limits the
 * rate.
 */

const MAX_QUERIES = 4096;

/** Must run before the renderer asks for its adapter. */
export function hookWebGPU() {
  const state = { device: undefined, texture: undefined, errors: [] };
  const timer = new PassRecorder();
  hookDevice(state, timer);
  hookPasses(timer);
  hookCanvas(state);
  return { state, timer };
}

/** Timestamps of the passes of frames that were drawn while `recording` was true. */
class PassRecorder {
  recording = false;
  device;
  #queries;
  #frames = [];
  #used = 0;

  startFrame() {
    this.#frames.push([]);
  }

  timestampWrites(label) {
    if (!this.recording || this.#used + 2 > MAX_QUERIES || !this.device.features.has('timestamp-query'))
      return undefined;
    this.#queries ??= this.device.createQuerySet({ type: 'timestamp', count: MAX_QUERIES });
    const at = this.#used;
    this.#used += 2;
    this.#frames.at(-1)?.push({ label, at });
    return { querySet: this.#queries, beginningOfPassWriteIndex: at, endOfPassWriteIndex: at + 1 };
  }

  async read() {
    const [frames, count] = [this.#frames.splice(0), this.#used];
    this.#used = 0;
    if (count === 0) return [];
    const stamps = await readQueries(this.device, this.#queries, count);
    const ms = (i) => Number(stamps[i] - stamps[0]) / 1e6;
    return frames.map((passes) => passes.map(({ label, at }) => ({ label, begin: ms(at), end: ms(at + 1) })));
  }
}

async function readQueries(device, queries, count) {
  const size = 8 * count;
  const resolved = device.createBuffer({ size, usage: GPUBufferUsage.QUERY_RESOLVE | GPUBufferUsage.COPY_SRC });
  const staging = device.createBuffer({ size, usage: GPUBufferUsage.MAP_READ | GPUBufferUsage.COPY_DST });
  const encoder = device.createCommandEncoder();
  encoder.resolveQuerySet(queries, 0, count, resolved, 0);
  encoder.copyBufferToBuffer(resolved, 0, staging, 0, size);
  device.queue.submit([encoder.finish()]);
  await staging.mapAsync(GPUMapMode.READ);
  const stamps = new BigUint64Array(staging.getMappedRange().slice(0));
  resolved.destroy();
  staging.destroy();
  return stamps;
}

/** Replaces a method; the replacement is given the original, bound to the object that it was called on. */
function wrap(prototype, name, replacement) {
  const original = prototype[name];
  prototype[name] = function (...args) {
    return replacement.call(this, (...inner) => original.apply(this, inner), ...args);
  };
}

function hookDevice(state, timer) {
  wrap(GPUAdapter.prototype, 'requestDevice', async function (request, descriptor = {}) {
    const features = new Set(descriptor.requiredFeatures ?? []);
    if (this.features.has('timestamp-query')) features.add('timestamp-query');
    const device = await request({ ...descriptor, requiredFeatures: [...features] });
    device.addEventListener('uncapturederror', ({ error }) => state.errors.push(error.message.slice(0, 300)));
    state.device = timer.device = device;
    return device;
  });
}

function hookPasses(timer) {
  for (const [name, kind] of [
    ['beginComputePass', 'compute'],
    ['beginRenderPass', 'render'],
  ]) {
    wrap(GPUCommandEncoder.prototype, name, function (begin, descriptor = {}) {
      const timestampWrites = timer.timestampWrites(descriptor.label || kind);
      return begin(timestampWrites ? { ...descriptor, timestampWrites } : descriptor);
    });
  }
}

function hookCanvas(state) {
  const configurations = new WeakMap();
  const prototype = GPUCanvasContext.prototype;
  prototype.configure = function (configuration) {
    configurations.set(this, configuration);
    state.texture = undefined;
  };
  prototype.unconfigure = () => {};
  prototype.getConfiguration = function () {
    return configurations.get(this) ?? null;
  };
  prototype.getCurrentTexture = function () {
    const { device, format, viewFormats = [], usage = GPUTextureUsage.RENDER_ATTACHMENT } = configurations.get(this);
    const { width, height } = this.canvas;
    if (state.texture?.width !== width || state.texture.height !== height) {
      state.texture?.destroy();
      state.texture = device.createTexture({
        label: 'bench.canvas',
        size: [width, height],
        format,
        viewFormats: [...viewFormats],
        usage: usage | GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.COPY_SRC,
      });
    }
    return state.texture;
  };
}
