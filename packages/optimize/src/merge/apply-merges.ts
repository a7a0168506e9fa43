import { quaternionOfMatrix, shCoefficientCount, symmetricEigen, type GaussianCloud } from '@gaussian-splat/core';
import { splatRows } from '@gaussian-splat/renderer/stages';
import { splatsOf, type ReducedCloud } from '../reduce.js';
import type { Merges } from './find-merges.js';
import { writeRow } from './pair-costs.js';

const { joinMoments, ROW, X, XX, XY, XZ, Y, YY, YZ, Z, ZZ } = splatRows;
const NOWHERE = -1;

/**
 * Returns a reduced cloud after all merges up to a price. If one splat of a pair has been dropped, the other does not
 * change. A merged splat keeps the higher degree of both, and the earlier position in the order. The argument is not
 * modified.
 * @param price Maximum of {@link Merges.prices}, a mean squared error.
 */
export function applyMerges(reduced: ReducedCloud, merges: Merges, price: number): ReducedCloud {
  const { cloud, kept } = reduced;
  const places = placesOf(kept, merges);
  const rows = new Float64Array(ROW * cloud.count);
  const [opacities, sh, degrees] = [cloud.opacities.slice(), cloud.sh.slice(), reduced.degrees.slice()];
  const numbers = 3 * shCoefficientCount(cloud.shDegree);
  const [isMerged, isGone, isClosed] = [0, 1, 2].map(() => new Uint8Array(cloud.count));
  // For each splat, the earliest index of the splats that are merged into it.
  const leads = Uint32Array.from(kept.keys());
  for (let k = 0; k < merges.prices.length; k++) {
    const [i, j] = [places[merges.into[k]], places[merges.from[k]]];
    if (i === NOWHERE || j === NOWHERE || isClosed[i] || isClosed[j] || merges.prices[k] > price) {
      // Later merges of these splats depend on this merge, and are not applied.
      if (i !== NOWHERE) isClosed[i] = 1;
      if (j !== NOWHERE) isClosed[j] = 1;
      continue;
    }
    for (const place of [i, j]) if (!isMerged[place]) writeRow(cloud, place, rows);
    const share = merges.shares[k];
    joinMoments(rows, ROW * i, ROW * j, share);
    opacities[i] = merges.opacities[k];
    for (let n = 0; n < numbers; n++)
      sh[numbers * i + n] = share * sh[numbers * i + n] + (1 - share) * sh[numbers * j + n];
    degrees[i] = Math.max(degrees[i], degrees[j]);
    leads[i] = Math.min(leads[i], leads[j]);
    isMerged[i] = isGone[j] = 1;
  }
  const shaped = shapesFrom(rows, isMerged, { ...cloud, opacities, sh });
  const staying = new Uint32Array(cloud.count).fill(cloud.count);
  for (let place = 0; place < cloud.count; place++) if (!isGone[place]) staying[leads[place]] = place;
  const left = staying.filter((place) => place < cloud.count);
  return {
    cloud: splatsOf(shaped, left),
    degrees: Uint8Array.from(left, (place) => degrees[place]),
    kept: Uint32Array.from(left, (place) => kept[place]),
  };
}

/** Returns the index in the reduced cloud of each splat of the source, or -1. It has entries for all splats of merges. */
function placesOf(kept: Uint32Array, { into, from }: Merges): Int32Array {
  const max = [kept, into, from].reduce((max, list) => list.reduce((a, b) => Math.max(a, b), max), 0);
  const places = new Int32Array(max + 1).fill(NOWHERE);
  for (let place = 0; place < kept.length; place++) places[kept[place]] = place;
  return places;
}

/**
 * Returns a cloud whose chosen splats have the centers and covariances of `rows`.
 * @param rows [N, ROW] rows as in splat-rows.ts of the renderer.
 * @param isChosen [N] 1 for chosen splats.
 */
function shapesFrom(rows: Float64Array, isChosen: Uint8Array, cloud: GaussianCloud): GaussianCloud {
  const [positions, scales, rotations] = [cloud.positions.slice(), cloud.scales.slice(), cloud.rotations.slice()];
  for (let i = 0, p = 0; i < cloud.count; i++, p += ROW) {
    if (!isChosen[i]) continue;
    const [xx, xy, xz, yy, yz, zz] = [XX, XY, XZ, YY, YZ, ZZ].map((entry) => rows[p + entry]);
    const { values, vectors } = symmetricEigen([xx, xy, xz, xy, yy, yz, xz, yz, zz]);
    for (const [axis, entry] of [X, Y, Z].entries()) {
      positions[3 * i + axis] = rows[p + entry];
      scales[3 * i + axis] = Math.sqrt(Math.max(0, values[axis]));
    }
    rotations.set(quaternionOfMatrix(vectors), 4 * i);
  }
  return { ...cloud, positions, scales, rotations };
}
