/** Messages between the page and the scene worker. */
import type { ErrorData } from '@gaussian-splat/core';
import type { CpuCheckMessage } from '@gaussian-splat/generator';
import type { BlockBuffers } from '@gaussian-splat/renderer/tools';
import type { LoadedScene, ScenePart } from './protocol.js';
import type { RequestOf, TaskType } from './worker-tasks.js';

/**
 * Requests to a worker. Each is sent with an `id`, and results in one `answer` or one `error`, unless it is canceled.
 */
export type WorkerRequest = {
  readonly [T in TaskType]: { readonly type: T; readonly request: RequestOf<T> };
}[TaskType];

/** A request as it is sent, with the listeners that the page has. */
export type TaskMessage = WorkerRequest & {
  readonly id: number;
  readonly wantsPreviews: boolean;
  readonly wantsParts: boolean;
};

export type PageMessage =
  | TaskMessage
  | { readonly type: 'cancel'; readonly id: number }
  /** The worker holds the Web Lock of this name until the page releases it, or its thread ends. */
  | { readonly type: 'hold'; readonly name: string }
  | { readonly type: 'release'; readonly name: string }
  /** Requests a `pong`, which shows that the worker responds. */
  | { readonly type: 'ping' }
  /** The next part of a scene was used. `buffers`: those of its splats, which are transferred back. */
  | { readonly type: 'taken'; readonly id: number; readonly buffers: BlockBuffers | undefined }
  /** Provides a request with a port to another worker that packs splats. */
  | { readonly type: 'helper'; readonly id: number; readonly port: MessagePort }
  /** Makes the worker a helper, which runs the tasks from the port. */
  | { readonly type: 'pack'; readonly port: MessagePort }
  /** Makes the worker sort splats for the views that arrive on the port. `positions`: [N, 3]; `areas`: [N]. */
  | {
      readonly type: 'sort';
      readonly port: MessagePort;
      readonly positions: Float32Array;
      readonly areas?: Float32Array | undefined;
    }
  /** Makes the worker, which is started for this purpose, run a generator once on the CPU. */
  | CpuCheckMessage;

export type WorkerMessage =
  /** The worker's script has started. */
  | { readonly type: 'ready' }
  | { readonly type: 'pong' }
  /** The worker holds a lock, so that the page can wait for its release. */
  | { readonly type: 'holds'; readonly name: string }
  /** The worker starts reading for a request, and may not answer messages for a long time. */
  | { readonly type: 'reading'; readonly id: number }
  /** The worker has finished reading for a request, or the request was canceled. */
  | { readonly type: 'rested'; readonly id: number }
  /** The file of a request is downloaded, and another worker must read it, because this one is downloading others. */
  | { readonly type: 'downloaded'; readonly id: number; readonly file: Blob }
  /** Other workers can help to pack the scene of a request; `max` is their maximum number. */
  | { readonly type: 'help'; readonly id: number; readonly max: number }
  | { readonly type: 'progress'; readonly id: number; readonly loaded: number; readonly total: number | undefined }
  | { readonly type: 'preview'; readonly id: number; readonly scene: LoadedScene }
  | { readonly type: 'part'; readonly id: number; readonly part: ScenePart }
  | { readonly type: 'answer'; readonly id: number; readonly answer: unknown }
  | { readonly type: 'error'; readonly id: number; readonly error: ErrorData };
