/** Scenes that come in portions, in any order, over pages. */
import { GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { check, checkEqual, withBufferLimit, type StageCase } from '../../support/gpu.js';
import { room, thinned } from '../../support/scenes.js';

const PAGE = 512;

const inPortions: StageCase = {
  name: 'upload: portions of a scene, in any order and across pages, are the scene',
  async run({ device, read }) {
    const packed = packGaussians(thinned(room(), 3000).cloud, { sh: 'int8' });
    const { geometry, sh, chunks, ...head } = packed;
    const stride = sh.length / packed.count;
    const small = withBufferLimit(device, PAGE * 4 * Math.max(8, stride));
    const gaussians = await GaussianBuffers.allocate(small, head);
    check(gaussians.blocks.length > 1, `${gaussians.blocks.length} page`);
    // No portion ends with a page.
    const starts: number[] = [];
    for (let start = 0; start < packed.count; start += 700) starts.push(start);
    await gaussians.write({ chunks });
    for (const start of starts.reverse()) {
      const end = Math.min(start + 700, packed.count);
      await gaussians.write({
        start,
        geometry: geometry.subarray(8 * start, 8 * end),
        sh: sh.subarray(stride * start, stride * end),
      });
    }
    let first = 0;
    for (const page of gaussians.blocks) {
      const end = first + page.count;
      const bounds = new Uint32Array(chunks.buffer, chunks.byteOffset, chunks.length);
      checkEqual(await read(page.geometry, 32 * page.count), geometry.subarray(8 * first, 8 * end), 'geometry');
      checkEqual(await read(page.sh, 4 * stride * page.count), sh.subarray(stride * first, stride * end), 'harmonics');
      const found = await read(page.chunks, 32 * Math.ceil(page.count / 256));
      checkEqual(found, bounds.subarray(8 * (first / 256), 8 * Math.ceil(end / 256)), 'chunks');
      first = end;
    }
    check(first === packed.count, `${first} splats`);
    gaussians.destroy();
  },
};

/** 12 MB of geometry: steps wait for the GPU. */
const inSteps: StageCase = {
  name: 'upload: a scene of several steps is whole, and ends with its scene',
  async run({ device, read }) {
    const count = 3 << 17;
    const geometry = Uint32Array.from({ length: 8 * count }, (_, k) => k);
    const one = packGaussians(thinned(room(), 3).cloud);
    const allocate = (): Promise<GaussianBuffers> => GaussianBuffers.allocate(device, { ...one, count });
    const gaussians = await allocate();
    await gaussians.write({ geometry });
    checkEqual(await read(gaussians.blocks[0].geometry, geometry.byteLength), geometry, 'geometry');
    gaussians.destroy();
    device.pushErrorScope('validation');
    const ended = await allocate();
    const written = ended.write({ geometry });
    ended.destroy();
    await written;
    check((await device.popErrorScope()) === null, 'a destroyed scene is written');
  },
};

export const portionCases: readonly StageCase[] = [inPortions, inSteps];
