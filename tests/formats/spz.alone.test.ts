import assert from 'node:assert/strict';
import { gunzipSync, gzipSync } from 'node:zlib';
import { test } from 'node:test';
import { encodingsFor, lossesIn } from '@gaussian-splat/optimize';
import { readPrefix, readScene } from '@gaussian-splat/formats';
import type { GaussianCloud, ShDegree } from '@gaussian-splat/core';
import { transformCloud } from '../../packages/formats/src/transform/transform-cloud.js';
import { needsSharedData, sharedFile } from '../support/data.js';
import { assertAtMost, expectRefusal, largestDifference } from './support/expect.js';
import { extensionRecord, spzBody, writeSpz, type SpzWriterOptions } from './support/spz-writer.js';
import { writePly } from './support/ply-writer.js';
import { activated, inriaColumns, rawSplats, type RawSplats } from './support/splats.js';

const VERSIONS = [1, 2, 3, 4] as const;
/** 1 - |dot| that the quantization of rotations costs at most: 8 bits, or 9 bits of magnitude. */
const ROTATION_BOUND = { 1: 1e-2, 2: 1e-2, 3: 4e-6, 4: 4e-6 };

function assertHolds(cloud: GaussianCloud, splats: RawSplats, version: 1 | 2 | 3 | 4): void {
  const degree = Math.min(3, splats.degree) as ShDegree;
  const expected = activated(splats, degree);
  assert.equal(cloud.count, splats.count);
  assert.equal(cloud.shDegree, degree);
  // Half floats keep 11 bits of numbers up to 8, fixed-point ones 12 bits after the point.
  const positionBound = version === 1 ? 2 ** -9 : 2 ** -13;
  assertAtMost(largestDifference(cloud.positions, expected.positions), positionBound, 'positions');
  assertAtMost(largestDifference(cloud.opacities, expected.opacities), 0.5 / 255 + 1e-6, 'opacities');
  const logScales = Array.from(cloud.scales, Math.log);
  assertAtMost(largestDifference(logScales, splats.logScales.flat()), 1 / 32 + 1e-5, 'scales');
  // Half a step of the constant term is larger than half a step of the rest.
  assertAtMost(largestDifference(cloud.sh, expected.sh), 0.5 / 255 / 0.15 + 1e-6, 'sh');
  for (let i = 0; i < splats.count; i++) {
    const dot = splats.rotations[i].reduce((sum, value, k) => sum + value * cloud.rotations[4 * i + k], 0);
    assert.ok(1 - Math.abs(dot) <= ROTATION_BOUND[version], `rotation ${i}: ${1 - Math.abs(dot)}`);
  }
}

for (const version of VERSIONS) {
  for (const degree of [0, 1, 2, 3, 4]) {
    test(`version ${version}, degree ${degree}: every value arrives`, async () => {
      const splats = rawSplats(301, degree);
      for (const antialiased of [false, true]) {
        const cloud = await readScene(writeSpz(splats, { version, antialiased }));
        assertHolds(cloud, splats, version);
        assert.equal(cloud.antialiased, antialiased);
      }
    });
  }
}

test('versions 1 to 3 are also read without their gzip', async () => {
  const splats = rawSplats(20, 1);
  for (const version of [1, 2, 3] as const) assertHolds(await readScene(spzBody(splats, { version })), splats, version);
});

test('the number of fractional bits scales the positions', async () => {
  const splats = rawSplats(20, 0);
  const { positions } = await readScene(writeSpz(splats, { version: 3, fractionalBits: 18 }));
  assertAtMost(largestDifference(positions, splats.positions.flat()), 2 ** -19, 'positions');
});

test('systems whose third axis is vertical turn positions, rotations and harmonics', async () => {
  const raw = rawSplats(20, 3);
  // Turned harmonics are larger, and have to stay within -1..1.
  const splats = { ...raw, sh: raw.sh.map((s) => s.map((c) => c.map((value) => Math.fround(0.3 * value)))) };
  const source = await readScene(writePly([{ name: 'vertex', columns: inriaColumns(splats) }]));
  const [encoding] = encodingsFor('a.spz').slice(-1);
  // Axes of the files of Niantic's library for systems 9 to 16, from those of PLY. It mirrors axes before it turns them.
  const files = [
    ...['-x -z -y', '+x -z -y', '-x +z -y', '+x +z -y'],
    ...['-x -z +y', '+x -z +y', '-x +z +y', '+x +z +y'],
  ];
  for (const [k, axes] of files.entries()) {
    const rows = axes
      .split(' ')
      .map(([sign, axis]) => [...'xyz'].map((own) => (own === axis ? Number(`${sign}1`) : 0)));
    const inFile = structuredClone(source);
    transformCloud(
      inFile,
      rows.flatMap((row) => [...row, 0]),
    );
    const written = await encoding.write({ cloud: inFile, degrees: new Uint8Array(20).fill(3) });
    const body = new Uint8Array(gunzipSync(written));
    const system = body.length - 4;
    assert.equal(body[system], 6, 'the writer names right, down, forward');
    body[system] = 9 + k;
    assertHolds(await readScene(body), splats, 3);
  }
});

