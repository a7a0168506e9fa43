import type { RendererOptions } from '../frame-request.js';
import { Renderer } from '../renderer.js';
import { chooseVariants } from './choose.js';

/**
 * A renderer whose `auto` levers have been decided on this device: variants that give a wrong image are ruled out by a known answer, the
 * others are timed (see {@link chooseVariants}). The constructor decides by what has been chosen on the device before, or else takes
 * `quads`, `rgba16float` and `parallel`, which work everywhere.
 */
export async function createRenderer(device: GPUDevice, options: RendererOptions = {}): Promise<Renderer> {
  await chooseVariants(device);
  return new Renderer(device, options);
}
