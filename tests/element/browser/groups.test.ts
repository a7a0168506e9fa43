/** Groups of the splats of a file: picked, hidden, tinted and measured by name, on the GPU. */
import '@gaussian-splat/element';
import type { GaussianSplatElement, PickedPoint } from '@gaussian-splat/element';
import { itInLab } from '../../support/extent-in-pages.js';
import {
  assert,
  assertEqual,
  atRest,
  claimComing,
  claimFault,
  COMPASS,
  frames,
  show,
  until,
} from './support/harness.js';
import { isBlue, isGreen, isRed, screenOf, type Rgb } from './support/screen.js';

const SH_C0 = 0.28209479177387814;
const NAMES = '{"4": "chair", "9": "table"}';

/** Number of splats of each object: enough for the packed order to differ from that of the file. */
const COUNT = 1000;
/** Objects of the room: number, center x and color. */
const OBJECTS = [
  [4, -0.8, [0.9, 0.1, 0.1]],
  [9, 0.8, [0.2, 0.3, 0.95]],
  [-1, 0, [0.1, 0.8, 0.1]],
] as const;
const PROPERTIES = [
  ...['x', 'y', 'z', 'f_dc_0', 'f_dc_1', 'f_dc_2', 'opacity', 'scale_0', 'scale_1', 'scale_2'],
  ...['rot_0', 'rot_1', 'rot_2', 'rot_3'],
];

/** A binary PLY as segmenting scripts write it: an integer after `rot_3`. Splats of the objects alternate, and every 50th cannot be drawn. */
function room(property = 'object_id', type = 'int'): string {
  const head = ['ply', 'format binary_little_endian 1.0', `element vertex ${3 * COUNT}`];
  head.push(...PROPERTIES.map((name) => `property float ${name}`), `property ${type} ${property}`, 'end_header', '');
  const stride = 4 * PROPERTIES.length + 4;
  const rows = new DataView(new ArrayBuffer(3 * COUNT * stride));
  for (let i = 0; i < 3 * COUNT; i++) {
    const [id, x, color] = OBJECTS[i % 3];
    const place = [0, 1, 2].map((k) => 0.3 * Math.sin(i * (k + 1.3) * 1.7));
    const rotation = i % 50 === 7 ? 0 : 1;
    const values = [x + place[0], place[1], place[2], ...color.map((c) => (c - 0.5) / SH_C0), 4, -3, -3, -3];
    [...values, rotation, 0, 0, 0].forEach((value, k) => rows.setFloat32(i * stride + 4 * k, value, true));
    rows.setInt32(i * stride + stride - 4, id, true);
  }
  return `${URL.createObjectURL(new Blob([head.join('\n'), rows]))}#room.ply`;
}

async function shown(attributes: Readonly<Record<string, string>>): Promise<GaussianSplatElement> {
  const element = show({ src: room(), alt: 'A room', 'camera-orbit': '0deg 90deg 4m', ...attributes });
  await element.ready;
  assert(element.loaded, `not loaded: ${element.error?.message ?? 'no error'}`);
  return element;
}

const countOf = async (element: Element, isColor: (color: Rgb) => boolean): Promise<number> =>
  (await screenOf(element)).middleOf(isColor)?.count ?? 0;

async function hitAt(element: GaussianSplatElement, isColor: (color: Rgb) => boolean): Promise<PickedPoint> {
  const { x, y } = element.getBoundingClientRect();
  const middle = (await screenOf(element)).middleOf(isColor)!;
  const hit = await element.positionFromPoint(x + middle.x, y + middle.y);
  assert(hit !== null, 'a hit');
  return hit;
}

function cutOf(element: Element, attributes: Readonly<Record<string, string>>): HTMLElement {
  const child = document.createElement('splat-cut');
  for (const [name, value] of Object.entries(attributes)) child.setAttribute(name, value);
  element.append(child);
  return child;
}

/** Counts the calls that create objects of the GPU while `act` runs. */
async function creations(act: () => Promise<unknown>): Promise<number> {
  const names = ['createBuffer', 'createTexture', 'createBindGroup', 'createComputePipeline'] as const;
  const originals = names.map((name) => GPUDevice.prototype[name]);
  let count = 0;
  names.forEach((name, k) => {
    (GPUDevice.prototype[name] as unknown) = function (this: GPUDevice, ...args: unknown[]) {
      count++;
      return (originals[k] as (...all: unknown[]) => unknown).apply(this, args);
    };
  });
  try {
    await act();
  } finally {
    names.forEach((name, k) => ((GPUDevice.prototype[name] as unknown) = originals[k]));
  }
  return count;
}

