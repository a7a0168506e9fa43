import type { Vector3 } from '@gaussian-splat/core';
import { eyeOfPose, type ViewerFrame } from '../camera/orbit.js';
import { readAttribute } from '../camera/grammar.js';
import { lengthGrammar, optionalLengthGrammar } from '../camera/lengths.js';
import { prefersReducedMotion } from '../controllers/motion.js';
import type { XrHost } from './xr-host.js';
import { openFloor } from '../walk/floor-source.js';
import { MarkerSplats, placeOf, ring } from './marker-splats.js';
import { VrRig } from './vr-rig.js';
import type { XrKind, XrStarted } from './xr-offer.js';
import type { XrGuide } from './xr-session.js';

/** Behind the splats, premultiplied. */
const BACKGROUND = [0.1, 0.1, 0.11, 1] as const;
/** Minimum area of a floor, m². */
const MIN_AREA = 4;

/** The unit of the file, meters. */
export const unitOf = (core: XrHost): number | undefined =>
  readAttribute('unit', core.attributes.unit, optionalLengthGrammar, (sentence) => core.warn(sentence));

/** Rows of the matrix from the scene's frame to viewer space in meters. */
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

/** Sessions in a headset that does not show the room. */
export const vrKind = (core: XrHost): XrKind => ({
  ...{ mode: 'immersive-vr', name: 'vr', word: 'vr' },
  isWanted: () => core.attributes.vr,
  options: () => ({ optionalFeatures: ['local-floor', 'hand-tracking'] }),
  spaces: ['local-floor', 'local'],
  guide: (started) => guideOf(core, started),
});

function guideOf(core: XrHost, { session, space, spaceType, signal, gl }: XrStarted): XrGuide {
  const unit = unitOf(core) ?? 1;
  const { goal } = core.camera;
  const rig = new VrRig(
    {
      eye: eyeOfPose(goal).map((value) => value * unit) as unknown as Vector3,
      heading: goal.theta,
      toViewer: metersOf(core.frame, unit),
      isFloor: spaceType === 'local-floor',
      stepsOnly: prefersReducedMotion(),
    },
    () => void session.end().catch(() => undefined),
  );
  findFloor(core, unit, signal).then(
    (map) => map && !signal.aborted && (rig.map = map),
    () => undefined,
  );
  const marker = new MarkerSplats(gl, ring(), core.services.sceneLoader, signal);
  return {
    background: BACKGROUND,
    place: (frame, pose, seconds) => rig.place(frame, pose, space, seconds),
    drawAbove: (camera, at) => {
      const place = rig.targetInSpace;
      if (place) marker.draw(camera, at, placeOf(place));
    },
  };
}

async function findFloor(core: XrHost, unit: number, signal: AbortSignal): ReturnType<typeof openFloor> {
  const { attributes, camera, frame, services, walkable: request, element } = core;
  const eye = eyeOfPose(camera.goal).map((value) => value * unit) as unknown as Vector3;
  const eyeHeight = readAttribute('eye-height', attributes.eyeHeight, lengthGrammar('1.6m'), () => undefined);
  const url = attributes.walkMap?.trim() || 'auto';
  const mapUrl = url === 'auto' ? null : new URL(url, element.baseURI).href;
  const source = { loader: services.sceneLoader, request: request!, mapUrl, frame, metersPerUnit: unit, eyeHeight };
  const map = await openFloor({ ...source, near: eye }, signal);
  if (map.area < MIN_AREA) throw new Error('no floor');
  return map;
}
