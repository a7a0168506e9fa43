/**
 * Splats of a textured mesh: `node --import tsx scripts/scene/surface-splats.mjs ROOM.glb ROOM.spz`.
 *
 * Each triangle is divided until its texture is nearly one color or it is as small as a splat may be, and becomes one flat Gaussian. A mesh with baked light (`KHR_materials_unlit`)
 * then looks as it does in a mesh renderer, with few splats on plain walls and many on details.
 */
import { readFileSync, writeFileSync } from 'node:fs';
import { PNG } from 'pngjs';
import { writeSpz } from '../../packages/optimize/src/write/spz.ts';

const [source, out, min = '0.015', contrast = '7'] = process.argv.slice(2);
/** Longest edge of a triangle that is divided no further, world units; and the spread of colors, of 255, within one that is. */
const [MIN_EDGE, CONTRAST] = [Number(min), Number(contrast)];
/** No splat is longer: it would show as a blob. */
const MAX_EDGE = 0.3;
/** Standard deviations of a uniform triangle are too small for their Gaussians to close the surface. */
const SPREAD = 1.9;
const THICKNESS = 0.002;
const SH_C0 = 0.28209479177387814;

const { json, binary } = parseGlb(readFileSync(source));
const images = json.images.map(({ bufferView }) => PNG.sync.read(Buffer.from(bytesOf(bufferView))));
const mean = (rows) => rows[0].map((_, k) => rows.reduce((sum, row) => sum + row[k], 0) / rows.length);
const minus = (a, b) => a.map((v, k) => v - b[k]);
const dot = (a, b) => a.reduce((sum, v, k) => sum + v * b[k], 0);
const scaled = (a, by) => a.map((v) => v * by);
const cross = ([a, b, c], [x, y, z]) => [b * z - c * y, c * x - a * z, a * y - b * x];
const unit = (a) => scaled(a, 1 / Math.hypot(...a));

function parseGlb(file) {
  const length = file.readUInt32LE(12);
  return { json: JSON.parse(file.subarray(20, 20 + length)), binary: file.subarray(28 + length) };
}

function bytesOf(index) {
  const { byteOffset = 0, byteLength } = json.bufferViews[index];
  return binary.subarray(byteOffset, byteOffset + byteLength);
}

/** Rows of numbers of an accessor. */
function rowsOf(index) {
  const { bufferView, byteOffset = 0, componentType, count, type } = json.accessors[index];
  const width = { SCALAR: 1, VEC2: 2, VEC3: 3 }[type];
  const { byteStride } = json.bufferViews[bufferView];
  const bytes = bytesOf(bufferView);
  const size = componentType === 5123 ? 2 : 4;
  const read = { 5123: 'readUInt16LE', 5125: 'readUInt32LE', 5126: 'readFloatLE' }[componentType];
  return Array.from({ length: count }, (_, row) =>
    Array.from({ length: width }, (_, k) => bytes[read](byteOffset + row * (byteStride ?? size * width) + size * k)),
  );
}

/** Column-major, from the node's frame to the world's. */
function matrixOf(index) {
  const {
    matrix,
    translation = [0, 0, 0],
    scale = [1, 1, 1],
    rotation: [x, y, z, w] = [0, 0, 0, 1],
  } = json.nodes[index];
  const own = matrix ?? [
    ...[1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)].map((v) => v * scale[0]), 0,
    ...[2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)].map((v) => v * scale[1]), 0,
    ...[2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)].map((v) => v * scale[2]), 0,
    ...translation, 1,
  ]; // prettier-ignore
  const parent = json.nodes.findIndex(({ children }) => children?.includes(index));
  return parent < 0 ? own : multiplied(matrixOf(parent), own);
}

function multiplied(a, b) {
  return Array.from({ length: 16 }, (_, i) => {
    const [column, row] = [i >> 2, i & 3];
    return [0, 1, 2, 3].reduce((sum, k) => sum + a[4 * k + row] * b[4 * column + k], 0);
  });
}

