/**
 * The WGSL hook of a page. It is validated, renamed to avoid collisions, and inserted in place of the function that the
 * stages call.
 */
import { GaussianSplatError } from '@gaussian-splat/core';
import { constants } from '../generated/shaders.js';

/** A uniform of a hook: a number, or a vector of 2 to 4. */
export type SplatUniform = number | readonly number[];

/** A hook that runs for each splat: see docs/guide/effects.md. */
export interface SplatShader {
  /** WGSL with a function `modify(splat: Splat, uniforms: Uniforms) -> Splat`. */
  readonly code: string;
  /**
   * Initial values of the fields of `Uniforms` by name, at most 8. Names and sizes are part of the code; values may
   * change in each frame.
   */
  readonly uniforms?: Readonly<Record<string, SplatUniform>> | undefined;
  /** Whether `uniforms.time` advances automatically. Default: false. */
  readonly animated?: boolean | undefined;
  /** Whether the hook changes positions or sizes. False allows the renderer to cull whole chunks. Default: true. */
  readonly moves?: boolean | undefined;
}

const TYPES = ['', 'f32', 'vec2f', 'vec3f', 'vec4f'];
const sizeOf = (value: SplatUniform): number => (typeof value === 'number' ? 1 : value.length);
/** Matches declarations that would give the module access to resources, entry points or overrides. */
const FORBIDDEN = /@\s*(group|binding|compute|vertex|fragment|id)\b|\b(enable|requires|override)\s|\bvar\s*</;
const DECLARED = /\b(?:fn|struct|alias|const)\s+([A-Za-z_]\w*)/g;
const NAME = /^[A-Za-z]\w*$/;

const refused = (expected: string, found: string): GaussianSplatError =>
  new GaussianSplatError('argument/splat-shader', {
    where: 'splatShader',
    ...{ expected, found },
    remedy: 'see the guide on effects; the scene is drawn without the shader',
  });

const withoutComments = (code: string): string =>
  code.replace(/\/\*[^]*?\*\/|\/\/.*/g, (comment) => comment.replace(/[^\n]/g, ' '));

/**
 * Returns the WGSL text of a hook: its function, and the code of the page.
 * @param name Name of the function that the stages call.
 * @param others Text of a stage, whose names the hook must not redeclare.
 * @throws GaussianSplatError `argument/splat-shader` for code or uniforms that are not allowed.
 */
export function hookText({ code, uniforms = {} }: SplatShader, name: string, others: string): string {
  if (typeof code !== 'string') throw refused('WGSL text in `code`', typeof code);
  const own = withoutComments(code);
  const forbidden = FORBIDDEN.exec(own);
  if (forbidden)
    throw refused('only functions, structs and constants', `"${forbidden[0].trim()}"${lineAt(own, forbidden.index)}`);
  if (!/\bfn\s+modify\s*\(/.test(own)) throw refused('a function `modify`', 'none');
  const entries = Object.entries(uniforms);
  if (entries.length > constants.MAX_VALUES)
    throw refused(`at most ${constants.MAX_VALUES} uniforms`, `${entries.length}`);
  for (const [key, value] of entries)
    if (!NAME.test(key) || key === 'time' || !TYPES[sizeOf(value)])
      throw refused('uniforms that are numbers or vectors of 2 to 4, by names of WGSL other than `time`', `"${key}"`);
  const fields = entries.map(([key, value]) => `${key}: ${TYPES[sizeOf(value)]},`);
  const values = entries.map(([, value], k) => `, v[${k}]${['', '.x', '.xy', '.xyz', ''][sizeOf(value)]}`);
  const max = constants.MAX_VALUES;
  // The text of the page starts on a new line, so that the line numbers of errors can be converted.
  return [
    'struct Splat { position: vec3f, color: vec3f, opacity: f32, scale: f32 }',
    `struct Uniforms { time: f32, ${fields.join(' ')} }`,
    `fn ${name}(p: vec3f, c: vec3f, o: f32, t: f32, v: array<vec4f, ${max}>) -> mat3x3f {`,
    `let s = page_modify(Splat(p, c, o, 1.0), Uniforms(t${values.join('')}));`,
    'return mat3x3f(s.position, s.color, vec3f(s.opacity, s.scale, 0.0));',
    '}',
    renamed(own, others),
  ].join('\n');
}

/** Number of lines in front of the page's text in {@link hookText}. */
const LINES_BEFORE = 6;

/** Renames the declarations of a page whose names the text of a stage also contains. */
function renamed(own: string, others: string): string {
  const words = new Set(others.match(/[A-Za-z_]\w*/g));
  const declared = new Set([...own.matchAll(DECLARED)].map(([, name]) => name));
  const met = [...declared].filter((name) => name === 'modify' || words.has(name));
  return met.reduce((text, name) => text.replace(new RegExp(`(?<![.\\w])${name}\\b`, 'g'), `page_${name}`), own);
}

const lineAt = (text: string, index: number): string => ` in line ${text.slice(0, index).split('\n').length}`;

/**
 * Compiles a stage with a hook, and throws its first error.
 * @param before Text of the stage in front of the hook.
 * @throws GaussianSplatError `argument/splat-shader` with the line of the page's text.
 */
export async function requireCompiles(device: GPUDevice, code: string, before: string): Promise<void> {
  device.pushErrorScope('validation');
  const module = device.createShaderModule({ label: 'gs.splat_shader', code });
  const error = device.popErrorScope().catch(() => null);
  const { messages } = await module.getCompilationInfo();
  const first = messages.find(({ type }) => type === 'error');
  if (!first && (await error) === null) return;
  const line = (first?.lineNum ?? 0) - before.split('\n').length + 1 - LINES_BEFORE;
  const place = line > 0 ? ` in line ${line}` : '';
  throw refused('WGSL that compiles', `${(first?.message ?? (await error)?.message ?? '').trim()}${place}`);
}
