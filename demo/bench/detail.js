/** Measures a streamed scene: a flight over it, frame after frame, and how far its picture is from one with more splats. */
import { lookAt } from '@gaussian-splat/core';
import { checkManifest, MemoryLedger, PassTimer, Renderer, StreamedGaussians } from '@gaussian-splat/renderer';
import { describeEnvironment, openDevice } from './run/environment.js';
import { readPixels } from './run/read-pixels.js';

const query = new URLSearchParams(location.search);
const number = (name, fallback) => Number(query.get(name) ?? fallback);
const [width, height] = [number('width', 960), number('height', 540)];
const [splats, megabytes, seconds] = [number('splats', 1e6), number('megabytes', 256), number('seconds', 20)];
/** Pixels that what is drawn may be displaced, if the budget allows. */
const detail = number('detail', 1);

const say = (text) => {
  document.getElementById('status').textContent = text;
};

async function open(device) {
  const url = new URL(query.get('scene'), location.href);
  const manifest = checkManifest(await (await fetch(url)).json(), url.href);
  const traffic = { requests: 0, bytes: 0, errors: [] };
  const fetchPage = async (file, signal) => {
    const bytes = await (await fetch(new URL(file, url), { signal })).arrayBuffer();
    traffic.requests++;
    traffic.bytes += bytes.byteLength;
    return bytes;
  };
  const onError = (error) => traffic.errors.push(String(error));
  const scene = await StreamedGaussians.open(device, manifest, { fetchPage, memoryBudget: 1e6 * megabytes, onError });
  return { manifest, scene, traffic };
}

/** Low over the scene, along a curve that turns, now and then up to where all of it is in sight. */
function cameraAt(share, { center, min, max }) {
  const [x, z] = [(max[0] - min[0]) / 2, (max[2] - min[2]) / 2];
  const place = (s) => [
    center[0] + 0.8 * x * Math.sin(2 * Math.PI * s),
    center[1] - 0.05 * x - 0.5 * x * Math.sin(Math.PI * s) ** 8,
    center[2] + 0.8 * z * Math.sin(4 * Math.PI * s),
  ];
  const focal = height;
  return {
    ...{ width, height, fx: focal, fy: focal, cx: width / 2, cy: height / 2, near: 0.05, far: Infinity },
    worldToCamera: lookAt(
      place(share),
      place(share + 0.02).map((v, axis) => (axis === 1 ? v + 0.02 * x : v)),
      [0, -1, 0],
    ),
  };
}

const percentile = (values, share) => [...values].sort((a, b) => a - b)[Math.floor(share * (values.length - 1))];
const rounded = (value) => Math.round(1000 * value) / 1000;

/** Span of the passes of each frame on the GPU, ms. */
const spans = (frames) =>
  frames.filter((passes) => passes.length > 0).map((passes) => Math.max(...passes.map((p) => p.end)) - passes[0].begin);

async function fly({ device, renderer, scene, manifest, traffic, target }) {
  const timer = device.features.has('timestamp-query') ? new PassTimer(device) : undefined;
  const rows = [];
  const start = performance.now();
  for (let second = 0; second < seconds; second++) {
    const [frames, gpu] = [[], []];
    const end = start + 1000 * (second + 1);
    while (performance.now() < end) {
      const before = performance.now();
      const camera = cameraAt((before - start) / 1000 / seconds, manifest.bounds);
      renderer.render({ gaussians: scene, camera, target, detail, splatBudget: splats, timer });
      await device.queue.onSubmittedWorkDone();
      frames.push(performance.now() - before);
      if (timer && frames.length % 8 === 0) gpu.push(...spans(await timer.read()));
    }
    const { visible, overflow, pairOverflow, budgetError } = await renderer.readStatistics();
    if (timer) gpu.push(...spans(await timer.read()));
    rows.push({
      second,
      frames: frames.length,
      wall: {
        median: rounded(percentile(frames, 0.5)),
        p95: rounded(percentile(frames, 0.95)),
        worst: rounded(Math.max(...frames)),
      },
      gpu:
        gpu.length > 0
          ? {
              median: rounded(percentile(gpu, 0.5)),
              p95: rounded(percentile(gpu, 0.95)),
              worst: rounded(Math.max(...gpu)),
            }
          : undefined,
      ...{ visible, overflow, pairOverflow, budgetError: rounded(budgetError), ...scene.progress },
      fetched: { ...traffic, errors: traffic.errors.length },
    });
    say(`second ${second}: ${frames.length} frames, ${visible} splats, ${scene.progress.resident} pages`);
  }
  return rows;
}

