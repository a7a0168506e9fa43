/**
 * Damaged and hostile files: every one ends quickly, in a header or in an error that names the file.
 * SECURITY.md: "Scene and model files are untrusted data".
 */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { GaussianSplatError } from '@gaussian-splat/core';
import { bytesSource, readOnnxHeader, type OnnxHeader } from '@gaussian-splat/core/onnx';
import { openModel } from '../support/element/loading.js';
import { isLab } from '../support/extent.js';
import { fixtureBytes, fixtureNames } from '../support/generators.js';
import { seededRandom } from '../support/random.js';

async function outcome(bytes: Uint8Array, chunk = bytes.length): Promise<OnnxHeader | GaussianSplatError> {
  try {
    return await readOnnxHeader({ ...bytesSource(bytes, 'model.onnx'), chunk: Math.max(1, chunk) });
  } catch (error) {
    assert.ok(error instanceof GaussianSplatError, `not a named error: ${String(error)}`);
    assert.match(error.code, /^decode\//);
    assert.match(error.where, /model\.onnx/);
    for (const part of [error.expected, error.found, error.remedy]) assert.doesNotMatch(part, /undefined|NaN|\[object/);
    assert.ok(error.message.length < 500, error.message);
    return error;
  }
}

test('a file that ends anywhere but at the end of a field is truncated', async () => {
  for (const name of ['packed.onnx', 'subgraphs.onnx', 'external.onnx']) {
    const whole = fixtureBytes(name);
    let truncated = 0;
    for (let length = 1; length < whole.length; length += name === 'packed.onnx' ? 13 : 1) {
      const result = await outcome(whole.slice(0, length));
      if (!(result instanceof GaussianSplatError)) continue;
      assert.match(result.code, /^decode\/(truncated|unknown-format)$/, `${name} cut to ${length}: ${result.message}`);
      if (result.code === 'decode/truncated') truncated++;
    }
    assert.ok(truncated > 100, `${name}: ${truncated} cuts were noticed`);
  }
});

const MUTATIONS = isLab ? 20_000 : 5_000;
test(`${MUTATIONS} mutations: a header or a named error, the same in one piece and in many`, async () => {
  const { uniform } = seededRandom(42);
  const random = (): number => uniform(0, 1);
  const files = fixtureNames().map(fixtureBytes);
  const start = process.cpuUsage();
  let refused = 0;
  for (let i = 0; i < MUTATIONS; i++) {
    const bytes = mutate(files[i % files.length], random);
    const result = await outcome(bytes);
    if (result instanceof GaussianSplatError) refused++;
    if (i % 20 !== 0) continue;
    const inPieces = await outcome(bytes, 1 + Math.floor(random() * 300));
    if (result instanceof GaussianSplatError) assert.equal(String(inPieces), String(result));
    else assert.deepEqual(inPieces, result);
  }
  assert.ok(refused > MUTATIONS / 10 && refused < MUTATIONS, `${refused} refused`);
  const seconds = process.cpuUsage(start).user / 1e6;
  assert.ok(seconds < 60, `${seconds} s of work`);
});

/** Flips, replaces, inserts, removes or repeats bytes, mostly in the first and last 200, which hold the structure. */
function mutate(original: Uint8Array, random: () => number): Uint8Array {
  let bytes = original.slice();
  const place = (): number => {
    const near = Math.floor(random() * Math.min(200, bytes.length));
    const choice = random();
    return choice < 0.45 ? near : choice < 0.9 ? bytes.length - 1 - near : Math.floor(random() * bytes.length);
  };
  for (let n = 1 + Math.floor(random() * 4); n > 0; n--) {
    const at = place();
    const value = [0, 0x7f, 0x80, 0xff, Math.floor(random() * 256)][Math.floor(random() * 5)];
    const kind = Math.floor(random() * 4);
    if (kind === 0) bytes[at] ^= 1 << Math.floor(random() * 8);
    else if (kind === 1) bytes[at] = value;
    else if (kind === 2) bytes = Uint8Array.of(...bytes.subarray(0, at), value, ...bytes.subarray(at));
    else bytes = Uint8Array.of(...bytes.subarray(0, at), ...bytes.subarray(at + 1 + Math.floor(random() * 8)));
  }
  return bytes;
}

/** A length-delimited field of protobuf. */
function field(number: number, payload: Uint8Array): Uint8Array {
  return Uint8Array.from([...varint(number * 8 + 2), ...varint(payload.length), ...payload]);
}

function varint(value: number): number[] {
  return value < 128 ? [value] : [(value % 128) + 128, ...varint(Math.floor(value / 128))];
}

const model = (graph: Uint8Array): Uint8Array => Uint8Array.from([8, 8, ...field(7, graph)]);

test('graphs within graphs come to an end', async () => {
  let graph = new Uint8Array(0);
  for (let depth = 0; depth < 200; depth++) graph = field(1, field(5, field(6, graph))) as Uint8Array<ArrayBuffer>;
  const result = await outcome(model(graph));
  assert.ok(result instanceof GaussianSplatError);
  assert.match(result.message, /graphs within graphs/);
});

test('wrong lengths are corrupt, for any value', async () => {
  for (const claim of [
    [0x7f],
    [0xff, 0xff, 0xff, 0xff, 0x0f],
    [0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x01],
  ]) {
    const result = await outcome(model(Uint8Array.of(0x0a, ...claim, 1, 2, 3)));
    // The graph ends with the file: a field that runs over both is a file that was cut.
    assert.ok(result instanceof GaussianSplatError && /truncated|corrupt/.test(result.code), String(result));
    const within = await outcome(Uint8Array.of(...model(Uint8Array.of(0x0a, ...claim, 1, 2, 3)), 8, 8));
    assert.ok(within instanceof GaussianSplatError && within.code === 'decode/corrupt', String(within));
  }
});

test('a file of 60 MB of empty fields is refused within seconds', async () => {
  const bytes = new Uint8Array(60_000_000);
  for (let i = 0; i < bytes.length; i += 2) bytes[i] = 0x0a;
  const start = process.cpuUsage();
  bytes.set([8, 8]);
  const result = await outcome(bytes);
  assert.ok(result instanceof GaussianSplatError && result.code === 'decode/unsupported', String(result));
  const seconds = process.cpuUsage(start).user / 1e6;
  assert.ok(seconds < 20, `${seconds} s of work`);
});

const joined = (parts: readonly Uint8Array[]): Uint8Array => new Uint8Array(Buffer.concat(parts));

test('a node of very many attributes is read in linear time', async () => {
  const text = (value: string): Uint8Array => new TextEncoder().encode(value);
  const attributes = Array.from({ length: 50_000 }, (_, k) => {
    return field(5, joined([field(1, text(`a${k}`)), Uint8Array.of(0x18, 1)]));
  });
  const start = process.cpuUsage();
  const result = await outcome(model(field(1, joined([field(4, text('Add')), ...attributes]))));
  const seconds = process.cpuUsage(start).user / 1e6;
  assert.ok(!(result instanceof GaussianSplatError), String(result));
  assert.equal(Object.keys(result.nodes[0].numbers!).length, 50_000);
  assert.ok(seconds < 3, `${seconds} s of work`);
});

test('a node of more names than a page can receive is refused', async () => {
  const inputs = new Uint8Array(2 * 1_000_001);
  for (let i = 0; i < inputs.length; i += 2) inputs[i] = 0x0a;
  const place = { bytes: model(field(1, inputs)), name: 'model.onnx' };
  const opened = openModel({ place, limits: undefined }, new AbortController().signal);
  await assert.rejects(opened, { code: 'out-of-memory/budget' });
});

test('a page that is only comments is refused at once', async () => {
  const start = process.cpuUsage();
  const result = await outcome(new TextEncoder().encode('<!---->'.repeat(28)));
  assert.ok(result instanceof GaussianSplatError, String(result));
  assert.ok(process.cpuUsage(start).user < 1e6);
});
