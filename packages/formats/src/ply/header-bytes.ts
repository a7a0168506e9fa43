/** Headers of splat files have 1 to 5 KB; a longer one than this is not searched for its end. */
export const MAX_HEADER_BYTES = 262_144;
/** So many are looked at first: a quarter of a megabyte of numbers as text takes longer than reading some thousand splats. */
export const USUAL_HEADER_BYTES = 16_384;
