/** Loaded only for the manifest of a sequence. */
export { parseSequence } from '@gaussian-splat/formats';
