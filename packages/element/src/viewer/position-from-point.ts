import { subtract, type Camera, type Vector3 } from '@gaussian-splat/core';
import {
  pickedSurface,
  placeOfSurface,
  surfacePoints,
  type PickedSurface,
  type ProbeAnswer,
  type ProbePoint,
} from '@gaussian-splat/renderer/tools';
import { boxPoints } from './camera/box-points.js';
import { toViewer } from './camera/orbit.js';
import { unproject } from './camera/projection.js';
import { ScenePoint, type PickedPoint } from './camera/values.js';
import type { SourceEntry } from './source-entry.js';
import type { CameraController } from './camera-controller.js';
import type { ViewController } from './view-controller.js';
import { isGone } from '../gpu/device-failures.js';
import { groupAt } from '../shared/splat-groups.js';
import type { WorldEntry } from './world-entry.js';
import type { Meshes } from '../sources/mesh/meshes.js';

export interface QueryHost {
  readonly element: Element;
  readonly sources: {
    readonly members: readonly WorldEntry[];
    readonly meshes: { readonly value: Pick<Meshes, 'hit'> | undefined };
  };
  readonly camera: Pick<CameraController, 'viewerFrame'>;
  /** Reads the surface positions of the last frame at points of the image. Rejects if the frame is released. */
  probe(points: readonly ProbePoint[]): Promise<readonly ProbeAnswer[]>;
  readonly view: Pick<ViewController, 'backend'>;
  /** The camera of the last frame, with the size of the frame in pixels; undefined before the first frame. */
  readonly drawnFrom: Camera | undefined;
  /** Element of the shadow tree that the image fills; null before the first rendering. */
  readonly surface: HTMLElement | null;
}

/** A surface and its place in the image, which may be beside the point that was picked. */
export interface AimedSurface extends PickedSurface {
  /** Pixels from the left and top edge of the frame. */
  readonly x: number;
  readonly y: number;
}

/** Chooses a surface near a point by more rays. */
export interface Aim {
  /** Returns more points to probe. `pixel` is the size of a CSS pixel in pixels of the frame. */
  points(x: number, y: number, pixel: number): readonly ProbePoint[];
  /** Returns the surface to use in place of the one at the point. */
  choose(
    camera: Camera,
    at: AimedSurface,
    points: readonly ProbePoint[],
    answers: readonly ProbeAnswer[],
    pixel: number,
  ): AimedSurface;
}

/**
 * Returns the visible surface under a point of the page and the element that contains the surface. Reads back from the
 * GPU asynchronously.
 * @param clientX CSS pixels, same as in a MouseEvent
 * @returns null outside the scene, on parts less than half opaque, and if the frame is released meanwhile
 */
export async function positionFromPoint(
  host: QueryHost,
  clientX: number,
  clientY: number,
  aim?: Aim,
): Promise<PickedPoint | null> {
  const { camera, view, drawnFrom: drawn, surface } = host;
  const { backend } = view;
  if (drawn === undefined || backend === null || surface === null) return null;
  const share = boxPoints(surface)(clientX, clientY);
  const [x, y] = [share.x * drawn.width, share.y * drawn.height];
  if (!(x >= 0 && y >= 0 && x < drawn.width && y < drawn.height)) return null;
  try {
    const pixel = drawn.width / surface.clientWidth;
    const around = surfacePoints(drawn, x, y);
    const more = aim?.points(x, y, pixel) ?? [];
    const answers = await host.probe([...around, ...more]);
    const [answer] = answers;
    const met = pickedSurface(drawn, around, answers.slice(0, around.length));
    if (!met) return null;
    // The splats of the shadow belong to no element.
    const placement = answer.splat?.placement;
    if (placement && !host.sources.members.some((member) => member.placement === placement)) return null;
    const own = { ...met, x, y };
    const found = aim?.choose(drawn, own, more, answers.slice(around.length), pixel) ?? own;
    const { position, normal, distance, uncertainty } = placeOfSurface(drawn, found.x, found.y, found);
    const eye = unproject(drawn, { x: found.x, y: found.y, depth: 0 });
    const [nx, ny, nz] = toViewer(camera.viewerFrame, normal);
    const point = new ScenePoint(...toViewer(camera.viewerFrame, position), uncertainty);
    return Object.assign(point, { normal: { x: nx, y: ny, z: nz }, distance, ...whose(host, answer, eye, position) });
  } catch (error) {
    // The loss of a device is reported by its scene.
    if (await isGone(backend)) return null;
    throw error;
  }
}

/**
 * Returns the element that contains a surface, and the splat or the mesh and material that was hit. `eye` and `place`
 * are in world coordinates.
 */
function whose(
  { element, sources, camera }: QueryHost,
  { splat }: ProbeAnswer,
  eye: Vector3,
  place: Vector3,
): Pick<PickedPoint, 'element' | 'splat' | 'group' | 'mesh' | 'material'> {
  const childOf = (isIt: (member: WorldEntry) => boolean): Element =>
    [...element.children].find((child) => {
      const member = (child as { readonly entry?: SourceEntry }).entry?.member;
      return member !== undefined && isIt(member);
    }) ?? element;
  if (splat) {
    const { placement, index } = splat;
    // WebGL draws one scene, whose splats have no placement.
    const of = (member: WorldEntry): boolean => !placement || member.placement === placement;
    const { live, groups } = sources.members.find(of)?.scene ?? {};
    const row = index === null ? null : (live?.rowOf?.(index) ?? index);
    const owner = childOf((member) => member.placement === placement);
    const group = groups && index !== null ? groupAt(groups, groups.of[index], owner) : null;
    return { element: owner, splat: row, group, mesh: null, material: null };
  }
  const [origin, direction] = [eye, subtract(place, eye)].map((v) => toViewer(camera.viewerFrame, v));
  const length = Math.hypot(...direction);
  const ahead: Vector3 = [direction[0] / length, direction[1] / length, direction[2] / length];
  const hit = sources.meshes.value?.hit(origin, ahead);
  if (!hit) return { element, splat: null, group: null, mesh: null, material: null };
  const { member: owner, mesh, material } = hit;
  return { element: childOf((member) => member === owner), splat: null, group: null, mesh, material };
}
