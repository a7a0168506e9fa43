/** Fetching with patience, once for all that ask, and by the rules of origins: for packages that load files. */
export * from './back-off.js';
export * from './part-request.js';
export * from './patient-fetch.js';
export * from './shared-reads.js';
