/**
 * Starts a worker from the address of its script. A worker script must have the page's origin; if it has another (a
 * CDN), or the page has no origin as in a sandboxed frame, a one-line script of the page's own imports it.
 */
export function spawnAt(script: URL): Worker {
  if (script.origin !== globalThis.origin) return spawnFromElsewhere(script);
  return new Worker(trustedUrl(script.href), { type: 'module' });
}

function spawnFromElsewhere(script: URL): Worker {
  return spawnText(`import(${JSON.stringify(script.href)})`);
}

/**
 * Starts a worker from the text of a promise of its message handler. Earlier messages are queued, and errors are thrown
 * so that the worker's owner receives them.
 */
export function spawnText(code: string): Worker {
  const text = `const early=[],keep=(e)=>early.push(e);addEventListener('message',keep);${code}.then(()=>{removeEventListener('message',keep);for(const e of early)dispatchEvent(new MessageEvent('message',{data:e.data,ports:[...e.ports]}))}).catch((e)=>setTimeout(()=>{throw e}))`;
  // Not a module, because sandboxed frames start no module worker from a blob.
  const url = URL.createObjectURL(new Blob([text], { type: 'text/javascript' }));
  const worker = new Worker(trustedUrl(url));
  // The URL is needed only until the script has been fetched, as its first message or its failure shows.
  const revoke = (): void => URL.revokeObjectURL(url);
  worker.addEventListener('message', revoke, { once: true });
  worker.addEventListener('error', revoke, { once: true });
  return worker;
}

/** Trusted Types, which TypeScript's DOM types lack. */
interface TrustedTypes {
  createPolicy(
    name: string,
    rules: { createScriptURL: (url: string) => string },
  ): { createScriptURL(url: string): string };
}

let policy: ReturnType<TrustedTypes['createPolicy']> | null | undefined;

/**
 * Converts an address for pages with `require-trusted-types-for 'script'`; unchanged if that is not supported, or the
 * page rejects the policy.
 */
function trustedUrl(url: string): string {
  const { trustedTypes } = globalThis as { trustedTypes?: TrustedTypes };
  if (policy === undefined) policy = trustedTypes ? createPolicy(trustedTypes) : null;
  return policy?.createScriptURL(url) ?? url;
}

function createPolicy(trustedTypes: TrustedTypes): ReturnType<TrustedTypes['createPolicy']> | null {
  try {
    // Only addresses that are created in this file are passed here.
    return trustedTypes.createPolicy('gaussian-splat', { createScriptURL: (url) => url });
  } catch {
    return null;
  }
}
