import {
  boundsOf,
  GaussianSplatError,
  shCoefficientCount,
  type Bounds,
  type GaussianCloud,
  type Vector3,
} from '@gaussian-splat/core';
import { SH_C0 } from '../cloud.js';
import type { SplatArrays } from '../updates/splat-update.js';

/** An object of a scene. */
export interface SplatGroup {
  /** Number in the file. */
  readonly id: number;
  /** Name that the page gave it; its number as text by default. */
  readonly name: string;
  /** Number of its splats. */
  readonly count: number;
}

/** How groups differ from the file. Groups that are not named look as in the file. */
export interface GroupChanges {
  /** Names of groups that are not drawn. */
  readonly hide?: readonly string[];
  /** Names of the only groups that are drawn; undefined for all. */
  readonly only?: readonly string[] | undefined;
  /** Colors of groups, which keep their own shades: red, green and blue, 0..1, sRGB-encoded. */
  readonly tint?: Readonly<Record<string, Vector3>>;
}

/** Weights of red, green and blue in the shade of a tinted splat (Rec. 709). */
const LUMA = [0.2126, 0.7152, 0.0722] as const;

/**
 * The objects of a scene: finds the one of a splat, measures it, and computes arrays that hide or tint some.
 * The splats are those of `cloud` in their order, as the property `splats` of the element shows them.
 */
export class SplatGroups {
  /** All groups, by ascending number. */
  readonly groups: readonly SplatGroup[];
  readonly #cloud: GaussianCloud;
  readonly #ids: Int32Array;
  readonly #byId: ReadonlyMap<number, SplatGroup>;
  #isTinted = false;

  /**
   * @param ids [N] numbers of groups, in the order of the cloud.
   * @param names Names by number. Groups without one are named by their number.
   * @throws GaussianSplatError `argument/value` unless there is one number for each splat.
   */
  constructor(cloud: GaussianCloud, ids: Int32Array, names: Readonly<Record<number, string>> = {}) {
    if (ids.length !== cloud.count) throw unfit('ids', `${cloud.count} numbers, one for each splat`, `${ids.length}`);
    this.#cloud = cloud;
    this.#ids = ids;
    const counts = new Map<number, number>();
    for (const id of ids) counts.set(id, (counts.get(id) ?? 0) + 1);
    const sorted = [...counts].sort(([a], [b]) => a - b);
    this.groups = sorted.map(([id, count]) => ({ id, count, name: names[id] ?? String(id) }));
    this.#byId = new Map(this.groups.map((group) => [group.id, group]));
  }

  /** Returns the group of a splat; undefined for null, as picks on meshes have, and outside of the scene. */
  of(splat: number | null | undefined): SplatGroup | undefined {
    return this.#byId.get(this.#ids[splat ?? -1]);
  }

  /** Returns the bounds of a group, in the coordinates of the cloud. */
  boundsOf(name: string): Bounds {
    const ids = this.#idsOf([name]);
    const { positions, opacities, origin } = this.#cloud;
    const places: number[] = [];
    const visible: number[] = [];
    this.#ids.forEach((id, i) => {
      if (!ids.has(id)) return;
      places.push(positions[3 * i], positions[3 * i + 1], positions[3 * i + 2]);
      visible.push(opacities[i]);
    });
    const count = visible.length;
    return boundsOf({ count, positions: Float32Array.from(places), opacities: Float32Array.from(visible), origin });
  }

  /**
   * Returns the arrays that show the changes, for `updateSplats(0, arrays)`: `opacities`, and `sh` if groups are tinted
   * or were so in the call before. Each call starts from the cloud, so that `{}` shows the file again.
   * @throws GaussianSplatError `argument/value` for an unknown name.
   */
  arraysFor({ hide = [], only, tint = {} }: GroupChanges): Required<Pick<SplatArrays, 'opacities'>> & SplatArrays {
    const hidden = this.#idsOf(hide);
    const shown = only && this.#idsOf(only);
    const isDrawn = (id: number): boolean => !hidden.has(id) && (shown?.has(id) ?? true);
    const opacities = this.#cloud.opacities.map((opacity, i) => (isDrawn(this.#ids[i]) ? opacity : 0));
    const colors = Object.entries(tint).map(([name, color]) => [this.#idsOf([name]), color] as const);
    const wasTinted = this.#isTinted;
    this.#isTinted = colors.length > 0;
    return this.#isTinted || wasTinted ? { opacities, sh: this.#tinted(colors) } : { opacities };
  }

  /** The color of a direction becomes its luma times the tint. Both are linear in the harmonics. */
  #tinted(colors: readonly (readonly [ids: ReadonlySet<number>, color: Vector3])[]): Float32Array {
    const sh = this.#cloud.sh.slice();
    const stride = 3 * shCoefficientCount(this.#cloud.shDegree);
    this.#ids.forEach((id, i) => {
      const color = colors.find(([ids]) => ids.has(id))?.[1];
      if (!color) return;
      for (let at = stride * i; at < stride * (i + 1); at += 3) {
        const shade = LUMA[0] * sh[at] + LUMA[1] * sh[at + 1] + LUMA[2] * sh[at + 2];
        for (let channel = 0; channel < 3; channel++) sh[at + channel] = color[channel] * shade;
      }
      for (let channel = 0; channel < 3; channel++) sh[stride * i + channel] += (0.5 * (color[channel] - 1)) / SH_C0;
    });
    return sh;
  }

  /** Several groups may have the same name. */
  #idsOf(names: readonly string[]): ReadonlySet<number> {
    const found = this.groups.filter(({ name }) => names.includes(name));
    const unknown = names.find((name) => !found.some((group) => group.name === name));
    if (unknown !== undefined)
      throw unfit(
        'group',
        this.groups
          .map(({ name }) => name)
          .join(', ')
          .slice(0, 400),
        unknown,
      );
    return new Set(found.map(({ id }) => id));
  }
}

const unfit = (where: string, expected: string, found: string): GaussianSplatError =>
  new GaussianSplatError('argument/value', {
    where: `SplatGroups: ${where}`,
    expected,
    found,
    remedy: 'pass the numbers that readGroups returns, and names that the constructor was given',
  });
