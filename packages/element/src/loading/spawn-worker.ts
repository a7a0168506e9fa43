/**
 * Starts the scene worker. A worker script must have the page's origin; where the element itself came from elsewhere
 * (a CDN), or the page has no origin as in a sandboxed frame, a one-line script of the page's own imports it.
 * @param location address of `scene-worker.js`, where a bundler has put it out of reach; null for the one beside this code
 */
export function spawnSceneWorker(location: string | null = null): Worker {
  if (location !== null) {
    const named = new URL(location, document.baseURI);
    if (named.origin !== globalThis.origin) return spawnFromElsewhere(named);
    return new Worker(trustedUrl(named.href) ?? named, { type: 'module' });
  }
  const here = new URL(import.meta.url);
  const script = new URL('./scene-worker.js', here);
  if (isOwnModule(here) && script.origin !== globalThis.origin) return spawnFromElsewhere(script);
  const trusted = isOwnModule(here) ? trustedUrl(script.href) : null;
  if (trusted !== null) return new Worker(trusted, { type: 'module' });
  // Written out in full, and nowhere else, since bundlers look for exactly this expression.
  return new Worker(new URL('./scene-worker.js', import.meta.url), { type: 'module' });
}

function spawnFromElsewhere(script: URL): Worker {
  // No module itself: sandboxed frames start none of a blob. What fails is thrown where the worker's owner hears of it.
  const code = `import(${JSON.stringify(script.href)}).catch((e)=>setTimeout(()=>{throw e}))`;
  const url = URL.createObjectURL(new Blob([code], { type: 'text/javascript' }));
  const worker = new Worker(trustedUrl(url) ?? url);
  // The URL is only needed until the script has been fetched, which its first message or its failure tells.
  const revoke = (): void => URL.revokeObjectURL(url);
  worker.addEventListener('message', revoke, { once: true });
  worker.addEventListener('error', revoke, { once: true });
  return worker;
}

/**
 * False where a bundler has put this module into a file of its own, or its address on the disk in place of `import.meta.url`: then only its own
 * expression finds the worker.
 */
const isOwnModule = ({ protocol, pathname }: URL): boolean =>
  protocol !== 'file:' && /\/(spawn-worker|gaussian-splat\.min)\.js$/.test(pathname);

/** Trusted Types, which TypeScript's types of the page do not know yet. */
interface TrustedTypes {
  createPolicy(
    name: string,
    rules: { createScriptURL: (url: string) => string },
  ): { createScriptURL(url: string): string };
}

let policy: ReturnType<TrustedTypes['createPolicy']> | null | undefined;

/** An address that pages with `require-trusted-types-for 'script'` accept; null where there is no such thing, or the page refuses the policy. */
function trustedUrl(url: string): string | null {
  const { trustedTypes } = globalThis as { trustedTypes?: TrustedTypes };
  if (policy === undefined) policy = trustedTypes ? createPolicy(trustedTypes) : null;
  return policy?.createScriptURL(url) ?? null;
}

function createPolicy(trustedTypes: TrustedTypes): ReturnType<TrustedTypes['createPolicy']> | null {
  try {
    // Only addresses that are made in this file come here.
    return trustedTypes.createPolicy('gaussian-splat', { createScriptURL: (url) => url });
  } catch {
    return null;
  }
}
