// Bindings of all variants of `sort_scatter`.
#import shared/plan
#import shared/group
#import shared/sort

@group(0) @binding(0) var<uniform> digit_pass: SortPass;
@group(0) @binding(1) var<storage, read> plan: Plan;
@group(0) @binding(2) var<storage, read> keys_in: array<u32>;
@group(0) @binding(3) var<storage, read> values_in: array<u32>;
// Exclusive prefix sums over the blocks: [block][digit]
@group(0) @binding(4) var<storage, read> block_offsets: array<u32>;
@group(0) @binding(5) var<storage, read> digit_totals: array<u32>;
@group(0) @binding(6) var<storage, read_write> keys_out: array<u32>;
@group(0) @binding(7) var<storage, read_write> values_out: array<u32>;

// The value that moves with key number i.
fn value_of(i: u32) -> u32 {
  if (digit_pass.makes_indices != 0u) { return i; }
  return values_in[i];
}
