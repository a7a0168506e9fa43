/** From what an element's attributes say to addresses and requests. */
import type { Attributes } from './attributes.js';
import type { SceneRequest } from './loading/protocol.js';
import type { Source } from './stage-options.js';

/** A page's hand in every address; null or undefined for none. */
export type UrlModifier = ((url: string) => string) | null | undefined;

/** The scene that is asked for; null for none. */
export function requestOf(
  { src, contract, chain }: Source,
  { credentials, quality, detail }: Pick<Attributes, 'credentials' | 'quality' | 'detail'>,
  modifier: UrlModifier,
): SceneRequest | null {
  if (!src) return null;
  return {
    url: addressOf(src, modifier),
    credentials,
    sh: quality === 'reference' ? 'float16' : 'auto',
    levels: typeof detail === 'number' && detail > 0,
    contract,
    chain: addressesOf(chain, modifier),
  };
}

/** Addresses with spaces between them; a property may have been given a list of them. */
export const addressesOf = (urls: string | null, modifier: UrlModifier): readonly string[] =>
  [urls]
    .flat()
    .join(' ')
    .split(/\s+/)
    .filter(Boolean)
    .map((url) => addressOf(url, modifier));

/** Of files that were given in place of addresses. */
const fileUrls = new WeakMap<Blob, string>();

/** The same for the same file, with its name behind it: a `.splat` is known by nothing else. */
function fileUrl(file: Blob): string {
  const url = fileUrls.get(file) ?? `${URL.createObjectURL(file)}#${encodeURIComponent((file as File).name ?? '')}`;
  fileUrls.set(file, url);
  return url;
}

/** The worker has a base URL of its own, so it is given whole ones. What is no URL stays as it is, and fails there. */
function addressOf(source: string | Blob, modifier: UrlModifier): string {
  if (source instanceof Blob) return fileUrl(source);
  const url = URL.canParse(source, document.baseURI) ? new URL(source, document.baseURI).href : source;
  return modifier?.(url) ?? url;
}
