/** What a frame of a session may take, by the rate of the headset, and how the size of what is drawn follows. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { XrLoop } from '../../packages/element/dist/xr/xr-session.js';

class Layer {
  readonly framebuffer = null;
}
Object.assign(globalThis, { XRWebGLLayer: Layer });

function loopAt(frameRate: number | undefined): XrLoop {
  const session = { frameRate, updateRenderState: () => undefined, requestAnimationFrame: () => 0 };
  const guide = { background: [0, 0, 0, 1] as const, place: () => null };
  return new XrLoop(session as never, { gl: {} as never, isOwn: true }, {} as never, guide);
}

for (const [rate, milliseconds] of [
  [72, 11.11],
  [90, 8.89],
  [120, 6.67],
  [undefined, 11.11],
] as const) {
  test(`at ${rate ?? 'an unknown number of'} frames a second a frame may take ${milliseconds} ms`, () => {
    const loop = loopAt(rate);
    assert.ok(Math.abs(loop.targetMs - milliseconds) < 0.01, `${loop.targetMs} ms`);
    loop.adapt(loop.targetMs - 0.1);
    assert.equal(loop.scale, 1);
    loop.adapt(loop.targetMs + 0.1);
    assert.ok(loop.scale < 1, 'fewer pixels');
    for (let k = 0; k < 20; k++) loop.adapt(3 * loop.targetMs);
    assert.equal(loop.scale, 0.5);
    // Between half of it and all of it nothing changes, so that the size does not swing.
    loop.adapt(0.75 * loop.targetMs);
    assert.equal(loop.scale, 0.5);
    for (let k = 0; k < 20; k++) loop.adapt(0.3 * loop.targetMs);
    assert.equal(loop.scale, 1);
  });
}
