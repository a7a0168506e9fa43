/**
 * Clips: the reader returns the written values, splats appear and disappear, and an index is checked before it is used.
 * SECURITY.md: "The size of a file bounds its cost".
 */
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { serialize } from 'node:v8';
import { constants, deflateRawSync, inflateRawSync } from 'node:zlib';
import type { GaussianCloud } from '@gaussian-splat/core';
import {
  CLIP_HEAD_BYTES,
  clipFrame,
  clipGroupAt,
  clipPartBytes,
  clipRoomBytes,
  LoadBudget,
  packClipIndex,
  parseClip,
  readClipPart,
  readScene,
  takeClipRoom,
  unpackClipIndex,
  writeClipHead,
  type ClipIndex,
  type ClipPart,
  type ClipPartContent,
} from '@gaussian-splat/formats';
import { clipOf, framesOf } from '../support/clips.js';
import { fountain } from '../support/scenes/fountain.js';

const FRAMES = 24;
const frameOf = fountain({ splats: 600, frames: FRAMES, framesPerSecond: 10 });
const sources = Array.from({ length: FRAMES }, (_, frame) => frameOf(frame));
const clip = await clipOf((frame) => sources[frame], { frames: FRAMES, framesPerGroup: 12 });
const index = parseClip(clip.bytes, 'a.gsv');

const readParts = (parts: readonly ClipPart[], frames: number): Promise<ClipPartContent[]> =>
  Promise.all(
    parts.map((part) => {
      const bytes = clip.bytes.subarray(part.start, part.start + part.sceneBytes + part.motionBytes);
      return readClipPart({ bytes, part, frames, shDegree: index.shDegree, name: 'a.gsv' });
    }),
  );
const partsOf = (group: number): Promise<ClipPartContent[]> =>
  readParts(index.groups[group].parts, index.groups[group].frames);
const still = await readParts(index.still, 1);

/** Distance from each splat that can be seen to the nearest of another cloud that has its color. */
function farthest(from: GaussianCloud, to: GaussianCloud): number {
  let max = 0;
  for (let i = 0; i < from.count; i++) {
    if (from.opacities[i] < 0.05) continue;
    let min = Infinity;
    for (let k = 0; k < to.count; k++) {
      if (Math.abs(from.sh[3 * i] - to.sh[3 * k]) > 0.2 || to.opacities[k] === 0) continue;
      min = Math.min(min, Math.hypot(...[0, 1, 2].map((a) => from.positions[3 * i + a] - to.positions[3 * k + a])));
    }
    max = Math.max(max, min);
  }
  return max;
}

test('the index says where groups and parts are', () => {
  assert.deepEqual([index.frameCount, index.framesPerSecond, index.durationSeconds], [FRAMES, 10, 2.4]);
  assert.equal(index.byteLength, clip.bytes.length);
  assert.deepEqual(
    index.groups.map(({ first, frames, parts }) => [first, frames, parts.length]),
    [
      [0, 12, 2],
      [12, 12, 2],
    ],
  );
  assert.deepEqual(
    [0, 11, 12, 23].map((frame) => clipGroupAt(index, frame)),
    [0, 0, 1, 1],
  );
  const [coarse, rest] = index.groups[0].parts;
  assert.ok(coarse.splats * 6 < rest.splats, `${coarse.splats} of ${rest.splats} splats are coarse`);
});

test('between threads, an index is a table of 20 bytes a part, and the same afterwards', () => {
  assert.deepEqual(unpackClipIndex(structuredClone(packClipIndex(index))), index);
  const frames = 32_768;
  const groups = Array.from({ length: frames }, () => ({
    frames: 1,
    parts: [{ ...index.groups[0].parts[0], planes: 3 }],
  }));
  const large = parseClip(writeClipHead({ ...index, groups }), 'a.gsv');
  assert.equal(large.frameCount, frames);
  assert.ok(serialize(packClipIndex(large)).length < 20 * frames);
  assert.deepEqual(unpackClipIndex(packClipIndex(large)), large);
});

