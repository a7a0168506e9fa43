/** Common parts of the commands for one scene: options, usage errors, and exit codes. */
import { parseArgs } from 'node:util';
import { GaussianSplatError } from '@gaussian-splat/core';

/** The command line is invalid; its message is shown above the usage. */
export class UsageError extends Error {}

/** The command cannot do what is asked; its message has the reason and a remedy. */
export class CommandError extends Error {}

/**
 * Parses a command line. The value of an option may begin with a dash, as in `--up -y`, for which `parseArgs` requires
 * `--up=-y`.
 * @param args {string[]}
 * @param options {import('node:util').ParseArgsConfig['options']}
 * @returns The values and the positional arguments; undefined if help is requested.
 * @throws UsageError for unknown options.
 */
export function parseCommandLine(args, options) {
  const all = { ...options, help: { type: 'boolean', short: 'h' } };
  try {
    const { values, positionals } = parseArgs({ args: joinValues(args, all), allowPositionals: true, options: all });
    return values.help ? undefined : { values, positionals };
  } catch (error) {
    throw new UsageError(error.message);
  }
}

/** Joins each option with a value that begins with one dash. */
function joinValues(args, options) {
  const joined = [];
  for (let i = 0; i < args.length; i++) {
    if (args[i] === '--') return [...joined, ...args.slice(i)];
    const takesText = args[i].startsWith('--') && options[args[i].slice(2)]?.type === 'string';
    joined.push(takesText && /^-[^-]/.test(args[i + 1]) ? `${args[i]}=${args[++i]}` : args[i]);
  }
  return joined;
}

/**
 * Parses the command line of a command for one scene: see {@link parseCommandLine}.
 * @returns The values, and the path of the scene; undefined if help is requested.
 * @throws UsageError for unknown options, and for no scene or several.
 */
export function parseSceneOptions(args, options) {
  const parsed = parseCommandLine(args, options);
  if (parsed === undefined) return undefined;
  const { values, positionals } = parsed;
  if (positionals.length !== 1) throw new UsageError(`expected one SCENE, found ${positionals.length}`);
  return { values, scene: positionals[0] };
}

/**
 * Prints the unused parts of a scene file to the error stream.
 * @param losses {string[]} Sentences about parts that the file to be written cannot hold.
 */
export function sayWarnings(scene, { warnings = [] }, losses = []) {
  for (const warning of [...warnings, ...losses]) console.error(`${scene}: ${warning}`);
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
    else if (error instanceof GaussianSplatError || error instanceof CommandError || isOfFiles(error))
      console.error(error.message);
    else console.error(error);
    process.exit(error instanceof UsageError ? 2 : 1);
  }
}
