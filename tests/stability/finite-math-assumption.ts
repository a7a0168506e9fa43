/**
 * S5b. WGSL may assume that there is no NaN and no infinity.
 *
 * Who fails: any shader that asks `x != x` or compares with an infinity: the specification lets compilers drop the question (WGSL, section on
 * floating point evaluation); subnormals may be flushed.
 *
 * Recipe: asked for a check when shaders are compiled. Run on their text, and with packed splats of such bits besides.
 *
 * Passes: no shader asks a float whether it is a number, bit patterns are asked instead; packed splats whose bits are those of NaN and infinities,
 * which no CPU has seen, are not drawn and are counted.
 */
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { GaussianBuffers, packGaussians, type PackedGaussians } from '@gaussian-splat/renderer';
import { nodeDevice } from '../support/node-device.js';
import { offCenter } from '../support/scenes.js';
import { differingBytes, notFinite, RASTERIZERS, resized, THREADS } from './support/images.js';
import { holds } from './support/row.js';
import { shaderTexts } from './support/sources.js';
import { capture, Renderer } from '../support/renderer.js';

test('shaders ask bits, not floats, whether a number is one', () => {
  const texts = shaderTexts();
  assert.ok(texts.size > 20, 'the shaders were found');
  const faults = [...texts].flatMap(([name, text]) => {
    const same = [...text.matchAll(/([\w.[\]]+)\s*(?:!=|==)\s*([\w.[\]]+)/g)].filter(
      ([, a, b]) => a === b && /[a-z]/.test(a),
    );
    const named = text.match(/\b(?:isNan|isInf|isnan|isinf)\b|1\.0\s*\/\s*0\.0|0x1p128/g) ?? [];
    return [...same.map(([found]) => found), ...named].map((found) => `${name}: ${found}`);
  });
  assert.deepEqual(faults, []);
  const guard = texts.get('shared/packed_gaussian.wgsl') ?? '';
  assert.match(guard, /words & vec4u\(EXPONENT_BITS\)/, 'the guard looks at exponent bits');
  assert.match(guard, /EXPONENT_BITS = 0x7f800000u/);
});

/** Bits of NaN, infinities and their negatives in every word of the geometry that holds a float's upper bits, a splat each. */
function withBadBits(packed: PackedGaussians): { spoilt: PackedGaussians; bad: Set<number> } {
  const geometry = packed.geometry.slice();
  const stride = geometry.length / packed.count;
  const patterns = [0x7fc00000, 0x7f800000, 0xff800000, 0xffc00000, 0x7f800400];
  const bad = new Set<number>();
  for (let i = 0; i < packed.count; i += 7) {
    const word = (i / 7) % stride;
    // Below the 22 bits of the shape's words lie parts of other numbers, which stay.
    const keep = word < 3 ? 0 : 0x3ff;
    const at = stride * i + word;
    geometry[at] = ((patterns[Math.floor(i / 7 / stride) % patterns.length] & ~keep) | (geometry[at] & keep)) >>> 0;
    bad.add(i);
  }
  return { spoilt: { ...packed, geometry }, bad };
}

/** The same with those splats made invisible by an opacity of 0. */
function without({ geometry, ...packed }: PackedGaussians, bad: ReadonlySet<number>): PackedGaussians {
  const clear = geometry.slice();
  const stride = clear.length / packed.count;
  for (const i of bad) {
    clear[stride * i + 5] &= ~0xff;
    clear[stride * i + 6] &= ~0x3ff;
    clear[stride * i + 7] &= ~0x3ff;
  }
  return { ...packed, geometry: clear };
}

for (const rasterizer of RASTERIZERS) {
  test(`bits that no CPU has checked, ${rasterizer}`, async () => {
    const device = await nodeDevice();
    const { cloud, cameras } = offCenter();
    const camera = resized(cameras[0], 120);
    const packed = packGaussians(cloud);
    const { spoilt, bad } = withBadBits(packed);
    const renderer = new Renderer(device, { threads: THREADS, rasterizer });
    const images: Float32Array[] = [];
    let unusable = 0;
    for (const scene of [without(packed, bad), spoilt]) {
      const gaussians = await GaussianBuffers.upload(device, scene);
      images.push(await capture(device, renderer, { gaussians, camera }));
      ({ unusable } = await renderer.stats());
      gaussians.destroy();
    }
    holds('S5b', `bits of NaN and infinity, ${rasterizer}: differing bytes`, differingBytes(images[0], images[1]), {
      atMost: 0,
      unit: 'bytes',
    });
    holds('S5b', `${rasterizer}, numbers that are not finite`, notFinite(images[1]), { atMost: 0, unit: 'numbers' });
    holds('S5b', `${rasterizer}, counted of ${bad.size}`, unusable, { atLeast: 1, atMost: bad.size, unit: 'splats' });
    renderer.destroy();
  });
}
