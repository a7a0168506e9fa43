/** Additions of the home page to the element: chips that act on its scene, tabs, copying a view, a race, and opening a file. */
import { copy } from './site/copy.js';
import { addressOf, takeFiles } from './site/local-file.js';
import { viewOf } from './site/view.js';
import { bringTabsToLife } from './site/tabs.js';
import { chipsOf } from './site/chips.js';

const byId = (id) => document.getElementById(id);
const hero = byId('hero');
const status = byId('own-status');
/** Name of the visitor's own file; undefined while the scene is the page's. */
let own;
const quoted = (text) => text.replaceAll('&', '&amp;').replaceAll('"', '&quot;').replaceAll('<', '&lt;');
/** Attributes of the scene that is shown: a file of the visitor is to lie beside the copied page. */
const sceneTag = (src) =>
  own ? `src="${encodeURIComponent(own)}" alt="${quoted(own)}"` : `src="${src}" alt="A living room"`;

async function copied(html) {
  byId('snippet').textContent = html;
  const said = await copy(html);
  byId('copied').textContent = own ? `${said} Put ${own} beside your page, and serve both.` : said;
}

bringTabsToLife(document.querySelector('.tabs'));
const chips = chipsOf(hero, document.querySelector('.hero'), (html) => (byId('snippet').textContent = html));

byId('copy-page').addEventListener('click', async () => {
  const address = (path) => new URL(path, document.baseURI).href;
  const view = Object.entries(viewOf(hero)).map(([name, value]) => `  ${name}="${value}"`);
  const html = `<!doctype html>
<html lang="en">
<meta charset="utf-8" />
<meta name="viewport" content="width=device-width, initial-scale=1" />
<title>${own ? quoted(own) : 'A living room'}</title>
<script type="module" src="${address('cdn/gaussian-splat.min.js')}"></script>
<gaussian-splat ${sceneTag(address('scenes/studio/apartment.spz'))} camera-controls
${view.join('\n')}
  style="display: block; width: 100%; height: 90vh"></gaussian-splat>
</html>
`;
  await copied(html);
});

byId('copy-view').addEventListener('click', async () => {
  const view = Object.entries(viewOf(hero)).map(([name, value]) => `  ${name}="${value}"`);
  const size = '  style="width: 100%; height: auto; aspect-ratio: 4 / 3"';
  const tag = [`<gaussian-splat ${sceneTag('apartment.spz')} camera-controls`, ...view, size].join('\n');
  const html = `<script type="module" src="cdn/gaussian-splat.min.js"></script>\n${tag}></gaussian-splat>`;
  await copied(html);
});

takeFiles(document.documentElement, (file) => {
  chips.remove();
  for (const { name } of [...hero.attributes])
    if (/^(min-|max-)?camera-|^field-|^walk-|^unit$/.test(name) && name !== 'camera-controls')
      hero.removeAttribute(name);
  own = file.name;
  hero.alt = own;
  hero.src = addressOf(file);
  status.textContent = `Loading ${file.name} …`;
  hero.scrollIntoView({ block: 'nearest' });
});

hero.addEventListener('load', () => {
  if (!status.textContent.startsWith('Loading')) return;
  const {
    splats,
    dropped,
    bytes: { scene: bytes },
  } = hero.stats;
  const left = dropped > 0 ? `, ${dropped.toLocaleString()} unusable splats left out` : '';
  status.textContent = `${splats.toLocaleString()} splats${left}, ${(bytes / 1e6).toFixed(1)} MB of GPU memory`;
});
hero.addEventListener('error', () => (status.textContent = hero.error.message));

byId('measure-race').addEventListener('click', async ({ target }) => {
  const { measureRace } = await import('./site/measure-race.js');
  await measureRace({ button: target, status: byId('race-status'), table: byId('race'), place: byId('race-frame') });
});

/** Borders between the three images, in percent of their width: the second is half an image behind the first. */
const borders = byId('borders');
const setBorders = () => byId('versions').style.setProperty('--border', `${borders.value}%`);
borders.addEventListener('input', setBorders);
setBorders();
