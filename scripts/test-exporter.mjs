/**
 * `npm run test:exporter`: the Python exporter in a virtual environment of its own (.cache/exporter): ruff, mypy, pytest; then OpenUSD
 * files of the commands with usd-core.
 * `-- --torch` installs PyTorch, too (gigabytes), for what trains, for modules and for comparisons with public code.
 * `-- --webgpu` runs the files on ONNX Runtime's WebGPU provider, in an environment beside it. Other arguments go to pytest.
 */
import { join } from 'node:path';
import { gpuEnvironment } from './lib/gpu-environment.mjs';
import { ensureDependencies, ensureElement } from './lib/prepare.mjs';
import { environment } from './lib/python-environment.mjs';
import { must, root } from './lib/run.mjs';

const folder = join(root, 'packages/exporter');
const flags = new Set(['--torch', '--webgpu']);
const given = process.argv.slice(2);
const [torch, webgpu] = [...flags].map((flag) => given.includes(flag));
const rest = given.filter((argument) => !flags.has(argument));

const python = environment(`exporter/${webgpu ? 'webgpu' : 'cpu'}`, folder, [
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
  ensureDependencies();
  ensureElement();
  must(process.execPath, ['--import', 'tsx', '--test', 'tests/formats/usd-core.alone.test.ts'], { cwd: root });
}