test('the memory on the GPU that an index asks for is charged to the whole file', () => {
  takeClipRoom(index, 'a.gsv');
  const [group] = index.groups;
  const part = { ...group.parts[0], splats: 4_000_000 };
  const large = { ...index, groups: [{ ...group, parts: [part] }] };
  const still = index.still.reduce((sum, each) => sum + clipPartBytes(each), 0);
  assert.equal(clipRoomBytes(large), clipPartBytes(part) + still);
  assert.throws(() => takeClipRoom({ ...large, byteLength: 1000 }, 'a.gsv'), { code: 'out-of-memory/budget' });
  takeClipRoom({ ...large, byteLength: 20_000_000 }, 'a.gsv');
});

test('splats are followed though no frame says which they were, and are gone when they are gone', async () => {
  const all = index.groups.reduce((sum, { parts }) => sum + parts.reduce((own, { splats }) => own + splats, 0), 0);
  // Each group has each splat once that is in one of its frames: the ground, the body, and all drops of its time.
  assert.ok(all < 2 * 1.5 * sources[0].count, `${all} splats in two groups`);
  for (const frame of [0, 5, 11, 12, 20, 23]) {
    const group = clipGroupAt(index, frame);
    const found = clipFrame(
      [...still, ...(await partsOf(group))],
      frame - index.groups[group].first,
      'a.gsv',
      new LoadBudget(1 << 24),
    );
    const alive = found.opacities.filter((opacity) => opacity > 0).length;
    assert.ok(Math.abs(alive - sources[frame].count) <= 0.02 * sources[frame].count, `frame ${frame}: ${alive} splats`);
    const [lost, added] = [farthest(sources[frame], found), farthest(found, sources[frame])];
    assert.ok(lost < 0.05 && added < 0.05, `frame ${frame}: ${lost} and ${added} away`);
  }
});

test('splats fade in and out by their lives, not by curves', async () => {
  for (const [group, { first, frames }] of index.groups.entries()) {
    const parts = await partsOf(group);
    for (const { motion } of parts) {
      assert.ok(motion.lives.fades, 'a part has fades');
      assert.ok(motion.parts.opacity.rank <= 2, `${motion.parts.opacity.rank} curves of opacities`);
    }
    for (let frame = 0; frame < frames; frame++) {
      const found = clipFrame([...still, ...parts], frame, 'a.gsv', new LoadBudget(1 << 24));
      const sum = (cloud: GaussianCloud): number => cloud.opacities.reduce((all, opacity) => all + opacity, 0);
      const [expected, seen] = [sum(sources[first + frame]), sum(found)];
      assert.ok(Math.abs(seen - expected) < 0.01 * expected, `frame ${first + frame}: ${seen} of ${expected}`);
    }
  }
});

/** The same file with another index. */
function withIndex(change: (json: Record<string, unknown> & { groups: (number | number[])[][] }) => void): Uint8Array {
  const length = new DataView(clip.bytes.buffer).getUint32(8, true);
  const json = JSON.parse(new TextDecoder().decode(clip.bytes.subarray(CLIP_HEAD_BYTES, CLIP_HEAD_BYTES + length)));
  change(json);
  const text = new TextEncoder().encode(JSON.stringify(json));
  const bytes = new Uint8Array(CLIP_HEAD_BYTES + text.length);
  bytes.set(clip.bytes.subarray(0, CLIP_HEAD_BYTES));
  new DataView(bytes.buffer).setUint32(8, text.length, true);
  bytes.set(text, CLIP_HEAD_BYTES);
  return bytes;
}

const withPart = (k: number, value: unknown): Uint8Array =>
  withIndex(({ groups }) => ((groups[0][1] as unknown[])[k] = value));

