import { asciiOf, grouped, quote } from './bytes.js';
import { damaged } from './faults.js';
import type { SceneSource } from './scene-format.js';

export type Json = Record<string, unknown>;

/** Bytes of a JSON file, or of the JSON section of another file. */
export type JsonSource = Pick<SceneSource, 'bytes' | 'name' | 'budget'>;

/** Maximum bytes of memory of a parsed JSON value for each byte of text. Nested empty arrays need the most. */
const BYTES_PER_CHARACTER = 16;
/** Maximum nesting of lists and objects. Copies between threads and messages of errors visit values by recursion. */
const MAX_NESTED = 1100;
/** Names of methods that JavaScript calls to convert an object. In a file they are values, which cannot be called. */
const METHODS: readonly string[] = ['toString', 'valueOf', 'toJSON'];
/** Matches texts that may have such a name, which may be escaped. */
const MAY_HAVE_METHODS = /"(toString|valueOf|toJSON)"|\\u/;

/** Parses a text of JSON, as `JSON.parse` does. */
export type ParseJson = (text: string, reviver?: (key: string, value: unknown) => unknown) => unknown;

/**
 * Parses a JSON object of at most `maxBytes`, and charges its memory to the budget. Its values have no methods that
 * would be called to convert them.
 * @throws GaussianSplatError `decode/header` for nesting above {@link MAX_NESTED}, `decode/corrupt`, `decode/truncated` if the text does not end with `}`, or
 * `out-of-memory/budget`
 */
export function parseJson({ bytes, name, budget }: JsonSource, maxBytes: number, parse: ParseJson = JSON.parse): Json {
  if (bytes.length > maxBytes) {
    throw damaged(name, `a description of at most ${grouped(maxBytes)} bytes`, grouped(bytes.length));
  }
  budget.take(BYTES_PER_CHARACTER * bytes.length, name);
  if (nestingOf(bytes) > MAX_NESTED)
    throw damaged(name, `lists at most ${grouped(MAX_NESTED)} deep within each other`, 'deeper ones', 'decode/header');
  let value: unknown;
  try {
    const text = new TextDecoder().decode(bytes);
    value = parse(text, MAY_HAVE_METHODS.test(text) ? withoutMethods : undefined);
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

const withoutMethods = (key: string, value: unknown): unknown => (METHODS.includes(key) ? undefined : value);

/** Returns the maximum nesting of lists and objects in a text of JSON. */
function nestingOf(bytes: Uint8Array): number {
  let [depth, max] = [0, 0];
  for (let i = 0; i < bytes.length; i++) {
    const byte = bytes[i];
    if (byte === QUOTE) {
      for (i++; i < bytes.length && bytes[i] !== QUOTE; i++) if (bytes[i] === BACKSLASH) i++;
    } else if (byte === OPEN_LIST || byte === OPEN_OBJECT) {
      if (++depth > max) max = depth;
    } else if (byte === OPEN_LIST + 2 || byte === OPEN_OBJECT + 2) depth--;
  }
  return max;
}

const [QUOTE, BACKSLASH, OPEN_LIST, OPEN_OBJECT] = [0x22, 0x5c, 0x5b, 0x7b];

export function isObject(value: unknown): value is Json {
  return typeof value === 'object' && value !== null && !Array.isArray(value);
}

/** Throws `decode/header` for the value at a path in a file. */
export type FailAt = (path: string, expected: string, found: unknown) => never;

/** Returns the function that reports values of a file. */
export const failIn =
  (name: string): FailAt =>
  (path, expected, found) => {
    throw damaged(`${name}, ${path}`, expected, show(found), 'decode/header');
  };

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
