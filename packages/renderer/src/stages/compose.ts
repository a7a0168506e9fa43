import { compose } from '../generated/shaders.js';
import type { FrameTimer } from '../gpu/pass-timer.js';
import { perDevice, SHADER_STAGE, ShaderProgram, type Resources } from '../gpu/kernel.js';

/** Lays the accumulated splats over the background, into a view of any renderable colour format. */
export class ComposeStage {
  readonly #device: GPUDevice;
  readonly #program: ShaderProgram<typeof compose>;

  constructor(device: GPUDevice) {
    this.#device = device;
    this.#program = perDevice(
      device,
      'compose',
      () => new ShaderProgram(device, compose, SHADER_STAGE.vertex | SHADER_STAGE.fragment),
    );
  }

  bind(resources: Resources<typeof compose>): GPUBindGroup {
    return this.#program.bind(resources);
  }

  record(
    encoder: GPUCommandEncoder,
    bindings: GPUBindGroup,
    target: GPUTextureView,
    format: GPUTextureFormat,
    timer?: FrameTimer,
  ): void {
    const pass = encoder.beginRenderPass({
      label: 'gs.compose',
      colorAttachments: [{ view: target, loadOp: 'clear', storeOp: 'store' }],
      timestampWrites: timer?.timestampWrites('compose'),
    });
    pass.setPipeline(this.#pipeline(format));
    pass.setBindGroup(0, bindings);
    pass.draw(3);
    pass.end();
  }

  #pipeline(format: GPUTextureFormat): GPURenderPipeline {
    const { module, pipelineLayout } = this.#program;
    return perDevice(this.#device, `compose ${format}`, () =>
      this.#device.createRenderPipeline({
        label: `gs.compose.${format}`,
        layout: pipelineLayout,
        vertex: { module, entryPoint: 'vertex' },
        fragment: { module, entryPoint: 'fragment', targets: [{ format }] },
        primitive: { topology: 'triangle-list' },
      }),
    );
  }
}
