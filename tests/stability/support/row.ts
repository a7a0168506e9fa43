/** Common parts of all rows of the catalog: how much of a recipe runs, and figures that are held to a limit and reported. */
import assert from 'node:assert/strict';
import { appendFileSync } from 'node:fs';
import { test, type TestContext } from 'node:test';
import { requestNodeAdapter } from '../../../packages/cli/src/lib/node-gpu.mjs';

/** True under `npm run lab -- stability`: whole recipes. `npm test` runs a part of each. */
export const isFull = process.env.STABILITY === 'full';

/** One of two sizes of a recipe. */
export const sized = <T>(fast: T, full: T): T => (isFull ? full : fast);

/** A test that takes minutes: there is none of it in `npm test`. */
export function fullTest(name: string, run: (context: TestContext) => Promise<void>): void {
  if (isFull) test(name, run);
}

export interface Limit {
  readonly atLeast?: number;
  readonly atMost?: number;
  readonly unit: string;
}

/** Begins a run in the file of figures: the next lines were measured on this adapter. */
export async function noteAdapter(): Promise<void> {
  if (!process.env.STABILITY_FIGURES) return;
  const { vendor, architecture, device, description } = (await requestNodeAdapter()).info;
  append({ date: new Date().toISOString(), adapter: { vendor, architecture, device, description } });
}

function append(line: object): void {
  const file = process.env.STABILITY_FIGURES;
  if (file) appendFileSync(file, `${JSON.stringify(line)}\n`);
}

/** Notes a figure of a row for the report; `limit` is undefined for figures that nothing depends on. */
export function note(row: string, what: string, value: number, limit: Limit): void {
  const shown = Number.isFinite(value) ? Number(value.toPrecision(4)) : value;
  console.log(`${row.padEnd(4)} ${what.padEnd(58)} ${shown} ${limit.unit}`);
  // JSON has no infinity: equal images have one.
  append({ row, what, value: Number.isFinite(value) ? value : String(value), ...limit, isFull });
}

/** Notes a figure of a row and fails the test if it is beyond its limit. A NaN is beyond every limit. */
export function holds(row: string, what: string, value: number, limit: Limit): void {
  note(row, what, value, limit);
  const { atLeast = -Infinity, atMost = Infinity, unit } = limit;
  assert.ok(value >= atLeast && value <= atMost, `${row}, ${what}: ${value} ${unit}, allowed ${atLeast} to ${atMost}`);
}

/** Points of a curve for the report. */
export function chart(row: string, name: string, points: readonly (readonly [x: number, y: number])[]): void {
  append({ row, chart: name, points: points.map(([x, y]) => [x, Number.isFinite(y) ? y : 150]) });
}
