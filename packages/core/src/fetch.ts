/**
 * Fetching with retries and time-outs, shared between callers, under the rules of origins: for packages that load
 * files.
 */
export * from './back-off.js';
export * from './part-request.js';
export * from './patient-fetch.js';
export * from './shared-reads.js';
