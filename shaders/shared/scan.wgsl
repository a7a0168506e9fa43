// Exclusive prefix sum of `values` in place, by a single workgroup that walks over it, so no workgroup waits for
// another. Neighboring threads read and write neighboring vectors, four for each thread in a step.
#import shared/prefix_vectors

@group(0) @binding(0) var<storage, read_write> values: array<vec4u>;

// Vectors of one thread, as many as a vector has components: each is a column of the sums over the threads.
const VECTORS = 4u;
const PER_THREAD = 4u * VECTORS;

// Inclusive sums of each thread, column by column.
var<workgroup> ends: array<vec4u, PREFIX_THREADS>;

// The values of vector v; values beyond the end count as 0.
fn values_of(v: u32, length: u32) -> vec4u {
  if (4u * v >= length) { return vec4u(0u); }
  let places = 4u * v + vec4u(0u, 1u, 2u, 3u);
  return select(vec4u(0u), values[v], places < vec4u(length));
}

// Exclusive sums of the components, starting with `before`.
fn sums_before(before: u32, own: vec4u) -> vec4u {
  let y = add_saturating(before, own.x);
  let z = add_saturating(y, own.y);
  return vec4u(before, y, z, add_saturating(z, own.z));
}

fn sum_of(own: vec4u) -> u32 {
  return add_saturating(sums_before(0u, own).w, own.w);
}

fn write_sums(v: u32, length: u32, before: u32, own: vec4u) {
  if (4u * v < length) { values[v] = sums_before(before, own); }
}

// values[length] receives the total, which overwrites the rest of its vector. Must be called by all threads; afterwards
// all of them may read the sums.
fn scan_values(length: u32, lane: u32) {
  var carry = 0u;
  for (var start = 0u; start < length; start += PREFIX_THREADS * PER_THREAD) {
    let first = start / 4u + lane;
    // All loads are issued before the first addition.
    let a = values_of(first, length);
    let b = values_of(first + PREFIX_THREADS, length);
    let c = values_of(first + 2u * PREFIX_THREADS, length);
    let d = values_of(first + 3u * PREFIX_THREADS, length);
    ends[lane] = inclusive_sums(vec4u(sum_of(a), sum_of(b), sum_of(c), sum_of(d)), lane);
    workgroupBarrier();
    // Not the difference of two sums, because both may be saturated.
    let before = select(ends[max(lane, 1u) - 1u], vec4u(0u), lane == 0u);
    let columns = ends[PREFIX_THREADS - 1u];
    let begins = add_vectors_saturating(before, sums_before(carry, columns));
    write_sums(first, length, begins.x, a);
    write_sums(first + PREFIX_THREADS, length, begins.y, b);
    write_sums(first + 2u * PREFIX_THREADS, length, begins.z, c);
    write_sums(first + 3u * PREFIX_THREADS, length, begins.w, d);
    carry = add_saturating(carry, sum_of(columns));
    workgroupBarrier();
  }
  storageBarrier();
  if (lane == 0u) { values[length / 4u][length % 4u] = carry; }
  storageBarrier();
}

fn value_at(i: u32) -> u32 { return values[i / 4u][i % 4u]; }
