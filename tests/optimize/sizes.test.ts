/** Files that their format cannot declare, or that memory cannot hold: named errors before anything is written. */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { writeClipHead } from '../../packages/formats/src/clip.js';
import { encodeFloorMap } from '@gaussian-splat/formats/floor';
import { writeGlb } from '../../packages/optimize/src/write/glb.js';
import { writePly } from '../../packages/optimize/src/write/ply.js';
import { sogFiles } from '../../packages/optimize/src/write/sog.js';
import { writeSpz } from '../../packages/optimize/src/write/spz.js';
import { writeZip } from '../../packages/optimize/src/write/zip.js';
import { inline } from '../../packages/optimize/src/parts/task-pool.js';
import { cloudOf } from '../support/clouds.js';

const ONE = cloudOf([{ position: [0, 0, 0], scale: 1, opacity: 0.5, color: [1, 1, 1] }]);
/** A cloud that declares more splats than its arrays have. */
const declaring = (count: number): typeof ONE => ({ ...ONE, count });
const tooLarge = { code: 'argument/value', message: /at most [\d,]+ (bytes|splats|files)/ };
const tooMuch = { code: 'out-of-memory/allocation' };

test('a GLB of 4 GiB is refused before its memory is allocated; one below is allocated', async () => {
  const lengths: number[] = [];
  const allocate = (length: number): never => {
    lengths.push(length);
    throw new RangeError('no memory');
  };
  const pool = { ...inline, allocate };
  // A splat of degree 3 has 4 * (3 + 1 + 3 + 48) + 8 bytes.
  const maxCount = Math.floor((2 ** 32 - 16_384) / 228);
  const splats = (count: number): Promise<unknown> =>
    writeGlb({ cloud: declaring(count), degrees: new Uint8Array(count).fill(3) }, pool);
  await assert.rejects(splats(maxCount + 100), tooLarge);
  assert.deepEqual(lengths, []);
  await assert.rejects(splats(maxCount), tooMuch);
  assert.ok(lengths.length === 1 && lengths[0] < 2 ** 32 && lengths[0] > 2 ** 32 - 20_000, `${lengths.join()} bytes`);
});

test('SPZ counts in 32 bits, WebP has 16,383 pixels a side, ZIP without ZIP64 has 4 GiB and 65,535 files', async () => {
  await assert.rejects(writeSpz(declaring(2 ** 32), { shBits: 8 }), tooLarge);
  const order = { length: 16_380 ** 2 + 1 } as Uint32Array;
  const steps = { place: 1, size: 1, turn: 1, opacity: 1, color: 1, harmonics: 1 };
  const encodeWebp = (): never => assert.fail('nothing to encode');
  await assert.rejects(sogFiles(ONE, order, { steps, palette: 1024, encodeWebp }), tooLarge);
  const part = new Uint8Array(2 ** 28);
  const parts = (count: number, bytes: Uint8Array): Map<string, Uint8Array> =>
    new Map(Array.from({ length: count }, (_, k) => [`${k}`, bytes]));
  assert.throws(() => writeZip(parts(16, part)), tooLarge);
  assert.throws(() => writeZip(parts(65_536, new Uint8Array())), tooLarge);
  assert.ok(writeZip(parts(65_535, new Uint8Array())).length > 0);
});

test('memory that cannot be had has a name', () => {
  assert.throws(() => writePly(declaring(2 ** 50)), tooMuch);
});

test('what the readers of clips and of floors refuse for its size is not written', () => {
  const part = { splats: 1, planes: 0, sceneBytes: 1, motionBytes: 1 };
  const groups = new Array(1_000_001).fill({ frames: 1, parts: [part] }) as {
    frames: number;
    parts: (typeof part)[];
  }[];
  const bounds = { min: [0, 0, 0], max: [1, 1, 1], center: [0, 0, 0], radius: 1 } as const;
  const facts = { framesPerSecond: 30, shDegree: 0, origin: [0, 0, 0], bounds, antialiased: false, grow: 1 } as const;
  assert.throws(() => writeClipHead({ ...facts, filterVariance: undefined, groups }), { code: 'argument/value' });
  const cells = { cell: 1, corner: [0, 0], step: 0.3, start: [0, 0, 0], area: 1 } as const;
  const layer = new Float32Array(1).fill(NaN);
  const layers = (count: number): Float32Array[] => new Array<Float32Array>(count).fill(layer);
  assert.ok(encodeFloorMap({ ...cells, width: 1, depth: 1, layers: layers(1024) }).length > 0);
  assert.throws(() => encodeFloorMap({ ...cells, width: 1, depth: 1, layers: layers(1025) }), {
    code: 'argument/value',
  });
  const wide = { ...cells, width: 2 ** 13, depth: 2 ** 13, layers: [layer] };
  assert.throws(() => encodeFloorMap(wide), { code: 'argument/value' });
});
