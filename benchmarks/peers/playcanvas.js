/** PlayCanvas as it ships (WebGPU, sorted on the GPU), as a subject of the benchmark (see run/measure.js). */
import * as pc from 'playcanvas';
import { readPixels } from '../run/read-pixels.js';
import { cameraToWorldGl, FAR, holdAnimationFrames, NEAR, verticalFov } from './frames.js';
import { hookWebGPU } from './webgpu-hooks.js';

const runFrame = holdAnimationFrames();
const { state, timer } = hookWebGPU();

/** Frames drawn before an image is taken. */
const SETTLING_FRAMES = 4;
/** How far aside the camera steps before an image is taken, in world units. */
const STEP_ASIDE = 10;

window.openSubject = async ({ ply, parity, antialiased, width, height }) => {
  const app = await startApp(width, height);
  const settings = app.scene.gsplat;
  settings.renderer = pc.GSPLAT_RENDERER_RASTER_GPU_SORT;
  if (parity) {
    // Approximations that change the frame are disabled; the filter of the scene's training is enabled.
    settings.minPixelSize = 0;
    settings.minContribution = 0;
    settings.dataFormat = pc.GSPLATDATA_LARGE;
    settings.colorUpdateAngle = 0;
    settings.antiAlias = antialiased;
  }
  await addScene(app, ply);
  const camera = addCamera(app);
  app.start();

  const subject = {
    draw(view, timed) {
      place(camera, view);
      timer.recording = timed;
      if (timed) timer.startFrame();
      if (runFrame() === 0) throw new Error('PlayCanvas asked for no frame');
      timer.recording = false;
    },
    finish: () => state.device.queue.onSubmittedWorkDone(),
    /** Colors are evaluated again only after a minimum camera movement: the frame gets every chance to do so. */
    async capture(view) {
      subject.draw(movedAside(view), false);
      await subject.finish();
      for (let i = 0; i < SETTLING_FRAMES; i++) {
        subject.draw(view, false);
        await subject.finish();
      }
      return readPixels(state.device, state.texture);
    },
    /** The next frame, even if some of its state is out of date. */
    async snapshot(view) {
      subject.draw(view, false);
      await subject.finish();
      return readPixels(state.device, state.texture);
    },
    facts: async () => ({
      rounded: true,
      errors: state.errors,
      settings: {
        renderer: settings.currentRenderer,
        minPixelSize: settings.minPixelSize,
        minContribution: settings.minContribution,
        dataFormat: settings.dataFormat,
        colorUpdateAngle: settings.colorUpdateAngle,
        antiAlias: settings.antiAlias,
      },
    }),
  };
  if (state.device.features.has('timestamp-query')) subject.readTimes = () => timer.read();
  return subject;
};

async function startApp(width, height) {
  const canvas = document.createElement('canvas');
  canvas.width = width;
  canvas.height = height;
  document.body.append(canvas);
  const device = await pc.createGraphicsDevice(canvas, {
    deviceTypes: ['webgpu'],
    antialias: false,
    powerPreference: 'high-performance',
  });
  device.maxPixelRatio = 1;
  const options = new pc.AppOptions();
  options.graphicsDevice = device;
  options.componentSystems = [pc.CameraComponentSystem, pc.GSplatComponentSystem];
  options.resourceHandlers = [pc.GSplatHandler, pc.TextureHandler];
  const app = new pc.AppBase(canvas);
  app.init(options);
  app.setCanvasFillMode(pc.FILLMODE_NONE, width, height);
  app.setCanvasResolution(pc.RESOLUTION_FIXED, width, height);
  return app;
}

async function addScene(app, ply) {
  const file = { url: 'scene.ply', filename: 'scene.ply', contents: new Response(ply) };
  const asset = new pc.Asset('scene', 'gsplat', file);
  await new Promise((resolve, reject) => {
    asset.ready(resolve);
    asset.once('error', (error) => reject(new Error(`PlayCanvas: ${error}`)));
    app.assets.add(asset);
    app.assets.load(asset);
  });
  const entity = new pc.Entity();
  entity.addComponent('gsplat', { asset });
  app.root.addChild(entity);
}

function addCamera(app) {
  const camera = new pc.Entity();
  camera.addComponent('camera', {
    nearClip: NEAR,
    farClip: FAR,
    clearColor: new pc.Color(0, 0, 0, 1),
    toneMapping: pc.TONEMAP_NONE,
  });
  app.root.addChild(camera);
  return camera;
}

function movedAside(view) {
  const worldToCamera = Array.from(view.worldToCamera);
  worldToCamera[3] += STEP_ASIDE;
  return { ...view, worldToCamera };
}

function place(camera, view) {
  const matrix = new pc.Mat4();
  matrix.data.set(cameraToWorldGl(view));
  camera.setPosition(matrix.getTranslation());
  camera.setRotation(new pc.Quat().setFromMat4(matrix));
  camera.camera.fov = verticalFov(view);
}
