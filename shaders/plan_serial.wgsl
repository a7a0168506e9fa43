// `plan` for software adapters, which run few threads sequentially: a single thread without barriers, which take such
// adapters long to compile.
#import shared/saturating
#import shared/plan_counts

@group(0) @binding(0) var<storage, read_write> values: array<u32>;

fn value_at(i: u32) -> u32 { return values[i]; }

@compute @workgroup_size(1)
fn main() {
  var sum = 0u;
  for (var i = 0u; i < limits.length; i++) {
    let own = values[i];
    values[i] = sum;
    sum = add_saturating(sum, own);
  }
  values[limits.length] = sum;
  write_plan();
}
