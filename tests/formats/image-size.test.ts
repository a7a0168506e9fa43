/**
 * Sizes of image files by their headers, before a browser decodes them.
 * SECURITY.md: "The size of a file bounds its cost".
 */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { boundedImageHeader } from '@gaussian-splat/formats';

const bytesOf = (hex: string): Uint8Array => new Uint8Array(Buffer.from(hex.replaceAll(/\s/g, ''), 'hex'));
/** 40 x 20 pixels, written by Pillow; `size` replaces width and height. */
const avif = (size = '00000028 00000014'): Uint8Array =>
  bytesOf(`0000002066747970617669660000000061766966 6d6966316d6961664d413142 000000eb6d657461000000000000002168646c72
    000000000000000070696374000000000000000000000000000000000e7069746d0000000000010000001e696c6f6300000000440000
    01000100000001000001130000002c0000002869696e660000000000010000001a696e6665020000000001000061763031436f6c6f72
    000000006a697072700000004b6970636f0000001469737065 00000000 ${size} 00000010706978690000000003080808
    0000000c6176314381000c0000000013636f6c726e636c780001000d0006800000001769706d6100000000000000010001040102830400
    0000346d64617412000a091815279b4404341a10321d14c78786650208209e50000000c793b4e705876b04e872be8b1f7e89d0`);
/** Headers of images of the given width and height, two bytes each. */
const HEADERS: Readonly<Record<string, (width: string, height: string) => Uint8Array>> = {
  'image/png': (width, height) => bytesOf(`89504e470d0a1a0a 0000000d 49484452 0000${width} 0000${height} 0806000000`),
  'image/jpeg': (width, height) => bytesOf(`ffd8 ffe0 0004 0000 ff ffc2 0011 08 ${height} ${width} 03 000000000000`),
  'image/avif': (width, height) => avif(`0000${width} 0000${height}`),
};

test('sizes of PNG, JPEG and AVIF', () => {
  for (const [type, make] of Object.entries(HEADERS))
    assert.deepEqual(boundedImageHeader(make('0128', '0014'), 'a'), { type, width: 296, height: 20 }, type);
  assert.deepEqual(boundedImageHeader(avif(), 'a'), { type: 'image/avif', width: 40, height: 20 });
});

test('more than 16,384 x 8,192 pixels are refused by name', () => {
  for (const [type, make] of Object.entries(HEADERS)) {
    assert.equal(boundedImageHeader(make('4000', '2000'), 'a')?.type, type);
    assert.throws(() => boundedImageHeader(make('4000', '2001'), 'a'), { code: 'out-of-memory/budget' }, type);
  }
  const webp = bytesOf('52494646 00000000 57454250 56503858 0a000000 00000000 ffff00 ffff00');
  assert.throws(() => boundedImageHeader(webp, 'a'), /found 65536 x 65536/);
});

test('a grid of tiles has the size of the image, and a file that is cut or damaged has none', () => {
  const whole = avif();
  const at = Buffer.from(whole).indexOf('ispe') - 4;
  const tile = bytesOf('00000014 69737065 00000000 00000010 00000010');
  const grid = Buffer.concat([whole.subarray(0, at), tile, whole.subarray(at)]);
  for (const box of ['meta', 'iprp', 'ipco']) {
    const place = grid.indexOf(box) - 4;
    grid.writeUInt32BE(grid.readUInt32BE(place) + tile.length, place);
  }
  assert.deepEqual(boundedImageHeader(grid, 'a'), { type: 'image/avif', width: 40, height: 20 });
  for (let length = 0; length < at + 20; length++)
    assert.equal(boundedImageHeader(whole.subarray(0, length), 'a'), undefined, `${length} bytes`);
  const sequence = whole.slice();
  sequence.set(Buffer.from('avis'), 8);
  assert.equal(boundedImageHeader(sequence, 'a'), undefined);
  for (let i = 0; i < whole.length; i++) {
    const damaged = whole.slice();
    damaged[i] ^= 0x80;
    try {
      boundedImageHeader(damaged, 'a');
    } catch (error) {
      assert.equal((error as { code?: string }).code, 'out-of-memory/budget', `byte ${i}: ${error}`);
    }
  }
});
