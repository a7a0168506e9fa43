/** Reads the manifests of sequences. The module is loaded only for sequences. */
export { parseSequence } from '@gaussian-splat/formats';