function trianglesOf({ primitives }, m) {
  return primitives.flatMap(({ attributes, indices, material }) => {
    const { pbrMetallicRoughness = {} } = json.materials[material];
    const base = textureOf(pbrMetallicRoughness.baseColorTexture, attributes);
    const points = rowsOf(attributes.POSITION).map(([x, y, z]) =>
      [0, 1, 2].map((r) => m[r] * x + m[4 + r] * y + m[8 + r] * z + m[12 + r]),
    );
    const order = indices === undefined ? points.map((_, i) => i) : rowsOf(indices).flat();
    return Array.from({ length: order.length / 3 }, (_, t) => {
      const corners = [0, 1, 2].map((k) => order[3 * t + k]);
      return {
        points: corners.map((i) => points[i]),
        base: base && { ...base, at: corners.map((i) => base.places[i]) },
        weights: [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
      }; // prettier-ignore
    });
  });
}

function textureOf(texture, attributes) {
  if (texture === undefined) return undefined;
  const image = images[json.textures[texture.index].source];
  return { image, places: rowsOf(attributes[`TEXCOORD_${texture.texCoord ?? 0}`]) };
}

/** The color of a triangle's point, of 255. Without a texture it is white. */
function colorAt({ base }, weights) {
  if (base === undefined) return [255, 255, 255];
  const { image, at } = base;
  const place = (axis, size) => {
    const v = weights.reduce((sum, weight, k) => sum + weight * at[k][axis], 0);
    return Math.min(size - 1, Math.max(0, Math.floor((v - Math.floor(v)) * size)));
  };
  const pixel = 4 * (place(1, image.height) * image.width + place(0, image.width));
  return [...image.data.subarray(pixel, pixel + 3)];
}

/** Colors within a triangle: its corners, a little inside, the middles of its edges, and its own middle. */
function sampled(triangle) {
  const { weights } = triangle;
  const mix = (shares) => [0, 1, 2].map((axis) => shares.reduce((sum, share, k) => sum + share * weights[k][axis], 0));
  const shares = [
    [1 / 3, 1 / 3, 1 / 3], [0.8, 0.1, 0.1], [0.1, 0.8, 0.1], [0.1, 0.1, 0.8], [0.45, 0.45, 0.1], [0.1, 0.45, 0.45], [0.45, 0.1, 0.45],
  ]; // prettier-ignore
  return shares.map((each) => colorAt(triangle, mix(each)));
}

function divided(triangle) {
  const { points, weights } = triangle;
  const edges = [0, 1, 2].map((k) =>
    Math.hypot(...[0, 1, 2].map((axis) => points[k][axis] - points[(k + 1) % 3][axis])),
  );
  const longest = Math.max(...edges);
  const colors = sampled(triangle);
  const spread = Math.max(
    ...[0, 1, 2].map(
      (c) => Math.max(...colors.map((color) => color[c])) - Math.min(...colors.map((color) => color[c])),
    ),
  );
  if (longest <= MIN_EDGE || (spread <= CONTRAST && longest <= MAX_EDGE)) return [{ points, color: mean(colors) }];
  // In two, at the middle of the longest edge: no part becomes a sliver.
  const k = edges.indexOf(longest);
  const [a, b, c] = [k, (k + 1) % 3, (k + 2) % 3];
  const half = (rows) => rows[a].map((v, axis) => (v + rows[b][axis]) / 2);
  const part = (corners) => ({
    ...triangle,
    points: corners.map((i) => (i < 0 ? half(points) : points[i])),
    weights: corners.map((i) => (i < 0 ? half(weights) : weights[i])),
  });
  return [...divided(part([a, -1, c])), ...divided(part([-1, b, c]))];
}

/**
 * The Gaussian with the triangle's center and, except for SPREAD, its covariance (that of a uniform triangle is a
 * twelfth of the corners' scatter).
 */
function cloudOf(all) {
  const [positions, scales, rotations, opacities, sh] = [3, 3, 4, 1, 3].map(
    (width) => new Float32Array(width * all.length),
  );
  all.forEach(({ points, color: color }, i) => {
    const center = mean(points);
    const arms = points.map((point) => minus(point, center));
    const along = unit(minus(points[1], points[0]));
    const normal = unit(cross(along, minus(points[2], points[0])));
    const across = cross(normal, along);
    const [xx, xy, yy] = [[along, along], [along, across], [across, across]].map(
      ([u, v]) => arms.reduce((sum, arm) => sum + dot(arm, u) * dot(arm, v), 0) / 12,
    ); // prettier-ignore
    const angle = 0.5 * Math.atan2(2 * xy, xx - yy);
    const [middle, reach] = [(xx + yy) / 2, Math.hypot((xx - yy) / 2, xy)];
    const x = [0, 1, 2].map((k) => Math.cos(angle) * along[k] + Math.sin(angle) * across[k]);
    // glTF has y up; the frame of splats has y down and z forward.
    const flip = ([a, b, c]) => [a, -b, -c];
    positions.set(flip(center), 3 * i);
    scales.set(
      [SPREAD * Math.sqrt(middle + reach), SPREAD * Math.sqrt(Math.max(1e-9, middle - reach)), THICKNESS],
      3 * i,
    );
    rotations.set(quaternionOf(flip(x), flip(cross(normal, x)), flip(normal)), 4 * i);
    opacities[i] = 0.98;
    sh.set(color.map((v) => (v / 255 - 0.5) / SH_C0), 3 * i); // prettier-ignore
  });
  return {
    count: all.length,
    shDegree: 0,
    antialiased: false,
    origin: [0, 0, 0],
    droppedCount: 0,
    positions,
    scales,
    rotations,
    opacities,
    sh,
  };
}

/** w, x, y, z of the rotation whose matrix has these columns. */
function quaternionOf(a, b, c) {
  const parts = [
    [1 + a[0] + b[1] + c[2], b[2] - c[1], c[0] - a[2], a[1] - b[0]],
    [b[2] - c[1], 1 + a[0] - b[1] - c[2], a[1] + b[0], c[0] + a[2]],
    [c[0] - a[2], a[1] + b[0], 1 - a[0] + b[1] - c[2], b[2] + c[1]],
    [a[1] - b[0], c[0] + a[2], b[2] + c[1], 1 - a[0] - b[1] + c[2]],
  ];
  // The largest diagonal is the one that rounding hurts least.
  return unit(parts.reduce((best, part, k) => (part[k] > best[0] ? [part[k], part] : best), [-1, parts[0]])[1]);
}

const triangles = json.nodes.flatMap((node, index) =>
  node.mesh === undefined ? [] : trianglesOf(json.meshes[node.mesh], matrixOf(index)),
);
const splats = triangles.flatMap(divided);
writeFileSync(out, await writeSpz(cloudOf(splats), { shBits: 8 }));
console.log(`${triangles.length} triangles, ${splats.length} splats, ${out}`);
