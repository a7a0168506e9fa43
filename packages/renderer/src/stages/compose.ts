import { compose, composeStored, constants } from '../generated/shaders.js';
import type { FrameTimer } from '../gpu/pass-timer.js';
import { ComputeKernel, perDevice, SHADER_STAGE, ShaderProgram, storingInto, type Resources } from '../gpu/kernel.js';
import type { Surface } from '../rasterizers/rasterizer.js';

const { COMPOSE_SIDE } = constants;
/** Blends premultiplied color over the target. */
const OVER: GPUBlendComponent = { srcFactor: 'one', dstFactor: 'one-minus-src-alpha', operation: 'add' };

/**
 * Resources of the composition. `drawn` is bound for {@link ComposeStage.draw}; `stored` contains the bind group of
 * each target view, which is created at its first use.
 */
export interface ComposeBindings {
  readonly resources: Resources<typeof compose>;
  readonly drawn: GPUBindGroup;
  readonly stored: WeakMap<GPUTextureView, GPUBindGroup>;
}

/**
 * Composes the accumulated splats over the background. `draw` writes to a view of any renderable color format, `store`
 * to a view that a compute shader may write. Both write the same image, except for the rounding of its format. On a GPU
 * with few raster units, such as an H200, drawing one triangle takes longer than rasterizing all tiles.
 */
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

  bind(resources: Resources<typeof compose>): ComposeBindings {
    return { resources, drawn: this.#program.bind(resources), stored: new WeakMap() };
  }

  /**
   * Compiles the pipeline for targets of a format, so that no frame compiles it. @param isStored Whether `store` is
   * used instead of `draw`.
   */
  prepare(format: GPUTextureFormat, isStored: boolean): void {
    if (isStored) this.#kernel(format).prepare();
    else this.#pipeline(format);
  }

  /**
   * Records a render pass that composes the image. @param keeps Whether the content of the target is the background.
   */
  draw(
    encoder: GPUCommandEncoder,
    bindings: ComposeBindings,
    { view, format }: Surface,
    timer?: FrameTimer,
    keeps = false,
  ): void {
    const pass = encoder.beginRenderPass({
      label: 'gs.compose',
      colorAttachments: [{ view, loadOp: keeps ? 'load' : 'clear', storeOp: 'store' }],
      timestampWrites: timer?.timestampWrites('compose'),
    });
    pass.setPipeline(this.#pipeline(format, keeps));
    pass.setBindGroup(0, bindings.drawn);
    pass.draw(3);
    pass.end();
  }

  store(encoder: GPUCommandEncoder, bindings: ComposeBindings, target: Surface, timer?: FrameTimer): void {
    const kernel = this.#kernel(target.format);
    let bound = bindings.stored.get(target.view);
    if (bound === undefined) {
      bound = kernel.bind({ ...bindings.resources, image: target.view });
      bindings.stored.set(target.view, bound);
    }
    const pass = encoder.beginComputePass({ label: 'gs.compose', timestampWrites: timer?.timestampWrites('compose') });
    const [columns, rows] = [target.width, target.height].map((pixels) => Math.ceil(pixels / COMPOSE_SIDE));
    kernel.dispatchGrid(pass, bound, columns, rows);
    pass.end();
  }

  #kernel(format: GPUTextureFormat): ComputeKernel<typeof composeStored> {
    return perDevice(
      this.#device,
      `${composeStored.name} ${format}`,
      () => new ComputeKernel(this.#device, storingInto(composeStored, format)),
    );
  }

  #pipeline(format: GPUTextureFormat, keeps = false): GPURenderPipeline {
    return composingPipeline(this.#device, 'compose', this.#program, format, keeps);
  }
}

/** Returns the pipeline that composes splats into a target. @param keeps Whether its content is the background. */
export function composingPipeline(
  device: GPUDevice,
  name: string,
  { module, pipelineLayout }: Pick<ShaderProgram<typeof compose>, 'module' | 'pipelineLayout'>,
  format: GPUTextureFormat,
  keeps: boolean,
): GPURenderPipeline {
  const blend = keeps ? { color: OVER, alpha: OVER } : undefined;
  return perDevice(device, `${name} ${format} ${keeps}`, () =>
    device.createRenderPipeline({
      label: `gs.${name}.${format}`,
      layout: pipelineLayout,
      vertex: { module, entryPoint: 'vertex' },
      fragment: {
        ...{ module, entryPoint: 'fragment', targets: [{ format, blend }] },
        constants: { is_encoding: Number(format.endsWith('-srgb')) },
      },
      primitive: { topology: 'triangle-list' },
    }),
  );
}
