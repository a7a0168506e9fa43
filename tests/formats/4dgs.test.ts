/**
 * `.4dgs` files: every case of the format's conformance corpus is shown as its own decoder shows it, or refused with the fault's name. tests/fixtures/4dgs/README.md names the source of the corpus.
 */
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { unzipSync } from 'fflate';
import { shCoefficientCount, type GaussianCloud } from '@gaussian-splat/core';
import { clipFrame, LoadBudget } from '@gaussian-splat/formats';
import { FourDgsClip } from '@gaussian-splat/formats/4dgs';
import { onlyInLab } from '../support/extent.js';

interface Moment {
  readonly t: number;
  readonly count: number;
  readonly opacity: readonly [number];
  readonly position: readonly number[];
  readonly color: readonly number[];
  readonly scale: readonly number[];
  readonly turn: readonly number[];
  readonly sh?: readonly number[] | null;
}

const corpus = new Map(Object.entries(unzipSync(readFileSync('tests/fixtures/4dgs/corpus.zip'))));
const reference = JSON.parse(new TextDecoder().decode(corpus.get('states.json')!)) as Readonly<
  Record<string, { readonly splats: number; readonly duration: number; readonly states: readonly Moment[] }>
>;
const names = [...corpus.keys()].filter((name) => name.endsWith('.4dgs'));
const fileOf = (name: string): Uint8Array<ArrayBuffer> => new Uint8Array(corpus.get(`${name}.4dgs`)!);
const SH_C0 = 0.28209479177387814;

/** Sums over splats, by opacity, so that no order of them counts. */
function sums(cloud: GaussianCloud): Omit<Moment, 't'> {
  const width = shCoefficientCount(cloud.shDegree);
  const total = (count: number, of: (i: number, k: number) => number): number[] =>
    Array.from({ length: count }, (_, k) => {
      let sum = 0;
      for (let i = 0; i < cloud.count; i++) sum += cloud.opacities[i] * of(i, k);
      return sum;
    });
  const turns = (i: number): number[] => {
    const [w, x, y, z] = cloud.rotations.subarray(4 * i, 4 * i + 4);
    return [x * y, x * w, y * z, w * w];
  };
  return {
    count: cloud.count,
    opacity: [total(1, () => 1)[0]],
    position: total(3, (i, k) => cloud.positions[3 * i + k]),
    color: total(3, (i, k) => 0.5 + SH_C0 * cloud.sh[3 * width * i + k]),
    scale: total(3, (i, k) => Math.log(cloud.scales[3 * i + k])),
    turn: total(4, (i, k) => turns(i)[k]),
    // The corpus has all coefficients of red first, band by band.
    ...(width > 1 && {
      sh: bandsOf(cloud.shDegree).map(([k, channel]) => total(1, (i) => cloud.sh[3 * (width * i + k) + channel])[0]),
    }),
  };
}

const bandsOf = (degree: number): [coefficient: number, channel: number][] =>
  [0, 1, 2].flatMap((channel) =>
    Array.from({ length: (degree + 1) ** 2 - 1 }, (_, k): [number, number] => [k + 1, channel]),
  );

function assertNear(found: Omit<Moment, 't'>, expected: Moment, where: string, tolerance: number): void {
  assert.equal(found.count, expected.count, `${where}: splats`);
  for (const key of ['opacity', 'position', 'color', 'scale', 'turn', 'sh'] as const)
    expected[key]?.forEach((value, k) => {
      const own = found[key]![k];
      const max = tolerance * Math.max(1, expected.count, Math.abs(value));
      assert.ok(Math.abs(own - value) <= max, `${where}: ${key} ${k}: ${own}, not ${value}`);
    });
}

const isEmpty = (name: string): boolean => reference[name].splats === 0;

test('every state of the corpus is that of its own decoder', async () => {
  let moments = 0;
  for (const [name, { states, duration }] of Object.entries(reference)) {
    if (isEmpty(name)) continue;
    const clip = await FourDgsClip.open(fileOf(name), name);
    assert.ok(Math.abs(clip.index.durationSeconds - duration) <= 1 / clip.index.framesPerSecond, name);
    for (const expected of states) {
      assertNear(sums(await clip.at(expected.t)), expected, `${name} at ${expected.t} s`, 2e-5);
      moments++;
    }
  }
  assert.ok(moments > 150, `${moments} moments`);
});

test('frames that are played are those states, in curves that the GPU adds up', { skip: onlyInLab }, async () => {
  for (const name of Object.keys(reference).filter((own) => !isEmpty(own))) {
    const { index, clip } = await opened(name);
    const groups = [0, index.groups.length >> 1, index.groups.length - 1];
    for (const group of new Set(groups)) {
      const { first, frames, parts } = index.groups[group];
      const content = await clip.group(group);
      assert.ok(content.cloud.count <= parts[0].splats, `${name}: splats of group ${group}`);
      const planes = Object.values(content.motion.parts).reduce((sum, { codes }) => sum + codes.length, 0);
      assert.ok(planes <= parts[0].planes, `${name}: ${planes} planes of group ${group}`);
      for (const frame of new Set([0, frames >> 1, frames - 1])) {
        const state = await clip.at((first + frame + 0.5) / index.framesPerSecond);
        const seen = state.opacities.filter((opacity) => opacity > 0).length;
        if (seen === 0) continue;
        const shown = clipFrame([content], frame, name, new LoadBudget(1e6));
        const kept = onlySeen(shown);
        assertNear(sums(kept), { t: 0, ...sums(state) }, `${name}, frame ${first + frame}`, 4e-4);
      }
    }
  }
});

