import type { Camera } from '@gaussian-splat/core';
import { meanSquare, type DrawFrame } from '@gaussian-splat/optimize';
import { cpuPainter } from './raster.js';

/** Draws views at a quarter of their size, by plain code: quicker than a software GPU for few splats. */
export const drawPlainly: DrawFrame = async (frame, views) => {
  const small = views.map((view): Camera => {
    const [width, height, fx, fy, cx, cy] = [view.width, view.height, view.fx, view.fy, view.cx, view.cy].map(
      (value) => value / 4,
    );
    return { ...view, fx, fy, cx, cy, width: Math.floor(width), height: Math.floor(height) };
  });
  const references = await cpuPainter.draw(frame, small);
  return {
    compare: async (cloud) => (await cpuPainter.draw(cloud, small)).map((image, k) => meanSquare(image, references[k])),
    destroy: () => undefined,
  };
};
