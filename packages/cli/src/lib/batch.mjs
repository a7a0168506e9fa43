/**
 * Many inputs of one command: files, folders and patterns. Each file runs in a process of its own, so that no file can
 * end the others, and its memory is freed. Finished files are recorded, and are not processed again.
 */
import { spawn } from 'node:child_process';
import { createHash } from 'node:crypto';
import { existsSync, mkdirSync, readdirSync, readFileSync, realpathSync, rmSync, statSync } from 'node:fs';
import { basename, dirname, extname, join, relative, resolve, sep } from 'node:path';
import { fileURLToPath } from 'node:url';
import { sceneFormats } from '@gaussian-splat/formats';
import { CommandError, isCollection, UsageError, version } from './command.mjs';
import { filesBeside } from './files-beside.mjs';
import { obstacleToFolder, writeWhole } from './output-file.mjs';

const BIN = fileURLToPath(new URL('../../bin/gaussian-splat.mjs', import.meta.url));

/** File of an output folder with the rows of the table. */
export const RESULTS = 'results.json';

/** Files that stand for their folder: the other files of the folder belong to them. */
const MANIFESTS = ['meta.json', 'lod-meta.json', 'detail.json', 'tileset.json'];
const SCENES = new Set(sceneFormats.flatMap(({ extensions }) => extensions).filter((end) => end !== '.json'));

const endOf = (path) => extname(path).toLowerCase();
/** Whether a file of a folder is a scene, by its name. Not every ZIP archive is one. */
const isScene = (path) => (SCENES.has(endOf(path)) && endOf(path) !== '.zip') || isManifest(path);
const isManifest = (path) => MANIFESTS.includes(basename(path).toLowerCase());
const isFolder = (path) => existsSync(path) && statSync(path).isDirectory();

/**
 * Runs a command for each file of its inputs, and writes a table and its rows, {@link RESULTS}.
 * @param batch What the command says about itself:
 * `name` of the command; `endings` of its outputs, the default first, '' for a folder; undefined if it writes none;
 * `accepts(path, isScene)`: whether a file of a folder is an input; `single`: options that need a single input;
 * `argumentsFor(input, out)`: arguments of one file; `own`: options of the batch, not of its files;
 * `emptied`: endings of outputs whose folder must be empty; `continues(folder)`: whether it holds what a run continues;
 * `finish(folder, rows)`: called with all rows; `afterwards(folder, values)`: called after the table.
 * @param inputs {string[]} Files, folders and patterns.
 * @param values Options of the command line, without their defaults.
 * @returns {Promise<number>} Exit status: 0 if all files have an output.
 */
export async function runBatch(batch, inputs, values) {
  const { name, endings, single = [], finish } = batch;
  for (const option of single)
    if (values[option] !== undefined)
      throw new UsageError(`--${option}: expected with one file, found ${inputs.join(' ')}`);
  const folder = values.out && resolve(values.out);
  if (endings && !folder) throw new UsageError('--out is missing: expected a folder for the outputs of several files');
  const ending = endingOf(endings, values.as);
  const obstacle = folder && obstacleToFolder(folder);
  if (obstacle) throw new UsageError(`--out: ${obstacle}; several files need a folder`);
  const known = new Map(recorded(folder, name).map((row) => [row.file, row]));
  const jobs = jobsOf(inputs, { ...batch, ending, folder, known });
  if (folder) mkdirSync(folder, { recursive: true });
  const rows = [];
  for (const [k, job] of jobs.entries()) {
    const before = await inputOf(job.path);
    const key = keyOf({ name, values, before });
    const last = known.get(job.file);
    const isDone = last?.key === key && (last.error ? isOfFile(last.code) : hasOutput(job.out, last));
    const out = job.out && relative(folder, job.out);
    const recordWith = (row) => {
      rows[k] = { file: job.file, out, key, ...row, bytesBefore: before.bytes };
      if (folder) record(folder, name, [...rows, ...jobs.slice(k + 1).flatMap(({ file }) => known.get(file) ?? [])]);
    };
    const target = batch.emptied?.includes(ending) ? outputOf(job.out) : undefined;
    const wasOurs = last?.out === out && (!last.error || last.isOurs);
    const isOurs = target && (wasOurs || !existsSync(target) || readdirSync(target).length === 0);
    if (!isDone) {
      process.stderr.write(`${k + 1} of ${jobs.length}  ${job.file}\n`);
      // A folder that the batch itself has begun is replaced, unless it can be continued.
      if (target && wasOurs && !(last.key === key && batch.continues?.(target)))
        rmSync(target, { recursive: true, force: true });
      recordWith({ error: 'was ended early', isOurs });
    }
    recordWith(isDone ? { ...last, isKept: true } : { ...(await runJob(batch, job, values)), isOurs });
  }
  await finish?.(folder, rows);
  console.log(tableOf(rows));
  const failed = rows.filter(({ error }) => error);
  const kept = rows.filter(({ isKept }) => isKept).length;
  console.log(
    `\n${rows.length - failed.length} of ${rows.length} files ${endings ? `written to ${folder}` : 'without a fault'}` +
      `${kept > 0 ? `, ${kept} of them were known` : ''}${failed.length > 0 ? `; ${failed.length} with an error` : ''}`,
  );
  await batch.afterwards?.(folder, values);
  return failed.length > 0 ? 1 : 0;
}

