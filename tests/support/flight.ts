/** The flight of benchmarks/detail.js without a GPU and without a clock: the same path, the real rules of who comes and goes, a server of known speed. */
import type { Bounds, Camera } from '@gaussian-splat/core';
import { SharedReads } from '@gaussian-splat/core/fetch';
import {
  aheadMs,
  CameraMotion,
  PageStreamer,
  Residency,
  SLOT_CHUNKS,
  UploadBudget,
} from '@gaussian-splat/renderer/stages';
import { setImmediate as turn } from 'node:timers/promises';
import { benchModule } from '../bench/load.js';
import type { FlightPages } from './flight-pages.js';

const FRAME_MS = 1000 / 60;
/** Frames from a look to when it has been read back. */
const READ_BACK = 2;
/** Frames between two feedback passes for a camera that moves. */
const LOOK = 3;

export interface FlightOptions {
  readonly bounds: Bounds;
  readonly width: number;
  readonly height: number;
  /** Bytes of the pool. */
  readonly slots: number;
  /** Bytes of a page in a slot. */
  readonly bytes: number;
  /** Seconds at the flight's starting position, and of the flight. */
  readonly warm: number;
  readonly seconds: number;
  /** How much of the path is flown in these seconds. Default 1. */
  readonly speed?: number;
  /** Milliseconds until a file comes, and bytes a second of all of them. */
  readonly latencyMs: number;
  readonly bandwidth: number;
  /** Milliseconds of main-thread time for a megabyte. */
  readonly uploadMs: number;
  /** Bytes of files that are kept, and whether copies of a tree have files of their own, as no folder has them: such a scene is one without copies. */
  readonly kept: number;
  readonly isWithoutCopies?: boolean;
  /** Page requests are those of the present view alone. */
  readonly isStill?: boolean;
}

/** The path that the benchmark page flies. */
const {
  flightCamera,
  degreesBetween,
}: {
  flightCamera: (share: number, view: Pick<FlightOptions, 'bounds' | 'width' | 'height'>) => Camera;
  degreesBetween: (a: Camera, b: Camera) => number;
} = await benchModule('detail/flight-path.js');

/** State of the flight at the end of a second. */
export interface FlightSecond {
  /**
   * Largest error in pixels of anything in view whose page is missing: at the second's end, and the mean of its frames.
   */
  readonly error: number;
  readonly mean: number;
  /** Degrees that the camera turned. */
  readonly turned: number;
  readonly pages: number;
  readonly files: number;
}

/** Answers after a while, one after the other. */
class Server {
  readonly #open: { readonly at: number; readonly arrive: () => void }[] = [];
  readonly #options: FlightOptions;
  #freeAt = 0;
  now = 0;

  constructor(options: FlightOptions) {
    this.#options = options;
  }

  files = 0;

