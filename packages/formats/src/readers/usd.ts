import { GaussianSplatError, type CloudHints, type GaussianCloud } from '@gaussian-splat/core';
import { grouped, startsWith } from '../bytes.js';
import type { DraftCloud } from '../cloud.js';
import { addCredits, creditsOf } from '../credits.js';
import { warn } from '../faults.js';
import { mergeClouds } from '../merge-clouds.js';
import type { SceneSource } from '../scene-format.js';
import { applyMotion } from '../transform/moved-cloud.js';
import { readCrate } from '../usd/crate.js';
import { isField, readField } from '../usd/fields.js';
import { DATA_PREFIX, pathOf, shownPath, valueAt, type UsdLayer, type UsdPrim } from '../usd/layer.js';
import { readTextLayer } from '../usd/text-layer.js';
import { placesAt } from '../usd/transforms.js';

const ASSUMED_Y = 'The stage does not name its up axis, and y is assumed. If the scene lies on its side, set up="z".';
/** Maximum number of arcs and types that messages name. */
const MAX_NAMED = 4;

/**
 * Reads a layer of OpenUSD, text or binary: the splats (`ParticleField3DGaussianSplat`, and `ParticleField` with a kernel
 * of Gaussians) of all prims that are active, visible and for rendering, at the first time code. Coordinates are those of
 * the stage; `hints.up` and `hints.metersPerUnit` are its up axis and its unit.
 *
 * A layer is not composed with others: a composition arc on splats or on a prim above them is `decode/unsupported`, and
 * elsewhere a warning.
 */
export async function readUsd(source: SceneSource): Promise<GaussianCloud> {
  const { bytes, name, signal } = source;
  const layer = startsWith(bytes, 'PXR-USDC') ? readCrate(source) : readTextLayer(source);
  signal?.throwIfAborted();
  const start = layer.metadata.get('startTimeCode');
  const time = typeof start === 'number' ? start : -Infinity;
  const isDrawn = drawnAt(time);
  const drawn = layer.prims.filter((prim) => isDrawn(prim));
  // Text and binary layers list prims in other orders.
  const fields = drawn.filter(isField).sort((a, b) => (pathOf(a) < pathOf(b) ? -1 : 1));
  const left = refuseArcs(layer, fields, name);
  if (fields.length === 0) throw noFields(drawn, name);
  const placeOf = placesAt(time, name);
  const clouds: GaussianCloud[] = [];
  for (const prim of fields) {
    signal?.throwIfAborted();
    const cloud = readField(prim, time, source);
    const toStage = placeOf(prim);
    const isMoved = toStage.some((value, k) => value !== Number(k % 5 === 0));
    clouds.push(isMoved ? applyMotion(cloud, toStage) : cloud);
  }
  const whole: DraftCloud =
    clouds.length === 1
      ? { ...clouds[0] }
      : mergeClouds(
          clouds.map((cloud) => ({ cloud, first: 0, count: cloud.count })),
          source,
        );
  whole.hints = { ...whole.hints, ...stageHints(layer) };
  // Apple's usdzconvert writes `copyright`.
  const [attribution, license] = ['copyright', 'license'].map((key) => layer.metadata.get(DATA_PREFIX + key));
  addCredits(whole, creditsOf({ attribution, license }));
  if (left.length > 0)
    warn(whole, `Content of other layers is left out: ${left.join(', ')}. "usdcat --flatten" puts it into one file.`);
  if (whole.hints.isUpAssumed) warn(whole, ASSUMED_Y);
  warnOthers(whole, drawn);
  return whole;
}

