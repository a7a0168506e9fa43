/** Groups of splats by name. Picks and cuts use this module, which is loaded with them. */
import type { SplatGroup } from '@gaussian-splat/formats/groups';
import type { SceneGroups } from '../loading/protocol.js';

export type { SplatGroup };

/** Names of groups by their numbers in the file. */
export type GroupNames = Readonly<Record<number, string>>;

/** Names that texts of JSON contain. */
const parsed = new Map<string, GroupNames>();

/** Returns the names that a page has set on an element. Text that is no JSON object logs one warning. */
function namesOf(owner: Element): GroupNames {
  const { groupNames } = owner as { readonly groupNames?: GroupNames | string | null };
  if (typeof groupNames !== 'string') return groupNames ?? {};
  let names = parsed.get(groupNames);
  if (names) return names;
  try {
    names = Object(JSON.parse(groupNames)) as GroupNames;
  } catch {
    console.warn(`group-names: expected JSON such as {"4": "chair"}, found ${groupNames}; numbers are the names.`);
  }
  parsed.set(groupNames, (names ??= {}));
  return names;
}

/** Returns a group by its index. @param owner Element whose scene it belongs to. */
export function groupAt({ ids, counts }: SceneGroups, index: number, owner: Element): SplatGroup {
  const id = ids[index];
  return { id, name: namesOf(owner)[id] ?? String(id), count: counts[index] };
}

interface Found {
  readonly by: GroupNames;
  readonly indices: readonly number[];
}
const found = new WeakMap<SceneGroups, Map<string, Found>>();

/**
 * Returns the indices of the groups with some names or numbers: the same array for each call until the names change.
 * @param owner Element whose scene they belong to.
 */
export function groupsNamed(groups: SceneGroups, names: readonly string[], owner: Element): readonly number[] {
  const known = found.get(groups) ?? new Map<string, Found>();
  found.set(groups, known);
  const by = namesOf(owner);
  const key = names.join();
  const before = known.get(key);
  if (before?.by === by) return before.indices;
  const isNamed = (id: number): boolean => names.includes(by[id]) || names.includes(String(id));
  const indices = Array.from(groups.ids.keys()).filter((index) => isNamed(groups.ids[index]));
  known.set(key, { by, indices });
  return indices;
}
