/** Common parts of the commands for one scene: options, usage errors, and exit codes. */
import { existsSync, readFileSync, statSync } from 'node:fs';
import { parseArgs } from 'node:util';
import { GaussianSplatError } from '@gaussian-splat/core';

/** Version of this package, on which recorded results depend. */
export const { version } = JSON.parse(readFileSync(new URL('../../package.json', import.meta.url), 'utf8'));

/** Words that run the program: those of a checkout, of `npx`, or the name of an installed one. */
export const PROGRAM =
  { 'gaussian-splat': 'npm run gaussian-splat --', npx: 'npx @gaussian-splat/cli' }[process.env.npm_lifecycle_event] ??
  'gaussian-splat';

/** The command line is invalid; its message is shown with the first lines of the usage. */
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

/** Inputs of a command line that names several files, a folder or a pattern: `runCommand` runs each file alone. */
export class SeveralInputs extends Error {
  constructor(inputs, values, options) {
    super(`expected one file, found ${inputs.join(' ')}`);
    this.inputs = inputs;
    const isGiven = ([name, value]) => value !== options[name]?.default;
    this.values = Object.fromEntries(Object.entries(values).filter(isGiven));
  }
}

/**
 * Parses the command line of a command for one scene: see {@link parseCommandLine}.
 * @returns The values, and the path of the scene; undefined if help is requested.
 * @throws UsageError for unknown options, and for no scene. SeveralInputs for several, a folder, or a pattern.
 */
export function parseSceneOptions(args, options) {
  const all = { ...options, as: { type: 'string' } };
  const parsed = parseCommandLine(args, all);
  if (parsed === undefined) return undefined;
  const { values, positionals } = parsed;
  if (positionals.length === 0) throw new UsageError('expected a SCENE, found none');
  if (positionals.length > 1 || isCollection(positionals[0])) throw new SeveralInputs(positionals, values, all);
  if (values.as !== undefined) throw new UsageError('--as: expected with several files, whose outputs it names');
  return { values, scene: positionals[0] };
}

/** Whether an input is a folder or a pattern such as `scenes/*.ply`, rather than a file. */
export const isCollection = (input) =>
  existsSync(input) ? statSync(input).isDirectory() : /[*?]/.test(input) && !URL.canParse(input);

/**
 * Prints the unused parts of a scene file to the error stream.
 * @param losses {string[]} Sentences about parts that the file to be written cannot hold.
 */
export function sayWarnings(scene, { warnings = [] }, losses = []) {
  for (const warning of [...warnings, ...losses]) console.error(`${scene}: ${warning}`);
}

/** Whether it is a file system error: ENOENT, EACCES, ENOSPC. Its message is clear enough for users. */
const isOfFiles = ({ code, syscall }) => syscall !== undefined || /^E[A-Z]+$/.test(code);

const figures = {};

/** Adds figures of the file that was read or written to the row of a batch: `splats`, `psnr`. */
export const report = (found) => Object.assign(figures, found);

/** Sends the result to the process that runs a batch, if this is one of its commands. */
const send = (message) => new Promise((resolve) => (process.send ? process.send(message, resolve) : resolve()));

/**
 * Runs a command and ends the process, which Dawn would keep alive: exit code 0, 2 for an invalid command line, 1 for
 * other errors.
 * @param usage {string}
 * @param parse {(args: string[]) => object | undefined} Undefined if help is requested.
 * @param main {(options: object) => Promise<void>}
 * @param batch How the command runs for several files: see `runBatch` of batch.mjs.
 */
export async function runCommand(usage, parse, main, batch) {
  const shownUsage = usage.replaceAll('gaussian-splat ', `${PROGRAM} `);
  // A file of a batch ends with it: the next call would meet its process in the same folder.
  process.once('disconnect', () => process.exit(1));
  try {
    const options = parse(process.argv.slice(2));
    if (options === undefined) console.log(shownUsage + severalIn(usage));
    else await main(options);
    await send({ figures });
    process.exit(0);
  } catch (error) {
    const shown = error instanceof SeveralInputs ? await runSeveral(error, batch) : error;
    const { message, code } = shown;
    await send({ error: { message, code } });
    if (shown instanceof UsageError)
      console.error(`${message}\n\n${shownUsage.split('\n\n')[0]}\n--help lists the options.`);
    // File system errors contain the file name, except for reading a folder.
    else if (code === 'EISDIR') console.error(`${message}: expected a file, found a folder`);
    else if (shown instanceof GaussianSplatError || shown instanceof CommandError || isOfFiles(shown))
      console.error(message);
    else console.error(shown);
    process.exit(shown instanceof UsageError ? 2 : 1);
  }
}

const severalIn = (usage) => `
Several files, a folder, or a pattern such as "scenes/**/*.ply" in place of SCENE${usage.includes('--out') ? ': --out names a folder for all outputs,\n--as their extension' : ''}.
A file with an error does not stop the others; results.json has the table, and a second run continues.
Exit status 1 if a file has an error.
`;

/** Runs a command for several files, and ends the process. @returns The error of a run that could not begin. */
async function runSeveral({ inputs, values }, batch) {
  try {
    const { runBatch } = await import('./batch.mjs');
    process.exit(await runBatch(batch, inputs, values));
  } catch (error) {
    return error;
  }
}
