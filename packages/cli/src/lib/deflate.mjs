/** Pieces of a raw deflate stream, one behind the other: each ends with a sync flush. */
import { constants, deflateRawSync } from 'node:zlib';

const STRATEGIES = [constants.Z_DEFAULT_STRATEGY, constants.Z_HUFFMAN_ONLY, constants.Z_FILTERED];

const deflatedBy = (bytes, options) => deflateRawSync(bytes, { ...options, finishFlush: constants.Z_SYNC_FLUSH });

/** By whichever strategy makes it smallest. */
export function deflate(bytes) {
  const pieces = STRATEGIES.map((strategy) => deflatedBy(bytes, { strategy, level: 9, memLevel: 9 }));
  return pieces.reduce((best, piece) => (piece.length < best.length ? piece : best));
}

/** Where only what it holds counts. */
export const deflateQuickly = (bytes) => deflatedBy(bytes, { level: 1 });
