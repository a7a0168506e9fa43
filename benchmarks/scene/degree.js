/** Clouds with fewer bands of color. */

/** A cloud whose splats keep the coefficients up to a degree, 0 to 3. */
export function withDegree(cloud, degree) {
  if (degree >= cloud.shDegree) return cloud;
  const [had, kept] = [cloud.shDegree, degree].map((d) => 3 * (d + 1) ** 2);
  const sh = new Float32Array(kept * cloud.count);
  for (let i = 0; i < cloud.count; i++) sh.set(cloud.sh.subarray(had * i, had * i + kept), kept * i);
  return { ...cloud, shDegree: degree, sh };
}
