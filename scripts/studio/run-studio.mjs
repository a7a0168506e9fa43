/** `npm run lab -- studio NAME ...`: makes scenes of the studio from nothing, on a machine with an NVIDIA GPU. scripts/studio/README.md says what it needs. */
import { spawnSync } from 'node:child_process';
import { join } from 'node:path';
import { ensureDependencies, ensurePackages } from '../lib/prepare.mjs';
import { root, run } from '../lib/run.mjs';

const SCENES = ['apartment', 'garden', 'hall', 'product', 'walker'];
const python = process.env.PYTHON ?? 'python3';
const words = process.argv.slice(2);
const options = words.findIndex((word) => word.startsWith('--'));
const names = options < 0 ? words : words.slice(0, options);
const rest = options < 0 ? [] : words.slice(options);
const unknown = names.filter((name) => !SCENES.includes(name));
if (names.length === 0 || unknown.length > 0) {
  console.error(`expected names of scenes (${SCENES.join(', ')}), found ${unknown.join(', ') || 'none'}`);
  process.exit(2);
}
const needed = spawnSync(python, [
  '-c',
  'import mitsuba, pyoidn, gsplat, torch, scipy, PIL; assert torch.cuda.is_available()',
]);
if (needed.status !== 0) {
  console.error(`expected an NVIDIA GPU and mitsuba, pyoidn, gsplat, torch, scipy and pillow in ${python}, found:
${needed.error ?? needed.stderr}Install them there, or name another Python: PYTHON=... npm run lab -- studio ${names.join(' ')}`);
  process.exit(1);
}
ensureDependencies();
ensurePackages();
for (const name of names) {
  const made = join(root, '.cache/studio', name);
  const here = (file) => join(root, 'scripts/studio', file);
  const steps = [
    [python, here('make.py'), name, '--data', join(root, '../shared/data'), '--out', made, ...rest],
    [python, here('pack.py'), 'ply', join(made, 'splats.xz'), join(made, 'scene.ply')],
    [
      process.execPath,
      here('compress.mjs'),
      made,
      join(root, 'tests/fixtures/studio'),
      join(root, 'demo/scenes/studio'),
    ],
  ];
  for (const [command, ...args] of steps) {
    const status = run(command, args);
    if (status !== 0) process.exit(status);
  }
}
