/** Tools for packages that fetch files: retries, time-outs, reads that callers share, and rules for other origins. */
export * from './back-off.js';
export * from './file-request.js';
export * from './grouped.js';
export * from './network-errors.js';
export * from './patient-fetch.js';
export * from './shared-reads.js';
