/** Sorts the splats of one scene for the WebGL renderer, view by view. Loaded by a worker that is started for it. */
import { SplatOrder, type OrderView } from '@gaussian-splat/renderer/webgl';

export interface SortRequest {
  readonly view: OrderView;
  /** Buffer for the result, which is transferred back. */
  readonly order: Uint32Array<ArrayBuffer>;
}

export interface SortAnswer extends SortRequest {
  readonly count: number;
  /** Total coverage of the image by the splats. */
  readonly covered: number;
  /** Duration of sorting, ms. */
  readonly milliseconds: number;
}

/** Answers the requests from a port. @param positions [N, 3] @param areas [N] */
export function sortSplats(port: MessagePort, positions: Float32Array, areas: Float32Array | undefined): void {
  const splats = new SplatOrder(positions, areas);
  port.onmessage = ({ data: { view, order } }: MessageEvent<SortRequest>) => {
    const begin = performance.now();
    const count = splats.sort(view, order);
    const { covered } = splats;
    const answer: SortAnswer = { view, order, count, covered, milliseconds: performance.now() - begin };
    port.postMessage(answer, [order.buffer]);
  };
}