function endingOf(endings, asked) {
  const ending = asked === undefined ? endings?.[0] : endings?.find((one) => one.replace(/^[./]/, '') === asked);
  if (asked !== undefined && ending === undefined)
    throw new UsageError(
      `--as: expected ${(endings ?? []).filter(Boolean).join(', ') || 'no such option'}, found "${asked}"`,
    );
  return ending;
}

/** Returns the files of inputs, each with its name in the table and its output. */
function jobsOf(inputs, { accepts = isScene, ending, folder, known }) {
  const found = new Map();
  // The folder of the outputs may be that of the inputs.
  const outputs = new Set([...known.values()].map(({ out }) => out && join(folder, out)));
  for (const input of inputs)
    for (const [path, name] of filesOf(input, accepts, folder))
      if (!found.has(path) && !(isCollection(input) && [path, dirname(path)].some((one) => outputs.has(one))))
        found.set(path, name);
  if (found.size === 0) throw new UsageError(`expected scenes, found none in ${inputs.join(', ')}`);
  const plain = [...found.values()].map((name) => withoutEnd(name));
  const jobs = [...found].map(([path, file], k) => {
    const isOne = plain.indexOf(plain[k]) === k && plain.lastIndexOf(plain[k]) === k;
    return {
      path,
      file,
      out: ending === undefined ? undefined : join(folder, (isOne ? plain[k] : file) + (ending ?? '')),
    };
  });
  const twin = jobs.find(({ out }, k) => out && jobs.findIndex((job) => job.out === out) !== k);
  if (twin) throw new UsageError(`two inputs would become ${twin.out}: name the folder that contains both`);
  return jobs;
}

/** Returns [path, name] of the files of an input. Names are relative to its folder; a manifest has that of its folder. */
function filesOf(input, accepts, out) {
  if (URL.canParse(input) && /^https?:/.test(input)) return [[input, basename(new URL(input).pathname)]];
  if (!isCollection(input)) {
    if (!existsSync(input)) throw new UsageError(`There is no file ${input}`);
    return [[resolve(input), nameIn(dirname(resolve(input)), resolve(input))]];
  }
  const parts = resolve(input).split(sep);
  const fixed = isFolder(input) ? parts.length : parts.findIndex((part) => /[*?]/.test(part));
  const root = parts.slice(0, fixed).join(sep) || sep;
  const pattern = isFolder(input) ? undefined : expressionOf(parts.slice(fixed).join('/'));
  const isWanted = (path) =>
    pattern ? pattern.test(relative(root, path).split(sep).join('/')) : accepts(path, isScene);
  return walk(root, out, pattern !== undefined)
    .filter(isWanted)
    .map((path) => [path, nameIn(root, path)]);
}

/** Returns the files below a folder. Of a folder with a manifest only the manifest, unless a pattern asks for `all`. */
function walk(folder, out, all, above = []) {
  if (!existsSync(folder)) return [];
  const own = realpathSync(folder);
  // A link to a folder above it would never end.
  if (above.includes(own)) return [];
  const entries = readdirSync(folder, { withFileTypes: true }).filter(({ name }) => !name.startsWith('.'));
  entries.sort((a, b) => (a.name < b.name ? -1 : 1));
  const manifest = all ? undefined : entries.find((entry) => isManifest(entry.name));
  if (manifest) return [join(folder, manifest.name)];
  return entries.flatMap((entry) => {
    const path = join(folder, entry.name);
    if (!isFolder(path)) return [path];
    return path === out ? [] : walk(path, out, all, [...above, own]);
  });
}

/** Returns the expression of a pattern: `*` and `?` within a name, and `**` for any folders. */
const expressionOf = (pattern) =>
  new RegExp(
    `^${pattern.replace(/[.+^${}()|[\]\\]/g, '\\$&').replace(/\*\*\/|\*\*|\*|\?/g, (sign) => ({ '**/': '(?:.*/)?', '**': '.*', '*': '[^/]*', '?': '[^/]' })[sign])}$`,
  );

const nameIn = (root, path) =>
  isManifest(path) ? relative(root, dirname(path)) || basename(dirname(path)) : relative(root, path);
const withoutEnd = (name) => name.slice(0, name.length - (isScene(name) || extname(name) ? extname(name).length : 0));

/** Returns the size of a file and of the files that it names, in bytes, and their times. */
async function inputOf(path) {
  if (!existsSync(path)) return { bytes: undefined, files: [path] };
  const { found } = await filesBeside(path).catch(() => ({ found: [] }));
  const files = [path, ...found.map((file) => join(dirname(path), file))].map((file) => {
    const { size, mtimeMs } = statSync(file);
    return [relative(dirname(path), file), size, mtimeMs];
  });
  return { bytes: files.reduce((sum, [, size]) => sum + size, 0), files };
}

