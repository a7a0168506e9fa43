/**
 * The mesh of the examples, written when the site is built: a round floor with a plinth in the middle and columns around it. Ours, and it costs the repository nothing.
 */
import { mkdirSync, writeFileSync } from 'node:fs';
import { dirname } from 'node:path';

const SEGMENTS = 48;
const COLUMNS = 6;
/** Metres. */
const FLOOR_RADIUS = 2.5;
const COLUMN_CIRCLE = 2.05;
const COLUMN_HEIGHT = 2.3;

/** Linear base colors. */
const MATERIALS = {
  floor: { baseColorFactor: [0.17, 0.14, 0.11, 1], roughnessFactor: 0.85, metallicFactor: 0 },
  stone: { baseColorFactor: [0.4, 0.33, 0.26, 1], roughnessFactor: 0.75, metallicFactor: 0 },
  brass: { baseColorFactor: [0.72, 0.46, 0.17, 1], roughnessFactor: 0.32, metallicFactor: 1 },
};

/** A profile of [radius, height] turned around the y axis; each stretch of it has separate normals if `isFlat`. */
function lathe(profile, { at: [x, z] = [0, 0], isFlat = true, segments = SEGMENTS } = {}) {
  const mesh = { positions: [], normals: [], indices: [] };
  const slope = ([r0, y0], [r1, y1]) => {
    const length = Math.hypot(r1 - r0, y1 - y0);
    return [(y1 - y0) / length, (r0 - r1) / length];
  };
  const stretches = profile.slice(1).map((end, k) => ({ ends: [profile[k], end], normal: slope(profile[k], end) }));
  const between = (a, b) => {
    const sum = [a[0] + b[0], a[1] + b[1]];
    return sum.map((value) => value / Math.hypot(...sum));
  };
  stretches.forEach(({ ends, normal }, k) => {
    const first = isFlat || k === 0 ? normal : between(stretches[k - 1].normal, normal);
    const last = isFlat || k === stretches.length - 1 ? normal : between(normal, stretches[k + 1].normal);
    const from = mesh.positions.length / 3;
    for (let i = 0; i <= segments; i++) {
      const angle = (2 * Math.PI * i) / segments;
      const [sin, cos] = [Math.sin(angle), Math.cos(angle)];
      ends.forEach(([radius, height], end) => {
        const [out, up] = end === 0 ? first : last;
        mesh.positions.push(x + radius * sin, height, z + radius * cos);
        mesh.normals.push(out * sin, up, out * cos);
      });
    }
    for (let i = 0; i < segments; i++) {
      const [a, b, c, d] = [0, 2, 3, 1].map((corner) => from + 2 * i + corner);
      mesh.indices.push(a, b, c, a, c, d);
    }
  });
  return mesh;
}

/** Several meshes as one. */
function joined(meshes) {
  const all = { positions: [], normals: [], indices: [] };
  for (const { positions, normals, indices } of meshes) {
    const first = all.positions.length / 3;
    all.indices.push(...indices.map((index) => first + index));
    all.positions.push(...positions);
    all.normals.push(...normals);
  }
  return all;
}

