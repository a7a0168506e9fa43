/**
 * `npm run test:notebook`: the notebook widget. Builds its wheel, installs it with JupyterLab into a fresh environment,
 * and uses it in Chromium; before that, ruff, mypy and pytest run in .cache/notebook. It needs PyPI, and the build of
 * `npm run build -- --element`. `-- --no-browser` leaves JupyterLab out.
 */
import { mkdtempSync, readdirSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { writeStatic } from '../packages/notebook/build.mjs';
import { testInJupyterLab } from '../packages/notebook/tests/jupyterlab.mjs';
import { environment, freshEnvironment } from './lib/python-environment.mjs';
import { must, root, run } from './lib/run.mjs';

const folder = join(root, 'packages/notebook');

const download = [
  '-m',
  'pip',
  'download',
  '--quiet',
  '--no-deps',
  '--retries',
  '0',
  '--dest',
  tmpdir(),
  'anywidget==0.11.0',
];
const isReachable = run(process.env.PYTHON ?? 'python3', download) === 0;
if (!isReachable) {
  console.warn('SKIPPED: PyPI is not reachable, so nothing of the notebook was tested.');
  process.exit(0);
}
writeStatic();
const python = environment('notebook', folder, ['--editable', `${folder}[dev]`]);
must(python, ['-m', 'ruff', 'check', '.'], { cwd: folder });
must(python, ['-m', 'ruff', 'format', '--check', '.'], { cwd: folder });
must(python, ['-m', 'mypy'], { cwd: folder });
must(python, ['-m', 'pytest'], { cwd: folder });
if (!process.argv.includes('--no-browser')) {
  const home = mkdtempSync(join(tmpdir(), 'notebook-'));
  try {
    must(python, ['-m', 'build', '--wheel', '--outdir', home, folder]);
    const wheel = readdirSync(home).find((name) => name.endsWith('.whl'));
    const own = freshEnvironment(join(home, 'environment'));
    must(own, ['-m', 'pip', 'install', '--quiet', '--disable-pip-version-check', `${join(home, wheel)}[jupyterlab]`]);
    await testInJupyterLab({ python: own, home, examples: join(folder, 'examples') });
  } finally {
    rmSync(home, { recursive: true, force: true });
  }
}
