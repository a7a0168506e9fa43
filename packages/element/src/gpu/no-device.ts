/** Errors of missing GPU devices and of insufficient memory, and other rare errors. The module is loaded on demand. */
import { GaussianSplatError } from '@gaussian-splat/core';
import { visitorMessages } from '../viewer/errors.js';

const NO_ADAPTER =
  'This 3D scene needs WebGPU, and this browser found no graphics adapter for it: switch on hardware acceleration or update the graphics driver.';
Object.assign(visitorMessages, {
  'unsupported/insecure-context':
    'This 3D scene needs WebGPU, which browsers offer only on secure pages: open this page over https.',
  'unsupported/no-webgpu':
    'This 3D scene needs WebGPU, which this browser does not have: open the page in a current Chrome, Edge, Safari or Firefox.',
  'unsupported/no-adapter': NO_ADAPTER,
  'unsupported/limits': NO_ADAPTER,
});

export function noWebGpu(): GaussianSplatError {
  if (globalThis.isSecureContext === false) {
    return new GaussianSplatError('unsupported/insecure-context', {
      where: 'this page',
      expected: 'a secure context (https or localhost), which WebGPU requires',
      found: `the insecure address ${globalThis.location?.origin ?? '(none)'}`,
      remedy: 'serve the page over https, or from localhost',
    });
  }
  return new GaussianSplatError('unsupported/no-webgpu', {
    where: 'this browser',
    expected: 'WebGPU (navigator.gpu)',
    found: 'none',
    remedy: 'use a current Chrome, Edge, Safari or Firefox with WebGPU switched on',
  });
}

export const noAdapter = (): GaussianSplatError =>
  new GaussianSplatError('unsupported/no-adapter', {
    where: 'this browser',
    expected: 'a graphics adapter for WebGPU',
    found: 'none',
    remedy: 'switch on hardware acceleration in the browser settings, or update the graphics driver',
  });

/** Returns the error of a page that has changed `Array.from`, as Prototype.js 1.7 does. */
export const changedPage = (): GaussianSplatError =>
  new GaussianSplatError('unsupported/page', {
    where: 'this page',
    expected: "the browser's Array.from",
    found: 'a replacement by a script of the page',
    remedy: 'load a version of that script that keeps Array.from, or show the scene in an iframe',
  });

export const noLimits = (error: unknown): GaussianSplatError =>
  new GaussianSplatError('unsupported/limits', {
    where: 'the graphics adapter',
    expected: 'a device within the limits that the adapter itself reports',
    found: error instanceof Error ? error.message : String(error),
    remedy: 'update the graphics driver or the browser',
    cause: error,
  });

export const noContext = (): GaussianSplatError =>
  new GaussianSplatError('unsupported/no-webgpu', {
    where: 'canvas',
    expected: 'a canvas context to draw into',
    found: 'none',
    remedy: 'use a browser that shows WebGPU on a canvas',
  });

/** Returns the error of a page whose function for devices has failed, or of a browser that does not respond. */
export const noDevice = (cause: unknown): GaussianSplatError =>
  new GaussianSplatError('unsupported/no-adapter', {
    where: 'the graphics adapter',
    expected: 'a WebGPU device',
    found: cause instanceof Error ? cause.message : String(cause),
    remedy: 'reload the page, or update the graphics driver',
    cause,
  });

/**
 * Returns the error of a failed GPU allocation, `out-of-memory/allocation`.
 * @param where Description of the content that could not be drawn.
 */
export const outOfMemory = (where: string, cause: GPUError): GaussianSplatError =>
  new GaussianSplatError('out-of-memory/allocation', {
    where,
    expected: 'enough free GPU memory',
    found: cause.message || 'an allocation that failed',
    remedy: 'show a smaller scene, or close other pages and elements that use the GPU',
    cause,
  });

export const sequenceWithin = (url: string): GaussianSplatError =>
  new GaussianSplatError('decode/unsupported', {
    where: url,
    expected: 'a scene file',
    found: 'the manifest of a sequence',
    remedy: 'name scene files as frames of a sequence, not other sequences',
  });
