/**
 * Starts the scene worker. A worker script must have the page's origin; where the element itself came from elsewhere
 * (a CDN) a one-line module of the page's origin imports it.
 */
export function spawnSceneWorker(): Worker {
  const script = new URL('./scene-worker.js', import.meta.url);
  // Written out in full, since bundlers look for exactly this expression.
  if (script.origin === location.origin)
    return new Worker(new URL('./scene-worker.js', import.meta.url), { type: 'module' });
  const url = URL.createObjectURL(new Blob([`import ${JSON.stringify(script.href)};`], { type: 'text/javascript' }));
  const worker = new Worker(url, { type: 'module' });
  // The URL is only needed until the script has been fetched, which its first message or its failure tells.
  const revoke = (): void => URL.revokeObjectURL(url);
  worker.addEventListener('message', revoke, { once: true });
  worker.addEventListener('error', revoke, { once: true });
  return worker;
}
