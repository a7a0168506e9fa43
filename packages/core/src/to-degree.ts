import { shCoefficientCount, type GaussianCloud, type ShDegree } from './gaussian-cloud.js';

/**
 * Returns a cloud with the spherical harmonics of a degree: coefficients above it are left out, missing ones are 0. The
 * same cloud if it has this degree.
 */
export function toDegree(degree: ShDegree, cloud: GaussianCloud): GaussianCloud {
  if (cloud.shDegree === degree) return cloud;
  const [from, to] = [cloud.shDegree, degree].map((own) => 3 * shCoefficientCount(own));
  const sh = new Float32Array(to * cloud.count);
  for (let i = 0; i < cloud.count; i++) sh.set(cloud.sh.subarray(from * i, from * i + Math.min(from, to)), to * i);
  return { ...cloud, shDegree: degree, sh };
}
