/** Our decoder of lossless WebP against Chromium's, byte for byte, on real images; and their times. */
import type * as Decoder from '../../../packages/formats/dist/webp/decode.js';
import type * as Native from '../../../packages/formats/dist/webp/native.js';

/** Not part of the package's surface, so it is imported from the build's output. */
const BUILT: string = '/packages/formats/dist/webp/decode.js';
const BUILT_NATIVE: string = '/packages/formats/dist/webp/native.js';

const IMAGES = [
  'scenes/logo-sog-v1/means_l.webp',
  'scenes/logo-sog-v1/means_u.webp',
  'scenes/logo-sog-v1/quats.webp',
  'scenes/logo-sog-v1/scales.webp',
  'scenes/logo-sog-v1/sh0.webp',
  'scenes/playbot-streamed/3_0/shN_centroids.webp',
  'scenes/playbot-streamed/3_0/shN_labels.webp',
  'scenes/playbot-streamed/0_0/quats.webp',
];

/** RGBA bytes as Chromium decodes them; through WebGL, since a 2D canvas premultiplies. */
async function decodeInBrowser(file: Uint8Array<ArrayBuffer>): Promise<Uint8Array> {
  const image = await createImageBitmap(new Blob([file]), { premultiplyAlpha: 'none', colorSpaceConversion: 'none' });
  const gl = new OffscreenCanvas(1, 1).getContext('webgl2')!;
  gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, image);
  gl.bindFramebuffer(gl.FRAMEBUFFER, gl.createFramebuffer());
  gl.framebufferTexture2D(
    gl.FRAMEBUFFER,
    gl.COLOR_ATTACHMENT0,
    gl.TEXTURE_2D,
    gl.getParameter(gl.TEXTURE_BINDING_2D),
    0,
  );
  const rgba = new Uint8Array(4 * image.width * image.height);
  gl.readPixels(0, 0, image.width, image.height, gl.RGBA, gl.UNSIGNED_BYTE, rgba);
  return rgba;
}

describe('lossless WebP', () => {
  let decodeWebp: typeof Decoder.decodeWebp;
  let decodeNatively: typeof Native.decodeNatively;
  before(async () => {
    ({ decodeWebp } = (await import(BUILT)) as typeof Decoder);
    ({ decodeNatively } = (await import(BUILT_NATIVE)) as typeof Native);
  });

  for (const name of IMAGES) {
    it(`${name} is what Chromium decodes`, async function () {
      const response = await fetch(`/net/shared/${name}`);
      if (!response.ok) return this.skip();
      const file = new Uint8Array(await response.arrayBuffer());
      const start = performance.now();
      const { width, height, pixels } = decodeWebp(file);
      const ours = performance.now() - start;
      const native = await decodeNatively(file, { width, height });
      const theirs = performance.now() - start - ours;
      if (file.length >= 4096) {
        if (native === undefined) throw new Error('Chromium has a decoder that is exact');
        const at = native.pixels.findIndex((pixel, i) => pixel !== pixels[i]);
        if (at >= 0 || native.pixels.length !== pixels.length) throw new Error(`pixel ${at} is another by Chromium's`);
      }
      const expected = await decodeInBrowser(file);
      if (expected.length !== 4 * pixels.length) throw new Error(`${pixels.length} pixels, not ${expected.length / 4}`);
      for (let i = 0; i < pixels.length; i++) {
        const p = pixels[i];
        const e = 4 * i;
        const isSame =
          ((p >>> 16) & 255) === expected[e] && ((p >>> 8) & 255) === expected[e + 1] && (p & 255) === expected[e + 2];
        if (!isSame || p >>> 24 !== expected[e + 3])
          throw new Error(`pixel ${i} is ${p.toString(16)}, not ${expected.slice(e, e + 4)}`);
      }
      console.log(`${name}: ${pixels.length} pixels in ${ours.toFixed(0)} ms, by the browser ${theirs.toFixed(0)} ms`);
    });
  }
});
