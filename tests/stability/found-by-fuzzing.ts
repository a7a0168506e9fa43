/**
 * Every case that `npm run lab -- fuzz` has found worth keeping: faults that were fixed, and the worst images with the cause of each.
 *
 * Who fails: no other renderer publishes such a corpus.
 *
 * Passes: no number that is not finite; 59 dB or more in all pixels that no rounding decides.
 */
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { readdirSync, readFileSync } from 'node:fs';
import type { RasterizerName } from '@gaussian-splat/renderer';
import { nodeDevice } from '../support/node-device.js';
import { judge } from './fuzz/judge.js';
import { fullDevice } from './support/devices.js';
import type { SceneRecipe } from './support/random-scene.js';
import { holds } from './support/row.js';

interface Kept {
  readonly rasterizer: RasterizerName;
  readonly recipe: SceneRecipe;
}

const folder = new URL('corpus/', import.meta.url);

test('the corpus', async () => {
  const files = readdirSync(folder).filter((name) => name.endsWith('.json'));
  assert.ok(files.length > 0, 'the corpus is there');
  const precise = await fullDevice();
  let faults = 0;
  for (const name of files) {
    const { rasterizer, recipe } = JSON.parse(readFileSync(new URL(name, folder), 'utf8')) as Kept;
    const subject = {
      device: await nodeDevice(),
      precise: precise.features.has('float32-blendable') ? precise : undefined,
      rasterizer,
    };
    const verdict = await judge(recipe, subject);
    console.log(name, JSON.stringify(verdict));
    if (verdict.cause === 'none') faults++;
  }
  holds('fuzz', `${files.length} kept cases: faults`, faults, { atMost: 0, unit: 'cases' });
});
