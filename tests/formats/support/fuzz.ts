/** Damaged and multiplied files: every reader must survive them without a crash, and at a cost that their size bounds. */
import { seededRandom } from '../../support/random.js';
import { damage } from './damage.js';
import {
  fuzzScenes,
  otherScenes,
  type FuzzFormat,
  type FuzzScene,
  type OtherReader,
  type ReaderKind,
} from './fuzz-scenes.js';
import { multiply } from './multiply.js';
import { BOUNDS, excesses, measuredReading, type Costs } from './reading.js';

export type Reader = FuzzFormat | OtherReader;

/** All readers, with what a worker is asked for and small sound files. */
export async function allReaders(): Promise<
  Readonly<Record<Reader, { readonly kind: ReaderKind; readonly scenes: readonly FuzzScene[] }>>
> {
  const scenes = Object.entries(fuzzScenes()).map(([name, own]) => [name, { kind: 'load', scenes: own }]);
  const load = Object.fromEntries(scenes) as Record<FuzzFormat, { kind: 'load'; scenes: readonly FuzzScene[] }>;
  return { ...load, ...(await otherScenes()) };
}

export interface FuzzTally {
  files: number;
  read: number;
  refused: number;
  /** Refusals by code. */
  readonly codes: Record<string, number>;
  /** Maximum of each cost, as a fraction of its bound. */
  readonly shares: Record<keyof Costs, number>;
}

/**
 * Reads `count` hostile copies of a reader's files. Throws at the first that breaks a rule, and says how to make it
 * again.
 * @param onFile Called with the number of each file before it is read, because a process that ends cannot say it.
 */
export async function fuzzReader(
  reader: Reader,
  { kind, scenes }: { readonly kind: ReaderKind; readonly scenes: readonly FuzzScene[] },
  {
    first = 0,
    count,
    seed = 1,
    onFile,
  }: { first?: number; count: number; seed?: number; onFile?: (k: number) => void },
): Promise<FuzzTally> {
  const none = Object.fromEntries(Object.keys(BOUNDS).map((cost) => [cost, 0])) as Record<keyof Costs, number>;
  const tally: FuzzTally = { files: 0, read: 0, refused: 0, codes: {}, shares: none };
  for (let k = first; k < first + count; k++) {
    onFile?.(k);
    const scene = hostileCopy(scenes[k % scenes.length], seed * 1_000_003 + k);
    const where = `${reader}, file ${k} of seed ${seed}`;
    const reading = await measuredReading(kind, scene).catch((cause: unknown) => {
      throw new Error(`${where}: an error without a name: ${String(cause)}`, { cause });
    });
    tally.files++;
    if (reading.outcome === 'read') tally.read++;
    else {
      tally.refused++;
      tally.codes[reading.outcome] = (tally.codes[reading.outcome] ?? 0) + 1;
    }
    for (const cost of Object.keys(BOUNDS) as (keyof Costs)[])
      tally.shares[cost] = Math.max(tally.shares[cost], reading.costs[cost] / BOUNDS[cost](reading.bytes));
    const found = excesses(reading);
    if (found.length > 0) throw new Error(`${where} (${reading.outcome}): ${found.join('; ')}`);
  }
  return tally;
}

/** A scene one of whose files is damaged or multiplied. */
export function hostileCopy({ name, files }: FuzzScene, seed: number): FuzzScene {
  const random = seededRandom(seed);
  const paths = Object.keys(files);
  const victim = random.uniform(0, 1) < 0.6 ? name : paths[Math.floor(random.uniform(0, paths.length))];
  const change = random.uniform(0, 1) < 0.3 ? damage : multiply;
  return { name, files: { ...files, [victim]: change(files[victim], random) } };
}
