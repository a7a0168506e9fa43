import { loadModule } from '@gaussian-splat/core';
import type * as detection from './detect.js';
import type * as diagnosis from './diagnose.js';
import type * as leftOut from './dropped-splats.js';
import { signedFormat, type UsualFormat } from './formats.js';
import type * as previews from './preview.js';
import type { SceneFormat, SceneReader } from './scene-format.js';

/** Modules of this package that are loaded on demand. Failed loads reject with GaussianSplatError `network/unreachable`. */

export const loadReader = ({ title, load }: Pick<SceneFormat, 'title' | 'load'>): Promise<SceneReader> =>
  loadModule(`the code that reads ${title}`, load);

/** Loads diagnose.ts, which identifies files that are not scenes. */
export const loadDiagnosis = (): Promise<typeof diagnosis> =>
  loadModule('the code for other files', () => import('./diagnose.js'));

/** Loads detect.ts, which detects formats without a common signature. */
export const loadDetection = (): Promise<typeof detection> =>
  loadModule('the code that detects formats', () => import('./detect.js'));

/** Returns the format of a file, or of its beginning; undefined if no format is detected. Most need no further code. */
export const formatOf = async (
  bytes: Uint8Array,
  name: string,
  contentType: string,
): Promise<UsualFormat | undefined> =>
  signedFormat(bytes) ?? (await loadDetection()).findFormat(bytes, name, contentType);

/** Loads preview.ts, which creates previews of scenes that have been read. */
export const loadPreviews = (): Promise<typeof previews> =>
  loadModule('the code that makes previews', () => import('./preview.js'));

/** Loads dropped-splats.ts, which reports dropped splats. */
export const loadLeftOut = (): Promise<typeof leftOut> =>
  loadModule('the code of warnings', () => import('./dropped-splats.js'));
