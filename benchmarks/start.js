/**
 * The page for first frames: pages of two lines in iframes, as on a first visit and on later ones. See
 * docs/benchmark.md.
 */
import { element, showError, showProgress } from './page/show.js';
import { sendReport } from './run/report.js';

/** Begins the keys under which pages keep what they know: what suits a GPU, and what comparing a generator with the CPU has shown. */
const KEPT = 'gaussian-splat ';
const PROOF = 'gaussian-splat proof ';
/** Time limits in ms: for a frame, and for autotuning once the page is at rest. */
const LONGEST = 60_000;
const LONGEST_SEARCH = 20_000;
const LONGEST_COMPARISON = 30_000;

/** Configurations to measure, from the page's address. */
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
  return { scene, visits, width, height, isCompared: query.has('compare') };
}

const kept = () => Object.keys(localStorage).filter((key) => key.startsWith(KEPT));
const proofs = () => kept().filter((key) => key.startsWith(PROOF));
const choices = () => kept().filter((key) => !key.startsWith(PROOF));
const forget = (keys) => keys.forEach((key) => localStorage.removeItem(key));

/** A page of two lines that reports when its scene is visible. */
function pageOf({ scene, width, height }, attributes) {
  const attribute = (text) => text.replaceAll('&', '&amp;').replaceAll('"', '&quot;');
  return `<!doctype html><meta charset="utf-8"><title>A visit</title>
<style>body { margin: 0 } gaussian-splat { display: block; width: ${width}px; height: ${height}px }</style>
<script type="module" src="${new URL('../cdn/gaussian-splat.min.js', location.href)}"></script>
<gaussian-splat src="${attribute(new URL(scene, location.href).href)}" alt="" loading="eager" ${attributes}></gaussian-splat>
<script>
  const splat = document.querySelector('gaussian-splat');
  const tell = (what, message) => parent.postMessage({ what, message }, self.origin);
  splat.addEventListener('preview', () => tell('preview'));
  splat.addEventListener('error', ({ detail }) => tell('error', detail?.message ?? 'no scene'));
  // The frame is visible at the next refresh of the display.
  splat.addEventListener('load', () => requestAnimationFrame(() => requestAnimationFrame(() => tell('shown'))));
</script>`;
}

/**
 * Opens such a page. @returns milliseconds to its first preview, if any, and to the complete frame, and its iframe,
 * which stays open
 */
function visit(plan, attributes = '') {
  const srcdoc = pageOf(plan, attributes);
  const frame = element('iframe', { title: 'A visit', width: plan.width, height: plan.height, srcdoc });
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

/** Waits until a page has kept what it found out. @returns milliseconds; undefined if it takes too long */
async function untilKept(keys, longest) {
  const begun = performance.now();
  while (keys().length === 0) {
    if (performance.now() - begun > longest) return undefined;
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
  return performance.now() - begun;
}

/**
 * Autotuning of a visit's page: milliseconds of trying the likely variants before its first frame, of the first self-test without the
 * compilation of pipelines, and of the search, without its pauses; undefined for steps that were not run.
 */
function choiceTimes({ contentWindow: { performance } }) {
  const [start] = performance.getEntriesByName('gaussian-splat.start');
  const [test] = performance.getEntriesByName('gaussian-splat.self-test');
  const [search] = performance.getEntriesByName('gaussian-splat.search');
  const without = (measure, name) => measure && measure.duration - measure.detail[name];
  return { startMs: start?.duration, testMs: without(test, 'compiling'), searchMs: without(search, 'paused') };
}

/** Longest that this page, whose thread the frames share, waits for one of the display's frames until `ended` settles, ms. */
async function longestGap(ended) {
  let [isOver, last, longest] = [false, performance.now(), 0];
  void ended.finally(() => (isOver = true));
  while (!isOver) {
    await new Promise(requestAnimationFrame);
    const now = performance.now();
    [longest, last] = [Math.max(longest, now - last), now];
  }
  return longest;
}

/**
 * Visits by turns without the comparison with the CPU and with it, as on a first visit: what was found out is forgotten each time. The frame
 * stays open until the comparison is done, or as long as that took the time before.
 */
async function visitCompared(plan) {
  const visits = [];
  let restMs = 3_000;
  for (let i = 0; i < 2 * plan.visits; i++) {
    const isCompared = i % 2 === 1;
    showProgress(`visit ${i + 1} of ${2 * plan.visits}, ${isCompared ? 'compared' : 'not compared'}`);
    forget(proofs());
    const { frame, ...times } = await visit(plan, isCompared ? '' : 'gpu-check="off"');
    const wait = isCompared
      ? untilKept(proofs, LONGEST_COMPARISON)
      : new Promise((resolve) => setTimeout(resolve, restMs));
    const longestGapMs = await longestGap(wait);
    const comparedMs = isCompared ? await wait : undefined;
    restMs = comparedMs ?? restMs;
    const verdict = proofs().map((key) => JSON.parse(localStorage.getItem(key)))[0];
    visits.push({ isCompared, ...times, comparedMs, longestGapMs, verdict });
    frame.remove();
  }
  return visits;
}

/** Times of all visits except the first of each kind, which fetch and compile. */
function compared(visits) {
  const shown = [false, true].map((kind) =>
    visits
      .filter(({ isCompared }) => isCompared === kind)
      .slice(1)
      .map(({ shownMs }) => shownMs)
      .sort((a, b) => a - b),
  );
  const [without, with_] = shown.map((times) => times[times.length >> 1]);
  return { medianWithoutMs: without, medianWithMs: with_, share: with_ / without - 1 };
}

function show(visits) {
  const cells = (name, values) =>
    element(
      'tr',
      {},
      values.map((textContent) => element(name, { textContent })),
    );
  const ms = (value) => (value === undefined ? '' : Math.round(value).toLocaleString('en'));
  const kindOf = ({ isCompared }, i) => (i === 0 ? 'first' : isCompared ? 'later, compared' : 'later');
  const rows = visits.map((visited, i) => {
    const { previewMs, shownMs, chosenMs, startMs, testMs, searchMs } = visited;
    return cells('td', [kindOf(visited, i), ...[previewMs, shownMs, startMs, testMs, chosenMs, searchMs].map(ms)]);
  });
  const head = cells('th', [
    'visit',
    'first preview, ms',
    'full frame, ms',
    'of it trial of what is likely, ms',
    'of it self-test, ms',
    'then until the choice is made, ms',
    'of it search without pauses, ms',
  ]);
  const table = element('table', {}, [element('thead', {}, [head]), element('tbody', {}, rows)]);
  document.getElementById('results').replaceChildren(table);
}

async function main() {
  const query = new URLSearchParams(location.search);
  if (location.search.length < 2) return;
  let report;
  try {
    const plan = readPlan(query);
    if (!plan.isCompared) forget(choices());
    const visits = plan.isCompared ? await visitCompared(plan) : [];
    show(visits);
    for (let i = 0; i < plan.visits && !plan.isCompared; i++) {
      showProgress(`visit ${i + 1} of ${plan.visits}`);
      const { frame, ...times } = await visit(plan);
      const chosenMs = i === 0 ? await untilKept(choices, LONGEST_SEARCH) : undefined;
      visits.push({ ...times, chosenMs, ...choiceTimes(frame) });
      frame.remove();
      show(visits);
    }
    const chosen = choices().map((key) => JSON.parse(localStorage.getItem(key)));
    report = { kind: 'start', userAgent: navigator.userAgent, plan, visits, chosen };
    if (plan.isCompared) report.comparison = compared(visits);
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
