/** Sorts the splats of one scene for the WebGL renderer, view by view. Loaded by a worker that is started for it. */
import { SplatOrder, type OrderView } from '@gaussian-splat/renderer/webgl';

export interface SortRequest {
  readonly view: OrderView;
  /** What is written into, and comes back. */
  readonly order: Uint32Array<ArrayBuffer>;
}

export interface SortAnswer extends SortRequest {
  readonly count: number;
}

/** Answers what comes through a port. @param positions [N, 3] */
export function sortSplats(port: MessagePort, positions: Float32Array): void {
  const splats = new SplatOrder(positions);
  port.onmessage = ({ data: { view, order } }: MessageEvent<SortRequest>) => {
    const answer: SortAnswer = { view, order, count: splats.sort(view, order) };
    port.postMessage(answer, [order.buffer]);
  };
}