function parts() {
  const floor = lathe([
    [0, -0.14],
    [FLOOR_RADIUS - 0.06, -0.14],
    [FLOOR_RADIUS, -0.08],
    [FLOOR_RADIUS, 0],
    [0, 0],
  ]);
  const plinth = lathe([
    [0.46, 0],
    [0.46, 0.1],
    [0.36, 0.16],
    [0.34, 0.82],
    [0.44, 0.9],
    [0.44, 0.98],
    [0, 0.98],
  ]);
  const columns = Array.from({ length: COLUMNS }, (_, k) => {
    const angle = (2 * Math.PI * (k + 0.5)) / COLUMNS;
    const at = [COLUMN_CIRCLE * Math.sin(angle), COLUMN_CIRCLE * Math.cos(angle)];
    const base = [
      [0.17, 0],
      [0.17, 0.08],
      [0.13, 0.14],
    ];
    const capital = [
      [0.1, COLUMN_HEIGHT - 0.16],
      [0.17, COLUMN_HEIGHT - 0.06],
      [0.17, COLUMN_HEIGHT],
    ];
    // A shaft swells a little, as old ones do.
    const shaft = Array.from({ length: 9 }, (_, i) => {
      const share = i / 8;
      return [0.125 - 0.025 * share + 0.012 * Math.sin(Math.PI * share), 0.14 + share * (COLUMN_HEIGHT - 0.3)];
    });
    const turn = { at, segments: 20 };
    return joined([lathe(base, turn), lathe(shaft, { ...turn, isFlat: false }), lathe(capital, turn)]);
  });
  const [inner, outer] = [COLUMN_CIRCLE - 0.16, COLUMN_CIRCLE + 0.16];
  const ring = lathe([
    [inner, COLUMN_HEIGHT],
    [outer, COLUMN_HEIGHT],
    [outer, COLUMN_HEIGHT + 0.16],
    [inner, COLUMN_HEIGHT + 0.16],
    [inner, COLUMN_HEIGHT],
  ]);
  const rim = lathe([
    [FLOOR_RADIUS - 0.3, 0.004],
    [FLOOR_RADIUS - 0.3, 0.016],
    [FLOOR_RADIUS - 0.34, 0.016],
    [FLOOR_RADIUS - 0.34, 0.004],
  ]);
  const band = lathe([
    [0.372, 0.74],
    [0.378, 0.76],
    [0.378, 0.78],
    [0.368, 0.8],
  ]);
  return { floor, stone: joined([plinth, ...columns, ring]), brass: joined([rim, band]) };
}

/** Writes the mesh as GLB. */
export function writePavilion(path) {
  const chunks = [];
  const [bufferViews, accessors] = [[], []];
  const add = (values, type, more) => {
    const byteOffset = chunks.reduce((sum, { byteLength }) => sum + byteLength, 0);
    bufferViews.push({ buffer: 0, byteOffset, byteLength: values.byteLength });
    chunks.push(Buffer.from(values.buffer));
    const count = values.length / (type === 'VEC3' ? 3 : 1);
    accessors.push({ bufferView: bufferViews.length - 1, componentType: more.componentType, count, type, ...more });
    return accessors.length - 1;
  };
  const primitives = Object.entries(parts()).map(([name, { positions, normals, indices }]) => {
    const along = (axis) => positions.filter((_, k) => k % 3 === axis);
    const range = [Math.min, Math.max].map((choose) => [0, 1, 2].map((axis) => choose(...along(axis))));
    return {
      attributes: {
        POSITION: add(Float32Array.from(positions), 'VEC3', { componentType: 5126, min: range[0], max: range[1] }),
        NORMAL: add(Float32Array.from(normals), 'VEC3', { componentType: 5126 }),
      },
      indices: add(Uint32Array.from(indices), 'SCALAR', { componentType: 5125 }),
      material: Object.keys(MATERIALS).indexOf(name),
    };
  });
  const body = Buffer.concat(chunks);
  const json = {
    asset: { version: '2.0', generator: 'demo/site/pavilion.mjs' },
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0, name: 'pavilion' }],
    meshes: [{ primitives }],
    materials: Object.entries(MATERIALS).map(([name, pbrMetallicRoughness]) => ({ name, pbrMetallicRoughness })),
    accessors,
    bufferViews,
    buffers: [{ byteLength: body.length }],
  };
  let text = JSON.stringify(json);
  text += ' '.repeat((4 - (text.length % 4)) % 4);
  const words = (...values) => Buffer.from(Uint32Array.from(values).buffer);
  mkdirSync(dirname(path), { recursive: true });
  writeFileSync(
    path,
    Buffer.concat([
      words(0x46546c67, 2, 28 + text.length + body.length, text.length, 0x4e4f534a),
      Buffer.from(text),
      words(body.length, 0x004e4942),
      body,
    ]),
  );
}
