/** Implementation of `gaussian-splat check MODEL [--contract CONTRACT.json] [--run]`, by @gaussian-splat/check. */
import { main } from '@gaussian-splat/check';
import { parseSceneOptions, PROGRAM, runCommand, SeveralInputs } from './lib/command.mjs';

const flag = { type: 'boolean' };
const OPTIONS = { contract: { type: 'string' }, out: { type: 'string' }, run: flag, draft: flag };

/** Returns the arguments of one model, whose faults the checker reports. */
function parse(args) {
  try {
    parseSceneOptions(args, OPTIONS);
  } catch (error) {
    if (error instanceof SeveralInputs) throw error;
  }
  return args;
}

await runCommand('', parse, async (args) => process.exit(await main(args, `${PROGRAM} check`)), {
  name: 'check',
  accepts: (path) => /\.onnx$/i.test(path),
});
