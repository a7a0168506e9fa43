/** Splats in the frame of a page that draws with WebGL itself: hidden by its depth, and its state as it was. */
import type { Camera, GaussianCloud } from '@gaussian-splat/core';
import { packGaussians, type PageSource, type StreamedScene } from '@gaussian-splat/renderer';
import { packNodes, packWithDetail, treeSource } from '@gaussian-splat/renderer/tools';
import {
  DATA_WIDTH,
  GlGaussians,
  GlHost,
  GlRenderer,
  orderView,
  positionsIn,
  SplatOrder,
} from '@gaussian-splat/renderer/webgl';
import { assert, assertEqual } from '../../element/browser/support/harness.js';
import { pick } from '../../support/lod-folder.js';
import { cameraAt, proceduralScenes, resized, thinned } from '../../support/scenes.js';

const SPLATS = 4_000;
const WIDTH = 160;
/** Depth of the rectangle in the host's frame. */
const [X, Y] = [24, 40];
const GRAY = 102;
const REQUEST = { accumulation: 'rgba16float', shDegree: 3, resolutionScale: 1 } as const;

/** The worker of a page that sorts. */
const SORTER = `import { sortSplats } from '${location.origin}/packages/renderer/dist/webgl/index.js';
onmessage = ({ data: { port, positions } }) => sortSplats(port, positions);`;

/** The matrix of a camera for positions relative to an origin. */
const cameraOf = ({ worldToCamera: m }: Camera, origin: readonly number[]): Float64Array =>
  Float64Array.from(m, (value, i) =>
    i % 4 === 3 && i < 12 ? value + [0, 1, 2].reduce((sum, k) => sum + m[i - 3 + k] * origin[k], 0) : value,
  );

/** Parameters of a context that a call reads, except for constants. */
function queriesOf(gl: WebGL2RenderingContext, call: () => void): string[] {
  const names: string[] = [];
  const nameOf = (value: unknown): string =>
    Object.keys(WebGL2RenderingContext).find(
      (name) => (WebGL2RenderingContext as unknown as Record<string, unknown>)[name] === value,
    ) ?? String(value);
  const read = ['getParameter', 'getIndexedParameter', 'isEnabled', 'getError', 'getFramebufferAttachmentParameter'];
  for (const name of read) {
    const own = (gl as unknown as Record<string, (...all: unknown[]) => unknown>)[name];
    Object.assign(gl, { [name]: (...all: unknown[]) => (names.push(nameOf(all[0])), own.apply(gl, all)) });
  }
  call();
  for (const name of read) delete (gl as unknown as Record<string, unknown>)[name];
  return names.filter((name) => name !== 'MAX_TEXTURE_SIZE');
}

