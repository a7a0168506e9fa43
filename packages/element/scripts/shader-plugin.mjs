/** Shortens the shaders in a bundle: see short-wgsl.mjs. The packages keep readable shaders for debugging. */
import { readdirSync, readFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { shortened } from './short-wgsl.mjs';

const FOLDER = fileURLToPath(new URL('../../renderer/dist/generated/', import.meta.url));
/** Modules in which scripts/build-shaders.mjs and the compiler store the pieces of shaders. */
export const SHADER_FILES = readdirSync(FOLDER)
  .filter((file) => /(^|-)shaders\.js$/.test(file))
  .map((file) => FOLDER + file);

const PIECE = /^(export const (\w+Part) = )("(?:[^"\\]|\\.)*");$/gm;

/** The pieces in the text of such a file, by name. */
export const piecesIn = (text) =>
  new Map([...text.matchAll(PIECE)].map(([, , name, code]) => [name, JSON.parse(code)]));

const JOINED = /^ *code: (\w+Part(?: \+ '\\n' \+ \w+Part)*),?$/gm;

/** The names of the pieces that each shader in the text of such a file is joined of. */
export const joinedIn = (text) => [...text.matchAll(JOINED)].map(([, pieces]) => pieces.match(/\w+Part/g));

/** A plugin for Rollup. */
export function shortShaders() {
  let short;
  return {
    name: 'short-shaders',
    buildStart() {
      const texts = SHADER_FILES.map((file) => readFileSync(file, 'utf8'));
      const pieces = new Map(texts.flatMap((text) => [...piecesIn(text)]));
      short = shortened(pieces, texts.flatMap(joinedIn));
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
