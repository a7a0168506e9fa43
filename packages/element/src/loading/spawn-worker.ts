/**
 * A worker whose script lies at an address. A worker script must have the page's origin; where it lies elsewhere (a CDN), or the page has no
 * origin as in a sandboxed frame, a one-line script of the page's own imports it.
 */
export function spawnAt(script: URL): Worker {
  if (script.origin !== globalThis.origin) return spawnFromElsewhere(script);
  return new Worker(trustedUrl(script.href), { type: 'module' });
}

function spawnFromElsewhere(script: URL): Worker {
  return spawnText(`import(${JSON.stringify(script.href)})`);
}

/**
 * A worker whose script is the text of a promise of what serves it. Messages that come before wait for it, and what fails is thrown where the
 * worker's owner hears of it.
 */
export function spawnText(code: string): Worker {
  const text = `const early=[],keep=(e)=>early.push(e);addEventListener('message',keep);${code}.then(()=>{removeEventListener('message',keep);for(const e of early)dispatchEvent(new MessageEvent('message',{data:e.data,ports:[...e.ports]}))}).catch((e)=>setTimeout(()=>{throw e}))`;
  // No module: sandboxed frames start none of a blob.
  const url = URL.createObjectURL(new Blob([text], { type: 'text/javascript' }));
  const worker = new Worker(trustedUrl(url));
  // The URL is only needed until the script has been fetched, which its first message or its failure tells.
  const revoke = (): void => URL.revokeObjectURL(url);
  worker.addEventListener('message', revoke, { once: true });
  worker.addEventListener('error', revoke, { once: true });
  return worker;
}

/** Trusted Types, which TypeScript's types of the page do not know yet. */
interface TrustedTypes {
  createPolicy(
    name: string,
    rules: { createScriptURL: (url: string) => string },
  ): { createScriptURL(url: string): string };
}

let policy: ReturnType<TrustedTypes['createPolicy']> | null | undefined;

/** An address that pages with `require-trusted-types-for 'script'` accept; as it is where there is no such thing, or the page refuses the policy. */
function trustedUrl(url: string): string {
  const { trustedTypes } = globalThis as { trustedTypes?: TrustedTypes };
  if (policy === undefined) policy = trustedTypes ? createPolicy(trustedTypes) : null;
  return policy?.createScriptURL(url) ?? url;
}

function createPolicy(trustedTypes: TrustedTypes): ReturnType<TrustedTypes['createPolicy']> | null {
  try {
    // Only addresses that are made in this file come here.
    return trustedTypes.createPolicy('gaussian-splat', { createScriptURL: (url) => url });
  } catch {
    return null;
  }
}
