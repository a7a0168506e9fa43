/**
 * The site as Eleventy builds it: pages are the HTML files of demo/, each beside its scripts, and those of benchmarks/; the documents of the
 * repository are rendered beside them in place. `npm run build` runs it after the packages.
 */
import { readdirSync, readFileSync, statSync } from 'node:fs';
import { join } from 'node:path';
import { root } from '../../scripts/lib/run.mjs';
import { documents } from './documents.mjs';
import { codes } from './codes.mjs';
import { pageFolders, relativeAddress } from './links.mjs';
import { improveMarkdown } from './markdown.mjs';
import { writePageList } from './page-list.mjs';

/** Files that pages load unchanged, and their targets. */
const COPIED = {
  'demo/style.css': 'style.css',
  'demo/home.css': 'home.css',
  'demo/icon.svg': 'icon.svg',
  'demo/scenes': 'scenes',
  'benchmarks/page/bench.css': 'bench/page/bench.css',
  'benchmarks/peers/*.html': 'bench/peers',
  'docs/*.{png,webp}': 'docs',
  'docs/stability': 'stability/data',
  'docs/frontier': 'speed/data',
  'packages/element/cdn': 'cdn',
};
/** HTML that is no page of the site. */
const NOT_PAGES = ['demo/dist/**', 'demo/site/layouts/**'];

export default function configure(eleventy) {
  eleventy.setUseGitIgnore(false);
  for (const pattern of NOT_PAGES) eleventy.ignores.add(pattern);
  // Documents come in by name, below; Markdown beside scenes and models is not a page.
  eleventy.ignores.add('demo/**/*.md');
  eleventy.setServerPassthroughCopyBehavior('copy');
  eleventy.addPassthroughCopy(COPIED);
  for (const name of pageFolders) eleventy.addPassthroughCopy({ [`demo/${name}/*.css`]: name });
  eleventy.addPassthroughCopy('demo/generators/**/*.{onnx,json,webp,png}');
  eleventy.addGlobalData('documents', documents);
  for (const document of documents) {
    const path = document.source.endsWith('.md') ? document.source : `${document.source}.md`;
    eleventy.addTemplate(`documents/${path}`, document.text, {
      layout: 'document.njk',
      templateEngineOverride: 'md',
      permalink: `${document.url}index.html`,
      title: document.title,
      document,
    });
  }
  // The pages that measure lie with their scripts, outside the demo.
  for (const name of readdirSync(join(root, 'benchmarks')).filter((file) => file.endsWith('.html')))
    eleventy.addTemplate(`bench/${name}`, readFileSync(join(root, 'benchmarks', name), 'utf8'));
  eleventy.amendLibrary('md', improveMarkdown);
  eleventy.addFilter('megabytes', (path) => `${(statSync(join(root, path)).size / 1e6).toFixed(2)} MB`);
  eleventy.addFilter('source', (path) => readFileSync(join(root, path), 'utf8'));
  eleventy.addFilter('codes', codes);
  eleventy.addFilter('selectByName', (items, wanted) => items.find(({ name }) => name === wanted));
  eleventy.addFilter('selectByTag', (items, wanted) => items.find(({ tag }) => tag === wanted));
  // Pages are linked relatively: the site may lie in any folder of any host.
  eleventy.addFilter('from', (target, url) => relativeAddress(url, target));
  eleventy.on('eleventy.after', ({ results }) => writePageList(results));
  return {
    dir: { input: 'demo', output: 'demo/dist', includes: 'site/layouts', layouts: 'site/layouts', data: 'site/data' },
    templateFormats: ['html', 'njk', 'md'],
    htmlTemplateEngine: 'njk',
    markdownTemplateEngine: false,
  };
}
