/** Serialized contracts by their objects, so that repeated comparisons serialize each object once. */
const written = new WeakMap<object, unknown>();

/**
 * Returns whether two values of the property `contract` have equal content. Frameworks create a new object of the same
 * content for every render, which must not reload a generator.
 */
export function isSameContract(a: unknown, b: unknown): boolean {
  return a === b || contentOf(a) === contentOf(b);
}

function contentOf(contract: unknown): unknown {
  if (typeof contract !== 'object' || contract === null) return contract || null;
  if (!written.has(contract)) written.set(contract, write(contract));
  return written.get(contract);
}

/**
 * Returns the object as JSON, or the object itself if it cannot be serialized. Its faults are reported when it is read.
 */
function write(contract: object): unknown {
  try {
    return JSON.stringify(contract);
  } catch {
    return contract;
  }
}
