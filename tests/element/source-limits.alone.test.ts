/**
 * The limits of a page are part of a source's request, because floors and immersive sessions load its file again, and hold
 * for previews.
 * SECURITY.md: "Pages set their own limits".
 */
import assert from 'node:assert/strict';
import { test } from 'node:test';
import { writePly } from '../formats/support/ply-writer.js';
import { inriaColumns, rawSplats } from '../formats/support/splats.js';
import { SourceController, type SourceHost } from '../support/element/parts.js';
import { PreviewSchedule, type SceneLimits, type SceneRequest } from '../support/element/loading.js';

function limitsWith(memoryBudget: number | undefined, sceneLimits: SceneLimits): SceneLimits | undefined {
  let found: SceneRequest | null = null;
  const host = {
    attributes: { crossorigin: null, loading: 'eager' },
    services: { sceneLimits, urlModifier: null },
    ...{ core: { isInSight: true }, isConnected: true, memoryBudget },
    scene: { want: (request: SceneRequest | null) => (found = request), see: () => undefined, isOther: () => false },
  };
  const source = { src: 'https://a.example/a.ply', contract: null, chain: null, postprocess: null };
  new SourceController(host as unknown as SourceHost).set(source);
  return (found as SceneRequest | null)?.limits;
}

test('every request has a limit of bytes: the one of the page, or one of its memory budget', () => {
  Object.assign(globalThis, { document: { baseURI: 'https://page.example/' } });
  assert.deepEqual(limitsWith(2 ** 20, {}), { maxBytes: 2 ** 23 });
  assert.deepEqual(limitsWith(undefined, { maxSplats: 5 }), { maxBytes: 2 ** 32, maxSplats: 5 });
  assert.deepEqual(limitsWith(2 ** 20, { maxBytes: 300 }), { maxBytes: 300 });
});

test('a preview has no more splats than the page allows', async () => {
  const file = writePly([{ name: 'vertex', columns: inriaColumns(rawSplats(8, 1)) }]);
  for (const [maxSplats, shown] of [
    [5, []],
    [8, [8]],
  ] as const) {
    const counts: number[] = [];
    const previews = new PreviewSchedule({ name: 'a.ply', maxSplats }, 0, ({ count }) => void counts.push(count));
    await previews.onArrival(file, undefined);
    assert.deepEqual(counts, shown);
  }
});
