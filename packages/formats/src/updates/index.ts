/** Updates of scenes that are being trained or edited: their arrays, and the messages that carry them. */
export {
  ARRAYS,
  checkUpdate,
  numbersOf,
  type ArrayName,
  type SplatArrays,
  type SplatUpdate,
  type UpdateSize,
} from './splat-update.js';
export { decodeUpdate, encodeUpdate, updatesIn, type UpdateOptions } from './messages.js';
