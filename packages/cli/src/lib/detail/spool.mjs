/**
 * The splats of a scene on the disk: all of them as rows in the order of the files, and those of a part of the scene in
 * its order. At no time more than a cell of the scene is in memory.
 */
import { createHash } from 'node:crypto';
import {
  closeSync,
  existsSync,
  fstatSync,
  mkdirSync,
  mkdtempSync,
  openSync,
  readdirSync,
  readFileSync,
  renameSync,
  rmdirSync,
  rmSync,
  writeFileSync,
} from 'node:fs';
import { dirname, join } from 'node:path';
import { toDegree } from '@gaussian-splat/core';
import { joinCredits, MAX_DROPPED_RATIO, readScene } from '@gaussian-splat/formats';
import {
  countShells,
  keysOf,
  MAX_SHELLS,
  orderBy,
  placeShells,
  planScene,
  positionsFrom,
  sampleStep,
} from '@gaussian-splat/optimize/pages';
import { CommandError, version } from '../command.mjs';
import { readWhole } from '../input-file.mjs';
import { writeOnce } from '../output-file.mjs';
import { blocksOf, readAt, stateOf } from './inputs.mjs';

/** Rows that are read at once. */
const BLOCK = 1 << 16;
/** Bits of a code that a bin of the histogram has in the first shell, and in the others, which few splats are in. */
const binShift = (shell) => (shell === 0 ? 12 : 20);

/** Numbers of a row, in this order: center, scales, rotation, opacity, harmonics. */
const WIDTHS = { positions: 3, scales: 3, rotations: 4, opacities: 1 };
const shWidth = (degree) => 3 * (degree + 1) ** 2;
export const rowNumbers = (degree) => 11 + shWidth(degree);
const columnsOf = (degree) => Object.entries({ ...WIDTHS, sh: shWidth(degree) });

/** Copies splats of a cloud to rows, or rows to the columns of a cloud if `isBack`. */
function copyRows(cloud, degree, rows, isBack = false) {
  const numbers = rowNumbers(degree);
  let column = 0;
  for (const [name, width] of columnsOf(degree)) {
    const values = cloud[name];
    for (let k = 0, at = column; k < cloud.count; k++, at += numbers)
      for (let n = 0; n < width; n++)
        if (isBack) values[width * k + n] = rows[at + n];
        else rows[at + n] = values[width * k + n];
    column += width;
  }
}

function emptyCloud(count, degree) {
  const columns = columnsOf(degree).map(([name, width]) => [name, new Float32Array(width * count)]);
  return { count, shDegree: degree, ...Object.fromEntries(columns), droppedCount: 0 };
}

/** Returns a part of a cloud, in the same memory. */
function partOf(cloud, first, count) {
  const columns = columnsOf(cloud.shDegree).map(([name, width]) => [
    name,
    cloud[name].subarray(width * first, width * (first + count)),
  ]);
  return { ...cloud, count, ...Object.fromEntries(columns) };
}

const bytesOf = (array) => new Uint8Array(array.buffer, array.byteOffset, array.byteLength);

/**
 * Reads all files of a scene once, and finds the order of its splats. The result is in a folder: another part of the
 * build, or another run, takes it from there.
 * @param options `degree`: highest of harmonics; `geometry`; `maxBytes` for files that are read whole; `facts` on which
 * files depend, too; `divide(spool)`: returns what is decided once for all parts.
 * @returns The plan, and where the splats are; see {@link splatsOfPart}.
 */
