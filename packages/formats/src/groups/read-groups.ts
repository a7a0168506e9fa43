import { GaussianSplatError, isUsable, keepUsable, type GaussianCloud } from '@gaussian-splat/core';
import { LoadBudget, type LoadLimits } from '../budget.js';
import { plainBytes, type FileBytes } from '../bytes.js';
import { withPlainNames } from '../ply/gaussian-layout.js';
import { parsePlyHeader } from '../ply/header.js';
import { openElement, readColumns } from '../ply/rows.js';
import { readPly } from '../readers/ply.js';
import { outOfMemory } from '../scene-errors.js';

/** Names of properties with the number of an object. The first of them in a file counts. */
export const GROUP_PROPERTIES = ['object_id', 'instance_id', 'segment_id', 'class_id', 'label'] as const;

export interface ReadGroupsOptions extends LoadLimits {
  /** File name for error messages. Default `scene`. */
  readonly name?: string;
  /** Property of the file with the group of each splat. Default: the first of {@link GROUP_PROPERTIES} in the file. */
  readonly property?: string;
}

/** A scene, and the group of each of its splats. */
export interface GroupedScene {
  readonly cloud: GaussianCloud;
  /** [N] numbers of groups, in the order of the cloud. */
  readonly ids: Int32Array;
  /** Name of the property. */
  readonly property: string;
}

/**
 * Reads a PLY of splats together with a property that has the number of an object for each splat. Values with fractions
 * are rounded.
 * @throws GaussianSplatError as `readScene` for a PLY; `argument/value` if the file lacks the property.
 */
export async function readGroups(file: FileBytes, options: ReadGroupsOptions = {}): Promise<GroupedScene> {
  const { name = 'scene', property: asked } = options;
  const bytes = plainBytes(file, name);
  const source = { bytes, name, budget: new LoadBudget(bytes.length, options) };
  try {
    const header = withPlainNames(parsePlyHeader(source));
    const { properties = [] } = header.elements.find((element) => element.name === 'vertex') ?? {};
    const present = properties.filter(({ listCountType }) => !listCountType).map((own) => own.name);
    const property = (asked === undefined ? GROUP_PROPERTIES : [asked]).find((each) => present.includes(each));
    if (property === undefined) throw noGroups(name, asked, present);
    const whole = await readPly(source);
    const data = openElement(source, header, 'vertex');
    source.budget.take(12 * whole.count, name);
    const values = new Float64Array(whole.count);
    readColumns(data, [{ property, array: values, stride: 1, offset: 0 }]);
    const ids = Int32Array.from(
      values.filter((_, i) => isUsable(whole, i)),
      Math.round,
    );
    return { cloud: keepUsable(whole), ids, property };
  } catch (error) {
    throw outOfMemory(error, name) ?? error;
  }
}

const noGroups = (where: string, asked: string | undefined, present: readonly string[]): GaussianSplatError =>
  new GaussianSplatError('argument/value', {
    where,
    expected: asked === undefined ? `one of the properties ${GROUP_PROPERTIES.join(', ')}` : `the property ${asked}`,
    found: present.join(', ').slice(0, 400) || 'none',
    remedy: 'name the property that has the object of each splat, or write one',
  });
