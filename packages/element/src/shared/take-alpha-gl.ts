/**
 * Captures the opacity of one scene in small images, with WebGL. Reads back from the GPU, so it is never part of a
 * frame.
 */
import type { Camera } from '@gaussian-splat/core';
import { DATA_WIDTH, type GlRenderer } from '@gaussian-splat/renderer/webgl';
import { SHADOW_PIXELS, type Alpha, type TakeAlpha } from './shadow-map.js';

/**
 * Returns a function that takes images of a scene's opacity, {@link SHADOW_PIXELS} a side. Free it when all are taken.
 * @param renderer Renderer of the scene. Its order of splats is replaced, which does not affect opacity.
 * @param kept Indices of the splats that are drawn.
 */
export function alphaOfScene(
  gl: WebGL2RenderingContext,
  renderer: GlRenderer,
  kept: Uint32Array,
): { readonly take: TakeAlpha; free(): void } {
  const [texture, target] = [gl.createTexture(), gl.createFramebuffer()];
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA8, SHADOW_PIXELS, SHADOW_PIXELS);
  gl.bindFramebuffer(gl.FRAMEBUFFER, target);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
  const order = new Uint32Array(DATA_WIDTH * Math.max(1, Math.ceil(kept.length / DATA_WIDTH)));
  order.set(kept);
  renderer.setOrder(order, kept.length);
  const take = (camera: Camera): Alpha => {
    renderer.render({ camera, shDegree: 0, accumulation: 'rgba16float', resolutionScale: 1 });
    renderer.present(undefined, { framebuffer: target });
    const bytes = new Uint8Array(4 * SHADOW_PIXELS ** 2);
    gl.bindFramebuffer(gl.FRAMEBUFFER, target);
    gl.readPixels(0, 0, SHADOW_PIXELS, SHADOW_PIXELS, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    // WebGL counts rows from below.
    const rowOf = (i: number): number => SHADOW_PIXELS - 1 - Math.floor(i / SHADOW_PIXELS);
    const alphaAt = (i: number): number => bytes[4 * (rowOf(i) * SHADOW_PIXELS + (i % SHADOW_PIXELS)) + 3] / 255;
    return Float32Array.from({ length: SHADOW_PIXELS ** 2 }, (_, i) => alphaAt(i));
  };
  const free = (): void => {
    gl.deleteFramebuffer(target);
    gl.deleteTexture(texture);
  };
  return { take, free };
}
