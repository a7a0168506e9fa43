/** Images as tensors, post-processors and chains, from GPU buffer to GPU buffer. */
import { DynamicGaussians, FilteredFrame, ImageTensor, type ImageFit } from '@gaussian-splat/renderer';
import { Generator, PostProcessor } from '@gaussian-splat/generator';
import { assert, assertEqual } from '../../element/browser/support/harness.js';
import {
  calls,
  codeOf,
  dispatches,
  FIXTURES,
  makeDevice,
  numbersOf,
  readBuffer,
  ReadingSink,
  relativeError,
  runOnCpu,
} from './support.js';

let device: GPUDevice;

/** An image of smooth colors and one hard edge, opaque. */
function colorful(width: number, height: number): Uint8ClampedArray<ArrayBuffer> {
  const pixels = new Uint8ClampedArray(4 * width * height);
  for (let i = 0; i < width * height; i++) {
    const [x, y] = [i % width, Math.floor(i / width)];
    pixels.set([(255 * x) / width, (255 * y) / height, 3 * x > width ? 255 : 0, 255], 4 * i);
  }
  return pixels;
}

/** The same resampling in plain numbers: triangular weights, pixel by pixel. */
function resampled(
  pixels: ArrayLike<number>,
  [width, height]: readonly [number, number],
  [columns, rows]: readonly [number, number],
  fit: ImageFit,
): number[] {
  const steps = [width / columns, height / rows];
  const step = fit === 'cover' ? [Math.min(...steps), Math.min(...steps)] : steps;
  const corner = [(width - step[0] * columns) / 2, (height - step[1] * rows) / 2];
  const weights = (index: number, axis: 0 | 1): number[] => {
    const center = corner[axis] + (index + 0.5) * step[axis];
    const size = axis === 0 ? width : height;
    const found = Array.from({ length: size }, (_, k) =>
      Math.max(0, 1 - Math.abs(k + 0.5 - center) / Math.max(1, step[axis])),
    );
    const sum = found.reduce((total, weight) => total + weight, 0);
    return found.map((weight) => weight / sum);
  };
  return [0, 1, 2].flatMap((channel) =>
    Array.from({ length: rows }, (_, y) => weights(y, 1)).flatMap((down) =>
      Array.from({ length: columns }, (_, x) => weights(x, 0)).map((across) => {
        let sum = 0;
        down.forEach((dy, y) =>
          across.forEach((dx, x) => (sum += dy * dx ? (dy * dx * pixels[4 * (y * width + x) + channel]) / 255 : 0)),
        );
        return sum;
      }),
    ),
  );
}

async function tensorOf(width: number, height: number, shape: ImageTensor['shape'], fit?: ImageFit) {
  const tensor = new ImageTensor(device, shape);
  const pixels = colorful(width, height);
  tensor.upload(await createImageBitmap(new ImageData(pixels, width, height)), fit);
  return { tensor, pixels };
}

/** 8 x 8 pixels of one gray. */
const plainImage = (gray: number): Promise<ImageBitmap> =>
  createImageBitmap(
    new ImageData(
      colorful(8, 8)
        .fill(gray)
        .map((x, i) => (i % 4 === 3 ? 255 : x)),
      8,
      8,
    ),
  );

before(async () => {
  device = await makeDevice();
});

describe('an image as a tensor', () => {
  for (const [from, to, fit, dtype] of [
    [[16, 12], [16, 12], 'stretch', 'float32'],
    [[40, 20], [8, 8], 'cover', 'float32'],
    [[40, 20], [8, 8], 'stretch', 'float32'],
    [[9, 31], [7, 5], 'cover', 'float16'],
    [[5, 4], [11, 13], 'cover', 'float32'],
  ] as const) {
    it(`${from.join('x')} to ${to.join('x')}, ${fit}, ${dtype}`, async () => {
      const { tensor, pixels } = await tensorOf(from[0], from[1], { width: to[0], height: to[1], dtype }, fit);
      const found = numbersOf(await readBuffer(device, tensor.buffer), dtype).slice(0, 3 * to[0] * to[1]);
      const error = relativeError(found, resampled(pixels, from, to, fit));
      assert(error < (dtype === 'float16' ? 1e-3 : 1e-5), `relative error ${error}`);
      tensor.destroy();
    });
  }

  it('without pixels is refused', () => {
    const tensor = new ImageTensor(device, { width: 8, height: 8, dtype: 'float32' });
    let code = 'none';
    try {
      tensor.upload(new Image());
    } catch (error) {
      code = (error as { code: string }).code;
    }
    assertEqual(code, 'argument/value');
    tensor.destroy();
  });
});

