/** Fetching with patience and by the rules of origins: for packages that load files. */
export * from './part-request.js';
export * from './patient-fetch.js';
