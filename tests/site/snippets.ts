/** Code that people copy: the fenced blocks of documents, and the tabs of the first page. */
import { readdirSync, readFileSync } from 'node:fs';
import { posix } from 'node:path';
import { root } from './support.js';

export interface Snippet {
  /** Its position: a file and a line, or a tab of the first page. */
  readonly place: string;
  /** As the fence says: `html`, `ts`, `tsx`, `js`, `vue`, `sh`, ... */
  readonly language: string;
  readonly code: string;
}

const read = (path: string): string => readFileSync(`${root}${path}`, 'utf8');

/** Every document with instructions for people. */
function documents(): string[] {
  const within = (folder: string): string[] =>
    readdirSync(`${root}${folder}`).map((name) => posix.join(folder, name)).filter((path) => path.endsWith('.md')); // prettier-ignore
  const packages = readdirSync(`${root}packages`).flatMap((name) => within(`packages/${name}`));
  return ['README.md', 'CONTRIBUTING.md', 'SECURITY.md', ...within('docs/guide'), ...within('docs'), ...packages];
}

function fencedIn(path: string): Snippet[] {
  const text = read(path);
  return [...text.matchAll(/^```(\w+)\n([\s\S]*?)^```/gm)].map(({ 1: language, 2: code, index }) => ({
    place: `${path}:${text.slice(0, index).split('\n').length}`,
    language,
    code,
  }));
}

const TABS = { html: 'html', cdn: 'html', react: 'tsx', vue: 'vue' };

/** The panels of the first page, as they are shown: what Eleventy has filled in is in them. */
function tabs(): Snippet[] {
  const page = read('demo/dist/index.html');
  return Object.entries(TABS).map(([name, language]) => {
    const [, shown] = new RegExp(`id="panel-${name}"[\\s\\S]*?<code[^>]*>([\\s\\S]*?)</code>`).exec(page)!;
    return { place: `the first page, tab ${name}`, language, code: unescape(shown) };
  });
}

const unescape = (text: string): string =>
  text.replaceAll('&lt;', '<').replaceAll('&gt;', '>').replaceAll('&quot;', '"').replaceAll('&amp;', '&');

/** All of some languages. */
export function snippets(...languages: string[]): Snippet[] {
  return [...documents().flatMap(fencedIn), ...tabs()].filter(({ language }) => languages.includes(language));
}
