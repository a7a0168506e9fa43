/**
 * Reads a file as the element does, by the code of its worker, and measures its five costs: bytes held, bytes sent
 * between threads, CPU, requests, bytes for the GPU. SECURITY.md gives their bounds.
 */
import { existsSync, readFileSync, writeFileSync } from 'node:fs';
import { serialize } from 'node:v8';
import { GaussianSplatError } from '@gaussian-splat/core';
import type { FloorOptions } from '@gaussian-splat/formats/floor';
import { clipRoomBytes, unpackClipIndex } from '@gaussian-splat/formats';
import { runOnPage } from '../../support/element/loading.js';
import type { FuzzScene, ReaderKind } from './fuzz-scenes.js';

/** Bounds for a file of `bytes`, as SECURITY.md has them. */
export const BOUNDS = {
  /** The program and what its libraries take while they work come on top. */
  heldBytes: (bytes: number): number => 2 ** 26 + 256 * bytes,
  sentBytes: (bytes: number): number => 1e6 + 2 * bytes,
  requests: (bytes: number): number => 1_000 + bytes / 1024,
  gpuBytes: (bytes: number): number => 2 ** 26 + 256 * bytes,
  /** On one core at 3 GHz, with others beside it. */
  cpuMs: (bytes: number): number => 3_000 + 4e-3 * bytes,
} as const;
/** Memory of the program that is not the file's: garbage that is not collected yet, compiled code. */
const OWN_BYTES = 150e6;

export type Costs = Readonly<Record<keyof typeof BOUNDS, number>>;

export interface Reading {
  /** Code of the error; `read` without one. */
  readonly outcome: string;
  /** Bytes of all files that arrived, each once. */
  readonly bytes: number;
  readonly costs: Costs;
}

const ORIGIN = 'http://files.example/';
const FRAME: FloorOptions['frame'] = [
  [1, 0, 0],
  [0, -1, 0],
  [0, 0, -1],
];

/** A server of some files in place of the network. It counts requests, and the bytes of different files. */
class Server {
  requests = 0;
  readonly #files: Readonly<Record<string, Uint8Array>>;
  readonly #sent = new Map<string, number>();

  constructor(files: Readonly<Record<string, Uint8Array>>) {
    this.#files = files;
  }

