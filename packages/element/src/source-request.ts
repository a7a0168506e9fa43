/** Addresses and requests from an element's attributes. */
import { credentialsOf, type Attributes } from './attributes.js';
import type { SceneRequest } from './loading/protocol.js';
import type { Source } from './element-host.js';

/** The page's rewriting of every address; null or undefined for none. */
export type UrlModifier = ((url: string) => string) | null | undefined;

/**
 * Address of a named resource, resolved once per attribute value, like that of `<img>`: the page's URL may change
 * later, and signatures may differ each time.
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

/** Resolved addresses of one element. */
export class Addresses {
  readonly #src = new Named();
  readonly #chain = new Named();
  readonly #postprocess = new Named();

  /** The requested scene; null for none. */
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

/** Also true for a file of another window, such as an iframe, which is no instance of this window's `Blob`. */
const isFile = (source: unknown): source is Blob => 'arrayBuffer' in Object(source);

/** Object URLs of files that were given instead of addresses. */
const fileUrls = new WeakMap<Blob, string>();

/** Same URL for the same file, followed by its name: the extension is all that identifies a `.splat`. */
function fileUrl(file: Blob): string {
  const url = fileUrls.get(file) ?? `${URL.createObjectURL(file)}#${encodeURIComponent((file as File).name ?? '')}`;
  fileUrls.set(file, url);
  return url;
}

/** Absolute, because the worker has a base URL of its own. A string that is no URL stays as it is and fails there. */
const absolute = (url: string): string =>
  URL.canParse(url, document.baseURI) ? new URL(url, document.baseURI).href : url;

function addressOf(source: string | Blob, modifier: UrlModifier): string {
  if (isFile(source)) return fileUrl(source);
  const url = absolute(source);
  try {
    // Converts any result to a string: if the element is given a promise, its error shows `[object Promise]`.
    return absolute(String(modifier?.(url) ?? url));
  } catch (error) {
    // An error of the page's function must not break the element; it is reported like that of an event listener.
    reportError(error);
    return url;
  }
}
