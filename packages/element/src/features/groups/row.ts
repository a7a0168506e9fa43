import { text } from '../../viewer/attribute.js';
import type { FeatureRow } from '../../viewer/features.js';
import type { GroupNames } from '../../shared/splat-groups.js';
import type { GroupMethods } from './groups.js';

export const GROUPS_ATTRIBUTES = {
  /**
   * Reads the group of each splat, such as its object, from a property of a PLY: its name, or empty for the first of
   * `object_id`, `instance_id`, `segment_id`, `class_id` and `label`. Picks then have a `group`, and `<splat-cut group>` acts on groups.
   * @example groups="object_id"
   */
  groups: text(),
  /**
   * Names of groups by their numbers in the file: JSON. The property takes the object as well.
   * @default the numbers
   * @example group-names='{"4": "chair"}'
   */
  groupNames: text<GroupNames | string | null>(),
};
type Table = typeof GROUPS_ATTRIBUTES;

/** Groups of splats: their names, counts and boxes. */
export const groups: FeatureRow = {
  what: 'the code for groups',
  attributes: GROUPS_ATTRIBUTES,
  by: ({ attributes }) => typeof attributes.groups === 'string',
  children: 'splat-scene[groups]',
  precedesFrames: true,
  open: async (viewer) => new (await import('./groups.js')).Groups(viewer),
};

declare module '../../viewer/attributes.js' {
  interface FeatureAttributes extends Table {}
  interface FeatureMembers extends GroupMethods {}
}
