import { drawn } from './gl-clock.js';

/**
 * Reads texels of 4 integers from a framebuffer, as they are at the call. The thread does not wait for the GPU. Rejects
 * if the context is lost.
 * @param attachment Number of the color attachment that is read.
 */
export async function readTexels(
  gl: WebGL2RenderingContext,
  framebuffer: WebGLFramebuffer,
  [width, height]: readonly [number, number],
  attachment = 0,
): Promise<Uint32Array> {
  const words = new Uint32Array(4 * width * height);
  const buffer = gl.createBuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
  gl.readBuffer(gl.COLOR_ATTACHMENT0 + attachment);
  gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
  gl.bufferData(gl.PIXEL_PACK_BUFFER, words.byteLength, gl.STREAM_READ);
  gl.readPixels(0, 0, width, height, gl.RGBA_INTEGER, gl.UNSIGNED_INT, 0);
  // Other readers of the context expect that none is bound.
  gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
  try {
    await drawn(gl);
    // A host may have bound a buffer of its own meanwhile.
    const bound = gl.getParameter(gl.PIXEL_PACK_BUFFER_BINDING) as WebGLBuffer | null;
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
    gl.getBufferSubData(gl.PIXEL_PACK_BUFFER, 0, words);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, bound);
    return words;
  } finally {
    gl.deleteBuffer(buffer);
  }
}
