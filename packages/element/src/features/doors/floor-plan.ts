import type { Vector3 } from '@gaussian-splat/core';
import type { FloorMap } from '@gaussian-splat/formats/floor';
import { css } from 'lit';
import { eyeOfPose } from '../../viewer/camera/orbit.js';
import { openFloor, rewritten } from '../../floor/floor-source.js';
import { adoptStyles } from '../../viewer/styles.js';
import { unitOf } from '../../viewer/unit.js';
import type { Viewer } from '../../viewer/viewer.js';
import { onPlan, placeRooms, type Door, type Placed } from './rooms.js';

/** Distance of the plan from the edge of its box, CSS pixels. */
const PADDING = 6;
const STYLES = css`
  [part='floor-plan'] {
    position: absolute;
    inset-block-start: 8px;
    inset-inline-end: 8px;
    inline-size: var(--floor-plan-width, 180px);
    block-size: auto;
    max-inline-size: 40%;
    max-block-size: 45%;
    box-sizing: border-box;
    object-fit: contain;
    padding: ${PADDING}px;
    border-radius: 8px;
    background: var(--interaction-prompt-background, rgb(0 0 0 / 0.6));
    cursor: pointer;
    z-index: 1;
  }
`;
const [FLOOR, PRESENT, DOOR, VISITOR] = ['#8f8a80', '#e9e4da', '#e2a85a', '#ff5a36'];
/** Pixels of the plan to a meter at most, and on its longer side at most. */
const [SCALE, MAX_SIDE] = [24, 480];
/** Size of the arrow, meters. */
const ARROW = 0.5;

interface Room {
  readonly url: string;
  readonly placed: Placed;
  readonly map: FloorMap;
}

/** A plan of rooms from the maps of their floors, with the visitor as an arrow. Positions are in meters. */
export class FloorPlan {
  readonly #viewer: Viewer;
  readonly #canvas: HTMLCanvasElement;
  readonly #loading = new AbortController();
  /** Maps by their URLs. */
  readonly #maps = new Map<string, Promise<FloorMap | undefined>>();
  #rooms: readonly Room[] = [];
  #doors: readonly Door[] = [];
  #present = '';
  #rendering = 0;
  /** The plan without the arrow. */
  #drawn: ImageData | undefined;
  /** Pixels to a meter, and the corner of the plan, meters. */
  #view = { scale: 1, x: 0, z: 0 };

