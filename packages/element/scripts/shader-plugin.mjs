/** Shortens the shaders in a bundle: see short-wgsl.mjs. The packages keep theirs readable, for whoever looks for a fault in one. */
import { readFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { shortened } from './short-wgsl.mjs';

const folder = (name) => fileURLToPath(new URL(`../../${name}/dist/generated/`, import.meta.url));
/** Where scripts/build-shaders.mjs and the compiler put the pieces that shaders are joined of. */
export const SHADER_FILES = [
  ...['shaders.js', 'live-shaders.js', 'streamed-shaders.js', 'quantized-shaders.js', 'probe-shaders.js'].map(
    (file) => folder('renderer') + file,
  ),
  `${folder('economise')}shaders.js`,
];

/** What variants of shaders find by its text and replace: see `specialise` in packages/renderer/src/gpu/kernel.ts. */
export const REPLACED = {
  keptNames: 'DIGIT_BITS DIGITS SUBGROUPS VOTE_WORDS Value VALUE_WORDS value bits word'.split(' '),
  keptLines: /^(const|alias) /,
};

const PIECE = /^(export const (\w+Part) = )("(?:[^"\\]|\\.)*");$/gm;

/** The pieces in the text of such a file, by name. */
export const piecesIn = (text) =>
  new Map([...text.matchAll(PIECE)].map(([, , name, code]) => [name, JSON.parse(code)]));

/** A plugin for Rollup. */
export function shortShaders() {
  let short;
  return {
    name: 'short-shaders',
    buildStart() {
      const pieces = SHADER_FILES.flatMap((file) => [...piecesIn(readFileSync(file, 'utf8'))]);
      short = shortened(new Map(pieces), REPLACED);
    },
    transform(code, id) {
      if (!SHADER_FILES.includes(id)) return null;
      return {
        code: code.replace(PIECE, (_, before, name) => `${before}${JSON.stringify(short.get(name))};`),
        map: null,
      };
    },
  };
}
