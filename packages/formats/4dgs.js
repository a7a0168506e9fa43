/** For bundlers that do not read `exports` (Parcel). */
export * from './dist/4dgs/index.js';
