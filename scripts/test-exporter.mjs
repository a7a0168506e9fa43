/**
 * `npm run test:exporter`: the Python exporter in a virtual environment of its own (.cache/exporter): ruff, mypy, pytest.
 * `-- --torch` installs PyTorch, too (gigabytes), for what trains, for modules and for comparisons with public code.
 * `-- --webgpu` runs the files on ONNX Runtime's WebGPU provider, in an environment beside it. Other arguments go to pytest.
 */
import { existsSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { gpuEnvironment } from './lib/gpu-environment.mjs';
import { must, root } from './lib/run.mjs';

const folder = join(root, 'packages/exporter');
const flags = new Set(['--torch', '--webgpu']);
const given = process.argv.slice(2);
const [torch, webgpu] = [...flags].map((flag) => given.includes(flag));
const rest = given.filter((argument) => !flags.has(argument));

const python = environment(webgpu ? 'webgpu' : 'cpu', [
  ...(webgpu ? ['onnxruntime-webgpu==1.27.0', 'pytest==9.2.0'] : []),
  ...['--editable', webgpu ? folder : `${folder}[dev${torch ? ',module,oracles' : ''}]`],
]);
if (webgpu) {
  must(python, ['-m', 'pytest', 'tests/test_webgpu.py', ...rest], { cwd: folder, env: gpuEnvironment() });
} else {
  must(python, ['-m', 'ruff', 'check', '.'], { cwd: folder });
  must(python, ['-m', 'ruff', 'format', '--check', '.'], { cwd: folder });
  must(python, ['-m', 'mypy'], { cwd: folder });
  must(python, ['-m', 'pytest', '-rs', ...rest], { cwd: folder });
}

/** The Python of a virtual environment with these requirements; installs only changes since the last time. */
function environment(name, requirements) {
  const home = join(root, '.cache/exporter', name);
  const bin = join(home, process.platform === 'win32' ? 'Scripts/python.exe' : 'bin/python');
  const stamp = join(home, 'installed.txt');
  const wanted = [...requirements, readFileSync(join(folder, 'pyproject.toml'), 'utf8')].join('\n');
  if (!existsSync(bin)) must(process.env.PYTHON ?? 'python3', ['-m', 'venv', home]);
  if (!existsSync(stamp) || readFileSync(stamp, 'utf8') !== wanted) {
    must(bin, ['-m', 'pip', 'install', '--quiet', '--disable-pip-version-check', ...requirements]);
    writeFileSync(stamp, wanted);
  }
  return bin;
}
