/** The built site read as files: links lead somewhere, and every attribute that a tag has in any text exists. */
import assert from 'node:assert/strict';
import { existsSync, readdirSync, readFileSync, statSync } from 'node:fs';
import { join, posix } from 'node:path';
import { test } from 'node:test';
import { snippets } from './snippets.js';
import { isBuilt, pagesOf, root, site } from './support.js';

const skip = isBuilt ? false : 'no site: npm run build';
const textOf = new Map<string, string>();

/** The page of an address. */
function read(url: string): string {
  const path = url.endsWith('/') ? `${url}index.html` : url;
  if (!textOf.has(path)) textOf.set(path, readFileSync(join(site, path), 'utf8'));
  return textOf.get(path)!;
}

const unescape = (text: string): string =>
  text.replaceAll('&lt;', '<').replaceAll('&gt;', '>').replaceAll('&quot;', '"').replaceAll('&amp;', '&');

/** Links of a page's tags. Examples of code are text there, and have no tags. */
function linksOf(url: string): string[] {
  const tags = [...read(url).matchAll(/<[a-z][^<>]*>/g)].map(([tag]) => tag);
  const links = tags.flatMap((tag) =>
    [...tag.matchAll(/\s(?:href|src|poster|postprocess)="([^"]*)"/g)].map(([, link]) => unescape(link)),
  );
  // One example shows the element with a missing file.
  return links.filter((link) => !/^(https?:|data:|mailto:)|\/missing\.spz$/.test(link));
}

const idsOf = (url: string): Set<string> => new Set([...read(url).matchAll(/\sid="([^"]+)"/g)].map(([, id]) => id));

test('links lead to pages, files and headings that are there', { skip }, () => {
  const dead: string[] = [];
  let count = 0;
  for (const url of pagesOf()) {
    for (const link of linksOf(url)) {
      count++;
      const [, path, fragment] = /^([^?#]*)(?:\?[^#]*)?(?:#(.*))?$/.exec(link)!;
      const target = path === '' ? url : posix.join(url.endsWith('/') ? url : posix.dirname(url), path);
      const file = join(site, decodeURIComponent(target.endsWith('/') ? `${target}index.html` : target));
      if (!existsSync(file) || statSync(file).isDirectory()) dead.push(`${url}: ${link}`);
      else if (fragment && file.endsWith('.html') && !idsOf(target).has(fragment)) dead.push(`${url}: ${link}`);
    }
  }
  assert.ok(count > 1000, `${count} links`);
  assert.deepEqual(dead, []);
});

test('documents link to files of the repository that are there', { skip }, () => {
  const broken = pagesOf().flatMap((url) =>
    [...read(url).matchAll(/class="broken-link" title="([^"]+)"/g)].map(([, title]) => `${url}: ${title}`),
  );
  assert.deepEqual(broken, []);
});

test('headings of documents do not hold the text below them', { skip }, () => {
  const headings = pagesOf()
    .filter((url) => url.startsWith('/docs/'))
    .flatMap((url) => [...read(url).matchAll(/<h[1-6][^>]*>([^]*?)<\/h[1-6]>/g)].map(([, text]) => `${url}: ${text}`));
  assert.ok(headings.length > 100, `${headings.length} headings`);
  const glued = headings.filter((heading) => /<strong>|\d{4}-\d\d-\d\d$|: .{120}/.test(heading));
  assert.deepEqual(glued, []);
});

test('every page is reached from the first', { skip }, () => {
  const reached = new Set<string>();
  const visit = (url: string): void => {
    if (reached.has(url)) return;
    reached.add(url);
    for (const link of linksOf(url)) {
      const path = link.split(/[?#]/)[0];
      const target = posix.join(url.endsWith('/') ? url : posix.dirname(url), path);
      if (pagesOf().includes(target)) visit(target);
    }
  };
  visit('/');
  assert.deepEqual(
    pagesOf().filter((url) => !reached.has(url)),
    [],
  );
});

/** Attributes of every element of any kind. */
const GLOBAL = /^(id|class|style|slot|hidden|title|tabindex|key|ref|role|aria-[a-z]+|data-[a-z-]+|control-[\w-]+)$/;
/** An ellipsis, and what templates of frameworks put before a name. */
const IN_TEMPLATES = /^(…|@|:|v-|on[A-Z])/;

/** Sources that show the tag to people. */
function sources(folder: string): string[] {
  return readdirSync(join(root, folder), { withFileTypes: true }).flatMap((entry) => {
    const path = posix.join(folder, entry.name);
    if (entry.isDirectory()) return /^(node_modules|dist|cdn|src|\..*)$/.test(entry.name) ? [] : sources(path);
    return /\.(md|html|njk|vue)$/.test(entry.name) ? [path] : [];
  });
}

/** `[file, attribute]` of each tag in a text, written as markup or escaped. */
function attributesIn(file: string): string[] {
  const text = unescape(readFileSync(join(root, file), 'utf8')).replace(/\{\{.*?\}\}|\{%.*?%\}/gs, '');
  const tags = [...text.matchAll(/<gaussian-splat((?:\s+[^\s"'=<>/]+(?:=(?:"[^"]*"|'[^']*'|[^\s"'>]+))?)*)\s*\/?>/g)];
  return tags.flatMap(([, list]) =>
    [...list.matchAll(/([^\s"'=]+)(?:=(?:"[^"]*"|'[^']*'|[^\s"'>]+))?/g)].map(([, name]) => name),
  );
}

test('every attribute that a tag has on a page or in a document is in the manifest', { skip }, () => {
  const manifest = JSON.parse(readFileSync(join(root, 'packages/element/custom-elements.json'), 'utf8')) as {
    modules: { declarations: { tagName?: string; attributes?: { name: string }[] }[] }[];
  };
  const known = manifest.modules
    .flatMap(({ declarations }) => declarations)
    .find(({ tagName }) => tagName === 'gaussian-splat')!
    .attributes!.map(({ name }) => name);
  const files = ['README.md', 'CONTRIBUTING.md', 'SECURITY.md', ...['demo', 'docs', 'packages'].flatMap(sources)];
  const built = pagesOf().map((url) => `demo/dist${url.endsWith('/') ? `${url}index.html` : url}`);
  const unknown: string[] = [];
  let count = 0;
  for (const file of [...files, ...built]) {
    for (const name of attributesIn(file)) {
      count++;
      if (!known.includes(name) && !GLOBAL.test(name) && !IN_TEMPLATES.test(name)) unknown.push(`${file}: ${name}`);
    }
  }
  assert.ok(count > 100, `${count} attributes`);
  assert.deepEqual(unknown, []);
});

test('a tag whose style has a height has a width, too: without one it is 300 pixels wide', { skip }, () => {
  const styles = snippets('html', 'vue', 'astro', 'svelte').flatMap(({ place, code }) =>
    [...code.matchAll(/<gaussian-splat\s[^>]*?\sstyle="([^"]*)"/g)].map(([, style]) => ({ place, style })),
  );
  assert.ok(styles.length > 5, `${styles.length} styles`);
  const narrow = styles.filter(({ style }) => /(^|[\s;])height:/.test(style) && !/(^|[\s;])width:/.test(style));
  assert.deepEqual(narrow, []);
});
