import { checkModel } from '@gaussian-splat/check';
import { readFileSync, writeFileSync } from 'node:fs';
const files = readFileSync('/tmp/agree.txt', 'utf8').trim().split('\n');
const out = {};
for (const file of files) {
  try {
    const { faults } = await checkModel(file, { run: true });
    out[file] = [...new Set(faults.map(({ code }) => code))].sort();
  } catch (error) {
    out[file] = [`throws ${error.code ?? ''} ${String(error.message).slice(0, 120)}`];
  }
}
writeFileSync('/tmp/agree-js.json', JSON.stringify(out, null, 1));
