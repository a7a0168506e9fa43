/**
 * The benchmark page: one scene, tiled to N splats, along a camera path, with per-pass GPU timestamps, the span from the
 * first pass's begin to the last one's end, wall time with the queue drained, and CPU time. `report=URL` POSTs the result,
 * `image=URL` the first view in float32, to hold it against other renderers.
 */
import { lookAt } from '@gaussian-splat/core';
import { fetchScene, readScene } from '@gaussian-splat/formats';
import {
  capture,
  deviceDescriptor,
  GaussianBuffers,
  packGaussians,
  PassTimer,
  Renderer,
} from '@gaussian-splat/renderer';
import { tilePacked } from './tile.js';

const query = new URLSearchParams(location.search);
const number = (name, fallback) => Number(query.get(name) ?? fallback);
const options = {
  scene: query.get('scene') ?? '../scenes/skull.spz',
  splats: number('n', 0),
  width: number('w', 1920),
  height: number('h', 1080),
  raster: query.get('raster') ?? 'auto',
  path: query.get('path') ?? 'orbit',
  frames: number('frames', 200),
  warmUp: number('warmup', 30),
};

const out = document.getElementById('out');
const show = (text) => (out.textContent = text);

/** Seconds between frames along a path: a fixed step, so that every machine draws the same frames. */
const TIME_STEP = 1 / 60;

/** World-to-camera matrix of a path at a time, around a scene of the given radius on the ground plane. */
const PATHS = {
  orbit: (t, r) => lookAt([r * Math.sin(0.5 * t), -0.45 * r, -r * Math.cos(0.5 * t)], [0, 0, 0], [0, -1, 0]),
  dolly: (t, r) => lookAt([0, -0.3 * r, -r + 0.4 * t], [0, 0, 0.4 * t], [0, -1, 0]),
  yaw: (t, r) => {
    const angle = (Math.PI / 3) * t;
    return lookAt([0, -0.3 * r, 0], [Math.sin(angle), -0.3 * r + 0.2, Math.cos(angle)], [0, -1, 0]);
  },
};

function cameraAt(frame, radius) {
  const { width, height, path } = options;
  const focal = (1200 * height) / 1080;
  const worldToCamera = PATHS[path](frame * TIME_STEP, radius);
  return { width, height, fx: focal, fy: focal, cx: width / 2, cy: height / 2, worldToCamera, near: 0.2, far: 1e10 };
}

/** Median and 95th percentile. */
function summary(values) {
  const sorted = [...values].sort((a, b) => a - b);
  const at = (share) => Number(sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))].toFixed(4));
  return { p50: at(0.5), p95: at(0.95) };
}

function summarizePasses(frames) {
  const labels = [...new Set(frames.flat().map(({ label }) => label))];
  const duration = (passes, label) =>
    passes.filter((pass) => pass.label === label).reduce((sum, { begin, end }) => sum + end - begin, 0);
  const stages = Object.fromEntries(labels.map((label) => [label, summary(frames.map((f) => duration(f, label)))]));
  const spans = frames.map((f) => Math.max(...f.map(({ end }) => end)) - Math.min(...f.map(({ begin }) => begin)));
  return { stages, span: summary(spans) };
}

async function measure() {
  const adapter = await navigator.gpu.requestAdapter({ powerPreference: 'high-performance' });
  const descriptor = deviceDescriptor(adapter);
  const canTime = adapter.features.has('timestamp-query');
  if (canTime) descriptor.requiredFeatures = [...descriptor.requiredFeatures, 'timestamp-query'];
  const device = await adapter.requestDevice(descriptor);
  const errors = [];
  device.addEventListener('uncapturederror', ({ error }) => errors.push(error.message.slice(0, 300)));

  show('Loading the scene…');
  const bytes = await fetchScene(new URL(options.scene, location.href));
  const tiled = tilePacked(packGaussians(await readScene(bytes, { name: options.scene })), options.splats);
  const gaussians = await GaussianBuffers.upload(device, tiled.packed);
  const radius = tiled.radius;
  const renderer = new Renderer(device, { rasterizer: options.raster });
  const { width, height } = options;
  const texture = device.createTexture({ size: [width, height], format: 'rgba8unorm', usage: 0x10 | 0x1 });
  const target = texture.createView();
  const draw = (frame, timer) =>
    renderer.render({ gaussians, camera: cameraAt(frame, radius), target, targetFormat: 'rgba8unorm', timer });

  show('Warming up…');
  for (let i = 0; i < options.warmUp; i++) draw(i);
  await device.queue.onSubmittedWorkDone();

  show('Measuring…');
  const timer = canTime ? new PassTimer(device) : undefined;
  const cpu = [];
  const start = performance.now();
  for (let i = 0; i < options.frames; i++) {
    const before = performance.now();
    draw(i, timer);
    cpu.push(performance.now() - before);
  }
  await device.queue.onSubmittedWorkDone();
  const wall = (performance.now() - start) / options.frames;
  const gpu = timer ? summarizePasses(await timer.read()) : {};
  const statistics = await renderer.readStatistics();
  const image = query.get('image');
  if (image) {
    const pixels = await capture(device, renderer, { gaussians, camera: cameraAt(0, radius) });
    await fetch(image, { method: 'POST', body: pixels });
  }
  const total = gaussians.byteLength + renderer.byteLength;
  const { vendor, architecture, description } = adapter.info;
  return {
    ...options,
    splats: gaussians.count,
    shDegree: gaussians.shDegree,
    raster: renderer.rasterizer,
    adapter: [vendor, architecture, description].filter(Boolean).join(' '),
    browser: navigator.userAgent,
    ...gpu,
    wall: Number(wall.toFixed(4)),
    cpu: summary(cpu),
    statistics,
    bytes: total,
    bytesPerSplat: Number((total / gaussians.count).toFixed(1)),
    errors,
  };
}

let result;
try {
  result = await measure();
} catch (error) {
  result = { ...options, error: String(error.stack ?? error) };
}
show(JSON.stringify(result, null, 2));
const report = query.get('report');
if (report) await fetch(report, { method: 'POST', body: JSON.stringify(result) });
