/**
 * The images that others are held against: [height, width, 3] color over black and [height, width] 1 where any splat is
 * seen. From the float64 oracle where the scene is small enough for it, else from our own compute rasterizer in float32,
 * which the tests hold against the oracle; then `proof` says how close it is on the start of the same scene.
 */
import { GaussianBuffers, packGaussians } from '@gaussian-splat/renderer';
import { OwnRenderer } from '../run/own-renderer.js';
import { compareImages } from './metrics.js';

/** Splats that the oracle is asked to draw at most, unless it is asked for by name. */
const ORACLE_SPLATS = 1_500_000;
const PRECISE = { rasterizer: 'tiles', accumulation: 'rgba32float', depthKeyBits: 32 };

/** @param kind auto, oracle or renderer. */
export async function makeReferences({ device, scene, cameras, kind = 'auto', onProgress = () => {} }) {
  const start = performance.now();
  const byOracle = kind === 'oracle' || (kind === 'auto' && scene.count <= ORACLE_SPLATS);
  onProgress(`reference images by ${byOracle ? 'the oracle' : 'the compute rasterizer in float32'}`);
  const made = byOracle
    ? { kind: 'oracle', images: await drawByOracle(scene.cloud(), cameras) }
    : await drawByRenderer(device, scene, cameras);
  return { ...made, milliseconds: Math.round(performance.now() - start) };
}

/** The oracle's images, on one thread for each view, up to the number of CPU cores. */
async function drawByOracle(cloud, cameras) {
  const images = new Array(cameras.length);
  const threads = Math.min(cameras.length, Math.max(1, navigator.hardwareConcurrency ?? 1));
  const share = (thread) =>
    cameras.map((camera, index) => ({ index, camera })).filter(({ index }) => index % threads === thread);
  await Promise.all(
    Array.from({ length: threads }, (_, thread) =>
      runWorker(cloud, share(thread), (index, image) => (images[index] = image)),
    ),
  );
  return images;
}

function runWorker(cloud, cameras, onImage) {
  const worker = new Worker(new URL('quality/oracle-worker.js', location.href), { type: 'module' });
  let left = cameras.length;
  return new Promise((resolve, reject) => {
    worker.onerror = (event) => reject(new Error(`oracle: ${event.message}`));
    worker.onmessage = ({ data: { index, image } }) => {
      onImage(index, image);
      if (--left === 0) resolve();
    };
    worker.postMessage({ cloud, cameras });
  }).finally(() => worker.terminate());
}

async function drawByRenderer(device, scene, cameras) {
  const [{ width, height }] = cameras;
  const subject = new OwnRenderer(device, await scene.upload({}), {
    options: PRECISE,
    resolutionScale: 1,
    width,
    height,
  });
  try {
    const images = [];
    for (const camera of cameras) images.push(toReference(await subject.capture(camera)));
    return { kind: 'renderer', options: PRECISE, images, proof: await prove(device, scene, cameras[0]) };
  } finally {
    subject.close();
  }
}

function toReference(pixels) {
  const count = pixels.length / 4;
  const image = { color: new Float32Array(3 * count), covered: new Uint8Array(count) };
  for (let i = 0; i < count; i++) {
    for (let k = 0; k < 3; k++) image.color[3 * i + k] = pixels[4 * i + k];
    image.covered[i] = pixels[4 * i + 3] > 0 ? 1 : 0;
  }
  return image;
}

/** How close the reference renderer is to the oracle on as many of the scene's first splats as the oracle can take. */
async function prove(device, scene, camera) {
  const cloud = scene.cloud(ORACLE_SPLATS);
  const [oracle] = await drawByOracle(cloud, [camera]);
  const gaussians = await GaussianBuffers.upload(device, packGaussians(cloud));
  const { width, height } = camera;
  const subject = new OwnRenderer(
    device,
    { buffers: [gaussians] },
    { options: PRECISE, resolutionScale: 1, width, height },
  );
  try {
    return { splats: cloud.count, ...compareImages(await subject.capture(camera), oracle, camera) };
  } finally {
    subject.close();
    gaussians.destroy();
  }
}
