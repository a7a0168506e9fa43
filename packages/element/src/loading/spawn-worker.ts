/**
 * Starts a worker from the address of its script. Browsers require that a worker's script has the page's origin. A
 * script of another origin (a CDN), or for a page without an origin, as in a sandboxed frame, is imported by a one-line
 * script of the page.
 */
export function spawnAt(script: URL): Worker {
  if (script.origin !== globalThis.origin) return spawnFromElsewhere(script);
  return new Worker(trustedUrl(script.href), { type: 'module' });
}

function spawnFromElsewhere(script: URL): Worker {
  return spawnText(`import(${JSON.stringify(script.href)})`);
}

/**
 * Starts a worker from text.
 * @param code Expression of a promise that resolves when the worker's message handler is added. Messages that arrive
 * earlier are queued. If the promise rejects, the error is thrown, so that the worker's owner receives it.
 */
export function spawnText(code: string): Worker {
  const text = `const early=[],keep=(e)=>early.push(e);addEventListener('message',keep);${code}.then(()=>{removeEventListener('message',keep);for(const e of early)dispatchEvent(new MessageEvent('message',{data:e.data,ports:[...e.ports]}))}).catch((e)=>setTimeout(()=>{throw e}))`;
  // The worker is a classic one, because sandboxed frames start no module worker from a blob.
  const url = URL.createObjectURL(new Blob([text], { type: 'text/javascript' }));
  const worker = new Worker(trustedUrl(url));
  // The URL is needed until the browser has fetched the script, which the worker's first message or failure shows.
  const revoke = (): void => URL.revokeObjectURL(url);
  worker.addEventListener('message', revoke, { once: true });
  worker.addEventListener('error', revoke, { once: true });
  return worker;
}

/** The used part of the Trusted Types API, which TypeScript's DOM types lack. */
interface TrustedTypes {
  createPolicy(
    name: string,
    rules: { createScriptURL: (url: string) => string },
  ): { createScriptURL(url: string): string };
}

let policy: ReturnType<TrustedTypes['createPolicy']> | null | undefined;

/**
 * Returns the address of a script as a trusted URL, for pages with `require-trusted-types-for 'script'`. Returns it
 * unchanged if the browser does not support Trusted Types, or the page rejects the policy.
 */
function trustedUrl(url: string): string {
  const { trustedTypes } = globalThis as { trustedTypes?: TrustedTypes };
  if (policy === undefined) policy = trustedTypes ? createPolicy(trustedTypes) : null;
  return policy?.createScriptURL(url) ?? url;
}

function createPolicy(trustedTypes: TrustedTypes): ReturnType<TrustedTypes['createPolicy']> | null {
  try {
    // The policy accepts all addresses, because only addresses that this file creates are passed to it.
    return trustedTypes.createPolicy('gaussian-splat', { createScriptURL: (url) => url });
  } catch {
    return null;
  }
}
