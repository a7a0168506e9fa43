/** Bounding volumes of 3D Tiles (OGC 22-025, section 6.7.1.4) as oriented boxes. */
import type { Affine } from './gltf/nodes.js';
import { isObject } from './json.js';
import type { Volume } from './tree/types.js';

type Vector = readonly number[];

/** Transform from the coordinates of tiles (z up) to those of a cloud (x right, y down, z forward): its own inverse. */
export const TO_CLOUD: Affine = [-1, 0, 0, 0, 0, 0, -1, 0, 0, -1, 0, 0];
/** WGS 84: semi-major axis in meters, and the square of the first eccentricity. */
const [EARTH_RADIUS, EARTH_ECCENTRICITY] = [6_378_137, 6.694_379_990_141_3e-3];
/** Fractions of the sides of a region whose points bound it. */
const SAMPLES = [0, 0.5, 1];

/**
 * Returns a bounding volume in the coordinates of a cloud; undefined for kinds other than boxes, spheres and regions.
 * @param toCloud Transform from the coordinates of the tile.
 */
export function volumeOf(value: unknown, toCloud: Affine): Volume | undefined {
  const { box, sphere, region } = isObject(value) ? value : {};
  if (isList(box, 12)) return moved(box, toCloud);
  if (isList(region, 6)) return moved(boxOfRegion(region), TO_CLOUD);
  if (!isList(sphere, 4)) return undefined;
  const [x, y, z, r] = sphere;
  const volume = moved([x, y, z, r, 0, 0, 0, r, 0, 0, 0, r], toCloud);
  return [...volume.slice(0, 12), volume[12] / Math.sqrt(3)];
}

/** Position of a part in a volume that is divided into `1 << level` parts along each axis. */
interface Part {
  readonly level: number;
  readonly x: number;
  readonly y: number;
  readonly z: number;
}

/**
 * Returns a part of a box or a region, as implicit tiles divide them. @param axes Number of divided axes: 2 or 3.
 */
export function partOfVolume(value: unknown, { level, x, y, z }: Part, axes: number): unknown {
  const { box, region } = isObject(value) ? value : {};
  const place = [x, y, z].slice(0, axes);
  const count = 2 ** level;
  if (isList(box, 12)) {
    const part = [...box];
    place.forEach((at, axis) => {
      for (let k = 0; k < 3; k++) {
        const half = box[3 + 3 * axis + k];
        part[k] += half * ((2 * at + 1) / count - 1);
        part[3 + 3 * axis + k] = half / count;
      }
    });
    return { box: part };
  }
  if (!isList(region, 6)) return value;
  const part = [...region];
  const [west, south, east, north, low, high] = region;
  const sides = [
    [west, east < west ? east + 2 * Math.PI : east],
    [south, north],
    [low, high],
  ] as const;
  const places = [
    [0, 2],
    [1, 3],
    [4, 5],
  ] as const;
  place.forEach((at, axis) => {
    const [from, to] = sides[axis];
    part[places[axis][0]] = from + ((to - from) * at) / count;
    part[places[axis][1]] = from + ((to - from) * (at + 1)) / count;
  });
  return { region: part };
}

/** Returns the largest scale of a transform along the axes. */
export const scaleOf = (map: Affine): number =>
  Math.max(...[0, 1, 2].map((k) => Math.hypot(map[k], map[k + 4], map[k + 8])));

const isList = (value: unknown, length: number): value is number[] =>
  Array.isArray(value) && value.length === length && value.every((one) => Number.isFinite(one));

/** Returns a box, [12], after a transform, with the radius of the sphere around its corners. */
function moved(box: Vector, map: Affine): Volume {
  const turned = (at: number, shift: number): Vector =>
    [0, 4, 8].map(
      (row) => map[row] * box[at] + map[row + 1] * box[at + 1] + map[row + 2] * box[at + 2] + shift * map[row + 3],
    );
  const parts = [turned(0, 1), turned(3, 0), turned(6, 0), turned(9, 0)];
  const [, a, b, c] = parts;
  const corners = [1, -1].flatMap((s) => [1, -1].map((t) => Math.hypot(...a.map((x, k) => x + s * b[k] + t * c[k]))));
  return [...parts.flat(), Math.max(...corners)];
}

/** Returns a box, [12], around a region: west, south, east, north in radians, and heights in meters. */
function boxOfRegion([west, south, east, north, low, high]: Vector): Vector {
  const width = (east < west ? 2 * Math.PI : 0) + east - west;
  const [lon, lat] = [west + width / 2, (south + north) / 2];
  const up = [Math.cos(lat) * Math.cos(lon), Math.cos(lat) * Math.sin(lon), Math.sin(lat)];
  const axes = [
    [-Math.sin(lon), Math.cos(lon), 0],
    [-Math.sin(lat) * Math.cos(lon), -Math.sin(lat) * Math.sin(lon), Math.cos(lat)],
    up,
  ];
  const points = SAMPLES.flatMap((s) =>
    SAMPLES.flatMap((t) => [low, high].map((h) => onEarth(west + s * width, south + t * (north - south), h))),
  );
  const sides = axes.map((axis) => {
    const along = points.map((point) => point.reduce((sum, x, k) => sum + x * axis[k], 0));
    return [Math.min(...along), Math.max(...along)];
  });
  const center = [0, 1, 2].map((k) => sides.reduce((sum, [min, max], a) => sum + ((min + max) / 2) * axes[a][k], 0));
  return [...center, ...sides.flatMap(([min, max], a) => axes[a].map((x) => ((max - min) / 2) * x))];
}

/** Returns earth-centered coordinates in meters of a longitude and latitude in radians, and a height in meters. */
function onEarth(lon: number, lat: number, height: number): Vector {
  const normal = EARTH_RADIUS / Math.sqrt(1 - EARTH_ECCENTRICITY * Math.sin(lat) ** 2);
  const flat = (normal + height) * Math.cos(lat);
  return [flat * Math.cos(lon), flat * Math.sin(lon), (normal * (1 - EARTH_ECCENTRICITY) + height) * Math.sin(lat)];
}
