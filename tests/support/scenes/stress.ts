/** Scenes with the splats that a setting of the renderer affects: opaque, faint, coincident, thin. They are synthetic, so they are always available. */
import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { cloudOf, repeat } from '../clouds.js';
import { randomSource } from '../gpu.js';
import { cameraAt } from '../scenes.js';

export interface StressScene {
  readonly name: string;
  readonly cloud: GaussianCloud;
  readonly camera: Camera;
}

/** Opacity of a logit of 14. */
const OPAQUE = 0.9999992;
const camera = cameraAt([0, 0, -3], [0, 0, 0], { width: 96, height: 64 });
const gray = [0.6, 0.3, -0.2] as const;

/** One after the other along the view, `at` from the camera's target on. */
const layers = (count: number, opacity: number, scale: number, depth = 2) =>
  cloudOf(
    Array.from({ length: count }, (_, i) => ({
      position: [0, 0, (depth * i) / count - depth / 2] as const,
      ...{ scale, opacity, color: [Math.sin(i), Math.cos(i), 0.5] as const },
    })),
  );

const random = randomSource(29);
/** Discs of a wall that overlap, at about the same depth. */
const wall = (count: number, opacity: number, z: number) =>
  repeat(count, () => ({
    position: [3.4 * (random() - 0.5), 2.4 * (random() - 0.5), z + 0.02 * random()] as const,
    ...{ scale: 0.08 + 0.08 * random(), opacity, color: [random(), random(), random()] as const },
  }));

export const stressScenes = (): StressScene[] => [
  { name: 'one opaque splat', cloud: layers(1, OPAQUE, 0.5), camera },
  { name: 'opaque layers', cloud: layers(60, OPAQUE, 0.4), camera },
  { name: 'an opaque wall', cloud: cloudOf(wall(900, OPAQUE, 0)), camera },
  { name: 'a wall of opacity 0.99', cloud: cloudOf(wall(900, 0.99, 0)), camera },
  {
    name: 'a pane before an opaque wall',
    cloud: cloudOf([
      { position: [0, 0, -1], scale: 1.5, opacity: 0.5, color: gray },
      { position: [0, 0, 1], scale: 3, opacity: OPAQUE, color: [1, 1, 1] },
    ]),
    camera,
  },
  {
    name: 'panes before a facade',
    cloud: cloudOf([...wall(60, 0.4, -0.8), ...wall(900, OPAQUE, 0.6)]),
    camera,
  },
  { name: 'haze', cloud: layers(500, 0.006, 0.6), camera },
  { name: 'fainter haze', cloud: layers(1500, 0.0045, 0.6), camera },
  { name: 'splats in one place', cloud: layers(300, 0.02, 0.3, 0), camera },
];
