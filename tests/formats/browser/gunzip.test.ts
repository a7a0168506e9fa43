/** SPZ is inflated by the browser, and each treats faulty gzip files in its own way. */
import { readScene } from '@gaussian-splat/formats';
import { assert, assertEqual } from '../../element/browser/support/harness.js';

/** Version 2 with `count` splats at (1, 1, -1), inflated. */
function inflatedSpz(count: number): Uint8Array<ArrayBuffer> {
  const bytes = new Uint8Array(16 + 19 * count).fill(128);
  bytes.set([...'NGSP'].map((letter) => letter.charCodeAt(0)));
  new DataView(bytes.buffer).setUint32(4, 2, true);
  new DataView(bytes.buffer).setUint32(8, count, true);
  bytes.set([0, 12, 0, 0], 12);
  for (let k = 0; k < 3 * count; k++) bytes.set([0, 16, 0], 16 + 3 * k);
  return bytes;
}

const gzipped = async (bytes: Uint8Array<ArrayBuffer>): Promise<Uint8Array> => {
  const stream = new Blob([bytes]).stream().pipeThrough(new CompressionStream('gzip'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
};

const joined = (...parts: readonly Uint8Array[]): Uint8Array => Uint8Array.from(parts.flatMap((part) => [...part]));

const codeOf = (file: Uint8Array): Promise<unknown> =>
  readScene(file, { name: 'a.spz' }).then(
    ({ count }) => count,
    ({ code }: { code: string }) => code,
  );

describe('a gzip file', () => {
  it('is read with any data after its end', async () => {
    const file = await gzipped(inflatedSpz(700));
    assertEqual(await codeOf(file), 700, 'without');
    for (const behind of [[0, 0, 0], [10], [...'junk'].map((letter) => letter.charCodeAt(0))]) {
      assertEqual(await codeOf(joined(file, Uint8Array.from(behind))), 700, `with ${behind.join()}`);
    }
  });

  it('of several members is read whole, and so is one of long runs with something behind', async () => {
    const content = inflatedSpz(700);
    const parts = [content.subarray(0, 5000), content.subarray(5000, 9000), content.subarray(9000)];
    const members = await Promise.all(parts.map((part) => gzipped(part.slice())));
    assertEqual(await codeOf(joined(...members)), 700, 'three members');
    assertEqual(await codeOf(joined(...members, Uint8Array.of(0, 0))), 700, 'and padding');
    assertEqual(await codeOf(joined(...members).subarray(0, -40)), 'decode/truncated', 'the last one is cut');
    // The content of one step is several pieces, which an error would drop.
    assertEqual(await codeOf(joined(await gzipped(inflatedSpz(70_000)), Uint8Array.of(10))), 70_000, 'long runs');
  });

  it('that is cut or damaged is refused', async () => {
    const file = await gzipped(inflatedSpz(700));
    assertEqual(await codeOf(file.subarray(0, -9)), 'decode/truncated', 'cut');
    assertEqual(await codeOf(file.subarray(0, -1)), 'decode/truncated', 'cut within its last numbers');
    const damaged = Uint8Array.from(file);
    damaged[file.length - 8] ^= 1;
    assertEqual(await codeOf(damaged), 'decode/corrupt', 'another checksum');
    const short = await gzipped(inflatedSpz(700).subarray(0, 5000));
    assert((await codeOf(joined(short, Uint8Array.of(1)))) === 'decode/truncated', 'too short, and something behind');
  });
});
