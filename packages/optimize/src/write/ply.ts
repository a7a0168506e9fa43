import { shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import { creditsOf } from '@gaussian-splat/formats';
import { fileBytes } from './file-bytes.js';
import { safeOrbitOf } from './safe-orbit.js';

/**
 * Writes the PLY of 3D Gaussian Splatting, binary, float32, without normals, with comments for filter, up, order and credits, and
 * the elements of Niantic's library for the limits of a camera;
 * positions are float64 if the cloud lies too far from (0, 0, 0) for float32.
 * @throws GaussianSplatError `out-of-memory/allocation`
 */
export function writePly(cloud: GaussianCloud): Uint8Array<ArrayBuffer> {
  const {
    count,
    shDegree,
    positions,
    origin,
    sh,
    opacities,
    scales,
    rotations,
    antialiased,
    filterVariance = 0.3,
    hints,
  } = cloud;
  const coefficients = shCoefficientCount(shDegree);
  const orbit = safeOrbitOf(cloud);
  const isFar = origin.some((x) => x !== 0);
  const names = [
    ...['x', 'y', 'z', 'f_dc_0', 'f_dc_1', 'f_dc_2'],
    ...Array.from({ length: 3 * (coefficients - 1) }, (_, k) => `f_rest_${k}`),
    ...['opacity', 'scale_0', 'scale_1', 'scale_2', 'rot_0', 'rot_1', 'rot_2', 'rot_3'],
  ];
  const lines = [
    'ply',
    'format binary_little_endian 1.0',
    ...(antialiased ? ['comment SplatRenderMode: mip'] : []),
    ...(antialiased || filterVariance !== 0.3 ? [`comment filter_variance ${filterVariance}`] : []),
    ...(hints?.up ? [`comment Vertical axis: ${hints.up.join(' ')}`] : []),
    ...(hints?.order ? [`comment sorting_method ${hints.order}`] : []),
    ...Object.entries(creditsOf(hints?.credits ?? {}) ?? {}).map(([key, text]) => `comment ${key}: ${text}`),
    `element vertex ${count}`,
    ...names.map((name, k) => `property ${isFar && k < 3 ? 'double' : 'float'} ${name}`),
    ...(orbit ? ORBIT_ELEMENTS : []),
    'end_header',
  ];
  const header = new TextEncoder().encode(`${lines.join('\n')}\n`);
  const numbers = (names.length + (isFar ? 3 : 0)) * count + (orbit?.length ?? 0);
  const bytes = fileBytes('PLY', header.length + 4 * numbers);
  bytes.set(header);
  const view = new DataView(bytes.buffer, header.length);
  let at = 0;
  const put = (value: number): void => {
    view.setFloat32(at, value, true);
    at += 4;
  };
  const putFar = (value: number): void => {
    view.setFloat64(at, value, true);
    at += 8;
  };
  const putPlace = isFar ? putFar : put;
  for (let i = 0; i < count; i++) {
    for (let k = 0; k < 3; k++) putPlace(positions[3 * i + k] + origin[k]);
    for (let k = 0; k < 3; k++) put(sh[3 * coefficients * i + k]);
    for (let channel = 0; channel < 3; channel++) {
      for (let k = 1; k < coefficients; k++) put(sh[3 * (coefficients * i + k) + channel]);
    }
    put(logit(opacities[i]));
    for (let k = 0; k < 3; k++) put(Math.max(LOG_NOTHING, Math.log(scales[3 * i + k])));
    for (let k = 0; k < 4; k++) put(rotations[4 * i + k]);
  }
  orbit?.forEach(put);
  return bytes;
}

const ORBIT_ELEMENTS = [
  'element safe_orbit_camera_elevation_min_max_radians 2',
  'property float safe_orbit_camera_elevation_min_max_radians',
  'element safe_orbit_camera_radius_min 1',
  'property float safe_orbit_camera_radius_min',
];

/** Replaces the infinite logarithm of a zero scale, which other readers reject; in float32 it is read as 0. */
const LOG_NOTHING = -104;

/** Opacity 1 has an infinite logit; 30 is the nearest value in float32. */
function logit(opacity: number): number {
  return Math.min(30, Math.max(-30, Math.log(opacity / (1 - opacity))));
}
