/** Loaded only if no worker starts. */

/** Warns, once for a page, that scenes are read on the main thread, with the reason and a remedy. */
export function warnOfRefusal(reason: string, violated: string | undefined, location: string | null): void {
  const directive = violated ?? /Content-Security-Policy: (\S+)/.exec(reason)?.[1];
  const cause = directive ? `the page's Content-Security-Policy forbids it: ${directive}` : reason;
  console.warn(
    `<gaussian-splat>: no worker could be started (${cause}), so scenes are read on the main thread. ${remedyOf(directive, location)}`,
  );
}

function remedyOf(directive: string | undefined, location: string | null): string {
  const own =
    'serve scene-worker.js and readers/ of the folder cdn of @gaussian-splat/element, and name that script with GaussianSplatElement.workerLocation';
  if (directive) return `Allow blob: in worker-src and script-src, or ${own}.`;
  if (location !== null) return `GaussianSplatElement.workerLocation is ${location}: ${own}.`;
  return `To have one, ${own}.`;
}
