/** The self-test finds a GPU that computes wrongly, whichever stage it is: stages are broken on purpose, one after another. */
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { passesSelfTest } from '@gaussian-splat/renderer/stages';
import { autotune, type RasterizerName } from '@gaussian-splat/renderer';
import { faultsOf, type Threads } from '@gaussian-splat/renderer/tools';
import { isLab } from '../support/extent.js';
import { miscompiling, type Miscompilation } from '../support/miscompilation.js';
import { endNodeDevice, nodeDevice } from '../support/node-device.js';

after(endNodeDevice);

interface Mutant extends Miscompilation {
  readonly what: string;
  /** Variants that have the stage; default all. */
  readonly threads?: Threads;
  readonly rasterizer?: RasterizerName;
}

const MUTANTS: readonly Mutant[] = [
  {
    what: 'chunks of a second page overwrite those of the first',
    shader: /gs.cull_chunks$/,
    from: 'chunk_shares[group] = share',
    to: 'chunk_shares[chunk] = share',
  },
  {
    what: 'chunks that are visible are left out',
    shader: /gs.cull_chunks$/,
    from: '!may_be_visible(',
    to: 'chunk == 3u || !may_be_visible(',
  },
  {
    what: 'the last word of a group is not counted',
    shader: /gs.cull$/,
    from: 'w < WORDS_PER_GROUP; w++) { count',
    to: 'w < WORDS_PER_GROUP - 1u; w++) { count',
    threads: 'parallel',
  },
  {
    what: 'bits of a group are lost when threads write at the same time',
    shader: /gs.cull$/,
    from: 'atomicOr(&bits[lane / 32u], 1u << (lane % 32u))',
    to: 'atomicStore(&bits[lane / 32u], 1u << (lane % 32u))',
    threads: 'parallel',
  },
  {
    what: 'the nearest depth is not found',
    shader: /gs.cull$/,
    from: 'atomicMax(&cull_stats[NEAREST_INVERTED], atomicLoad(&nearest_inverted))',
    to: 'atomicMax(&cull_stats[NEAREST_INVERTED], 0u)',
    threads: 'parallel',
  },
  {
    what: 'a bit of a word is lost',
    shader: /gs.cull_serial$/,
    from: 'bits |= 1u << k',
    to: 'bits |= (1u << k) & 0x7fffffffu',
    threads: 'serial',
  },
  {
    what: 'sums of a workgroup do not reach the last quarter',
    shader: /gs.plan$/,
    from: 'if (lane >= reach) { sum = add_vectors',
    to: 'if (lane >= reach && lane < 192u) { sum = add_vectors',
    threads: 'parallel',
  },
  {
    what: 'columns of a scan begin at nothing',
    shader: /gs.plan$/,
    from: 'let begins = add_vectors_saturating(before, sums_before(carry, columns));',
    to: 'let begins = before;',
    threads: 'parallel',
  },
  {
    what: 'sums of groups are one group late',
    shader: /gs.plan_serial$/,
    from: 'values[i] = sum;',
    to: 'values[i] = sum + own;',
    threads: 'serial',
  },
  {
    what: 'the survivors of a second page begin at the first slot',
    shader: /gs.plan/,
    from: 'PagePlan(first, end - first)',
    to: 'PagePlan(0u, end - first)',
  },
  {
    what: 'a rank within a group is counted in the lower half alone',
    shader: /gs.compact$/,
    from: 'bits_before(low, i32(word)) + bits_before(high, i32(word) - 4)',
    to: 'bits_before(low, i32(word))',
  },
  {
    what: 'survivors of later groups take the number of an earlier one',
    shader: /gs.compact$/,
    from: 'survivors[slot] = group * CULL_GROUP + lane',
    to: 'survivors[slot] = min(group, 5u) * CULL_GROUP + lane',
  },
  {
    what: 'a second page reads the splats of the first groups',
    shader: /gs.project$/,
    from: 'survivors[slot] - view.first_group * CULL_GROUP',
    to: 'survivors[slot]',
  },
  { what: 'a slope is lost', shader: /gs.project$/, from: 'dot(row_x, row_y) / variance_x', to: '0.0' },
  {
    what: 'later workgroups project nothing',
    shader: /gs.project$/,
    from: 'if (rank >= page.survivors) { return; }',
    to: 'if (rank >= min(page.survivors, 2048u)) { return; }',
  },
  {
    what: 'color does not change with direction',
    shader: /gs.project$/,
    from: 'normalize(toward)',
    to: 'vec3f(0.0, 0.0, 1.0)',
  },
  {
    what: 'keys of a full block are not all counted',
    shader: /gs.sort_count$/,
    from: 'atomicAdd(&histogram[digit_of(own[r], digit_pass.shift)], 1u)',
    to: 'atomicAdd(&histogram[digit_of(own[r], digit_pass.shift)], u32(r < 3u))',
    threads: 'parallel',
  },
  {
    what: 'counts of blocks after the first are not written',
    shader: /gs.sort_count_serial$/,
    from: 'counts[block_id * DIGITS + digit] = histogram[digit]',
    to: 'counts[min(block_id, 1u) * DIGITS + digit] = histogram[digit]',
    threads: 'serial',
  },
  {
    what: 'blocks do not begin where the ones before end',
    shader: /gs.sort_scan$/,
    from: 'var running = carry + inclusive - sum;',
    to: 'var running = carry;',
    threads: 'parallel',
  },
  {
    what: 'a block begins one key late',
    shader: /gs.sort_scan$/,
    from: '* (DIGITS / DIGITS_PER_GROUP) + workgroup_id.x] = running;',
    to: '* (DIGITS / DIGITS_PER_GROUP) + workgroup_id.x] = running + vec4u(u32(first + k == 2u));',
    threads: 'parallel',
  },
  {
    what: 'block offsets are those of the first block',
    shader: /gs.sort_scan_serial$/,
    from: 'counts[i] = sum;',
    to: 'counts[i] = 0u;',
    threads: 'serial',
  },
  {
    what: 'keys of a round are ranked by a part of the words',
    shader: /gs.sort_scatter$/,
    from: 'before += select(0u, countOneBits(mask), w < own_word)',
    to: 'before += select(0u, countOneBits(mask), w + 1u < own_word)',
    threads: 'parallel',
  },
  {
    what: 'bitmaps are not emptied between rounds',
    shader: /gs.sort_scatter$/,
    from: 'atomicStore(&exchange[w * DIGITS + digit], 0u);',
    to: 'if (r < 1u) { atomicStore(&exchange[w * DIGITS + digit], 0u); }',
    threads: 'parallel',
  },
  {
    what: 'the order among equal digits turns around',
    shader: /gs.sort_scatter_serial$/,
    from: 'for (var i = block_id * SORT_BLOCK; i < end; i++) {',
    to: 'for (var n = block_id * SORT_BLOCK; n < end; n++) { let i = end - 1u - (n - block_id * SORT_BLOCK);',
    threads: 'serial',
  },
  {
    what: 'the farthest batch of quads is missing',
    shader: /gs.rasterize_quads$/,
    from: 'let rank = instance * QUAD_BATCH',
    to: 'let rank = (instance + 1u) * QUAD_BATCH',
    rasterizer: 'quads',
  },
  {
    what: 'quads are painted without their slope',
    shader: /gs.rasterize_quads$/,
    from: 'offset.y - slope * offset.x',
    to: 'offset.y',
    rasterizer: 'quads',
  },
  {
    what: 'blending into float16 loses half a unit in the last place with each layer, as lavapipe does',
    shader: /gs.rasterize_quads$/,
    from: 'return vec4f(quad.color.rgb * alpha, alpha);',
    to: 'return vec4f(quad.color.rgb * alpha - 0.00012, alpha);',
    rasterizer: 'quads',
  },
  {
    what: 'splats are listed for one column of bins alone',
    shader: /gs.bin_count$/,
    from: '(count.x << 16u)',
    to: '(1u << 16u)',
    rasterizer: 'tiles',
  },
  {
    what: 'pairs of later groups are written over those of the first',
    shader: /gs.bin_emit$/,
    from: 'let base = group_pairs[group];',
    to: 'let base = group_pairs[group % 8u];',
    rasterizer: 'tiles',
  },
  {
    what: 'the first pair of a bin is missing',
    shader: /gs.bin_index$/,
    from: 'ranges[bin].x = i;',
    to: 'ranges[bin].x = i + 40u;',
    rasterizer: 'tiles',
  },
];

