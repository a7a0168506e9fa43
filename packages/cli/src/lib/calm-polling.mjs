/**
 * Dawn's Node module asks the driver for finished work from one `setImmediate` to the next, for as long as any is under way: that keeps a processor busy, and where the GPU
 * is that same processor (SwiftShader) it was found to take a third to a half of all processor time. After half a millisecond of it, it may ask once a millisecond.
 */
const EAGER_MS = 0.5;
const PAUSE_MS = 1;

/** Compiled code: nothing else in a program of ours hands such a function to `setImmediate`, and a bound one would only come a millisecond late. */
const isNative = (callback) => /\{\s*\[native code\]\s*\}$/.test(Function.prototype.toString.call(callback));

/** Must come before Dawn is made. */
export function calmPolling() {
  const soon = globalThis.setImmediate;
  let isAsking = false;
  let since = 0;
  const calm = (callback, ...args) => {
    if (typeof callback !== 'function' || !isNative(callback)) return soon(callback, ...args);
    // Who asks again, does so while it is being called.
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
  // With `util.promisify`'s form of it.
  globalThis.setImmediate = Object.defineProperties(calm, Object.getOwnPropertyDescriptors(soon));
}
