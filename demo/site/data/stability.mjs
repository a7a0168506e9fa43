/** The report of `npm run lab -- stability --report` as the page shows it: charts, rows with others beside ours, and every row of the catalog. */
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { latestOf, titleOf } from '../../../scripts/stability/figures.mjs';
import { readHeaders } from '../../../scripts/stability/headers.mjs';
import { isWhole, linesOf, subjectsOf } from '../../../scripts/stability/tables.mjs';
import { root } from '../../../scripts/lib/run.mjs';

const CHARTS = { S1: 'popping', S7: 'distance', S8: 'key-bits', S21: 'zoom' };

export default function stability() {
  const { runs, pages } = JSON.parse(readFileSync(join(root, 'docs/stability/figures.json'), 'utf8'));
  const rows = readHeaders();
  const charts = Object.entries(CHARTS).filter(([id]) => runs.some(({ rows }) => rows[id]?.curves.length > 0));
  return {
    charts: charts.map(([row, file]) => ({ row, file, title: rows.find(({ id }) => id === row).title })),
    adapters: runs.map((run) => ({
      name: titleOf(run.adapter),
      driver: run.adapter.description,
      date: latestOf(run).slice(0, 10),
    })),
    peers: pages.length > 0 && describePages(pages),
    rows: rows.map((row) => describeRow(row, runs)),
  };
}

const number = (value) => String(typeof value === 'number' ? Number(value.toPrecision(4)) : value);

/** dB that a scene may cost a renderer against its value on an ordinary one. */
const MAX_LOSS = 6;

function describePages(pages) {
  const subjects = subjectsOf(pages);
  const { adapter, rows } = pages[0];
  return {
    adapter: adapter === 'google swiftshader' || !adapter ? 'SwiftShader' : adapter,
    subjects: subjects.map(({ name }) => name),
    rows: rows.map(({ row, title }) => ({
      id: row === '-' ? '' : row,
      title,
      results: subjects.map(({ results }) => resultOf(results.get(`${row} ${title}`), ordinaryOf(rows, results))),
    })),
  };
}

/** A renderer's value on the scene for comparison. */
function ordinaryOf(rows, results) {
  const { row, title } = rows.find((each) => each.row === '-') ?? {};
  return results.get(`${row} ${title}`)?.figure;
}

/** A figure, and the renderer's loss on the scene: it is compared with itself, since others' usual image is not the reference image. */
function resultOf({ figure, unit, passes, error } = {}, ordinary) {
  if (error !== undefined) return { text: error, isLoss: true };
  if (passes === undefined) return { text: '', isLoss: false };
  const loss = unit === 'dB' && typeof figure === 'number' ? ordinary - figure : undefined;
  const isLoss = loss === undefined ? !passes : loss > MAX_LOSS;
  return {
    text: `${number(figure)} ${unit}`,
    isLoss,
    loss: isLoss && loss !== undefined ? `−${number(Math.round(loss))} dB` : '',
  };
}

function describeRow({ id, title, fails, recipe, passes }, runs) {
  const able = runs.filter(({ rows }) => rows[id] !== undefined);
  const columns = able.map(({ rows }) => rows[id].figures);
  return {
    ...{ id, title, fails, recipe, passes },
    anchor: id.toLowerCase(),
    adapters: able.map(({ adapter, rows }) => `${titleOf(adapter)}${isWhole(rows[id]) ? '' : ', a part'}`),
    failed: able.filter(({ rows }) => rows[id].passed === false).map(({ adapter }) => titleOf(adapter)),
    figures: linesOf(columns).map(({ what, unit, limit, figures }) => ({
      ...{ what, limit },
      measured: figures.map((figure) => ({
        text: figure === undefined ? '' : `${number(figure.value)} ${unit}`,
        isKept: figure === undefined || isKept(figure),
      })),
    })),
    summary: summaryOf(columns.flat()),
  };
}

const hasLimit = ({ atLeast, atMost }) => atLeast !== undefined || atMost !== undefined;
const isKept = ({ value, atLeast = -Infinity, atMost = Infinity }) => value >= atLeast && value <= atMost;

/** Summary of a row for readers who have not opened it. Rows without figures pass or fail as tests. */
function summaryOf(figures) {
  const limited = figures.filter(hasLimit);
  if (limited.length === 0) return figures.length === 0 ? 'a test without figures' : `${figures.length} figures`;
  const kept = limited.filter(isKept).length;
  if (kept === limited.length) return kept === 1 ? 'its limit kept' : `all ${kept} limits kept`;
  return `${kept} of ${limited.length} limits kept`;
}
