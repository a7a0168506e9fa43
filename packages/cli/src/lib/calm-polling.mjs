/**
 * Dawn's Node module polls the driver in consecutive `setImmediate` calls while any work is in progress. This keeps a
 * CPU core busy, and with a software adapter (SwiftShader) took a third to a half of all CPU time. After half a
 * millisecond, polling is limited to once a millisecond.
 */
const EAGER_MS = 0.5;
const PAUSE_MS = 1;

/**
 * Detects native functions: nothing else in our programs passes one to `setImmediate`, and a bound function would only
 * be called a millisecond later.
 */
const isNative = (callback) => /\{\s*\[native code\]\s*\}$/.test(Function.prototype.toString.call(callback));

/** Must be called before Dawn is created. */
export function calmPolling() {
  const soon = globalThis.setImmediate;
  let isAsking = false;
  let since = 0;
  const calm = (callback, ...args) => {
    if (typeof callback !== 'function' || !isNative(callback)) return soon(callback, ...args);
    // A polling function schedules its next call during a call.
    if (!isAsking) since = performance.now();
    const ask = () => {
      isAsking = true;
      try {
        callback(...args);
      } finally {
        isAsking = false;
      }
    };
    return performance.now() - since < EAGER_MS ? soon(ask) : setTimeout(ask, PAUSE_MS);
  };
  // Keeps the variant for `util.promisify`.
  globalThis.setImmediate = Object.defineProperties(calm, Object.getOwnPropertyDescriptors(soon));
}
