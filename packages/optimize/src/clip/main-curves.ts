/** Approximate maximum number of rows that determine curves. More rows have little effect. */
const MAX_ROWS = 30_000;
const MAX_SWEEPS = 30;

/**
 * Returns the principal components (without centering) of rows as curves with a root mean square of 1, strongest first.
 * @param rows [N, length] rows.
 * @param min Root mean square weight below which a curve is dropped.
 */
export function mainCurves(rows: Float32Array, length: number, min: number): Float64Array[] {
  const count = rows.length / length;
  if (count === 0) return [];
  const stride = Math.max(1, Math.floor(count / MAX_ROWS));
  const products = new Float64Array(length * length);
  const nothing = new Float32Array(length);
  const rowAt = (row: number): Float32Array =>
    row < count ? rows.subarray(length * row, length * (row + 1)) : nothing;
  // Four rows at once, so that each sum is read and written less often.
  for (let row = 0; row < count; row += 4 * stride) {
    const p = rowAt(row);
    const q = rowAt(row + stride);
    const r = rowAt(row + 2 * stride);
    const s = rowAt(row + 3 * stride);
    for (let a = 0; a < length; a++) {
      const [pa, qa, ra, sa] = [p[a], q[a], r[a], s[a]];
      if (pa === 0 && qa === 0 && ra === 0 && sa === 0) continue;
      for (let b = a, at = (length + 1) * a; b < length; b++, at++)
        products[at] += pa * p[b] + qa * q[b] + ra * r[b] + sa * s[b];
    }
  }
  const used = Math.ceil(count / stride);
  for (let a = 0; a < length; a++) {
    for (let b = a; b < length; b++) products[length * b + a] = products[length * a + b] /= used;
  }
  const { values, vectors } = eigen(products, length);
  return values
    .map((value, k) => ({ value, curve: vectors[k] }))
    .sort((a, b) => b.value - a.value)
    .filter(({ value }) => value > min * min * length)
    .map(({ curve }) => curve.map((part) => part * Math.sqrt(length)));
}

/** Returns the eigenvalues and eigenvectors of a symmetric matrix, by Jacobi's rotations. Modifies the matrix. */
function eigen(matrix: Float64Array, size: number): { values: number[]; vectors: Float64Array[] } {
  const vectors = Array.from({ length: size }, (_, k) =>
    Float64Array.from({ length: size }, (_, i) => (i === k ? 1 : 0)),
  );
  const trace = Array.from({ length: size }, (_, k) => matrix[(size + 1) * k]).reduce((sum, value) => sum + value, 0);
  for (let sweep = 0; sweep < MAX_SWEEPS; sweep++) {
    let rest = 0;
    for (let p = 0; p < size; p++) {
      for (let q = p + 1; q < size; q++) {
        const between = matrix[size * p + q];
        rest += between * between;
        if (Math.abs(between) <= 1e-15 * trace) continue;
        const theta = (matrix[(size + 1) * q] - matrix[(size + 1) * p]) / (2 * between);
        const t = (theta < 0 ? -1 : 1) / (Math.abs(theta) + Math.hypot(theta, 1));
        const c = 1 / Math.hypot(t, 1);
        turn(matrix, vectors, size, { p, q, c, s: t * c });
      }
    }
    if (Math.sqrt(rest) <= 1e-10 * trace) break;
  }
  return { values: vectors.map((_, k) => matrix[(size + 1) * k]), vectors };
}

function turn(
  matrix: Float64Array,
  vectors: readonly Float64Array[],
  size: number,
  { p, q, c, s }: { p: number; q: number; c: number; s: number },
): void {
  for (let at = 0; at < size * size; at += size) turnPair(matrix, at + p, matrix, at + q, c, s);
  const [one, other] = [vectors[p], vectors[q]];
  for (let k = 0; k < size; k++) {
    turnPair(matrix, size * p + k, matrix, size * q + k, c, s);
    turnPair(one, k, other, k, c, s);
  }
}

function turnPair(as: Float64Array, i: number, bs: Float64Array, j: number, c: number, s: number): void {
  const a = as[i];
  const b = bs[j];
  as[i] = c * a - s * b;
  bs[j] = s * a + c * b;
}
