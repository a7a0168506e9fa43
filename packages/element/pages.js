/** For bundlers that do not read `exports` (Parcel). */
export * from './dist/pages.js';