describe('a post-processor', () => {
  for (const [name, width, height, dtype, kind] of [
    ['post.onnx', 21, 13, 'float32', 'webgpu'],
    ['post-fixed.onnx', 48, 32, 'float32', 'captured'],
    // Float16 without the device feature runs on the CPU: the image is read back and uploaded again.
    ['post-half.onnx', 9, 7, 'float16', 'wasm'],
  ] as const) {
    it(`${name}: its result for an image, twice, and no run for the same one again`, async () => {
      const images: number[][] = [];
      const reading: Promise<void>[] = [];
      const errors: unknown[] = [];
      const post = await PostProcessor.open({ url: FIXTURES + name }, device, {
        onError: (error) => errors.push(error),
        onImage: ({ buffer, dims }) => {
          assertEqual(dims, [1, 3, height, width], 'shape');
          const i = images.push([]) - 1;
          reading.push(readBuffer(device, buffer).then((bytes) => void (images[i] = numbersOf(bytes, dtype))));
        },
      });
      const { tensor, pixels } = await tensorOf(width, height, { width, height, dtype });
      for (const gain of [0.5, 0.25, 0.25]) {
        post.request(tensor, { controls: { gain } });
        await post.idle;
      }
      await Promise.all(reading);
      assertEqual(errors.map(String), [], 'errors');
      assertEqual([images.length, post.isBusy], [2, false], 'runs');
      if (!device.features.has('shader-f16')) assertEqual(post.kind, kind, 'kind');
      const plain = resampled(pixels, [width, height], [width, height], 'stretch');
      for (const [i, gain] of [0.5, 0.25].entries()) {
        const expected = plain.map((x) => gain * x);
        const error = relativeError(images[i].slice(0, expected.length), expected);
        assert(error < (dtype === 'float16' ? 2e-3 : 1e-5), `gain ${gain}: relative error ${error}`);
      }
      post.close();
      tensor.destroy();
    });
  }

  it('is not recorded if a recording would show the first image for ever', async () => {
    const reading: Promise<Uint8Array>[] = [];
    const post = await PostProcessor.open({ url: `${FIXTURES}filter-copied.onnx` }, device, {
      onError: reportError,
      onImage: ({ buffer }) => reading.push(readBuffer(device, buffer)),
    });
    const tensor = new ImageTensor(device, { width: 8, height: 8, dtype: 'float32' });
    for (const gray of [255, 51, 0]) {
      tensor.upload(await plainImage(gray));
      post.request(tensor);
      await post.idle;
    }
    const found = (await Promise.all(reading)).map((bytes) => Math.round(510 * numbersOf(bytes, 'float32')[100]));
    assertEqual(found, [255, 51, 0], 'half of each image');
    post.close();
    tensor.destroy();
  });

  it('that keeps a state runs again for the same image until it has converged', async () => {
    const reading: Promise<Uint8Array>[] = [];
    const post = await PostProcessor.open({ url: `${FIXTURES}post-temporal.onnx` }, device, {
      onError: reportError,
      gpuCheck: false,
      onImage: ({ buffer }) => reading.push(readBuffer(device, buffer)),
    });
    const { tensor, pixels } = await tensorOf(32, 24, { width: 32, height: 24, dtype: 'float32' });
    for (let i = 0; i < 40; i++) {
      post.request(tensor);
      await post.idle;
    }
    const expected = resampled(pixels, [32, 24], [32, 24], 'stretch');
    const errorOf = async (run: number): Promise<number> =>
      relativeError(numbersOf(await reading[run], 'float32').slice(0, expected.length), expected);
    assertEqual(reading.length, 33, 'runs');
    const [first, last] = [await errorOf(0), await errorOf(32)];
    assert(first > 0.79 && last < 1e-3, `relative error ${first} of the first run, ${last} of the last`);
    post.close();
    tensor.destroy();
  });

  it('makes no buffer and reads nothing back once it is warm', async () => {
    const frame = new FilteredFrame(device, 48, 32);
    let images = 0;
    const post = await PostProcessor.open({ url: `${FIXTURES}post-fixed.onnx` }, device, {
      onImage: ({ buffer, dims }) => {
        frame.accept({ buffer, dims, dtype: 'float32' });
        images++;
      },
    });
    const next = async (): Promise<void> => {
      post.request(frame.handOver({ width: 48, height: 32, dtype: 'float32' }));
      await post.idle;
    };
    for (let i = 0; i < 3; i++) await next();
    const earlier = { ...calls };
    for (let i = 0; i < 20; i++) await next();
    assertEqual(images, 23, 'pictures');
    assertEqual({ ...calls }, earlier, 'calls of 20 runs');
    post.close();
    frame.destroy();
  });

  it('one after the other: each takes the image of the previous one', async () => {
    let image: Promise<Uint8Array> | undefined;
    const urls = ['post.onnx', 'post-fixed.onnx', 'post.onnx'].map((name) => ({ url: FIXTURES + name }));
    const open = PostProcessor.open(urls, device, {
      onImage: ({ buffer }) => (image = readBuffer(device, buffer)),
    });
    // A model of any size cannot feed one of a fixed size.
    assertEqual(await codeOf(open), 'contract/chain');
    const post = await PostProcessor.open(urls.slice(1), device, {
      onImage: ({ buffer }) => (image = readBuffer(device, buffer)),
    });
    const { tensor, pixels } = await tensorOf(48, 32, { width: 48, height: 32, dtype: 'float32' });
    post.request(tensor, { controls: { gain: 0.5 } });
    await post.idle;
    assert(image, 'an image');
    const found = numbersOf(await image, 'float32').slice(0, 3 * 48 * 32);
    const expected = resampled(pixels, [48, 32], [48, 32], 'stretch').map((x) => 0.25 * x);
    assert(relativeError(found, expected) < 1e-5, 'a quarter');
    post.close();
    tensor.destroy();
  });

  it('is none that writes Gaussians, takes Gaussians, or takes no image', async () => {
    const found: Record<string, string> = {};
    for (const name of ['packed.onnx', 'link-fixed.onnx', 'picture.onnx']) {
      found[name] = await codeOf(PostProcessor.open({ url: FIXTURES + name }, device, { onImage: () => undefined }));
    }
    assertEqual(Object.values(found), ['contract/chain', 'contract/chain', 'contract/chain']);
  });
});

