// `scan` for processors that run few threads one after the other: a single thread, and no barriers, which such processors take long to compile.
#import shared/saturating

@group(0) @binding(0) var<storage, read_write> values: array<u32>;
@group(0) @binding(1) var<uniform> scan: Scan;

struct Scan { length: u32 }

@compute @workgroup_size(1)
fn main() {
  var sum = 0u;
  for (var i = 0u; i < scan.length; i++) {
    let own = values[i];
    values[i] = sum;
    sum = add_saturating(sum, own);
  }
  values[scan.length] = sum;
}
