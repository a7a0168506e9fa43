/** The WGSL in shaders/: files, the parts that they import, and their declarations. */
import { readFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { WgslReflect } from 'wgsl_reflect/wgsl_reflect.module.js';

export const shaderFolder = fileURLToPath(new URL('../../shaders/', import.meta.url));

const textOf = (path) => readFileSync(`${shaderFolder}${path}.wgsl`, 'utf8');
const IMPORT = /^#import (\S+)$/gm;

/** A shader and all files that it imports, each once, before the files that import it, with others in place of some. */
export function partsOf(path, replaced, seen = new Set()) {
  if (seen.has(path)) return [];
  seen.add(path);
  const imported = [...textOf(path).matchAll(IMPORT)].flatMap(([, name]) =>
    partsOf(replaced[name] ?? name, replaced, seen),
  );
  return [...imported, path];
}

/** A file's own lines. Its imports come first, as they would in any language. */
export function ownCode(path) {
  const code = strip(textOf(path));
  if (/\n(?!#import)[^\n]*\n#import/.test(`\n${code}`)) throw new Error(`shaders/${path}.wgsl: #import behind code`);
  return code.replace(IMPORT, '').trim();
}

/** The same, with other functions called than those that it names. Empty if it declares them. */
export function modifiedCode(path, called) {
  const names = Object.keys(called).join('|');
  const code = ownCode(path);
  if (new RegExp(`\\bfn (${names})\\(`).test(code)) return code;
  return code.replace(new RegExp(`\\b(${names})(?=\\()`, 'g'), (name) => called[name]);
}

/** Comments and indentation are for readers of shaders/, not for the bytes that a page loads. */
function strip(code) {
  return code
    .split('\n')
    .map((line) => line.replace(/\/\/.*$/, '').trim())
    .filter((line) => line !== '')
    .join('\n');
}

export function reflect(stage, code) {
  try {
    return new WgslReflect(code);
  } catch (error) {
    // The parser's own stack trace prints its whole minified source.
    const line = Number(/Line: (\d+)/.exec(error.message)?.[1]);
    throw new Error(`shaders/${stage}.wgsl: ${error.message} near "${code.split('\n')[line - 1]}"`);
  }
}

export function reflectStruct(struct) {
  const fields = struct.members.map((member) => [
    member.name,
    { offset: member.offset, type: member.type.getTypeName() },
  ]);
  return { size: struct.size, fields: Object.fromEntries(fields) };
}
