/** Lengths in attributes that only late-loaded code reads. */
import { METRES_PER_UNIT, parseQuantity, type AttributeGrammar } from './grammar.js';

/** A positive length with a unit, such as `1.6m` or `37cm`: meters, or null. */
const parseExtent = (text: string): number | null => {
  const quantity = parseQuantity(text.trim().toLowerCase());
  const meters = quantity === null || quantity.unit === '' ? undefined : METRES_PER_UNIT[quantity.unit];
  return meters !== undefined && quantity!.value > 0 ? quantity!.value * meters : null;
};

export const lengthGrammar = (fallback: string): AttributeGrammar<number> => ({
  expected: 'a length above 0 with m, cm or mm',
  fallback,
  parse: parseExtent,
});

/** The same, or undefined if absent. */
export const optionalLengthGrammar: AttributeGrammar<number | undefined> = {
  expected: 'a length above 0 with m, cm or mm, such as 1m or 37cm',
  fallback: '',
  parse: (text) => (text === '' ? undefined : parseExtent(text)),
};
