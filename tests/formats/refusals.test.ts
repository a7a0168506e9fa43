import assert from 'node:assert/strict';
import { test } from 'node:test';
import { zipSync } from 'fflate';
import { detectFormat, readLodScene, readScene, sceneFormats, SogFiles } from '@gaussian-splat/formats';
import { needsSharedData, sharedFile } from '../support/data.js';
import { expectRefusal } from './support/expect.js';
import { buildGltf } from './support/gltf-writer.js';
import { smallCloud } from './support/small-cloud.js';
import { writeSog } from './support/sog-writer.js';

const text = (content: string): Uint8Array => new TextEncoder().encode(content);

const KINDS: readonly (readonly [what: string, bytes: Uint8Array, code: string, message: RegExp, name?: string])[] = [
  ['nothing', new Uint8Array(0), 'decode/empty', /found 0 bytes/],
  ['a page', text('<!DOCTYPE html>\n<title>Not found</title>'), 'decode/html', /web page.*DOCTYPE.*Check the address/],
  ['a page after a mark', text('\ufeff  <!-- x -->\n<html lang="en">'), 'decode/html', /web page/],
  ['a page named .ply', text('<html></html>'), 'decode/html', /web page/, 'scene.ply'],
  ['XML', text('<?xml version="1.0"?><Error><Code>AccessDenied</Code></Error>'), 'decode/unknown-format', /XML/],
  [
    'a pointer',
    text('version https://git-lfs.github.com/spec/v1\noid sha256:0\n'),
    'decode/lfs-pointer',
    /git lfs pull/,
  ],
  ['JSON', text('{"error": "not found"}'), 'decode/unknown-format', /JSON text: "\{/],
  ['a SOG description without a count', text('{"version": 2, "means": {}}'), 'decode/header', /count.*nothing/],
  ['a SOG description of the future', text('{"version": 3, "means": {}}'), 'decode/unsupported', /SOG version 1 or 2/],
  ['a streamed SOG description without files', text('{"lodLevels": 7}'), 'decode/header', /filenames.*found nothing/],
  ['glTF without splats', text('{"asset": {"version": "2.0"}}'), 'decode/not-splats', /KHR_gaussian_splatting/],
  ['glTF 1', text('{"asset": {"version": "1.0"}}'), 'decode/unsupported', /glTF 2/],
  ['a GLB that is cut', text('glTF\x02\0\0\0'), 'decode/truncated', /20 bytes, found 8/],
  ['a ZIP that is cut', text('PK\x03\x04 readme.txt'), 'decode/truncated', /directory of a ZIP file/],
  ['ZIP', zipSync({ 'readme.txt': text('x') }), 'decode/unknown-format', /ZIP archive with "readme.txt"/],
  ['PNG', Uint8Array.of(0x89, 0x50, 0x4e, 0x47), 'decode/unknown-format', /PNG/],
  ['JPEG', Uint8Array.of(0xff, 0xd8, 0xff, 0xe0), 'decode/unknown-format', /JPEG/],
  ['text', text('Hello, world\n'), 'decode/unknown-format', /a text: "Hello/],
  ['a ksplat that is cut', new Uint8Array(100), 'decode/truncated', /4,096/, 'a/scene.ksplat?x'],
  ['bytes', Uint8Array.of(7, 7, 7), 'decode/unknown-format', /bytes that begin with 07 07 07/],
  ['a PLY that is no PLY', text('plyers of the game'), 'decode/unknown-format', /a text/, 'x.ply'],
];

for (const [what, bytes, code, message, name = 'file'] of KINDS) {
  test(`${what} is refused by name`, async () => {
    await expectRefusal(bytes, code, message, { name });
  });
}

test('pages and pointers in place of a part of a scene are reported as such', async () => {
  const files = writeSog(smallCloud(40, 1));
  const lod = text(
    JSON.stringify({
      lodLevels: 1,
      filenames: ['0/meta.json'],
      tree: { bound: { min: [0, 0, 0], max: [1, 1, 1] }, lods: { 0: { file: 0, count: 40 } } },
    }),
  );
  const page = text('<!doctype html><title>Not found</title>');
  const pointer = text('version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 12345\n');
  const brings = (path: string, bytes: Uint8Array) => async (wanted: string) =>
    wanted === path ? bytes : files[wanted.split('/').at(-1)!];
  const cases: [Uint8Array, string, Uint8Array, string, RegExp][] = [
    [files['meta.json'], 'quats.webp', page, 'decode/html', /quats\.webp .*the file that the scene names.*web page/],
    [files['meta.json'], 'shN_labels.webp', pointer, 'decode/lfs-pointer', /shN_labels\.webp .*git lfs pull/],
    [lod, '0/meta.json', page, 'decode/html', /0\/meta\.json .*web page/],
    [lod, '0/sh0.webp', pointer, 'decode/lfs-pointer', /0\/meta\.json, sh0\.webp .*git lfs pull/],
  ];
  for (const [scene, path, bytes, code, message] of cases) {
    await expectRefusal(scene, code, message, { name: 'scene.json', openFile: brings(path, bytes) });
    assert.ok(await readScene(scene, { openFile: brings('', bytes) }));
  }
  const { json, buffer } = buildGltf([[{ cloud: smallCloud(2, 0) }]], [{ mesh: 0 }], [0]);
  const gltf = text(JSON.stringify({ ...json, buffers: [{ uri: 'a.bin', byteLength: buffer.length }] }));
  const openFile = brings('a.bin', page);
  await expectRefusal(gltf, 'decode/html', /scene\.gltf, a\.bin .*web page/, {
    name: 'scene.gltf',
    openFile,
  });
  const { boxes } = readLodScene(lod, 'lod-meta.json', 'https://x.test/lod-meta.json');
  const fetch = async (url: string): Promise<Uint8Array> => brings('quats.webp', page)(new URL(url).pathname.slice(3));
  await assert.rejects(new SogFiles().read(boxes[0].runs[0], fetch), /quats\.webp .*web page.*decode\/html/);
});

test('real files of other kinds are refused by name', { skip: needsSharedData }, async () => {
  const files: [string, string, RegExp][] = [
    ['cases/metalsplatter/beetle.ascii.ply', 'decode/not-splats', /a mesh with 1148 vertex, 2053 face.*lacks scale_0/],
    ['cases/metalsplatter/beetle.binary.ply', 'decode/not-splats', /a mesh.*and has x, y, z, nx, ny, nz, flags/],
    ['photos/skull/points3D.ply', 'decode/not-splats', /lacks scale_0, scale_1, rot_0.*has x, y, z, nx, ny, nz, red/],
    ['cases/malformed/lfs-pointer_point_cloud.ply', 'decode/lfs-pointer', /git-LFS pointer/],
    ['cases/malformed/lfs-pointer_cameras.json', 'decode/lfs-pointer', /git-LFS pointer/],
    [
      'cases/malformed/playbot3.MISLABELLED-v1.spz',
      'decode/corrupt',
      /1,240,000 .* version 1, found 1,333,000, the length of version 2/,
    ],
    ['scenes/logo-sog-v1/meta.json', 'decode/unsupported', /a way to open the other files/],
    ['scenes/playbot-streamed/lod-meta.json', 'decode/unsupported', /a way to open the other files/],
    ['avatars/rigged-gltf/BrainStem.glb', 'decode/not-splats', /KHR_gaussian_splatting/],
    ['generators/octree-gs/color_mlp.onnx', 'decode/unsupported', /ONNX model/],
    ['reference/skull_01_classic.png', 'decode/unknown-format', /PNG/],
    ['photos/skull/images/01.jpg', 'decode/unknown-format', /JPEG/],
    ['scenes/logo-sog-v1/quats.webp', 'decode/unknown-format', /WebP/],
    ['generators/octree-gs/anchor_positions.bin', 'decode/unknown-format', /bytes that begin with/],
  ];
  for (const [name, code, message] of files) {
    await expectRefusal(sharedFile(name), code, message, { name });
    const unnamed = await expectRefusal(sharedFile(name), code, message, { name: 'unnamed' });
    assert.equal(unnamed.family, 'decode');
  }
});

test('content speaks before the name', { skip: needsSharedData }, async () => {
  const files = [
    ['formats/playbot3.ply', 'ply'],
    ['formats/playbot3.compressed.ply', 'compressed-ply'],
    ['formats/playbot3.niantic-v2.spz', 'spz'],
    ['formats/playbot3.pc-v4.spz', 'spz'],
    ['scenes/plant.splat', 'splat'],
    ['formats/playbot3.glb', 'gltf'],
    ['formats/playbot3.c1.sh2.ksplat', 'ksplat'],
    ['scenes/massa.sog', 'zip'],
    ['scenes/logo-sog-v1/meta.json', 'sog'],
    ['scenes/playbot-streamed/lod-meta.json', 'lod'],
  ];
  for (const [file, format] of files) {
    for (const name of [file, 'scene', 'scene.ply', 'scene.spz', 'scene.png']) {
      assert.equal(detectFormat(sharedFile(file), name), format, `${file} as ${name}`);
    }
  }
  const cloud = await readScene(sharedFile('formats/playbot3.ply'), { name: 'wrong.splat' });
  assert.equal(cloud.count, 31_000);
});

test('the registry names every format once and its loaders give readers', async () => {
  assert.deepEqual(sceneFormats.map(({ name }) => name).sort(), [
    ...['compressed-ply', 'gltf', 'ksplat', 'lcc', 'lcc2', 'lod', 'ply', 'rad', 'sog', 'splat', 'spz', 'usd', 'zip'],
  ]);
  for (const { extensions, mimeTypes, load } of sceneFormats) {
    for (const extension of extensions) assert.match(extension, /^(\.[a-z]+2?)+$/);
    for (const type of mimeTypes) assert.match(type, /^[a-z]+\/[a-z+.-]+$/);
    assert.equal(typeof (await load()), 'function');
  }
});
