/** The WGSL as people write it, for rules that hold for its text. */
import { readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';

const folder = fileURLToPath(new URL('../../../shaders/', import.meta.url));

/** Text of every shader file without its comments, by its path in shaders/. */
export function shaderTexts(): ReadonlyMap<string, string> {
  const names = readdirSync(folder, { recursive: true, encoding: 'utf8' }).filter((name) => name.endsWith('.wgsl'));
  return new Map(
    names.map((name) => [name, readFileSync(join(folder, name), 'utf8').replace(/\/\/.*$/gm, '')] as const),
  );
}

/** Bodies of all loops of a text, nested ones within their outer ones. */
export function loopBodies(text: string): string[] {
  const bodies: string[] = [];
  for (const match of text.matchAll(/\b(?:for|while|loop)\b/g)) {
    const open = text.indexOf('{', endOfCondition(text, match.index + match[0].length));
    let depth = 0;
    let at = open;
    do {
      if (text[at] === '{') depth++;
      if (text[at] === '}') depth--;
    } while (depth > 0 && ++at < text.length);
    bodies.push(text.slice(match.index, at + 1));
  }
  return bodies;
}

/** Behind the parentheses of a `for` or `while`. */
function endOfCondition(text: string, from: number): number {
  if (!/^\s*\(/.test(text.slice(from))) return from;
  let depth = 0;
  for (let at = text.indexOf('(', from); at < text.length; at++) {
    if (text[at] === '(') depth++;
    if (text[at] === ')' && --depth === 0) return at;
  }
  return text.length;
}
