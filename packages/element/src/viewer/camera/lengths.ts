/** Grammars of lengths, for attributes that only code loaded on demand reads. */
import { METERS_PER_UNIT, parseQuantity, type AttributeGrammar } from './grammar.js';

/** Parses a positive length with a unit, such as `1.6m` or `37cm`. Returns meters; null if the text is malformed. */
const parseExtent = (text: string): number | null => {
  const quantity = parseQuantity(text.trim().toLowerCase());
  const meters = quantity === null || quantity.unit === '' ? undefined : METERS_PER_UNIT[quantity.unit];
  return meters !== undefined && quantity!.value > 0 ? quantity!.value * meters : null;
};

export const lengthGrammar = (fallback: string): AttributeGrammar<number> => ({
  expected: 'a length above 0 with m, cm or mm',
  fallback,
  parse: parseExtent,
});

/** Grammar of an optional positive length: meters, or undefined if the attribute is absent. */
export const optionalLengthGrammar: AttributeGrammar<number | undefined> = {
  expected: 'a length above 0 with m, cm or mm, such as 1m or 37cm',
  fallback: '',
  parse: (text) => (text === '' ? undefined : parseExtent(text)),
};
