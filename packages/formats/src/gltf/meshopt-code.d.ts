/** `npm run build` writes this module by scripts/decoders.mjs. */
export { MeshoptDecoder } from 'meshoptimizer/decoder';
