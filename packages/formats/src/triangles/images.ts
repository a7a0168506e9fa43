import { grouped } from '../bytes.js';
import { damaged } from '../faults.js';
import { isObject } from '../json.js';
import type { Json } from '../gltf/container.js';
import type { GltfDocument } from '../gltf/document.js';
import { TEXEL_BYTES } from './costs.js';
import { imageHeader, type ImageHeader } from './image-size.js';
import type { Survey } from './survey.js';

/** Texture size that every WebGPU device supports. */
const MAX_SIDE = 8192;
const IMAGES = 'a PNG, JPEG or WebP image, or a KTX2 image of Basis Universal';

/** An encoded image. */
export interface ImageFile extends ImageHeader {
  readonly bytes: Uint8Array<ArrayBuffer>;
}

/** The images in the textures of used materials. */
export class Images {
  /** GPU memory of all textures in bytes, known once the images are read. */
  byteLength = 0;
  readonly #document: GltfDocument;
  /** GPU textures that contain each image. */
  readonly #uses = new Map<number, Set<string>>();

  /** Throws `decode/*`. */
  constructor(document: GltfDocument, { materials }: Survey) {
    this.#document = document;
    for (const material of materials) {
      for (const reference of texturesIn(document.item('materials', material))) {
        const image = sourceOf(document, reference.index);
        const uses = this.#uses.get(image) ?? new Set();
        this.#uses.set(image, uses);
        // Another transform or set of coordinates requires a separate texture.
        uses.add(JSON.stringify([reference.index, reference.texCoord, reference.extensions]));
      }
    }
  }

  /** Throws `decode/*`, `out-of-memory/budget`, and the errors of the download. */
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
    if (header === undefined) throw damaged(`${document.name}, ${path}`, IMAGES, 'another file', 'decode/unsupported');
    const { width, height } = header;
    if (Math.max(width, height) > MAX_SIDE) {
      const expected = `at most ${grouped(MAX_SIDE)} pixels a side`;
      throw damaged(`${document.name}, ${path}`, expected, `${width} x ${height}`, 'decode/unsupported');
    }
    const texture = Math.ceil(width * height * TEXEL_BYTES);
    // Charges the file, the bitmap, and each texture.
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
 * The image of a texture: WebP if available, because others are fallbacks for viewers without WebP. KTX2 comes last,
 * because its fallback needs no decoder.
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

/** All texture references in a material and in its extensions. */
function texturesIn(value: Json, depth = 0): Json[] {
  return Object.entries(value).flatMap(([key, child]) => {
    if (!isObject(child) || depth > 3) return [];
    return /Texture$/.test(key) && child.index !== undefined ? [child] : texturesIn(child, depth + 1);
  });
}