async function opened(name: string): Promise<{ clip: FourDgsClip; index: FourDgsClip['index'] }> {
  const clip = await FourDgsClip.open(fileOf(name), name);
  return { clip, index: clip.index };
}

/** Splats that live in other frames stay, without opacity. */
function onlySeen(cloud: GaussianCloud): GaussianCloud {
  const rows = [...Array(cloud.count).keys()].filter((i) => cloud.opacities[i] > 0);
  const pick = (values: Float32Array, width: number): Float32Array =>
    Float32Array.from(
      { length: width * rows.length },
      (_, k) => values[width * rows[Math.floor(k / width)] + (k % width)],
    );
  return {
    ...cloud,
    count: rows.length,
    positions: pick(cloud.positions, 3),
    scales: pick(cloud.scales, 3),
    rotations: pick(cloud.rotations, 4),
    opacities: pick(cloud.opacities, 1),
    sh: pick(cloud.sh, 3 * shCoefficientCount(cloud.shDegree)),
  };
}

const REFUSED: Readonly<Record<string, readonly [code: string, message: RegExp]>> = {
  BadMagic: ['decode/header', /a \.4dgs file/],
  EmptyTemporalModel: ['decode/unsupported', /temporal model.*""/s],
  FutureMajorVersion: ['decode/unsupported', /version 1.*"2"/s],
  NegativeStepTime: ['decode/corrupt', /step of time above 0.*-0\.004/s],
  UnknownQuantizationScheme: ['decode/unsupported', /uniform-v1.*uniform-v9/s],
  UnknownStreamCodec: ['decode/unsupported', /codec 9/],
  UnknownTemporalModel: ['decode/unsupported', /"frame-sequence"/],
  WindowIndexOutOfRange: ['decode/corrupt', /indexes below 1/],
  ZeroStepTime: ['decode/corrupt', /step of time above 0/],
};

async function refusal(bytes: Uint8Array, name: string): Promise<{ code: string; message: string }> {
  try {
    const clip = await FourDgsClip.open(bytes, name);
    // Chunks are decoded when their frames are due.
    for (const group of clip.index.groups.keys()) await clip.group(group);
  } catch (error) {
    return error as { code: string; message: string };
  }
  return { code: 'none', message: `${name} was read` };
}

test('every invalid case is refused with what is wrong', async () => {
  const cases = names.filter((name) => name.startsWith('invalid/')).map((name) => name.slice(8, -5));
  assert.deepEqual(cases.sort(), Object.keys(REFUSED).sort());
  for (const name of cases) {
    const { code, message } = await refusal(fileOf(`invalid/${name}`), name);
    assert.equal(code, REFUSED[name][0], `${name}: ${message}`);
    assert.match(message, REFUSED[name][1], name);
  }
  for (const name of Object.keys(reference).filter(isEmpty))
    assert.equal((await refusal(fileOf(name), name)).code, 'decode/empty', name);
});

/** Records with their places: opcode, 64 bits of length, content. */
function recordsIn(bytes: Uint8Array): { opcode: number; start: number; end: number }[] {
  const view = new DataView(bytes.buffer, bytes.byteOffset);
  const found = [];
  for (let at = 8; at + 9 <= bytes.length - 8;) {
    const end = at + 9 + Number(view.getBigUint64(at + 1, true));
    found.push({ opcode: bytes[at], start: at, end });
    at = end;
  }
  return found;
}

test('a file whose last state has no end is played up to a second after its last change', async () => {
  const source = fileOf('keyframe/KeyframeDeltaChurn-UseChunkIndex-UseCrc-UseStatistics');
  const ended = await FourDgsClip.open(source, 'ended');
  const records = recordsIn(source);
  const bytes = source.slice();
  const view = new DataView(bytes.buffer);
  const header = records.find(({ opcode }) => opcode === 0x01)!;
  let at = header.start + 9;
  for (let text = 0; text < 2; text++) at += 4 + view.getUint32(at, true);
  const last = records.findLast(({ opcode }) => opcode === 0x05 || opcode === 0x10)!;
  const begin = view.getFloat64(last.start + 9, true);
  view.setFloat64(at, Infinity, true);
  view.setFloat64(last.start + 17, Infinity, true);
  const endless = await FourDgsClip.open(bytes, 'endless');
  assert.ok(Math.abs(endless.index.durationSeconds - begin - 1) < 0.1, `${endless.index.durationSeconds} s`);
  for (const seconds of [0, begin - 0.01, begin + 0.01])
    assertNear(sums(await endless.at(seconds)), { t: 0, ...sums(await ended.at(seconds)) }, `${seconds} s`, 1e-6);
  const { count } = await endless.group(endless.index.groups.length - 1).then(({ cloud }) => cloud);
  assert.equal(count, (await ended.group(ended.index.groups.length - 1)).cloud.count);
});

