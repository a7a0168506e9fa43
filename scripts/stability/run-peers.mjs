/** The rows of the catalog that any viewer can be put through, with ours and the peers in one run: a JSON report. */
import { writeFileSync } from 'node:fs';
import { runPage } from '../lib/browser-page.mjs';

const [out, query = ''] = process.argv.slice(2);
const report = await runPage('bench/stability.html', Object.fromEntries(new URLSearchParams(query)), {
  minutes: 30,
  onProgress: (line) => console.error(line),
});
if (out) writeFileSync(out, `${JSON.stringify(report, null, 2)}\n`);
for (const { row, title, results } of report.rows) {
  console.log(`${row} ${title}`);
  for (const { subject, figure, unit, passes, error } of results) {
    console.log(`   ${subject.padEnd(28)} ${passes ? 'passes' : 'fails '} ${error ?? `${figure.toFixed(1)} ${unit}`}`);
  }
}