test('what an index cannot say is refused by name', () => {
  const cases: readonly (readonly [string, () => Uint8Array, RegExp])[] = [
    ['another file', () => new Uint8Array(64), /^decode\/header.*another file/],
    ['a cut head', () => clip.bytes.subarray(0, 8), /^decode\/truncated/],
    ['a cut index', () => clip.bytes.subarray(0, 40), /^decode\/truncated/],
    ['no groups', () => withIndex((json) => (json.groups = [])), /^decode\/header.*groups/],
    ['no frames', () => withIndex((json) => (json.groups[0][0] = 0)), /^decode\/header.*groups\[0\]\[0\]/],
    ['endless frames', () => withIndex((json) => (json.groups[0][0] = 1e9)), /^decode\/header/],
    ['no splats', () => withPart(0, 0), /^decode\/header/],
    ['endless splats', () => withPart(0, 1e12), /^decode\/header/],
    ['endless planes', () => withPart(1, 1e6), /^decode\/header/],
    ['half a byte', () => withPart(2, 1.5), /^decode\/header/],
    ['bytes before the file', () => withPart(3, -5), /^decode\/header/],
    ['still splats that are no parts', () => withIndex((json) => (json.still = 5)), /^decode\/header.*still/],
    ['still parts without bytes', () => withIndex((json) => (json.still = [[4]])), /^decode\/header.*still\[0\]/],
    ['endless still splats', () => withIndex((json) => (json.still = [[1e12, 4]])), /^decode\/header.*still\[0\]/],
    ['no bounds', () => withIndex((json) => delete json.bounds), /^decode\/header.*bounds/],
    ['no time', () => withIndex((json) => (json.framesPerSecond = 0)), /^decode\/header.*framesPerSecond/],
  ];
  for (const [name, make, expected] of cases) {
    let said = 'nothing';
    try {
      parseClip(make(), 'a.gsv');
    } catch (error) {
      said = `${(error as { code: string }).code} ${(error as Error).message}`;
    }
    assert.match(said, expected, name);
  }
});

