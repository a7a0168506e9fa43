/** Hashes of the CDN build's scripts for `integrity` attributes and import maps: `npm run build` writes them to cdn/integrity.json. */
import { createHash } from 'node:crypto';
import { readdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join, sep } from 'node:path';
import { fileURLToPath } from 'node:url';

const CDN = fileURLToPath(new URL('../cdn/', import.meta.url));

/** `sha384-...` of a file's content. */
export function integrityOf(path) {
  return `sha384-${createHash('sha384').update(readFileSync(path)).digest('base64')}`;
}

/** Writes cdn/integrity.json: each script's path relative to cdn/, and its hash. Returns what it wrote. */
export function writeIntegrity() {
  const scripts = readdirSync(CDN, { recursive: true }).filter((file) => /\.m?js$/.test(file));
  const hashes = Object.fromEntries(
    scripts.sort().map((file) => [file.split(sep).join('/'), integrityOf(join(CDN, file))]),
  );
  writeFileSync(join(CDN, 'integrity.json'), `${JSON.stringify(hashes, null, 2)}\n`);
  return hashes;
}