/** Bytes of a rectangle of a host's canvas, from its upper row on. */
function read(gl: WebGL2RenderingContext, x: number, y: number, { width, height }: Camera): Uint8Array {
  const bytes = new Uint8Array(4 * width * height);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  gl.readPixels(x, y, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
  const row = 4 * width;
  return bytes.map((_, i) => bytes[row * (height - 1 - Math.floor(i / row)) + (i % row)]);
}

function context(width: number, height: number, options: WebGLContextAttributes): WebGL2RenderingContext {
  const canvas = Object.assign(document.createElement('canvas'), { width, height });
  const gl = canvas.getContext('webgl2', options);
  if (gl === null) throw new Error('no WebGL 2 in this browser');
  return gl;
}

/** The image of the splats alone over a background, by the renderer in a context of its own. */
async function alone(cloud: GaussianCloud, camera: Camera, background: number): Promise<Uint8Array> {
  const gl = context(camera.width, camera.height, { antialias: false, depth: false });
  const packed = packGaussians(cloud);
  const renderer = new GlRenderer(gl, await GlGaussians.upload(gl, packed));
  const order = new Uint32Array(Math.ceil(packed.count / DATA_WIDTH) * DATA_WIDTH);
  const count = new SplatOrder(positionsIn(packed.geometry)).sort(orderView(camera, packed.origin), order);
  renderer.setOrder(order, count);
  renderer.render({ ...REQUEST, camera });
  renderer.present([background, background, background, 1]);
  const bytes = read(gl, 0, 0, camera);
  gl.getExtension('WEBGL_lose_context')?.loseContext();
  return bytes;
}

const PARAMETERS = [
  'ACTIVE_TEXTURE ARRAY_BUFFER_BINDING BLEND BLEND_DST_ALPHA BLEND_DST_RGB BLEND_EQUATION_ALPHA BLEND_EQUATION_RGB BLEND_SRC_ALPHA BLEND_SRC_RGB',
  'COLOR_CLEAR_VALUE COLOR_WRITEMASK CULL_FACE CURRENT_PROGRAM DEPTH_CLEAR_VALUE DEPTH_FUNC DEPTH_TEST DEPTH_WRITEMASK DRAW_FRAMEBUFFER_BINDING',
  'READ_FRAMEBUFFER_BINDING ELEMENT_ARRAY_BUFFER_BINDING PIXEL_PACK_BUFFER_BINDING PIXEL_UNPACK_BUFFER_BINDING POLYGON_OFFSET_FILL RASTERIZER_DISCARD',
  'RENDERBUFFER_BINDING SAMPLER_BINDING SCISSOR_BOX SCISSOR_TEST STENCIL_TEST TEXTURE_BINDING_2D UNIFORM_BUFFER_BINDING UNPACK_ALIGNMENT UNPACK_FLIP_Y_WEBGL',
  'UNPACK_PREMULTIPLY_ALPHA_WEBGL UNPACK_ROW_LENGTH VERTEX_ARRAY_BINDING VIEWPORT',
].flatMap((line) => line.split(' '));

/** All that a host may have set, as text; objects by their number. */
function stateOf(gl: WebGL2RenderingContext, known: Map<unknown, number>): string {
  const named = (value: unknown): unknown => {
    if (ArrayBuffer.isView(value)) return [...(value as Float32Array)];
    if (typeof value !== 'object' || value === null || Array.isArray(value)) return value;
    if (!known.has(value)) known.set(value, known.size);
    return `object ${known.get(value)}`;
  };
  const values = PARAMETERS.map((name) => [name, named(gl.getParameter(gl[name as 'BLEND']))]);
  const active = gl.getParameter(gl.ACTIVE_TEXTURE) as number;
  const units = Array.from({ length: 8 }, (_, i) => {
    gl.activeTexture(gl.TEXTURE0 + i);
    return named(gl.getParameter(gl.TEXTURE_BINDING_2D));
  });
  gl.activeTexture(active);
  return JSON.stringify([values, units, named(gl.getIndexedParameter(gl.UNIFORM_BUFFER_BINDING, 0))]);
}

/** A host that paints a gray box before a distance, in a state that suits no other. */
class Box {
  readonly #gl: WebGL2RenderingContext;
  readonly #program: WebGLProgram;

  constructor(gl: WebGL2RenderingContext) {
    this.#gl = gl;
    const program = (this.#program = gl.createProgram());
    const add = (type: GLenum, text: string): void => {
      const shader = gl.createShader(type)!;
      gl.shaderSource(shader, `#version 300 es\nprecision highp float;\n${text}`);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    };
    add(
      gl.VERTEX_SHADER,
      'uniform float z; void main() { vec2 p = vec2(gl_VertexID & 1, gl_VertexID >> 1); gl_Position = vec4(p - 0.5, z, 1.0); }',
    );
    add(gl.FRAGMENT_SHADER, `out vec4 color; void main() { color = vec4(vec3(${GRAY / 255}), 1.0); }`);
    gl.linkProgram(program);
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.CULL_FACE);
    gl.cullFace(gl.FRONT_AND_BACK);
    gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, true);
    gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, true);
    gl.activeTexture(gl.TEXTURE3);
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.bindSampler(1, gl.createSampler());
    gl.bindBufferBase(gl.UNIFORM_BUFFER, 0, gl.createBuffer());
    gl.blendFuncSeparate(gl.DST_COLOR, gl.ZERO, gl.ONE, gl.SRC_ALPHA);
  }

  /** @param depth of the window, 0 to 1 */
  paint(depth: number, { width, height }: Camera): void {
    const gl = this.#gl;
    gl.disable(gl.CULL_FACE);
    gl.useProgram(this.#program);
    gl.viewport(X, Y, width, height);
    gl.clearColor(0, 0, 0, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniform1f(gl.getUniformLocation(this.#program, 'z'), 2 * depth - 1);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    gl.enable(gl.CULL_FACE);
    gl.enable(gl.STENCIL_TEST);
    gl.stencilFunc(gl.NEVER, 1, 1);
    gl.colorMask(false, true, false, true);
  }
}

describe("splats in a host's frame", () => {
  const base = thinned(proceduralScenes[0](), SPLATS);
  const camera: Camera = { ...resized(base.cameras[0], WIDTH), near: 0.1, far: 1000 };
  const { worldToCamera: m } = camera;
  const { cloud } = base;
  const depths = Array.from({ length: cloud.count }, (_, i) => {
    const p = [0, 1, 2].map((k) => cloud.positions[3 * i + k] + cloud.origin[k]);
    return m[8] * p[0] + m[9] * p[1] + m[10] * p[2] + m[11];
  });
  // Between two splats that lie apart, so that the rounding of 24 bits hides neither.
  const sorted = depths.filter((depth) => depth > camera.near).sort((a, b) => a - b);
  const half = sorted.slice(Math.floor(0.45 * sorted.length), Math.floor(0.55 * sorted.length));
  const gaps = half.slice(1).map((depth, i) => depth - half[i]);
  const widest = gaps.indexOf(Math.max(...gaps));
  const middle = (half[widest] + half[widest + 1]) / 2;
  const stored = (1 / camera.near - 1 / middle) / (1 / camera.near - 1 / camera.far);

  for (const options of [
    { antialias: false, depth: true, stencil: true },
    { antialias: true, depth: true, stencil: false },
  ])
    it(`are hidden by its depth, ${JSON.stringify(options)}`, async () => {
      const [width, height] = [camera.width + 2 * X, camera.height + Y + 8];
      const gl = context(width, height, options);
      const box = new Box(gl);
      const host = new GlHost(gl);
      const known = new Map<unknown, number>();
      const before = stateOf(gl, known);
      const packed = packGaussians(cloud);
      const splats = await host.load(packed);
      assertEqual(stateOf(gl, known), before, 'state after loading');
      gl.colorMask(true, true, true, true);
      gl.disable(gl.STENCIL_TEST);
      box.paint(stored, camera);
      const drawn = stateOf(gl, known);
      assert(splats.draw(camera, { x: X, y: Y }), 'not sorted');
      assertEqual(stateOf(gl, known), drawn, 'state after a frame');
      const found = read(gl, X, Y, camera);
      const own = gl.createBuffer();
      const asked = splats.pick(camera.width / 2, camera.height / 2);
      assertEqual(stateOf(gl, known), drawn, 'state after the question of a pick');
      gl.bindBuffer(gl.PIXEL_PACK_BUFFER, own);
      const [place, beside] = [await asked, await splats.pick(-50, -50)];
      assert(gl.getParameter(gl.PIXEL_PACK_BUFFER_BINDING) === own, 'the buffer of the host');
      gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
      assertEqual(beside, null, 'a pick beside the scene');
      const m = camera.worldToCamera;
      const [px, py, pz] = [0, 1, 2].map((r) =>
        place!.position.reduce((sum, v, k) => sum + m[4 * r + k] * v, m[4 * r + 3]),
      );
      const off = [
        (camera.fx * px) / pz + camera.cx - camera.width / 2,
        (camera.fy * py) / pz + camera.cy - camera.height / 2,
      ];
      assert(pz > camera.near && off.every((pixels) => Math.abs(pixels) < 1e-6), `${off} pixels, ${pz} away`);
      assert(Math.abs(place!.distance - Math.hypot(px, py, pz)) < 1e-6 * pz, `${place!.distance} away`);
      const nearest = depths.reduce((best, depth) => Math.min(best, depth), Infinity);
      assert(pz >= nearest - 0.5 && place!.uncertainty >= 0, `${pz}, splats from ${nearest} on`);
      assertEqual(gl.getError(), gl.NO_ERROR, 'errors');

      const front = Array.from({ length: cloud.count }, (_, i) => i).filter((i) => depths[i] <= middle);
      const take = (values: Float32Array, numbers: number): Float32Array =>
        Float32Array.from(
          { length: numbers * front.length },
          (_, i) => values[numbers * front[Math.floor(i / numbers)] + (i % numbers)],
        );
      const nearer = {
        ...cloud,
        ...{ count: front.length, positions: take(cloud.positions, 3), scales: take(cloud.scales, 3) },
        ...{ rotations: take(cloud.rotations, 4), opacities: take(cloud.opacities, 1) },
        sh: take(cloud.sh, cloud.sh.length / cloud.count),
      } as GaussianCloud;
      const outside = await alone(cloud, camera, 0);
      const inside = await alone(nearer, camera, GRAY / 255);
      const isInside = (i: number): boolean => {
        const [x, y] = [(i / 4) % camera.width, Math.floor(i / 4 / camera.width)].map(Math.floor);
        return (
          Math.abs(x + 0.5 - camera.width / 2) < camera.width / 4 &&
          Math.abs(y + 0.5 - camera.height / 2) < camera.height / 4
        );
      };
      let [max, hidden] = [0, 0];
      // Antialiased edges of the box show both.
      const isEdge = (i: number): boolean =>
        options.antialias && [-4, 4].some((by) => isInside(i + by * camera.width) !== isInside(i));
      found.forEach((value, i) => {
        if (isEdge(i)) return;
        max = Math.max(max, Math.abs(value - (isInside(i) ? inside : outside)[i]));
        hidden += isInside(i) ? Math.abs(value - outside[i]) : 0;
      });
      assert(max <= 2, `${max} of 255 from our own image with that depth`);
      assert(hidden > 1000, 'the box hides nothing');
      const untouched = read(gl, 0, 0, { ...camera, width: X, height: Y });
      assert(
        untouched.every((value, i) => value === (i % 4 === 3 ? 255 : 0)),
        'pixels beside the rectangle are touched',
      );
      host.destroy();
      splats.destroy();
      gl.getExtension('WEBGL_lose_context')?.loseContext();
    });

  /** Every second splat of the scene, moved by `offset`. */
  function halfOf(parity: 0 | 1, offset: readonly [number, number, number]): GaussianCloud {
    const numbers = Array.from({ length: cloud.count }, (_, i) => i).filter((i) => i % 2 === parity);
    const take = (values: Float32Array): Float32Array => {
      const width = values.length / cloud.count;
      return Float32Array.from({ length: width * numbers.length }, (_, k) => {
        return values[width * numbers[Math.floor(k / width)] + (k % width)];
      });
    };
    const { positions, scales, rotations, opacities, sh } = cloud;
    const moved = take(positions).map((value, k) => value + offset[k % 3]);
    return {
      ...{ ...cloud, count: numbers.length, positions: moved, scales: take(scales), rotations: take(rotations) },
      ...{ opacities: take(opacities), sh: take(sh) },
    } as GaussianCloud;
  }

  /** Largest difference of two images, in 255ths. */
  const apart = (a: Uint8Array, b: Uint8Array): number =>
    a.reduce((max, value, i) => Math.max(max, Math.abs(value - b[i])), 0);

  it('of two scenes are in one order, as if they were one scene, and picks name the scene', async () => {
    const gl = context(camera.width, camera.height, { antialias: false, depth: true });
    const host = new GlHost(gl);
    const OFFSET = [3, -2, 5] as const;
    const parts = [halfOf(0, [0, 0, 0]), halfOf(1, OFFSET)].map((part) => packGaussians(part));
    const moved = Float64Array.from(camera.worldToCamera, (value, i) => {
      const row = camera.worldToCamera.slice(i - (i % 4), i - (i % 4) + 3) as number[];
      return i % 4 === 3 && i < 12 ? value - row.reduce((sum, v, k) => sum + v * OFFSET[k], 0) : value;
    });
    const cameras = [camera, { ...camera, worldToCamera: moved }];
    const paint = (draw: () => void): Uint8Array => {
      gl.clearColor(0, 0, 0, 1);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      draw();
      return read(gl, 0, 0, camera);
    };
    const splats = await host.load(parts);
    const found = paint(() => assert(splats.draw(cameras, { depth: null }), 'not sorted'));
    const expected = await alone(cloud, camera, 0);
    assert(apart(found, expected) <= 2, `${apart(found, expected)} of 255 from the one scene`);
    const separate = await Promise.all(parts.map((part) => host.load(part)));
    const over = paint(() => separate.forEach((one, k) => one.draw(cameras[k], { depth: null })));
    assert(apart(over, expected) > 20, 'the order of two scenes makes no difference');
    const seen = new Set<number>();
    for (let k = 0; k < 60; k++) {
      const [x, y] = [((k % 10) + 0.5) * (camera.width / 10), (Math.floor(k / 10) + 0.5) * (camera.height / 6)];
      const place = await splats.pick(x, y);
      if (!place) continue;
      seen.add(place.scene);
      const at = cameras[place.scene].worldToCamera;
      const [px, py, pz] = [0, 1, 2].map((r) =>
        place.position.reduce((sum, v, c) => sum + at[4 * r + c] * v, at[4 * r + 3]),
      );
      const off = [(camera.fx * px) / pz + camera.cx - x, (camera.fy * py) / pz + camera.cy - y];
      assert(
        off.every((pixels) => Math.abs(pixels) < 1e-6),
        `${off} pixels from the pick`,
      );
    }
    assertEqual([...seen].sort(), [0, 1], 'scenes of picks');
    let refused = '';
    try {
      splats.draw(camera);
    } catch (error) {
      refused = (error as Error).message;
    }
    assert(/a camera for each of 2 scenes/.test(refused), refused);
    assertEqual(gl.getError(), gl.NO_ERROR, 'errors');
    for (const one of [splats, ...separate]) one.destroy();
    host.destroy();
    gl.getExtension('WEBGL_lose_context')?.loseContext();
  });

  it('of a streamed scene are those of the whole scene, or a coarser level if they do not fit', async () => {
    const whole = { ...cloud, origin: [0, 0, 0] as const };
    const middle = [0, 1, 2].map(
      (axis) => cloud.positions.reduce((sum, x, i) => sum + (i % 3 === axis ? x : 0), 0) / cloud.count,
    );
    const quarters: number[][] = [[], [], [], []];
    for (let i = 0; i < cloud.count; i++) {
      const [x, , z] = whole.positions.subarray(3 * i);
      quarters[(x > middle[0] ? 1 : 0) + (z > middle[2] ? 2 : 0)].push(i);
    }
    const SIDE = 100;
    const volumes = quarters.map((_, k) => {
      const [x, z] = [k & 1 ? SIDE : -SIDE, k & 2 ? SIDE : -SIDE];
      const center = [middle[0] + x, middle[1], middle[2] + z];
      return [...center, SIDE, 0, 0, 0, 2 * SIDE, 0, 0, 0, SIDE, 3 * SIDE];
    });
    const { shDegree, antialiased } = whole;
    const bounds = { min: [-1, -1, -1], max: [1, 1, 1], center: [0, 0, 0], radius: 1 } as const;
    const format = { shDegree, shPrecision: 'float16', geometry: 'quantized', antialiased } as const;
    const scene: StreamedScene = { ...format, splats: cloud.count, origin: [0, 0, 0], bounds };
    const coarse = pick(
      whole,
      Array.from({ length: Math.ceil(cloud.count / 4) }, (_, k) => 4 * k),
      2,
    );
    const content = { cloud: coarse, volumes, isAdded: false, error: Infinity };
    const opened = {
      scene,
      first: packNodes([content], scene),
      children: quarters.map((own) => ({ children: [], own })),
      isComplete: true,
    };
    const fetched: number[] = [];
    const source = (isExact = false): PageSource => {
      const own: StreamedScene = isExact ? { ...scene, geometry: undefined } : scene;
      const first = isExact ? packNodes([content], own) : opened.first;
      return treeSource({ ...opened, scene: own, first }, async ({ own: indices }, above) => {
        fetched.push(indices.length);
        const finest = { cloud: pick(whole, indices), volumes: [], isAdded: false, error: 0 };
        return Promise.resolve({ ...packNodes([finest], own, above), found: [] });
      });
    };
    const at = { ...camera, worldToCamera: cameraOf(camera, cloud.origin) };
    const expected = await alone(whole, at, 0);
    const worker = new Worker(URL.createObjectURL(new Blob([SORTER], { type: 'text/javascript' })), { type: 'module' });
    const found: number[] = [];
    const maxSplats = 1024 * (Math.ceil(coarse.count / 1024) + 4);
    for (const { isExact, ...options } of [{}, { worker }, { maxSplats }, { worker, isExact: true }]) {
      fetched.length = 0;
      const gl = context(camera.width, camera.height, { antialias: false, depth: true });
      const host = new GlHost(gl, { restores: !isExact });
      let changes = 0;
      const splats = await host.stream(source(isExact), { ...options, onChange: () => void changes++ });
      const draw = (): boolean => {
        gl.clearColor(0, 0, 0, 1);
        gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
        return splats.draw(at, { depth: null, depthRange: [0, 1] }, { detail: 0.01 });
      };
      for (let calm = 0; calm < 5; await new Promise((resolve) => setTimeout(resolve, 60)))
        calm = draw() && splats.progress!.coming === 0 ? calm + 1 : 0;
      const image = read(gl, 0, 0, camera);
      if (isExact) assertEqual(queriesOf(gl, draw).join(), '', 'queries of the state, which wait for the GPU process');
      const sum = image.reduce((total, value, i) => total + (value - expected[i]) ** 2, 0);
      found.push(10 * Math.log10(255 ** 2 / (sum / image.length)));
      const { limit, resident, bytes } = splats.progress!;
      const text = `${resident} pages, ${limit}, ${bytes} bytes, ${fetched.join(' ')}, ${found.join(' ')} dB`;
      assertEqual(gl.getError(), gl.NO_ERROR, 'errors');
      assert(new Set(fetched).size === fetched.length && changes >= fetched.length, `each page once: ${text}`);
      if ('maxSplats' in options) assert(limit === 'memory' && resident < 5, text);
      else assert(limit === null && resident === 5, text);
      splats.destroy();
      host.destroy();
      gl.getExtension('WEBGL_lose_context')?.loseContext();
    }
    worker.terminate();
    console.log(`streamed in a host: ${found.map((value) => value.toFixed(1)).join(', ')} dB`);
    assert(found[0] > 50 && found[1] > 50 && found[3] > 50, found.join(' '));
    assert(found[2] < found[0] && found[2] > 12, found.join(' '));
  });

  it('of a streamed scene are coarser while late frames move, and as fine as asked at rest', async () => {
    const gl = context(WIDTH, WIDTH, { antialias: false, depth: true });
    const host = new GlHost(gl);
    const whole = { ...cloud, origin: [0, 0, 0] as const };
    const { shDegree, antialiased } = whole;
    const bounds = { min: [-1, -1, -1], max: [1, 1, 1], center: [0, 0, 0], radius: 1 } as const;
    const format = { shDegree, shPrecision: 'float16', geometry: 'quantized', antialiased } as const;
    const scene: StreamedScene = { ...format, splats: cloud.count, origin: [0, 0, 0], bounds };
    const first = packNodes([{ cloud: whole, volumes: [], isAdded: false, error: 0 }], scene);
    const never = (): Promise<never> => Promise.reject(new Error('no node below'));
    const splats = await host.stream(treeSource({ scene, first, children: [], isComplete: true }, never));
    const at = { ...camera, worldToCamera: cameraOf(camera, cloud.origin) };
    const errors = (count: number, step: number, frameMs: number): number[] =>
      Array.from({ length: count }, (_, k) => {
        const moved = Float64Array.from(at.worldToCamera, (value, i) => value + (i === 3 ? step * k : 0));
        gl.clear(gl.COLOR_BUFFER_BIT);
        splats.draw({ ...at, worldToCamera: moved }, { depth: null }, { detail: 2, frameMs });
        return splats.progress!.budgetError;
      });
    assertEqual(Math.max(...errors(5, 1e-3, 1e6)), 0, 'in time');
    // No frame takes less than this.
    const late = errors(40, 1e-3, 1e-6);
    assert(late[3] > 2 && late.at(-1)! > 7.9 && late.at(-1)! <= 8, `up to four times the error: ${late.join(' ')}`);
    errors(1, 0, 1e-6);
    const coarse = read(gl, 0, 0, camera);
    const still = errors(30, 0, 1e-6);
    assert(still[1] > 2 && still.at(-1) === 0, `${still[1]} and ${still.at(-1)} at rest`);
    const fine = read(gl, 0, 0, camera);
    errors(1, 0, Infinity);
    const exact = read(gl, 0, 0, camera);
    assert(
      exact.every((value, i) => value === fine[i]),
      'the image at rest is whole',
    );
    assert(
      coarse.some((value, i) => value !== fine[i]),
      'the image in motion has fewer pixels',
    );
    splats.destroy();
    host.destroy();
  });

  it('with levels of detail are those of the scene, or as near as the pixels that they may be off', async () => {
    const gl = context(WIDTH, WIDTH, { antialias: false, depth: true });
    const host = new GlHost(gl);
    const whole = proceduralScenes[0]().cloud;
    const afar = { ...resized(cameraAt([0.3, -1, -40], [0, 0, 0]), WIDTH), near: 0.1, far: 1000 };
    const packed = packWithDetail(whole);
    assert(packed.count > whole.count && packed.details, 'levels');
    const splats = await host.load([packed, packGaussians(halfOf(0, [0, 0, 0]))]);
    const draw = (detail: number): Uint8Array => {
      gl.clearColor(0, 0, 0, 1);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      // The second scene is behind the camera.
      const behind = Float64Array.from(afar.worldToCamera);
      behind[11] -= 1e4;
      splats.draw([afar, { ...afar, worldToCamera: behind }], { depth: null }, { detail });
      return read(gl, 0, 0, afar);
    };
    const expected = await alone(whole, afar, 0);
    assert(apart(draw(0), expected) <= 1, `${apart(draw(0), expected)} of 255 from the scene without levels`);
    const squares = [0.5, 4, 64].map((detail) => {
      const image = draw(detail);
      return image.reduce((sum, value, i) => sum + (value - expected[i]) ** 2, 0) / image.length;
    });
    const decibels = squares.map((square) => 10 * Math.log10(255 ** 2 / square));
    console.log(`levels in a host: ${decibels.map((value) => value.toFixed(1)).join(', ')} dB at 0.5, 4 and 64 px`);
    assert(decibels[0] > 30 && decibels[2] < decibels[0], `${decibels} dB`);
    splats.destroy();
    host.destroy();
    gl.getExtension('WEBGL_lose_context')?.loseContext();
  });

  it('are sorted by a worker of the page, in the order of the main thread', async () => {
    const gl = context(camera.width, camera.height, { antialias: false, depth: true });
    const host = new GlHost(gl);
    const code = new URL('../../../packages/renderer/dist/webgl/index.js', import.meta.url).href;
    const lines = [
      `import { sortSplats } from '${code}';`,
      'onmessage = ({ data: { port, positions } }) => sortSplats(port, positions);',
    ];
    const script = URL.createObjectURL(new Blob(lines, { type: 'text/javascript' }));
    const worker = new Worker(script, { type: 'module' });
    const splats = await host.load(packGaussians(cloud), { worker });
    gl.clearColor(0, 0, 0, 1);
    const paint = (): boolean => {
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      return splats.draw(camera, { depth: null });
    };
    assert(!paint(), 'an order before the worker has answered');
    for (let tries = 0; !paint(); tries++) {
      assert(tries < 1_000, 'an order of the worker');
      await new Promise((resolve) => setTimeout(resolve, 20));
    }
    const found = read(gl, 0, 0, camera);
    const expected = await alone(cloud, camera, 0);
    const off = found.reduce((max, value, i) => Math.max(max, Math.abs(value - expected[i])), 0);
    assert(off <= 1 && found.some((value, i) => i % 4 < 3 && value > 50), `${off} of 255`);
    assert(paint(), 'the same view is sorted once');
    worker.terminate();
    splats.destroy();
    host.destroy();
    gl.getExtension('WEBGL_lose_context')?.loseContext();
  });
});
