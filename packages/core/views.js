/** For bundlers that do not read `exports` (Parcel). */
export * from './dist/views/index.js';
