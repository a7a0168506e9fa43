// Rows of 16 bytes that a chunk of shared/quantized_gaussian takes, and how many of them come before its splats.
#import shared/group

const QUANTIZED_HEAD_ROWS = 2u;
const QUANTIZED_CHUNK_ROWS = CULL_GROUP + QUANTIZED_HEAD_ROWS;
