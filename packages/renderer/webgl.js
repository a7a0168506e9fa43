/** For bundlers that do not read `exports` (Parcel). */
export * from './dist/webgl/index.js';
