/** Converts the attributes of an element to absolute URLs and to requests for the loader. */
import { credentialsOf, type Attributes } from './attributes.js';
import type { SceneRequest } from '../loading/protocol.js';
import type { Source } from './element-host.js';

/** Function of the page that rewrites each address; null or undefined for none. */
export type UrlModifier = ((url: string) => string) | null | undefined;

/**
 * URLs of one attribute. They are resolved once per value, like that of `<img>`: the page's URL may change later, and a
 * modifier may sign each call differently.
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

/** Resolved URLs of all attributes of one element. */
export class Addresses {
  readonly #src = new Named();
  readonly #chain = new Named();
  readonly #postprocess = new Named();

  /** Returns the request for the element's scene; null without `splats`, and if `src` is missing or empty. */
  request(
    { src, contract, chain, isMesh, splats }: Source,
    { crossorigin, quality, detail, renderer, groups }: Attributes,
    modifier: UrlModifier,
  ): SceneRequest | null {
    const [url] = splats ? ['splats:'] : this.#src.of(src ? [src] : [], modifier);
    if (url === undefined) return null;
    return {
      url,
      credentials: credentialsOf(crossorigin),
      sh: quality === 'reference' ? 'float16' : 'auto',
      levels: typeof detail === 'number' && detail > 0,
      isWhole: !detail || detail === 'off',
      renderer,
      ...{ isMesh, splats, groups: groups ?? undefined },
      contract,
      chain: this.#chain.of(listed(chain), modifier),
    };
  }

  postprocess(urls: string | null, modifier: UrlModifier): readonly string[] {
    return this.#postprocess.of(listed(urls), modifier);
  }
}

/** Splits a list of URLs at white space. A property may also have been set to an array of URLs. */
const listed = (urls: string | null): readonly string[] => [urls].flat().join(' ').split(/\s+/).filter(Boolean);

/**
 * Whether a source is a file. Does not use `instanceof`, because a file of another window, such as an iframe, is no
 * instance of this window's `Blob`.
 */
const isFile = (source: unknown): source is Blob => 'arrayBuffer' in Object(source);

/** Object URLs of the files that pages have set as `src`. */
const fileUrls = new WeakMap<Blob, string>();
/** Revokes the URL of a file that no element and no script refers to: the browser would keep its bytes. */
const unused = new FinalizationRegistry<string>((url) => URL.revokeObjectURL(url));

/**
 * Returns the object URL of a file, equal for each call, with the file name as its fragment. The extension is all that
 * identifies a `.splat`.
 */
function fileUrl(file: Blob): string {
  let url = fileUrls.get(file);
  if (url === undefined) {
    url = URL.createObjectURL(file);
    unused.register(file, url);
    url += `#${encodeURIComponent((file as File).name ?? '')}`;
    fileUrls.set(file, url);
  }
  return url;
}

/**
 * Returns an absolute URL, because the worker has another base URL. Returns a string that is no URL unchanged; the
 * worker reports it.
 */
const absolute = (url: string): string =>
  URL.canParse(url, document.baseURI) ? new URL(url, document.baseURI).href : url;

function addressOf(source: string | Blob, modifier: UrlModifier): string {
  if (isFile(source)) return fileUrl(source);
  const url = absolute(source);
  try {
    // Converts any result of the page's function to a string. For a promise, the error shows `[object Promise]`.
    return absolute(String(modifier?.(url) ?? url));
  } catch (error) {
    // An error of the page's function is reported like that of an event listener, and the address stays unchanged.
    reportError(error);
    return url;
  }
}
