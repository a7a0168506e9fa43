/** Resolves three.js's multisampled depth to one depth for each pixel. */
import { readBack } from '@gaussian-splat/renderer/tools';

const SHADER = /* wgsl */ `
@group(0) @binding(0) var samples: texture_depth_multisampled_2d;

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
  return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

// The nearest of the samples: where one of them meets a mesh, the pixel has its layer.
@fragment
fn fragment(@builtin(position) position: vec4f) -> @builtin(frag_depth) f32 {
  let pixel = vec2u(position.xy);
  var nearest = 0.0;
  for (var i = 0u; i < textureNumSamples(samples); i++) { nearest = max(nearest, textureLoad(samples, pixel, i)); }
  return nearest;
}
`;

/** Shader that reads the depth at single pixels; 0 is infinitely far. */
const PROBE = /* wgsl */ `
@group(0) @binding(0) var depths: texture_depth_2d;
@group(0) @binding(1) var<storage, read> points: array<vec2u>;
@group(0) @binding(2) var<storage, read_write> found: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
  if (id.x < arrayLength(&points)) { found[id.x] = textureLoad(depths, points[id.x], 0); }
}
`;

export class MeshResolve {
  readonly #device: GPUDevice;
  readonly #pipeline: GPURenderPipeline;
  /** For each kind of triangles: `samples`, the multisampled depth, and `depth`, the depth of the pixels. */
  readonly #resolved: { samples: GPUTexture; depth: GPUTexture; group: GPUBindGroup }[] = [];

  constructor(device: GPUDevice) {
    this.#device = device;
    const module = device.createShaderModule({ label: 'gs.mesh_resolve', code: SHADER });
    this.#pipeline = device.createRenderPipeline({
      label: 'gs.mesh_resolve',
      layout: 'auto',
      vertex: { module },
      fragment: { module, targets: [] },
      depthStencil: { format: 'depth32float', depthWriteEnabled: true, depthCompare: 'always' },
    });
  }

  /**
   * Depth of opaque triangles in the last frame, `near / z`: 0 in pixels without triangles. undefined before the first
   * frame.
   */
  get depth(): GPUTexture | undefined {
    return this.#resolved[0]?.depth;
  }

  /**
   * Resolves the depth of a kind of triangles.
   * @param kind Kind of triangles, from 0.
   * @param samples Multisampled depth of the frame.
   * @returns The depth of the frame; the same texture while its size does not change.
   */
  run(kind: number, samples: GPUTexture): GPUTexture {
    const { depth, group } = this.#resolvedOf(kind, samples);
    const encoder = this.#device.createCommandEncoder({ label: 'gs.mesh_resolve' });
    const pass = encoder.beginRenderPass({
      label: 'gs.mesh_resolve',
      colorAttachments: [],
      depthStencilAttachment: {
        view: depth.createView(),
        depthLoadOp: 'clear',
        depthClearValue: 0,
        depthStoreOp: 'store',
      },
    });
    pass.setPipeline(this.#pipeline);
    pass.setBindGroup(0, group);
    pass.draw(3);
    pass.end();
    this.#device.queue.submit([encoder.finish()]);
    return depth;
  }

  /**
   * Returns the stored depth of opaque triangles at pixels [x, y] of the last frame; 0 in pixels without triangles.
   * Reads back from the GPU, for clicks and labels.
   */
  async read(pixels: readonly (readonly [number, number])[]): Promise<Float32Array> {
    const { depth } = this;
    if (depth === undefined || pixels.length === 0) return new Float32Array(pixels.length);
    const device = this.#device;
    const { STORAGE, COPY_DST, COPY_SRC } = GPUBufferUsage;
    const make = (name: string, bytes: number, usage: number): GPUBuffer =>
      device.createBuffer({ label: `gs.mesh_probe.${name}`, size: bytes * pixels.length, usage });
    const points = make('points', 8, STORAGE | COPY_DST);
    const found = make('found', 4, STORAGE | COPY_SRC);
    try {
      device.queue.writeBuffer(points, 0, Uint32Array.from(pixels.flat()));
      const pipeline = device.createComputePipeline({
        label: 'gs.mesh_probe',
        layout: 'auto',
        compute: { module: device.createShaderModule({ label: 'gs.mesh_probe', code: PROBE }) },
      });
      const entries = [depth.createView(), { buffer: points }, { buffer: found }];
      const group = device.createBindGroup({
        label: 'gs.mesh_probe',
        layout: pipeline.getBindGroupLayout(0),
        entries: entries.map((resource, binding) => ({ binding, resource })),
      });
      const encoder = device.createCommandEncoder({ label: 'gs.mesh_probe' });
      const pass = encoder.beginComputePass({ label: 'gs.mesh_probe' });
      pass.setPipeline(pipeline);
      pass.setBindGroup(0, group);
      pass.dispatchWorkgroups(Math.ceil(pixels.length / 64));
      pass.end();
      const [depths] = await readBack(device, [{ buffer: found }], encoder);
      return new Float32Array(depths);
    } finally {
      for (const buffer of [points, found]) buffer.destroy();
    }
  }

  destroy(): void {
    for (const { depth } of this.#resolved.splice(0)) depth.destroy();
  }

  #resolvedOf(kind: number, samples: GPUTexture): { depth: GPUTexture; group: GPUBindGroup } {
    const known = this.#resolved[kind];
    if (known?.samples === samples) return known;
    known?.depth.destroy();
    const { RENDER_ATTACHMENT, TEXTURE_BINDING } = GPUTextureUsage;
    const depth = this.#device.createTexture({
      label: 'gs.mesh_resolve.depth',
      size: [samples.width, samples.height],
      format: 'depth32float',
      usage: RENDER_ATTACHMENT | TEXTURE_BINDING,
    });
    const group = this.#device.createBindGroup({
      label: 'gs.mesh_resolve',
      layout: this.#pipeline.getBindGroupLayout(0),
      entries: [{ binding: 0, resource: samples.createView() }],
    });
    const made = { samples, depth, group };
    this.#resolved[kind] = made;
    return made;
  }
}