test('system 16 of the library of Niantic stands upright', { skip: needsSharedData }, async () => {
  const { count, positions, sh } = await readScene(sharedFile('../cases/files-4/spz-system-16.spz'));
  const stride = sh.length / count;
  const brightness = Array.from({ length: count }, (_, i) => sh[stride * i] + sh[stride * i + 1] + sh[stride * i + 2]);
  const white = brightness.indexOf(Math.max(...brightness));
  assert.ok(Math.abs(positions[3 * white + 1] + 1) < 1e-3, `y = ${positions[3 * white + 1]}`);
});

test('the marks of writers decide the frame of files that name none, which the cloud reports', async () => {
  const splats = rawSplats(20, 3);
  const cases: [SpzWriterOptions, NonNullable<SpzWriterOptions['axes']>][] = [
    [{ version: 1 }, [1, -1, -1]],
    [{ version: 2 }, [1, 1, 1]],
    [{ version: 2, antialiased: true }, [1, -1, -1]],
    [{ version: 3 }, [1, 1, 1]],
    [{ version: 3, antialiased: true }, [1, 1, 1]],
    [{ version: 3, fractionalBits: 16 }, [1, -1, -1]],
    [{ version: 4 }, [1, 1, 1]],
  ];
  for (const [options, axes] of cases) {
    const cloud = await readScene(writeSpz(splats, { ...options, axes }));
    assertHolds(cloud, splats, options.version);
    assert.equal(cloud.hints?.isUpAssumed, true);
    assert.match(cloud.warnings!.join(), /does not name its axes.*set up="y"/);
    const start = await readPrefix(writeSpz(splats, { ...options, axes }), { name: 'a.spz' });
    assert.equal(start?.warnings, undefined, 'the records are at the end of a file');
  }
  // Spark's header, and a gzip library of Rust, which names no system: byte 9 of the file.
  for (const fractionalBits of [10, 12]) {
    const options = { version: 2, antialiased: true, fractionalBits, axes: [1, 1, 1] } as const;
    const bySpark = writeSpz(splats, options);
    bySpark[9] = 255;
    const cloud = await readScene(bySpark);
    assertAtMost(largestDifference(cloud.positions, splats.positions.flat()), 2 ** -(fractionalBits + 1), 'positions');
    assert.match(cloud.warnings!.join(), /does not name its axes/);
  }
  const named = extensionRecord(0xadbe0003, Uint8Array.of(4, 0, 0, 0));
  const cloud = await readScene(writeSpz(splats, { version: 3, extensions: named, axes: [1, -1, -1] }));
  assert.deepEqual([cloud.hints?.isUpAssumed, cloud.warnings], [undefined, undefined]);
});

test('colors outside the range of SPZ are counted before they are cut', async () => {
  const cloud = await readScene(writePly([{ name: 'vertex', columns: inriaColumns(rawSplats(20, 1)) }]));
  assert.deepEqual(lossesIn('a.spz', cloud), []);
  cloud.sh.set([10, 0, -4], 0);
  cloud.sh[12 * 7 + 5] = 1.5;
  const [sentence] = lossesIn('a.SPZ', cloud);
  assert.match(sentence, /^2 of 20 splats have colors outside the range of SPZ, .* by up to 6\.67\./);
  assert.deepEqual(lossesIn('a.glb', cloud), []);
  const [encoding] = encodingsFor('a.spz').slice(-1);
  const again = await readScene(await encoding.write({ cloud, degrees: new Uint8Array(20).fill(1) }));
  assertAtMost(Math.abs(again.sh[0] + 6.667 - 10), 0.01, 'the cut color');
});

test('the coordinate system is found among other extensions', async () => {
  const splats = rawSplats(20, 3);
  const other = extensionRecord(0xadbe0002, new Uint8Array(12));
  const system = (value: number) => extensionRecord(0xadbe0003, Uint8Array.of(value, 0, 0, 0));
  const both = (value: number) => new Uint8Array(Buffer.concat([other, system(value)]));
  // Right-down-front is system 6, left-up-front 7, left-down-back 1: see CoordinateSystem in SPZ's splat-types.h.
  const cases: [Uint8Array, SpzWriterOptions['axes']][] = [
    [other, [1, 1, 1]],
    [both(0), [1, 1, 1]],
    [both(4), [1, -1, -1]],
    [both(6), [1, 1, 1]],
    [both(7), [-1, -1, 1]],
    [both(1), [-1, 1, -1]],
  ];
  for (const version of [2, 3, 4] as const) {
    for (const [extensions, axes] of cases) {
      assertHolds(await readScene(writeSpz(splats, { version, extensions, axes })), splats, version);
    }
  }
  const unknown = writeSpz(splats, { version: 4, extensions: both(17) });
  await expectRefusal(unknown, 'decode/unsupported', /extension 0xADBE0003.*found 17/);
});

