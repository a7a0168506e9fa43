/**
 * The stability catalogue: one file for each way in which splat renderers are known to fail. All rows run in one process, because they share a
 * device and its pipelines. STABILITY_ROWS limits them to files whose name contains it.
 */
import { readdirSync } from 'node:fs';
import { after } from 'node:test';

const rows = readdirSync(new URL('.', import.meta.url)).filter((name) => /^[a-z-]+\.ts$/.test(name));
for (const row of rows.filter((name) => name.includes(process.env.STABILITY_ROWS ?? ''))) {
  await import(new URL(row, import.meta.url).href);
}

// Dawn keeps Node alive.
after(() => {
  setImmediate(() => process.exit());
});
