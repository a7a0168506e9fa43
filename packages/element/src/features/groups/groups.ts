/** Lists the groups of splats of an element's scenes. Loaded on demand. */
import type { Matrix4, Vector3 } from '@gaussian-splat/core';
import { groupAt, type SplatGroup } from '../../shared/splat-groups.js';
import { boxOf, type SceneBox } from '../../viewer/scene-queries.js';
import type { Viewer } from '../../viewer/viewer.js';

/** A group of splats with its place. */
export interface MeasuredGroup extends SplatGroup {
  /** Box around the centers of its splats, in meters of viewer space. */
  readonly box: SceneBox;
}

/** Methods of elements whose scenes have groups. They are undefined before the first of them is shown. */
export interface GroupMethods {
  /**
   * Returns the groups of a scene, in the order of their numbers; none while it is not shown, and for files without
   * groups.
   * @param scene The element, the default, or a `<splat-scene>` in it.
   */
  getSplatGroups?(scene?: Element): readonly MeasuredGroup[];
}

export class Groups {
  readonly #viewer: Viewer;

  constructor(viewer: Viewer) {
    this.#viewer = viewer;
    const getSplatGroups: GroupMethods['getSplatGroups'] = (scene = viewer.element) => this.#groupsOf(scene);
    Object.assign(viewer.element, { getSplatGroups });
  }

  #groupsOf(element: Element): readonly MeasuredGroup[] {
    const { sources, frame } = this.#viewer;
    sources.place();
    const { member } = sources.entries.find(({ owner }) => owner.element === element) ?? {};
    const groups = member?.scene.groups;
    if (!member || !groups) return [];
    const { sceneToWorld = IDENTITY } = member.placement;
    return Array.from(groups.ids, (_, k) => {
      const corners = groups.boxes.subarray(6 * k, 6 * k + 6);
      return { ...groupAt(groups, k, element), box: boxOf(frame, boxIn(sceneToWorld, corners))! };
    });
  }
}

const IDENTITY: Matrix4 = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

/** Returns the box around a box that a matrix has moved. @param corners Lower and upper corner. */
function boxIn(matrix: Matrix4, corners: Float64Array): { min: Vector3; max: Vector3 } {
  const corner = (pick: (a: number, b: number) => number): Vector3 =>
    [0, 4, 8].map((row) =>
      [0, 1, 2].reduce(
        (sum, axis) => sum + pick(matrix[row + axis] * corners[axis], matrix[row + axis] * corners[axis + 3]),
        matrix[row + 3],
      ),
    ) as unknown as Vector3;
  return { min: corner(Math.min), max: corner(Math.max) };
}
