import { readAttribute } from './camera/grammar.js';
import { optionalLengthGrammar } from './camera/lengths.js';
import type { Viewer } from './viewer.js';

/** Meters per unit of the scene: of the attribute `unit`, or else of the scene's file; undefined if neither has it. */
export const unitOf = ({ attributes, sources, warn }: Viewer): number | undefined =>
  readAttribute('unit', attributes.unit, optionalLengthGrammar, warn) ?? sources.shown[0]?.bounds.metersPerUnit;