test('a header that names another version than the body has is refused', async () => {
  const splats = rawSplats(50, 2);
  for (const actual of [1, 2, 3] as const) {
    for (const named of [1, 2, 3] as const) {
      if (actual === named) continue;
      const body = spzBody(splats, { version: actual });
      body[4] = named;
      const message = new RegExp(`splats of version ${named}.*the length of version ${actual}`);
      await expectRefusal(body, 'decode/corrupt', message);
      await expectRefusal(new Uint8Array(gzipSync(body)), 'decode/corrupt', message);
    }
  }
});

test('bodies that are too short by a byte are refused', async () => {
  for (const [version, size] of [
    [1, 800],
    [2, 950],
    [3, 1000],
  ] as const) {
    const body = spzBody(rawSplats(50, 0), { version }).subarray(0, -1);
    for (const file of [body, new Uint8Array(gzipSync(body))]) {
      const message = new RegExp(`expected ${size === 1000 ? '1,000' : size} bytes.*found ${size - 1}`);
      await expectRefusal(file, 'decode/truncated', message);
    }
  }
});

test('what stands behind the splats is left alone, unless the header may name the wrong version', async () => {
  const splats = rawSplats(50, 1);
  const behind = (version: 1 | 2 | 3, tail: Uint8Array): Uint8Array[] => {
    const body = Buffer.concat([spzBody(splats, { version }), tail]);
    return [new Uint8Array(body), new Uint8Array(gzipSync(body))];
  };
  for (const version of [1, 2, 3] as const) {
    for (const tail of [new Uint8Array(1), Uint8Array.of(10, 20, 30), new Uint8Array(1000), new Uint8Array(65_536)]) {
      for (const file of behind(version, tail)) assertHolds(await readScene(file), splats, version);
    }
    // No writer pads as much; inflating stops there.
    for (const file of behind(version, new Uint8Array(65_537)))
      await expectRefusal(file, 'decode/corrupt', /found more/);
  }
  for (const file of behind(3, new Uint8Array(3000).fill(7))) assertHolds(await readScene(file), splats, 3);
  for (const file of behind(2, new Uint8Array(49).fill(7))) assertHolds(await readScene(file), splats, 2);
  for (const bytes of [50, 51, 3000]) {
    for (const file of behind(2, new Uint8Array(bytes).fill(7))) {
      await expectRefusal(file, 'decode/corrupt', /1,400 bytes for 50 splats of version 2, found/);
    }
  }
  // Version 4 stores the lengths of its streams.
  const streams = Buffer.concat([writeSpz(splats, { version: 4 }), Buffer.alloc(99, 7)]);
  assertHolds(await readScene(new Uint8Array(streams)), splats, 4);
});

test('a scene far from (0, 0, 0) is written with the digits that 24 bits leave, or refused', async () => {
  const at = (far: number): GaussianCloud => {
    const positions = Float32Array.of(0, 1, 2, -3, 0.5, 0.25);
    return {
      ...{ count: 2, origin: [far, -far, 0], positions, scales: new Float32Array(6).fill(0.1) },
      ...{ rotations: Float32Array.of(1, 0, 0, 0, 1, 0, 0, 0), opacities: Float32Array.of(1, 1) },
      ...{ sh: new Float32Array(6), shDegree: 0, antialiased: false, droppedCount: 0 },
    };
  };
  const write = (cloud: GaussianCloud) =>
    encodingsFor('a.spz')[0].write({ cloud, degrees: new Uint8Array(cloud.count) });
  for (const far of [0, 1000, 100_000, 8_388_600]) {
    const cloud = at(far);
    const { positions } = await readScene(await write(cloud));
    const world = Array.from(cloud.positions, (value, k) => value + cloud.origin[k % 3]);
    assertAtMost(largestDifference(positions, world), Math.max(2 ** -21, far * 2 ** -23), `${far} away`);
  }
  for (const far of [8_388_608, -8_388_620, 1e9]) {
    const cloud = at(far);
    const refused = { code: 'argument/value', message: /coordinates of at most 8,388,607, .*\.ply/ };
    await assert.rejects(async () => write(cloud), refused);
    assert.throws(() => encodingsFor('a.spz', cloud), refused);
    assert.ok(encodingsFor('a.ply', cloud));
  }
});

