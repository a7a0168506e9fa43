import { cullQuantized, cullSerialQuantized, projectQuantized } from '../generated/quantized-shaders.js';
import type { GeometryReading } from '../geometry-reading.js';

/** Reads what {@link packQuantizedChunk} of quantized-geometry.ts writes. */
export const QUANTIZED: GeometryReading = {
  cull: cullQuantized,
  cullSerial: cullSerialQuantized,
  project: projectQuantized,
};
