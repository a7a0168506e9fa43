/** The benchmark's modules, which are plain JavaScript. */

/** A module of benchmarks, for example `run/summary.js`. */
export const benchModule = (path: string) => import(new URL(`../../benchmarks/${path}`, import.meta.url).href);

/** A module of scripts, for example `frontier/front.mjs`. */
export const scriptModule = (path: string) => import(new URL(`../../scripts/${path}`, import.meta.url).href);
