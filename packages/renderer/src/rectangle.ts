import type { Compositor, Target } from './frame-target.js';
import { composeRectangle } from './generated/rectangle-shaders.js';
import { perDevice, SHADER_STAGE, ShaderProgram, type Resource } from './gpu/kernel.js';
import { composingPipeline } from './stages/compose.js';

/** Upper left corner and size of a rectangle in a target, in pixels. */
export interface RectangleBounds {
  readonly x: number;
  readonly y: number;
  readonly width: number;
  readonly height: number;
}

type ComposeResources = Parameters<Compositor['compose']>[1];

interface Bound {
  readonly compose: Resource;
  readonly group: GPUBindGroup;
}

/** Composes splats into a rectangle of a larger target. The other pixels of the target do not change. */
export class Rectangle implements Compositor {
  readonly #device: GPUDevice;
  readonly #bounds: RectangleBounds;

  constructor(device: GPUDevice, bounds: RectangleBounds) {
    this.#device = device;
    this.#bounds = bounds;
  }

  compose(
    encoder: GPUCommandEncoder,
    resources: ComposeResources,
    { view, format }: Pick<Target, 'view' | 'format'>,
    keeps: boolean,
  ): void {
    const { x, y, width, height } = this.#bounds;
    const pass = encoder.beginRenderPass({
      label: 'gs.compose',
      colorAttachments: [{ view, loadOp: 'load', storeOp: 'store' }],
    });
    pass.setViewport(x, y, width, height, 0, 1);
    pass.setPipeline(composingPipeline(this.#device, 'compose.rectangle', programOf(this.#device), format, keeps));
    pass.setBindGroup(0, bind(this.#device, resources));
    pass.draw(3);
    pass.end();
  }
}

const programOf = (device: GPUDevice): ShaderProgram<typeof composeRectangle> =>
  perDevice(
    device,
    composeRectangle.name,
    () => new ShaderProgram(device, composeRectangle, SHADER_STAGE.vertex | SHADER_STAGE.fragment),
  );

/** Returns the cached bind group of the resources, because a frame must not create one. */
function bind(device: GPUDevice, resources: ComposeResources): GPUBindGroup {
  const known = perDevice(device, 'bound rectangles', () => new WeakMap<Resource, Bound>());
  const { compose, accumulated } = resources;
  let bound = known.get(accumulated);
  if (bound?.compose !== compose) {
    bound = { compose, group: programOf(device).bind(resources) };
    known.set(accumulated, bound);
  }
  return bound.group;
}
