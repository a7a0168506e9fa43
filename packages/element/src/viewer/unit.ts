import { readAttribute } from './camera/grammar.js';
import { optionalLengthGrammar } from './camera/lengths.js';
import type { Viewer } from './viewer.js';

/** Meters per unit of the scene, according to the attribute `unit`; undefined without it. */
export const unitOf = ({ attributes, warn }: Viewer): number | undefined =>
  readAttribute('unit', attributes.unit, optionalLengthGrammar, warn);
