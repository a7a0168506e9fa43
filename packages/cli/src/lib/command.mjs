/** Common parts of the commands for one scene: options, usage errors, and exit codes. */
import { parseArgs } from 'node:util';
import { GaussianSplatError } from '@gaussian-splat/core';

/** The command line is invalid; its message is shown above the usage. */
export class UsageError extends Error {}

/** Base folder of the user's relative paths, because npm runs scripts in the project's root. */
export const from = process.env.INIT_CWD ?? process.cwd();

/**
 * @param args {string[]}
 * @param options {import('node:util').ParseArgsConfig['options']}
 * @returns The values, and the path of the scene; undefined if help is requested.
 * @throws UsageError for unknown options, and for no scene or several.
 */
export function parseSceneOptions(args, options) {
  let parsed;
  try {
    parsed = parseArgs({ args, allowPositionals: true, options: { ...options, help: { type: 'boolean' } } });
  } catch (error) {
    throw new UsageError(error.message);
  }
  const { values, positionals } = parsed;
  if (values.help) return undefined;
  if (positionals.length !== 1) throw new UsageError(`expected one SCENE, found ${positionals.length}`);
  return { values, scene: positionals[0] };
}

/** Prints the unused parts of a scene file to the error stream. */
export function sayWarnings(scene, { warnings = [], hints }) {
  for (const warning of warnings) console.error(`${scene}: ${warning}`);
  if (hints?.isUpAssumed)
    console.error(`${scene}: the file does not name its frame, which is assumed from the marks of its writer`);
}

/** Whether it is a file system error: ENOENT, EACCES, ENOSPC. Its message is clear enough for users. */
const isOfFiles = ({ code, syscall }) => syscall !== undefined || /^E[A-Z]+$/.test(code);

/**
 * Runs a command and ends the process, which Dawn would keep alive: exit code 0, 2 for an invalid command line, 1 for
 * other errors.
 * @param usage {string}
 * @param parse {(args: string[]) => object | undefined} Undefined if help is requested.
 * @param main {(options: object) => Promise<void>}
 */
export async function runCommand(usage, parse, main) {
  try {
    const options = parse(process.argv.slice(2));
    if (options === undefined) console.log(usage);
    else await main(options);
    process.exit(0);
  } catch (error) {
    if (error instanceof UsageError) console.error(`${error.message}\n\n${usage}`);
    // File system errors contain the file name, except for reading a folder.
    else if (error.code === 'EISDIR') console.error(`${error.message}: expected a file, found a folder`);
    else if (error instanceof GaussianSplatError || isOfFiles(error)) console.error(error.message);
    else console.error(error);
    process.exit(error instanceof UsageError ? 2 : 1);
  }
}
