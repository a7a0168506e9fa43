/** Models that have nothing more to compute give their weights back, and start again when they have. */
import { ImageTensor } from '@gaussian-splat/renderer';
import { Generator } from '@gaussian-splat/generator';
import { assert, assertEqual, delay, until } from '../../element/browser/support/harness.js';
import { itInLab } from '../../support/extent-in-pages.js';
import { FIXTURES, makeDevice, numbersOf, ReadingSink, RUNTIME } from './support.js';

const released = { count: 0 };
let device: GPUDevice;

before(async () => {
  device = await makeDevice();
  const { InferenceSession } = (await import(`${RUNTIME}ort.jspi.bundle.min.mjs`)) as {
    InferenceSession: { prototype: { release: () => unknown } };
  };
  const { release } = InferenceSession.prototype;
  InferenceSession.prototype.release = function countingRelease() {
    released.count++;
    return release.apply(this);
  };
});

/** The model, with 17 MB more in its file: a long description counts as weights do. */
async function large(name: string): Promise<string> {
  const model = await (await fetch(FIXTURES + name)).arrayBuffer();
  const size = 17 * 2 ** 20;
  // Field 6 of a ModelProto, `doc_string`; its length as a varint of four bytes.
  const head = Uint8Array.of(0x32, ...[0, 7, 14].map((shift) => ((size >> shift) & 0x7f) | 0x80), size >> 21);
  return `${URL.createObjectURL(new Blob([model, head, new Uint8Array(size).fill(32)]))}#${name}`;
}

function redOf(sink: ReadingSink, run: number): Promise<number> {
  return sink.runs[run].tensors.gaussians.then((bytes) => numbersOf(bytes, 'float32')[9]);
}

itInLab(
  'a large network of images is released at rest, a small one stays; the next image starts it again',
  async () => {
    const options = { onError: reportError, gpuCheck: false } as const;
    const [heavy, light] = await Promise.all(
      [await large('picture.onnx'), `${FIXTURES}picture.onnx`].map((url) => Generator.open({ url }, device, options)),
    );
    const sink = (heavy.sink = new ReadingSink(device));
    light.sink = new ReadingSink(device);
    const tensor = new ImageTensor(device, { width: 8, height: 8, dtype: 'float32' });
    const canvas = new OffscreenCanvas(8, 8);
    const context = canvas.getContext('2d')!;
    const ask = async (color: string): Promise<void> => {
      context.fillStyle = color;
      context.fillRect(0, 0, 8, 8);
      tensor.upload(canvas);
      for (const generator of [heavy, light]) {
        generator.request({ images: { image: tensor } });
        await generator.idle;
      }
    };
    await ask('#f00');
    assertEqual(released.count, 0, 'released while it may be used');
    await until(() => released.count > 0, 'release of the large one');
    await delay(300);
    assertEqual(released.count, 1, 'releases');
    await ask('#000');
    assertEqual([await redOf(sink, 0), await redOf(sink, 1)], [1, 0], 'red of both images');
    for (const generator of [heavy, light]) generator.close();
    tensor.destroy();
  },
);

it('a model without inputs runs once and is released', async () => {
  const before = released.count;
  const generator = await Generator.open({ url: '/tests/fixtures/families/classic.onnx' }, device, {
    onError: reportError,
    gpuCheck: false,
  });
  const sink = (generator.sink = new ReadingSink(device));
  generator.request({});
  await generator.idle;
  assert(sink.runs.length === 1 && generator.kind === 'webgpu', `${sink.runs.length} runs, ${generator.kind}`);
  await until(() => released.count > before, 'release');
  generator.close();
});
