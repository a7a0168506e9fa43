import {
  numberToHalf,
  shCoefficientCount,
  type CloudHints,
  type Credits,
  type GaussianCloud,
  type Vector3,
} from '@gaussian-splat/core';
import { upright } from '@gaussian-splat/formats';
import { writeCrate, type CrateArray, type CrateFields, type CrateType } from './crate.js';
import { writeZip } from './zip.js';

export interface UsdOptions {
  /** Whether scales, orientations, opacities and colors are float16. Positions are float32 in either case. */
  readonly hasHalves: boolean;
}

const NAME = 'Splats';
/** The offset of each file in a USDZ is a multiple of these bytes. */
const USDZ_ALIGNMENT = 64;
/** Standard deviations within which a splat is visible. */
const SIGMAS = 3;

/** Signs of x, y and z, of (w, x, y, z) after their permutation, and of the 16 coefficients, under half a turn about x. */
const HALF_TURN = {
  places: [1, -1, -1],
  harmonics: [1, -1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1, -1, 1, -1, 1],
};
const NO_TURN = { places: [1, 1, 1], harmonics: new Array<number>(16).fill(1) };

const HINTS: Readonly<Record<string, string>> = { pixel: 'rayHitDistance', distance: 'cameraDistance' };

/**
 * Writes a binary layer of OpenUSD (`.usdc`) with one `ParticleField3DGaussianSplat`. A cloud whose direction up is y or z
 * keeps its coordinates. All others become right, up, back, which turns them by half a turn about x.
 * @throws GaussianSplatError `out-of-memory/allocation`
 */
export function writeUsdc(given: GaussianCloud, { hasHalves }: UsdOptions): Uint8Array<ArrayBuffer> {
  const axis = axisOf(given.hints);
  const cloud = axis ? given : upright(given);
  const turn = axis ? NO_TURN : HALF_TURN;
  const { count, shDegree, origin, hints } = cloud;
  const place = origin.map((value, k) => turn.places[k] * value) as unknown as Vector3;
  const attribute = (typeName: string, value: CrateFields['default'], isUniform = false): CrateFields => ({
    typeName: { token: typeName },
    ...(isUniform && { variability: { isUniform: true } }),
    default: value,
  });
  const array = (type: CrateType, width: number, numbers: CrateArray): CrateFields =>
    attribute(`${type}[]`, { array: numbers, type, width });
  /** Attribute of all splats in the precision of the options. The names of float16 attributes end in h. */
  const ofSplats = (name: string, types: readonly [CrateType, CrateType], width: number, numbers: Float32Array) =>
    hasHalves
      ? { [`${name}h`]: array(types[1], width, Uint16Array.from(numbers, numberToHalf)) }
      : { [name]: array(types[0], width, numbers) };
  const stride = 3 * shCoefficientCount(shDegree);
  const isFar = origin.some((value) => value !== 0);
  return writeCrate(
    {
      defaultPrim: { token: NAME },
      metersPerUnit: { double: hints?.metersPerUnit ?? 1 },
      upAxis: { token: axis ?? 'Y' },
      ...(hints?.credits && { customLayerData: { strings: dataOf(hints.credits) } }),
    },
    {
      name: NAME,
      fields: { specifier: { specifier: 0 }, typeName: { token: 'ParticleField3DGaussianSplat' } },
      attributes: {
        extent: array('float3', 3, extentOf(cloud, turn.places)),
        positions: array(
          'point3f',
          3,
          signed(cloud.positions, 3, (k) => turn.places[k]),
        ),
        ...ofSplats('scales', ['float3', 'half3'], 3, cloud.scales),
        ...ofSplats('orientations', ['quatf', 'quath'], 4, quaternionsOf(cloud, turn === HALF_TURN)),
        ...ofSplats('opacities', ['float', 'half'], 1, cloud.opacities),
        'radiance:sphericalHarmonicsDegree': attribute('int', { int: shDegree }, true),
        ...ofSplats(
          'radiance:sphericalHarmonicsCoefficients',
          ['float3', 'half3'],
          3,
          signed(cloud.sh, stride, (k) => turn.harmonics[Math.floor(k / 3)]),
        ),
        projectionModeHint: attribute('token', { token: 'perspective' }, true),
        sortingModeHint: attribute('token', { token: HINTS[hints?.order ?? ''] ?? 'zDepth' }, true),
        // Float32 positions far from (0, 0, 0) would lose detail.
        ...(isFar &&
          count > 0 && {
            'xformOp:translate': attribute('double3', { doubles: place }),
            xformOpOrder: attribute('token[]', { tokens: ['xformOp:translate'], isArray: true }, true),
          }),
      },
    },
  );
}

/** Entries of the dictionary `customLayerData`, as Apple's usdzconvert names them. */
const dataOf = ({ attribution, license }: Credits): Record<string, string> => ({
  ...(attribution && { copyright: attribution }),
  ...(license && { license }),
});

/** Writes a USDZ: an archive with the layer of {@link writeUsdc}. Throws `argument/value` for 4 GiB or more. */
export function writeUsdz(cloud: GaussianCloud, options: UsdOptions): Uint8Array<ArrayBuffer> {
  return writeZip(new Map([['splats.usdc', writeUsdc(cloud, options)]]), 'USDZ', USDZ_ALIGNMENT);
}

/** Up axis of a stage with the coordinates of a cloud; undefined if its direction up is neither y nor z. */
function axisOf(hints: CloudHints | undefined): 'Y' | 'Z' | undefined {
  const [x, y, z] = hints?.up ?? [0, -1, 0];
  if (x === 0 && y === 1 && z === 0) return 'Y';
  return x === 0 && y === 0 && z === 1 ? 'Z' : undefined;
}

/** Multiplies each row of `stride` values by signs. Returns the same array if no sign is negative. */
function signed(values: Float32Array, stride: number, signOf: (k: number) => number): Float32Array {
  const signs = Array.from({ length: stride }, (_, k) => signOf(k));
  return signs.every((sign) => sign === 1) ? values : values.map((value, k) => signs[k % stride] * value);
}

/** Quaternions (x, y, z, w); those of half a turn about x are (0, 1, 0, 0) times those of the cloud. */
function quaternionsOf({ rotations }: GaussianCloud, isTurned: boolean): Float32Array {
  const out = new Float32Array(rotations.length);
  for (let k = 0; k < out.length; k += 4) {
    const [w, x, y, z] = rotations.subarray(k, k + 4);
    out.set(isTurned ? [w, -z, y, -x] : [x, y, z, w], k);
  }
  return out;
}

/** Smallest and largest corner of the box around all splats, [2, 3], in the axes of the stage. */
function extentOf({ count, positions, scales }: GaussianCloud, signs: readonly number[]): Float32Array {
  const box = new Float32Array([Infinity, Infinity, Infinity, -Infinity, -Infinity, -Infinity]);
  for (let i = 0; i < count; i++) {
    const reach = SIGMAS * Math.max(scales[3 * i], scales[3 * i + 1], scales[3 * i + 2]);
    for (let axis = 0; axis < 3; axis++) {
      const at = signs[axis] * positions[3 * i + axis];
      box[axis] = Math.min(box[axis], at - reach);
      box[3 + axis] = Math.max(box[3 + axis], at + reach);
    }
  }
  return count > 0 ? box : new Float32Array(6);
}
