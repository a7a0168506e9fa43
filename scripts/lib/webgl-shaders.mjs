/**
 * The shaders of the WebGL renderer, in GLSL ES 3.00, made from the same WGSL as WebGPU's: naga (naga-cli, a tool of Rust) translates shaders/webgl and its imports from shaders/shared. Its output is committed, since few machines have naga, with a digest of the WGSL source. A test compares both everywhere.
 */
import { execFileSync } from 'node:child_process';
import { createHash } from 'node:crypto';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { format, resolveConfig } from 'prettier';
import { ownCode, partsOf, reflect, reflectStruct } from './shader-source.mjs';

/** The version of naga-cli that the committed text is of. */
export const NAGA = '30.0.1';
export const WEBGL_SHADERS = fileURLToPath(new URL('../../packages/renderer/src/webgl/shaders.ts', import.meta.url));

/** GLSL that replaces WebGPU's buffers. */
const REPLACED = { 'shared/stored_gaussian': 'webgl/textured_gaussian' };
const STAGES = ['project', 'quads', 'hosted_quads', 'compose', 'probe', 'probe_cross', 'probe_surface'];
/** Functions that a stage takes unchanged from WebGPU's. */
const SHARED = ['full_screen'];
const ENTRIES = [
  ['full_screen', 'vertex'],
  ...['quads', 'hosted_quads', 'compose'].map((stage) => [stage, 'vertex']),
  ...STAGES.map((stage) => [stage, 'fragment']),
];
/** Structs of uniforms that WebGPU's stages do not have. */
const STRUCTS = ['QuadsView', 'HostedView', 'ProbeView'];

const codeOf = (stage) =>
  partsOf(`${SHARED.includes(stage) ? 'shared' : 'webgl'}/${stage}`, REPLACED)
    .map(ownCode)
    .join('\n');

/** Digest of all the WGSL, without its comments. */
export function digestOfSource() {
  const hash = createHash('sha256');
  for (const stage of STAGES) hash.update(codeOf(stage));
  return hash.digest('hex').slice(0, 32);
}

/** Whether the tool is here, in the version that the committed text is of. */
export function hasNaga() {
  try {
    return execFileSync('naga', ['--version'], { encoding: 'utf8' }).includes(NAGA);
  } catch {
    return false;
  }
}

/** The text of the file of shaders. */
export async function webglShaders() {
  const folder = mkdtempSync(join(tmpdir(), 'shaders-'));
  try {
    const texts = ENTRIES.map(([stage, entry]) => [nameOf(stage, entry), translate(folder, stage, entry)]);
    const lines = [
      '/**',
      ' * Written by `npm run shaders:webgl` from shaders/webgl and shaders/shared, and committed: see scripts/lib/webgl-shaders.mjs. Do not edit.',
      ' */',
      '/** Digest of the WGSL that this file was generated from. */',
      `export const SOURCE_DIGEST = '${digestOfSource()}';`,
      '/** Texels in a row of the textures that hold arrays. */',
      `export const DATA_WIDTH = ${Number(/const DATA_WIDTH = (\d+)u;/.exec(codeOf('quads'))[1])};`,
      ...STAGES.flatMap((stage) => reflect(`webgl/${stage}`, codeOf(stage)).structs)
        .filter(({ name }, i, all) => STRUCTS.includes(name) && all.findIndex((other) => other.name === name) === i)
        .map((struct) => `export const ${struct.name} = ${JSON.stringify(reflectStruct(struct))} as const;`),
      ...texts.map(([name, text]) => `export const ${name}: string = ${JSON.stringify(text)};`),
    ];
    return await format(lines.join('\n'), { ...(await resolveConfig(WEBGL_SHADERS)), parser: 'typescript' });
  } finally {
    rmSync(folder, { recursive: true, force: true });
  }
}

const nameOf = (stage, entry) =>
  `${stage.replace(/_(\w)/g, (_, letter) => letter.toUpperCase())}${entry[0].toUpperCase()}${entry.slice(1)}`;

function translate(folder, stage, entry) {
  const code = codeOf(stage);
  const from = join(folder, `${stage}.wgsl`);
  const to = join(folder, `${stage}.${entry === 'vertex' ? 'vert' : 'frag'}`);
  writeFileSync(from, code);
  execFileSync('naga', ['--profile', 'es300', '--compact', '--entry-point', entry, from, to], { stdio: 'inherit' });
  return shortened(named(readFileSync(to, 'utf8'), code));
}

/** Textures by their names in WGSL, in place of the numbers of their bindings. */
function named(text, code) {
  const bindings = [...code.matchAll(/@group\(0\) @binding\((\d+)\) var (\w+): texture/g)];
  return bindings.reduce(
    (done, [, number, name]) => done.replaceAll(new RegExp(`_group_0_binding_${number}_[vf]s`, 'g'), `t_${name}`),
    text,
  );
}

/**
 * Removes text that a page need not load: spaces, constants that nothing uses, and a first instance that is always 0.
 */
function shortened(text) {
  const lines = text
    .replace('uniform uint naga_vs_first_instance;', '')
    .replace('(uint(gl_InstanceID) + naga_vs_first_instance)', 'uint(gl_InstanceID)')
    .split('\n')
    .map((line) => line.trim())
    .filter((line) => line !== '');
  const isUsed = (line) => {
    const [, name] = /^const \w+ (\w+)(?:\[\d+\])? = /.exec(line) ?? [];
    return name === undefined || lines.some((other) => other !== line && new RegExp(`\\b${name}\\b`).test(other));
  };
  return lines.filter(isUsed).join('\n');
}
