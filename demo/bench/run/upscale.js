/** Bilinear enlargement of an image that was drawn smaller, clamped at the edges, in any format. */

const SHADER = /* wgsl */ `
@group(0) @binding(0) var source: texture_2d<f32>;
@group(0) @binding(1) var<uniform> target_size: vec2f;

@vertex fn corner(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
  return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

// By textureLoad: 32-bit floats cannot be sampled with a filter everywhere.
@fragment fn enlarge(@builtin(position) position: vec4f) -> @location(0) vec4f {
  let size = vec2f(textureDimensions(source));
  let at = position.xy * size / target_size - 0.5;
  let low = floor(at);
  let part = at - low;
  let last = vec2i(size) - 1;
  let a = clamp(vec2i(low), vec2i(0), last);
  let b = clamp(vec2i(low) + 1, vec2i(0), last);
  let top = mix(textureLoad(source, a, 0), textureLoad(source, vec2i(b.x, a.y), 0), part.x);
  let bottom = mix(textureLoad(source, vec2i(a.x, b.y), 0), textureLoad(source, b, 0), part.x);
  return mix(top, bottom, part.y);
}`;

export class Upscaler {
  #device;
  #pipeline;
  #bindings;
  #uniform;

  /** @param format of the target. */
  constructor(device, format, source, { width, height }) {
    this.#device = device;
    const module = device.createShaderModule({ label: 'bench.upscale', code: SHADER });
    this.#pipeline = device.createRenderPipeline({
      label: 'bench.upscale',
      layout: 'auto',
      vertex: { module, entryPoint: 'corner' },
      fragment: { module, entryPoint: 'enlarge', targets: [{ format }] },
    });
    this.#uniform = device.createBuffer({ size: 16, usage: GPUBufferUsage.UNIFORM | GPUBufferUsage.COPY_DST });
    device.queue.writeBuffer(this.#uniform, 0, Float32Array.of(width, height));
    this.#bindings = device.createBindGroup({
      layout: this.#pipeline.getBindGroupLayout(0),
      entries: [
        { binding: 0, resource: source.createView() },
        { binding: 1, resource: { buffer: this.#uniform } },
      ],
    });
  }

  /** Draws the source over the whole of the target. */
  draw(view, timer) {
    const encoder = this.#device.createCommandEncoder();
    const pass = encoder.beginRenderPass({
      colorAttachments: [{ view, loadOp: 'clear', storeOp: 'store' }],
      timestampWrites: timer?.timestampWrites('upscale'),
    });
    pass.setPipeline(this.#pipeline);
    pass.setBindGroup(0, this.#bindings);
    pass.draw(3);
    pass.end();
    this.#device.queue.submit([encoder.finish()]);
  }

  destroy() {
    this.#uniform.destroy();
  }
}
