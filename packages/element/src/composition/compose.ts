/** Loaded when an element has its first child that is a scene or a mesh: what shows them beside its own scene. */
import type { Stage } from '../stage.js';
import { adopt, compositions, SplatChild } from './child.js';
import { ComposedStage } from './composed-stage.js';
import { Composition } from './composition.js';
import { SplatMeshElement } from './splat-mesh.js';
import { SplatSceneElement } from './splat-scene.js';

/** Registers the children's tags. */
export function define(): void {
  if (!globalThis.customElements || customElements.get('splat-scene')) return;
  customElements.define('splat-scene', SplatSceneElement);
  customElements.define('splat-mesh', SplatMeshElement);
}

/** Lets an element show its children. */
export function compose(stage: Stage): void {
  compositions.set(stage.element, new Composition(stage));
  Object.setPrototypeOf(stage, ComposedStage.prototype);
  define();
  for (const child of stage.element.children) if (child instanceof SplatChild) adopt(child);
}
