/**
 * Registers `<splat-scene>` and `<splat-mesh>` at once, for pages and frameworks that set their properties; without it a `<gaussian-splat>` does so when it has such a
 * child. Registers `<gaussian-splat>`, too.
 */
import './index.js';
import { define } from './composition/compose.js';

import type { MESH_ATTRIBUTES, SCENE_ATTRIBUTES } from './composition/attributes.js';
import type { SettableOf } from './composition/child.js';
import type { SplatSceneElement } from './composition/splat-scene.js';

export type { ChildEventMap } from './composition/child.js';
export { SplatMeshElement } from './composition/splat-mesh.js';
export { SplatSceneElement } from './composition/splat-scene.js';

/** The properties of `<splat-scene>` that a page may set. */
export type SettableSceneProperties = SettableOf<typeof SCENE_ATTRIBUTES> &
  Partial<Pick<SplatSceneElement, 'inputValues'>>;
/** The properties of `<splat-mesh>` that a page may set. */
export type SettableMeshProperties = SettableOf<typeof MESH_ATTRIBUTES>;

define();