describe('Gaussians made from an image', () => {
  it('are those of the CPU, computed again for another image, and a missing image is named', async () => {
    const generator = await Generator.open({ url: `${FIXTURES}picture.onnx` }, device, { onError: reportError });
    const sink = (generator.sink = new ReadingSink(device));
    let code = 'none';
    try {
      generator.request({});
    } catch (error) {
      code = (error as { code: string }).code;
    }
    assertEqual(code, 'argument/value');
    const { tensor, pixels } = await tensorOf(24, 16, { width: 8, height: 8, dtype: 'float32' }, 'cover');
    const ask = async (): Promise<void> => {
      generator.request({ images: { image: tensor } });
      await generator.idle;
    };
    await ask();
    await ask();
    assertEqual(sink.runs.length, 1, 'runs for one image');
    const rows = numbersOf(await sink.runs[0].tensors.gaussians, 'float32');
    const planes = resampled(pixels, [24, 16], [8, 8], 'cover');
    const colors = Array.from({ length: 64 }, (_, i) => [0, 1, 2].map((c) => rows[13 * i + 9 + c])).flat();
    const expected = Array.from({ length: 64 }, (_, i) => [0, 1, 2].map((c) => planes[64 * c + i])).flat();
    assert(relativeError(colors, expected) < 1e-5, `colors: ${relativeError(colors, expected)}`);
    tensor.upload(await createImageBitmap(new ImageData(colorful(8, 8).fill(255), 8, 8)));
    await ask();
    const white = numbersOf(await sink.runs[1].tensors.gaussians, 'float32');
    assertEqual([white[9], white[10], white[11]], [1, 1, 1], 'white');
    generator.close();
    tensor.destroy();
  });

  it('take one run for the first image and one for each other: no run proves a recording', async () => {
    const generator = await Generator.open({ url: `${FIXTURES}picture.onnx` }, device, {
      onError: reportError,
      gpuCheck: false,
    });
    const sink = (generator.sink = new ReadingSink(device));
    const tensor = new ImageTensor(device, { width: 8, height: 8, dtype: 'float32' });
    const counts: number[] = [];
    for (const gray of [255, 51, 0]) {
      tensor.upload(await plainImage(gray));
      const before = dispatches.count;
      generator.request({ images: { image: tensor } });
      await generator.idle;
      counts.push(dispatches.count - before);
    }
    assertEqual([generator.kind, sink.runs.length], ['webgpu', 3], 'kind, runs');
    const [first, second, third] = counts;
    assert(second > 0 && second === third, `dispatches of later runs: ${second}, ${third}`);
    assert(first <= 1.3 * second, `${first} dispatches until the first frame, of ${second} in a run`);
    generator.close();
    tensor.destroy();
  });

  it('are computed again if their rows get their shape last of all', async () => {
    const generator = await Generator.open({ url: `${FIXTURES}picture-copied.onnx` }, device, { onError: reportError });
    const sink = (generator.sink = new ReadingSink(device));
    const tensor = new ImageTensor(device, { width: 8, height: 8, dtype: 'float32' });
    for (const gray of [255, 51, 0]) {
      tensor.upload(await plainImage(gray));
      generator.request({ images: { image: tensor } });
      await generator.idle;
    }
    const rows = await Promise.all(sink.runs.map(({ tensors }) => tensors.gaussians));
    const found = rows.map((bytes) => Math.round(255 * numbersOf(bytes, 'float32')[10]));
    assertEqual(found, [255, 51, 0], 'colors of each image');
    generator.close();
    tensor.destroy();
  });
});

