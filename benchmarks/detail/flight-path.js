/** The flight over a streamed scene, and how fast it turns: for the benchmark page and for the simulation of tests/support/flight.ts. */
import { lookAt } from '@gaussian-splat/core';

/**
 * Flight at a low height along a curve that turns, and at times up to a point from which the whole scene is visible.
 * @param share fraction of the curve, 0 to 1
 */
export function flightCamera(share, { bounds, width, height }) {
  const { center, min, max } = bounds;
  const [x, z] = [(max[0] - min[0]) / 2, (max[2] - min[2]) / 2];
  const place = (s) => [
    center[0] + 0.8 * x * Math.sin(2 * Math.PI * s),
    center[1] - 0.05 * x - 0.5 * x * Math.sin(Math.PI * s) ** 8,
    center[2] + 0.8 * z * Math.sin(4 * Math.PI * s),
  ];
  const ahead = place(share + 0.02);
  return {
    ...{ width, height, fx: height, fy: height, cx: width / 2, cy: height / 2, near: 0.05, far: Infinity },
    worldToCamera: lookAt(place(share), [ahead[0], ahead[1] + 0.02 * x, ahead[2]], [0, -1, 0]),
  };
}

/** Degrees between the axes of two cameras. */
export function degreesBetween({ worldToCamera: a }, { worldToCamera: b }) {
  // The third row; lengths of differences are exact where a cosine near 1 is not.
  const apart = Math.hypot(...[8, 9, 10].map((k) => a[k] - b[k]));
  return (360 / Math.PI) * Math.asin(Math.min(1, apart / 2));
}