test('parts that are others than the index says are refused', async () => {
  const read = async (asked: ClipIndex, bytes = clip.bytes): Promise<string> => {
    const { frames, parts } = asked.groups[0];
    const [part] = parts;
    const own = bytes.subarray(part.start, part.start + part.sceneBytes + part.motionBytes);
    return readClipPart({ bytes: own, part, frames, shDegree: asked.shDegree, name: 'a.gsv' }).then(
      () => 'nothing',
      (error: Error & { code: string }) => `${error.code} ${error.message}`,
    );
  };
  const changed = (change: Partial<ClipIndex['groups'][0]['parts'][0]>, frames = 12): ClipIndex => ({
    ...index,
    groups: [{ ...index.groups[0], frames, parts: [{ ...index.groups[0].parts[0], ...change }] }],
  });
  const [{ splats, planes }] = index.groups[0].parts;
  assert.match(await read(changed({ splats: splats + 1 })), /^decode\/header.*as the index says/);
  assert.match(await read(changed({ planes: planes + 1 })), /^decode\/header.*as the index says/);
  assert.match(await read(changed({}, 13)), /^decode\/header.*13 frames/);
  assert.match(await read(changed({ splats: 2 ** 27 })), /^out-of-memory\/budget/);
  const damaged = clip.bytes.slice();
  const [part] = index.groups[0].parts;
  damaged.fill(0xff, part.start + part.sceneBytes + 2, part.start + part.sceneBytes + 40);
  assert.match(await read(index, damaged), /^decode\//);
});

test('parts that say more than they hold, or hold more than they say, are refused by name', async () => {
  const old = new Uint8Array(readFileSync('tests/fixtures/clips/version-1.gsv'));
  const { groups, shDegree } = parseClip(old, 'old.gsv');
  const [group] = groups;
  const [part] = group.parts;
  const behind = part.start + part.sceneBytes;
  const scene = old.subarray(part.start, behind);
  const motion = new Uint8Array(
    inflateRawSync(old.subarray(behind, behind + part.motionBytes), { finishFlush: constants.Z_SYNC_FLUSH }),
  );
  const view = new DataView(motion.buffer);
  const ranks = [0, 1, 2, 3, 4].map((k) => view.getUint32(12 + 8 * k, true));
  const numbers = [3, 3, 3, 1, 3];
  // Behind the head, the curves and the modes of the planes.
  const lives = 52 + ranks.reduce((sum, rank, k) => sum + rank * (4 * group.frames + numbers[k]), 0);
  const edited = (change: (bytes: Uint8Array, own: DataView) => void): Uint8Array => {
    const copy = motion.slice();
    change(copy, new DataView(copy.buffer));
    return copy;
  };
  const cases: readonly (readonly [string, Uint8Array, object, RegExp])[] = [
    ['as it is', motion, {}, /^nothing$/],
    [
      'a life without an end',
      edited((bytes) => bytes.fill(255, lives + 2 * part.splats, lives + 4 * part.splats)),
      {},
      /^decode\/corrupt.*live/,
    ],
    [
      'an end before the birth',
      edited((bytes) => bytes.fill(0, lives + 2 * part.splats, lives + 4 * part.splats)),
      {},
      /^decode\/corrupt.*live/,
    ],
    [
      'version 2, without fades',
      concat(
        edited((_, own) => own.setUint32(0, 2, true)).subarray(0, lives + 4 * part.splats),
        motion.subarray(lives + 8 * part.splats),
      ),
      {},
      /^nothing$/,
    ],
    ['a version to come', edited((_, own) => own.setUint32(0, 4, true)), {}, /^decode\/unsupported.*2 or 3/],
    ['endless curves', edited((_, own) => own.setUint32(12, 2 ** 31, true)), {}, /^decode\/header.*curves/],
    ['other frames', edited((_, own) => own.setUint32(8, 2 ** 31, true)), {}, /^decode\/header.*frames/],
    ['other splats', edited((_, own) => own.setUint32(4, 2 ** 31, true)), {}, /^decode\/header/],
    ['a flood behind it', concat(motion, new Uint8Array(2e8)), {}, /^decode\/truncated.*more/],
    ['a curve of no number', edited((_, own) => own.setFloat32(52, NaN, true)), {}, /^decode\/corrupt.*curves/],
    ['more splats than the page allows', motion, { limits: { maxSplats: part.splats - 1 } }, /^out-of-memory\/budget/],
    ['more bytes than the page allows', motion, { limits: { maxBytes: 100 } }, /^out-of-memory\/budget/],
    ['splats that the scene lacks', motion, { splats: part.splats + 1 }, /^decode\/header/],
  ];
  for (const [name, raw, { limits, ...changes }, expected] of cases as readonly [
    string,
    Uint8Array,
    { limits?: object },
    RegExp,
  ][]) {
    const packed = new Uint8Array(deflateRawSync(raw));
    const own = { ...part, motionBytes: packed.length, ...changes };
    let said = 'nothing';
    try {
      await readClipPart({
        bytes: concat(scene, packed),
        part: own,
        frames: group.frames,
        ...{ shDegree, name: 'a.gsv', limits },
      });
    } catch (error) {
      said = `${(error as { code: string }).code} ${(error as Error).message}`;
    }
    assert.match(said, expected, name);
  }
});

function concat(a: Uint8Array, b: Uint8Array): Uint8Array {
  const both = new Uint8Array(a.length + b.length);
  both.set(a);
  both.set(b, a.length);
  return both;
}

test('a clip of version 1 has the splats that it always had', async () => {
  const old = new Uint8Array(readFileSync('tests/fixtures/clips/version-1.gsv'));
  const expected = JSON.parse(readFileSync('tests/fixtures/clips/version-1.json', 'utf8')) as {
    splats: number;
    opacity: number;
    position: number[];
  }[];
  const { frameCount, still } = parseClip(old, 'old.gsv');
  assert.deepEqual([frameCount, still], [expected.length, []]);
  const frameAt = framesOf(old);
  for (const [frame, { splats, opacity, position }] of expected.entries()) {
    const { count, opacities, positions } = await frameAt(frame);
    const sum = (of: (i: number) => number): number =>
      Array.from({ length: count }, (_, i) => opacities[i] * of(i)).reduce((total, value) => total + value, 0);
    assert.equal(opacities.filter((value) => value > 0).length, splats, `frame ${frame}: splats`);
    const found = [sum(() => 1), ...[0, 1, 2].map((axis) => sum((i) => positions[3 * i + axis]))];
    [opacity, ...position].forEach((value, k) =>
      assert.ok(Math.abs(found[k] - value) < 1e-3, `frame ${frame}, sum ${k}: ${found[k]}, not ${value}`),
    );
  }
});

test('coded motion that is cut, continued or changed is refused, or read within the bounds of its index', async () => {
  const group = index.groups[0];
  const [part] = group.parts;
  const own = clip.bytes.subarray(part.start, part.start + part.sceneBytes + part.motionBytes);
  const read = async (bytes: Uint8Array, limits = {}): Promise<string> =>
    readClipPart({
      ...{ bytes, frames: group.frames, shDegree: index.shDegree, name: 'a.gsv', limits },
      part: { ...part, motionBytes: bytes.length - part.sceneBytes },
    }).then(
      ({ motion: { lives, parts } }) => {
        assert.ok(lives.first.every((first, i) => first < lives.end[i] && lives.end[i] <= group.frames));
        assert.ok(Object.values(parts).every(({ curves }) => curves.every((value) => Math.abs(value) <= 2 ** 21)));
        return 'nothing';
      },
      (error: Error & { code: string }) => `${error.code} ${error.message}`,
    );
  const edited = (at: number, value: number): Uint8Array => {
    const copy = own.slice();
    copy[part.sceneBytes + at] = value;
    return copy;
  };
  assert.equal(await read(own), 'nothing');
  assert.match(await read(own.subarray(0, part.sceneBytes + 20)), /^decode\/truncated.*head/);
  assert.match(await read(own.subarray(0, own.length - 5)), /^decode\/truncated/);
  assert.match(await read(concat(own, new Uint8Array(7))), /^decode\/corrupt.*7 more/);
  assert.match(await read(edited(1, 5)), /^decode\/unsupported.*version 4/);
  assert.match(await read(edited(2, 9)), /^decode\/unsupported/);
  assert.match(await read(edited(4, own[part.sceneBytes + 4] ^ 1)), /^decode\/header.*splats/);
  assert.match(await read(edited(13, 255)), /^decode\/header.*curves/);
  assert.match(await read(own, { maxBytes: own.length + 2000 }), /^out-of-memory\/budget/);
  let refused = 0;
  for (let at = 52; at < own.length - part.sceneBytes; at += 61)
    if ((await read(edited(at, own[part.sceneBytes + at] ^ 0x5a))) !== 'nothing') refused++;
  assert.ok(refused > 0, 'no changed code was noticed');
});

test('a clip that is read as a scene, and a .4dgs container, are refused with what to do', async () => {
  const container = new TextEncoder().encode('    4DGS1\r\n').subarray(3);
  container[0] = 0x89;
  const files = [
    [clip.bytes, /a clip of many frames.*\.gsv/s],
    [new Uint8Array([...container, ...new Uint8Array(64)]), /a \.4dgs file.*path ends with \.4dgs/s],
  ] as const;
  for (const [bytes, expected] of files)
    await assert.rejects(readScene(bytes, { name: 'a file' }), (error: { code: string; message: string }) => {
      assert.equal(error.code, 'decode/unsupported');
      assert.match(error.message, expected);
      return true;
    });
});