/** Returns a function that tests whether a prim and all above it are defined, active, visible and for rendering. */
function drawnAt(time: number): (prim: UsdPrim) => boolean {
  const known = new Map<UsdPrim, boolean>();
  return (prim) => {
    const { parent, specifier, metadata, attributes } = prim;
    const purpose = attributes.has('purpose') ? valueAt(attributes.get('purpose'), time) : 'default';
    const isDrawn =
      (parent === undefined || known.get(parent) === true) &&
      specifier === 'def' &&
      metadata.get('active') !== false &&
      valueAt(attributes.get('visibility'), time) !== 'invisible' &&
      purpose !== 'guide' &&
      purpose !== 'proxy';
    // Parents are tested before their children.
    known.set(prim, isDrawn);
    return isDrawn;
  };
}

/**
 * Returns phrases for the composition arcs of prims that have no splats below them.
 * @throws GaussianSplatError `decode/unsupported` if an arc may change the splats, or bring the only ones.
 */
function refuseArcs({ prims, arc }: UsdLayer, fields: readonly UsdPrim[], name: string): string[] {
  const above = new Set<UsdPrim>();
  for (const field of fields) for (let at: UsdPrim | undefined = field; at; at = at.parent) above.add(at);
  const withArcs = prims.filter((prim) => prim.arc);
  const bad = withArcs.find((prim) => above.has(prim)) ?? (fields.length === 0 ? withArcs[0] : undefined);
  if (arc || bad)
    throw new GaussianSplatError('decode/unsupported', {
      where: arc ? name : `${name}, ${shownPath(bad)}`,
      expected: 'splats in one layer, without composition',
      found: `${arc ?? bad!.arc} of other layers or prims`,
      remedy: 'flatten the stage first: usdcat --flatten scene.usda --out flat.usdc',
    });
  const named = withArcs.slice(0, MAX_NAMED).map((prim) => `${prim.arc} of ${shownPath(prim)}`);
  return withArcs.length > MAX_NAMED ? [...named, `${withArcs.length - MAX_NAMED} more`] : named;
}

function noFields(drawn: readonly UsdPrim[], name: string): GaussianSplatError {
  const types = new Map<string, number>();
  for (const { type } of drawn) types.set(type || 'prim', (types.get(type || 'prim') ?? 0) + 1);
  const counts = [...types]
    .sort((a, b) => b[1] - a[1])
    .map(([type, count]) => `${grouped(count)} ${type.slice(0, 60)}`);
  const other = types.has('ParticleField') ? ' (ParticleField without a kernel of Gaussians)' : '';
  return new GaussianSplatError('decode/not-splats', {
    where: name,
    expected: 'a stage of OpenUSD with splats (ParticleField3DGaussianSplat)',
    found: counts.length > 0 ? counts.slice(0, MAX_NAMED).join(', ') + other : 'no prims that are drawn',
    remedy: 'export the splats with OpenUSD 26.03 or later, for example with usd-convert-gsplat, or as PLY or SPZ',
  });
}

/** Up axis and unit of the stage. OpenUSD assumes y without an up axis. */
function stageHints({ metadata }: UsdLayer): CloudHints {
  const axis = metadata.get('upAxis');
  const meters = metadata.get('metersPerUnit');
  return {
    up: axis === 'Z' ? [0, 0, 1] : [0, 1, 0],
    ...(axis === undefined && { isUpAssumed: true }),
    ...(typeof meters === 'number' && meters > 0 && Number.isFinite(meters) && { metersPerUnit: meters }),
  };
}

/** Adds warnings about motion of the splats, and about meshes of the stage. */
function warnOthers(cloud: DraftCloud, drawn: readonly UsdPrim[]): void {
  const isMoving = (prim: UsdPrim): boolean =>
    [...prim.attributes].some(
      ([name, { samples }]) => (samples?.length ?? 0) > 1 && (isField(prim) || name.startsWith('xformOp:')),
    );
  const moving = drawn.filter(isMoving).length;
  if (moving > 0)
    warn(cloud, `Time samples of ${grouped(moving)} prims are left out: the first frame is drawn without motion.`);
  const meshes = drawn.filter(({ type }) => type === 'Mesh').length;
  if (meshes > 0) warn(cloud, `${grouped(meshes)} meshes of the stage are left out.`);
}
