/** Sky with WebGPU: one triangle over the target, which is drawn before the splats. */
import type { Camera } from '@gaussian-splat/core';
import type { FrameTarget } from '@gaussian-splat/renderer';
import type { ViewerFrame } from '../../viewer/camera/orbit.js';
import type { Frame } from '../../sources/generator/frame-filter.js';
import { viewRays } from './view-rays.js';

const LABEL = 'gs.sky';
/**
 * Shader of the sky. The center of the equirectangular image is in the direction +x, as in three.js and
 * `<model-viewer>`.
 */
const SHADER = /* wgsl */ `
struct Rays { x: vec4f, y: vec4f, base: vec4f }
@group(0) @binding(0) var<uniform> rays: Rays;
@group(0) @binding(1) var image: texture_2d<f32>;
@group(0) @binding(2) var linear: sampler;

@vertex fn full_screen(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
  return vec4f(select(-1.0, 3.0, i == 1u), select(-1.0, 3.0, i == 2u), 0.0, 1.0);
}

@fragment fn sky(@builtin(position) at: vec4f) -> @location(0) vec4f {
  let way = normalize(at.x * rays.x.xyz + at.y * rays.y.xyz + rays.base.xyz);
  let place = vec2f(atan2(way.z, way.x) / 6.2831853 + 0.5, acos(clamp(way.y, -1.0, 1.0)) / 3.14159265);
  return vec4f(textureSampleLevel(image, linear, place, 0.0).rgb, 1.0);
}
`;

export class SkyGpu {
  readonly device: GPUDevice;
  readonly #texture: GPUTexture;
  readonly #rays: GPUBuffer;
  readonly #module: GPUShaderModule;
  readonly #sampler: GPUSampler;
  readonly #pipelines = new Map<GPUTextureFormat, { pipeline: GPURenderPipeline; group: GPUBindGroup }>();

  /** Uploads the sky. @param image Equirectangular image; the caller closes it. */
  constructor(device: GPUDevice, image: ImageBitmap) {
    this.device = device;
    const { width, height } = image;
    const { COPY_DST, RENDER_ATTACHMENT, TEXTURE_BINDING } = GPUTextureUsage;
    this.#texture = device.createTexture({
      label: LABEL,
      size: [width, height],
      format: 'rgba8unorm',
      usage: COPY_DST | RENDER_ATTACHMENT | TEXTURE_BINDING,
    });
    device.queue.copyExternalImageToTexture({ source: image }, { texture: this.#texture }, [width, height]);
    this.#rays = device.createBuffer({
      label: LABEL,
      size: 48,
      usage: GPUBufferUsage.UNIFORM | GPUBufferUsage.COPY_DST,
    });
    this.#module = device.createShaderModule({ label: LABEL, code: SHADER });
    this.#sampler = device.createSampler({ addressModeU: 'repeat', magFilter: 'linear', minFilter: 'linear' });
  }

  draw(
    { camera, target }: { readonly camera: Camera; readonly target: GPUTexture },
    frame: ViewerFrame,
  ): Partial<FrameTarget> {
    const { pipeline, group } = this.#pipelineFor(target.format);
    this.device.queue.writeBuffer(this.#rays, 0, viewRays(camera, frame));
    const encoder = this.device.createCommandEncoder({ label: LABEL });
    const pass = encoder.beginRenderPass({
      label: LABEL,
      colorAttachments: [{ view: target.createView(), loadOp: 'clear', storeOp: 'store' }],
    });
    pass.setPipeline(pipeline);
    pass.setBindGroup(0, group);
    pass.draw(3);
    pass.end();
    this.device.queue.submit([encoder.finish()]);
    return { background: 'load' };
  }

  #pipelineFor(format: GPUTextureFormat): { pipeline: GPURenderPipeline; group: GPUBindGroup } {
    const known = this.#pipelines.get(format);
    if (known) return known;
    const module = this.#module;
    const pipeline = this.device.createRenderPipeline({
      label: LABEL,
      layout: 'auto',
      vertex: { module },
      fragment: { module, targets: [{ format }] },
    });
    const resources = [{ buffer: this.#rays }, this.#texture.createView(), this.#sampler];
    const group = this.device.createBindGroup({
      label: LABEL,
      layout: pipeline.getBindGroupLayout(0),
      entries: resources.map((resource, binding) => ({ binding, resource })),
    });
    const made = { pipeline, group };
    this.#pipelines.set(format, made);
    return made;
  }

  destroy(): void {
    this.#texture.destroy();
    this.#rays.destroy();
  }
}

/** Whether a frame has a target texture. Images of the splats alone have none, and no sky. */
export const hasTarget = (frame: Frame): boolean => (frame.target as GPUTexture | undefined) !== undefined;
