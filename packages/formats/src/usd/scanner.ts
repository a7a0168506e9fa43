import { halfToNumber, numberToHalf } from '@gaussian-splat/core';
import type { LoadBudget } from '../budget.js';
import { grouped, quote } from '../bytes.js';
import { fail, type UsdValue } from './layer.js';

/** Names and numbers: all characters without a meaning of their own. */
const WORD = /[^\s()[\]{}=,;"'@<>#]*/y;
const CLOSING: ReadonlyMap<string, string> = new Map([
  ['(', ')'],
  ['[', ']'],
  ['{', '}'],
]);
/** Whether a character separates numbers of an array: a space, a comma, or a parenthesis. */
const isSeparator = (code: number): boolean =>
  code === 32 || code === 44 || code === 40 || code === 41 || (code >= 9 && code <= 13);

/** Rounds numbers of a type to its precision. */
export type Precision = keyof typeof ROUND;

const ROUND = {
  double: (value: number): number => value,
  float: Math.fround,
  half: (value: number): number => halfToNumber(numberToHalf(value)),
};

/** Range of characters: `start` to `end`, excluding `end`. */
export interface TextRange {
  readonly start: number;
  readonly end: number;
}

/** Reads the tokens of a layer of text (`.usda`), with the place of each fault. */
export class Scanner {
  readonly #text: string;
  readonly #name: string;
  readonly #budget: LoadBudget;
  #at = 0;
  #comment = -1;

  constructor(text: string, name: string, budget: LoadBudget) {
    this.#text = text;
    this.#name = name;
    this.#budget = budget;
  }

  /** Charges bytes before they are allocated. */
  take(bytes: number): void {
    this.#budget.take(bytes, this.#name);
  }

  /** Returns the next token without reading it; empty at the end. */
  peek(): string {
    const at = this.#at;
    const token = this.next();
    this.#at = at;
    return token;
  }

  /** Reads a token: a word, a number, a quoted text with its quotes, a path or an asset, or one character; empty at the end. */
  next(): string {
    this.#skipSpace();
    const start = this.#at;
    this.#skipToken();
    return this.#text.slice(start, this.#at);
  }

  /** Reads a token that must be this one. */
  expect(token: string): void {
    const found = this.next();
    if (found !== token) this.fault(quote(token), found);
  }

  /** Reads a quoted text. */
  text(): string {
    return unquoted(this.next()) ?? this.fault('a name in quotes', this.#text.slice(this.#at, this.#at + 20));
  }

  /** Throws an error at the current place. */
  fault(expected: string, found: string): never {
    const line = this.#text.slice(0, this.#at).split('\n').length;
    const isCut = found === '' && this.#at >= this.#text.length;
    return fail(`${this.#name}, line ${grouped(line)}`, expected, isCut ? 'the end of the file' : quote(found), isCut);
  }

  /** Skips a value of any type, and returns its range. */
  skipValue(): TextRange {
    this.#skipSpace();
    const start = this.#at;
    const first = this.#text[start];
    if (first === '[') this.#skipArray();
    else if (CLOSING.has(first)) this.#skipBrackets();
    else if (this.next() === '') this.fault('a value', '');
    return { start, end: this.#at };
  }

  /** Skips to the end of brackets of any kind that begin here. */
  #skipBrackets(): void {
    const open: string[] = [];
    do {
      const token = this.next();
      if (token === '') this.fault(`"${open.at(-1)}"`, '');
      const closing = CLOSING.get(token);
      if (closing) {
        this.take(16);
        open.push(closing);
      } else if (token.length === 1 && ')]}'.includes(token) && open.pop() !== token)
        this.fault('brackets in pairs', token);
    } while (open.length > 0);
  }

  /** Skips an array. An array of numbers ends at the first bracket. */
  #skipArray(): void {
    const end = this.#text.indexOf(']', this.#at + 1);
    const first = this.#text.slice(this.#at + 1, this.#at + 200).trimStart()[0] ?? '';
    if (end < 0 || !/[\d(+.\]-]/.test(first)) return this.#skipBrackets();
    if (this.#nextComment() < end) return this.#skipBrackets();
    this.#at = end + 1;
  }

  /** Returns the place of the next `#`, which is searched once. */
  #nextComment(): number {
    if (this.#comment < this.#at) {
      const found = this.#text.indexOf('#', this.#at);
      this.#comment = found < 0 ? Infinity : found;
    }
    return this.#comment;
  }

  /** Whether the value in a range is `None` or an empty list. */
  isEmpty({ start, end }: TextRange): boolean {
    return /^(None|\[\s*\])$/.test(this.#text.slice(start, Math.min(end, start + 64)));
  }

  /** Parses the value in a range: numbers, texts, or one of either. `None` is undefined. */
  parse({ start, end }: TextRange, precision: Precision): UsdValue | undefined {
    const first = this.#text[start];
    if (first === '[' || first === '(') {
      const inner = new Scanner(this.#text.slice(start + 1, end - 1), this.#name, this.#budget);
      return /["'@<]/.test(inner.peek()[0] ?? '') ? inner.#texts() : inner.#numbers(precision);
    }
    const word = this.#text.slice(start, end);
    if (word === 'None' || first === '{') return undefined;
    if (word === 'true' || word === 'false') return word === 'true';
    const number = numberOf(word);
    return unquoted(word) ?? (number === undefined ? word : ROUND[precision](number));
  }

  /** Returns the texts of a dictionary in a range, `{ string NAME = "..." ... }`, by name. Ends at the first fault. */
  dictionary({ start, end }: TextRange): Map<string, string> {
    const texts = new Map<string, string>();
    const inner = new Scanner(this.#text.slice(start + 1, end - 1), this.#name, this.#budget);
    for (let type = inner.next(); type !== ''; type = inner.next()) {
      if (inner.peek() === '[') inner.skipValue();
      const name = inner.next();
      if (inner.next() !== '=') break;
      const value = inner.parse(inner.skipValue(), 'double');
      if (type === 'string' && typeof value === 'string')
        texts.set(unquoted(name) ?? name, value.replace(/\\(.)/gs, '$1'));
    }
    return texts;
  }

  #texts(): string[] {
    const texts: string[] = [];
    for (let token = this.next(); token !== ''; token = this.next()) {
      this.take(32 + 2 * token.length);
      if (token !== ',') texts.push(unquoted(token) ?? token);
    }
    return texts;
  }

  #numbers(precision: Precision): Float32Array | Float64Array {
    const text = this.#text.includes('#') ? this.#text.replace(/#[^\n]*/g, '') : this.#text;
    let count = 0;
    for (let at = 0, isInside = false; at < text.length; at++) {
      const wasInside = isInside;
      isInside = !isSeparator(text.charCodeAt(at));
      if (isInside && !wasInside) count++;
    }
    this.take((precision === 'double' ? 8 : 4) * count);
    const numbers = precision === 'double' ? new Float64Array(count) : new Float32Array(count);
    for (let at = 0, n = 0; n < count; n++) {
      while (isSeparator(text.charCodeAt(at))) at++;
      const start = at;
      while (at < text.length && !isSeparator(text.charCodeAt(at))) at++;
      const word = text.slice(start, at);
      const number = numberOf(word) ?? fail(this.#name, 'numbers in an array', quote(word));
      numbers[n] = precision === 'half' ? ROUND.half(number) : number;
    }
    return numbers;
  }

  #skipSpace(): void {
    for (;;) {
      const code = this.#text.charCodeAt(this.#at);
      if (code === 35) {
        const end = this.#text.indexOf('\n', this.#at);
        this.#at = end < 0 ? this.#text.length : end;
      } else if (code === 32 || (code >= 9 && code <= 13) || code === 59 || code === 0xfeff) this.#at++;
      else return;
    }
  }

  #skipToken(): void {
    const first = this.#text[this.#at] ?? '';
    if (first === '"' || first === "'") return this.#skipQuoted(first);
    if (first === '@' || first === '<') {
      const mark = first === '<' ? '>' : this.#text.startsWith('@@@', this.#at) ? '@@@' : '@';
      return this.#skipTo(mark, this.#at + mark.length);
    }
    WORD.lastIndex = this.#at;
    WORD.exec(this.#text);
    this.#at = Math.max(WORD.lastIndex, this.#at + first.length);
  }

  #skipQuoted(quoteMark: string): void {
    const isLong = this.#text.startsWith(quoteMark.repeat(3), this.#at);
    const mark = isLong ? quoteMark.repeat(3) : quoteMark;
    for (let from = this.#at + mark.length; ;) {
      const end = this.#text.indexOf(mark, from);
      if (end < 0) return this.#skipTo(mark, from);
      let slashes = 0;
      while (this.#text[end - 1 - slashes] === '\\') slashes++;
      if (slashes % 2 === 0) {
        this.#at = end + mark.length;
        return;
      }
      from = end + 1;
    }
  }

  #skipTo(mark: string, from: number): void {
    const end = this.#text.indexOf(mark, from);
    this.#at = end < 0 ? this.#text.length : end + mark.length;
    if (end < 0) this.fault(mark, '');
  }
}

/** Text of a quoted token; undefined if it is not quoted. Escapes are not resolved: names have none. */
function unquoted(token: string): string | undefined {
  const mark = /^("""|'''|"|')/.exec(token)?.[0];
  return mark && token.slice(mark.length, -mark.length);
}

function numberOf(word: string): number | undefined {
  const number = Number(word);
  if (!Number.isNaN(number)) return number;
  if (/^[+-]?inf$/.test(word)) return word[0] === '-' ? -Infinity : Infinity;
  return /^[+-]?nan$/.test(word) ? NaN : undefined;
}
