import { sceneFormats } from './formats.js';
import type { SceneFormat } from './scene-format.js';

/** The format that the first bytes of a file prove; undefined where another than they must tell. */
export const signedFormat = (bytes: Uint8Array): SceneFormat | undefined =>
  sceneFormats.find(({ hasSignature }) => hasSignature?.(bytes));
