/** Rooms and the doors between them, from the attributes of children. Independent of page and camera. */
import type { Vector3 } from '@gaussian-splat/core';
import { parsePoint } from '../../viewer/camera/grammar.js';

export interface Door {
  readonly element: HTMLElement;
  /** Absolute URLs of the scene in which the door is, and of the scene behind it. */
  readonly room: string;
  readonly to: string;
  /** Middle of the door at the height of the eyes, viewer space of its room. */
  readonly position: Vector3;
  /** Azimuth in which visitors leave through it, radians: 0 is -z, 90° is -x, as `theta` of a camera that looks this way. */
  readonly heading: number;
  /** Azimuth of the view of visitors who come in through it, radians; by default away from the door. */
  readonly view: number;
  /** Absolute URL of the map of the floor behind the door; null for none. */
  readonly floorMap: string | null;
}

/** A pose on the floor: the eye in viewer space, and the azimuth of the view, radians. */
export interface Arrival {
  readonly eye: Vector3;
  readonly heading: number;
}

/** Distance from the door, in meters, at which visitors arrive. */
const BEFORE_DOOR = 1;

/** Returns the absolute address of a room; a text that is none unchanged, which its load reports. */
export const addressOf = (url: string, { baseURI }: Node): string =>
  URL.canParse(url, baseURI) ? new URL(url, baseURI).href : url;

/**
 * Returns the doors among the children of an element. A door without a position is left out, with a warning.
 * @param first URL of the scene that the element shows first, for doors without `data-room`.
 */
export function readDoors(element: HTMLElement, first: string, warn: (sentence: string) => void): Door[] {
  const absolute = (url: string): string => addressOf(url, element);
  return [...element.querySelectorAll<HTMLElement>(':scope > [data-door]')].flatMap((child) => {
    const { door, room, position = '', heading: out = '0', arrivalHeading, floorMap } = child.dataset;
    const at = parsePoint(position);
    const heading = azimuthOf(out);
    const view = arrivalHeading === undefined ? heading + Math.PI : azimuthOf(arrivalHeading);
    if (at === null || Number.isNaN(heading + view)) {
      const found = [position, out, arrivalHeading].filter((text) => text !== undefined);
      warn(
        `<gaussian-splat> data-door="${door}": expected data-position="x y z" and headings as "90deg", found "${found.join('", "')}".`,
      );
      return [];
    }
    return {
      ...{ element: child, room: room === undefined ? first : absolute(room), to: absolute(door!) },
      ...{ position: at, heading, view },
      floorMap: floorMap === undefined ? null : absolute(floorMap),
    };
  });
}

/** Returns an angle in radians; NaN for a text that is none. */
const azimuthOf = (text: string): number =>
  (Number(/^\s*(-?[\d.]+)deg\s*$/.exec(text)?.[1] ?? (Number(text) === 0 ? 0 : NaN)) * Math.PI) / 180;

/** Returns the door that leads back from the room behind a door; undefined if there is none. */
export const backOf = (door: Door, all: readonly Door[]): Door | undefined =>
  all.find(({ room, to }) => room === door.to && to === door.room);

/** Returns the pose at which visitors arrive who come in through a door of the room: before it, with its view. */
export function arrivalAt({ position: [x, y, z], heading, view }: Door, unit: number): Arrival {
  const way = BEFORE_DOOR / unit;
  return { eye: [x + way * Math.sin(heading), y, z + way * Math.cos(heading)], heading: view };
}

/** Place of a room on the plan: rotation about y in radians, then translation, from its viewer space in meters to that of the first room. */
export interface Placed {
  readonly turn: number;
  readonly x: number;
  readonly z: number;
}

/** Returns the transform of a point of a room, x and z, to the plan. */
export const onPlan = ({ turn, x, z }: Placed, [px, pz]: readonly [number, number]): [number, number] => [
  x + Math.cos(turn) * px + Math.sin(turn) * pz,
  z - Math.sin(turn) * px + Math.cos(turn) * pz,
];

/**
 * Places all rooms that doors lead to, so that the two sides of each door are at the same point. Rooms of loops are placed by
 * the shortest way from the first room.
 * @param unit Meters to a unit of viewer space.
 */
export function placeRooms(first: string, all: readonly Door[], unit: number): Map<string, Placed> {
  const floorOf = ({ position }: Door): [number, number] => [position[0] * unit, position[2] * unit];
  const placed = new Map<string, Placed>([[first, { turn: 0, x: 0, z: 0 }]]);
  for (const room of placed.keys()) {
    for (const door of all) {
      const back = backOf(door, all);
      if (door.room !== room || placed.has(door.to) || !back) continue;
      const own = placed.get(room)!;
      // The way out of one side is the way into the other.
      const turn = own.turn + door.heading + Math.PI - back.heading;
      const [x, z] = onPlan(own, floorOf(door));
      const [bx, bz] = onPlan({ turn, x: 0, z: 0 }, floorOf(back));
      placed.set(door.to, { turn, x: x - bx, z: z - bz });
    }
  }
  return placed;
}
