/** Page that lists scenes with their figures, and shows the selected one. */
import { cpSync, existsSync, readFileSync } from 'node:fs';
import { join, relative } from 'node:path';
import { fileURLToPath } from 'node:url';
import { writeWhole } from './output-file.mjs';

const elementFile = (path) => fileURLToPath(new URL(path, import.meta.resolve('@gaussian-splat/element/package.json')));
/** Folder of the built element. */
export const CDN = elementFile('cdn');

/** Copies the element without source maps, and without ONNX Runtime (43 MB) unless a scene is a generator. */
export function copyElement(target, withRuntime) {
  const isNeeded = (path) => {
    const inside = relative(CDN, path);
    return !inside.endsWith('.map') && (withRuntime || !inside.startsWith('onnxruntime'));
  };
  cpSync(CDN, target, { recursive: true, filter: isNeeded });
}

export const addressOf = (source) => source.split(/[\\/]/).map(encodeURIComponent).join('/');
export const escaped = (text) =>
  text.replaceAll('&', '&amp;').replaceAll('"', '&quot;').replaceAll('<', '&lt;').replaceAll('>', '&gt;');

/** Mark of a page that this module has written, and may replace. */
const MARK = '<meta name="generator" content="gaussian-splat catalogue" />';

/**
 * Writes the page of a folder, and the element beside it. A page of another author stays.
 * @param rows Rows of the table of `runBatch`, with `src`: the address of the scene relative to the folder, `tag`, and
 * `attributes` without values.
 */
export function writeCatalogue(folder, rows) {
  const page = join(folder, 'index.html');
  if (!existsSync(CDN)) return console.log('without a catalogue: the element has not been built');
  if (existsSync(page) && !readFileSync(page, 'utf8').includes(MARK))
    return console.log(`${page} exists and was not changed`);
  copyElement(
    join(folder, 'cdn'),
    rows.some(({ src = '' }) => /\.onnx$/i.test(src)),
  );
  writeWhole(page, pageOf(rows));
}

const megabytes = (bytes) => (bytes === undefined ? '' : `${(bytes / 1e6).toFixed(2)} MB`);

function lineOf({ file, src, tag = 'gaussian-splat', attributes = [], splats, bytesBefore, bytesAfter, psnr, error }) {
  const name = escaped(file);
  const link = src
    ? `<a href="#${encodeURIComponent(file)}" data-tag="${tag}"${attributes.length > 0 ? ` data-attributes="${attributes.join(' ')}"` : ''} data-src="${addressOf(src)}">${name}</a>`
    : name;
  const cells = [splats?.toLocaleString('en') ?? '', megabytes(bytesBefore), megabytes(bytesAfter)];
  const rest = [...cells, psnr === undefined ? '' : `${psnr.toFixed(2)} dB`, escaped(error?.split('\n')[0] ?? '')];
  return `<tr><td>${[link, ...rest].join('</td><td>')}</td></tr>`;
}

function pageOf(rows) {
  return `<!doctype html>
<html lang="en">
  <meta charset="utf-8" />
  <meta name="viewport" content="width=device-width, initial-scale=1" />
  ${MARK}
  <title>${rows.length} scenes</title>
  <style>
    body { margin: 0; font: 16px/1.5 system-ui, sans-serif; }
    main { height: 60vh; background: #ddd; }
    gaussian-splat { display: block; width: 100%; height: 100%; }
    table { border-collapse: collapse; margin: 1rem; }
    td, th { padding: 0.2rem 0.8rem; text-align: right; }
    td:first-child, th:first-child, td:last-child, th:last-child { text-align: left; }
    [aria-current] { font-weight: bold; }
  </style>
  <main></main>
  <table>
    <tr><th>scene</th><th>splats</th><th>before</th><th>after</th><th>accuracy</th><th>error</th></tr>
    ${rows.map(lineOf).join('\n    ')}
  </table>
  <script type="module" src="cdn/gaussian-splat.min.js"></script>
  <script>
    const links = [...document.querySelectorAll('[data-src]')];
    function show() {
      const link = links.find((one) => one.hash === location.hash) ?? links[0];
      if (!link) return;
      for (const one of links) one.toggleAttribute('aria-current', one === link);
      const element = document.createElement('gaussian-splat');
      for (const name of ['camera-controls', ...(link.dataset.attributes ?? '').split(' ')])
        if (name) element.setAttribute(name, '');
      element.setAttribute('alt', link.textContent);
      const isMesh = link.dataset.tag === 'splat-mesh';
      const source = isMesh ? element.appendChild(document.createElement('splat-mesh')) : element;
      source.setAttribute('src', link.dataset.src);
      document.querySelector('main').replaceChildren(element);
    }
    addEventListener('hashchange', show);
    show();
  </script>
</html>
`;
}
