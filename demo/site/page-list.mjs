/** `pages.json` in the built site: every page of it, for whoever wants to visit them all. */
import { writeFileSync } from 'node:fs';

/** @param results {{ url: string, outputPath: string }[]} what Eleventy has written. */
export function writePageList(results) {
  const urls = results.filter(({ outputPath }) => outputPath?.endsWith('.html')).map(({ url }) => url);
  writeFileSync('demo/dist/pages.json', `${JSON.stringify(urls.sort(), null, 2)}\n`);
}
