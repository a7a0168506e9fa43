/** From what an element's attributes say to addresses and requests. */
import { credentialsOf, type Attributes } from './attributes.js';
import type { SceneRequest } from './loading/protocol.js';
import type { Source } from './stage-host.js';

/** A page's hand in every address; null or undefined for none. */
export type UrlModifier = ((url: string) => string) | null | undefined;

/**
 * Addresses of what an attribute names: found once for each value that it is given, as `<img>` does. The address of the page may change
 * afterwards, and a page's signatures may be others each time.
 */
class Named {
  #values: readonly (string | Blob)[] = [];
  #modifier: UrlModifier;
  #urls: readonly string[] = [];

  of(values: readonly (string | Blob)[], modifier: UrlModifier): readonly string[] {
    const old = this.#values;
    const isSame = values.length === old.length && values.every((value, i) => value === old[i]);
    if (!isSame || modifier !== this.#modifier) {
      [this.#values, this.#modifier] = [values, modifier];
      this.#urls = values.map((value) => addressOf(value, modifier));
    }
    return this.#urls;
  }
}

/** What the attributes of one element name. */
export class Addresses {
  readonly #src = new Named();
  readonly #chain = new Named();
  readonly #postprocess = new Named();

  /** The scene that is asked for; null for none. */
  request(
    { src, contract, chain }: Source,
    { crossorigin, quality, detail, renderer }: Pick<Attributes, 'crossorigin' | 'quality' | 'detail' | 'renderer'>,
    modifier: UrlModifier,
  ): SceneRequest | null {
    const [url] = this.#src.of(src ? [src] : [], modifier);
    if (url === undefined) return null;
    return {
      url,
      credentials: credentialsOf(crossorigin),
      sh: quality === 'reference' ? 'float16' : 'auto',
      levels: typeof detail === 'number' && detail > 0,
      isWhole: !detail || detail === 'off',
      renderer,
      contract,
      chain: this.#chain.of(listed(chain), modifier),
    };
  }

  postprocess(urls: string | null, modifier: UrlModifier): readonly string[] {
    return this.#postprocess.of(listed(urls), modifier);
  }
}

/** A property may have been given a list of them. */
const listed = (urls: string | null): readonly string[] => [urls].flat().join(' ').split(/\s+/).filter(Boolean);

/** A file of another window, an iframe's for one, is none of this one's `Blob`s. */
const isFile = (source: unknown): source is Blob => 'arrayBuffer' in Object(source);

/** Of files that were given in place of addresses. */
const fileUrls = new WeakMap<Blob, string>();

/** The same for the same file, with its name behind it: a `.splat` is known by nothing else. */
function fileUrl(file: Blob): string {
  const url = fileUrls.get(file) ?? `${URL.createObjectURL(file)}#${encodeURIComponent((file as File).name ?? '')}`;
  fileUrls.set(file, url);
  return url;
}

/** The worker has a base URL of its own, so it is given whole ones. What is no URL stays as it is, and fails there. */
const absolute = (url: string): string =>
  URL.canParse(url, document.baseURI) ? new URL(url, document.baseURI).href : url;

function addressOf(source: string | Blob, modifier: UrlModifier): string {
  if (isFile(source)) return fileUrl(source);
  const url = absolute(source);
  try {
    // Whatever it gives: an element that asks for a promise says so.
    return absolute(String(modifier?.(url) ?? url));
  } catch (error) {
    // The page's own fault must not end the element's life, as that of a listener does not.
    reportError(error);
    return url;
  }
}
