/**
 * `node --import tsx fuzz-run.ts READER FIRST COUNT SEED` reads hostile files in a process of its own, and prints its
 * tally as a line of JSON. The number of the current file goes to the standard error.
 */
import { writeSync } from 'node:fs';
import { allReaders, fuzzReader, type Reader } from './fuzz.js';

const [reader, first, count, seed] = process.argv.slice(2);
const readers = await allReaders();
const onFile = (k: number): void => void writeSync(2, `${k}\n`);
const tally = await fuzzReader(reader as Reader, readers[reader as Reader], {
  ...{ first: Number(first), count: Number(count), seed: Number(seed), onFile },
});
console.log(JSON.stringify(tally));
