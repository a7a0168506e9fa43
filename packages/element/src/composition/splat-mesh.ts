import { loadModule } from '@gaussian-splat/core';
import type { PropertyDeclarations } from 'lit';
import type { openGaussians } from '../gpu/open-scene.js';
import type { Source } from '../stage-host.js';
import { MESH_ATTRIBUTES, type PropertiesOf } from './attributes.js';
import { childDeclarations, SplatChild } from './child.js';

/**
 * A triangle mesh among scenes, as a child of `<gaussian-splat>`: glTF or GLB with its materials and animations. It hides splats behind it, and they hide it.
 * Lit by even light from all around, unless its file has lights.
 *
 * ```html
 * <gaussian-splat src="room.sog">
 *   <splat-mesh src="chair.glb" position="-1m 0 0" autoplay loop></splat-mesh>
 * </gaussian-splat>
 * ```
 *
 * @tagname splat-mesh
 * @fires {CustomEvent<LoadDetail>} load - It is shown.
 * @fires {ProgressEvent} progress - Bytes have arrived.
 * @fires {CustomEvent<ElementError>} error - It cannot be shown; `detail` is the same object as the property `error`. The others stay.
 * @fires {ScenePointerEvent} click - With `interactive`: a visitor has clicked it, by pointer or key. Bubbles.
 * @fires {ScenePointerEvent} pointerover - With `interactive`: the pointer has come over it. Bubbles.
 * @fires {ScenePointerEvent} pointerout - With `interactive`: the pointer has left it. Bubbles.
 * @fires {Event} play - As of HTMLMediaElement: its own clock runs.
 * @fires {Event} pause - Its own clock stands still.
 * @fires {Event} ended - Its own clock has come to its end.
 */
export class SplatMeshElement extends SplatChild {
  static override properties: PropertyDeclarations = childDeclarations(MESH_ATTRIBUTES);

  declare src: PropertiesOf<typeof MESH_ATTRIBUTES>['src'];
  protected readonly table = MESH_ATTRIBUTES;

  /** @internal */
  get source(): Source {
    return { src: this.src, contract: null, chain: null, postprocess: null };
  }

  /** A source without splats. @internal */
  readonly open: typeof openGaussians = async (request, options) => {
    const { openMesh } = await loadModule('the code that shows meshes', () => import('../meshes/open-mesh.js'));
    return openMesh(request, options);
  };
}

declare global {
  interface HTMLElementTagNameMap {
    'splat-mesh': SplatMeshElement;
  }
}
