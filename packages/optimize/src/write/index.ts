import { GaussianSplatError, type GaussianCloud } from '@gaussian-splat/core';
import { isOfPlanes } from '@gaussian-splat/renderer/stages';
import type { SplatVisibility } from '../pages/splat-visibility.js';
import type { ReducedCloud } from '../reduce.js';
import type { TaskPool } from '../parts/task-pool.js';
import { writeGlb } from './glb.js';
import { writePly } from './ply.js';
import { tuneSog, type SogChoice } from './tune-sog.js';
import { fractionalBitsOf, lossesOfSpz, writeSpz } from './spz.js';
import type { EncodeWebp } from './sog.js';
import { writeUsdc, writeUsdz } from './usd.js';
import { isLodIndex } from './streamed-sog.js';

/** Input of writers from a reduced cloud. */
export interface WrittenCloud extends Pick<ReducedCloud, 'cloud' | 'degrees'> {
  /** [N] index in the source scene of each splat of `cloud`; default 0 to N - 1. */
  readonly kept?: Uint32Array;
}

/** An encoding of a scene with a certain precision. */
export interface Encoding {
  /** Description for people, with the precision. */
  readonly title: string;
  /**
   * Returns the bytes of the file.
   * @param pool Runs parallel parts, and allocates the memory of GLB files.
   */
  readonly write: (reduced: WrittenCloud, pool?: TaskPool) => Uint8Array | Promise<Uint8Array>;
  /**
   * Whether all splats are stored with the same number of coefficients, so that lower degrees of some splats save no
   * bytes. Default: false.
   */
  readonly hasOneDegree?: boolean;
  /** Settings that {@link tune} selected; undefined for other formats than SOG. */
  readonly sog?: SogChoice;
  /** Returns this encoding with its finest steps. Undefined unless {@link tune} selects the steps. */
  readonly finest?: (cloud: Pick<GaussianCloud, 'shDegree'>) => Encoding;
  /** Returns this encoding with all steps multiplied by a factor. Undefined unless {@link tune} selected the steps. */
  readonly coarser?: (factor: number) => Encoding;
  /**
   * Returns this encoding with the coarsest precision that it finds within an error limit.
   * @param measure Returns the mean squared error of a file against the scene.
   * @param target Maximum mean squared error, peak 1.
   * @param seen Visibility of the splats of the scene, if known.
   */
  readonly tune?: (whole: WrittenCloud, measure: Measure, target: number, seen?: SplatVisibility) => Promise<Encoding>;
}

/** Returns the mean squared error of images of a written file against images of the scene, peak 1. */
export type Measure = (bytes: Uint8Array) => Promise<number>;

/** External encoders for formats. */
export interface Encoders {
  /** Lossless WebP, for SOG. */
  readonly encodeWebp?: EncodeWebp;
}

const spz = (shBits: number): Encoding => ({
  title: `SPZ version 3, spherical harmonics of ${shBits} bits`,
  write: ({ cloud }) => writeSpz(cloud, { shBits }),
});

/** OpenUSD with float16 and float32; an archive (USDZ) or a layer. All splats of a prim have the same degree. */
const usd = (write: typeof writeUsdc): Encoding[] =>
  [true, false].map((hasHalves) => ({
    title: hasHalves ? 'OpenUSD, float16 with float32 positions' : 'OpenUSD, float32',
    write: ({ cloud }) => write(cloud, { hasHalves }),
    hasOneDegree: true,
  }));

/** GLB for scenes of planes, whose order of splats must be kept: a primitive for each degree would change it. */
const GLB_OF_PLANES: Encoding = {
  title: 'GLB, one primitive in the order of the scene',
  write: ({ cloud, degrees }, pool) =>
    writeGlb({ cloud, degrees: new Uint8Array(degrees.length).fill(cloud.shDegree) }, pool),
  hasOneDegree: true,
};

/** Encodings by file extension, smallest file first. */
const ENCODINGS: ReadonlyMap<string, readonly Encoding[]> = new Map([
  ['.spz', [spz(4), spz(5), spz(6), spz(8)]],
  ['.glb', [{ title: 'GLB, a primitive for each degree', write: writeGlb }]],
  ['.ply', [{ title: 'PLY, float32', write: ({ cloud }: WrittenCloud) => writePly(cloud), hasOneDegree: true }]],
  ['.usdz', usd(writeUsdz)],
  ['.usdc', usd(writeUsdc)],
]);

