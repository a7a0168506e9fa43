/** Encoders of depths, coverages and ids: NumPy arrays, OpenEXR, and PNG of 16 bits. */
import { extname } from 'node:path';
import { PNG } from 'pngjs';
import { CommandError, UsageError } from './command.mjs';

/** Encoders by the ending of a file. Each takes values [height, width], and the name and step of a value. */
const ENCODERS = { '.npy': encodeNpy, '.exr': encodeExr, '.png': encodePng16 };

/** @throws UsageError for a file of another kind. */
export function checkMapFile(option, path) {
  if (extname(path).toLowerCase() in ENCODERS) return;
  throw new UsageError(`--${option}: expected a file that ends in ${Object.keys(ENCODERS).join(', ')}, found ${path}`);
}

/**
 * Encodes a map in the format of its file name.
 * @param map.values Float32Array or Uint32Array, [height, width]
 * @param map.channel Name of the channel in an EXR file.
 * @param map.step Value of one step of a PNG file.
 */
export const encodeMap = (path, map) => ENCODERS[extname(path).toLowerCase()](map);

/** https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html, version 1.0 */
function encodeNpy({ values, width, height }) {
  const type = values instanceof Float32Array ? '<f4' : '<u4';
  const text = `{'descr': '${type}', 'fortran_order': False, 'shape': (${height}, ${width}), }`;
  // The data begins at a multiple of 64 bytes.
  const header = `${text.padEnd(Math.ceil((text.length + 11) / 64) * 64 - 11)}\n`;
  const start = Buffer.from([0x93, ...Buffer.from('NUMPY'), 1, 0, header.length & 255, header.length >> 8]);
  return Buffer.concat([start, Buffer.from(header, 'latin1'), bytesOf(values)]);
}

/** https://openexr.com/en/latest/OpenEXRFileLayout.html: one part of scan lines without compression. */
function encodeExr({ values, width, height, channel }) {
  const int = (...numbers) => Buffer.from(Int32Array.from(numbers).buffer);
  const float = (...numbers) => Buffer.from(Float32Array.from(numbers).buffer);
  const text = (value) => Buffer.from(`${value}\0`, 'latin1');
  const attribute = (name, type, content) => Buffer.concat([text(name), text(type), int(content.length), content]);
  const pixelType = values instanceof Float32Array ? 2 : 0;
  const header = Buffer.concat([
    int(20000630, 2),
    attribute('channels', 'chlist', Buffer.concat([text(channel), int(pixelType, 0, 1, 1), Buffer.of(0)])),
    attribute('compression', 'compression', Buffer.of(0)),
    attribute('dataWindow', 'box2i', int(0, 0, width - 1, height - 1)),
    attribute('displayWindow', 'box2i', int(0, 0, width - 1, height - 1)),
    attribute('lineOrder', 'lineOrder', Buffer.of(0)),
    attribute('pixelAspectRatio', 'float', float(1)),
    attribute('screenWindowCenter', 'v2f', float(0, 0)),
    attribute('screenWindowWidth', 'float', float(1)),
    Buffer.of(0),
  ]);
  const lineBytes = 8 + 4 * width;
  const first = header.length + 8 * height;
  const offsets = BigUint64Array.from({ length: height }, (_, y) => BigInt(first + y * lineBytes));
  const lines = Array.from({ length: height }, (_, y) => [
    int(y, 4 * width),
    bytesOf(values.subarray(y * width, (y + 1) * width)),
  ]);
  return Buffer.concat([header, Buffer.from(offsets.buffer), ...lines.flat()]);
}

function encodePng16({ values, width, height, channel, step }) {
  const steps = Uint16Array.from(values, (value) => Math.min(0xffff, Math.round(value / step)));
  const tooLarge = values.findIndex((value) => Math.round(value / step) > 0xffff);
  if (tooLarge >= 0)
    throw new CommandError(
      `${channel}: expected values up to ${0xffff * step} in a PNG of 16 bits, found ${values[tooLarge]}; write .exr or .npy, or use a larger --depth-unit`,
    );
  const png = new PNG({ width, height });
  png.data = steps;
  const options = { bitDepth: 16, colorType: 0, inputColorType: 0, inputHasAlpha: false };
  return PNG.sync.write(png, options);
}

const bytesOf = ({ buffer, byteOffset, byteLength }) => Buffer.from(buffer, byteOffset, byteLength);
