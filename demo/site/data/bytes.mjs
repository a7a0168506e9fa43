/** The committed run of `npm run lab -- bytes`: for each scene the files of it, the smallest first. */
import { existsSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { root } from '../../../scripts/lib/run.mjs';

const path = join(root, 'docs/frontier/bytes.json');

export default function bytes() {
  if (!existsSync(path)) return undefined;
  const { date, scenes } = JSON.parse(readFileSync(path, 'utf8'));
  return {
    date: date.slice(0, 10),
    scenes: scenes.map(({ name, splats, shDegree, rows }) => ({
      ...{ name, shDegree, splats: splats.toLocaleString('en') },
      rows: rows.toSorted((a, b) => a.bytes - b.bytes).map((row) => rowOf(row, splats)),
    })),
  };
}

const rowOf = ({ name, bytes, decodeMs, firstMs, decibels, worst }, splats) => ({
  name,
  perSplat: (bytes / splats).toFixed(1),
  worst: worst > 90 ? 'exact' : worst.toFixed(1),
  decibels: decibels > 90 ? 'exact' : decibels.toFixed(1),
  decode: decodeMs.toFixed(0),
  first: (firstMs / 1000).toFixed(2),
});
