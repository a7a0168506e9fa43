/** Small GLB files, made here. */

/** Corners of a box's faces, and their normals. */
function box([hx, hy, hz]: readonly number[]): { positions: number[]; normals: number[]; indices: number[] } {
  const [positions, normals, indices]: number[][] = [[], [], []];
  for (const axis of [0, 1, 2]) {
    for (const side of [-1, 1]) {
      const first = positions.length / 3;
      for (const [u, v] of [
        [-1, -1],
        [1, -1],
        [1, 1],
        [-1, 1],
      ]) {
        const corner = [0, 0, 0];
        corner[axis] = side;
        corner[(axis + 1) % 3] = u * side;
        corner[(axis + 2) % 3] = v;
        positions.push(corner[0] * hx, corner[1] * hy, corner[2] * hz);
        normals.push(...[0, 1, 2].map((k) => (k === axis ? side : 0)));
      }
      indices.push(...[0, 1, 2, 0, 2, 3].map((k) => first + k));
    }
  }
  return { positions, normals, indices };
}

export interface BoxOptions {
  /** Half of each side, meters. */
  readonly half?: readonly [number, number, number];
  /** Linear red, green, blue; emissive, so that light does not change it. */
  readonly color?: readonly [number, number, number];
  /** How its color is used: emissive (the default), unlit base color, or a rough surface that reflects light. */
  readonly surface?: 'shining' | 'unlit' | 'rough';
  /** Whether it is transparent. */
  readonly alpha?: number;
  /** Greatest alpha that is not drawn: `alphaMode` MASK. */
  readonly cutoff?: number;
  /** Its movement along x within a second. */
  readonly moves?: number;
  /** Whether a bone moves it. */
  readonly isSkinned?: boolean;
  /** Names of the mesh and its material. */
  readonly names?: readonly [mesh: string, material: string];
  /** A splat besides, at this place. */
  readonly splat?: readonly [number, number, number];
  /** Bounds that the file states, which may differ from those of its corners. */
  readonly stated?: { readonly min: readonly number[]; readonly max: readonly number[] };
  /** Whether the first corner is not a number. */
  readonly isBroken?: boolean;
  /** Whether the corners are drawn as points instead of triangles. */
  readonly drawnAs?: 'points';
  /** Address of an image: light passes where it is red. */
  readonly clearWhere?: string;
}

/** A box that shines. */
export function boxGlb({
  half = [0.5, 0.5, 0.5],
  color = [1, 0, 0],
  surface = 'shining',
  alpha = 1,
  cutoff,
  moves,
  isSkinned = false,
  names: [mesh, wood] = ['', ''],
  splat,
  stated,
  isBroken = false,
  drawnAs,
  clearWhere,
}: BoxOptions = {}): File {
  const { positions, normals, indices } = box(half);
  if (isBroken) positions[0] = NaN;
  const parts: Uint8Array[] = [];
  const views: object[] = [];
  const accessors: object[] = [];
  const add = (values: Float32Array | Uint16Array, type: string, more: object = {}): number => {
    const components = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4 }[type]!;
    const byteOffset = parts.reduce((sum, { byteLength }) => sum + byteLength, 0);
    views.push({ buffer: 0, byteOffset, byteLength: values.byteLength });
    parts.push(new Uint8Array(values.buffer));
    const componentType = values instanceof Uint16Array ? 5123 : 5126;
    accessors.push({ bufferView: views.length - 1, componentType, count: values.length / components, type, ...more });
    return accessors.length - 1;
  };
  const floats = (values: readonly number[], type: string, more?: object): number =>
    add(Float32Array.from(values), type, more);
  const range = stated ?? { min: half.map((h) => -h), max: [...half] };
  const corners = positions.length / 3;
  const triangles = {
    attributes: {
      ...{ POSITION: floats(positions, 'VEC3', range), NORMAL: floats(normals, 'VEC3') },
      ...(clearWhere !== undefined && { TEXCOORD_0: floats(new Array<number>(2 * corners).fill(0), 'VEC2') }),
      ...(isSkinned && {
        JOINTS_0: add(new Uint16Array(4 * corners), 'VEC4'),
        WEIGHTS_0: floats(
          Array.from({ length: 4 * corners }, (_, k) => Number(k % 4 === 0)),
          'VEC4',
        ),
      }),
    },
    ...(drawnAs === 'points' ? { mode: 0 } : { indices: add(Uint16Array.from(indices), 'SCALAR') }),
    material: 0,
  };
  const primitives: object[] = [triangles];
  if (splat) {
    const attributes = {
      POSITION: floats(splat, 'VEC3', { min: splat, max: splat }),
      'KHR_gaussian_splatting:ROTATION': floats([0, 0, 0, 1], 'VEC4'),
      'KHR_gaussian_splatting:SCALE': floats([0.2, 0.2, 0.2], 'VEC3'),
      'KHR_gaussian_splatting:OPACITY': floats([0.99], 'SCALAR'),
      'KHR_gaussian_splatting:SH_DEGREE_0_COEF_0': floats([-1.7, 1.7, -1.7], 'VEC3'),
    };
    const extension = { kernel: 'ellipse', colorSpace: 'srgb_rec709_display' };
    primitives.push({ attributes, mode: 0, extensions: { KHR_gaussian_splatting: extension } });
  }
  const animations = moves === undefined ? [] : [animation(moves, isSkinned ? 1 : 0, floats)];
  const json = {
    asset: { version: '2.0' },
    scene: 0,
    scenes: [{ nodes: isSkinned ? [0, 1] : [0] }],
    nodes: isSkinned ? [{ mesh: 0, skin: 0 }, { name: 'bone' }] : [{ mesh: 0 }],
    ...(isSkinned && { skins: [{ joints: [1] }] }),
    meshes: [{ name: mesh, primitives }],
    materials: [{ name: wood, ...material(surface, color, alpha, cutoff), ...(clearWhere !== undefined && CLEAR) }],
    ...(clearWhere !== undefined && { textures: [{ source: 0 }], images: [{ uri: clearWhere }] }),
    extensionsUsed: ['KHR_materials_unlit', ...(splat ? ['KHR_gaussian_splatting'] : [])],
    ...(animations.length > 0 && { animations }),
    accessors,
    bufferViews: views,
    buffers: [{ byteLength: parts.reduce((sum, { byteLength }) => sum + byteLength, 0) }],
  };
  return new File([glb(json, parts)], 'box.glb');
}

