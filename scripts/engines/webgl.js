/** The page side of `npm run lab -- webgl`: frames of the renderer alone, and how old the order of a moving element is. */
import { readScene } from '@gaussian-splat/formats';
import { packGaussians } from '@gaussian-splat/renderer';
import {
  blendable,
  DATA_WIDTH,
  drawn,
  GlGaussians,
  GlRenderer,
  orderView,
  SplatOrder,
} from '@gaussian-splat/renderer/webgl';

const GEOMETRY_WORDS = 8;
const clouds = new Map();

async function cloudOf(url) {
  if (!clouds.has(url)) {
    const bytes = new Uint8Array(await (await fetch(url)).arrayBuffer());
    clouds.set(url, await readScene(bytes, { name: url.split('/').pop() }));
  }
  return clouds.get(url);
}

/** A view in 8 bits, rows from above, as base64; which format it was blended in, and milliseconds of a frame and of a sort. */
async function drawView(url, camera, mode, accumulation) {
  const packed = packGaussians({ ...(await cloudOf(url)), antialiased: mode === 'antialiased' });
  const { width, height } = camera;
  const canvas = Object.assign(document.createElement('canvas'), { width, height });
  const gl = canvas.getContext('webgl2', { antialias: false, depth: false });
  if (!gl) throw new Error('no WebGL 2 in this browser');
  const gaussians = await GlGaussians.upload(gl, packed);
  const renderer = new GlRenderer(gl, gaussians);
  const numbers = new Float32Array(packed.geometry.buffer);
  const positions = new Float32Array(3 * packed.count);
  for (let i = 0; i < packed.count; i++)
    positions.set(numbers.subarray(GEOMETRY_WORDS * i, GEOMETRY_WORDS * i + 3), 3 * i);
  const order = new Uint32Array(Math.ceil(packed.count / DATA_WIDTH) * DATA_WIDTH);
  const whole = { ...camera, far: camera.far ?? Infinity };
  const splats = new SplatOrder(positions);
  const begin = performance.now();
  const count = splats.sort(orderView(whole, packed.origin), order);
  const sortMs = performance.now() - begin;
  renderer.setOrder(order, count);
  const request = { camera: whole, accumulation, shDegree: 3, resolutionScale: 1 };
  renderer.render(request);
  renderer.present();
  await drawn(gl);
  const start = performance.now();
  renderer.render(request);
  renderer.present();
  // Reading waits for the frame.
  const bytes = new Uint8Array(4 * width * height);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
  const frameMs = performance.now() - start;
  const upright = new Uint8Array(bytes.length);
  for (let row = 0; row < height; row++)
    upright.set(bytes.subarray(4 * width * row, 4 * width * (row + 1)), 4 * width * (height - 1 - row));
  renderer.destroy();
  gaussians.destroy();
  const format = blendable(gl, accumulation);
  gl.getExtension('WEBGL_lose_context')?.loseContext();
  let text = '';
  for (let at = 0; at < upright.length; at += 8192) text += String.fromCharCode(...upright.subarray(at, at + 8192));
  return JSON.stringify({ pixels: btoa(text), format, frameMs, sortMs });
}

/**
 * Age in ms of the sort order in each frame of a motion: time since its request, 0 if the main thread has just made it.
 */
async function orderAges(attributes, milliseconds) {
  const ages = [];
  let asked;
  let answered;
  let shown = 0;
  const port = MessagePort.prototype;
  const gl = WebGL2RenderingContext.prototype;
  const { postMessage } = port;
  const { texSubImage2D, drawElementsInstanced } = gl;
  const onmessage = Object.getOwnPropertyDescriptor(port, 'onmessage');
  port.postMessage = function watching(message, transfer) {
    if (message?.view) asked = performance.now();
    return postMessage.call(this, message, transfer);
  };
  Object.defineProperty(port, 'onmessage', {
    ...onmessage,
    set(handler) {
      onmessage.set.call(this, (event) => {
        answered = asked;
        handler(event);
        answered = undefined;
      });
    },
  });
  gl.texSubImage2D = function watching(...args) {
    if (args[6] === this.RED_INTEGER) shown = answered ?? performance.now();
    return texSubImage2D.apply(this, args);
  };
  gl.drawElementsInstanced = function watching(...args) {
    ages.push(performance.now() - shown);
    return drawElementsInstanced.apply(this, args);
  };
  try {
    const element = await show({ ...attributes, 'interaction-prompt': 'none', 'interpolation-decay': '0' });
    await delay(1000);
    const start = performance.now();
    let frames = 0;
    for (let theta = 0; performance.now() < start + milliseconds; theta += 2, frames++) {
      // The first frames find their quality level.
      if (performance.now() < start + milliseconds / 2) ages.length = 0;
      element.setAttribute('camera-orbit', `${theta}deg 75deg auto`);
      await new Promise(requestAnimationFrame);
    }
    const { splats } = element.stats;
    const perSecond = (1000 * frames) / (performance.now() - start);
    const sorted = ages.sort((a, b) => a - b);
    const [median, max] = [sorted[Math.floor(sorted.length / 2)], sorted.at(-1)];
    return JSON.stringify({
      splats,
      median,
      most: max,
      frames: sorted.length,
      perSecond,
      moving: element.stats.dynamicQuality.moving,
    });
  } finally {
    Object.assign(port, { postMessage });
    Object.assign(gl, { texSubImage2D, drawElementsInstanced });
    Object.defineProperty(port, 'onmessage', onmessage);
  }
}

Object.assign(window, { drawView, orderAges, isReady: true });
