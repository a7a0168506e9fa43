/** What the commands that take one scene have in common: their options, errors of use, and exit codes. */
import { parseArgs } from 'node:util';
import { GaussianSplatError } from '@gaussian-splat/core';

/** The command line is wrong; its message is shown above the usage. */
export class UsageError extends Error {}

/** Folder that a person's relative paths start from: npm runs scripts in the project's root. */
export const from = process.env.INIT_CWD ?? process.cwd();

/**
 * @param args {string[]}
 * @param options {import('node:util').ParseArgsConfig['options']}
 * @returns the values, and the one scene that is named; undefined where help is asked for
 * @throws UsageError for other options, and for no scene or several
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

/** Says on the error stream what of a scene file is not used. */
export function sayWarnings(scene, { warnings = [], hints }) {
  for (const warning of warnings) console.error(`${scene}: ${warning}`);
  if (hints?.isUpAssumed)
    console.error(`${scene}: the file does not name its frame, which is assumed from the marks of its writer`);
}

/** Whether the file system says it: ENOENT, EACCES, ENOSPC. Its sentence is enough for people. */
const isOfFiles = ({ code, syscall }) => syscall !== undefined || /^E[A-Z]+$/.test(code);

/**
 * Runs a command and ends the process, which Dawn would keep alive: 0, 2 for a wrong command line, 1 for everything else.
 * @param usage {string}
 * @param parse {(args: string[]) => object | undefined} undefined where help is asked for
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
    // Errors of the file system name the file, all but reading a folder.
    else if (error.code === 'EISDIR') console.error(`${error.message}: expected a file, found a folder`);
    else if (error instanceof GaussianSplatError || isOfFiles(error)) console.error(error.message);
    else console.error(error);
    process.exit(error instanceof UsageError ? 2 : 1);
  }
}
