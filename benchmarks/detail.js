/**
 * Measures a streamed scene: a flight of consecutive frames, and the PSNR of its frames against frames with more
 * splats.
 */
import { checkManifest, MemoryLedger, PassTimer, StreamedGaussians, Viewpoint, World } from '@gaussian-splat/renderer';
import { compare } from './detail/at-rest.js';
import { flightCamera } from './detail/flight-path.js';
import { Second } from './detail/second.js';
import { Progress, within } from './run/bounded.js';
import { describeEnvironment, openDevice } from './run/environment.js';
import { startFetching } from './run/worker-fetch.js';

const query = new URLSearchParams(location.search);
const number = (name, fallback) => Number(query.get(name) ?? fallback);
const [width, height] = [number('width', 960), number('height', 540)];
const [splats, megabytes, seconds] = [number('splats', 1e6), number('megabytes', 256), number('seconds', 20)];
/** Pixels that what is drawn may be displaced, if the budget allows. */
const detail = number('detail', 1);

/** Seconds at the first place of the flight before it begins, reported apart: what a visitor waits through. */
const warm = number('warm', 3);
/** `display`: a frame for each that the display shows, as on any page; `free`: the next as soon as the GPU is done. */
const quality = query.get('pace') ?? 'display';

/** How much of the curve is flown in these seconds: with 0.5 the first half, half as fast. */
const speed = number('speed', 1);
/** Positions on the flight that are measured at rest, as fractions of the curve. */
const views = (query.get('views') ?? '0.1,0.3,0.5,0.9').split(',').filter(Boolean).map(Number);

/** Seconds that a view may take to have all its pages, and after which everything is reported as far as it has come. */
const [settleSeconds, limit] = [number('settle', 5), number('limit', warm + seconds + 60)];
/** Seconds that one file may take. */
const FETCH_SECONDS = 20;

const say = (text) => {
  document.getElementById('status').textContent = text;
};

const progress = new Progress(limit, say);
/** Grows during the measurement; its content is reported even if the measurement fails. */
const report = {
  ...{ width, height, detail, splatBudget: splats, megabytes, warm, seconds, speed, limit, pace: quality },
  ...{ warmUp: [], flight: [], atRest: [] },
};

async function open(device) {
  const url = new URL(query.get('scene'), location.href);
  const fetchFile = startFetching(FETCH_SECONDS);
  const fetched = await progress.wait('the manifest', fetchFile(url, new AbortController().signal));
  const manifest = checkManifest(JSON.parse(new TextDecoder().decode(fetched.bytes)), url.href);
  const traffic = { requests: 0, bytes: 0, errors: [] };
  report.fetched = traffic;
  const fetchPage = async (file, signal, coded) => {
    const { bytes, length } = await fetchFile(new URL(file, url), signal, coded);
    traffic.requests++;
    traffic.bytes += length;
    return bytes;
  };
  const onError = (error) => {
    traffic.errors.push(String(error));
    traffic.errors.splice(5);
  };
  const options = { fetchPage, isDecoded: true, memoryBudget: 1e6 * megabytes, onError };
  const scene = await progress.wait(
    'the pool and the coarsest page',
    StreamedGaussians.open(device, manifest, options),
  );
  return { manifest, scene, traffic };
}

/**
 * Lets the page's other tasks have a turn, as they do between the frames of a display: a loop that only ever waits for the GPU was seen to bring in two pages in two
 * seconds, with eight on their way all the time.
 */
const turn = () =>
  new Promise((resolve) => (quality === 'free' ? setTimeout(resolve) : requestAnimationFrame(resolve)));

/**
 * Draws for a number of seconds.
 * @param rows gets a row for each second
 * @param cameraOf gets the fraction, 0 to 1, of the elapsed time
 */
async function fly(all, rows, what, duration, cameraOf) {
  const timer = all.device.features.has('timestamp-query') ? new PassTimer(all.device) : undefined;
  const start = performance.now();
  const pending = [];
  for (let second = 0; second < duration; second++) {
    const current = new Second(all, timer);
    const end = start + 1000 * Math.min(second + 1, duration);
    progress.begin(`second ${second} of the ${what}`);
    // One frame at least, however slow.
    while (performance.now() < end || current.frames === 0) {
      await turn();
      await current.draw(cameraOf(Math.min(1, (performance.now() - start) / 1000 / duration)));
    }
    pending.push(current.row(second).then((row) => rows.push(row)));
    if (progress.left === 0) throw new Error('the time was up');
  }
  await within(FETCH_SECONDS, `what the GPU knows of the ${what}`, Promise.all(pending));
}

async function measure() {
  const environment = await progress.wait('the GPU device', openDevice());
  const { device } = environment;
  report.environment = describeEnvironment(environment);
  report.gpuErrors = environment.errors;
  const { manifest, scene, traffic } = await open(device);
  Object.assign(report, { splats: manifest.splats, pages: scene.progress.total });
  const world = new World();
  world.add({ scene });
  const settings = { detail, splatBudget: splats, detailFade: number('fade', 0.5) };
  const viewpoint = new Viewpoint(device, world, { settings: settings });
  report.levers = viewpoint.resolvedSettings;
  const usage = GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.COPY_SRC | GPUTextureUsage.STORAGE_BINDING;
  const target = device.createTexture({ size: [width, height], format: 'rgba8unorm', usage });
  const all = {
    device,
    viewpoint,
    scene,
    manifest,
    traffic,
    target,
    settings,
    width,
    height,
    turn,
    progress,
    settleSeconds,
  };
  const cameraOf = (share) => flightCamera(speed * share, { bounds: manifest.bounds, width, height });
  await fly(all, report.warmUp, 'warm-up', warm, () => cameraOf(0));
  await fly(all, report.flight, 'flight', seconds, cameraOf);
  report.bytes = { scene: scene.byteLength, renderer: viewpoint.byteLength, ledger: MemoryLedger.of(device).bytes };
  await compare(all, views, report.atRest);
}

/** The report: in the page, for scripts, and for the URL of the request. */
async function publish() {
  const text = JSON.stringify(report, null, 1);
  document.getElementById('json').textContent = text;
  document.getElementById('raw').hidden = false;
  globalThis.report = report;
  if (query.has('report')) await fetch(query.get('report'), { method: 'POST', body: text });
}

if (query.has('scene')) {
  const watch = within(limit + 5, 'the page', measure());
  await watch.catch((error) => {
    report.unfinished = `${error.message}; at work on ${progress}`;
    report.stack = error.stack;
  });
  say(report.unfinished ?? 'done');
  await publish();
}