// Barriers take SwiftShader seconds to compile: these are left to the laboratory.
const isQuick = ({ threads, rasterizer }: Mutant): boolean => threads !== 'parallel' && rasterizer !== 'tiles';

for (const { what, threads = 'serial', rasterizer = 'quads', ...fault } of MUTANTS.filter(
  (mutant) => isLab || isQuick(mutant),
)) {
  test(`found by the self-test: ${what}`, async () => {
    const { device, befallen } = miscompiling(await nodeDevice(), [fault]);
    assert.equal(await passesSelfTest(device, { threads, rasterizer }), false);
    assert.ok(befallen.length > 0, `${fault.shader.source} has "${fault.from}"`);
  });
}

test(
  'what is broken is named, and another variant draws',
  { skip: !isLab && 'tiles take SwiftShader seconds to compile' },
  async () => {
    const slopeless = MUTANTS.find(({ shader }) => shader.source.includes('rasterize_quads') && shader)!;
    const { device } = miscompiling(await nodeDevice(), [slopeless]);
    assert.equal((await autotune(device, { store: null })).rasterizer, 'tiles');
    assert.match(
      faultsOf(device).join(),
      /errors of this GPU: frames of quads in rgba16float, serial\. Other variants draw/,
    );
  },
);

test('the self-test passes where nothing is broken, in a few milliseconds', async () => {
  const device = await nodeDevice();
  const times = [];
  for (let i = 0; i < 4; i++) {
    const start = performance.now();
    assert.ok(await passesSelfTest(device, { threads: 'serial', rasterizer: 'quads' }));
    times.push(performance.now() - start);
  }
  console.log(`self-test: first ${times[0].toFixed(0)} ms, then ${Math.min(...times.slice(1)).toFixed(1)} ms`);
});
