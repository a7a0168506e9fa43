/** The repository's own documents, which the site renders in place: each has one source. */
import { existsSync, readdirSync, readFileSync } from 'node:fs';
import { join, posix } from 'node:path';
import { root } from '../../scripts/lib/run.mjs';

/** Sections in the order of the site. A document belongs to the first rule that matches its path, and stands in the order of the rules. */
const guide = (name) => new RegExp(`^docs/guide/${name}`);
const SECTIONS = [
  [
    'Guide',
    [
      ...[
        'start',
        'concepts',
        'prepare',
        'attributes',
        'camera',
        'loading',
        'labels',
        'animation',
        'changing-scenes',
        'notebooks',
        'styling',
        'events',
      ].map(guide),
      ...[
        'scenes-and-meshes',
        'effects',
        'large-scenes',
        'many-machines',
        'depth',
        'performance',
        'accessibility',
        'hosting',
        'frameworks',
        'three',
        'vue',
      ].map(guide),
      /^packages\/(element|react)\/README/,
    ],
  ],
  ['Help', ['troubleshooting', 'browsers', 'limits', 'compare', 'coming-from'].map(guide)],
  [
    'Generators',
    [
      guide('own-generator'),
      /^docs\/contract/,
      /^packages\/(generator|check|exporter|notebook)\//,
      /^demo\/generators\/README/,
    ],
  ],
  [
    'Accuracy and speed',
    [/^docs\/accuracy/, /^docs\/benchmark/, /^docs\/stability/, /^docs\/papers/, /^packages\/optimize\//],
  ],
  [
    'Without the element',
    [guide(''), /^packages\/(renderer|three|formats|core|cli)\/README/, /^docs\/(lod-format|sequences)/],
  ],
  ['For contributors', [/^CONTRIBUTING/, /^docs\/architecture/, /^packages\//, /^scripts\//, /^README/]],
  ['Decisions', [/^docs\/decisions\//]],
  ['About', [/^CHANGELOG/, /^SECURITY/, /^LICENSE/, /ATTRIBUTION/, /^docs\//]],
];
const TITLES = {
  'README.md': 'README',
  LICENSE: 'License',
  'docs/architecture.md': 'Architecture',
  'packages/element/README.md': 'The npm package',
  'packages/react/README.md': 'React',
  'demo/scenes/ATTRIBUTION.md': 'Attribution: scenes',
  'demo/generators/ATTRIBUTION.md': 'Attribution: generators',
};
const AT_ROOT = ['CONTRIBUTING.md', 'CHANGELOG.md', 'SECURITY.md', 'LICENSE', 'README.md'];
const NOT_OURS = /(^|\/)(node_modules|dist|\.[^/]+)$/;

/** Every document: `{ source, section, title, url, text }`, its source relative to the repository's root. */
export const documents = listDocuments();

function listDocuments() {
  const sources = [
    ...AT_ROOT.filter((name) => existsSync(join(root, name))),
    ...['docs', 'packages', 'demo/generators', 'demo/scenes', 'scripts'].flatMap(markdownIn),
  ]
    .filter((source) => source !== 'docs/README.md') // The site's own list of documents replaces it.
    .sort();
  const taken = new Set();
  return SECTIONS.flatMap(([section, rules]) =>
    rules.flatMap((rule) => {
      const found = sources.filter((source) => rule.test(source) && !taken.has(source));
      for (const source of found) taken.add(source);
      return found.map((source) => describe(source, section));
    }),
  );
}

function markdownIn(folder) {
  return readdirSync(join(root, folder), { withFileTypes: true }).flatMap((entry) => {
    const path = `${folder}/${entry.name}`;
    if (entry.isDirectory()) return NOT_OURS.test(path) ? [] : markdownIn(path);
    return entry.name.endsWith('.md') ? [path] : [];
  });
}

function describe(source, section) {
  const text = readFileSync(posix.join(root, source), 'utf8');
  const [, heading] = /^# (.+)$/m.exec(text) ?? [];
  const title = TITLES[source] ?? plain(heading ?? source);
  // A license has no heading; a page needs one.
  return { source, section, title, url: urlOf(source), text: heading ? text : `# ${title}\n\n${text}` };
}

/** A heading without its marks. */
function plain(heading) {
  return heading.replace(/[`*]/g, '').replaceAll('&lt;', '<').replaceAll('&gt;', '>');
}

/** `docs/guide/start.md` is at `/docs/guide/start/`, `packages/element/README.md` at `/docs/packages/element/`. */
function urlOf(source) {
  if (source === 'README.md') return '/docs/readme/';
  const path = source
    .replace(/^docs\//, '')
    .replace(/\/README\.md$/, '')
    .replace(/\.md$/, '');
  return `/docs/${path.toLowerCase()}/`;
}
