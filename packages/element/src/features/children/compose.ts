/** Defines the children of an element. The module is loaded for the first `<splat-scene>` or `<splat-mesh>`. */
import type { Viewer } from '../../viewer/viewer.js';
import { adopt, SplatChild, cores } from './child.js';
import { SplatMeshElement } from './splat-mesh.js';
import { SplatSceneElement } from './splat-scene.js';

/** Registers the tags `splat-scene` and `splat-mesh`, unless they are registered already. */
export function define(): void {
  if (!globalThis.customElements || customElements.get('splat-scene')) return;
  customElements.define('splat-scene', SplatSceneElement);
  customElements.define('splat-mesh', SplatMeshElement);
}

/** Enables an element to have children, and attaches those that it already has. */
export function compose(core: Viewer): void {
  cores.set(core.element, core);
  define();
  for (const child of core.element.children) if (child instanceof SplatChild) adopt(child);
}
