/**
 * Registers `<splat-scene>`, `<splat-mesh>`, `<splat-cut>` and `<gaussian-splat>` immediately, for pages and frameworks
 * that set their properties. Without this module, a `<gaussian-splat>` registers the other elements when it has such a
 * child.
 */
import { GaussianSplatElement } from './index.js';
import { define } from './features/children/compose.js';
import { defineCuts } from './features/effects/define.js';
import type { SplatCutElement } from './features/effects/splat-cut.js';

import type { CUT_ATTRIBUTES } from './features/effects/attributes.js';
import type { MESH_ATTRIBUTES, SCENE_ATTRIBUTES } from './features/children/attributes.js';
import type { PropertiesOf } from './viewer/attribute.js';
import type { SettableOf } from './features/children/child.js';
import type { SplatSceneElement } from './features/children/splat-scene.js';

export type { ChildEventMap } from './features/children/child.js';
export { SplatCutElement } from './features/effects/splat-cut.js';
export type { ScenePointerEvent } from './features/children/interaction.js';
export { SplatMeshElement } from './features/children/splat-mesh.js';
export { SplatSceneElement } from './features/children/splat-scene.js';

/** The properties of `<splat-scene>` that a page may set. */
export type SettableSceneProperties = SettableOf<typeof SCENE_ATTRIBUTES> &
  Partial<Pick<SplatSceneElement, 'inputValues'>>;
/** The properties of `<splat-cut>` that a page may set. */
export type SettableCutProperties = Partial<
  PropertiesOf<typeof CUT_ATTRIBUTES> & Pick<SplatCutElement, 'matrix'> & { hidden: boolean }
>;
/** The properties of `<splat-mesh>` that a page may set. */
export type SettableMeshProperties = SettableOf<typeof MESH_ATTRIBUTES>;

// If another copy of this package has registered the parent element, only children of that copy work with it. It
// registers them when it finds the first one.
const parent = globalThis.customElements?.get('gaussian-splat');
if (parent === GaussianSplatElement || parent?.prototype instanceof GaussianSplatElement) {
  define();
  defineCuts();
}
