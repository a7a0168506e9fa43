/** The pages of a streamed scene in a session: the finest level that fits into a budget of splats. SECURITY.md does not allow for more, nor do headsets. */
import assert from 'node:assert/strict';
import { createServer, type Server } from 'node:http';
import type { AddressInfo } from 'node:net';
import { after, before, test } from 'node:test';
import { DEFAULT_STEPS } from '@gaussian-splat/optimize/pages';
import { deflateQuickly } from '../../packages/cli/src/lib/encoders.mjs';
import { loadScene, type SceneRequest } from '../support/element/loading.js';
import { openXrScene, type XrSceneSource } from '../support/element/parts.js';
import { smallCloud } from '../formats/support/small-cloud.js';
import { detailFolder } from '../support/detail-folder.js';

const COUNT = 450_000;
const MAX = { handheld: 400_000, computer: 1_500_000 };
let server: Server;
let base: string;

before(async () => {
  const coded = { steps: DEFAULT_STEPS, deflate: deflateQuickly };
  const folder = detailFolder(smallCloud(COUNT, 0), undefined, { geometry: 'quantized', coded });
  const manifest = Buffer.from(JSON.stringify(folder.manifest));
  server = createServer((request, response) => {
    const path = new URL(request.url!, 'http://a').pathname.slice(1);
    const bytes = path === 'detail.json' ? manifest : folder.files.get(path);
    response.writeHead(bytes ? 200 : 404);
    response.end(bytes && new Uint8Array(bytes));
  });
  await new Promise<void>((resolve) => server.listen(0, resolve));
  base = `http://localhost:${(server.address() as AddressInfo).port}`;
});
after(() => {
  server.closeAllConnections();
  server.close();
});

/** The load of a session up to the upload, since there is no GPU here. */
async function loaded(isHandheld: boolean): Promise<number> {
  const { matchMedia } = globalThis;
  globalThis.matchMedia = (() => ({ matches: isHandheld })) as unknown as typeof matchMedia;
  const uploads = new Error('uploads');
  let count = 0;
  const loader = {
    load: async (request: SceneRequest, signal: AbortSignal) => {
      const scene = await loadScene(request, signal, { onProgress: () => undefined });
      assert.ok('packed' in scene && scene.packed);
      ({ count } = scene.packed);
      throw uploads;
    },
  } as unknown as XrSceneSource['loader'];
  const request = { url: `${base}/detail.json`, credentials: 'omit', sh: 'auto' } as const;
  const context = { gl: {} as WebGL2RenderingContext, isOwn: true };
  try {
    await openXrScene(context, { shown: null, request, loader }, new AbortController().signal);
  } catch (error) {
    assert.equal(error, uploads);
  } finally {
    globalThis.matchMedia = matchMedia;
  }
  return count;
}

test('a headset or a phone shows the finest that 400,000 splats allow, a computer more', async () => {
  const handheld = await loaded(true);
  assert.ok(handheld > 0.85 * MAX.handheld && handheld < 1.02 * MAX.handheld, `${handheld} splats`);
  assert.equal(await loaded(false), COUNT);
});
