/**
 * Growth of the heap in MiB an hour: the line of least squares through the second half of the epochs. In the first the page warms up: code is compiled, caches fill.
 */
export function heapSlope(epochs) {
  const points = epochs.slice(Math.floor(epochs.length / 2)).map(({ minutes, heap }) => [minutes / 60, heap / 2 ** 20]);
  const mean = (k) => points.reduce((sum, point) => sum + point[k], 0) / Math.max(1, points.length);
  const [x, y] = [mean(0), mean(1)];
  const spread = points.reduce((sum, [a]) => sum + (a - x) ** 2, 0);
  return spread === 0 ? 0 : points.reduce((sum, [a, b]) => sum + (a - x) * (b - y), 0) / spread;
}
