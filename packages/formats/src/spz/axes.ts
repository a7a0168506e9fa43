import { GaussianSplatError, type Credits, type TrainedOrder } from '@gaussian-splat/core';
import { viewOf } from '../bytes.js';
import { creditsOf } from '../credits.js';
import { safeOrbit, type OrbitLimits } from '../safe-orbit.js';
import type { SpzHeader } from './header.js';

/** Sign of each axis in the conversion to the coordinates of a cloud (x right, y down, z forward). */
export type AxisSigns = readonly [x: 1 | -1, y: 1 | -1, z: 1 | -1];

/** x right, y up, z back: the coordinates of the specification, which Scaniverse and older tools write. */
export const RIGHT_UP_BACK: AxisSigns = [1, -1, -1];
/** x right, y down, z forward: the coordinates of PLY, which current converters keep. */
export const RIGHT_DOWN_FORWARD: AxisSigns = [1, 1, 1];

/** Adobe's record of the coordinate system of a file, one of 16 in the numbering of SPZ's `CoordinateSystem`. */
const COORDINATE_SYSTEM = 0xadbe0003;
/** Adobe's limits of an orbiting camera: smallest and largest elevation, smallest radius. */
const SAFE_ORBIT = 0xadbe0002;
const PADDING = 0;
/** Our own record of the trained order of splats: a number of {@link ORDERS}, from 1 on. */
const ORDER = 0x47530001;
const ORDERS: readonly TrainedOrder[] = ['pixel', 'distance'];
/** Our own record of credits: attribution and license in UTF-8, separated by a zero byte. */
const CREDITS = 0x47530002;
const MAX_SKIPPED = 8;
/** Number of fractional bits in the files of all converters. */
const USUAL_FRACTIONAL_BITS = 12;
/** The system that gzip libraries of Rust and Go write. Niantic's apps compress with zlib, which writes its own system. */
const UNKNOWN_SYSTEM = 255;

/**
 * Coordinate system of a file: signs of its axes and, for systems with a vertical third axis, a map [3, 4] to apply
 * afterwards.
 */
export interface SpzFrame {
  readonly axes: AxisSigns;
  readonly turn?: readonly number[] | undefined;
  /** Whether the file declares no coordinate system. */
  readonly isAssumed?: boolean | undefined;
  readonly order?: TrainedOrder | undefined;
  readonly orbit?: OrbitLimits | undefined;
  readonly credits?: Credits | undefined;
}

/**
 * Axes of a file without a declared coordinate system, inferred from its writer. Version 1, and version 2 with
 * antialiasing, come from Niantic's own apps; files without extension records and with other numbers of fractional bits
 * than 12 come from tools that follow the specification. All of these use right-up-back. Spark writes version 2 with
 * antialiasing, too, but keeps the coordinates of its input, as current converters keep those of PLY:
 * docs/decisions/0022-the-frame-of-spz.md.
 */
export function assumedAxes(header: SpzHeader): AxisSigns {
  const { version, antialiased, fractionalBits, hasExtensions, gzipSystem, followsSpecification } = header;
  const isOfAppsOrSpark = version === 2 && antialiased;
  const isRightUpBack =
    followsSpecification ||
    version === 1 ||
    (isOfAppsOrSpark ? gzipSystem !== UNKNOWN_SYSTEM : fractionalBits !== USUAL_FRACTIONAL_BITS && !hasExtensions);
  return isRightUpBack ? RIGHT_UP_BACK : RIGHT_DOWN_FORWARD;
}

/**
 * Finds the coordinate system in the extension records: `[uint32 type][uint32 length][payload]`, in sequence; without
 * one, {@link assumedAxes}. Records that are not known, or not used, are skipped, and listed: among them limits of an
 * orbit within a glTF, whose nodes may scale the splats.
 */