/**
 * Returns the encodings for a file of this name; for `lod-meta.json`, an archive of a folder: see {@link filesOfZip}.
 * @param cloud The scene, if it is known already.
 * @param encoders Encoders for `.sog`.
 * @throws GaussianSplatError `argument/value` for a name with an unknown extension, for a scene trained with a filter
 * that the format cannot declare, and for one farther from (0, 0, 0) than the format's range.
 */
export function encodingsFor(
  name: string,
  cloud: Partial<Pick<GaussianCloud, 'antialiased' | 'filterVariance' | 'positions' | 'origin'>> = {},
  encoders: Encoders = {},
): readonly Encoding[] {
  if (isLodIndex(name)) {
    requireFilter(name, '.sog', cloud);
    return [tuneSog(encoders.encodeWebp, true)];
  }
  const extension = /\.[a-z]+$/i.exec(name)?.[0].toLowerCase() ?? '';
  const found = extension === '.sog' ? [tuneSog(encoders.encodeWebp)] : ENCODINGS.get(extension);
  if (found === undefined) {
    throw new GaussianSplatError('argument/value', {
      where: name,
      expected: `a name that ends in ${[...ENCODINGS.keys(), '.sog'].join(', ')}`,
      found: extension || 'no extension',
      remedy:
        'choose .glb for accuracy, .sog for size, lod-meta.json in a folder for streaming, .usdz for OpenUSD, .ply for tools that read nothing else',
    });
  }
  requireFilter(name, extension, cloud);
  const { positions, origin } = cloud;
  if (positions && extension === '.glb' && isOfPlanes(positions)) return [GLB_OF_PLANES];
  if (positions && origin && extension === '.spz') fractionalBitsOf({ positions, origin });
  return found;
}

/** Returns sentences about parts of a scene that a file of this name cannot hold in any precision. */
export function lossesIn(name: string, cloud: Pick<GaussianCloud, 'count' | 'sh' | 'shDegree' | 'hints'>): string[] {
  const { hints } = cloud;
  return [
    ...(/\.spz$/i.test(name) ? lossesOfSpz(cloud) : []),
    ...(hints?.orbit && !/\.(spz|ply)$/i.test(name)
      ? ['Its limits of the camera are left out, because only .spz and .ply hold them.']
      : []),
  ];
}

type Filter = Partial<Pick<GaussianCloud, 'antialiased' | 'filterVariance'>>;

/** Variance in px² of scenes without a declared filter. */
const USUAL_VARIANCE = 0.3;
/** Variance in px² of SOG's `model: antialiased`. */
const MIP_VARIANCE = 0.1;

/** Functions by file extension that return whether the format can declare a filter; `variance` in px². */
const HOLDS_FILTER: Readonly<Record<string, (isCompensated: boolean, variance: number) => boolean>> = {
  '.ply': () => true,
  '.spz': (_, variance) => variance === USUAL_VARIANCE,
  '.glb': (isCompensated, variance) => !isCompensated && variance === USUAL_VARIANCE,
  '.usdz': (isCompensated, variance) => !isCompensated && variance === USUAL_VARIANCE,
  '.usdc': (isCompensated, variance) => !isCompensated && variance === USUAL_VARIANCE,
  '.sog': (isCompensated, variance) => variance === USUAL_VARIANCE || (isCompensated && variance === MIP_VARIANCE),
};

/** Throws `argument/value` if a scene would be read with a low-pass filter other than that of its training. */
function requireFilter(
  name: string,
  extension: string,
  { antialiased = false, filterVariance = USUAL_VARIANCE }: Filter,
): void {
  const isHeldBy = (other: string): boolean => HOLDS_FILTER[other](antialiased, filterVariance);
  if (isHeldBy(extension)) return;
  const others = ['.sog', '.spz', '.ply'].filter(isHeldBy);
  throw new GaussianSplatError('argument/value', {
    where: name,
    expected: `a format that can name the filter of the scene: ${others.join(', ')}`,
    found: `${extension}, which cannot store ${filterVariance} px²${antialiased ? ' with compensation (antialiasing)' : ''}`,
    remedy: `choose ${others.join(' or ')}`,
  });
}