/** Draws one view until nothing more comes. */
async function settle({ device, renderer, scene, target }, request) {
  for (let [calm, frames] = [0, 0]; calm < 20 && frames < 3000; frames++) {
    const { resident } = scene.progress;
    renderer.render({ ...request, gaussians: scene, target });
    await device.queue.onSubmittedWorkDone();
    if (frames % 8 === 0) await new Promise((resolve) => setTimeout(resolve));
    calm = scene.progress.resident === resident && scene.progress.coming === 0 ? calm + 1 : 0;
  }
}

/** PSNR over the pixels that either picture covers. */
function psnr(a, b) {
  let [sum, count] = [0, 0];
  for (let i = 0; i < a.length; i += 4) {
    if (a[i + 3] === 0 && b[i + 3] === 0) continue;
    for (let k = 0; k < 4; k++) sum += (a[i + k] - b[i + k]) ** 2;
    count += 4;
  }
  return -10 * Math.log10(sum / count);
}

/** Views at rest: the picture within the budget against one of a quarter of the error and no budget. */
async function compare(all) {
  const views = [];
  for (const share of [0.1, 0.3, 0.5]) {
    const camera = cameraAt(share, all.manifest.bounds);
    await settle(all, { camera, detail, splatBudget: splats });
    const within = await readPixels(all.device, all.target);
    const { visible, budgetError } = await all.renderer.readStatistics();
    await settle(all, { camera, detail: detail / 4, splatBudget: 4 * splats });
    const finer = await readPixels(all.device, all.target);
    const more = await all.renderer.readStatistics();
    views.push({
      ...{ share, visible, budgetError: rounded(budgetError), resident: all.scene.progress.resident },
      against: {
        visible: more.visible,
        budgetError: rounded(more.budgetError),
        overflow: more.overflow,
        decibels: rounded(psnr(within, finer)),
      },
    });
  }
  return views;
}

async function main() {
  const environment = await openDevice();
  const { device } = environment;
  const { manifest, scene, traffic } = await open(device);
  const renderer = new Renderer(device);
  const usage = GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.COPY_SRC | GPUTextureUsage.STORAGE_BINDING;
  const target = device.createTexture({ size: [width, height], format: 'rgba8unorm', usage });
  const all = { device, renderer, scene, manifest, traffic, target };
  const flight = await fly(all);
  const bytes = { scene: scene.byteLength, renderer: renderer.byteLength, ledger: MemoryLedger.of(device).bytes };
  const atRest = await compare(all);
  return {
    ...{ splats: manifest.splats, pages: scene.progress.total, width, height, detail, splatBudget: splats, megabytes },
    ...{
      levers: renderer.levers,
      environment: describeEnvironment(environment),
      bytes,
      flight,
      atRest,
      errors: traffic.errors.slice(0, 5),
    },
  };
}

if (query.has('scene')) {
  const report = await main().catch((error) => ({ error: `${error}\n${error.stack}` }));
  document.getElementById('json').textContent = JSON.stringify(report, null, 1);
  globalThis.report = report;
  if (query.has('report')) {
    await fetch(query.get('report'), { method: 'POST', body: JSON.stringify(report, null, 1) });
  }
}
