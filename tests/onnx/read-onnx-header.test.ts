import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { GaussianSplatError } from '@gaussian-splat/core';
import {
  blobSource,
  bytesSource,
  gpuNotes,
  readOnnxHeader,
  uncastableTypes,
  type OnnxHeader,
} from '@gaussian-splat/core/onnx';
import { needsSharedData, sharedFile } from '../support/data.js';
import { fixtureBytes, fixtureHeader, fixtureNames, fixturePath } from '../support/generators.js';

/** A header in the words of expected.json, which the onnx package of Python wrote. */
function plain(header: OnnxHeader): Record<string, unknown> {
  const { irVersion, producer, graphName, opsets, metadata, inputs, outputs, operators, functions } = header;
  return {
    irVersion,
    producer,
    graphName,
    opsets: Object.fromEntries(opsets),
    metadata: Object.fromEntries(metadata),
    inputs: inputs.map(({ name, dtype, dims }) => ({ name, dtype, dims: dims ?? null })),
    outputs: outputs.map(({ name, dtype, dims }) => ({ name, dtype, dims: dims ?? null })),
    operators: Object.fromEntries([...operators].sort(([a], [b]) => (a < b ? -1 : 1))),
    functions: [...functions],
    externalFiles: header.externalFiles.map(({ location }) => location),
  };
}

const expected = JSON.parse(readFileSync(fixturePath('expected.json'), 'utf8')) as Record<string, unknown>;

test('there are fixtures', () => {
  assert.ok(fixtureNames().length >= 12);
  assert.deepEqual(fixtureNames().sort(), Object.keys(expected).sort());
});

for (const name of fixtureNames()) {
  test(`${name} reads as Python's onnx reads it, from memory and from a Blob`, async () => {
    const bytes = fixtureBytes(name);
    const header = await readOnnxHeader(bytesSource(bytes, name));
    assert.deepEqual(plain(header), expected[name]);
    assert.equal(header.byteLength, bytes.length);
    assert.deepEqual(await readOnnxHeader(blobSource(new Blob([new Uint8Array(bytes)]), name)), header);
  });

  test(`${name} reads the same in pieces of 7 bytes`, async () => {
    const bytes = fixtureBytes(name);
    const inPieces = { ...bytesSource(bytes, name), chunk: 7 };
    assert.deepEqual(await readOnnxHeader(inPieces), await readOnnxHeader(bytesSource(bytes, name)));
  });
}

test('inputs with a default are distinguished', async () => {
  const { inputs, optionalInputs } = await fixtureHeader('subgraphs.onnx');
  assert.deepEqual([inputs.map(({ name }) => name), optionalInputs], [['flag', 'x', 'list'], ['weight']]);
});

test('external data: the length that the file must have', async () => {
  const { externalFiles, initializerBytes } = await readOnnxHeader(bytesSource(fixtureBytes('external.onnx')));
  assert.deepEqual(externalFiles, [{ location: 'external.weights', byteLength: 6656 }]);
  assert.ok(initializerBytes < 300, `${initializerBytes} bytes: only the entries are in the model`);
});

test('what pages cannot cast, and what leaves the GPU, is named from the header', async () => {
  const header = await fixtureHeader('faulty-cast.onnx');
  assert.deepEqual(uncastableTypes(header), ['uint16']);
  const notes = gpuNotes(header);
  assert.match(notes.join('\n'), /Round .*no kernel for it: .*Floor\(x \+ 0.5\)/);
  assert.match(notes.join('\n'), /Split into 10 .* CPU/);
  // From float16 and 64-bit integers, and to them, pages can cast.
  for (const name of ['packed-sh-half.onnx', 'packed.onnx', 'instances.onnx']) {
    assert.deepEqual(uncastableTypes(await fixtureHeader(name)), [], name);
  }
  assert.match(gpuNotes(await fixtureHeader('packed-sh-half.onnx')).join(), /shader-f16.*NVIDIA/);
  const sampled = { name: '', operator: 'GridSample', inputs: [header.inputs[0].name], outputs: ['y'], isInner: false };
  assert.match(gpuNotes({ ...header, nodes: [sampled], opsets: new Map([['ai.onnx', 20]]) }).join(), /up to opset 19/);
  assert.deepEqual(gpuNotes(await fixtureHeader('instances.onnx')), []);
});

test('real decoders of Octree-GS', { skip: needsSharedData }, async () => {
  const columns: Record<string, number> = { color: 30, cov: 70, opacity: 10 };
  for (const [name, width] of Object.entries(columns)) {
    const file = `generators/octree-gs/${name}_mlp.onnx`;
    const header = await readOnnxHeader(bytesSource(sharedFile(file), file));
    assert.equal(header.opsets.get('ai.onnx'), 10);
    assert.match(header.producer, /^pytorch/);
    assert.deepEqual([header.inputs.length, header.outputs.length], [1, 1], name);
    assert.equal(header.outputs[0].dims?.at(-1), width, name);
    assert.equal(header.inputs[0].dtype, 'float32');
  }
});

const FOREIGN: readonly [what: string, content: string | Uint8Array, code: string, found: RegExp][] = [
  ['nothing', '', 'decode/unknown-format', /an empty file/],
  ['a 404 page', '<!doctype html><title>404</title>', 'decode/html', /web page \(HTML\)/],
  ['a page after a comment', '\n<!-- x -->\n<html><body>no</body>', 'decode/html', /web page/],
  ['an XML error', '<?xml version="1.0"?><Error><Code>NoSuchKey</Code></Error>', 'decode/unknown-format', /XML/],
  ['a git-LFS pointer', 'version https://git-lfs.github.com/spec/v1\noid sha256:0\n', 'decode/lfs-pointer', /git-LFS/],
  ['a PyTorch checkpoint', 'PK\x03\x04archive/data.pkl', 'decode/unknown-format', /PyTorch/],
  ['an ORT model', '\x20\x00\x00\x00ORTM\x00\x00\x00\x00', 'decode/unsupported', /ORT/],
  ['a PLY scene', 'ply\nformat binary_little_endian 1.0\n', 'decode/unknown-format', /PLY/],
  ['JSON', '{"version": 1}', 'decode/unknown-format', /JSON/],
  ['a text', 'Not found, sorry', 'decode/unknown-format', /a text/],
  [
    'random bytes',
    Uint8Array.from({ length: 4000 }, (_, i) => (i * 2654435761) >>> 13),
    'decode/unknown-format',
    /begin with/,
  ],
  ['zeros', new Uint8Array(100), 'decode/unknown-format', /begin with 00 00/],
  ['an IR version and nothing else', Uint8Array.of(8, 8), 'decode/unknown-format', /neither/],
];

for (const [what, content, code, found] of FOREIGN) {
  test(`${what} is named as such`, async () => {
    const bytes = typeof content === 'string' ? Uint8Array.from(content, (c) => c.charCodeAt(0)) : content;
    await assert.rejects(readOnnxHeader(bytesSource(bytes, 'model.onnx')), (error: unknown) => {
      assert.ok(error instanceof GaussianSplatError, String(error));
      assert.equal(error.code, code, error.message);
      assert.match(error.found, found);
      assert.match(error.where, /model\.onnx/);
      return true;
    });
  });
}
