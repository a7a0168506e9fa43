/**
 * The stability catalog: one file for each known failure of splat renderers. All rows run in one process, because they share a
 * device and its pipelines. STABILITY_ROWS limits them to files whose name contains it.
 */
import { readdirSync } from 'node:fs';
import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { scriptModule } from '../bench/load.js';
import { noteAdapter } from './support/row.js';

test('28 rows, and each says who fails it, what is run, and when it passes', async () => {
  const { readHeaders } = await scriptModule('stability/headers.mjs');
  const ids = (readHeaders() as { id: string }[]).map(({ id }) => id);
  const numbers = Array.from({ length: 27 }, (_, i) => `S${i + 1}`);
  assert.deepEqual(ids, [...numbers.slice(0, 5), 'S5b', ...numbers.slice(5)]);
});

await noteAdapter();
const rows = readdirSync(new URL('.', import.meta.url)).filter((name) => /^[a-z-]+\.ts$/.test(name));
for (const row of rows.filter((name) => name.includes(process.env.STABILITY_ROWS ?? ''))) {
  await import(new URL(row, import.meta.url).href);
}

// Dawn keeps Node alive.
after(() => {
  setImmediate(() => process.exit());
});
