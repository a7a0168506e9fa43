/** Converts documents of the repository to pages: headings that links can name, links to pages, tables that scroll on a phone. */
import { existsSync } from 'node:fs';
import { join, posix } from 'node:path';
import { root } from '../../scripts/lib/run.mjs';
import { documents } from './documents.mjs';
import { pageFolders, relativeAddress } from './links.mjs';

/** Folders and files of the repository that have an address on the site, besides the documents. */
const ADDRESSES = [
  [/^docs\/(?:README\.md|(?:decisions|guide)\/?)$/, '/docs/'],
  [/^docs\/frontier\/?$/, '/speed/'],
  [/^docs\/frontier\/(.+)$/, '/speed/data/$1'],
  [/^docs\/stability\/(.+)$/, '/stability/data/$1'],
  [/^docs\/([^/]+\.(?:png|webp))$/, '/docs/$1'],
  [/^demo\/(scenes\/.+|generators\/.+\.(?:onnx|json|webp|png))$/, '/$1'],
  [/^benchmarks\/?$/, '/bench/'],
  [/^benchmarks\/([\w-]+\.html)$/, '/bench/$1'],
  [new RegExp(`^demo/(${pageFolders.join('|')})/?$`), '/$1/'],
];
const urlOfSource = new Map(documents.map(({ source, url }) => [source, url]));

/** Teaches markdown-it; the document is in the page's data. */
export function improveMarkdown(markdown) {
  markdown.core.ruler.push('documents', ({ tokens, env }) => {
    nameHeadings(tokens);
    emptyHeads(tokens);
    for (const token of tokens) if (token.type === 'inline') rewriteInline(token.children, env);
  });
  const { rules } = markdown.renderer;
  rules.table_open = () => '<div class="scroll" tabindex="0" role="group" aria-label="Table"><table>\n';
  rules.table_close = () => '</table></div>\n';
  const fence = rules.fence;
  rules.fence = (...all) => fence(...all).replace('<pre>', '<pre tabindex="0">');
  rules.code_block = (...[tokens, i]) =>
    `<pre tabindex="0"><code>${markdown.utils.escapeHtml(tokens[i].content)}</code></pre>\n`;
}

/** The names that links to headings use: those of the common hosts of repositories. */
export function slugOf(text) {
  return text
    .trim()
    .toLowerCase()
    .replace(/[^\p{L}\p{N}\s_-]/gu, '')
    .replaceAll(' ', '-');
}

function nameHeadings(tokens) {
  const taken = new Map();
  tokens.forEach((token, i) => {
    if (token.type !== 'heading_open') return;
    const text = tokens[i + 1].children.map(({ content }) => content).join('');
    const slug = slugOf(text) || 'section';
    const times = taken.get(slug) ?? 0;
    taken.set(slug, times + 1);
    token.attrSet('id', times === 0 ? slug : `${slug}-${times}`);
  });
}

/** A head cell without words is no heading for screen readers. */
function emptyHeads(tokens) {
  tokens.forEach((token, i) => {
    if (token.type !== 'th_open' || tokens[i + 1].content !== '') return;
    token.tag = 'td';
    tokens[i + 2].tag = 'td';
  });
}

function rewriteInline(children, { document, page }) {
  const unlinked = [];
  for (const token of children) {
    if (token.type === 'image') token.attrSet('src', targetOf(token.attrGet('src'), document, page)?.href ?? '');
    if (token.type === 'link_open') {
      const target = targetOf(token.attrGet('href'), document, page);
      unlinked.push(target.href === undefined);
      if (target.href !== undefined) token.attrSet('href', target.href);
      else becomeSpan(token, target);
    }
    if (token.type === 'link_close' && unlinked.pop()) token.tag = 'span';
  }
}

/** Files that are no pages are named, not linked: the site does not know the repository's address. */
function becomeSpan(token, { path, isThere }) {
  token.tag = 'span';
  token.attrs = [
    ['class', isThere ? 'path' : 'broken-link'],
    ['title', `${path} in the repository`],
  ];
}

/** The target of a document's link on the site: `{ href }`, or `{ path, isThere }` of a file that is no page. */
function targetOf(link, document, page) {
  if (document === undefined || /^([a-z]+:|#)/i.test(link)) return { href: link };
  const [file, fragment] = link.split('#');
  const path = posix.normalize(posix.join(posix.dirname(document.source), decodeURIComponent(file))).replace(/\/$/, '');
  const url = addressOf(path);
  if (url === undefined) return { path, isThere: existsSync(join(root, path)) };
  return { href: relativeAddress(page.url, url) + (fragment ? `#${fragment}` : '') };
}

function addressOf(path) {
  const ofDocument = urlOfSource.get(path) ?? urlOfSource.get(`${path}/README.md`);
  if (ofDocument !== undefined) return ofDocument;
  const [pattern, address] = ADDRESSES.find(([each]) => each.test(path)) ?? [];
  return pattern && path.replace(pattern, address);
}
