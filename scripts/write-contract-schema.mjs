/** Writes packages/core/contract.schema.json from the schema in packages/core/src/contract/schema.ts; build core first. */
import { writeFileSync } from 'node:fs';
import { format } from 'prettier';
import { root } from './lib/run.mjs';

const { CONTRACT_SCHEMA } = await import('../packages/core/dist/contract/index.js');
const text = await format(JSON.stringify(CONTRACT_SCHEMA), { parser: 'json', printWidth: 120 });
// The exporter checks contracts by the same one.
for (const path of ['core/contract.schema.json', 'exporter/src/gaussian_exporter/contract_schema.json']) {
  writeFileSync(`${root}packages/${path}`, text);
  console.log(`wrote ${path}`);
}
