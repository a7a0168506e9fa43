import { GaussianSplatError } from '@gaussian-splat/core';
import { composeLinear } from './generated/linear-shaders.js';
import { perDevice, SHADER_STAGE, ShaderProgram, TEXTURE_USAGE, type Resource } from './gpu/kernel.js';
import type { Compositor, Target } from './frame-target.js';

/**
 * Composes splats into a target of linear light, for example of a host with a later output pass, or of a `-srgb`
 * format. Splats are blended with the content of the target in encoded colors, as in training.
 *
 * ```ts
 * const colors = new LinearColors(device);
 * viewpoint.draw(camera, { target, background: 'load', colors });
 * ```
 */
export class LinearColors implements Compositor {
  readonly #device: GPUDevice;
  readonly #program: ShaderProgram<typeof composeLinear>;
  /** Copy of the previous content of the target; undefined before it is needed. */
  #content: GPUTexture | undefined;
  #bound: { readonly key: readonly Resource[]; readonly group: GPUBindGroup } | undefined;

  constructor(device: GPUDevice) {
    this.#device = device;
    const both = SHADER_STAGE.vertex | SHADER_STAGE.fragment;
    this.#program = perDevice(device, composeLinear.name, () => new ShaderProgram(device, composeLinear, both));
  }

  /**
   * Records a render pass that composes accumulated splats over the content of the target, or over nothing.
   * @param keeps Whether the content of the target is the background.
   * @throws GaussianSplatError `argument/value` if the content of the target is needed and cannot be copied.
   */
  compose(
    encoder: GPUCommandEncoder,
    resources: Readonly<Record<'compose' | 'accumulated', Resource>>,
    target: Target,
    keeps: boolean,
  ): void {
    const content = keeps ? this.#copy(encoder, target) : this.#nothing;
    const key = [resources.compose, resources.accumulated, content];
    if (!key.every((value, k) => value === this.#bound?.key[k]))
      this.#bound = { key, group: this.#program.bind({ ...resources, content }) };
    const pass = encoder.beginRenderPass({
      label: 'gs.compose',
      colorAttachments: [{ view: target.view, loadOp: 'clear', storeOp: 'store' }],
    });
    pass.setPipeline(this.#pipeline(target.format, keeps));
    pass.setBindGroup(0, this.#bound!.group);
    pass.draw(3);
    pass.end();
  }

  destroy(): void {
    this.#content?.destroy();
    this.#content = undefined;
    this.#bound = undefined;
  }

  #copy(encoder: GPUCommandEncoder, { texture, format, width, height }: Target): GPUTextureView {
    if (texture === undefined || (texture.usage & TEXTURE_USAGE.copySource) === 0)
      throw new GaussianSplatError('argument/value', {
        where: 'FrameTarget.target',
        expected: 'a texture with the usage COPY_SRC, whose content can be read',
        found: texture ? `usage ${texture.usage}` : 'a view',
        remedy: "give the texture itself, with COPY_SRC, or a color in place of background: 'load'",
      });
    const { textureBinding, copyDestination } = TEXTURE_USAGE;
    const known = this.#content;
    if (known?.width !== width || known.height !== height || known.format !== format) {
      known?.destroy();
      const usage = textureBinding | copyDestination;
      this.#content = this.#device.createTexture({ label: 'gs.content', size: [width, height], format, usage });
      this.#views.delete(this.#content);
    }
    encoder.copyTextureToTexture({ texture }, { texture: this.#content! }, [width, height]);
    return this.#viewOf(this.#content!);
  }

  readonly #views = new WeakMap<GPUTexture, GPUTextureView>();

  #viewOf(texture: GPUTexture): GPUTextureView {
    let view = this.#views.get(texture);
    if (view === undefined) this.#views.set(texture, (view = texture.createView()));
    return view;
  }

  get #nothing(): GPUTextureView {
    return perDevice(this.#device, 'no content', () =>
      this.#device
        .createTexture({
          label: 'gs.no_content',
          size: [1, 1],
          format: 'rgba8unorm',
          usage: TEXTURE_USAGE.textureBinding,
        })
        .createView(),
    );
  }

  #pipeline(format: GPUTextureFormat, keeps: boolean): GPURenderPipeline {
    const { module, pipelineLayout } = this.#program;
    return perDevice(this.#device, `compose linear ${format} ${keeps}`, () =>
      this.#device.createRenderPipeline({
        label: `gs.compose.linear.${format}`,
        layout: pipelineLayout,
        vertex: { module, entryPoint: 'vertex' },
        fragment: { module, entryPoint: 'fragment', targets: [{ format }], constants: { keeps: Number(keeps) } },
        primitive: { topology: 'triangle-list' },
      }),
    );
  }
}