/** Extensions of a material through which light passes where its texture is red. */
const CLEAR = {
  extensions: { KHR_materials_transmission: { transmissionFactor: 1, transmissionTexture: { index: 0 } } },
};

function material(
  surface: 'shining' | 'unlit' | 'rough',
  color: readonly number[],
  alpha: number,
  cutoff?: number,
): object {
  const base = surface === 'shining' ? [0, 0, 0] : color;
  return {
    pbrMetallicRoughness: { baseColorFactor: [...base, alpha], metallicFactor: 0 },
    ...(alpha < 1 && { alphaMode: 'BLEND' }),
    ...(cutoff !== undefined && { alphaMode: 'MASK', alphaCutoff: cutoff }),
    ...(surface === 'shining' && { emissiveFactor: color }),
    ...(surface === 'unlit' && { extensions: { KHR_materials_unlit: {} } }),
  };
}

function animation(
  moves: number,
  node: number,
  floats: (values: readonly number[], type: string, more?: object) => number,
): object {
  const input = floats([0, 1], 'SCALAR', { min: [0], max: [1] });
  const output = floats([0, 0, 0, moves, 0, 0], 'VEC3');
  return { channels: [{ sampler: 0, target: { node, path: 'translation' } }], samplers: [{ input, output }] };
}

/** JSON and its bytes as one file. */
function glb(json: object, parts: readonly Uint8Array[]): Blob {
  const padded = (bytes: Uint8Array, fill: number): Uint8Array => {
    const whole = new Uint8Array(4 * Math.ceil(bytes.length / 4)).fill(fill);
    whole.set(bytes);
    return whole;
  };
  const text = padded(new TextEncoder().encode(JSON.stringify(json)), 0x20);
  const size = parts.reduce((sum, { byteLength }) => sum + byteLength, 0);
  const body = new Uint8Array(4 * Math.ceil(size / 4));
  let offset = 0;
  for (const part of parts) {
    body.set(part, offset);
    offset += part.byteLength;
  }
  const head = Uint32Array.of(0x46546c67, 2, 12 + 8 + text.length + 8 + body.length);
  const chunk = (length: number, kind: number): Uint32Array => Uint32Array.of(length, kind);
  return new Blob([head, chunk(text.length, 0x4e4f534a), text, chunk(body.length, 0x004e4942), body] as BlobPart[]);
}
