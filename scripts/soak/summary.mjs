/** How far a soak has come, in one line. */
import { heapSlope } from './slope.mjs';

const mebibytes = (bytes) => (bytes / 2 ** 20).toFixed(2);

/** @param epochs checks of the ledger until now; `resident` is the result of {@link residentBytes} of processes.mjs */
export function summaryLine({ epochs, actions, base, events, failures }) {
  const { minutes, heap, own, resident } = epochs.at(-1);
  const kinds = Object.entries(resident ?? {}).filter(([, bytes]) => bytes > 0);
  return [
    `summary: ${minutes.toFixed(1)} min, ${actions} actions, ${epochs.length} epochs`,
    `heap ${mebibytes(base.heap)} MiB at first, ${mebibytes(heap)} now, ${heapSlope(epochs).toFixed(2)} MiB an hour`,
    `ledger ${own - base.own} bytes from the start`,
    `resident ${kinds.map(([kind, bytes]) => `${kind} ${mebibytes(bytes)}`).join(', ') || 'unknown'} MiB`,
    `events ${JSON.stringify(events)}`,
    `${failures.length} failures`,
  ].join('; ');
}
