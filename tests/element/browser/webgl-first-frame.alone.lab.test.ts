/** The first frame of a scene in pages with WebGL beside the one with WebGPU: times, so no other page may be open. */
import '@gaussian-splat/element';
import { detailFolder } from '../../support/detail-folder.js';
import { pebbles } from '../../support/scenes/pebbles.js';
import { assert, assertEqual, nextEvent, show } from './support/harness.js';

/** Time with WebGL, at most, as a multiple of the time with WebGPU. */
const MAX_RATIO = 1.5;
const ROUNDS = 4;

async function putPages(): Promise<string> {
  const folder = detailFolder(pebbles(20_000), undefined, { geometry: 'quantized' });
  const put = (path: string, body: BodyInit): Promise<Response> =>
    fetch(`/net/kept/webgl-first/${path}`, { method: 'PUT', body });
  for (const [path, bytes] of folder.files) await put(path, bytes);
  await put('detail.json', JSON.stringify(folder.manifest));
  return '/net/kept/webgl-first/detail.json';
}

describe('renderer="webgl"', () => {
  it('shows the first frame of a scene in pages within 1.5 times of what it takes with WebGPU', async () => {
    const src = await putPages();
    const firstFrameMs = async (renderer: string): Promise<number> => {
      const begin = performance.now();
      const element = show({
        ...{ src, renderer, 'camera-orbit': '0deg 90deg 8m' },
        ...{ 'interpolation-decay': '0', 'interaction-prompt': 'none' },
      });
      // The coarsest page is a preview with WebGL, if the others do not arrive at once.
      await Promise.race(['preview', 'load'].map((type) => nextEvent(element, type)));
      const took = performance.now() - begin;
      await element.ready;
      assertEqual(element.stats?.renderer, renderer, 'renderer');
      element.remove();
      return took;
    };
    const times: Record<string, number[]> = { webgpu: [], webgl: [] };
    for (let round = 0; round < ROUNDS; round++)
      for (const renderer of ['webgpu', 'webgl']) times[renderer].push(await firstFrameMs(renderer));
    // The first round compiles shaders.
    const [webgpu, webgl] = ['webgpu', 'webgl'].map((renderer) => Math.min(...times[renderer].slice(1)));
    console.log(`first frame of a scene in pages: ${webgpu.toFixed(0)} ms with WebGPU, ${webgl.toFixed(0)} with WebGL`);
    assert(webgl <= MAX_RATIO * webgpu, `${webgl} of ${webgpu} ms`);
  });
});
