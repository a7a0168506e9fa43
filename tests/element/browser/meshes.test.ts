/** Triangle meshes among scenes: `<splat-mesh>` children, and glTF files that hold both. */
import '@gaussian-splat/element/scenes.js';
import { GaussianSplatElement } from '@gaussian-splat/element';
import type { SplatMeshElement, SplatSceneElement } from '@gaussian-splat/element/scenes.js';
import { isLab, itInLab } from '../../support/extent-in-pages.js';
import { boxGlb, type BoxOptions } from './support/glb.js';
import { holdings } from './support/ledger.js';
import { assert, assertEqual, COMPASS, delay, devices, FIXTURES, frames, nextEvent, until } from './support/harness.js';
import { comesToShow, isBlue, isGreen, isRed, screenOf, type Rgb } from './support/screen.js';

const GREEN = `${FIXTURES}green.splat`;
const VIEW = {
  'camera-orbit': '0deg 90deg 10m',
  'camera-target': '0 0 0',
  'field-of-view': '45deg',
  quality: 'default',
};
const METER = 50 / Math.tan(Math.PI / 8) / 10;

function place(attributes: Readonly<Record<string, string>> = {}): GaussianSplatElement {
  const element = document.createElement('gaussian-splat');
  for (const [name, value] of Object.entries({ ...VIEW, ...attributes })) element.setAttribute(name, value);
  element.style.cssText = 'display: block; width: 120px; height: 100px';
  document.body.append(element);
  return element;
}

function mesh(options: BoxOptions, attributes: Readonly<Record<string, string>> = {}): SplatMeshElement {
  const child = document.createElement('splat-mesh') as SplatMeshElement;
  child.src = boxGlb(options);
  for (const [name, value] of Object.entries(attributes)) child.setAttribute(name, value);
  return child;
}

const placeOf = async (element: Element, isPicked: (color: Rgb) => boolean): Promise<number[] | null> => {
  const middle = (await screenOf(element)).middleOf(isPicked);
  return middle && [(middle.x - 60) / METER, (50 - middle.y) / METER];
};

function assertNear(
  actual: readonly number[] | null,
  expected: readonly number[],
  what: string,
  tolerance = 0.15,
): void {
  const isNear = actual?.every((value, k) => Math.abs(value - expected[k]) <= tolerance);
  assert(isNear, `${what}: expected ${expected.join()}, found ${actual?.map((v) => v.toFixed(2)).join() ?? 'nothing'}`);
}

