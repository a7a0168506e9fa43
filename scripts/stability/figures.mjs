/**
 * Figures of the catalog by the adapter that they were measured on. A figures file (tests/stability/support/row.ts writes it) is JSON lines: one of the adapter and
 * the time, then figures and curves of rows that it drew, then whether a row passed; the next line of an adapter begins another run.
 */
import { readFileSync } from 'node:fs';

/**
 * @typedef {{vendor: string, architecture: string, device: string, description: string}} Adapter as `GPUAdapterInfo` says it
 * @typedef {{date: string, passed?: boolean, figures: object[], curves: object[]}} Row the result of a row's last run; `passed` is missing if it was not recorded
 * @typedef {{adapter: Adapter, rows: Record<string, Row>}} Run the rows of one adapter, by id
 */

/** @returns {Run[]} the runs of a figures file. Throws for lines before the first adapter's. */
export function parseFigures(text, name) {
  const runs = [];
  let date;
  for (const line of text.split('\n').filter(Boolean)) {
    const { row, adapter, ...entry } = JSON.parse(line);
    if (adapter) {
      date = entry.date;
      runs.push({ adapter, rows: {} });
      continue;
    }
    if (runs.length === 0)
      throw new Error(
        `${name}: expected a line of the adapter first, found figures. Run the rows again with npm run lab -- stability`,
      );
    addEntry((runs.at(-1).rows[row] ??= { date, figures: [], curves: [] }), entry);
  }
  return runs;
}

function addEntry(row, entry) {
  if (entry.what !== undefined) row.figures.push(entry);
  else if (entry.chart !== undefined) row.curves.push({ name: entry.chart, points: entry.points });
  else row.passed = entry.passed;
}

/**
 * Merges runs of the same adapter: of each row the latest, whole or not. SwiftShader, which runs everywhere, comes
 * first.
 */
export function mergeRuns(runs) {
  const byAdapter = new Map();
  for (const { adapter, rows } of [...runs].sort((a, b) => latestOf(a).localeCompare(latestOf(b)))) {
    const merged = byAdapter.get(keyOf(adapter))?.rows ?? {};
    for (const [id, row] of Object.entries(rows)) if (row.date >= (merged[id]?.date ?? '')) merged[id] = row;
    byAdapter.set(keyOf(adapter), { adapter, rows: merged });
  }
  const rank = ({ adapter }) => `${isSwiftShader(adapter) ? 0 : 1} ${keyOf(adapter)}`;
  return [...byAdapter.values()].sort((a, b) => rank(a).localeCompare(rank(b)));
}

/** When a run's last row was drawn. */
export const latestOf = ({ rows }) =>
  Object.values(rows).reduce((latest, { date }) => (date > latest ? date : latest), '');

/** The driver may change, the adapter is the same. */
const keyOf = ({ vendor, architecture, device }) => [vendor, architecture, device].join(' ');

const isSwiftShader = (adapter) => /swiftshader/i.test(keyOf(adapter));

const VENDORS = { amd: 'AMD', arm: 'ARM', nvidia: 'NVIDIA' };

/** A name for people. Browsers hide most of what there is to say. */
export function titleOf(adapter) {
  if (isSwiftShader(adapter)) return 'SwiftShader';
  const words = (adapter.device || adapter.architecture || '').split(/[\s-]+/).filter(Boolean);
  if (words[0]?.toLowerCase() !== adapter.vendor) words.unshift(adapter.vendor || 'unknown adapter');
  return words.map((word) => VENDORS[word] ?? word.charAt(0).toUpperCase() + word.slice(1)).join(' ');
}

/** Reports of the page bench/stability.html by adapter, the latest of each; one without peers keeps those of before. */
export function mergePages(pages) {
  const byAdapter = new Map();
  for (const page of pages) {
    const known = byAdapter.get(page.adapter);
    const isLess = known && known.rows[0].results.length > page.rows[0].results.length;
    if (!isLess) byAdapter.set(page.adapter, page);
  }
  const isFirst = ({ adapter }) => (/swiftshader/i.test(adapter) || !adapter ? 0 : 1);
  return [...byAdapter.values()].sort((a, b) => isFirst(a) - isFirst(b));
}

/** Contents of another machine's files: figures files, and reports that the page POSTed. */
export function readFiles(paths) {
  const found = { runs: [], pages: [] };
  for (const path of paths) {
    const text = readFileSync(path, 'utf8');
    const report = reportIn(text);
    if (report) found.pages.push(report);
    else found.runs.push(...parseFigures(text, path));
  }
  return found;
}

function reportIn(text) {
  try {
    const whole = JSON.parse(text);
    return Array.isArray(whole.rows) ? whole : undefined;
  } catch {
    return undefined;
  }
}
