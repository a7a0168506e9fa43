/** The tables of docs/stability.md. */
import { latestOf, titleOf } from './figures.mjs';

/** The adapters that measured: name, driver, date of the last run, failed rows. */
export function describeRuns(runs, rows) {
  return runs
    .map((run) => {
      const failed = rows.filter(({ id }) => run.rows[id]?.passed === false).map(({ id }) => id);
      const result = failed.length > 0 ? `failed: ${failed.join(', ')}` : 'no failed row';
      return `${titleOf(run.adapter)} (${cell(run.adapter.description)}, ${latestOf(run).slice(0, 10)}): ${result}.`;
    })
    .join(' ');
}

/** One line for each row of the catalog: its failure, the limits kept on each adapter, and its test. */
export function catalogTable(rows, runs) {
  const lines = rows.map((row) => {
    const results = runs.map((run) => resultOf(run.rows[row.id]));
    return `| [${row.id}](../${row.file}) | ${cell(row.title)} | ${results.join(' | ')} |`;
  });
  const names = runs.map(({ adapter }) => titleOf(adapter));
  return `| test | failure | ${names.join(' | ')} |\n|---|---|${names.map(() => '---|').join('')}\n${lines.join('\n')}\n`;
}

/** Limits kept of limits tested; an asterisk if the short recipe ran. */
function resultOf(row) {
  if (row === undefined) return '';
  const limited = row.figures.filter(({ atLeast, atMost }) => atLeast !== undefined || atMost !== undefined);
  const kept = limited.filter(
    ({ value, atLeast = -Infinity, atMost = Infinity }) => value >= atLeast && value <= atMost,
  );
  const text = `${kept.length}/${limited.length}${isWhole(row) ? '' : '*'}`;
  return row.passed === false ? `**failed**, ${text}` : text;
}

export const isWhole = ({ figures }) => figures.every(({ isFull }) => isFull);

/**
 * Results of several adapters for the same measures, a line each. A whole recipe has separate lines if its size or count differs.
 * @param columns {object[][]} figures of each adapter
 */
export function linesOf(columns) {
  const whats = [...new Set(columns.flatMap((figures) => figures.map(({ what }) => what)))];
  return whats.map((what) => {
    const figures = columns.map((column) => column.find((figure) => figure.what === what));
    const some = figures.find(Boolean);
    return { what, unit: some.unit, limit: limitOf(some), values: figures.map((figure) => figure?.value), figures };
  });
}

export function limitOf({ atLeast, atMost }) {
  const parts = [atLeast !== undefined && `at least ${atLeast}`, atMost !== undefined && `at most ${atMost}`];
  return parts.filter(Boolean).join(', ');
}

/** Rows that a page can draw: ours on the first adapter beside peers as shipped. The site shows the other adapters and settings. */
export function pagesTable(pages) {
  const subjects = subjectsOf(pages.slice(0, 1)).filter(({ name }) => !name.endsWith(', parity'));
  const lines = [
    `| row | ${subjects.map(({ name }) => name).join(' | ')} |`,
    `|---|${subjects.map(() => '---').join('|')}|`,
    ...pages[0].rows.map(({ row, title }) => {
      const entry = ({ results }) => {
        const { figure, unit, passes, error } = results.get(`${row} ${title}`) ?? {};
        if (passes === undefined) return '';
        const text = error ? 'none' : figure.toFixed(unit === 'dB' ? 1 : 0);
        return passes ? text : `**${text}**`;
      };
      return `| ${row}, ${cell(title)} | ${subjects.map(entry).join(' | ')} |`;
    }),
  ];
  return `${lines.join('\n')}\n`;
}

/**
 * Renderers that ran the page's rows, ours first, with the results by row and title. Browsers report little of an
 * adapter, mostly its vendor.
 */
export function subjectsOf(pages) {
  const subjects = pages.flatMap(({ adapter, rows }, page) =>
    rows[0].results.map(({ subject }, k) => ({
      name: page === 0 ? subject : `${subject}, ${adapter}`,
      isOurs: k === 0,
      results: new Map(rows.map(({ row, title, results }) => [`${row} ${title}`, results[k]])),
    })),
  );
  return [...subjects.filter(({ isOurs }) => isOurs), ...subjects.filter(({ isOurs }) => !isOurs)];
}

const cell = (text) => text.replace(/\|/g, '\\|').replace(/\s+/g, ' ');