  readonly fetch = (chunks: number): Promise<ArrayBuffer> => {
    this.files++;
    const { latencyMs, bandwidth } = this.#options;
    const bytes = (this.#options.bytes * chunks) / SLOT_CHUNKS;
    this.#freeAt = Math.max(this.now, this.#freeAt) + (1000 * bytes) / bandwidth;
    const at = Math.max(this.now + latencyMs, this.#freeAt);
    return new Promise((resolve) => this.#open.push({ at, arrive: () => resolve(new ArrayBuffer(bytes)) }));
  };

  /** Lets time pass. */
  async run(until: number): Promise<void> {
    for (;;) {
      let next = -1;
      this.#open.forEach(({ at }, k) => {
        if (at <= until && (next < 0 || at < this.#open[next].at)) next = k;
      });
      if (next < 0) break;
      const [{ at, arrive }] = this.#open.splice(next, 1);
      this.now = at;
      arrive();
      await turn();
    }
    this.now = until;
  }
}

/** Flies. @returns the seconds of the flight, without those before it */
export async function fly(pages: FlightPages, options: FlightOptions): Promise<FlightSecond[]> {
  const { list } = pages;
  const server = new Server(options);
  const files = new SharedReads<ArrayBuffer>(({ byteLength }) => byteLength, options.kept);
  const nameOf = (page: number): string => {
    const { file } = list.place(page);
    return `${file.chunks} ${file.file} ${options.isWithoutCopies ? list.translate(page).join() : ''}`;
  };
  const residency = new Residency(list, options.slots, (page) => files.has(nameOf(page)));
  residency.begin(0);
  residency.settle(0);
  const traffic = new PageStreamer(residency, {
    slotBytes: options.bytes,
    fetch: async (page, signal) => {
      const name = nameOf(page);
      await files.read(name, () => server.fetch(parseInt(name)), signal);
      return Uint32Array.of(page);
    },
    onArrival: () => undefined,
    onError: (error) => {
      throw error;
    },
    now: () => server.now,
  });
  const [quality, motion] = [new UploadBudget(), new CameraMotion()];
  const rows: FlightSecond[] = [];
  let look: { readonly requests: Float32Array; readonly frame: number } | undefined;
  let [sum, placed, turned] = [0, 0, 0];
  let before: Camera | undefined;
  const all = Math.round(60 * (options.warm + options.seconds));
  for (let frame = 0; frame < all; frame++) {
    await server.run(frame * FRAME_MS);
    placed += upload(residency, traffic, quality, { now: server.now, ...options });
    traffic.sendForMore();
    // Files that are kept come at once.
    await turn();
    const passed = Math.max(0, (frame / 60 - options.warm) / options.seconds);
    const camera = flightCamera((options.speed ?? 1) * passed, options);
    turned += before ? degreesBetween(before, camera) : 0;
    before = camera;
    motion.observe(camera, server.now);
    if (look && frame >= look.frame + READ_BACK) {
      residency.note(look.requests);
      traffic.follow();
      look = undefined;
    }
    if (look === undefined && frame % LOOK === 0) {
      const ahead = options.isStill ? camera : motion.ahead(aheadMs(traffic.arrivalMs));
      look = { requests: requestsOf(pages, residency, [camera, ahead]), frame };
    }
    const error = lacking(pages, residency, camera);
    sum += error;
    if ((frame + 1) % 60 > 0) continue;
    rows.push({ error, mean: sum / 60, turned, pages: placed, files: server.files });
    [sum, placed, turned, server.files] = [0, 0, 0, 0];
  }
  return rows.slice(options.warm);
}

function upload(
  residency: Residency,
  traffic: PageStreamer<Uint32Array>,
  quality: UploadBudget,
  { now, bytes, uploadMs }: { readonly now: number; readonly bytes: number; readonly uploadMs: number },
): number {
  const max = quality.startFrame(now);
  let [used, placed] = [0, 0];
  while (used === 0 || used + bytes <= max) {
    const next = traffic.next();
    if (next === undefined) break;
    used += bytes;
    if (residency.settle(next.page)) placed++;
    else traffic.refused();
  }
  if (used > 0) quality.note(used, (used / 1e6) * uploadMs);
  return placed;
}

/** Allowed error of a view in pixels, and the error that starts page requests: see shaders/page_feedback.wgsl. */
const [ALLOWED, SOON] = [1, 0.93];

function requestsOf(pages: FlightPages, residency: Residency, cameras: readonly Camera[]): Float32Array {
  const { list } = pages;
  const requests = new Float32Array(list.count);
  for (const camera of new Set(cameras)) {
    pages.request(camera, SOON, (page, pixels) => {
      if (pixels > requests[page] && residency.isResident(list.parent[page])) requests[page] = pixels;
    });
  }
  return requests;
}

function lacking(pages: FlightPages, residency: Residency, camera: Camera): number {
  let max = 0;
  pages.request(camera, ALLOWED, (page, pixels, isVisible) => {
    if (!isVisible || pixels <= max || residency.isResident(page)) return;
    if (residency.isResident(pages.list.parent[page])) max = pixels;
  });
  return max;
}
