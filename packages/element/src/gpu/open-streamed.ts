/** Scenes that are streamed page by page: see docs/detail-pages.md. */
import { GaussianSplatError } from '@gaussian-splat/core';
import { fetchScene } from '@gaussian-splat/formats';
import { checkManifest, StreamedGaussians } from '@gaussian-splat/renderer';
import type { ProgressListener, SceneRequest } from '../loading/protocol.js';
import type { SceneLoader } from '../loading/scene-loader.js';
import type { DetailLevers } from './gpu-scene.js';

export interface StreamedOptions {
  readonly loader: SceneLoader;
  readonly signal: AbortSignal;
  readonly onProgress: ProgressListener;
  /** Bytes of GPU memory that pages may take; undefined for what suits the device. */
  readonly memoryBudget: number | undefined;
  /** Called when another frame is asked for. */
  readonly onChange: () => void;
}

/** What a device is trusted with: phones end pages that take more. */
interface Caps {
  readonly splats: number;
  readonly bytes: number;
}

const PHONE: Caps = { splats: 1e6, bytes: 160e6 };
const DESKTOP: Caps = { splats: 3e6, bytes: 512e6 };
/** Pixels that what is drawn may be displaced where the caps leave room for more. */
const DETAIL = 1;

const capsOf = (): Caps => (globalThis.matchMedia?.('(pointer: coarse)').matches ? PHONE : DESKTOP);

/**
 * Opens a folder by its manifest: fetches that and the coarsest page.
 * @throws GaussianSplatError `network/*`, `decode/*`, `out-of-memory/*`, or the signal's reason
 */
export async function openStreamed(
  { url, credentials }: SceneRequest,
  device: GPUDevice,
  { loader, signal, onProgress, memoryBudget = Infinity, onChange }: StreamedOptions,
): Promise<{ gaussians: StreamedGaussians; detail: DetailLevers }> {
  const bytes = await fetchScene(url, { mode: 'cors', credentials, signal, onProgress });
  const manifest = checkManifest(parsed(bytes, url), url);
  const caps = capsOf();
  const gaussians = await StreamedGaussians.open(device, manifest, {
    fetchPage: (file, aborted) => loader.fetchFile({ url: new URL(file, url).href, credentials }, aborted),
    memoryBudget: Math.min(memoryBudget, caps.bytes),
    onChange,
    // A page that is missing leaves what stands for it on show; the console tells whoever looks.
    onError: (error) => console.warn(error instanceof Error ? error.message : error),
  });
  if (!signal.aborted) return { gaussians, detail: { detail: DETAIL, splatBudget: caps.splats } };
  gaussians.destroy();
  throw signal.reason;
}

function parsed(bytes: Uint8Array, where: string): unknown {
  try {
    return JSON.parse(new TextDecoder().decode(bytes));
  } catch (cause) {
    throw new GaussianSplatError('decode/header', {
      where,
      expected: 'JSON that npm run detail wrote',
      found: (cause as Error).message,
      remedy: 'check the address, or write the folder again',
      cause,
    });
  }
}
