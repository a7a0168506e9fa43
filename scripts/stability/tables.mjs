/** The tables of docs/stability.md. */
import { latestOf, titleOf } from './figures.mjs';

/** Who measured: adapter, driver, when, and how much of the catalogue. */
export function describeRuns(runs, rows) {
  const lines = runs.map((run) => {
    const own = rows.map(({ id }) => run.rows[id]).filter(Boolean);
    const whole = own.filter(isWhole).length;
    const failed = rows.filter(({ id }) => run.rows[id]?.passed === false).map(({ id }) => id);
    const name = titleOf(run.adapter);
    return `| ${name} | ${cell(run.adapter.description)} | ${latestOf(run).slice(0, 10)} | ${whole} of ${own.length} | ${failed.join(', ') || 'none'} |`;
  });
  return `| adapter | driver | last run | rows of which the whole recipe ran | rows with a test that failed |\n|---|---|---|---|---|\n${lines.join('\n')}\n`;
}

/** A row's figures, a column for each adapter, and who failed it. Rows that are tests alone have none. */
export function rowTable(id, runs) {
  const able = runs.filter(({ rows }) => rows[id] !== undefined);
  const failed = able.filter(({ rows }) => rows[id].passed === false).map(({ adapter }) => titleOf(adapter));
  const parts = failed.length > 0 ? [`**A test of this row failed on ${failed.join(', ')}.**\n`] : [];
  const columns = able.filter(({ rows }) => rows[id].figures.length > 0);
  if (columns.length === 0) return parts;
  const names = columns.map(({ adapter, rows }) => `${titleOf(adapter)}${isWhole(rows[id]) ? '' : ', a part'}`);
  const lines = linesOf(columns.map(({ rows }) => rows[id].figures)).map(({ what, unit, limit, values }) => {
    const cells = values.map((value) => (value === undefined ? '' : `${shown(value)} ${unit}`.trim()));
    return `| ${cell(what)} | ${limit} | ${cells.join(' | ')} |`;
  });
  parts.push(
    `| what | limit | ${names.join(' | ')} |\n|---|---|${names.map(() => '---|').join('')}\n${lines.join('\n')}\n`,
  );
  return parts;
}

export const isWhole = ({ figures }) => figures.every(({ isFull }) => isFull);

/**
 * What several adapters found of the same things, a line each. A whole recipe has lines of its own where it says another size or count.
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

/** The rows that a page can draw: every subject of the first adapter, ours on the others beside it. */
export function pagesTable(pages) {
  const subjects = subjectsOf(pages);
  const lines = [
    '## The same rows, with peers\n',
    `Same splats, same views, same criterion, in one page of Chromium (${pages[0].adapter || 'SwiftShader'} where no other adapter is named), after rounding to 8 bits. Fails are in bold. The first row is no failure but a measure: a peer's\ndefault picture is that far from the reference on any scene, by its own rules of falloff and dilation; what a row adds is the difference to it. Our limits hold for the reference picture, which peers do not aim at.\n`,
    `| row | at least | ${subjects.map(({ name }) => name).join(' | ')} |`,
    `|---|---|${subjects.map(() => '---').join('|')}|`,
    ...pages[0].rows.map(({ row, title, least }) => {
      const entry = ({ results }) => {
        const { figure, unit, passes, error } = results.get(`${row} ${title}`) ?? {};
        if (passes === undefined) return '';
        const text = error ? cell(error) : `${figure.toFixed(unit === 'dB' ? 1 : 0)} ${unit}`;
        return passes ? text : `**${text}**`;
      };
      return `| ${row}, ${cell(title)} | ${least === undefined ? '0 bytes' : `${least} dB`} | ${subjects.map(entry).join(' | ')} |`;
    }),
  ];
  return `${lines.join('\n')}\n`;
}

/** Who was put through the page's rows, ours first, with the results by row and title. Browsers tell little of an adapter, mostly its vendor. */
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

export function shown(value) {
  if (value === 'Infinity') return 'equal, infinitely many';
  if (typeof value !== 'number' || Number.isInteger(value)) return String(value);
  return Math.abs(value) < 0.01 ? value.toExponential(1) : String(Number(value.toPrecision(4)));
}
