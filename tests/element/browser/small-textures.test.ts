/** WebGL 2 with the smallest textures that it guarantees, as browsers report them that hide the device: what the screen shows. */
import '@gaussian-splat/element';
import { itInLab } from '../../support/extent-in-pages.js';
import { assert, assertEqual, atRest, showLoaded } from './support/harness.js';
import { screenOf, type Screen } from './support/screen.js';

const MAX_SIZE = 2048;
const LOOK = { 'camera-orbit': '0deg 90deg 5m', 'interpolation-decay': '0', 'interaction-prompt': 'none' };

let largest = 0;
const { getParameter, texStorage2D } = WebGL2RenderingContext.prototype;
WebGL2RenderingContext.prototype.getParameter = function (this: WebGL2RenderingContext, name: number): unknown {
  return name === this.MAX_TEXTURE_SIZE ? MAX_SIZE : getParameter.call(this, name);
};
WebGL2RenderingContext.prototype.texStorage2D = function (this: WebGL2RenderingContext, ...args) {
  largest = Math.max(largest, args[3], args[4]);
  texStorage2D.apply(this, args);
};

/** Returns the address of a wall of splats, four meters wide, with a color for each quarter. */
function wallOf(columns: number, rows: number): string {
  const bytes = new DataView(new ArrayBuffer(32 * columns * rows));
  for (let i = 0; i < columns * rows; i++) {
    const [u, v] = [((i % columns) + 0.5) / columns - 0.5, (Math.floor(i / columns) + 0.5) / rows - 0.5];
    [4 * u, 4 * v, 0, 2 / columns, 2 / rows, 0.002].forEach((value, k) =>
      bytes.setFloat32(32 * i + 4 * k, value, true),
    );
    [u > 0 ? 220 : 30, v > 0 ? 220 : 30, 90, 255, 255, 128, 128, 128].forEach((value, k) =>
      bytes.setUint8(32 * i + 24 + k, value),
    );
  }
  return `${URL.createObjectURL(new Blob([bytes.buffer]))}#wall.splat`;
}

async function screenWith(src: string, renderer: string, splats: number): Promise<Screen> {
  const element = await showLoaded({ src, renderer, ...LOOK }, 'width: 100px; height: 80px');
  await atRest(element);
  assertEqual([element.stats?.renderer, element.stats?.splats], [renderer, splats], 'the scene');
  const screen = await screenOf(element);
  element.remove();
  return screen;
}

describe(`textures of ${MAX_SIZE} texels a side`, () => {
  for (const [columns, rows] of [
    [40, 40],
    [1000, 500],
  ])
    (columns === 40 ? it : itInLab)(`show ${columns * rows} splats as WebGPU does`, async () => {
      largest = 0;
      const src = wallOf(columns, rows);
      const [small, whole] = [
        await screenWith(src, 'webgl', columns * rows),
        await screenWith(src, 'webgpu', columns * rows),
      ];
      assert(largest > 200 && largest <= MAX_SIZE, `the largest texture has ${largest} texels a side`);
      const quarters = [
        [25, 20],
        [75, 20],
        [25, 60],
        [75, 60],
      ].map(([x, y]) =>
        small
          .at(x, y)
          .map((value) => value > 128)
          .join(),
      );
      assertEqual(new Set(quarters).size, 4, 'colors of the quarters');
      const differences = small.differences(whole, 3);
      assert(differences < 0.002 * 4 * 100 * 80, `${differences} values differ from WebGPU's`);
    });
});
