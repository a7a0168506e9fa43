/** Threads beside a GPU: the reduced scene is the same with them and without. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { boundsOf, type GaussianCloud } from '@gaussian-splat/core';
import { viewSplitAround, degreesOf, GpuEvaluator, type ReducedCloud } from '@gaussian-splat/optimize';
import { inline, type TaskPool } from '@gaussian-splat/optimize/parts';
import { ThreadPool } from '../../packages/cli/src/lib/thread-pool.mjs';
import { assertSameCloud, assertSameNumbers } from '../formats/support/expect.js';
import { smallCloud } from '../formats/support/small-cloud.js';
import { endNodeDevice, serialDevice } from '../support/node-device.js';

const COPIES = 3;
const pool = new ThreadPool(2, 600);

after(async () => {
  await pool.close();
  await endNodeDevice();
});

/** Small splats, some of them differ from their copies by their place alone. */
function scene(): GaussianCloud {
  const few = smallCloud(1000, 1, 11);
  const repeated = (values: Float32Array): Float32Array => {
    const all = new Float32Array(new SharedArrayBuffer(COPIES * values.byteLength));
    for (let at = 0; at < all.length; at += values.length) all.set(values, at);
    return all;
  };
  const [positions, scales, rotations, opacities, sh] = [
    few.positions,
    few.scales.map((value) => 0.3 * value),
    few.rotations,
    few.opacities,
    few.sh,
  ].map(repeated);
  for (let k = 0; k < positions.length; k++) positions[k] += 0.3 * Math.floor(k / 3000);
  return { ...few, count: COPIES * few.count, positions, scales, rotations, opacities, sh };
}

test('threads take out of a scene what one thread does', async () => {
  const cloud = scene();
  const dealt = viewSplitAround(boundsOf(cloud), { width: 48, height: 32 });
  const views = {
    scored: dealt.scored.slice(0, 3),
    searched: dealt.searched.slice(0, 1),
    heldOut: dealt.heldOut.slice(0, 1),
  };
  const device = await serialDevice();
  const reduced = async (workers: TaskPool): Promise<ReducedCloud> => {
    const evaluator = await GpuEvaluator.create(device, cloud, views, { pool: workers });
    try {
      await evaluator.rank();
      return await evaluator.reduce({ minContribution: 0.02, colorPrice: 1e-6 });
    } finally {
      evaluator.destroy();
    }
  };
  const [alone, together] = [await reduced(inline), await reduced(pool)];
  const [constant, whole] = degreesOf(alone.degrees);
  assert.ok(constant > 200 && whole > 200 && constant + whole < cloud.count, `${constant} and ${whole}`);
  assertSameNumbers(together.degrees, alone.degrees);
  assertSameCloud(together.cloud, alone.cloud);
  assert.ok(pool.shares(together.cloud.sh.buffer) && !pool.shares(alone.cloud.sh.buffer));
});
