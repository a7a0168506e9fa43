/** Virtual environments of Python for tests, in .cache. */
import { existsSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { must, root } from './run.mjs';

const inBin = (home, name) =>
  join(home, process.platform === 'win32' ? 'Scripts' : 'bin', process.platform === 'win32' ? `${name}.exe` : name);

/** Creates a virtual environment. @returns Path of its Python. */
export function freshEnvironment(home) {
  must(process.env.PYTHON ?? 'python3', ['-m', 'venv', home]);
  return inBin(home, 'python');
}

/**
 * Returns the Python of an environment in .cache with these requirements; installs only changes since the last time.
 * @param name Folder below .cache.
 * @param folder Package of Python, whose pyproject.toml has further requirements.
 */
export function environment(name, folder, requirements) {
  const home = join(root, '.cache', name);
  const stamp = join(home, 'installed.txt');
  const wanted = [...requirements, readFileSync(join(folder, 'pyproject.toml'), 'utf8')].join('\n');
  const python = existsSync(inBin(home, 'python')) ? inBin(home, 'python') : freshEnvironment(home);
  if (!existsSync(stamp) || readFileSync(stamp, 'utf8') !== wanted) {
    must(python, ['-m', 'pip', 'install', '--quiet', '--disable-pip-version-check', ...requirements]);
    writeFileSync(stamp, wanted);
  }
  return python;
}
