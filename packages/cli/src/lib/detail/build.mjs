/** Builds the pages of a scene by cells, each of which fits into the memory; a part of a build has some of the cells. */
import { existsSync, mkdirSync, mkdtempSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { totalmem } from 'node:os';
import { join } from 'node:path';
import {
  codingFor,
  DEFAULT_STEPS,
  manifestOf,
  packPage,
  packTop,
  PageEncoder,
  SceneCells,
} from '@gaussian-splat/optimize/pages';
import { CommandError, UsageError } from '../command.mjs';
import { deflate } from '../encoders.mjs';
import { writeWhole } from '../output-file.mjs';
import { openSpool, placesOf, rowNumbers, splatsOfPart } from './spool.mjs';

/** Bytes that the program needs besides the splats of a cell. */
const BASE = 3e8;
/** Merges of the largest and of the smallest cells: of 16.8 million and of 4,096 splats. */
const [MAX_MERGES, MIN_MERGES] = [8, 2];

/** Folder of an unfinished build, in the folder of the scene. */
export const UNFINISHED = 'unfinished';

const topName = (cell) => `cell-${String(cell).padStart(6, '0')}.top`;
const fileOf = (page) => `pages/scene-${String(page).padStart(5, '0')}.bin`;

/** Bytes of a cell while it is built: its rows and its columns, then its levels. */
const cellBytes = (splats, degree) => splats * (3 * 4 * rowNumbers(degree) + 100);

/** Parses a size such as 2GB, 800MB or 4e9. @throws UsageError */
export function parseMemory(text) {
  if (text === undefined) return totalmem() / 2;
  const [, number, unit = ''] = /^(\d+\.?\d*(?:e\d+)?) ?([KMGT]?i?B?)$/i.exec(text) ?? [];
  const power = ' KMGT'.indexOf(unit[0]?.toUpperCase() ?? ' ');
  const bytes = Number(number) * (/i/i.test(unit) ? 1024 : 1000) ** Math.max(0, power);
  if (!(bytes > BASE)) throw new UsageError(`--memory: expected a size above 300MB such as 2GB, found "${text}"`);
  return bytes;
}

/**
 * Opens a build: reads the files of the scene, unless a run or another part has done it, and divides it into cells.
 * @param out Folder of the scene.
 */
export async function openBuild(out, inputs, { degree, geometry, memory, facts }) {
  const folder = join(out, UNFINISHED);
  const maxBytes = memory - BASE;
  const divide = (spool) => ({ merges: mergesFor(placesOf(spool).end, spool.degree, maxBytes) });
  const spool = await openSpool(folder, inputs, { degree, geometry, maxBytes, facts, divide });
  return { out, folder, spool, cells: new SceneCells(placesOf(spool).end, spool.merges) };
}

function mergesFor(splats, degree, maxBytes) {
  let merges = MAX_MERGES;
  while (merges > MIN_MERGES && cellBytes(Math.min(splats, SceneCells.splatsOf(merges)), degree) > maxBytes)
    merges -= 2;
  return merges;
}

/** Returns the tree of a scene of one cell, and its splats. */
export function wholeTree({ folder, spool, cells }) {
  const reader = splatsOfPart(spool, mkdtempSync(join(folder, 'whole-')), { first: 0, end: 1, ...sizeOfCells(cells) });
  const cloud = reader.read(0, cells.counts[0]);
  return { tree: { ...cells.build(spool.plan, cloud), splats: spool.count }, cloud };
}

/** Merges of the run in which the coding of a scene of several cells is measured, of 65,536 splats. */
const MEASURED_MERGES = 4;

/** Returns the tree of the run in the middle of a scene of several cells, and its splats. */
export function middleTree({ folder, spool, cells }) {
  const merges = Math.min(MEASURED_MERGES, cells.merges);
  const runs = new SceneCells(cells.counts[0], merges);
  const run = runs.count >> 1;
  const own = mkdtempSync(join(folder, 'middle-'));
  const reader = splatsOfPart(spool, own, { first: run, end: run + 1, ...sizeOfCells(runs) });
  const { first, end } = runs.range(run);
  const cloud = reader.read(first, end);
  rmSync(own, { recursive: true });
  const tree = new SceneCells(cloud.count, merges).build(spool.plan, cloud);
  return { tree: { ...tree, splats: cloud.count }, cloud };
}

const sizeOfCells = ({ merges }) => ({ cellSplats: SceneCells.splatsOf(merges) });

/**
 * Builds the cells of a part, and writes their pages and their coarsest chunks. Finished cells are not built again.
 * @param part `{index, of}`: the part, from 1 on, and the number of parts.
 * @param codingOf Resolves to the coding of the files of a tree with a cloud, for `writePages`; to undefined for
 * uncompressed ones.
 * @param onCell Called with the number of finished cells, and of cells of the part.
 */
export async function buildPart(build, { index, of }, { codingOf, onCell = () => undefined }) {
  const { out, folder, spool, cells } = build;
  const first = Math.floor(((index - 1) * cells.count) / of);
  const end = Math.floor((index * cells.count) / of);
  mkdirSync(join(out, 'pages'), { recursive: true });
  const isDone = (cell) => existsSync(join(folder, topName(cell)));
  let own;
  let reader;
  for (let cell = first; cell < end; cell++) {
    if (!isDone(cell)) {
      own ??= mkdtempSync(join(folder, `part-${index}-of-${of}-`));
      reader ??= splatsOfPart(spool, own, { first, end, ...sizeOfCells(cells) });
      const range = cells.range(cell);
      const cloud = reader.read(range.first, range.end);
      const tree = cells.build(spool.plan, cloud);
      writePages(out, tree, cells.files(cell), await codingOf(tree, cloud));
      writeWhole(join(folder, topName(cell)), packTop(tree));
    }
    onCell(cell - first + 1, end - first);
  }
  if (own) rmSync(own, { recursive: true });
}

function writePages(out, tree, files, coded) {
  const encoder = coded && new PageEncoder(tree, coded.coding, coded);
  for (const { page, index } of files) {
    const bytes = encoder ? encoder.encode(page) : new Uint8Array(packPage(tree, page).buffer);
    writeFileSync(join(out, fileOf(index)), bytes);
  }
}

/**
 * Builds the levels above the cells, and writes their pages and the manifest.
 * @returns The manifest.
 * @throws CommandError if parts are missing
 */
export function joinParts({ out, folder, spool, cells }, coded) {
  const missing = Array.from({ length: cells.count }, (_, cell) => cell).filter(
    (cell) => !existsSync(join(folder, topName(cell))),
  );
  if (missing.length > 0)
    throw new CommandError(
      `${missing.length} of ${cells.count} cells are missing, the first is ${missing[0]}: repeat the parts that have not ended, with the same options`,
    );
  const { plan, degree, count } = spool;
  if (cells.count > 1) {
    const tops = Array.from({ length: cells.count }, (_, cell) => {
      const bytes = readFileSync(join(folder, topName(cell)));
      return new Float32Array(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
    });
    const top = cells.join(plan, tops, degree);
    writePages(out, top, cells.files(undefined), coded);
  }
  return manifestOf({ ...plan, splats: count, levels: [{ shDegree: degree }] }, cells.pages, fileOf, coded?.coding);
}

/** Writes the manifest, which is last, and removes what the build needed. */
export function finishBuild({ out, folder }, manifest) {
  writeWhole(join(out, 'detail.json'), JSON.stringify(manifest));
  rmSync(folder, { recursive: true });
}

/** Coding of the files of a scene of several cells that is not measured. */
export const usualCoding = (minPsnr) => minPsnr && { coding: codingFor(DEFAULT_STEPS), deflate };

/** Whether a folder contains what an interrupted build leaves, and nothing else. */
export function isUnfinished(out) {
  const names = readdirSync(out);
  if (names.some((name) => name !== 'pages' && name !== UNFINISHED)) return false;
  const pages = join(out, 'pages');
  if (!existsSync(pages)) return true;
  return readdirSync(pages).every((name) => /^(scene|top|part)-\d{5,}\.bin$/.test(name));
}
