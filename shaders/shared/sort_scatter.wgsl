// What all variants of `sort_scatter` read and write.
#import shared/plan
#import shared/group
#import shared/sort

@group(0) @binding(0) var<uniform> digit_pass: SortPass;
@group(0) @binding(1) var<storage, read> plan: Plan;
@group(0) @binding(2) var<storage, read> keys_in: array<u32>;
@group(0) @binding(3) var<storage, read> values_in: array<Value>;
// Exclusive prefix sums over the blocks: [block][digit]
@group(0) @binding(4) var<storage, read> block_offsets: array<u32>;
@group(0) @binding(5) var<storage, read> digit_totals: array<u32>;
@group(0) @binding(6) var<storage, read_write> keys_out: array<u32>;
@group(0) @binding(7) var<storage, read_write> values_out: array<Value>;

// What moves along with a key: one word, or two where all four of these lines are replaced.
alias Value = u32;
const VALUE_WORDS = 1u;
fn word_of(value: Value, word: u32) -> u32 { return value; }
fn with_word(value: Value, word: u32, bits: u32) -> Value { return bits; }

// What moves along with key number i.
fn value_of(i: u32) -> Value {
  if (digit_pass.makes_indices != 0u) { return Value(i); }
  return values_in[i];
}
