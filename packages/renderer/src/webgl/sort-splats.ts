/** Sorts the splats of one scene for each view of the WebGL renderer, in a worker that is started for this purpose. */
import { SplatOrder, type OrderView, type SplatUpdate } from './splat-order.js';

type Views = OrderView | readonly OrderView[];

export interface SortRequest<V extends Views = OrderView> {
  /** View of the scene, or of each of several scenes. */
  readonly view: V;
  /** Buffer for the order, one index for each splat. It is transferred to the worker and back. */
  readonly order: Uint32Array<ArrayBuffer>;
  /** Splats that have changed since the last request. */
  readonly update?: SplatUpdate | undefined;
}

export interface SortAnswer<V extends Views = OrderView> extends Omit<SortRequest<V>, 'update'> {
  readonly count: number;
  /** Sum over the splats of the fraction of the image that each covers; 0 if it is not computed. */
  readonly covered: number;
  /** Duration of sorting, ms. */
  readonly milliseconds: number;
}

/**
 * Sorts the splats for each request from a port.
 * @param positions [N, 3] positions of the splats.
 * @param areas [N] areas of the splats; undefined if their coverage is not needed.
 *
 * ```js
 * // The worker of a page, for `GlHost.load(packed, { worker })`:
 * onmessage = ({ data: { port, positions } }) => sortSplats(port, positions);
 * ```
 */
export function sortSplats(port: MessagePort, positions: Float32Array, areas?: Float32Array): void {
  const splats = new SplatOrder(positions, areas);
  port.onmessage = ({ data }: MessageEvent<SortRequest<Views> | Pick<SplatOrder, 'details'>>) => {
    if ('details' in data) return void (splats.details = data.details);
    const { view, order, update } = data;
    if (update) splats.replace(update);
    const begin = performance.now();
    const count = splats.sort(view, order);
    const { covered } = splats;
    const answer: SortAnswer<Views> = { view, order, count, covered, milliseconds: performance.now() - begin };
    port.postMessage(answer, [order.buffer]);
  };
}
