/** Loaded when an element gets its first child with a scene or a mesh. */
import { adopt, SplatChild, cores, type ChildCore } from './child.js';
import { SplatMeshElement } from './splat-mesh.js';
import { SplatSceneElement } from './splat-scene.js';

/** Registers the children's tags. */
export function define(): void {
  if (!globalThis.customElements || customElements.get('splat-scene')) return;
  customElements.define('splat-scene', SplatSceneElement);
  customElements.define('splat-mesh', SplatMeshElement);
}

/** Enables children of an element. */
export function compose(core: ChildCore): void {
  cores.set(core.element, core);
  define();
  for (const child of core.element.children) if (child instanceof SplatChild) adopt(child);
}
