/** From what three.js has drawn, with several samples a pixel, to the frame and one depth a pixel. */
import type { Rgba } from '@gaussian-splat/renderer';

/** Premultiplied colours over what is there. */
const OVER: GPUBlendComponent = { srcFactor: 'one', dstFactor: 'one-minus-src-alpha' };

const SHADER = /* wgsl */ `
@group(0) @binding(0) var drawn: texture_2d<f32>;
@group(0) @binding(1) var depths: texture_depth_multisampled_2d;

struct Resolved {
  @location(0) color: vec4f,
  @builtin(frag_depth) depth: f32,
}

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
  return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn fragment(@builtin(position) position: vec4f) -> Resolved {
  let pixel = vec2u(position.xy);
  return Resolved(textureLoad(drawn, pixel, 0), textureLoad(depths, pixel, 0));
}
`;

/** Reads the depth at single points: 0 is infinitely far. */
const PROBE = /* wgsl */ `
@group(0) @binding(0) var depths: texture_depth_2d;
@group(0) @binding(1) var<storage, read> points: array<vec2u>;
@group(0) @binding(2) var<storage, read_write> found: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
  if (id.x < arrayLength(&points)) { found[id.x] = textureLoad(depths, points[id.x], 0); }
}
`;

interface Bound {
  readonly color: GPUTexture;
  readonly depth: GPUTexture;
  readonly group: GPUBindGroup;
}

export class MeshResolve {
  readonly #device: GPUDevice;
  readonly #module: GPUShaderModule;
  readonly #layout: GPUBindGroupLayout;
  readonly #pipelines = new Map<GPUTextureFormat, GPURenderPipeline>();
  #depth: GPUTexture | undefined;
  #bound: Bound | undefined;

  constructor(device: GPUDevice) {
    this.#device = device;
    this.#module = device.createShaderModule({ label: 'gs.mesh_resolve', code: SHADER });
    const visibility = GPUShaderStage.FRAGMENT;
    this.#layout = device.createBindGroupLayout({
      label: 'gs.mesh_resolve',
      entries: [
        { binding: 0, visibility, texture: { sampleType: 'unfilterable-float' } },
        { binding: 1, visibility, texture: { sampleType: 'depth', multisampled: true } },
      ],
    });
  }

  /** Of the last frame: `near / z`, 0 where there is nothing. */
  get depth(): GPUTexture | undefined {
    return this.#depth;
  }

  /**
   * @param background what is behind the meshes, premultiplied
   * @returns the depth of the frame; the same texture while its size is
   */
  run(color: GPUTexture, depth: GPUTexture, target: GPUTexture, background: Rgba = [0, 0, 0, 0]): GPUTexture {
    const own = this.#depthOf(target);
    if (this.#bound?.color !== color || this.#bound.depth !== depth) this.#bound = this.#bind(color, depth);
    const encoder = this.#device.createCommandEncoder({ label: 'gs.mesh_resolve' });
    const pass = encoder.beginRenderPass({
      label: 'gs.mesh_resolve',
      colorAttachments: [{ view: target.createView(), loadOp: 'clear', clearValue: [...background], storeOp: 'store' }],
      depthStencilAttachment: {
        view: own.createView(),
        depthLoadOp: 'clear',
        depthClearValue: 0,
        depthStoreOp: 'store',
      },
    });
    pass.setPipeline(this.#pipelineFor(target.format));
    pass.setBindGroup(0, this.#bound.group);
    pass.draw(3);
    pass.end();
    this.#device.queue.submit([encoder.finish()]);
    return own;
  }

  /** Stored depths at pixels of the last frame; 0 where there is nothing. Reads back from the GPU: for clicks and labels. */
  async read(pixels: readonly (readonly [number, number])[]): Promise<Float32Array> {
    const depth = this.#depth;
    if (depth === undefined || pixels.length === 0) return new Float32Array(pixels.length);
    const device = this.#device;
    const { STORAGE, COPY_DST, COPY_SRC, MAP_READ } = GPUBufferUsage;
    const make = (name: string, bytes: number, usage: number): GPUBuffer =>
      device.createBuffer({ label: `gs.mesh_probe.${name}`, size: bytes * pixels.length, usage });
    const points = make('points', 8, STORAGE | COPY_DST);
    const found = make('found', 4, STORAGE | COPY_SRC);
    const staging = make('read', 4, COPY_DST | MAP_READ);
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
      encoder.copyBufferToBuffer(found, 0, staging, 0, 4 * pixels.length);
      device.queue.submit([encoder.finish()]);
      await staging.mapAsync(GPUMapMode.READ);
      return new Float32Array(staging.getMappedRange().slice(0));
    } finally {
      for (const buffer of [points, found, staging]) buffer.destroy();
    }
  }

  destroy(): void {
    this.#depth?.destroy();
    this.#depth = undefined;
  }

  #depthOf({ width, height }: GPUTexture): GPUTexture {
    if (this.#depth?.width === width && this.#depth.height === height) return this.#depth;
    this.#depth?.destroy();
    const { RENDER_ATTACHMENT, TEXTURE_BINDING } = GPUTextureUsage;
    return (this.#depth = this.#device.createTexture({
      label: 'gs.mesh_resolve.depth',
      size: [width, height],
      format: 'depth32float',
      usage: RENDER_ATTACHMENT | TEXTURE_BINDING,
    }));
  }

  #bind(color: GPUTexture, depth: GPUTexture): Bound {
    const group = this.#device.createBindGroup({
      label: 'gs.mesh_resolve',
      layout: this.#layout,
      entries: [color, depth].map((texture, binding) => ({ binding, resource: texture.createView() })),
    });
    return { color, depth, group };
  }

  #pipelineFor(format: GPUTextureFormat): GPURenderPipeline {
    const known = this.#pipelines.get(format);
    if (known) return known;
    const pipeline = this.#device.createRenderPipeline({
      label: 'gs.mesh_resolve',
      layout: this.#device.createPipelineLayout({ bindGroupLayouts: [this.#layout] }),
      vertex: { module: this.#module },
      fragment: { module: this.#module, targets: [{ format, blend: { color: OVER, alpha: OVER } }] },
      depthStencil: { format: 'depth32float', depthWriteEnabled: true, depthCompare: 'always' },
    });
    this.#pipelines.set(format, pipeline);
    return pipeline;
  }
}
