/** The environment behind a scene: positions of its colors, with both renderers, in saved images, and its errors. */
import '@gaussian-splat/element';
import { GaussianSplatElement } from '@gaussian-splat/element';
import { holdings } from './support/ledger.js';
import {
  assert,
  assertEqual,
  atRest,
  claimComing,
  COMPASS,
  delay,
  showLoaded,
  submits,
  until,
} from './support/harness.js';
import { comesToShow, isBlue, isGreen, isRed, screenOf, type Rgb } from './support/screen.js';

const STYLE = 'width: 160px; height: 120px';
const VIEW = { alt: 'A compass', 'camera-target': '0m 0m 0m', 'field-of-view': '40deg', 'interaction-prompt': 'none' };
const isBlack = ([r, g, b]: Rgb): boolean => r + g + b < 40;

/** Four columns, red, green, blue and white, above a black ground. */
async function skyUrl(): Promise<string> {
  const canvas = new OffscreenCanvas(64, 32);
  const context = canvas.getContext('2d')!;
  ['red', 'lime', 'blue', 'white'].forEach((color, i) => {
    context.fillStyle = color;
    context.fillRect(16 * i, 0, 16, 32);
  });
  context.fillStyle = 'black';
  context.fillRect(0, 24, 64, 8);
  return URL.createObjectURL(await canvas.convertToBlob());
}

const load = async (more: Readonly<Record<string, string>> = {}): Promise<GaussianSplatElement> =>
  showLoaded({ src: COMPASS, ...VIEW, 'skybox-image': await skyUrl(), 'interpolation-decay': '0', ...more }, STYLE);

/** Corners of the image, without splats. */
const cornersOf = async (element: Element): Promise<Rgb[]> => {
  const screen = await screenOf(element);
  return [screen.at(3, 3), screen.at(156, 3), screen.at(3, 116), screen.at(156, 116)];
};

for (const renderer of ['webgpu', 'webgl'])
  describe(`a sky with ${renderer}`, () => {
    it('lies where the camera looks, behind the splats, and costs nothing at rest', async () => {
      const element = await load({ renderer, 'camera-orbit': '45deg 90deg 12m' });
      const shows = (orbit: string, is: (color: Rgb) => boolean, ys = [3, 116]): Promise<boolean> => {
        element.cameraOrbit = orbit;
        return comesToShow(element, (screen) => ys.every((y) => is(screen.at(3, y)) && is(screen.at(156, y))));
      };
      assert(await shows('45deg 90deg 12m', isRed), `red: ${JSON.stringify(await cornersOf(element))}`);
      assert(await shows('-45deg 90deg 12m', isGreen), `green: ${JSON.stringify(await cornersOf(element))}`);
      assert(await shows('-135deg 90deg 12m', isBlue), `blue: ${JSON.stringify(await cornersOf(element))}`);
      assert(await shows('0deg 23deg 12m', isBlack, [116]), `the ground: ${JSON.stringify(await cornersOf(element))}`);
      const center = (await screenOf(element)).at(80, 60);
      assert(!isBlack(center), `the compass before the ground: ${center.join()}`);
      await atRest(element);
      const before = submits;
      await delay(300);
      assertEqual(submits - before, 0, 'frames at rest');
      element.skyboxImage = null;
      await element.updateComplete;
      assert(await comesToShow(element, (screen) => !isBlack(screen.at(3, 116))), 'the sky goes with its attribute');
    });

    it('is in saved images, and behind parallel rays', async () => {
      const element = await load({ renderer, 'camera-orbit': '45deg 90deg 12m', orthographic: '' });
      assert(await comesToShow(element, (screen) => isRed(screen.at(3, 3))), 'red on the screen');
      const image = await createImageBitmap(await element.toBlob({ background: 'white' }));
      const context = new OffscreenCanvas(image.width, image.height).getContext('2d')!;
      context.drawImage(image, 0, 0);
      const [r, g, b, a] = context.getImageData(2, 2, 1, 1).data;
      assert(isRed([r, g, b]) && a === 255, `red in the image: ${[r, g, b, a].join()}`);
    });
  });

describe('a sky that cannot be', () => {
  it('is named in a warning, and the scene is shown', async () => {
    const element = await load({ 'skybox-image': '/tests/element/browser/fixtures/none.jpg' });
    await claimComing(/skybox-image: expected an image at/);
    assertEqual(element.loaded, true, 'loaded');
  });

  it('is refused before it is decoded if it has too many pixels, or a header without them', async () => {
    const decode = globalThis.createImageBitmap;
    let decoded = 0;
    globalThis.createImageBitmap = ((image: ImageBitmapSource, options?: ImageBitmapOptions) => {
      if (image instanceof Blob) decoded++;
      return decode(image, options);
    }) as typeof decode;
    try {
      // A PNG of 40,000 x 40,000 pixels, 6.4 GB after decoding.
      const png = Uint8Array.of(0x89, 0x50, 0x4e, 0x47, 13, 10, 26, 10, 0, 0, 0, 13, 0x49, 0x48, 0x44, 0x52);
      const size = [0, 0, 0x9c, 0x40, 0, 0, 0x9c, 0x40, 8, 6, 0, 0, 0];
      const urlOf = (...parts: BlobPart[]): string => URL.createObjectURL(new Blob(parts));
      const element = await load({ 'skybox-image': urlOf(png, Uint8Array.from(size)) });
      await claimComing(/skybox-image: .*at most 134,217,728 pixels, found 40000 x 40000/);
      element.skyboxImage = urlOf('GIF89a', new Uint8Array(100));
      await claimComing(/skybox-image: expected a JPEG, PNG, WebP or AVIF image/);
      assertEqual([element.loaded, decoded], [true, 0], 'loaded, decoded images');
    } finally {
      globalThis.createImageBitmap = decode;
    }
  });
});

it('a sky and a shadow leave the GPU with their element', async () => {
  const { releaseDelay } = GaussianSplatElement;
  GaussianSplatElement.releaseDelay = 0;
  try {
    // It keeps the device.
    await atRest(await showLoaded());
    const before = holdings().objects;
    const element = await load({ 'shadow-intensity': '1', 'camera-orbit': '45deg 60deg 12m' });
    await atRest(element, 1_500);
    assert(holdings().objects > before, 'they are on the GPU');
    element.remove();
    await until(() => holdings().objects <= before, 'their memory to be free', 1_000);
  } finally {
    GaussianSplatElement.releaseDelay = releaseDelay;
  }
});