  /** @param onRoom Called with the URL of a room that the visitor chooses. */
  constructor(viewer: Viewer, onRoom: (url: string) => void) {
    this.#viewer = viewer;
    adoptStyles(viewer.element.shadowRoot!, STYLES);
    this.#canvas = viewer.element.ownerDocument.createElement('canvas');
    this.#canvas.setAttribute('part', 'floor-plan');
    // Screen readers have the doors, which name the rooms.
    this.#canvas.setAttribute('aria-hidden', 'true');
    this.#canvas.addEventListener('click', (event) => {
      const room = this.#roomAt(event.offsetX, event.offsetY);
      if (room) onRoom(room.url);
    });
  }

  /** Draws the plan of the rooms that doors lead to. */
  show(first: string, firstMap: string | null, doors: readonly Door[], present: string): void {
    this.#present = present;
    this.#doors = doors;
    const rendering = ++this.#rendering;
    const mapOf = (url: string): string | null =>
      url === first ? firstMap : (doors.find(({ to, floorMap }) => to === url && floorMap)?.floorMap ?? null);
    const rooms = [...placeRooms(first, doors, unitOf(this.#viewer) ?? 1)].map(async ([url, placed]) => {
      const address = mapOf(url);
      const map = address === null ? undefined : await this.#mapAt(address);
      return map && { url, placed, map };
    });
    void Promise.all(rooms).then((all) => {
      if (rendering !== this.#rendering || this.#loading.signal.aborted) return;
      this.#rooms = all.filter((room) => room !== undefined);
      this.#draw();
    });
  }

  /** Moves the arrow. @param eye Viewer space. @param heading Azimuth of the view, radians. */
  move(eye: Vector3, heading: number): void {
    const context = this.#canvas.getContext('2d')!;
    const room = this.#rooms.find(({ url }) => url === this.#present);
    if (!this.#drawn || !room) return;
    context.putImageData(this.#drawn, 0, 0);
    const unit = unitOf(this.#viewer) ?? 1;
    const [x, z] = this.#pixel(onPlan(room.placed, [eye[0] * unit, eye[2] * unit]));
    const { scale } = this.#view;
    context.save();
    context.translate(x, z);
    context.rotate(-heading - room.placed.turn);
    context.fillStyle = VISITOR;
    context.beginPath();
    context.moveTo(0, -ARROW * scale);
    context.lineTo(0.6 * ARROW * scale, 0.6 * ARROW * scale);
    context.lineTo(-0.6 * ARROW * scale, 0.6 * ARROW * scale);
    context.fill();
    context.restore();
  }

  remove(): void {
    this.#loading.abort();
    this.#canvas.remove();
  }

  #mapAt(url: string): Promise<FloorMap | undefined> {
    let map = this.#maps.get(url);
    if (!map) this.#maps.set(url, (map = this.#open(url)));
    return map;
  }

  async #open(address: string): Promise<FloorMap | undefined> {
    const { services, sources, frame } = this.#viewer;
    const request = sources.ownEntry.scene.shownRequest;
    if (!request) return undefined;
    const mapUrl = rewritten(this.#viewer, address);
    const source = { loader: services.sceneLoader, request, mapUrl, frame, metersPerUnit: unitOf(this.#viewer) ?? 1 };
    return openFloor({ ...source, eyeHeight: 0, near: [0, 0, 0] }, this.#loading.signal).catch((error: Error) => {
      if (!this.#loading.signal.aborted) this.#viewer.warn(error.message);
      return undefined;
    });
  }

  #pixel([x, z]: readonly [number, number]): [number, number] {
    const { scale, x: left, z: top } = this.#view;
    return [(x - left) * scale, (z - top) * scale];
  }

  #draw(): void {
    if (this.#rooms.length === 0) return this.#canvas.remove();
    const corners = this.#rooms.flatMap(({ placed, map: { corner, cell, width, depth } }) =>
      [0, 1, 2, 3].map((k) =>
        onPlan(placed, [corner[0] + (k & 1) * width * cell, corner[1] + (k >> 1) * depth * cell]),
      ),
    );
    const [xs, zs] = [corners.map(([x]) => x), corners.map(([, z]) => z)];
    const [left, top] = [Math.min(...xs), Math.min(...zs)];
    const [wide, deep] = [Math.max(...xs) - left, Math.max(...zs) - top];
    const scale = Math.min(SCALE, MAX_SIDE / Math.max(wide, deep));
    this.#view = { scale, x: left, z: top };
    this.#canvas.width = Math.ceil(wide * scale);
    this.#canvas.height = Math.ceil(deep * scale);
    const context = this.#canvas.getContext('2d', { willReadFrequently: true })!;
    for (const { url, placed, map } of this.#rooms) {
      context.fillStyle = url === this.#present ? PRESENT : FLOOR;
      // Cells are drawn a little larger, so that no gaps remain between turned ones.
      const side = map.cell * scale + 1;
      for (let i = 0; i < map.width * map.depth; i++) {
        if (map.layers.every((layer) => Number.isNaN(layer[i]))) continue;
        const [x, z] = this.#pixel(onPlan(placed, [map.corner[0] + ((i % map.width) + 0.5) * map.cell, map.corner[1] + (Math.floor(i / map.width) + 0.5) * map.cell])); // prettier-ignore
        context.fillRect(x - side / 2, z - side / 2, side, side);
      }
    }
    context.fillStyle = DOOR;
    const unit = unitOf(this.#viewer) ?? 1;
    for (const { room, position } of this.#doors) {
      const placed = this.#rooms.find(({ url }) => url === room)?.placed;
      if (!placed) continue;
      const [x, z] = this.#pixel(onPlan(placed, [position[0] * unit, position[2] * unit]));
      context.fillRect(x - 0.2 * scale, z - 0.2 * scale, 0.4 * scale, 0.4 * scale);
    }
    this.#drawn = context.getImageData(0, 0, this.#canvas.width, this.#canvas.height);
    if (!this.#canvas.isConnected) this.#viewer.surface?.after(this.#canvas);
    const { goal } = this.#viewer.camera;
    this.move(eyeOfPose(goal), goal.theta);
  }

  /** Returns the room whose floor is at CSS pixels of the plan, or the nearest floor of another room. */
  #roomAt(offsetX: number, offsetY: number): Room | undefined {
    const { width, height, clientWidth, clientHeight } = this.#canvas;
    const [inner, innerHeight] = [clientWidth - 2 * PADDING, clientHeight - 2 * PADDING];
    // The plan is as large as fits, in the middle.
    const factor = Math.max(width / inner, height / innerHeight);
    const at = [
      (offsetX - PADDING - inner / 2) * factor + width / 2,
      (offsetY - PADDING - innerHeight / 2) * factor + height / 2,
    ];
    const distanceTo = ({ placed, map }: Room): number => {
      let best = Infinity;
      for (let i = 0; i < map.width * map.depth; i++) {
        if (map.layers.every((layer) => Number.isNaN(layer[i]))) continue;
        const [x, z] = this.#pixel(onPlan(placed, [map.corner[0] + (i % map.width) * map.cell, map.corner[1] + Math.floor(i / map.width) * map.cell])); // prettier-ignore
        best = Math.min(best, Math.hypot(x - at[0], z - at[1]));
      }
      return best;
    };
    return [...this.#rooms].sort((a, b) => distanceTo(a) - distanceTo(b))[0];
  }
}
