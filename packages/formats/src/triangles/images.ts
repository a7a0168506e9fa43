import { grouped } from '../bytes.js';
import { damaged } from '../faults.js';
import { isObject } from '../json.js';
import type { Json } from '../gltf/container.js';
import type { GltfDocument } from '../gltf/document.js';
import { TEXEL_BYTES } from './costs.js';
import { imageHeader, type ImageHeader } from './image-size.js';
import type { Survey } from './survey.js';

/** Maximum width and height of textures that every WebGPU device supports, in pixels. */
const MAX_SIDE = 8192;
const IMAGES = 'a PNG, JPEG or WebP image, or a KTX2 image of Basis Universal';

/** An encoded image file with its media type and its size. */
export interface ImageFile extends ImageHeader {
  readonly bytes: Uint8Array<ArrayBuffer>;
}

/** Images in the textures of the materials that a scene uses. */
export class Images {
  /** GPU memory of all textures in bytes. It is complete after {@link read}. */
  byteLength = 0;
  readonly #document: GltfDocument;
  /** For each image, a key of each GPU texture that contains it. */
  readonly #uses = new Map<number, Set<string>>();

  /** Finds the images of all textures. Throws `decode/*`. */
  constructor(document: GltfDocument, { materials }: Survey) {
    this.#document = document;
    for (const material of materials) {
      for (const reference of texturesIn(document.item('materials', material))) {
        const image = sourceOf(document, reference.index);
        const uses = this.#uses.get(image) ?? new Set();
        this.#uses.set(image, uses);
        uses.add(isOwn(reference) ? `reference ${uses.size}` : `texture ${String(reference.index)}`);
      }
    }
  }

  /**
   * Reads the used images.
   * @returns One entry for each image of the file; undefined for unused ones.
   * @throws GaussianSplatError `decode/*`, `out-of-memory/budget`; errors of the download
   */
  async read(): Promise<(ImageFile | undefined)[]> {
    const { images } = this.#document.json;
    const files: (ImageFile | undefined)[] = new Array(Array.isArray(images) ? images.length : 0).fill(undefined);
    for (const [index, uses] of this.#uses) files[index] = await this.#read(index, uses.size);
    return files;
  }

  async #read(index: number, uses: number): Promise<ImageFile> {
    const document = this.#document;
    const path = `images[${index}]`;
    const bytes = await this.#bytesOf(document.item('images', index), path);
    const header = imageHeader(bytes);
    if (header === undefined || header.type === 'image/avif')
      throw damaged(`${document.name}, ${path}`, IMAGES, 'another file', 'decode/unsupported');
    const { width, height } = header;
    if (Math.max(width, height) > MAX_SIDE) {
      const expected = `at most ${grouped(MAX_SIDE)} pixels a side`;
      throw damaged(`${document.name}, ${path}`, expected, `${width} x ${height}`, 'decode/unsupported');
    }
    const texture = Math.ceil(width * height * TEXEL_BYTES);
    // The charge includes the file, the decoded bitmap, and each GPU texture.
    document.take(bytes.length + 4 * width * height + uses * texture);
    this.byteLength += uses * texture;
    return { ...header, bytes: bytes.slice() as Uint8Array<ArrayBuffer> };
  }

  async #bytesOf({ bufferView, uri }: Json, path: string): Promise<Uint8Array> {
    const document = this.#document;
    if (bufferView !== undefined) return document.readView(bufferView);
    return document.readUri(uri, `${path}.uri`);
  }
}

/**
 * Returns the index of the image of a texture. A WebP image is preferred, because other images are fallbacks for viewers
 * without WebP. A KTX2 image is used only without a fallback, which needs no decoder.
 */
export function sourceOf(document: GltfDocument, index: unknown): number {
  const texture = document.item('textures', index);
  const { extensions, source } = texture;
  const sourceIn = (name: string): unknown =>
    isObject(extensions) && isObject(extensions[name]) ? extensions[name].source : undefined;
  const image = sourceIn('EXT_texture_webp') ?? source ?? sourceIn('KHR_texture_basisu');
  if (document.isIndex(image)) return image;
  throw damaged(
    `${document.name}, textures[${String(index)}]`,
    IMAGES,
    isObject(extensions) ? Object.keys(extensions).join(', ').slice(0, 80) : 'none',
    'decode/unsupported',
  );
}

/** Whether three.js copies the texture for a reference, because it has a transform or other texture coordinates. */
const isOwn = ({ texCoord, extensions }: Json): boolean =>
  Boolean(texCoord) || (isObject(extensions) && extensions.KHR_texture_transform !== undefined);

/**
 * Returns all texture references in a material and in its extensions. That of metalness and roughness occurs twice,
 * because three.js reads it for each of them.
 */
function texturesIn(value: Json, depth = 0): Json[] {
  return Object.entries(value).flatMap(([key, child]) => {
    if (!isObject(child) || depth > 3) return [];
    if (!/Texture$/.test(key) || child.index === undefined) return texturesIn(child, depth + 1);
    return key === 'metallicRoughnessTexture' ? [child, child] : [child];
  });
}
