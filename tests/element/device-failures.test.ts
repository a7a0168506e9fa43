/** Error texts for a device that cannot be restored. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { GaussianSplatError } from '@gaussian-splat/core';
import { unrecoverable, DeviceLostError } from '../support/element/parts.js';

test('a lost device is reported with the words of the browser and a remedy', () => {
  const info = { reason: 'unknown', message: 'DXGI_ERROR_DEVICE_HUNG.' } as GPUDeviceLostInfo;
  const none = new GaussianSplatError('unsupported/no-adapter', {
    ...{ where: 'this browser', expected: 'a graphics adapter for WebGPU', found: 'none', remedy: 'update' },
  });
  const lost = 'found a device that was lost (reason "unknown": DXGI_ERROR_DEVICE_HUNG)';
  const said = (cause: unknown, loss?: GPUDeviceLostInfo): string => unrecoverable(cause, loss).message;
  const has = (message: string, part: string): void => assert.ok(message.includes(part), message);
  has(said(new DeviceLostError(info), info), `${lost}. Reload the page; `);
  has(
    said(none, info),
    `${lost}, and no other in its place (this browser: none). Reload the page, to which the browser may refuse the GPU`,
  );
  has(said(none), 'found a device that was lost, and no other in its place (this browser: none). Reload');
  has(said(new DeviceLostError(info), { ...info, reason: 'destroyed' }), '. A script of this page called');
  has(said(new DeviceLostError(info), { ...info, message: '' }), '(reason "unknown": nothing more is known)');
  const generators = new GaussianSplatError('device-lost/unrecoverable', {
    ...{
      where: 'GPU device of the generator',
      expected: 'an available device',
      found: 'one that was lost',
      remedy: '',
    },
  });
  has(said(generators), 'found a device that was lost. Reload the page; ');
});
