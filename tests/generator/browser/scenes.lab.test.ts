/** A generator, a file, a sequence, a streamed scene and a mesh in one element: added, moved, played and removed, with devices that go; nothing is wrong and nothing stays. */
import '@gaussian-splat/element/scenes.js';
import { GaussianSplatElement } from '@gaussian-splat/element';
import type { SplatMeshElement, SplatSceneElement } from '@gaussian-splat/element/scenes.js';
import { boxGlb } from '../../element/browser/support/glb.js';
import { holdings } from '../../element/browser/support/ledger.js';
import {
  assert,
  assertEqual,
  COMPASS,
  devices,
  FIXTURES as SCENES,
  frames,
  nextEvent,
  until,
} from '../../element/browser/support/harness.js';
import { screenOf } from '../../element/browser/support/screen.js';
import { detailFolder } from '../../support/detail-folder.js';
import { pebbles } from '../../support/scenes/pebbles.js';
import { isLab } from '../../support/extent-in-pages.js';
import { FIXTURES } from './support.js';

GaussianSplatElement.runtimeLocation = '/net/compressed/onnxruntime-web/dist/';

const LOSSES = isLab ? 5 : 1;
/** How long all of it plays and moves, ms. */
const PLAYS_MS = isLab ? 60_000 : 1_500;

const scene = (src: string, position: string): SplatSceneElement => {
  const child = document.createElement('splat-scene') as SplatSceneElement;
  child.setAttribute('src', src);
  child.setAttribute('position', position);
  return child;
};

/** A folder of pages. @returns the address of its manifest */
async function serveStreamed(): Promise<string> {
  const { files, manifest } = detailFolder(pebbles(6_000));
  const put = (name: string, body: BodyInit): Promise<unknown> =>
    fetch(`/net/kept/composed/${name}`, { method: 'PUT', body });
  await Promise.all([...files].map(([name, bytes]) => put(name, bytes)));
  await put('detail.json', JSON.stringify(manifest));
  return '/net/kept/composed/detail.json';
}

describe('generators among other scenes', () => {
  it('play, move, come and go, and come back after losses', async () => {
    const { releaseDelay } = GaussianSplatElement;
    GaussianSplatElement.releaseDelay = 0;
    try {
      const element = document.createElement('gaussian-splat');
      element.style.cssText = 'display: block; width: 120px; height: 100px';
      for (const [name, value] of Object.entries({
        ...{ src: COMPASS, 'camera-orbit': '0deg 90deg 12m', 'camera-target': '0 0 0', 'field-of-view': '45deg' },
        quality: 'default',
      }))
        element.setAttribute(name, value);
      document.body.append(element);
      const generator = scene(`${FIXTURES}packed.onnx`, '-3 0 0');
      const movie = scene('/net/sequence/movie.json', '3 0 0');
      const box = document.createElement('splat-mesh') as SplatMeshElement;
      box.src = boxGlb({ moves: 2, half: [0.4, 0.4, 0.4] });
      box.position = [0, 2.5, 0];
      const streamed = scene(await serveStreamed(), '-3 -4 0');
      streamed.scale = 0.2;
      element.append(generator, movie, box, streamed);
      await element.ready;
      for (const child of [generator, movie, box, streamed])
        assert(child.loaded, child.error?.message ?? child.localName);
      assert(Number.isFinite(movie.duration) && !Number.isNaN(generator.duration), 'both have a time');
      // Until the pages of the streamed one are all there.
      let still = await screenOf(element);
      for (let changed = Infinity; changed > 0;) {
        await frames(20);
        const next = await screenOf(element);
        changed = next.differences(still, 3);
        still = next;
      }
      element.loop = true;
      await element.play();
      const end = performance.now() + PLAYS_MS;
      for (let i = 0; performance.now() < end; i++) {
        box.rotation = [0, i / 10, 0];
        generator.position = [-3, Math.sin(i / 10), 0];
        if (i % 20 === 10) movie.remove();
        if (i % 20 === 19) element.append(movie);
        await frames(1);
      }
      assert(element.currentTime > 0, 'the time continues');
      element.pause();
      element.append(movie);
      box.rotation = null;
      generator.position = '-3 0 0';
      element.currentTime = 0;
      await nextEvent(element, 'seeked');
      // A scene that loses its device twice while it loads has failed for good.
      await until(() => movie.loaded, 'the movie, which was removed');
      for (let i = 0; i < LOSSES; i++) {
        const restored = nextEvent(element, 'contextrestored', 60_000);
        devices.at(-1)!.destroy();
        await restored;
      }
      await element.ready;
      const isBack = async (): Promise<boolean> => (await screenOf(element)).differences(still, 3) === 0;
      await until(isBack, 'the frame of the beginning');
      element.append(scene(`${SCENES}green.splat`, '0 -2 0'));
      await element.ready;
      assertEqual(element.stats?.scenes.length, 6, 'the own scene and five children');
    } finally {
      document.body.replaceChildren();
      await until(() => holdings().objects === 0, 'the memory to be given back');
      GaussianSplatElement.releaseDelay = releaseDelay;
    }
  });
});