/** Returns what must not have changed for a recorded result to count: the version, the options, and all read files. */
function keyOf({ name, values, before }) {
  const options = Object.entries(values)
    .filter(([option]) => option !== 'out')
    .map(([option, value]) => [option, value, stateOf(value)]);
  return createHash('sha256')
    .update(JSON.stringify([version, name, options, before.files]))
    .digest('hex')
    .slice(0, 16);
}

function stateOf(value) {
  if (typeof value !== 'string' || !existsSync(value)) return null;
  const { size, mtimeMs } = statSync(value);
  return [size, mtimeMs];
}

/** Whether an error is that of the file itself, so that another try would have the same result. */
const isOfFile = (code) => /^decode[/]/.test(code ?? '');

const sizeOf = (path) =>
  isFolder(path)
    ? readdirSync(path, { recursive: true, withFileTypes: true })
        .filter((entry) => entry.isFile())
        .reduce((sum, entry) => sum + statSync(join(entry.parentPath ?? entry.path, entry.name)).size, 0)
    : statSync(path).size;
const outputOf = (out) => (basename(out) === 'lod-meta.json' ? dirname(out) : out);
const hasOutput = (out, { bytesAfter }) =>
  out === undefined || (existsSync(out) && sizeOf(outputOf(out)) === bytesAfter);

function recorded(folder, name) {
  const path = folder && join(folder, RESULTS);
  if (!path || !existsSync(path)) return [];
  try {
    const { command, rows } = JSON.parse(readFileSync(path, 'utf8'));
    return command === name ? rows : [];
  } catch (error) {
    throw new CommandError(`${path} is damaged (${error.message}): remove it, and all files are processed again`);
  }
}

function record(folder, name, rows) {
  const kept = rows.map((row) => ({ ...row, isKept: undefined }));
  writeWhole(join(folder, RESULTS), JSON.stringify({ command: name, rows: kept }, null, 1));
}

/** Runs the command for one file. @returns A row: its figures, or its error. */
async function runJob({ name, argumentsFor, own: batchOptions = [] }, { path, out }, values) {
  if (out) mkdirSync(dirname(out), { recursive: true });
  const options = Object.entries(values).flatMap(([option, value]) => {
    if (['out', 'as', ...batchOptions].includes(option)) return [];
    return value === true ? [`--${option}`] : [`--${option}=${value}`];
  });
  const own = argumentsFor ? argumentsFor(path, out) : [path, ...(out ? [`--out=${out}`] : [])];
  const begun = performance.now();
  const { status, signal, text, message } = await ended([BIN, name, ...own, ...options]);
  const seconds = Math.round((performance.now() - begun) / 100) / 10;
  const wrong = status === 2 ? (message?.error?.message ?? text) : '';
  // Wrong options end the batch, except for those that are wrong for this file alone.
  if (status === 2 && ![path, out].some((one) => one && wrong.includes(one))) throw new UsageError(wrong);
  if (status !== 0) {
    const error = message?.error?.message ?? (signal ? `ended by ${signal}` : lastLine(text));
    return { error, code: message?.error?.code, seconds };
  }
  return { ...message?.figures, bytesAfter: out && sizeOf(outputOf(out)), seconds };
}

const lastLine = (text) => text.trim().split('\n').at(-1) || 'ended without a message';

/** Runs a script. @returns Exit status, the text that it printed, and the message of `runCommand`. */
function ended(args) {
  return new Promise((done, failed) => {
    const child = spawn(process.execPath, [...process.execArgv, ...args], { stdio: ['ignore', 'pipe', 'pipe', 'ipc'] });
    let [text, message] = ['', undefined];
    child.stdout.on('data', (data) => (text = (text + data).slice(-4096)));
    child.stderr.on('data', (data) => (text = (text + data).slice(-4096)));
    child.on('message', (sent) => (message = sent));
    child.once('error', failed);
    child.once('close', (status, signal) => done({ status, signal, text, message }));
  });
}

const megabytes = (bytes) => (bytes === undefined ? '' : `${(bytes / 1e6).toFixed(bytes < 1e6 ? 3 : 2)}`);

/** Returns the table that a batch ends with. */
function tableOf(rows) {
  const lines = rows.map(({ file, splats, bytesBefore, bytesAfter, psnr, seconds, error = '' }) => [
    ...[file, splats ?? '', megabytes(bytesBefore), megabytes(bytesAfter), psnr?.toFixed(2) ?? '', seconds],
    error.split('\n')[0],
  ]);
  const table = [['file', 'splats', 'MB before', 'MB after', 'dB', 'seconds', 'error'], ...lines].map((line) =>
    line.map(String),
  );
  const widths = table[0].map((_, k) => table.reduce((max, line) => Math.max(max, line[k].length), 0));
  const cell = (text, k) => (k === 0 || k === 6 ? text.padEnd(k === 0 ? widths[k] : 0) : text.padStart(widths[k]));
  return table.map((line) => line.map(cell).join('  ').trimEnd()).join('\n');
}