describe('groups of a file', () => {
  for (const renderer of ['webgpu', 'webgl'])
    (renderer === 'webgpu' ? it : itInLab)(
      `are answered by picks, and listed with counts and boxes: ${renderer}`,
      async () => {
        const element = await shown({ groups: '', 'group-names': NAMES, renderer });
        const groups = [isRed, isBlue, isGreen].map(async (isColor) => (await hitAt(element, isColor)).group?.name);
        assertEqual(await Promise.all(groups), ['chair', 'table', '-1'], 'names of the groups');
        const listed = element.getSplatGroups!();
        assertEqual(
          listed.map(({ id, name, count }) => [id, name, count]),
          [-1, 4, 9].map((id, k) => [id, ['-1', 'chair', 'table'][k], 980]),
          'groups of the scene',
        );
        const { min, max } = listed[1].box;
        assert(Math.abs(min.x + 1.1) < 0.01 && Math.abs(max.x + 0.5) < 0.01, `${min.x} to ${max.x}`);
        assert(Math.abs(max.y - 0.3) < 0.01 && Math.abs(min.z + 0.3) < 0.01, `${max.y}, ${min.z}`);
        element.groupNames = { 4: 'stool' };
        assertEqual((await hitAt(element, isRed)).group, { id: 4, name: 'stool', count: 980 }, 'another name');
      },
    );

  itInLab('are hidden, tinted and shown alone by a cut, which creates nothing on the GPU when it changes', async () => {
    const element = await shown({ groups: 'object_id', 'group-names': NAMES });
    const before = await screenOf(element);
    const cut = cutOf(element, { group: 'table' });
    await until(async () => (await countOf(element, isBlue)) === 0, 'the table is hidden');
    await atRest(element);
    const hidden = await screenOf(element);
    assert((hidden.middleOf(isRed)?.count ?? 0) >= 0.95 * before.middleOf(isRed)!.count, 'the chair stays');
    assert(hidden.differences(before, 8) > 100, 'the image has changed');
    const { x, y } = element.getBoundingClientRect();
    const { x: left, y: top } = before.middleOf(isBlue)!;
    assertEqual(await element.positionFromPoint(x + left, y + top), null, 'nothing is picked there');
    const made = await creations(async () => {
      cut.setAttribute('group', '4, 9');
      await until(async () => (await countOf(element, isRed)) === 0, 'both are hidden');
      cut.setAttribute('side', 'outside');
      await until(async () => (await countOf(element, isGreen)) === 0, 'the rest is hidden');
      assert((await countOf(element, isRed)) > 0 && (await countOf(element, isBlue)) > 0, 'both are back');
      cut.setAttribute('side', 'inside');
      cut.setAttribute('group', 'chair');
      cut.setAttribute('effect', 'recolor');
      cut.setAttribute('hue', '120deg');
      await until(async () => (await countOf(element, isRed)) === 0, 'the chair is green');
      await frames(4);
    });
    // Picks and images of the test allocate; the frames of a cut do not.
    assertEqual(made, 0, 'objects created on the GPU');
    assertEqual((await hitAt(element, isBlue)).group?.name, 'table', 'the table is back');
    cut.setAttribute('shape', 'box');
    cut.setAttribute('position', '0 -5 0');
    await until(async () => (await countOf(element, isRed)) > 0, 'a shape limits the group');
    cut.remove();
    await atRest(element);
    assertEqual((await screenOf(element)).differences(before, 8), 0, 'pixels that differ from the first image');
  });

  it('belong to a <splat-scene> with names of its own', async () => {
    const element = show({ alt: 'Two rooms', 'camera-orbit': '0deg 90deg 9m' });
    const scenes = ['-2', '2'].map((x) => {
      const scene = document.createElement('splat-scene');
      const attributes = { src: room('label', 'int'), groups: 'label', position: `${x} 0 0` };
      for (const [name, value] of Object.entries(attributes)) scene.setAttribute(name, value);
      element.append(scene);
      return scene as HTMLElement & { groupNames: unknown; loaded?: boolean };
    });
    await until(() => scenes.every(({ loaded }) => loaded), 'both scenes');
    scenes[1].groupNames = { 4: 'stool' };
    await until(() => element.getSplatGroups !== undefined, 'the code of groups');
    assertEqual(element.getSplatGroups!(), [], 'groups of the element itself');
    const [left, right] = scenes.map((scene) => element.getSplatGroups!(scene)[1]);
    assertEqual([left.name, right.name], ['4', 'stool'], 'names');
    assert(Math.abs(right.box.min.x - left.box.min.x - 4) < 1e-4, 'boxes are where the scenes are');
    const whole = await countOf(element, isRed);
    cutOf(scenes[1], { group: 'stool' });
    await until(async () => (await countOf(element, isRed)) < 0.7 * whole, 'one chair is hidden');
    assert((await countOf(element, isRed)) > 0.3 * whole, 'the other stays');
  });

  it('that a file lacks leave the scene as it is, and a warning says which properties there are', async () => {
    const element = await shown({ src: room('quality', 'int'), groups: '' });
    assertEqual((await hitAt(element, isRed)).group, null, 'group');
    claimFault(/left out: quality/);
    claimFault(/expected one of the properties object_id.*found .*quality/);
    await shown({ src: COMPASS, groups: '' });
    claimFault(/expected a PLY, found another format/);
    cutOf(element, { group: 'chair' });
    await claimComing(/<splat-cut group>: expected a scene with groups, found chair/);
  });
});
