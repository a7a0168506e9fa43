import type { PropertyDeclarations } from 'lit';
import type { Source } from '../../viewer/element-host.js';
import type { PropertiesOf } from '../../viewer/attribute.js';
import { MESH_ATTRIBUTES } from './attributes.js';
import { childDeclarations, SplatChild } from './child.js';

/**
 * A triangle mesh among scenes, as a child of `<gaussian-splat>`: glTF or GLB with its materials and animations. Meshes
 * and splats occlude each other. A neutral environment lights the mesh, unless its file has lights.
 *
 * ```html
 * <gaussian-splat src="room.sog">
 *   <splat-mesh src="chair.glb" position="-1m 0 0" autoplay loop></splat-mesh>
 * </gaussian-splat>
 * ```
 *
 * @tagname splat-mesh
 * @fires {CustomEvent<LoadDetail>} load - Fired when the mesh is shown.
 * @fires {ProgressEvent} progress - Fired when bytes have arrived.
 * @fires {CustomEvent<ElementError>} error - Fired when the mesh cannot be shown; `detail` is the same object as the
 * property `error`. Other scenes and meshes stay.
 * @fires {ScenePointerEvent} click - With `interactive`: fired when a visitor clicks the mesh, by pointer or key.
 * Bubbles.
 * @fires {ScenePointerEvent} pointerover - With `interactive`: fired when the pointer enters the mesh. Bubbles.
 * @fires {ScenePointerEvent} pointerout - With `interactive`: fired when the pointer leaves the mesh. Bubbles.
 * @fires {Event} play - Same as on HTMLMediaElement: fired when the mesh's own clock starts.
 * @fires {Event} pause - Fired when the mesh's own clock stops.
 * @fires {Event} ended - Fired when the mesh's own clock reaches the end.
 */
export class SplatMeshElement extends SplatChild {
  static override properties: PropertyDeclarations = childDeclarations(MESH_ATTRIBUTES);

  declare src: PropertiesOf<typeof MESH_ATTRIBUTES>['src'];
  protected readonly table = MESH_ATTRIBUTES;

  /** @internal */
  get source(): Source {
    return { src: this.src, contract: null, chain: null, postprocess: null, isMesh: true };
  }
}

declare global {
  interface HTMLElementTagNameMap {
    'splat-mesh': SplatMeshElement;
  }
}
