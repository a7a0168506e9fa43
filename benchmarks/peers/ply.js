/** Writes scenes as the PLY files that INRIA's trainer writes and every viewer reads. */

/** Logit of an opacity of exactly 1 that a float32 sigmoid still rounds to 1. */
const OPAQUE_LOGIT = 20;
/** Logarithm that stands for a standard deviation of 0. */
const FLAT_LOG = -30;

const logit = (p) => Math.min(OPAQUE_LOGIT, Math.max(-OPAQUE_LOGIT, Math.log(p / (1 - p))));
const logScale = (s) => (s > 0 ? Math.log(s) : FLAT_LOG);

/**
 * Copies of a cloud as one binary PLY file; opacities as logits, scales as logarithms, harmonics channel by channel.
 * @returns {Blob} a blob, since large scenes do not fit one array.
 */
export function writePly(cloud, copies) {
  const count = copies.reduce((sum, { length }) => sum + length, 0);
  const { floats, width, names } = rowsOf(cloud);
  const header = ['ply', 'format binary_little_endian 1.0', `element vertex ${count}`];
  header.push(...names.map((name) => `property float ${name}`), 'end_header', '');
  const parts = copies.map(({ offset, length }) => {
    const rows = floats.slice(0, width * length);
    for (let i = 0; i < rows.length; i += width) for (let k = 0; k < 3; k++) rows[i + k] += offset[k];
    // Blobs of blobs: the browser may keep each on disk, and the array is free again.
    return new Blob([rows]);
  });
  return new Blob([header.join('\n'), ...parts], { type: 'application/octet-stream' });
}

function rowsOf({ count, origin, positions, scales, rotations, opacities, sh }) {
  const coefficients = sh.length / (3 * count);
  const rest = 3 * (coefficients - 1);
  const numbered = (name, length) => Array.from({ length }, (_, i) => `${name}_${i}`);
  const names = ['x', 'y', 'z', ...numbered('f_dc', 3), ...numbered('f_rest', rest), 'opacity'];
  names.push(...numbered('scale', 3), ...numbered('rot', 4));
  const width = names.length;
  const floats = new Float32Array(width * count);
  for (let i = 0, at = 0; i < count; i++) {
    for (let k = 0; k < 3; k++) floats[at++] = origin[k] + positions[3 * i + k];
    for (let k = 0; k < 3; k++) floats[at++] = sh[3 * coefficients * i + k];
    for (let channel = 0; channel < 3; channel++) {
      for (let c = 1; c < coefficients; c++) floats[at++] = sh[3 * (coefficients * i + c) + channel];
    }
    floats[at++] = logit(opacities[i]);
    for (let k = 0; k < 3; k++) floats[at++] = logScale(scales[3 * i + k]);
    for (let k = 0; k < 4; k++) floats[at++] = rotations[4 * i + k];
  }
  return { floats, width, names };
}