test('records that come too late, and an index that says something else, are refused', async () => {
  const source = fileOf('keyframe/KeyframeDeltaChurn-UseChunkIndex-UseCrc-UseStatistics');
  const records = recordsIn(source);
  for (const opcode of [0x01, 0x03, 0x04]) {
    const record = records.find((own) => own.opcode === opcode)!;
    const chunk = records.findLast((own) => own.opcode === 0x05 || own.opcode === 0x10)!;
    const late = Buffer.concat([
      source.subarray(0, chunk.end),
      source.subarray(record.start, record.end),
      source.subarray(chunk.end),
    ]);
    assert.equal((await refusal(new Uint8Array(late), `late ${opcode}`)).code, 'decode/header');
  }
  const entries = records.filter(({ opcode }) => opcode === 0x08);
  // Splats that the chunk describes; splats that exist.
  for (const [place, k] of [
    [32, 1],
    [60, 2],
  ] as const) {
    const wrong = source.slice();
    wrong[entries[k].start + 9 + place]++;
    const { code, message } = await refusal(wrong, 'a wrong index');
    assert.equal(code, 'decode/header', message);
    assert.match(message, /index.*splats/s);
  }
});

/** A record with its opcode and its length. */
function recordOf(opcode: number, content: Uint8Array): Buffer {
  const head = Buffer.alloc(9);
  head.writeUInt8(opcode);
  head.writeBigUInt64LE(BigInt(content.length), 1);
  return Buffer.concat([head, content]);
}

test('a table of many windows is read, and changes of nothing and days of nothing are refused at once', async () => {
  const start = process.cpuUsage();
  const source = fileOf('TenWindows-UseCrc');
  const windows = recordsIn(source).find(({ opcode }) => opcode === 0x04)!;
  const count = 150_000;
  const table = Buffer.alloc(4 + 16 * count);
  table.writeUInt32LE(count);
  Buffer.from(source.subarray(windows.start + 13, windows.end)).copy(table, 4);
  for (let k = 10; k < count; k++) {
    table.writeDoubleLE(k * k * 1e-9, 4 + 16 * k);
    table.writeDoubleLE(k * k * 1e-9 + 1, 12 + 16 * k);
  }
  const many = [source.subarray(0, windows.start), recordOf(0x04, table), source.subarray(windows.end)];
  assert.ok((await FourDgsClip.open(new Uint8Array(Buffer.concat(many)), 'many')).index.frameCount > 0);

  const keyed = fileOf('keyframe/KeyframeDeltaChurn-UseChunkIndex-UseCrc-UseStatistics');
  const [keyframe, delta] = [0x05, 0x10].map((wanted) => recordsIn(keyed).find(({ opcode }) => opcode === wanted)!);
  // The mode that refers to the chunk before.
  keyed[delta.start + 29] = 1;
  const without = Buffer.concat([keyed.subarray(0, keyframe.start), keyed.subarray(keyframe.end)]);
  const orphan = await refusal(new Uint8Array(without), 'orphan');
  assert.equal(orphan.code, 'decode/corrupt', orphan.message);
  assert.match(orphan.message, /a reference to byte/);

  const long = source.slice();
  const view = new DataView(long.buffer);
  // Two texts precede the duration in the header.
  let at = recordsIn(source)[0].start + 9;
  for (let k = 0; k < 2; k++) at += 4 + view.getUint32(at, true);
  view.setFloat64(at, 999_999, true);
  const { code, message } = await refusal(long, 'days');
  assert.equal(code, 'out-of-memory/budget', message);
  const { user } = process.cpuUsage(start);
  assert.ok(user < 5e6, `${user / 1e6} s`);
});

test('no damage of a file ends otherwise than in a named error', async () => {
  const cases = [
    'MixedLifetimes-SHDegree1-UseChunkIndex-UseCrc',
    'object/ObjectTrackComposed-UseChunkIndex-UseCrc',
    'keyframe/KeyframeDeltaChurn-UseChunkIndex-UseCrc-UseStatistics',
  ];
  for (const name of cases) {
    const source = fileOf(name);
    for (let k = 0; k < 120; k++) {
      const bytes = source.slice(0, k % 4 === 0 ? Math.floor((source.length * k) / 120) : source.length);
      if (bytes.length > 0) bytes[(7919 * k * k + 8) % bytes.length] ^= 1 + ((37 * k) % 255);
      try {
        const clip = await FourDgsClip.open(bytes, name, { maxBytes: 1 << 26, maxSeconds: 5 });
        await clip.group(0);
      } catch (error) {
        assert.match(String((error as { code?: string }).code), /^(decode|out-of-memory)\//, `${name} ${k}: ${error}`);
      }
    }
  }
});