export async function openSpool(folder, inputs, { degree: highest, geometry, maxBytes, facts, divide }) {
  const key = createHash('sha256')
    .update(JSON.stringify([version, stateOf(inputs), highest, geometry ?? null, facts]))
    .digest('hex');
  const path = join(folder, 'plan.json');
  if (existsSync(path)) {
    const known = JSON.parse(readFileSync(path, 'utf8'));
    if (known.key !== key)
      throw new CommandError(
        `${folder} is of other files or options, or of another version: remove it, or repeat the command as it was`,
      );
    return { ...known, folder };
  }
  mkdirSync(folder, { recursive: true });
  // Processes of other machines and containers may have the same number.
  const place = mkdtempSync(join(folder, 'reading-'));
  const [temporary, own] = [join(place, 'inflated'), join(place, 'rows')];
  try {
    const rows = await writeRows(own, inputs, { highest, temporary, maxBytes });
    const found = { key, geometry, ...rows, ...findOrder(own, rows, geometry) };
    renameSync(own, join(folder, 'rows'));
    // The plan of the first part is that of all: they may have more memory, and larger cells.
    writeOnce(path, JSON.stringify({ ...found, ...divide(found) }));
    return { ...JSON.parse(readFileSync(path, 'utf8')), folder };
  } finally {
    rmSync(place, { recursive: true, force: true });
    if (!existsSync(path)) removeEmpty([folder, dirname(folder)]);
  }
}

function removeEmpty(folders) {
  for (const folder of folders) if (existsSync(folder) && readdirSync(folder).length === 0) rmdirSync(folder);
}

/** Writes all splats as rows, with centers relative to the origin of their file. */
async function writeRows(path, inputs, { highest, temporary, maxBytes }) {
  const options = { temporary, maxBytes };
  const degree = Math.min(highest, await degreeOf(inputs, options));
  const segments = [];
  const box = { min: [Infinity, Infinity, Infinity], max: [-Infinity, -Infinity, -Infinity] };
  const [warnings, credits] = [new Set(), new Set()];
  let [count, droppedCount, facts] = [0, 0, undefined];
  const file = openSync(path, 'w');
  try {
    for (const input of inputs) {
      let [dropped, before] = [0, count];
      for await (const block of blocksOf(input, options)) {
        const cloud = toDegree(degree, block);
        const { antialiased, filterVariance, hints, turn } = cloud;
        facts ??= { rule: { antialiased, filterVariance, hints }, turn };
        credits.add(JSON.stringify(hints?.credits ?? null));
        if (antialiased !== facts.rule.antialiased || filterVariance !== facts.rule.filterVariance)
          throw new CommandError(`${input.path}: expected the low-pass filter of ${inputs[0].path}, found another one`);
        for (const warning of cloud.warnings ?? []) warnings.add(warning);
        dropped += cloud.droppedCount;
        if (segments.at(-1)?.origin.join() !== cloud.origin.join())
          segments.push({ first: count, origin: cloud.origin });
        growBox(box, cloud);
        const rows = new Float32Array(rowNumbers(degree) * cloud.count);
        copyRows(cloud, degree, rows);
        writeFileSync(file, bytesOf(rows));
        count += cloud.count;
      }
      // Reading the whole file reports why its splats are unusable.
      if (dropped > MAX_DROPPED_RATIO * (count - before + dropped))
        await readScene(await readWhole(input.path), { name: input.path, maxBytes });
      droppedCount += dropped;
    }
  } finally {
    closeSync(file);
  }
  if (count === 0) throw new CommandError(`${inputs[0].path}: expected splats, found none`);
  const all = [...credits].map((text) => JSON.parse(text) ?? undefined);
  facts.rule.hints = { ...facts.rule.hints, credits: joinCredits(all) };
  return { count, degree, segments, box, ...facts, droppedCount, warnings: [...warnings] };
}

async function degreeOf(inputs, options) {
  let degree = 0;
  for (const input of inputs)
    for await (const { shDegree } of blocksOf(input, options)) {
      degree = Math.max(degree, shDegree);
      break;
    }
  return degree;
}

function growBox({ min, max }, { count, positions, origin }) {
  for (let axis = 0; axis < 3; axis++) {
    let [low, high] = [Infinity, -Infinity];
    for (let i = axis; i < 3 * count; i += 3) {
      low = Math.min(low, positions[i]);
      high = Math.max(high, positions[i]);
    }
    min[axis] = Math.min(min[axis], low + origin[axis]);
    max[axis] = Math.max(max[axis], high + origin[axis]);
  }
}

