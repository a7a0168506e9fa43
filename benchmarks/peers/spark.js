/** Spark as it ships (WebGL 2, sorted in a worker), as a subject of the benchmark (see run/measure.js). */
import { SparkRenderer, SplatMesh } from '@sparkjsdev/spark';
import * as THREE from 'three';
import { nextTask } from '../run/measure.js';
import { cameraToWorldGl, FAR, holdAnimationFrames, NEAR, verticalFov } from './frames.js';

holdAnimationFrames();

/** Time limit for the worker, and the movement and rotation (cosine) of the camera above which Spark sorts again. */
const TIMEOUT_MS = 60_000;
const SAME_PLACE = 2e-3;
const SAME_DIRECTION = 0.999;

/** Spark without approximations that change the frame, and with the filter of the scene's training. */
const parityOptions = (antialiased) => ({
  preBlurAmount: antialiased ? 0 : 0.3,
  blurAmount: antialiased ? 0.3 : 0,
  sortRadial: false,
  accumExtSplats: true,
  enableLod: false,
  clipXY: 1.4,
});

window.openSubject = async ({ ply, parity, antialiased, width, height }) => {
  const renderer = new THREE.WebGLRenderer({ antialias: false, powerPreference: 'high-performance' });
  renderer.setPixelRatio(1);
  renderer.setSize(width, height);
  document.body.append(renderer.domElement);
  const scene = new THREE.Scene();
  const camera = new THREE.PerspectiveCamera(50, width / height, NEAR, FAR);
  const spark = new SparkRenderer({ renderer, ...(parity ? parityOptions(antialiased) : {}) });
  scene.add(spark);
  const fileBytes = new Uint8Array(await ply.arrayBuffer());
  const mesh = new SplatMesh({ fileBytes, fileName: 'scene.ply', ...(parity ? { extSplats: true } : {}) });
  await mesh.initialized;
  scene.add(mesh);

  const gl = renderer.getContext();
  const draw = (view) => {
    place(camera, view);
    renderer.render(scene, camera);
  };
  const finish = async () => waitForGl(gl);
  const settle = (view) => settleOrder(spark, camera, () => draw(view));
  return {
    draw,
    finish,
    settle,
    async capture(view) {
      draw(view);
      await settle(view);
      draw(view);
      return readGl(gl);
    },
    /** The next frame, in the latest order. */
    async snapshot(view) {
      draw(view);
      return readGl(gl);
    },
    facts: async () => {
      const { blurAmount, preBlurAmount, sortRadial, enableLod, maxStdDev, minAlpha, activeSplats } = spark;
      const { clipXY, accumExtSplats } = spark;
      const info = gl.getExtension('WEBGL_debug_renderer_info');
      return {
        rounded: true,
        settings: { blurAmount, preBlurAmount, sortRadial, enableLod, maxStdDev, minAlpha, clipXY, accumExtSplats },
        activeSplats,
        adapter: gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER),
      };
    },
  };
};

function place(camera, view) {
  new THREE.Matrix4().fromArray(cameraToWorldGl(view)).decompose(camera.position, camera.quaternion, camera.scale);
  camera.fov = verticalFov(view);
  camera.updateProjectionMatrix();
  camera.updateMatrixWorld(true);
}

/** Draws and waits until the order in use is that of the camera. */
async function settleOrder(spark, camera, draw) {
  const start = performance.now();
  const direction = new THREE.Vector3();
  while (performance.now() - start < TIMEOUT_MS) {
    if (!spark.sorting && !spark.sortDirty) {
      camera.getWorldDirection(direction);
      const inPlace = spark.sortedCenter.distanceTo(camera.position) <= SAME_PLACE;
      const turned = !spark.sortRadial && spark.sortedDir.dot(direction) < SAME_DIRECTION;
      if (inPlace && !turned && spark.activeSplats > 0) return;
      draw();
    }
    await nextTask();
  }
  throw new Error(`Spark: no order for the camera within ${TIMEOUT_MS / 1000} s`);
}

/** A pixel can only be read when all is drawn: WebGL has no other way to wait that is as exact. */
function waitForGl(gl) {
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
}

/** [height, width, 4] in 0..1, row by row from the top. */
function readGl(gl) {
  const { drawingBufferWidth: width, drawingBufferHeight: height } = gl;
  const bytes = new Uint8Array(4 * width * height);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
  const pixels = new Float32Array(bytes.length);
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < 4 * width; x++) pixels[4 * width * y + x] = bytes[4 * width * (height - 1 - y) + x] / 255;
  }
  return pixels;
}
