import { perDevice, SHADER_STAGE, ShaderProgram, type Resources, type ShaderDescription } from '../gpu/kernel.js';

/** A stage that draws every pixel of a target once. The entry points of its shader are `vertex` and `fragment`. */
export class FullScreenStage<S extends ShaderDescription> {
  readonly #device: GPUDevice;
  readonly #name: string;
  readonly #program: ShaderProgram<S>;

  constructor(device: GPUDevice, shader: S) {
    this.#device = device;
    this.#name = shader.name;
    const visibility = SHADER_STAGE.vertex | SHADER_STAGE.fragment;
    this.#program = perDevice(device, shader.name, () => new ShaderProgram(device, shader, visibility));
  }

  bind(resources: Resources<S>): GPUBindGroup {
    return this.#program.bind(resources);
  }

  record(encoder: GPUCommandEncoder, bindings: GPUBindGroup, view: GPUTextureView, format: GPUTextureFormat): void {
    const pass = encoder.beginRenderPass({
      label: `gs.${this.#name}`,
      colorAttachments: [{ view, loadOp: 'clear', storeOp: 'store' }],
    });
    pass.setPipeline(this.#pipeline(format));
    pass.setBindGroup(0, bindings);
    pass.draw(3);
    pass.end();
  }

  #pipeline(format: GPUTextureFormat): GPURenderPipeline {
    const { module, pipelineLayout } = this.#program;
    return perDevice(this.#device, `${this.#name} ${format}`, () =>
      this.#device.createRenderPipeline({
        label: `gs.${this.#name}.${format}`,
        layout: pipelineLayout,
        vertex: { module, entryPoint: 'vertex' },
        fragment: { module, entryPoint: 'fragment', targets: [{ format }] },
        primitive: { topology: 'triangle-list' },
      }),
    );
  }
}