/** Calls a function with blocks of rows as clouds, in their order. */
function forRows(path, { count, degree, segments }, use) {
  const file = openSync(path);
  const rows = new Float32Array(rowNumbers(degree) * Math.min(BLOCK, count));
  try {
    segments.forEach(({ first, origin }, k) => {
      const end = segments[k + 1]?.first ?? count;
      for (let at = first; at < end; at += BLOCK) {
        const block = rows.subarray(0, rowNumbers(degree) * Math.min(BLOCK, end - at));
        readAt(file, bytesOf(block), 4 * rowNumbers(degree) * at);
        use({ rows: block, count: block.length / rowNumbers(degree), first: at, origin });
      }
    });
  } finally {
    closeSync(file);
  }
}

/** Returns the centers of a block relative to the origin of a plan. */
function centersOf({ rows, count, origin }, degree, to) {
  const positions = new Float32Array(3 * count);
  for (let k = 0; k < count; k++)
    for (let axis = 0; axis < 3; axis++) positions[3 * k + axis] = rows[rowNumbers(degree) * k + axis];
  return positionsFrom(to, { origin, positions });
}

/** Finds the plan of a scene in a sample, and counts its splats along the curve of the plan. */
function findOrder(path, spool, geometry) {
  const { count, degree, segments, box, rule } = spool;
  const step = sampleStep(count);
  const sample = { ...emptyCloud(Math.ceil(count / step), degree), ...rule, origin: segments[0].origin };
  const numbers = rowNumbers(degree);
  let taken = 0;
  forRows(path, spool, (block) => {
    const begun = taken;
    for (let k = (step - (block.first % step)) % step; k < block.count; k += step, taken++)
      block.rows.copyWithin(numbers * (taken - begun), numbers * k, numbers * (k + 1));
    const part = partOf(sample, begun, taken - begun);
    copyRows(part, degree, block.rows, true);
    part.positions.set(positionsFrom(sample.origin, { origin: block.origin, positions: part.positions }));
  });
  const plan = planScene(sample, box, geometry, count);
  const shells = new Float64Array(MAX_SHELLS);
  const bins = [];
  forRows(path, spool, (block) => {
    const keys = keysOf(plan, centersOf(block, degree, plan.origin), block.first);
    countShells(keys, shells);
    for (let k = 0; k < block.count; k++) {
      const shell = keys.shells[k];
      bins[shell] ??= new Float64Array(2 ** (32 - binShift(shell)));
      bins[shell][keys.codes[k] >>> binShift(shell)]++;
    }
  });
  return { plan, shells: [...shells], bins: Array.from(bins, (own = []) => sparse(own)) };
}

/** Returns [bin, count] of the bins that are not empty. */
function sparse(bins) {
  const found = [];
  bins.forEach((count, bin) => count > 0 && found.push(bin, count));
  return found;
}

/** Returns the number of splats in the order of a scene, with padding. */
export const placesOf = ({ shells }) => placeShells(Float64Array.from(shells));

/**
 * Divides the splats of a range of cells among files, one for the splats that begin in each cell.
 * @param folder A new folder of this process alone: a lost process may still write to its own.
 * @param range First and last cell, the last one excluded, and the number of splats of a cell.
 * @returns A reader: `read(first, end)` returns the cloud of a range of the order, with padding of opacity 0.
 */
