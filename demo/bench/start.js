/** The page of first pictures: pages of two lines in frames, as on a first visit and on later ones. See docs/benchmark.md. */
import { element, showError, showProgress } from './page/show.js';
import { sendReport } from './run/report.js';

/** Begins the keys under which pages keep what suits a GPU. */
const CHOICES = 'gaussian-splat ';
/** Milliseconds that a picture may take, and that the search for what suits the GPU may take once the page is at rest. */
const LONGEST = 60_000;
const LONGEST_SEARCH = 20_000;

/** What is measured, from the page's address. */
function readPlan(query) {
  const [visits, width, height] = [
    ['visits', 4],
    ['width', 1280],
    ['height', 720],
  ].map(([name, usual]) => {
    const value = Number(query.get(name) ?? usual);
    if (!Number.isInteger(value) || value < 1) throw new RangeError(`${name}: expected a whole number from 1 on`);
    return value;
  });
  const scene = query.get('scene') || '../scenes/skull.spz';
  return { scene, visits, width, height };
}

const choices = () => Object.keys(localStorage).filter((key) => key.startsWith(CHOICES));

/** A page of two lines that tells when there is something to see. */
function pageOf({ scene, width, height }) {
  const attribute = (text) => text.replaceAll('&', '&amp;').replaceAll('"', '&quot;');
  return `<!doctype html><meta charset="utf-8"><title>A visit</title>
<style>body { margin: 0 } gaussian-splat { display: block; width: ${width}px; height: ${height}px }</style>
<script type="module" src="${new URL('../cdn/gaussian-splat.min.js', location.href)}"></script>
<gaussian-splat src="${attribute(new URL(scene, location.href).href)}" alt="" loading="eager"></gaussian-splat>
<script>
  const splat = document.querySelector('gaussian-splat');
  const tell = (what, message) => parent.postMessage({ what, message }, self.origin);
  splat.addEventListener('preview', () => tell('preview'));
  splat.addEventListener('error', ({ detail }) => tell('error', detail?.message ?? 'no scene'));
  // The picture is on show with the next one of the display.
  splat.addEventListener('load', () => requestAnimationFrame(() => requestAnimationFrame(() => tell('shown'))));
</script>`;
}

/** Opens such a page. @returns milliseconds to its first preview, if there is one, and to the whole picture, and its frame, open still */
function visit(plan) {
  const frame = element('iframe', { title: 'A visit', width: plan.width, height: plan.height, srcdoc: pageOf(plan) });
  return new Promise((resolve, reject) => {
    const begun = performance.now();
    let previewMs;
    const end = (settle, value) => {
      clearTimeout(timer);
      removeEventListener('message', listen);
      settle(value);
    };
    const timer = setTimeout(() => end(reject, new Error(`no frame within ${LONGEST / 1000} s`)), LONGEST);
    function listen({ source, data }) {
      if (source !== frame.contentWindow) return;
      const now = performance.now() - begun;
      if (data.what === 'preview') previewMs ??= now;
      if (data.what === 'error') end(reject, new Error(data.message));
      if (data.what === 'shown') end(resolve, { previewMs, shownMs: now, frame });
    }
    addEventListener('message', listen);
    document.getElementById('stage').replaceChildren(frame);
  });
}

/** Waits until a page that is at rest has found what suits the GPU. @returns milliseconds; undefined if it takes too long */
async function untilChosen() {
  const begun = performance.now();
  while (choices().length === 0) {
    if (performance.now() - begun > LONGEST_SEARCH) return undefined;
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
  return performance.now() - begun;
}

function show(visits) {
  const cells = (name, values) =>
    element(
      'tr',
      {},
      values.map((textContent) => element(name, { textContent })),
    );
  const ms = (value) => (value === undefined ? '' : Math.round(value).toLocaleString('en'));
  const rows = visits.map(({ previewMs, shownMs, chosenMs }, i) =>
    cells('td', [i === 0 ? 'first' : 'later', ms(previewMs), ms(shownMs), ms(chosenMs)]),
  );
  const head = cells('th', ['visit', 'first preview, ms', 'whole picture, ms', 'then until the choice is made, ms']);
  const table = element('table', {}, [element('thead', {}, [head]), element('tbody', {}, rows)]);
  document.getElementById('results').replaceChildren(table);
}

async function main() {
  const query = new URLSearchParams(location.search);
  if (location.search.length < 2) return;
  let report;
  try {
    const plan = readPlan(query);
    for (const key of choices()) localStorage.removeItem(key);
    const visits = [];
    for (let i = 0; i < plan.visits; i++) {
      showProgress(`visit ${i + 1} of ${plan.visits}`);
      const { frame, ...times } = await visit(plan);
      visits.push({ ...times, chosenMs: i === 0 ? await untilChosen() : undefined });
      frame.remove();
      show(visits);
    }
    const chosen = choices().map((key) => JSON.parse(localStorage.getItem(key)));
    report = { kind: 'start', userAgent: navigator.userAgent, plan, visits, chosen };
    document.getElementById('status').textContent = 'Done.';
    document.getElementById('json').textContent = JSON.stringify(report, null, 2);
    document.getElementById('raw').hidden = false;
  } catch (error) {
    report = { kind: 'start', error: String(error.stack ?? error) };
    showError(error);
  }
  await sendReport(report, query.get('report'));
}

await main();
