/** What a contract that was given as an object says, so that it is written down once however often it is compared. */
const written = new WeakMap<object, unknown>();

/**
 * Whether two contracts, as the property `contract` takes them, say the same. Frameworks make a new object of the same content for every render:
 * that must not load a generator anew.
 */
export function isSameContract(a: unknown, b: unknown): boolean {
  return a === b || contentOf(a) === contentOf(b);
}

function contentOf(contract: unknown): unknown {
  if (typeof contract !== 'object' || contract === null) return contract || null;
  if (!written.has(contract)) written.set(contract, write(contract));
  return written.get(contract);
}

/** JSON, or the object itself where it has none: what is wrong with it will be said when it is read. */
function write(contract: object): unknown {
  try {
    return JSON.stringify(contract);
  } catch {
    return contract;
  }
}
