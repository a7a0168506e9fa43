/**
 * Mesh files are untrusted data, as scene files are. SECURITY.md: "Pages set their own limits", "Manifests name files of their own server", "Downloads end", "A scene that asks for too much
 * harms itself".
 * SECURITY.md: "An oversized scene affects only itself".
 */
import '@gaussian-splat/element/scenes.js';
import { GaussianSplatElement } from '@gaussian-splat/element';
import type { SplatMeshElement } from '@gaussian-splat/element/scenes.js';
import { itInLab } from '../../support/extent-in-pages.js';
import { boxGlb } from './support/glb.js';
import { assert, assertEqual, claimComing, FIXTURES, frames, until } from './support/harness.js';
import { holdings } from './support/ledger.js';
import { comesToShow, type Rgb } from './support/screen.js';

const FOLDER = '/net/kept/meshes/';
const keep = (name: string, body: BodyInit): Promise<unknown> => fetch(FOLDER + name, { method: 'PUT', body });

const triangle = (await (await fetch(`${FIXTURES}triangle.gltf`)).json()) as object;
const CORNERS = Float32Array.of(0, 0, 0, 1, 0, 0, 0, 1, 0);
const withBuffer = (uri: string): string => JSON.stringify({ ...triangle, buffers: [{ byteLength: 36, uri }] });

/** A mesh alone; removed by the test after each case. */
async function meshOf(src: string | File): Promise<SplatMeshElement> {
  const element = document.createElement('gaussian-splat');
  element.style.cssText = 'display: block; width: 120px; height: 100px';
  const mesh = document.createElement('splat-mesh') as SplatMeshElement;
  mesh.src = src;
  element.append(mesh);
  document.body.append(element);
  return mesh;
}

async function reasonOf(src: string | File): Promise<string> {
  const mesh = await meshOf(src);
  await until(() => mesh.loaded || mesh.error !== null, 'the mesh, or its error', 60_000);
  const reason = mesh.error?.reason ?? 'shown';
  mesh.parentElement!.remove();
  return reason;
}

