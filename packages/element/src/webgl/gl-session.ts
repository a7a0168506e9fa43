/**
 * One WebGL context for all elements of a page, because browsers drop the oldest of more than 8 or 16 contexts.
 * Elements show copies of the context's image.
 */
import { GaussianSplatError } from '@gaussian-splat/core';
import { MemoryLedger } from '@gaussian-splat/renderer';
import { GlClock } from '@gaussian-splat/renderer/webgl';
import type { DeviceOwner } from '../gpu/backend.js';
import type { DeviceLease } from '../gpu/shared-device.js';

/** A lease of the page's context. Its `device` throws a descriptive error, because there is no WebGPU device. */
export interface GlLease extends DeviceLease {
  readonly gl: WebGL2RenderingContext;
  readonly clock: GlClock;
  /** Enlarges the canvas to at least this size, pixels. A canvas that grows is cleared. */
  fit(width: number, height: number): void;
}

const LOSS = { reason: 'unknown', message: 'the WebGL context was lost' } as GPUDeviceLostInfo;

class GlSession {
  readonly gl: WebGL2RenderingContext;
  readonly clock: GlClock;
  readonly limits: DeviceOwner['limits'];
  readonly memory: MemoryLedger;
  isLost = false;
  /** Listeners of a lost context. A shared promise would retain every listener that ever waited for it. */
  readonly #listeners = new Set<() => void>();
  #users = 0;

  constructor(gl: WebGL2RenderingContext) {
    this.gl = gl;
    this.clock = new GlClock(gl);
    const [width, height] = gl.getParameter(gl.MAX_VIEWPORT_DIMS) as Int32Array;
    const side = gl.getParameter(gl.MAX_TEXTURE_SIZE) as number;
    this.limits = { maxTextureDimension2D: Math.min(width, height, side) };
    this.memory = MemoryLedger.of(gl);
    gl.canvas.addEventListener('webglcontextlost', () => {
      this.isLost = true;
      if (current === this) current = undefined;
      for (const notify of this.#listeners) notify();
      this.#listeners.clear();
    });
  }

  fit(width: number, height: number): void {
    const { canvas } = this.gl;
    if (canvas.width < width) canvas.width = width;
    if (canvas.height < height) canvas.height = height;
  }

  lease(): GlLease {
    this.#users++;
    let notify: () => void = () => undefined;
    const lost = new Promise<GPUDeviceLostInfo>((resolve) => (notify = () => resolve(LOSS)));
    this.#listeners.add(notify);
    let isReleased = false;
    const isLost = (): boolean => this.isLost;
    return {
      gl: this.gl,
      clock: this.clock,
      context: this.gl,
      limits: this.limits,
      memory: this.memory,
      get device(): never {
        throw cannotShow('what needs WebGPU');
      },
      lost,
      get isLost() {
        return isLost();
      },
      fit: (width, height) => this.fit(width, height),
      release: () => {
        if (isReleased) return;
        isReleased = true;
        this.#listeners.delete(notify);
        if (--this.#users === 0) this.#end();
      },
    };
  }

  #end(): void {
    if (current === this) current = undefined;
    // Without this call, the memory of the context would stay until the canvas is garbage-collected.
    this.gl.getExtension('WEBGL_lose_context')?.loseContext();
  }
}

let current: GlSession | undefined;

/** Returns a lease of the page's context; undefined if the browser supports no WebGL 2. */
export function acquireGl(): GlLease | undefined {
  current ??= start();
  return current?.lease();
}

function start(): GlSession | undefined {
  const gl = document.createElement('canvas').getContext('webgl2', {
    alpha: true,
    // A headset may be connected to another GPU, which could not draw from an incompatible context.
    xrCompatible: document.querySelector('gaussian-splat:is([vr],[ar])') !== null,
    antialias: false,
    depth: false,
    stencil: false,
    powerPreference: 'high-performance',
  });
  return gl && !gl.isContextLost() ? new GlSession(gl) : undefined;
}

/**
 * Returns the error for a feature that WebGL lacks.
 * @param what The feature.
 * @param cause Reason that WebGPU is not used.
 */
export const cannotShow = (what: string, cause?: unknown): GaussianSplatError =>
  new GaussianSplatError('unsupported/webgl', {
    where: 'this page, which draws with WebGL 2 in place of WebGPU',
    expected: 'one scene file, alone, that fits into memory',
    found: what,
    remedy: 'use a browser with WebGPU, or show a scene file here',
    cause,
  });

/** Returns the error for a page that requests WebGL in a browser without it. */
export const noWebGl = (): GaussianSplatError =>
  new GaussianSplatError('unsupported/webgl', {
    where: 'this browser',
    expected: 'WebGL 2',
    found: 'none',
    remedy: 'switch on hardware acceleration in the browser settings, or leave the attribute renderer out',
  });
