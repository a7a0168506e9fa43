/** Writes packages/core/contract.schema.json from the schema in packages/core/src/contract/schema.ts; build core first. */
import { writeFileSync } from 'node:fs';
import { format } from 'prettier';
import { root } from './lib/run.mjs';

const { CONTRACT_SCHEMA } = await import('../packages/core/dist/contract/index.js');
const path = `${root}packages/core/contract.schema.json`;
writeFileSync(path, await format(JSON.stringify(CONTRACT_SCHEMA), { parser: 'json', printWidth: 120 }));
console.log(`wrote ${path}`);
