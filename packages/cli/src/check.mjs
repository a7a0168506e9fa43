/** Implementation of `gaussian-splat check MODEL [--contract CONTRACT.json] [--run]`, by @gaussian-splat/check. */
import { main } from '@gaussian-splat/check';

process.exit(await main(process.argv.slice(2)));
