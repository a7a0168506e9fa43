import { asciiOf, grouped, quote } from './bytes.js';
import { damaged } from './faults.js';
import type { SceneSource } from './scene-format.js';

export type Json = Record<string, unknown>;

/** Bytes of a JSON file, or of the JSON section of another file. */
export type JsonSource = Pick<SceneSource, 'bytes' | 'name' | 'budget'>;

/** Maximum bytes of memory of a parsed JSON value for each byte of text. Nested empty arrays need the most. */
const BYTES_PER_CHARACTER = 16;

/**
 * Parses a JSON object of at most `maxBytes`, and charges its memory to the budget.
 * @throws GaussianSplatError `decode/corrupt`, `decode/truncated` if the text does not end with `}`, or
 * `out-of-memory/budget`
 */
export function parseJson(
  { bytes, name, budget }: JsonSource,
  maxBytes: number,
  parse: (text: string) => unknown = JSON.parse,
): Json {
  if (bytes.length > maxBytes) {
    throw damaged(name, `a description of at most ${grouped(maxBytes)} bytes`, grouped(bytes.length));
  }
  budget.take(BYTES_PER_CHARACTER * bytes.length, name);
  let value: unknown;
  try {
    value = parse(new TextDecoder().decode(bytes));
  } catch (cause) {
    const isCut = !/\}\s*$/.test(asciiOf(bytes, Math.max(0, bytes.length - 64)));
    const code = isCut ? 'decode/truncated' : 'decode/corrupt';
    throw damaged(
      `${name} (${grouped(bytes.length)} bytes)`,
      'JSON',
      (cause as Error).message.slice(0, 200),
      code,
      cause,
    );
  }
  if (!isObject(value)) throw damaged(name, 'a JSON object', show(value));
  return value;
}

export function isObject(value: unknown): value is Json {
  return typeof value === 'object' && value !== null && !Array.isArray(value);
}

/** Formats a JSON value for error messages, with at most 80 characters of it. */
export function show(value: unknown): string {
  if (value === undefined) return 'nothing';
  try {
    return quote(typeof value === 'string' ? value : (JSON.stringify(value) ?? String(value)), 80);
  } catch {
    // Nested arrays may be deeper than the call stack.
    return Array.isArray(value) ? 'a deep list' : 'a deep object';
  }
}
