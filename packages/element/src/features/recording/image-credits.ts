/** Writes the credits of a scene into saved images. Loaded for the first image of a scene that has any. */
import type { Credits } from '@gaussian-splat/core';

/**
 * Returns the image with credits as XMP, which image editors and archives read: IPTC's credit line
 * (`photoshop:Credit`), and `dc:rights`. Only PNG and JPEG; other images stay as they are.
 */
export async function withCredits(image: Blob, credits: readonly Credits[]): Promise<Blob> {
  const place = PLACES[image.type];
  if (!place) return image;
  const [at, part] = place(new Uint8Array(await image.arrayBuffer()), xmpOf(credits));
  return new Blob([image.slice(0, at), part, image.slice(at)], { type: image.type });
}

/** Returns the offset of the metadata in a file, and its bytes, by media type. */
const PLACES: Partial<
  Record<string, (file: Uint8Array, xmp: string) => [offset: number, part: Uint8Array<ArrayBuffer>]>
> = {
  // An iTXt chunk, not compressed, after the signature and IHDR.
  'image/png': (_, xmp) => {
    const body = utf8(`iTXtXML:com.adobe.xmp\0\0\0\0\0${xmp}`);
    return [33, joined(bigEndian(body.length - 4, 4), body, bigEndian(crc32(body), 4))];
  },
  // APP1 behind JFIF's segment, which must be the first.
  'image/jpeg': (file, xmp) => {
    const body = utf8(`http://ns.adobe.com/xap/1.0/\0${xmp}`);
    const offset = file[3] === 0xe0 ? 4 + 256 * file[4] + file[5] : 2;
    return [offset, joined([0xff, 0xe1], bigEndian(body.length + 2, 2), body)];
  },
};

/** Maximum number of characters of a text, because a segment of JPEG has 65,535 bytes. */
const MAX_TEXT = 4_000;

function xmpOf(credits: readonly Credits[]): string {
  const all = (of: (own: Credits) => string): string =>
    escaped([...new Set(credits.map(of).filter(Boolean))].join(' | ').slice(0, MAX_TEXT));
  const names = all(({ attribution }) => attribution ?? '');
  const rights = all(({ attribution, license }) => [attribution, license].filter(Boolean).join(', '));
  return [
    '<?xpacket begin="\uFEFF" id="W5M0MpCehiHzreSzNTczkc9d"?>',
    '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">',
    '<rdf:Description rdf:about="" xmlns:dc="http://purl.org/dc/elements/1.1/" xmlns:photoshop="http://ns.adobe.com/photoshop/1.0/">',
    names && `<photoshop:Credit>${names}</photoshop:Credit>`,
    `<dc:rights><rdf:Alt><rdf:li xml:lang="x-default">${rights}</rdf:li></rdf:Alt></dc:rights>`,
    '</rdf:Description></rdf:RDF></x:xmpmeta><?xpacket end="r"?>',
  ].join('');
}

/** Escapes text for XML, which allows no control characters. */
const escaped = (text: string): string =>
  text.replace(/[\0-\x1f]/g, ' ').replace(/[<>&"']/g, (character) => `&#${character.charCodeAt(0)};`);

const utf8 = (text: string): Uint8Array => new TextEncoder().encode(text);

const bigEndian = (value: number, bytes: number): number[] =>
  Array.from({ length: bytes }, (_, k) => (value >>> (8 * (bytes - 1 - k))) & 255);

function joined(...parts: readonly ArrayLike<number>[]): Uint8Array<ArrayBuffer> {
  return Uint8Array.from(parts.flatMap((part) => Array.from(part)));
}

/** CRC of PNG: that of ISO 3309. */
function crc32(bytes: Uint8Array): number {
  let crc = ~0;
  for (const byte of bytes) {
    crc ^= byte;
    for (let k = 0; k < 8; k++) crc = (crc >>> 1) ^ (crc & 1 ? 0xedb88320 : 0);
  }
  return ~crc;
}
