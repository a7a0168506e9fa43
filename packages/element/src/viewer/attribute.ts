/** Kinds of attributes, from which the tables of the elements and of the features are made. */
import type { PropertyDeclaration } from 'lit';
import { keywordGrammar, numberGrammar, type AttributeGrammar } from './camera/grammar.js';

/** Limits a delay in ms to the maximum of timers, which treat longer ones, even `Infinity`, as 0. */
export const timerMs = (wait: number): number => Math.min(wait, 2 ** 31 - 1);

/**
 * One attribute, as in the tables of elements. The types `P` of the property and `V` of the parsed value exist only at
 * compile time; `V` is never if the element uses the property directly.
 */
export interface Attribute<P, V = never> {
  readonly lit: PropertyDeclaration;
  readonly grammar?: AttributeGrammar<V>;
  readonly property?: P;
}

/** Used as written. */
export const text = <P = string | null>(): Attribute<P> => ({ lit: {} });
/** True if present, except for `"false"`, because some frameworks write it as an attribute with a value. */
export const flag = (): Attribute<boolean> => ({
  lit: {
    type: Boolean,
    converter: { fromAttribute: (value: string | null): boolean => value !== null && value !== 'false' },
  },
});
export const read = <V, P = string | null>(grammar: AttributeGrammar<V>): Attribute<P, V> => ({ lit: {}, grammar });
export const number = <V>(grammar: AttributeGrammar<V>): Attribute<number | string | null, V> => ({ lit: {}, grammar });
/** The first is the default. */
export const keyword = <V extends string>(words: readonly V[]): Attribute<V | null, V> => read(keywordGrammar(words));
/** `''` is the value of the bare attribute. */
export const bareKeyword = <V extends string>(words: readonly V[]): Attribute<V | '' | null, V> =>
  read(keywordGrammar(words));

export const map = <A, B>(grammar: AttributeGrammar<A>, to: (value: A) => B): AttributeGrammar<B> => ({
  ...grammar,
  parse: (written) => {
    const value = grammar.parse(written);
    return value === null ? null : to(value);
  },
});
export const milliseconds = (fallback: number): AttributeGrammar<number> =>
  map(numberGrammar(fallback, 0, 'milliseconds, 0 or more'), timerMs);

/** Attributes by the names of their properties. */
export type AttributeTable = Readonly<Record<string, Attribute<unknown, unknown>>>;

/** The element's properties that a table of attributes defines. */
export type PropertiesOf<Table> = {
  -readonly [K in keyof Table]: Table[K] extends Attribute<infer P, unknown> ? P : never;
};