export function splatsOfPart(spool, folder, { first: firstCell, end: endCell, cellSplats }) {
  const { degree, plan, rule } = spool;
  const { starts, fillers } = placesOf(spool);
  const numbers = rowNumbers(degree);
  const [from, to] = [firstCell * cellSplats, endCell * cellSplats];
  // Each run of bins that begins in one cell has a file; splats of the last bin may belong to the next cell.
  const [files, fileOf] = [[], []];
  spool.bins.forEach((pairs, shell) => {
    let place = starts[shell];
    for (let k = 0; k < pairs.length; k += 2) {
      const [bin, count] = [pairs[k], pairs[k + 1]];
      const cell = Math.floor(place / cellSplats);
      if (place < to && place + count > from) {
        if (files.at(-1)?.cell !== cell || files.at(-1).shell !== shell)
          files.push({ cell, shell, first: place, end: place, path: join(folder, `${shell}-${cell}.rows`) });
        files.at(-1).end = place + count;
        fileOf[shell] ??= new Int32Array(2 ** (32 - binShift(shell))).fill(-1);
        fileOf[shell][bin] = files.length - 1;
      }
      place += count;
    }
  });
  scatter(spool, files, fileOf);
  const readFile = (file) => {
    const opened = openSync(file.path);
    const rows = new Float32Array(fstatSync(opened).size / 4);
    readAt(opened, bytesOf(rows), 0);
    closeSync(opened);
    const count = rows.length / numbers;
    const positions = new Float32Array(3 * count);
    for (let k = 0; k < count; k++) positions.set(rows.subarray(numbers * k, numbers * k + 3), 3 * k);
    return { rows, order: orderBy(keysOf(plan, positions)) };
  };
  return {
    read(first, end) {
      const cloud = { ...emptyCloud(end - first, degree), ...rule, origin: plan.origin };
      const sorted = new Float32Array(numbers * Math.min(BLOCK, end - first));
      for (const file of files) {
        if (file.end <= first || file.first >= end) continue;
        const { rows, order } = readFile(file);
        const last = Math.min(end, file.end);
        for (let place = Math.max(first, file.first); place < last; place += BLOCK) {
          const part = partOf(cloud, place - first, Math.min(BLOCK, last - place));
          for (let k = 0; k < part.count; k++) {
            const at = numbers * order[place - file.first + k];
            for (let n = 0; n < numbers; n++) sorted[numbers * k + n] = rows[at + n];
          }
          copyRows(part, degree, sorted, true);
        }
      }
      for (const gap of fillers)
        for (let place = Math.max(first, gap.first); place < Math.min(end, gap.end); place++) {
          for (const [name, width] of columnsOf(degree)) {
            const k = place - first;
            cloud[name].copyWithin(width * k, width * (k - 1), width * k);
          }
          cloud.opacities[place - first] = 0;
        }
      return cloud;
    },
  };
}

/** Bytes that wait to be written to all files. */
const PENDING = 1 << 26;

function scatter(spool, files, fileOf) {
  const { degree, plan } = spool;
  const numbers = rowNumbers(degree);
  const room = Math.max(1, Math.floor(PENDING / Math.max(1, files.length) / (4 * numbers)));
  const pending = files.map(() => ({ rows: new Float32Array(numbers * room), count: 0 }));
  const flush = (k) => {
    const file = openSync(files[k].path, 'a');
    writeFileSync(file, bytesOf(pending[k].rows.subarray(0, numbers * pending[k].count)));
    closeSync(file);
    pending[k].count = 0;
  };
  forRows(join(spool.folder, 'rows'), spool, (block) => {
    const positions = centersOf(block, degree, plan.origin);
    const { shells, codes } = keysOf(plan, positions, block.first);
    for (let k = 0; k < block.count; k++) {
      const file = fileOf[shells[k]]?.[codes[k] >>> binShift(shells[k])] ?? -1;
      if (file < 0) continue;
      const own = pending[file];
      const at = numbers * own.count++;
      own.rows.set(block.rows.subarray(numbers * k, numbers * (k + 1)), at);
      for (let axis = 0; axis < 3; axis++) own.rows[at + axis] = positions[3 * k + axis];
      if (own.count === room) flush(file);
    }
  });
  files.forEach((_, k) => flush(k));
}
