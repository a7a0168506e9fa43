import { GaussianSplatError } from '@gaussian-splat/core';

/** What WebGL cannot show. @param cause why there is no WebGPU */
export const cannotShow = (what: string, cause?: unknown): GaussianSplatError =>
  new GaussianSplatError('unsupported/webgl', {
    where: 'this page, which draws with WebGL 2 in place of WebGPU',
    expected: 'one scene file, alone, that fits into memory',
    found: what,
    remedy: 'use a browser with WebGPU, or show a scene file here',
    cause,
  });

/** Of a page that asks for WebGL by name. */
export const noWebGl = (): GaussianSplatError =>
  new GaussianSplatError('unsupported/webgl', {
    where: 'this browser',
    expected: 'WebGL 2',
    found: 'none',
    remedy: 'switch on hardware acceleration in the browser settings, or leave the attribute renderer out',
  });
