/** Other work that a page gives the GPU: arithmetic on a device, and so a queue, of its own, as much in each frame as takes a time. */

const WORKGROUPS = 2048;
const SHADER = `
  @group(0) @binding(0) var<storage, read_write> out: array<f32>;
  @group(0) @binding(1) var<uniform> rounds: u32;
  @compute @workgroup_size(64) fn burn(@builtin(global_invocation_id) id: vec3u) {
    var x = f32(id.x) * 1e-6;
    for (var i = 0u; i < rounds; i++) { x = fma(x, 0.999, 0.001); x = fma(x, 1.001, -0.001); }
    out[id.x % 64u] = x;
  }`;
/** Estimated GPU speed, once a submission takes this long, ms. */
const TELLING_MS = 20;
/** Frames that may be on their way: a page that submits more than the GPU can do would only fall behind. */
const IN_FLIGHT = 2;

export class Burner {
  #device;
  #pipeline;
  #rounds;
  #bindings;
  #perMs = 0;
  #flying = 0;

  static async open() {
    const adapter = await navigator.gpu.requestAdapter({ powerPreference: 'high-performance' });
    const burner = new Burner(await adapter.requestDevice());
    await burner.#findRate();
    return burner;
  }

  constructor(device) {
    const { STORAGE, UNIFORM, COPY_DST } = GPUBufferUsage;
    this.#device = device;
    const module = device.createShaderModule({ code: SHADER });
    this.#pipeline = device.createComputePipeline({ layout: 'auto', compute: { module, entryPoint: 'burn' } });
    this.#rounds = device.createBuffer({ size: 4, usage: UNIFORM | COPY_DST });
    const out = device.createBuffer({ size: 4 * 64, usage: STORAGE });
    this.#bindings = device.createBindGroup({
      layout: this.#pipeline.getBindGroupLayout(0),
      entries: [out, this.#rounds].map((buffer, binding) => ({ binding, resource: { buffer } })),
    });
  }

  /** Rounds of arithmetic that take a millisecond. */
  get perMs() {
    return Math.round(this.#perMs);
  }

  /** Keeps the GPU busy for about the given milliseconds, unless it is already late. */
  burn(milliseconds) {
    const rounds = Math.round(this.#perMs * milliseconds);
    if (rounds < 1 || this.#flying >= IN_FLIGHT) return;
    this.#flying++;
    this.#submit(rounds);
    void this.#device.queue.onSubmittedWorkDone().then(() => this.#flying--);
  }

  #submit(rounds) {
    const { queue } = this.#device;
    queue.writeBuffer(this.#rounds, 0, Uint32Array.of(rounds));
    const encoder = this.#device.createCommandEncoder();
    const pass = encoder.beginComputePass();
    pass.setPipeline(this.#pipeline);
    pass.setBindGroup(0, this.#bindings);
    pass.dispatchWorkgroups(WORKGROUPS);
    pass.end();
    queue.submit([encoder.finish()]);
  }

  async #time(rounds) {
    const begun = performance.now();
    this.#submit(rounds);
    await this.#device.queue.onSubmittedWorkDone();
    return performance.now() - begun;
  }

  /** The duration of an empty submission is the browser's latency. */
  async #findRate() {
    await this.#time(1);
    const min = await this.#time(1);
    for (let rounds = 16; ; rounds *= 4) {
      const took = (await this.#time(rounds)) - min;
      if (took < TELLING_MS) continue;
      this.#perMs = rounds / took;
      return;
    }
  }
}