export function readExtensions(
  records: Uint8Array,
  header: SpzHeader,
  name: string,
): SpzFrame & { skipped: readonly number[] } {
  const skipped = new Set<number>();
  let frame: SpzFrame | undefined;
  let order: TrainedOrder | undefined;
  let orbit: OrbitLimits | undefined;
  let credits: Credits | undefined;
  for (const { type, payload } of recordsIn(records)) {
    const length = payload.byteLength;
    const limits = type === SAFE_ORBIT && length >= 12 && !header.followsSpecification ? limitsIn(payload) : undefined;
    if (limits) orbit = limits;
    else if (type === COORDINATE_SYSTEM && length >= 4) frame ??= frameOfSystem(payload.getUint32(0, true), name);
    else if (type === ORDER && length >= 4) order = ORDERS[payload.getUint32(0, true) - 1];
    else if (type === CREDITS) credits = creditsIn(payload);
    else if (type !== PADDING && skipped.size < MAX_SKIPPED) skipped.add(type);
  }
  return {
    ...(frame ?? { axes: assumedAxes(header), isAssumed: !header.followsSpecification }),
    order,
    orbit,
    credits,
    skipped: [...skipped],
  };
}

/** All extension records; one that exceeds the bytes has an empty payload. */
function* recordsIn(records: Uint8Array): Generator<{ type: number; payload: DataView }> {
  const view = viewOf(records);
  for (let at = 0; at + 8 <= records.length;) {
    const length = view.getUint32(at + 4, true);
    const end = at + 8 + length;
    yield { type: view.getUint32(at, true), payload: viewOf(records.subarray(at + 8, end > records.length ? 0 : end)) };
    at = end;
  }
}

function creditsIn(payload: DataView): Credits | undefined {
  const [attribution, license] = new TextDecoder().decode(payload).split('\0');
  return creditsOf({ attribution, license });
}

const limitsIn = (payload: DataView): OrbitLimits | undefined =>
  safeOrbit([0, 4, 8].map((at) => payload.getFloat32(at, true)));

/**
 * In systems 1 to 8, bit 0 of (system - 1) means right, bit 1 up and bit 2 forward. Systems 9 to 16 list the depth axis
 * before the vertical one: bit 0 of (system - 9) means right, bit 1 up and bit 2 back. System 0 is unspecified.
 */
function frameOfSystem(system: number, name: string): SpzFrame | undefined {
  if (system === 0) return undefined;
  const bits = (system - 1) & 7;
  const right = bits & 1 ? 1 : -1;
  const down = bits & 2 ? -1 : 1;
  if (system <= 8) return { axes: [right, down, bits & 4 ? 1 : -1] };
  if (system <= 16) {
    // As the only library that writes these systems does it: it mirrors the axes before it turns them, so that in systems
    // 9, 10, 15 and 16 the second and the third axis point the other way than their names say.
    return { axes: [1, 1, 1], turn: [right, 0, 0, 0, 0, 0, bits & 4 ? 1 : -1, 0, 0, bits & 2 ? 1 : -1, 0, 0] };
  }
  throw new GaussianSplatError('decode/unsupported', {
    where: `${name}, SPZ extension 0xADBE0003 (coordinate system)`,
    expected: 'a system from 0 to 16',
    found: String(system),
    remedy: 'export the scene again in the right-up-back (RUB) system, which is the default of SPZ',
  });
}

/**
 * Signs of the components x, y and z of a quaternion (w does not change): a mirrored axis reverses the rotations about
 * the other two.
 */
export function quaternionSigns([x, y, z]: AxisSigns): readonly [number, number, number] {
  return [y * z, x * z, x * y];
}

/**
 * Signs of the 15 coefficients of spherical harmonics of degrees 1 to 3: that of each basis polynomial under the signs
 * of x, y and z, in the order of 3D Gaussian Splatting.
 */
export function harmonicSigns([x, y, z]: AxisSigns): readonly number[] {
  const degree1 = [y, z, x];
  const degree2 = [x * y, y * z, 1, x * z, 1];
  const degree3 = [y, x * y * z, y, z, x, z, x];
  return [...degree1, ...degree2, ...degree3];
}
