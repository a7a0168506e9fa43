/**
 * Limits the polling of Dawn's Node module. Dawn polls the driver in consecutive `setImmediate` calls while work is in
 * progress. This occupies a CPU core, and with a software adapter (SwiftShader) a third to a half of all CPU time. After
 * {@link EAGER_MS}, polling is limited to once in {@link PAUSE_MS}.
 */
const EAGER_MS = 0.5;
const PAUSE_MS = 1;

/**
 * Whether a callback is a native function. Only Dawn passes one to `setImmediate` in the commands of this package; a bound
 * function would only be called a millisecond later.
 */
const isNative = (callback) => /\{\s*\[native code\]\s*\}$/.test(Function.prototype.toString.call(callback));

/** Replaces `setImmediate` by a function that limits the polling of Dawn. Call it before Dawn is created. */
export function calmPolling() {
  const soon = globalThis.setImmediate;
  let isAsking = false;
  let since = 0;
  const calm = (callback, ...args) => {
    if (typeof callback !== 'function' || !isNative(callback)) return soon(callback, ...args);
    // If a polling function schedules its next call during a call, the same polling continues.
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
  // The properties include the variant for `util.promisify`.
  globalThis.setImmediate = Object.defineProperties(calm, Object.getOwnPropertyDescriptors(soon));
}