describe('meshes', () => {
  itInLab('alone, draw no empty batch of splats, which would cause a warning', async () => {
    const drawIndexed = GPURenderPassEncoder.prototype.drawIndexed;
    const counts: (number | undefined)[] = [];
    GPURenderPassEncoder.prototype.drawIndexed = function watching(...args) {
      counts.push(args[1]);
      drawIndexed.apply(this, args);
    };
    try {
      const element = place();
      element.append(mesh({ color: [0, 0, 1] }));
      await element.ready;
      await comesToShow(element, (screen) => isBlue(screen.at(60, 50)));
      assertEqual([counts.includes(0), counts.length > 0], [false, true], `instances: ${counts.join()}`);
    } finally {
      GPURenderPassEncoder.prototype.drawIndexed = drawIndexed;
    }
  });

  it('stand where their attributes say, and hide splats as these hide them', async () => {
    const element = place();
    const ball = document.createElement('splat-scene') as SplatSceneElement;
    ball.setAttribute('src', GREEN);
    ball.setAttribute('scale', '2');
    const behind = mesh({ color: [0, 0, 1], half: [1, 1, 0.1] }, { position: '2 0 -3' });
    const before = mesh({ half: [0.2, 0.2, 0.1] }, { position: '0 0 3m' });
    element.append(ball, behind, before);
    await until(() => ball.loaded && behind.loaded && before.loaded, `all three, with ${behind.error?.message ?? ''}`);
    await comesToShow(element, (screen) => isGreen(screen.at(60 - 0.5 * METER, 50)));
    const screen = await screenOf(element);
    const at = (x: number): Rgb => screen.at(60 + x * METER, 50);
    assert(isRed(at(0)), `the near box hides the ball: ${at(0).join()}`);
    assert(isGreen(at(-0.5)), `beside it the ball: ${at(-0.5).join()}`);
    // A meter is 10/13 as long as far away.
    assert(isGreen(at(0.9)), `before the far box is the ball: ${at(0.9).join()}`);
    assert(isBlue(at(2.15)), `the far box beside the ball: ${at(2.15).join()}`);
    const color = (await screenOf(element)).at(60, 50);
    assert(color[0] > 230 && color[1] < 60 && color[2] < 60, `its own color: ${color.join()}`);
    before.remove();
    await frames();
    assert(isGreen((await screenOf(element)).at(60, 50)), 'taken away');
    behind.rotation = [0, Math.PI / 2, 0];
    await behind.updateComplete;
    await frames();
    assert(!isBlue((await screenOf(element)).at(60 + 2.15 * METER, 50)), 'turned to its edge');
  });

  it('are layers of the frame: edges show the splats behind them, and so does glass', async () => {
    const element = place();
    const ball = document.createElement('splat-scene') as SplatSceneElement;
    ball.setAttribute('src', GREEN);
    ball.setAttribute('scale', '40');
    const black = mesh(
      { surface: 'unlit', color: [0, 0, 0], half: [0.6, 0.6, 0.1] },
      { position: '-0.9 0 3', rotation: '0 0 17deg' },
    );
    const before = mesh(
      { surface: 'unlit', color: [1, 0, 0], alpha: 0.5, half: [0.3, 0.3, 0.05] },
      { position: '0.9 0.5 3' },
    );
    const behind = mesh(
      { surface: 'unlit', color: [1, 0, 0], alpha: 0.5, half: [0.3, 0.3, 0.05] },
      { position: '0.9 -0.5 -6' },
    );
    element.append(ball, black, before, behind);
    await until(() => [ball, black, before, behind].every(({ loaded }) => loaded), 'all');
    await frames();
    const screen = await screenOf(element);
    const near = (x: number, y: number): Rgb => screen.at(60 + (x * METER * 10) / 7, 50 - (y * METER * 10) / 7);
    const green = screen.at(60, 50);
    assert(isGreen(green), `the ball: ${green.join()}`);
    assert(Math.max(...near(-0.9, 0)) <= 1, `the black box: ${near(-0.9, 0).join()}`);
    // Nothing but black and the green behind is in the edges: no page.
    for (let x = -1.9; x < 0; x += 0.02)
      for (let y = -0.7; y < 0.7; y += 0.02) {
        const found = near(x, y);
        assert(found[0] <= green[0] + 12 && found[2] <= green[2] + 12, `at ${x}, ${y}: ${found.join()}`);
      }
    const through = near(0.9, 0.5);
    const mixed = [0, 1, 2].map((k) => 0.5 * green[k] + (k === 0 ? 127.5 : 0));
    assert(
      through.every((value, k) => Math.abs(value - mixed[k]) <= 14),
      `through glass: ${through.join()} for ${mixed.join()}`,
    );
    const hidden = screen.at(60 + (0.9 * METER * 10) / 16, 50 + (0.5 * METER * 10) / 16);
    assert(hidden[0] <= green[0] + 12, `glass behind the ball: ${hidden.join()}`);
  });

  itInLab('of glass show those behind them, in the order of their depth and not of their loading', async () => {
    const element = place();
    const pane = (color: readonly [number, number, number], position: string): SplatMeshElement =>
      mesh({ surface: 'unlit', color, alpha: 0.5, half: [0.4, 0.4, 0.01] }, { position });
    const box = mesh({ surface: 'unlit', color: [0, 0, 1], half: [3, 3, 0.1] }, { position: '0 0 -3' });
    // Left the near pane comes first, right the far one.
    const panes = [
      ...[pane([1, 0, 0], '-0.6 0 0.5'), pane([0, 1, 0], '-0.6 0 -0.5')],
      ...[pane([0, 1, 0], '0.6 0 -0.5'), pane([1, 0, 0], '0.6 0 0.5')],
    ];
    element.append(box, ...panes);
    await until(() => [box, ...panes].every(({ loaded }) => loaded), 'all');
    await frames();
    const screen = await screenOf(element);
    for (const x of [-0.6, 0.6]) {
      const found = screen.at(60 + x * METER, 50);
      // Half red before a quarter of green before a quarter of blue.
      const expected = [127.5, 63.75, 63.75];
      const off = Math.max(...found.map((value, k) => Math.abs(value - expected[k])));
      assert(off <= 3, `two panes at ${x}: ${found.join()}`);
    }
  });

  itInLab('without light keep their base colors, and lit by even light nearly so', async () => {
    const grays = [0, 0.02, 0.1, 0.214, 0.5, 1];
    const shown = [0, 39, 89, 127, 188, 255];
    const element = place();
    const boxes = grays.flatMap((gray, i) =>
      (['unlit', 'rough'] as const).map((surface, row) =>
        mesh({ surface, color: [gray, gray, gray], half: [0.4, 0.4, 0.05] }, { position: `${i - 2.5} ${row} 0` }),
      ),
    );
    const orange = mesh({ surface: 'unlit', color: [1, 0.2122, 0], half: [0.4, 0.4, 0.05] }, { position: '0 -2 0' });
    element.append(...boxes, orange);
    await until(() => [...boxes, orange].every(({ loaded }) => loaded), 'all boxes');
    await frames();
    const screen = await screenOf(element);
    const at = (x: number, y: number): Rgb => screen.at(60 + x * METER, 50 - y * METER);
    const unlit = grays.map((_, i) => at(i - 2.5, 0));
    for (const [i, found] of unlit.entries())
      assert(
        found.every((value) => Math.abs(value - shown[i]) <= 1),
        `gray ${shown[i]}: ${found.join()}`,
      );
    const found = at(0, -2);
    assert(
      [255, 127, 0].every((value, k) => Math.abs(value - found[k]) <= 1),
      `orange: ${found.join()}`,
    );
    const lit = grays.map((_, i) => at(i - 2.5, 1)[0]);
    const max = Math.max(...lit.map((value, i) => Math.abs(value - shown[i])));
    assert(max <= 24, `lit grays ${lit.join()} for ${shown.join()}`);
  });

  itInLab('are shown with any bounds in their file, and opaque where their glass is', async () => {
    const canvas = new OffscreenCanvas(1, 1);
    canvas.getContext('2d')!.fillRect(0, 0, 1, 1);
    const bytes = new Uint8Array(await (await canvas.convertToBlob()).arrayBuffer());
    const black = `data:image/png;base64,${btoa(String.fromCharCode(...bytes))}`;
    const far = { min: [100, 100, 100], max: [101, 101, 101] };
    const half = [0.4, 0.4, 0.05] as const;
    const element = place();
    const elsewhere = mesh({ color: [1, 0, 0], half, stated: far }, { position: '-2 0 0' });
    const bottle = mesh({ color: [0, 1, 0], half, clearWhere: black }, { position: '2 0 0' });
    const orange = { surface: 'unlit', color: [1, 0.2122, 0], half: [0.02, 0.02, 0.02] } as const;
    const points = mesh({ ...orange, drawnAs: 'points' }, { position: '0 1 0' });
    const cut = (alpha: number, position: string): SplatMeshElement =>
      mesh({ color: [0, 1, 0], half: [0.3, 0.3, 0.05], clearWhere: black, alpha, cutoff: 0.5 }, { position });
    const [kept, gone] = [cut(0.7, '1 -1 0'), cut(0.3, '-1 -1 0')];
    const all = [elsewhere, bottle, points, kept, gone];
    element.append(...all);
    await until(() => all.every(({ loaded }) => loaded), 'all');
    await frames();
    const screen = await screenOf(element);
    const at = (x: number, y = 0): Rgb => screen.at(60 + x * METER, 50 - y * METER);
    assert(isRed(at(-2)), `a box that says that it is elsewhere: ${at(-2).join()}`);
    assert(isGreen(at(2)), `glass whose texture says that no light passes: ${at(2).join()}`);
    assert(at(1, -1)[0] < 150, `alpha above the cutoff of glass: ${at(1, -1).join()}`);
    assert(at(-1, -1)[0] > 250, `alpha below the cutoff of glass: ${at(-1, -1).join()}`);
    const near = [-0.1, 0, 0.1].flatMap((x) => [0.9, 1, 1.1].map((y) => at(x, y)));
    const [, green, blue] = near.reduce((min, color) => (color[2] < min[2] ? color : min));
    // Points cover parts of pixels of a white page.
    const share = (255 - green) / (255 - blue);
    assert(blue < 200 && Math.abs(share - (255 - 127) / 255) < 0.1, `points: ${near.join(' ')}`);
  });

  it('are framed without the corners that are not numbers', async () => {
    const element = document.createElement('gaussian-splat');
    element.style.cssText = 'display: block; width: 120px; height: 100px';
    const box = mesh({ isBroken: true });
    element.append(box);
    document.body.append(element);
    await until(() => box.loaded || box.error !== null, 'the box');
    assertEqual(box.error, null, `${box.error?.message}`);
    assert(await comesToShow(element, (screen) => screen.middleOf(isRed) !== null), 'it is drawn');
  });

  itInLab('are in images of toBlob(), over a color and over nothing, and hide splats there', async () => {
    const element = place({ src: GREEN });
    element.append(mesh({ half: [0.2, 0.2, 0.1] }, { position: '0 0 3m' }));
    await element.ready;
    await frames();
    const pixels = async (options: Parameters<typeof element.toBlob>[0]) => {
      const bitmap = await createImageBitmap(await element.toBlob(options));
      const { width, height } = bitmap;
      const context = new OffscreenCanvas(width, height).getContext('2d')!;
      context.drawImage(bitmap, 0, 0);
      const at = (x: number, y: number): number[] => [...context.getImageData(x * width, y * height, 1, 1).data];
      return { middle: at(0.5, 0.5), corner: at(0.05, 0.05), size: [width, height] };
    };
    for (const size of [{}, { width: 240, height: 200 }]) {
      const clear = await pixels(size);
      assertEqual(clear.corner, [0, 0, 0, 0], 'nothing behind');
      const blue = await pixels({ ...size, background: 'rgb(0 0 255)' });
      assertEqual(blue.corner, [0, 0, 255, 255], 'the color behind');
      assert(isRed(blue.middle as unknown as Rgb), `the mesh over it: ${blue.middle.join()}`);
      assertEqual(blue.middle, clear.middle, 'what is opaque is the same over both');
      if ('width' in size) assertEqual(blue.size, [240, 200], 'size');
    }
    const screen = await screenOf(element);
    assert(isRed(screen.at(60, 50)), 'and the frame on the page is as before');
  });

  itInLab('alone, without splats, and with a scene that comes later', async () => {
    const element = place();
    element.append(mesh({ half: [1, 0.5, 0.5] }, { position: '0 1 0' }));
    await element.ready;
    assert(element.loaded, 'loaded');
    assertNear(await placeOf(element, isRed), [0, 1], 'the box');
    assertEqual(
      element.stats?.scenes.map(({ triangles }) => triangles),
      [12],
      'triangles',
    );
    element.src = GREEN;
    await nextEvent(element, 'load');
    assert(await placeOf(element, isGreen), 'the scene');
    assertNear(await placeOf(element, isRed), [0, 1.2], 'the box', 0.4);
  });

  itInLab('move: by their own clock, or by that of the element', async () => {
    const element = place({ src: COMPASS });
    const follower = mesh({ moves: 4, color: [1, 0, 1], half: [0.3, 0.3, 0.3] }, { position: '-2 2 0' });
    element.append(follower);
    await element.ready;
    assertEqual([element.duration, follower.duration], [1, 1], 'durations');
    const isPink = ([r, g, b]: Rgb): boolean => r > 150 && b > 150 && g < 110;
    assertNear(await placeOf(element, isPink), [-2, 2], 'at first');
    const seeked = nextEvent(element, 'seeked');
    element.currentTime = 0.5;
    await seeked;
    assertNear(await placeOf(element, isPink), [0, 2], 'half of the way');
    follower.autoplay = true;
    follower.loop = true;
    await until(() => !follower.paused && follower.currentTime > 0.1, 'its own clock');
    assertEqual(element.paused, true, 'the clock of the element');
    follower.pause();
  });

  itInLab('of a file that has splats, too, are shown with them', async () => {
    const src = URL.createObjectURL(boxGlb({ splat: [2, 1, 0], half: [0.5, 0.5, 0.5] }));
    const element = place();
    const child = document.createElement('splat-scene');
    child.setAttribute('src', `${src}#both.glb`);
    // The front of a glTF object faces the side to which a trainer's scene turns its back.
    child.setAttribute('rotation', '0 180deg 0');
    element.append(child);
    await element.ready;
    assert(child.error === null, `${child.error?.message}`);
    await until(() => (element.stats?.scenes[0].triangles ?? 0) > 0, 'the triangles');
    await frames();
    assertNear(await placeOf(element, isRed), [0, 0], 'triangles');
    assertNear(await placeOf(element, isGreen), [2, 1], 'splats', 0.3);
    const own = place({ src: `${src}#both.glb`, 'camera-orbit': '180deg 90deg 10m' });
    await own.ready;
    // They come after the splats; without children, `stats.scenes` lists nothing that would say so.
    for (let i = 0; i < 100 && (await placeOf(own, isRed)) === null; i++) await delay(50);
    assertNear(await placeOf(own, isRed), [0, 0], 'triangles');
    assertNear(await placeOf(own, isGreen), [2, 1], 'splats', 0.3);
  });

  itInLab('are picked, and hide labels', async () => {
    const element = place({ src: GREEN });
    element.insertAdjacentHTML('beforeend', '<b slot="hotspot-ball" data-position="0 0 1.5">o</b>');
    const box = mesh({ half: [0.5, 0.5, 0.5] }, { position: '0 0 4' });
    await element.ready;
    await until(() => element.queryHotspot('hotspot-ball')?.visible === true, 'the label');
    element.append(box);
    await nextEvent(box, 'load');
    await until(() => element.queryHotspot('hotspot-ball')?.visible === false, 'the label to be hidden');
    const { left, top } = element.getBoundingClientRect();
    const point = await element.positionFromPoint(left + 60, top + 50);
    assert(point && Math.abs(point.z - 4.5) < 0.02, `picked: ${point?.toString()}`);
  });

  itInLab('that leave while others compile leave these to be shown', async () => {
    const element = place({});
    const first = mesh({ color: [0, 1, 0], half: [0.3, 0.3, 0.3] }, { position: '-2 2 0' });
    element.append(first);
    await until(() => first.loaded, 'the first mesh');
    const errors: string[] = [];
    const { createShaderModule } = GPUDevice.prototype;
    const { error } = console;
    let isRemoved = false;
    console.error = (...words: unknown[]) => errors.push(words.join(' '));
    // The moment between the shaders of three.js and their pipeline.
    GPUDevice.prototype.createShaderModule = function removing(descriptor) {
      if (!descriptor.label?.startsWith('gs.')) {
        isRemoved = true;
        first.remove();
      }
      return createShaderModule.call(this, descriptor);
    };
    try {
      // Another kind of material needs other shaders.
      const second = mesh({ color: [1, 0, 1], half: [0.3, 0.3, 0.3], surface: 'unlit' }, { position: '2 2 0' });
      element.append(second);
      await until(() => second.loaded || second.error !== null, 'the second mesh');
      assertEqual([second.loaded, isRemoved], [true, true], 'loaded; removed meanwhile');
      const isPink = ([r, g, b]: Rgb): boolean => r > 150 && b > 150 && g < 110;
      assert(await comesToShow(element, (screen) => screen.middleOf(isPink) !== null), 'the second mesh is drawn');
      assertEqual(errors, [], 'errors');
    } finally {
      console.error = error;
      GPUDevice.prototype.createShaderModule = createShaderModule;
    }
  });

  itInLab('that cannot be read leave the others; a lost device brings them back; nothing stays behind', async () => {
    const before = GaussianSplatElement.releaseDelay;
    GaussianSplatElement.releaseDelay = 0;
    try {
      document.body.replaceChildren();
      await until(() => holdings().objects === 0, 'what others leave to go');
      const element = place({ src: GREEN });
      const broken = mesh({}, {});
      broken.src = new File([new Uint8Array(100)], 'broken.glb');
      const missing = mesh({}, {});
      missing.src = '/net/missing.glb';
      const good = mesh({}, { position: '3 0 0' });
      element.append(broken, missing, good);
      await element.ready;
      assertEqual([broken.error?.reason, missing.error?.reason], ['decode/unknown-format', 'network/status'], 'errors');
      assert(good.loaded && element.error === null, 'the others');
      const image = await screenOf(element);
      for (let i = 0; i < (isLab ? 3 : 1); i++) {
        const restored = nextEvent(element, 'contextrestored', 60_000);
        devices.at(-1)!.destroy();
        await restored;
        await frames();
        assertEqual((await screenOf(element)).differences(image, 2), 0, 'the frame is back');
      }
      document.body.replaceChildren();
      await delay(300);
      assertEqual(holdings(), { objects: 0, bytes: 0 }, 'what lives on the GPU');
    } finally {
      GaussianSplatElement.releaseDelay = before;
    }
  });
});
