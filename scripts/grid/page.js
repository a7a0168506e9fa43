/** The page of `npm run lab -- grid`: scenes one below the other, written as documentation recommends. Its address names how many (`count`) and the renderer. */
import { ledger } from '/soak/ledger.js';

const query = new URLSearchParams(location.search);
const count = Number(query.get('count') ?? 12);
const FILES = ['skull.spz', 'st-peter.sog', 'studio/apartment.spz'];
const POSTERS = ['skull', 'statue', 'apartment'];

/** Long tasks by their length in ms, and bytes of the GPU, one entry per sample. */
const longTasks = [];
const samples = [];
const observer = new PerformanceObserver((list) =>
  longTasks.push(...list.getEntries().map(({ duration }) => duration)),
);
observer.observe({ type: 'longtask', buffered: true });

for (let i = 0; i < count; i++) {
  const article = document.createElement('article');
  const file = FILES[i % FILES.length];
  article.innerHTML = `<h2>Scene ${i + 1}</h2>
    <gaussian-splat src="/scenes/${file}?${i}" alt="Scene ${i + 1}" camera-controls camera-orbit="${30 * i}deg 75deg auto"
      poster="/scenes/posters/${POSTERS[i % FILES.length]}.webp"></gaussian-splat>
    <p>A page has words between its scenes, some of which are long enough for two lines.</p>`;
  document.body.append(article);
}
await import('/cdn/gaussian-splat.min.js');

const elements = [...document.querySelectorAll('gaussian-splat')];
if (query.has('renderer')) for (const element of elements) element.setAttribute('renderer', query.get('renderer'));

const isInView = (element) => {
  const { top, bottom } = element.getBoundingClientRect();
  return bottom > 0 && top < innerHeight;
};

/** Peak bytes of each element's splats, frames and canvas. */
const needs = new Map();

/** Bytes of the GPU that the page holds, those of canvases with an image included. */
function sample() {
  let canvasBytes = 0;
  for (const element of elements) {
    const { width = 0, height = 0 } = element.shadowRoot.querySelector('canvas') ?? {};
    canvasBytes += 4 * width * height;
    const { scene = 0, frames = 0 } = element.stats?.bytes ?? {};
    if (scene > 0) needs.set(element, Math.max(needs.get(element) ?? 0, scene + frames + 4 * width * height));
  }
  const held = elements.filter(({ stats }) => stats?.bytes.scene > 0).length;
  samples.push({ own: ledger().own, canvasBytes, held, inView: elements.filter(isInView) });
}

/** Fulfils once every scene in view is loaded and drawn. */
async function settled() {
  for (let tries = 0; tries < 600; tries++) {
    const missing = elements.filter((element) => isInView(element) && !(element.stats?.bytes.scene > 0));
    if (missing.every(({ error }) => error)) return;
    await new Promise((resolve) => setTimeout(resolve, 100));
  }
}

window.grid = {
  settled,
  /** 1 at the end of the page, -1 at its beginning, 0 between them. */
  atEnd: () => {
    const last = document.documentElement.scrollHeight - innerHeight;
    return scrollY >= last - 1 ? 1 : scrollY <= 1 ? -1 : 0;
  },
  start: () => {
    longTasks.length = 0;
    setInterval(sample, 100);
  },
  report: () => ({
    samples: samples.map(({ inView, ...rest }) => ({
      ...rest,
      inView: inView.length,
      needed: inView.reduce((sum, element) => sum + (needs.get(element) ?? 0), 0),
    })),
    longTasks,
    errors: elements.flatMap(({ error }) => error?.message ?? []),
    loaded: elements.filter(({ loaded }) => loaded).length,
  }),
};
