/** What the first page adds to the element: tabs, copying a view, opening a file, and showing an error. */
import { copy } from './site/copy.js';
import { addressOf, takeFiles } from './site/local-file.js';
import { viewOf } from './site/view.js';
import { bringTabsToLife } from './site/tabs.js';

const byId = (id) => document.getElementById(id);

bringTabsToLife(document.querySelector('.tabs'));

byId('copy-view').addEventListener('click', async () => {
  const view = Object.entries(viewOf(byId('hero'))).map(([name, value]) => `  ${name}="${value}"`);
  const html = `<gaussian-splat src="skull.spz" alt="A skull" camera-controls\n${view.join('\n')}></gaussian-splat>`;
  byId('snippet').textContent = `<script type="module" src="cdn/gaussian-splat.min.js"></script>\n${html}`;
  byId('copied').textContent = await copy(html);
});

takeFiles(byId('drop'), (file) => {
  const element = byId('own-scene');
  element.hidden = false;
  element.src = addressOf(file);
  byId('own-status').textContent = `Loading ${file.name}`;
});

/** Tells below an element what became of its source. */
function report(element, status) {
  element.addEventListener('load', () => {
    const { splats, dropped, bytes } = element.statistics;
    const left = dropped > 0 ? `, ${dropped} unusable ones left out` : '';
    status.textContent = `${splats.toLocaleString()} splats${left}, ${(bytes / 1e6).toFixed(1)} MB of GPU memory`;
  });
  element.addEventListener('error', () => {
    status.textContent = element.error.message;
  });
}

report(byId('own-scene'), byId('own-status'));
report(byId('faulty'), byId('faulty-status'));

for (const button of document.querySelectorAll('button[data-source]')) {
  button.addEventListener('click', () => {
    byId('faulty').hidden = false;
    byId('faulty').src = button.dataset.source;
  });
}
