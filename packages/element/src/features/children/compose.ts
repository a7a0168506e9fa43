/** Defines the children of an element. The module is loaded for the first `<splat-scene>` or `<splat-mesh>`. */
import type { Viewer } from '../../viewer/viewer.js';
import { adopt, SplatChild, cores } from './child.js';
import { SplatMeshElement } from './splat-mesh.js';
import { SplatSceneElement } from './splat-scene.js';

/**
 * Registers the tags `splat-scene` and `splat-mesh`, unless they are registered already.
 * @param registry Registry of the element's own tag, which is another one in shadow trees with a scoped registry.
 */
export function define(registry: CustomElementRegistry | undefined = globalThis.customElements): void {
  if (!registry || registry.get('splat-scene')) return;
  registry.define('splat-scene', SplatSceneElement);
  registry.define('splat-mesh', SplatMeshElement);
}

/** Enables an element to have children, and attaches those that it already has. */
export function compose(core: Viewer): void {
  cores.set(core.element, core);
  const { customElementRegistry } = core.element as { customElementRegistry?: CustomElementRegistry | null };
  define(customElementRegistry ?? undefined);
  for (const child of core.element.children) if (child instanceof SplatChild) adopt(child);
}
