// What both variants of `sort_scatter` read and write.
#import shared/plan
#import shared/group
#import shared/sort

@group(0) @binding(0) var<uniform> digit_pass: SortPass;
@group(0) @binding(1) var<storage, read> plan: Plan;
@group(0) @binding(2) var<storage, read> keys_in: array<u32>;
@group(0) @binding(3) var<storage, read> values_in: array<Value>;
// Exclusive prefix sums over the blocks: [digit][block]
@group(0) @binding(4) var<storage, read> block_offsets: array<u32>;
@group(0) @binding(5) var<storage, read> digit_totals: array<u32>;
@group(0) @binding(6) var<storage, read_write> keys_out: array<u32>;
@group(0) @binding(7) var<storage, read_write> values_out: array<Value>;

// What moves along with a key.
alias Value = u32;

struct Item {
  key: u32,
  value: Value,
}

// Key number i and what moves along with it; nothing of meaning behind the last one.
fn item_at(i: u32) -> Item {
  var item = Item(0u, Value(i));
  if (i < plan.visible) {
    item.key = keys_in[i];
    if (digit_pass.makes_indices == 0u) { item.value = values_in[i]; }
  }
  return item;
}
