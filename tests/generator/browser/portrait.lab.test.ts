/** The portrait of the gallery: its photograph becomes a relief whose face is in front of its wall, with its colors. */
import { ImageTensor } from '@gaussian-splat/renderer';
import { Generator } from '@gaussian-splat/generator';
import { assert, assertEqual } from '../../element/browser/support/harness.js';
import { CAMERA, numbersOf, ReadingSink } from './support.js';

const FOLDER = '/demo/generators/portrait/';
const GRID = 96;

it('the photograph of the gallery becomes a relief', async () => {
  // As pages have it: on a software GPU, the model runs on the CPU.
  const device = await (await navigator.gpu.requestAdapter())!.requestDevice();
  const problems: unknown[] = [];
  const generator = await Generator.open({ url: `${FOLDER}model.onnx` }, device, {
    gpuCheck: false,
    onError: (error) => problems.push(error),
    onFallback: (reason) => console.log(reason),
  });
  const sink = (generator.sink = new ReadingSink(device));
  const image = new ImageTensor(device, { width: 256, height: 256, dtype: 'float32' });
  image.upload(await createImageBitmap(await (await fetch(`${FOLDER}image.png`)).blob()));
  const start = performance.now();
  generator.request({ camera: CAMERA, images: { image } });
  await generator.idle;
  console.log(`${generator.kind}: first run in ${Math.round(performance.now() - start)} ms`);
  assertEqual([problems.map(String), sink.runs.length], [[], 1], 'errors, and runs');
  const positions = numbersOf(await sink.runs[0].tensors.positions, 'float32').slice(0, 3 * GRID * GRID);
  assert(positions.every(Number.isFinite), 'finite positions');
  const depthAt = (x: number, y: number): number =>
    positions[3 * (Math.round(y * (GRID - 1)) * GRID + Math.round(x * (GRID - 1))) + 2];
  const depths = positions.filter((_, i) => i % 3 === 2);
  const nearest = depths.indexOf(Math.min(...depths));
  const [x, y] = [(nearest % GRID) / GRID, Math.floor(nearest / GRID) / GRID];
  console.log(`the nearest point is at ${x.toFixed(2)}, ${y.toFixed(2)}`);
  assert(x > 0.35 && x < 0.7 && y > 0.15 && y < 0.55, `the nearest point is at ${x}, ${y}, not on the nose`);
  assert(depthAt(0.02, 0.02) > depthAt(x, y) + 0.1, 'the wall is behind the nose');
  generator.close();
});
