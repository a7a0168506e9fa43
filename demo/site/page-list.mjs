/** The built site for programs: all pages, documents as they were written, and the index of search. */
import { mkdirSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { documents } from './documents.mjs';
import { slugOf } from './markdown.mjs';

const DIST = 'demo/dist';

/** `pages.json`: every page. @param results {{ url: string, outputPath: string }[]} what Eleventy has written. */
export function writePageList(results) {
  const urls = results
    .filter(({ outputPath, url }) => outputPath?.endsWith('.html') && url !== '/404.html')
    .map(({ url }) => url);
  writeFileSync(join(DIST, 'pages.json'), `${JSON.stringify(urls.sort(), null, 2)}\n`);
  writeTwins();
  writeFileSync(join(DIST, 'llms.txt'), overview());
  writeFileSync(join(DIST, 'docs/search.json'), JSON.stringify(documents.flatMap(passagesOf)));
}

/** Beside each document's page its Markdown: `docs/guide/start/index.md`. */
function writeTwins() {
  for (const { url, text } of documents) {
    mkdirSync(join(DIST, url), { recursive: true });
    writeFileSync(join(DIST, url, 'index.md'), text);
  }
}

/** https://llmstxt.org: the contents of the site in Markdown. */
function overview() {
  const sections = [...new Set(documents.map(({ section }) => section))].filter((section) => section !== 'Decisions');
  const listed = sections.map((section) => {
    const items = documents.filter((document) => document.section === section);
    return `## ${section}\n\n${items.map(({ title, url }) => `- [${title}](${url.slice(1)}index.md)`).join('\n')}`;
  });
  return `# gaussian-splat\n\n> A custom element that shows Gaussian splats on any web page, drawn with WebGPU.\n\n${listed.join('\n\n')}\n`;
}

/**
 * Text of a document under each of its headings. Decisions and figures are for contributors, and would drown the rest.
 */
function passagesOf({ section, title, url, text }) {
  if (section === 'Decisions' || section === 'Accuracy and speed') return [];
  return text.split(/^(?=#{1,3} )/m).map((part) => {
    const [, heading = title] = /^#+ (.+)$/m.exec(part) ?? [];
    const words = heading.replace(/[`*]/g, '');
    return {
      title,
      heading: words,
      address: `${url.slice(6)}#${slugOf(words)}`,
      text: part.replace(/^#.*$/m, '').replace(/[`*|#<>]/g, ' '),
    };
  });
}
