/** Opens streamed scenes as pages: manifests of pages (docs/lod-format.md), streamed SOG by boxes, and trees node by node. */
import type { Credits } from '@gaussian-splat/core';
import { fileRequest } from '@gaussian-splat/core/fetch';
import type { PageSource } from '@gaussian-splat/renderer';
import { folderSource, levelSource, treeSource, type FetchPage } from '@gaussian-splat/renderer/tools';
import type { ProgressListener, SceneLimits, SceneRequest } from '../../loading/protocol.js';
import type { SceneLoader } from '../../loading/scene-loader.js';
import { nameIn } from '../name-in.js';

interface PagesOptions {
  readonly loader: SceneLoader;
  readonly signal: AbortSignal;
  readonly onProgress: ProgressListener;
  /** Called with warnings about content that is not drawn. */
  readonly onError?: ((error: unknown) => void) | undefined;
}

/** The pages of a streamed scene, whose coarsest part has arrived. */
export interface OpenedPages {
  readonly source: PageSource;
  readonly credits: Credits | undefined;
}

/**
 * Opens a streamed scene: fetches its manifest or index, and its coarsest level. Resolves to undefined for a file without levels.
 * @throws GaussianSplatError `network/*`, `decode/*`, or the signal's reason.
 */
export function openPages(request: SceneRequest, options: PagesOptions): Promise<OpenedPages | undefined> {
  const name = nameIn(request.url);
  const open = /detail\.json$/i.test(name) ? openFolder : /lod-meta\.json$/i.test(name) ? openBoxes : openNodes;
  return open(request, options);
}

/**
 * Limits of the downloads of one scene. They apply to the sum of all of its parts; a part that is fetched again counts
 * once.
 */
class Allowance {
  readonly #limits: SceneLimits;
  readonly #bytes = new Map<string, number>();
  #sum = 0;

  constructor(limits: SceneLimits = {}) {
    this.#limits = limits;
  }

  /** Returns the limits for a part: the bytes that the other parts leave. */
  of(part: string): SceneLimits {
    const { maxBytes = Infinity } = this.#limits;
    const others = this.#sum - (this.#bytes.get(part) ?? 0);
    return { ...this.#limits, maxBytes: Math.max(0, maxBytes - others) };
  }

  async note<T extends { readonly byteLength: number }>(part: string, coming: Promise<T>): Promise<T> {
    const bytes = await coming;
    this.#sum += bytes.byteLength - (this.#bytes.get(part) ?? 0);
    this.#bytes.set(part, bytes.byteLength);
    return bytes;
  }
}

type Open = (request: SceneRequest, options: PagesOptions) => Promise<OpenedPages | undefined>;

const openFolder: Open = async (request, { loader, signal, onProgress }) => {
  const { limits = {} } = request;
  const allowance = new Allowance(limits);
  const manifest = await loader.ask('manifest', request, signal, { onProgress });
  const { attribution, license } = manifest;
  const fetchPage: FetchPage = async (page, aborted, coded) => {
    const part = fileRequest(page, request, limits.origins);
    const own = { ...part, limits: allowance.of(part.url), source: request.source, coded };
    return allowance.note(part.url, loader.fetchFile(own, aborted));
  };
  return {
    source: folderSource(manifest, fetchPage, true),
    credits: attribution || license ? { attribution, license } : undefined,
  };
};

const openBoxes: Open = async (request, { loader, signal, onProgress }) => {
  const { levels, files, runs, firstRuns, credits } = await loader.ask('boxes', request, signal, { onProgress });
  const { url, credentials } = request;
  const allowance = new Allowance(request.limits);
  const source = levelSource(levels, async (page, aborted) => {
    const [file, first, count] = runs.subarray(3 * (firstRuns[page.box] + page.level));
    const part = `${page.box} ${page.level}`;
    const place = { url, path: files[file], first, count };
    const own = { credentials, limits: allowance.of(part), source: request.source };
    const box = { ...place, ...own, page, scene: levels.scene };
    return new Uint32Array(await allowance.note(part, loader.ask('box', box, aborted)));
  });
  return { source, credits };
};

const openNodes: Open = async (request, { loader, signal, onProgress, onError }) => {
  // Nodes of RAD share chunks, and those of LCC2 share files, which the worker that has them fetches and decodes once.
  const keeper = /\.rad$/i.test(nameIn(request.url)) ? request.url : undefined;
  const answer = await loader.ask('tree', request, signal, { onProgress, keeper });
  if (!answer) return undefined;
  const { tree, warnings, ...opened } = answer;
  const report = (sentences: readonly string[]): void =>
    sentences.forEach((sentence) => onError?.(new Error(sentence)));
  report(warnings);
  const { url, credentials, source: from } = request;
  const allowance = new Allowance(request.limits);
  const source = treeSource(opened, async (node, above, aborted) => {
    const part = above.join(' ');
    const own = { credentials, limits: allowance.of(part), source: from };
    // The worker needs the volumes of the children alone.
    const bare = { ...node, children: node.children.map(({ volume }) => ({ volume, children: [] })) };
    const asked = { url, ...own, tree, node: bare, scene: opened.scene, above };
    const page = await loader.ask('node', asked, aborted, { keeper: keeper ?? (node.file && `${url} ${node.file}`) });
    await allowance.note(part, Promise.resolve(page.words));
    report(page.warnings);
    return page;
  });
  return { source, credits: opened.credits };
};