test('headers out of range are refused', async () => {
  const splats = rawSplats(4, 0);
  const changed = (byte: number, value: number, version: 2 | 4 = 2) => {
    const file = version === 4 ? writeSpz(splats, { version }) : spzBody(splats, { version });
    file[byte] = value;
    return file;
  };
  await expectRefusal(changed(4, 0), 'decode/header', /byte 4 .*version from 1 to 4, found 0/);
  await expectRefusal(changed(4, 5), 'decode/unsupported', /byte 4 .*found 5/);
  await expectRefusal(changed(12, 5), 'decode/header', /byte 12 .*found 5/);
  await expectRefusal(changed(13, 25), 'decode/header', /byte 13 .*found 25/);
  await expectRefusal(changed(14, 0x80), 'decode/unsupported', /byte 14 .*levels of detail/);
  await expectRefusal(changed(8, 0), 'decode/empty', /1 splat or more, found 0/);
  await expectRefusal(changed(15, 9, 4), 'decode/header', /byte 15 .*5 streams/);
  await expectRefusal(changed(16, 31, 4), 'decode/header', /byte 16 .*byte 31/);
  await expectRefusal(changed(17, 255, 4), 'decode/truncated', /SPZ header of/);
  await expectRefusal(changed(40, 7, 4), 'decode/header', /byte 40 .*36 bytes of positions, found 7/);
  await expectRefusal(changed(33, 7, 4), 'decode/truncated', /bytes of positions from byte/);
  const nested = new Uint8Array(gzipSync(writeSpz(splats, { version: 4 })));
  await expectRefusal(nested, 'decode/unsupported', /version 4, which is not compressed as a whole/);
});

test('4,294,967,295 splats in a small file are refused at once', async () => {
  for (const version of VERSIONS) {
    const splats = rawSplats(4, 0);
    const file = version === 4 ? writeSpz(splats, { version }) : spzBody(splats, { version });
    file.fill(0xff, 8, 12);
    await expectRefusal(file, 'decode/truncated', /4,294,967,295 splats/);
    if (version < 4) await expectRefusal(new Uint8Array(gzipSync(file)), 'decode/truncated', /4,294,967,295 splats/);
  }
});

test('a gzip bomb behind a small header is not inflated', async () => {
  const body = spzBody(rawSplats(4, 0), { version: 2 });
  const bomb = new Uint8Array(gzipSync(Buffer.concat([body, Buffer.alloc(200_000_000)])));
  const before = process.memoryUsage().arrayBuffers;
  await expectRefusal(bomb, 'decode/corrupt', /expected 76 bytes.*found more/);
  assert.ok(process.memoryUsage().arrayBuffers - before < 50_000_000, 'memory stays small');
});

test('gzip of something else is named', async () => {
  const gzip = (text: string) => new Uint8Array(gzipSync(Buffer.from(text)));
  await expectRefusal(gzip('ply\nformat ascii 1.0\n'), 'decode/truncated', /PLY header/);
  await expectRefusal(gzip('<!doctype html><p>no</p>'), 'decode/unknown-format', /a web page/);
  await expectRefusal(gzip(''), 'decode/unknown-format', /inside the gzip file.*found no bytes/);
  await expectRefusal(gzip('NGSP'), 'decode/truncated', /SPZ header of 16 bytes, found 4/);
});

test('damaged gzip streams are distinguished from truncated ones', async () => {
  const file = writeSpz(rawSplats(2000, 1), { version: 3 });
  await expectRefusal(file.subarray(0, file.length >> 1), 'decode/truncated', /cut after/);
  const damaged = Uint8Array.from(file);
  damaged[damaged.length - 6] ^= 1;
  await expectRefusal(damaged, 'decode/corrupt', /gzip stream.*damaged/);
});

test('a gzip stream is read to its checksum even where the body ends with a block of the inflater', async () => {
  // 16 + 3276·20 bytes are 65,536, a multiple of the block sizes of inflaters.
  const body = spzBody(rawSplats(3276, 0), { version: 3 });
  assert.equal(body.length, 65_536);
  const damaged = new Uint8Array(gzipSync(body));
  damaged[damaged.length - 6] ^= 1;
  await expectRefusal(damaged, 'decode/corrupt', /gzip stream.*damaged/);
  const longer = new Uint8Array(gzipSync(Buffer.concat([body, Buffer.alloc(1)])));
  assert.equal((await readScene(longer)).count, 3276);
  longer[longer.length - 6] ^= 1;
  await expectRefusal(longer, 'decode/corrupt', /gzip stream.*damaged/);
});

test('an aborted signal rejects with its reason', async () => {
  const file = writeSpz(rawSplats(2000, 1), { version: 3 });
  const controller = new AbortController();
  const reading = readScene(file, { signal: controller.signal });
  controller.abort();
  await assert.rejects(reading, { name: 'AbortError' });
  await assert.rejects(readScene(file, { signal: AbortSignal.abort() }), { name: 'AbortError' });
});