  get bytes(): number {
    return [...this.#sent.values()].reduce((sum, length) => sum + length, 0);
  }

  readonly fetch = async (
    input: string | URL,
    { headers }: { headers?: Record<string, string> } = {},
  ): Promise<Response> => {
    this.requests++;
    const { href, origin, pathname } = new URL(input);
    const path = decodeURIComponent(pathname.slice(1));
    const file = `${origin}/` === ORIGIN ? this.#files[path] : undefined;
    if (!file) return new Response('', { status: 404 });
    const range = /^bytes=(\d+)-(\d+)$/.exec(headers?.Range ?? '');
    const [start, end] = range ? [Number(range[1]), Math.min(file.length, Number(range[2]) + 1)] : [0, file.length];
    if (range && start >= end) return new Response('', { status: 416 });
    this.#sent.set(href, Math.max(this.#sent.get(href) ?? 0, end));
    const body = file.slice(start, end);
    const sent = { ETag: '"1"', 'Content-Length': String(body.length) };
    return range
      ? new Response(body, {
          status: 206,
          headers: { ...sent, 'Content-Range': `bytes ${start}-${end - 1}/${file.length}` },
        })
      : new Response(body, { headers: sent });
  };
}

const listeners: Parameters<typeof runOnPage>[3] = { onProgress: () => undefined };

/** Asks the worker's code as the element does. Returns all answers. */
async function ask(kind: ReaderKind, { name, files }: FuzzScene): Promise<unknown[]> {
  const { signal } = new AbortController();
  const url = ORIGIN + name;
  const request = { url, credentials: 'same-origin', sh: 'auto', isWhole: true } as const;
  const options: FloorOptions = { frame: FRAME, near: [0, 1.6, 0] };
  switch (kind) {
    case 'load':
      return [await runOnPage('load', request, signal, listeners)];
    case 'levels':
      return [await runOnPage('boxes', request, signal, listeners)];
    case 'tree':
      return tree(url, signal);
    case 'clip':
      return clip(url, signal);
    case 'manifest':
      return [await runOnPage('manifest', request, signal, listeners)];
    case 'floor':
      return [
        await runOnPage('floor', { ...request, options, map: new Uint8Array(files[name]).buffer }, signal, listeners),
      ];
    case 'voxels':
      return [await runOnPage('floor', { ...request, options, voxelUrl: url }, signal, listeners)];
    case 'mesh':
      return [await runOnPage('mesh', request, signal, listeners)];
    case 'model':
      return [await runOnPage('model', { place: { url, credentials: 'same-origin' } }, signal, listeners)];
  }
}

/** A tree's first page, and a path down to a leaf. */
async function tree(url: string, signal: AbortSignal): Promise<unknown[]> {
  const asked = { url, credentials: 'same-origin', sh: 'auto' } as const;
  const opened = await runOnPage('tree', asked, signal, listeners);
  const answers: unknown[] = [opened];
  if (!opened) return answers;
  let [[node], [above]] = [opened.children, opened.first.errors];
  for (let depth = 0; node && depth < 20; depth++) {
    const own = { tree: opened.tree, node, scene: opened.scene, above };
    const page = await runOnPage('node', { url, credentials: 'same-origin', ...own }, signal, listeners);
    answers.push(page);
    [node, above] = [[...node.children, ...page.found][0], page.errors[0]];
  }
  return answers;
}

/** The memory that the page allocates on the GPU for a clip, in bytes, before its parts arrive. */
let clipBytes = 0;

async function clip(url: string, signal: AbortSignal): Promise<unknown[]> {
  const asked = { url, credentials: 'same-origin' } as const;
  const opened = await runOnPage('clip', asked, signal, listeners);
  const index = unpackClipIndex(opened.index);
  const { groups, shDegree, origin } = index;
  clipBytes = clipRoomBytes(index);
  // The browser passes a file between threads without a copy.
  const answers: unknown[] = [{ ...opened, file: undefined }];
  for (const group of new Set([0, groups.length - 1])) {
    const { frames, parts } = groups[group];
    const own = { part: parts[0], group, frames, shDegree, origin };
    const place = { ...asked, whole: opened.file, tag: opened.tag };
    answers.push(await runOnPage('clip-part', { ...place, ...own }, signal, listeners));
  }
  return answers;
}

/** Bytes of the arrays of an answer, which are transferred, and of the rest of it, which is copied. */
function sizesOf(answers: readonly unknown[]): { arrays: number; copied: number } {
  const buffers = new Set<ArrayBufferLike>();
  // A list instead of recursion, because a file may nest values to any depth.
  const left: unknown[] = [...answers];
  while (left.length > 0) {
    const value = left.pop();
    if (ArrayBuffer.isView(value)) buffers.add(value.buffer);
    else if (value instanceof ArrayBuffer) buffers.add(value);
    else if (value instanceof Map) for (const own of value.values()) left.push(own);
    else if (typeof value === 'object' && value !== null) for (const own of Object.values(value)) left.push(own);
  }
  const arrays = [...buffers].reduce((sum, { byteLength }) => sum + byteLength, 0);
  return { arrays, copied: serialize(answers).length - arrays };
}

const STATUS = '/proc/self/status';
/** On Linux, the peak of memory since it was forgotten last; elsewhere that of array buffers now. */
function peakBytes(): number {
  if (!existsSync(STATUS)) return process.memoryUsage().arrayBuffers;
  return 1024 * Number(/VmHWM:\s*(\d+)/.exec(readFileSync(STATUS, 'utf8'))![1]);
}
function forgetPeak(): void {
  // A kernel that does not allow this keeps the peak of the process, which is a stricter measure only for the first.
  if (existsSync(STATUS)) writeFileSync('/proc/self/clear_refs', '5');
}

/** Returns the bytes by which the peak of this process grew during some work. */
export async function growthDuring(work: () => Promise<unknown>): Promise<number> {
  forgetPeak();
  const memory = peakBytes();
  await work();
  return peakBytes() - memory;
}

/** Reads a scene, and returns what it cost. Errors without a code are thrown. */
export async function measuredReading(kind: ReaderKind, scene: FuzzScene): Promise<Reading> {
  const server = new Server(scene.files);
  const before = { fetch: globalThis.fetch, createImageBitmap: globalThis.createImageBitmap };
  Object.assign(globalThis, { fetch: server.fetch, createImageBitmap: () => Promise.reject(new Error('no image')) });
  const cpu = process.cpuUsage();
  clipBytes = 0;
  let outcome = 'read';
  let answers: unknown[] = [];
  const read = async (): Promise<void> => {
    try {
      answers = await ask(kind, scene);
    } catch (error) {
      if (!(error instanceof GaussianSplatError)) throw error;
      // The element's own name for an error that a reader did not name.
      if (/^(Type|Reference|Syntax|Range)?Error: /.test(error.found)) throw error;
      outcome = error.code;
    }
  };
  const growth = await growthDuring(read).finally(() => Object.assign(globalThis, before));
  const { user, system } = process.cpuUsage(cpu);
  const heldBytes = Math.max(0, growth - OWN_BYTES);
  const { arrays, copied } = sizesOf(answers);
  const bytes = Math.max(server.bytes, scene.files[scene.name].length);
  const costs = {
    heldBytes,
    sentBytes: copied,
    requests: server.requests,
    gpuBytes: arrays + clipBytes,
    cpuMs: (user + system) / 1000,
  };
  return { outcome, bytes, costs };
}

/** The costs of a reading that are above their bounds, in words. */
export const excesses = ({ bytes, costs }: Reading): string[] =>
  (Object.keys(BOUNDS) as (keyof Costs)[])
    .filter((cost) => costs[cost] > BOUNDS[cost](bytes))
    .map((cost) => `${cost} ${Math.round(costs[cost])}, at most ${Math.round(BOUNDS[cost](bytes))} for ${bytes} bytes`);
