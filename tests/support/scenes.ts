/** Seeded procedural scenes: the same on every machine, each hard for renderers in one way. */
import { room } from './scenes/room.js';
import { type Scene } from './scenes/scene.js';
import { edgeOnDiscs, hugeSplats, needles, pixelSplats } from './scenes/shapes.js';
import { brightColors, equalDepthPlane, offCenter, opacitySteps } from './scenes/values.js';

export { withHostileSplats, type HostileCloud } from './hostile.js';
export { room } from './scenes/room.js';
export { cameraAt, resized, thinned, type Scene } from './scenes/scene.js';
export { edgeOnDiscs, hugeSplats, needles, pixelSplats } from './scenes/shapes.js';
export { brightColors, equalDepthPlane, movedBy, offCenter, OPACITY_STEPS, opacitySteps } from './scenes/values.js';

/** Makers of all scenes; each creates its scene again, in a fraction of a second. */
export const proceduralScenes: readonly (() => Scene)[] = [
  room,
  needles,
  hugeSplats,
  pixelSplats,
  opacitySteps,
  brightColors,
  edgeOnDiscs,
  offCenter,
  equalDepthPlane,
];
