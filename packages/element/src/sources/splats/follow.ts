import { GaussianSplatError } from '@gaussian-splat/core';
import { decodeUpdate, updatesIn, type SplatUpdate } from '@gaussian-splat/formats/updates';

/** A sender of updates: the address of a WebSocket, a WebSocket of the page, or a stream of bytes. */
export type SplatFeed = string | URL | WebSocket | ReadableStream<Uint8Array>;

/** Receives the updates of a feed. */
export interface FeedListener {
  /** Shows an update. Fulfills with true when it is shown, and with false if a later scene has replaced it before. */
  readonly add: (update: SplatUpdate) => Promise<boolean>;
  /** Called for an update that cannot be shown, and when the feed is interrupted. */
  readonly fail: (error: unknown) => void;
  /** Maximum number of bytes of a message of a stream; undefined for the default of `updatesIn`. */
  readonly maxBytes?: number | undefined;
}

export const isFeed = (value: unknown): value is SplatFeed =>
  typeof value === 'string' ||
  value instanceof URL ||
  ['getReader', 'readyState'].some((name) => name in Object(value));

/**
 * Passes the updates of a feed to a listener as soon as they arrive, until the signal is aborted. That also cancels a
 * stream, and closes a socket that this function has opened.
 */
export function follow(feed: SplatFeed, listener: FeedListener, signal: AbortSignal): void {
  const { fail } = listener;
  try {
    if (typeof feed === 'object' && 'getReader' in feed) void followStream(feed, listener, signal).catch(fail);
    else followSocket(feed, listener, signal);
  } catch (error) {
    fail(error);
  }
}

async function followStream(
  stream: ReadableStream<Uint8Array>,
  { add, fail, maxBytes }: FeedListener,
  signal: AbortSignal,
): Promise<void> {
  // Updates are read while earlier ones wait, so that the newest is shown next.
  for await (const update of updatesIn(stream, { signal, maxBytes })) add(update).catch(fail);
}

function followSocket(feed: string | URL | WebSocket, { add, fail }: FeedListener, signal: AbortSignal): void {
  const isOwn = typeof feed === 'string' || feed instanceof URL;
  const socket = isOwn ? new WebSocket(feed) : feed;
  socket.binaryType = 'arraybuffer';
  // Requests the newest state. A sender that waits for it sends no more than the page can show.
  const request = (word: string): void => {
    if (socket.readyState === WebSocket.OPEN) socket.send(word);
  };
  const show = async (data: unknown): Promise<void> => {
    if (!(data instanceof ArrayBuffer)) return;
    const update = decodeUpdate(data);
    if (await add(update)) request(String(update.step));
  };
  const onClose = ({ code, reason }: CloseEvent): void => {
    if (code !== NORMAL_CLOSURE && code !== GOING_AWAY) fail(interrupted(socket.url, `code ${code} ${reason}`.trim()));
  };
  socket.addEventListener('open', () => request(READY), { signal });
  socket.addEventListener('message', ({ data }) => void show(data).catch(fail), { signal });
  socket.addEventListener('close', onClose, { signal });
  if (isOwn) signal.addEventListener('abort', () => socket.close(), { once: true });
  if (socket.readyState >= WebSocket.CLOSING) fail(interrupted(socket.url, 'a closed one'));
  request(READY);
}

/** The first request of a page. */
const READY = 'ready';
const [NORMAL_CLOSURE, GOING_AWAY] = [1000, 1001];

const interrupted = (where: string, found: string): GaussianSplatError =>
  new GaussianSplatError('network/interrupted', {
    where,
    expected: 'a WebSocket that stays open',
    found,
    remedy: 'check the server, and assign another WebSocket or address to the property splats',
  });
