/** What the demo page adds to the element: copying a view, opening a file, and showing an error. */

const byId = (id) => document.getElementById(id);

byId('copy-view').addEventListener('click', async () => {
  const hero = byId('hero');
  const html =
    `<gaussian-splat src="skull.spz" alt="A skull" camera-controls\n` +
    `  camera-orbit="${hero.getCameraOrbit()}" camera-target="${hero.getCameraTarget()}"\n` +
    `  field-of-view="${hero.getFieldOfView()}"></gaussian-splat>`;
  byId('snippet').textContent = `<script type="module" src="gaussian-splat.min.js"></script>\n${html}`;
  try {
    await navigator.clipboard.writeText(html);
    byId('copied').textContent = 'Copied.';
  } catch {
    byId('copied').textContent = 'Shown above: the browser did not allow copying.';
  }
});

let objectUrl;

/** Shows a local file. The name goes into the fragment, so that the element can tell formats without a signature apart. */
function open(file) {
  const element = byId('own-scene');
  if (objectUrl) URL.revokeObjectURL(objectUrl);
  objectUrl = URL.createObjectURL(file);
  element.hidden = false;
  element.src = `${objectUrl}#${encodeURIComponent(file.name)}`;
  byId('own-status').textContent = `Loading ${file.name}`;
}

byId('file').addEventListener('change', ({ target }) => {
  if (target.files.length > 0) open(target.files[0]);
});

const drop = byId('drop');
for (const type of ['dragenter', 'dragover']) {
  drop.addEventListener(type, (event) => {
    event.preventDefault();
    drop.classList.add('over');
  });
}
for (const type of ['dragleave', 'drop']) drop.addEventListener(type, () => drop.classList.remove('over'));
drop.addEventListener('drop', (event) => {
  event.preventDefault();
  const [file] = event.dataTransfer.files;
  if (file) open(file);
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
