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

/** The worker has a base URL of its own, so it is given whole ones. What is no URL stays as it is, and fails there. */
function addressOf(src: string, modifier: UrlModifier): string {
  const url = URL.canParse(src, document.baseURI) ? new URL(src, document.baseURI).href : src;
  return modifier?.(url) ?? url;
}
