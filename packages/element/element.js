/** For bundlers that do not read `exports` (Parcel). */
export * from './dist/viewer/element.js';
