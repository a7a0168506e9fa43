/** Shadow of a scene that WebGL draws: beneath the splats, in the same context. */
import { multiply, type Camera } from '@gaussian-splat/core';
import { DATA_WIDTH, GlGaussians, GlRenderer } from '@gaussian-splat/renderer/webgl';
import type { WebGlBackend } from '../../webgl/webgl-backend.js';
import type { Taker } from './shadow-controller.js';
import { alphaOfScene } from '../../shared/take-alpha-gl.js';

const upTo = (count: number): Uint32Array => Uint32Array.from({ length: count }, (_, i) => i);

/** Returns the functions that capture images of a backend's scene and draw its shadow. */
export function glTaker(backend: WebGlBackend): Taker {
  const { lease, textures } = backend.scene;
  const { gl } = lease;
  const own = new GlRenderer(gl, textures);
  const { take, free } = alphaOfScene(gl, own, upTo(textures.facts.count));
  const show: Taker['show'] = async (packed, map, toWorld) => {
    const gaussians = await GlGaussians.upload(gl, packed);
    const renderer = new GlRenderer(gl, gaussians);
    // The splats of a shadow lie in one plane, so any order gives the same image.
    renderer.setOrder(upTo(DATA_WIDTH * Math.max(1, Math.ceil(packed.count / DATA_WIDTH))), packed.count);
    let isSeen = true;
    const beneath = (camera: Camera): void => {
      if (!isSeen) return;
      const placed = { ...camera, worldToCamera: multiply(camera.worldToCamera, toWorld) };
      renderer.render({ camera: placed, shDegree: 0, accumulation: 'rgba16float', resolutionScale: 1 });
      renderer.present(undefined, { keeps: true });
    };
    backend.beneath.shadow = beneath;
    const remove = (): void => {
      if (backend.beneath.shadow === beneath) backend.beneath.shadow = undefined;
      renderer.destroy();
      gaussians.destroy();
    };
    return { context: gl, map, toWorld, fade: (opacity) => void (isSeen = opacity > 0.5), remove };
  };
  const end = (): void => {
    free();
    own.destroy();
  };
  return { take, show, free: end };
}
