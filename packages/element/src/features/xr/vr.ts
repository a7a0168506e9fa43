import type { Vector3 } from '@gaussian-splat/core';
import { eyeOfPose, type ViewerFrame } from '../../viewer/camera/orbit.js';
import { readAttribute } from '../../viewer/camera/grammar.js';
import { lengthGrammar } from '../../viewer/camera/lengths.js';
import { unitOf } from '../../viewer/unit.js';
import { prefersReducedMotion } from '../../viewer/motion.js';
import type { Viewer } from '../../viewer/viewer.js';
import { mapUrlOf, openFloor, rewritten } from '../../floor/floor-source.js';
import { GlDrawing } from './gl-drawing.js';
import { GpuDrawing, gpuOf } from './gpu-drawing.js';
import { BindingTarget, CopyTarget } from './gpu-targets.js';
import { Leaving } from './leaving.js';
import { placeOf, ring } from './marker-splats.js';
import { VrRig } from './vr-rig.js';
import { gpuBindingClass, type XrInput, type XrInputEvent, type XrSession } from './webxr.js';
import type { XrDrawing } from './xr-drawing.js';
import type { XrKind, XrStarted } from './xr-offer.js';
import { unsupported, type XrShown } from './xr-scene.js';
import type { XrGuide } from './xr-session.js';

/** Color behind the splats, premultiplied red, green, blue and alpha, 0..1. */
const BACKGROUND = [0.1, 0.1, 0.11, 1] as const;
/** Features of each session, if the headset has them. */
const FEATURES = ['local-floor', 'hand-tracking'];
/** Minimum area of a floor, m². */
const MIN_AREA = 4;

/** Returns the transform from scene coordinates to viewer space in meters, 4x4, row-major. */
export const metersOf = ([x, y, z]: ViewerFrame, unit: number): Float64Array =>
  Float64Array.from([
    ...x.map((v) => v * unit),
    0,
    ...y.map((v) => v * unit),
    0,
    ...z.map((v) => v * unit),
    0,
    0,
    0,
    0,
    1,
  ]);

/** Definition of VR sessions: in a headset that does not show the real environment. */
export function vrKind(core: Viewer): XrKind {
  // Whether the WebGPU binding can be used: false after the browser has refused a session with it or could not open it.
  let isUsable = true;
  const mayUseBinding = (): boolean => isUsable && gpuBindingClass() !== undefined && gpuOf(core) !== undefined;
  return {
    ...{ mode: 'immersive-vr', name: 'vr', word: 'vr' },
    isWanted: () => core.attributes.vr,
    canShow: () => core.stillRequest !== null || isDrawnByGpu(core),
    options: () => ({ optionalFeatures: [...FEATURES, ...(mayUseBinding() ? ['webgpu'] : [])] }),
    simplerOptions: () => (mayUseBinding() ? { optionalFeatures: FEATURES } : undefined),
    simplerGranted: () => (isUsable = false),
    open: (session, source) =>
      drawingOf(core, session, source).catch((error: unknown) => {
        // A session with WebGPU has no WebGL layer, so this one ends. The next click requests a session with WebGL.
        isUsable = false;
        throw error;
      }),
    spaces: ['local-floor', 'local'],
    guide: (started) => guideOf(core, started),
  };
}

/** Whether WebGPU draws the complete scenes of the page, which may move. */
const isDrawnByGpu = (core: Viewer): boolean => {
  const { shown, isPreview, ownEntry } = core.sources;
  return gpuOf(core) !== undefined && shown.length > 0 && !isPreview && !ownEntry.scene.isOutgoing;
};

/**
 * Opens the drawing of a session: WebGPU if the session has its binding, or WebGL for one scene file. Otherwise a
 * WebGPU canvas is copied, because WebGL draws neither moving nor several scenes.
 */
async function drawingOf(core: Viewer, session: XrSession, source: XrShown): Promise<XrDrawing> {
  const backend = gpuOf(core);
  if (session.enabledFeatures?.includes('webgpu')) {
    if (!backend) throw unsupported('WebGPU in the page, which the session has asked for', 'none');
    return new GpuDrawing(core, backend, new BindingTarget(session, backend.device));
  }
  const isForWebGl = source.request !== null && core.sources.world.placements.length === 1;
  if (!backend || isForWebGl) return GlDrawing.open(session, core, source);
  return new GpuDrawing(core, backend, await CopyTarget.open(session, backend.device));
}

function guideOf(core: Viewer, { session, space, spaceType, signal, drawing }: XrStarted): XrGuide {
  const unit = unitOf(core) ?? 1;
  const { goal } = core.camera;
  const rig = new VrRig({
    eye: eyeOfPose(goal).map((value) => value * unit) as unknown as Vector3,
    heading: goal.theta,
    toViewer: metersOf(core.frame, unit),
    isFloor: spaceType === 'local-floor',
    stepsOnly: prefersReducedMotion(),
  });
  const leaving = new Leaving(session, signal);
  findFloor(core, unit, signal).then(
    (map) => map && !signal.aborted && (rig.map = map),
    () => undefined,
  );
  // Hands without a gamepad report only these events.
  const listen = (type: 'selectstart' | 'selectend', react: (input: XrInput) => void): void =>
    session.addEventListener(type, (event) => react((event as XrInputEvent).inputSource), { signal });
  listen('selectstart', (input) => rig.aim(input));
  listen('selectend', (input) => rig.choose(input, leaving.isGesture));
  const marker = drawing.marker(ring(), signal);
  return {
    background: BACKGROUND,
    place: (frame, pose, seconds) => {
      leaving.advance(seconds);
      const place = rig.place(frame, pose, space, seconds);
      core.features.call('headMoved', rig.head!);
      return place;
    },
    drawAbove: (eye) => {
      const place = leaving.isGesture ? undefined : rig.targetInSpace;
      if (place) marker.draw(eye, placeOf(place));
    },
  };
}

async function findFloor(core: Viewer, unit: number, signal: AbortSignal): ReturnType<typeof openFloor> {
  const { attributes, camera, frame, services, stillRequest: request } = core;
  if (request === null) throw new Error('no floor');
  const eye = eyeOfPose(camera.goal).map((value) => value * unit) as unknown as Vector3;
  const eyeHeight = readAttribute('eye-height', attributes.eyeHeight, lengthGrammar('1.6m'), () => undefined);
  const source = {
    loader: services.sceneLoader,
    request,
    mapUrl: rewritten(core, mapUrlOf(core)),
    frame,
    metersPerUnit: unit,
    eyeHeight,
  };
  const map = await openFloor({ ...source, near: eye }, signal);
  if (map.area < MIN_AREA) throw new Error('no floor');
  return map;
}
