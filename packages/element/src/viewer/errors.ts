import { GaussianSplatError, type ErrorCode } from '@gaussian-splat/core';
import type { A11yStrings } from './strings.js';

/** Failure families, the values of `element.error.code`. */
export type ElementErrorCode = 'unsupported' | 'network' | 'decode' | 'contract' | 'device-lost' | 'out-of-memory';

/** Reason that an element shows no scene. */
export interface ElementError {
  /** Family of the failure, for decisions by the page. */
  readonly code: ElementErrorCode;
  /** The full, stable code, for example `network/status`. */
  readonly reason: ErrorCode;
  /** For the author of the page: expected and found values, the place of the error, and the remedy. */
  readonly message: string;
  readonly cause: unknown;
}

const FAMILIES: readonly ElementErrorCode[] = [
  'unsupported',
  'network',
  'decode',
  'contract',
  'device-lost',
  'out-of-memory',
];

/** Converts any failure to an error of the element. */
export function toElementError(error: unknown): ElementError {
  if (error instanceof GaussianSplatError) {
    // A family is also a code of the element, except `argument`: that family means that a scene passed its reader but
    // not the renderer.
    const code = FAMILIES.find((family) => family === error.family) ?? 'decode';
    return { code, reason: error.code, message: error.message, cause: error };
  }
  const message = error instanceof Error ? `${error.name}: ${error.message}` : String(error);
  return { code: 'decode', reason: 'decode/corrupt', message, cause: error };
}

/**
 * Returns one sentence for visitors, who can fix little: the page's own text, or else the English one for the failure.
 */
export function visitorMessage({ code, reason }: ElementError, strings: A11yStrings): string {
  const own = strings[`error-${code}`];
  if (own !== undefined) return own;
  return visitorMessages[reason] ?? VISITOR_MESSAGES[code];
}

/**
 * Messages for visitors by stable code, which take precedence over those of the family. Code that creates such an error
 * adds its message.
 */
export const visitorMessages: Partial<Record<ErrorCode, string>> = {
  'unsupported/wrong-image': 'This 3D scene cannot be drawn correctly here: update the browser or graphics driver.',
};

const VISITOR_MESSAGES: Readonly<Record<ElementErrorCode, string>> = {
  unsupported: 'This 3D scene needs WebGPU, which is not available here.',
  network: 'The 3D scene could not be downloaded.',
  decode: 'The 3D scene could not be read.',
  contract: 'The model of the 3D scene could not be run.',
  'device-lost': 'The graphics device was lost. Reload the page to see the 3D scene.',
  'out-of-memory': 'The 3D scene needs more memory than this device has.',
};
