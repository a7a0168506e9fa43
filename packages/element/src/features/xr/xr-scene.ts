import { GaussianSplatError } from '@gaussian-splat/core';
import { GlGaussians, GlRenderer, positionsIn } from '@gaussian-splat/renderer/webgl';
import { isHandheld } from '../../gpu/memory-budget.js';
import type { LoadedGaussians } from '../../gpu/loaded-gaussians.js';
import type { SceneRequest } from '../../loading/protocol.js';
import type { SceneLoader } from '../../loading/scene-loader.js';
import { kindOf } from '../../sources/source-kinds.js';
import { GlLoaded } from '../../webgl/gl-loaded.js';
import { WebGlBackend } from '../../webgl/webgl-backend.js';

/** Timeout for making a context compatible with a headset, milliseconds: browsers without a headset never answer. */
const COMPATIBLE_MS = 2_000;

/**
 * Memory limit of a streamed scene in a session, bytes: 400,000 splats in headsets and phones, 1.5 million on
 * computers.
 */
const STREAM_BYTES = { handheld: 50e6, computer: 186e6 };

/** A scene that a session draws with WebGL. */
export interface XrScene {
  readonly renderer: GlRenderer;
  /** [N, 3] positions relative to `origin`. */
  readonly positions: Float32Array;
  readonly origin: GlGaussians['facts']['origin'];
  destroy(): void;
}

/** WebGL context of a session. `isOwn` is false if it is the context of the page. */
export interface XrContext {
  readonly gl: WebGL2RenderingContext;
  readonly isOwn: boolean;
}

/** The element's own scene when a session starts. */
export interface XrShown {
  readonly shown: LoadedGaussians | null;
  /** Request of a scene file; null for a scene that moves, and if the element has no scene of its own. */
  readonly request: SceneRequest | null;
}

export interface XrSceneSource extends XrShown {
  readonly request: SceneRequest;
  readonly loader: SceneLoader;
}

/**
 * Returns the page's context if the page draws with WebGL and the headset is compatible with it; otherwise a new
 * context.
 */
export async function contextFor(shown: LoadedGaussians | null): Promise<XrContext> {
  if (shown instanceof GlLoaded && !shown.place.isLost && (await becomesCompatible(shown.lease.gl)))
    return { gl: shown.lease.gl, isOwn: false };
  const gl = document.createElement('canvas').getContext('webgl2', {
    ...{ alpha: true, antialias: false, depth: false, stencil: false, xrCompatible: true },
    powerPreference: 'high-performance',
  });
  if (gl === null || gl.isContextLost()) throw unsupported('a WebGL 2 context for a headset', 'none');
  return { gl, isOwn: true };
}

async function becomesCompatible(gl: WebGL2RenderingContext): Promise<boolean> {
  const { makeXRCompatible } = gl as { makeXRCompatible?: () => Promise<void> };
  if (!makeXRCompatible) return false;
  const late = new Promise<boolean>((resolve) => setTimeout(() => resolve(false), COMPATIBLE_MS));
  const made = makeXRCompatible.call(gl).then(
    () => !gl.isContextLost(),
    () => false,
  );
  return Promise.race([made, late]);
}

/**
 * Opens the scene in a context: with the displayed splats, or from the same file again, usually from the browser's
 * cache.
 */
export async function openXrScene(
  { gl, isOwn }: XrContext,
  { shown, request, loader }: XrSceneSource,
  signal: AbortSignal,
): Promise<XrScene> {
  if (!isOwn && shown instanceof GlLoaded) {
    const { textures, positions } = shown.content;
    const renderer = new GlRenderer(gl, textures);
    return { renderer, positions, origin: textures.facts.origin, destroy: () => renderer.destroy() };
  }
  const inLevels = { ...request, levels: false, isWhole: false };
  const { name } = kindOf(inLevels);
  if (name === 'splats' || !WebGlBackend.can(name)) throw unsupported('the file of a scene', `a ${name}`);
  const streamBytes = name === 'stream' ? STREAM_BYTES[isHandheld() ? 'handheld' : 'computer'] : undefined;
  const asked = { ...inLevels, streamBytes };
  const { packed } = await loader.load(asked, signal, () => undefined);
  signal.throwIfAborted();
  const gaussians = await GlGaussians.upload(gl, packed);
  const renderer = new GlRenderer(gl, gaussians);
  const destroy = (): void => {
    renderer.destroy();
    gaussians.destroy();
  };
  return { renderer, positions: positionsIn(packed.geometry), origin: packed.origin, destroy };
}

export const unsupported = (expected: string, found: string): GaussianSplatError =>
  new GaussianSplatError('unsupported/xr', {
    where: '<gaussian-splat>',
    expected,
    found,
    remedy: 'use a browser and a device with WebXR, in a secure page whose frames allow="xr-spatial-tracking"',
  });
