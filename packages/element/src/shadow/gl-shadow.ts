/** The shadow of a scene that WebGL draws: beneath it, in the same context. */
import { multiply, type Camera } from '@gaussian-splat/core';
import { DATA_WIDTH, GlGaussians, GlRenderer } from '@gaussian-splat/renderer/webgl';
import type { WebGlBackend } from '../webgl/webgl-backend.js';
import type { Taker } from './shadow-controller.js';
import { alphaOfScene } from './take-alpha-gl.js';

const upTo = (count: number): Uint32Array => Uint32Array.from({ length: count }, (_, i) => i);

/** Takes images of a painter's scene, and draws shadows beneath it. */
export function glTaker(backend: WebGlBackend): Taker {
  const { lease, textures } = backend.scene;
  const { gl } = lease;
  const own = new GlRenderer(gl, textures);
  const { take, free } = alphaOfScene(gl, own, upTo(textures.facts.count));
  const show: Taker['show'] = async (packed, map, toWorld) => {
    const gaussians = await GlGaussians.upload(gl, packed);
    const renderer = new GlRenderer(gl, gaussians);
    // All lie in one plane: any order shows the same.
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
