/** `gaussian-splat check MODEL [--contract CONTRACT.json] [--run]`: the conformance checker of @gaussian-splat/check. */
import { main } from '@gaussian-splat/check';

// npm runs scripts in the repository's root, independent of the current folder.
process.chdir(process.env.INIT_CWD ?? '.');
process.exit(await main(process.argv.slice(2)));
