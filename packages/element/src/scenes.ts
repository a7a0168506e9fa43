/**
 * Registers `<splat-scene>` and `<splat-mesh>` at once, for pages and frameworks that set their properties; without it a `<gaussian-splat>` does so when it has such a
 * child. Registers `<gaussian-splat>`, too.
 */
import './index.js';
import { define } from './composition/compose.js';

export type { ChildEventMap } from './composition/child.js';
export { SplatSceneElement } from './composition/splat-scene.js';

define();
