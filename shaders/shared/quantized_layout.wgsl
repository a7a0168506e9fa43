// Rows of 16 bytes in a chunk of shared/quantized_gaussian, and the number of header rows among them.
#import shared/group

const QUANTIZED_HEAD_ROWS = 2u;
const QUANTIZED_CHUNK_ROWS = CULL_GROUP + QUANTIZED_HEAD_ROWS;
