import { cullQuantized, cullSerialQuantized, projectQuantized } from '../generated/quantized-shaders.js';
import type { GeometryReading } from '../geometry-reading.js';

/** Shaders that read the chunks of {@link packQuantizedChunk}. */
export const QUANTIZED: GeometryReading = {
  cull: cullQuantized,
  cullSerial: cullSerialQuantized,
  project: projectQuantized,
};
