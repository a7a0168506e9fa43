/** A frame of the WebGL renderer alone, as a canvas has it. In browsers only. */
import type { Camera } from '@gaussian-splat/core';
import type { AccumulationFormat, PackedGaussians } from '@gaussian-splat/renderer';
import {
  DATA_WIDTH,
  GlGaussians,
  GlRenderer,
  orderView,
  positionsIn,
  SplatOrder,
} from '@gaussian-splat/renderer/webgl';

/** [height, width, 4] premultiplied, from 8 bits. */
export async function drawWithWebGl(
  packed: PackedGaussians,
  camera: Camera,
  accumulation: AccumulationFormat = 'rgba16float',
): Promise<Float32Array> {
  const { width, height } = camera;
  const canvas = Object.assign(document.createElement('canvas'), { width, height });
  const gl = canvas.getContext('webgl2', { antialias: false, depth: false });
  if (gl === null) throw new Error('no WebGL 2 in this browser');
  const gaussians = await GlGaussians.upload(gl, packed);
  const renderer = new GlRenderer(gl, gaussians);
  try {
    const order = new Uint32Array(Math.max(1, Math.ceil(packed.count / DATA_WIDTH)) * DATA_WIDTH);
    renderer.setOrder(
      order,
      new SplatOrder(positionsIn(packed.geometry)).sort(orderView(camera, packed.origin), order),
    );
    renderer.render({ camera, accumulation, shDegree: 3, resolutionScale: 1 });
    renderer.present();
    const bytes = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    const row = 4 * width;
    // WebGL counts rows from below.
    return Float32Array.from(bytes, (_, i) => bytes[row * (height - 1 - Math.floor(i / row)) + (i % row)] / 255);
  } finally {
    renderer.destroy();
    gaussians.destroy();
    gl.getExtension('WEBGL_lose_context')?.loseContext();
  }
}