describe('a chain', () => {
  for (const link of ['link-fixed.onnx', 'link.onnx']) {
    it(`ball, then ${link}: the second takes what the first wrote, on the GPU`, async () => {
      const urls = ['packed.onnx', link].map((name) => ({ url: FIXTURES + name }));
      const generator = await Generator.open(urls, device, { onError: reportError });
      const sink = (generator.sink = new ReadingSink(device));
      const states = [
        { timeSeconds: 0.4, controls: { lift: 0.25 } },
        { timeSeconds: 1.1, controls: { lift: 0.25 } },
        { timeSeconds: 1.1, controls: { lift: -1 } },
      ];
      for (const state of states) {
        generator.request(state);
        await generator.idle;
      }
      const isFixed = link === 'link-fixed.onnx';
      // The other link has no control: for it the last two states are the same.
      assertEqual([sink.runs.length, generator.models.length], [isFixed ? 3 : 2, 2], 'runs');
      assertEqual(generator.kind, isFixed ? 'captured' : 'webgpu', 'kind');
      for (const [i, run] of sink.runs.entries()) {
        const { timeSeconds, controls } = states[i];
        const ball = (await runOnCpu(`${FIXTURES}packed.onnx`, { timeSeconds })).gaussians.values;
        const expected = ball.map((x, k) => (isFixed && k % 13 === 1 ? x + controls.lift : x));
        const error = relativeError(numbersOf(await run.tensors.gaussians, 'float32').slice(0, 64 * 13), expected);
        assert(run.rows === 64 && error < 1e-3, `run ${i}: ${run.rows} rows, relative error ${error}`);
      }
      generator.close();
    });
  }

  it('makes no buffer and reads nothing back once it is warm', async () => {
    const urls = ['packed.onnx', 'link-fixed.onnx', 'link-fixed.onnx'].map((name) => ({ url: FIXTURES + name }));
    const generator = await Generator.open(urls, device, { onError: reportError });
    const gaussians = await DynamicGaussians.create(device, generator.model.layout);
    generator.sink = gaussians;
    const at = async (timeSeconds: number): Promise<void> => {
      generator.request({ timeSeconds });
      await generator.idle;
    };
    for (let i = 0; i < 3; i++) await at(i);
    const earlier = { ...calls };
    for (let i = 3; i < 23; i++) await at(i);
    assertEqual([generator.runs, { ...calls }], [23, earlier], 'runs and calls');
    generator.close();
    gaussians.destroy();
  });

  it('whose first model writes more rows than it declares: contract/rows, and nothing is handed on', async () => {
    const errors: unknown[] = [];
    const urls = ['faulty-rows.onnx', 'link.onnx'].map((name) => ({ url: FIXTURES + name }));
    const generator = await Generator.open(urls, device, { onError: (error) => errors.push(error) });
    const sink = (generator.sink = new ReadingSink(device));
    device.pushErrorScope('validation');
    for (const timeSeconds of [0, 1]) {
      generator.request({ timeSeconds });
      await generator.idle;
    }
    assertEqual(await device.popErrorScope(), null, 'errors of the GPU');
    assertEqual(sink.runs.length, 0, 'runs');
    assertEqual(
      errors.map((error) => (error as { code: string }).code),
      ['contract/rows', 'contract/rows'],
    );
    assert(/at most 10 rows.*64/.test(String(errors[0])), String(errors[0]));
    generator.close();
  });

  it('whose models do not fit is refused before the runtime is asked', async () => {
    const cases: Readonly<Record<string, readonly string[]>> = {
      'another activation': ['packed.onnx', 'link-logit.onnx'],
      'another layout': ['split.onnx', 'link-fixed.onnx'],
      'rows that may change into rows that may not': ['link.onnx', 'link-fixed.onnx'],
      'the wrong way round': ['link-fixed.onnx', 'packed.onnx'],
      'two that make Gaussians': ['packed.onnx', 'packed.onnx'],
      'an image in the end': ['packed.onnx', 'post.onnx'],
      'a count of rows that gets lost': ['faulty-values.onnx', 'link-fixed.onnx'],
    };
    for (const [name, files] of Object.entries(cases)) {
      const urls = files.map((file) => ({ url: FIXTURES + file }));
      assertEqual(await codeOf(Generator.open(urls, device)), 'contract/chain', name);
    }
  });
});
