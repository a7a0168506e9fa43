/** Warns of pages without workers. The module is loaded only if no worker starts. */

/**
 * Logs a warning that scenes are read on the main thread, with the reason and a remedy. There is none for a machine or
 * a network that is slow.
 * @param reason Message of the failure.
 * @param violated Directive of the page's policy that has blocked the worker, if known.
 * @param location Address of the worker's script that the page has set; null if it has set none.
 * @param isLate Whether a worker has only not started in time.
 */
export function warnOfRefusal(
  reason: string,
  violated: string | undefined,
  location: string | null,
  isLate: boolean,
): void {
  const directive = violated ?? /Content-Security-Policy: (\S+)/.exec(reason)?.[1];
  const cause = directive ? `the page's Content-Security-Policy forbids it: ${directive}` : reason;
  const remedy = isLate && !directive ? 'The machine or the network is slow.' : remedyOf(directive, location);
  console.warn(
    `<gaussian-splat>: no worker could be started (${cause}), so scenes are read on the main thread. ${remedy}`,
  );
}

function remedyOf(directive: string | undefined, location: string | null): string {
  const own =
    'serve scene-worker.js and readers/ of the folder cdn of @gaussian-splat/element, and name that script with GaussianSplatElement.workerLocation';
  if (directive) return `Allow blob: in worker-src and script-src, or ${own}.`;
  if (location !== null) return `GaussianSplatElement.workerLocation is ${location}: ${own}.`;
  return `To have one, ${own}.`;
}
