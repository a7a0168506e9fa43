/** Writes the exporter's copy of the rules in packages/core/src/onnx/webgpu-rules.ts; build core first. */
import { writeFileSync } from 'node:fs';
import { format } from 'prettier';
import { root } from './lib/run.mjs';

const { WEBGPU_RULES } = await import('../packages/core/dist/onnx/index.js');
const path = `${root}packages/exporter/src/gaussian_exporter/webgpu_rules.json`;
writeFileSync(path, await format(JSON.stringify(WEBGPU_RULES), { parser: 'json', printWidth: 120 }));
console.log(`wrote ${path}`);
