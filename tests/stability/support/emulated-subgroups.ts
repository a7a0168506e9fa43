/** Devices whose subgroups are of any size: votes of the sort are counted in workgroup memory instead. */
import assert from 'node:assert/strict';
import { constants } from '@gaussian-splat/renderer/stages';
import { deviceWith } from './devices.js';

/** What `subgroupBallot` and `subgroupShuffle` do for subgroups of neighbouring threads, in WGSL without subgroups. */
const ballotOf = (size: number): string => `
const EMULATED_SIZE = ${size}u;
var<workgroup> emulated_votes: array<atomic<u32>, ${constants.SORT_THREADS / 32}>;
var<private> emulated_lane: u32;
fn emulated_ballot(vote: bool) -> vec4u {
  let lane = emulated_lane;
  workgroupBarrier();
  if (lane % 32u == 0u) { atomicStore(&emulated_votes[lane / 32u], 0u); }
  workgroupBarrier();
  if (vote) { atomicOr(&emulated_votes[lane / 32u], 1u << (lane % 32u)); }
  workgroupBarrier();
  let first = lane / EMULATED_SIZE * EMULATED_SIZE;
  var ballot = vec4u(0u);
  for (var bit = 0u; bit < EMULATED_SIZE; bit++) {
    let thread = first + bit;
    let is_set = (atomicLoad(&emulated_votes[thread / 32u]) >> (thread % 32u)) & 1u;
    ballot[bit / 32u] |= is_set << (bit % 32u);
  }
  return ballot;
}
var<workgroup> emulated_words: array<u32, ${constants.SORT_THREADS}>;
fn emulated_shuffle(word: u32, thread: u32) -> u32 {
  let lane = emulated_lane;
  workgroupBarrier();
  emulated_words[lane] = word;
  workgroupBarrier();
  return emulated_words[lane / EMULATED_SIZE * EMULATED_SIZE + thread];
}
`;

/** The shader with its subgroups replaced by those of the given size. */
function emulated(code: string, size: number): string {
  const changed = code
    .replace(/enable subgroups;\s*/, '')
    .replace(/@builtin\(subgroup_size\)\s*(\w+)\s*:\s*u32\s*,?/, '')
    .replace(/@builtin\(subgroup_invocation_id\)\s*(\w+)\s*:\s*u32\s*,?/, '')
    .replaceAll('subgroupBallot(', 'emulated_ballot(')
    .replaceAll('subgroupShuffle(', 'emulated_shuffle(')
    .replace(
      /(fn main\([^{]*\{)/,
      `$1 emulated_lane = lane; let subgroup_size = EMULATED_SIZE; let own = lane % EMULATED_SIZE;`,
    );
  return ballotOf(size) + changed;
}

/**
 * A new device that says that its subgroups have `least` threads or more, and on which they have `size`.
 * @param size a power of two from 4 to 128
 */
export async function deviceWithSubgroups(
  size: number,
  least = size,
): Promise<{ device: GPUDevice; changed: string[] }> {
  const device = await deviceWith(['subgroups']);
  const changed: string[] = [];
  Object.defineProperty(device, 'adapterInfo', { value: { subgroupMinSize: least, subgroupMaxSize: 128 } });
  const compile = device.createShaderModule.bind(device);
  device.createShaderModule = (descriptor) => {
    if (!descriptor.code.includes('subgroupBallot(')) return compile(descriptor);
    const code = emulated(descriptor.code, size);
    assert.ok(!/subgroup(?:Ballot|Shuffle|_invocation_id)/.test(code), 'nothing of the device is left in the shader');
    changed.push(descriptor.label ?? '');
    return compile({ ...descriptor, code });
  };
  return { device, changed };
}