describe('files of meshes', () => {
  afterEach(() => {
    GaussianSplatElement.sceneLimits = {};
    document.body.replaceChildren();
  });

  itInLab('textures within a GLB, buffers in the JSON, and meshopt are shown', async () => {
    const textured = await meshOf(`${FIXTURES}textured.glb`);
    await until(() => textured.loaded || textured.error !== null, 'the textured mesh', 60_000);
    assertEqual(textured.error, null, `${textured.error?.message}`);
    const isDrawn = ([r, g, b]: Rgb): boolean => r + g + b > 60;
    assert(
      await comesToShow(textured.parentElement!, (screen) => screen.middleOf(isDrawn) !== null),
      'the textured mesh is drawn',
    );
    textured.parentElement!.remove();
    await keep('data.gltf', JSON.stringify(triangle));
    assertEqual(await reasonOf(`${FOLDER}data.gltf`), 'shown', 'a buffer in the JSON');
    assertEqual(await reasonOf(`${FIXTURES}meshopt.glb`), 'shown', 'meshopt');
    assertEqual(await reasonOf(`${FIXTURES}draco.glb`), 'shown', 'Draco');
  });

  itInLab('a thousand lights are as much code for the GPU as one', async () => {
    const { createShaderModule } = GPUDevice.prototype;
    const codeOf = async (lights: number): Promise<number> => {
      let length = 0;
      GPUDevice.prototype.createShaderModule = function (descriptor) {
        length += descriptor.code.length;
        return createShaderModule.call(this, descriptor);
      };
      const own = { extensions: { KHR_lights_punctual: { light: 0 } } };
      const children = Array.from({ length: lights }, (_, k) => k + 1);
      const lit = {
        ...{ ...triangle, extensionsUsed: ['KHR_lights_punctual'], materials: undefined },
        extensions: { KHR_lights_punctual: { lights: [{ type: 'point' }] } },
        ...{ scenes: [{ nodes: [0] }], nodes: [{ mesh: 0, children }, ...children.map(() => own)] },
        meshes: [{ primitives: [{ attributes: { POSITION: 0 } }] }],
      };
      await keep(`lit-${lights}.gltf`, JSON.stringify(lit));
      assertEqual(await reasonOf(`${FOLDER}lit-${lights}.gltf`), 'shown', `${lights} lights`);
      if (lights > 16) await claimComing(/984 lights of a mesh are left out/);
      return length;
    };
    try {
      // The first mesh compiles what all meshes share.
      await codeOf(2);
      const [one, many] = [await codeOf(1), await codeOf(1000)];
      assert(one > 0 && many <= 1.01 * one, `${many} characters of WGSL for 1,000 lights, ${one} for one`);
    } finally {
      GPUDevice.prototype.createShaderModule = createShaderModule;
    }
  });

  itInLab('a worker of one file has no decoders: the page decodes', async () => {
    const { sceneLoader } = GaussianSplatElement;
    const refusals: string[] = [];
    const spawn = (): Worker => {
      const worker = new Worker('/packages/element/dist/loading/scene-worker.bundle.js', { type: 'module' });
      worker.addEventListener('message', ({ data }: MessageEvent<{ type: string; error?: { where: string } }>) => {
        if (data.type === 'error') refusals.push(data.error!.where);
      });
      return worker;
    };
    GaussianSplatElement.sceneLoader = new (sceneLoader.constructor as new (spawn: () => Worker) => typeof sceneLoader)(
      spawn,
    );
    try {
      for (const file of ['draco.glb', 'ktx2.glb']) assertEqual(await reasonOf(FIXTURES + file), 'shown', file);
      assertEqual(refusals, ['the decoder of Draco', 'the decoder of KTX2'], 'refusals of the worker');
    } finally {
      GaussianSplatElement.sceneLoader = sceneLoader;
    }
  });

  itInLab('textures in KTX2 are shown upright, with their colors', async () => {
    const mesh = await meshOf(`${FIXTURES}ktx2.glb`);
    await until(() => mesh.loaded || mesh.error !== null, 'the mesh', 60_000);
    assertEqual(mesh.error, null, `${mesh.error?.message}`);
    const max =
      (channel: number) =>
      (color: Rgb): boolean =>
        color.every((value, k) => k === channel || value < color[channel] / 2) && color[channel] > 60;
    const isShown = await comesToShow(mesh.parentElement!, (screen) => {
      const [red, green, blue] = [0, 1, 2].map((channel) => screen.middleOf(max(channel)));
      if (!red || !green || !blue) return false;
      // The first row of the image is its top: red, then green; blue is below red.
      return red.x < green.x && red.y < blue.y && Math.abs(red.y - green.y) < 10;
    });
    assert(isShown, 'red at the top left, green beside it, blue below');
  });

  itInLab('ask their own server alone, and those that the page allows', async () => {
    const foreign = await (await fetch('/net/other-origin')).text();
    await keep('corners.bin', CORNERS);
    await keep('own.gltf', withBuffer('corners.bin'));
    await keep('foreign.gltf', withBuffer(`${foreign}/fixtures/compass.splat`));
    assertEqual(await reasonOf(`${FOLDER}own.gltf`), 'shown', 'a buffer beside it');
    const isAsked = (): boolean =>
      performance.getEntriesByType('resource').some(({ name }) => name.startsWith(`${foreign}/fixtures`));
    assertEqual(await reasonOf(`${FOLDER}foreign.gltf`), 'decode/unsupported', 'one on another server');
    assert(!isAsked(), 'no request leaves the server');
    GaussianSplatElement.sceneLimits = { origins: [foreign] };
    assertEqual(await reasonOf(`${FOLDER}foreign.gltf`), 'shown', 'one that the page allows');
  });

  itInLab('cost no more than the budgets allow, of the load, the page and the GPU', async () => {
    await keep(
      'many.gltf',
      JSON.stringify({ ...triangle, accessors: [{ componentType: 5126, count: 5e7, type: 'VEC3' }] }),
    );
    assertEqual(await reasonOf(`${FOLDER}many.gltf`), 'out-of-memory/budget', 'the budget of the load');
    GaussianSplatElement.sceneLimits = { maxBytes: 1_000 };
    assertEqual(await reasonOf(boxGlb()), 'out-of-memory/budget', 'sceneLimits.maxBytes');
    GaussianSplatElement.sceneLimits = {};
    const before = GaussianSplatElement.memoryBudget;
    GaussianSplatElement.memoryBudget = 100;
    assertEqual(await reasonOf(boxGlb()), 'out-of-memory/budget', 'memoryBudget');
    GaussianSplatElement.memoryBudget = before;
    const box = await meshOf(boxGlb());
    await until(() => box.loaded, 'a mesh within them', 60_000);
    assert(holdings().bytes > 0, 'the ledger of the device has the mesh');
  });

  itInLab('triangles beyond the budget leave the splats of the same file, and the page can know', async () => {
    const bytes = new Uint8Array(await boxGlb({ splat: [0, 0, 0] }).arrayBuffer());
    const length = new DataView(bytes.buffer).getUint32(12, true);
    const text = new TextDecoder().decode(bytes.subarray(20, 20 + length));
    // Accessors without a view are 90 million zeros. All of the corners' attributes have the same count.
    const corners = text.replace(
      /"bufferView":\d+,"componentType":5126,"count":24/g,
      '"componentType":5126,"count":90000000',
    );
    const changed = corners.trimEnd().padEnd(length);
    assert(changed.length === length && corners !== text, 'as long as before');
    bytes.set(new TextEncoder().encode(changed), 20);
    const element = document.createElement('gaussian-splat');
    element.src = new File([bytes], 'both.glb');
    document.body.append(element);
    await until(() => element.loaded || element.error !== null, 'the splats', 60_000);
    assertEqual(element.error, null, 'error');
    await until(
      () => element.stats?.warnings.some((text) => /triangles are not shown/.test(text)) === true,
      'a warning',
    );
    await claimComing(/both\.glb.*out-of-memory\/budget/);
  });

  itInLab('removal ends their requests', async () => {
    await keep('stuck.gltf', withBuffer('/net/stuck/mesh'));
    const mesh = await meshOf(`${FOLDER}stuck.gltf`);
    const open = async (): Promise<number> => Number(await (await fetch('/net/stuck/mesh/open')).text());
    let count = 0;
    const isOpen = async (expected: number): Promise<void> => {
      for (let i = 0; i < 100 && count !== expected; i++) {
        await frames();
        count = await open();
      }
      assertEqual(count, expected, 'open connections');
    };
    await isOpen(1);
    mesh.parentElement!.remove();
    await new Promise((resolve) => setTimeout(resolve, GaussianSplatElement.releaseDelay));
    await isOpen(0);
  });
});
