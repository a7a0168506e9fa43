import { constants, layouts, rasterizeQuads } from '../generated/shaders.js';
import { BUFFER_USAGE, perDevice, SHADER_STAGE, ShaderProgram, type Overrides } from '../gpu/kernel.js';
import { writeStruct } from '../gpu/struct.js';
import type {
  AccumulationFormat,
  Painting,
  PaintingDepth,
  QuadsWithDepth,
  Rasterizer,
  RasterizerInputs,
  Slice,
} from './rasterizer.js';

const { QUAD_BATCH } = constants;
/** Number of indices of the two triangles of a quad. */
const INDICES_PER_QUAD = 6;

type Program = ShaderProgram<typeof rasterizeQuads>;

/** Rasterizes splats as quads with the hardware, back to front, and blends them into a float texture. */
export class QuadsRasterizer implements Rasterizer {
  readonly name = 'quads';
  readonly #device: GPUDevice;
  readonly #program: Program;
  readonly #format: AccumulationFormat;
  readonly #indices: GPUBuffer;
  readonly #uniform: GPUBuffer;
  readonly #uniformBytes = new ArrayBuffer(layouts.RasterView.size);
  #bindings: GPUBindGroup | undefined;
  #inputs: RasterizerInputs | undefined;

  constructor(device: GPUDevice, format: AccumulationFormat) {
    this.#device = device;
    this.#format = format;
    this.#program = perDevice(
      device,
      'quads',
      () => new ShaderProgram(device, rasterizeQuads, SHADER_STAGE.vertex | SHADER_STAGE.fragment),
    );
    this.prepare();
    this.#indices = perDevice(device, 'quads indices', () => makeIndices(device));
    this.#uniform = device.createBuffer({
      label: 'gs.rasterize.view',
      size: layouts.RasterView.size,
      usage: BUFFER_USAGE.uniform | BUFFER_USAGE.copyDestination,
    });
  }

  /** Bytes of the uniform buffer; quads need no other memory. */
  get byteLength(): number {
    return this.#uniform.size;
  }

  /** Returns false, because blending always needs an accumulation texture. */
  finishes(): boolean {
    return false;
  }

  pingPongBytes(): number {
    return 0;
  }

  bind(inputs: RasterizerInputs): void {
    this.#inputs = inputs;
    const { plan, splats, order } = inputs;
    this.#bindings = this.#program.bind({ raster: this.#uniform, plan, splats, order });
  }

  /** Compiles the pipeline, which is the same for all settings. */
  prepare(): void {
    this.#pipeline();
  }

  /** Does nothing: quads are drawn from the output of the earlier stages. */
  prepareFrame(): void {}

  record(encoder: GPUCommandEncoder, { surface, timer, depth, depths }: Painting, slice: Slice): void {
    const { view, width, height } = surface;
    const layers = depth?.layers ?? 0;
    // A frame with layers is not divided, because each slice contains splats on both sides of a layer.
    if (layers > 0 && slice.index > 0) return;
    const [index, slices] = layers > 0 ? [0, 1] : [slice.index, slice.count];
    writeStruct(layouts.RasterView, { viewport: [width, height], slice: index, slices }, this.#uniformBytes);
    this.#device.queue.writeBuffer(this.#uniform, 0, this.#uniformBytes);
    const pass = encoder.beginRenderPass({
      label: 'gs.rasterize',
      // Clears to black with full transmittance.
      colorAttachments: [
        {
          view,
          clearValue: { r: 0, g: 0, b: 0, a: 1 },
          loadOp: slice.index === 0 ? 'clear' : 'load',
          storeOp: 'store',
        },
      ],
      timestampWrites: timer?.timestampWrites('rasterize'),
    });
    if (this.#bindings !== undefined && this.#inputs !== undefined) {
      const { plan, splats, order, capacity } = this.#inputs;
      const deep = depth?.quadsProgram;
      const resources = { raster: this.#uniform, plan, splats, order };
      // The image may cover only a part of the texture.
      pass.setViewport(0, 0, width, height, 0, 1);
      pass.setIndexBuffer(this.#indices, 'uint16');
      // Layers of meshes are blended between the splats behind and in front of them.
      for (let part = layers; part >= 0; part--) {
        if (capacity > 0) {
          pass.setPipeline(this.#pipeline(deep, { layers, part }));
          pass.setBindGroup(0, deep && depths ? deep.bind(resources, depth!, depths) : this.#bindings);
          // Draws as many quads as the capacity; the vertices of missing splats are clipped.
          pass.drawIndexed(QUAD_BATCH * INDICES_PER_QUAD, Math.ceil(capacity / QUAD_BATCH));
        }
        if (part === 0) break;
        pass.setPipeline(this.#layerPipeline(depth!, { layers, nth: part - 1 }));
        pass.setBindGroup(0, depth!.layerBindings);
        pass.draw(3);
      }
    }
    pass.end();
  }

  destroy(): void {
    this.#uniform.destroy();
  }

  #pipeline(deep?: QuadsWithDepth, constants: Overrides = {}): GPURenderPipeline {
    const own = deep ? constants : {};
    return perDevice(this.#device, `quads ${this.#format}${deep?.name ?? ''} ${JSON.stringify(own)}`, () =>
      makePipeline(this.#device, deep ?? this.#program, this.#format, own),
    );
  }

  #layerPipeline({ layerProgram }: PaintingDepth, constants: Overrides): GPURenderPipeline {
    return perDevice(this.#device, `layers ${this.#format} ${JSON.stringify(constants)}`, () =>
      makePipeline(this.#device, layerProgram, this.#format, constants),
    );
  }
}

function makePipeline(
  device: GPUDevice,
  program: Pick<Program, 'module' | 'pipelineLayout'>,
  format: AccumulationFormat,
  constants: Overrides,
): GPURenderPipeline {
  const { module, pipelineLayout } = program;
  const blend: GPUBlendState = {
    color: { srcFactor: 'one', dstFactor: 'one-minus-src-alpha', operation: 'add' },
    // Transmittance keeps its relative precision as a product; 1 - transmittance would lose it near opacity 1.
    alpha: { srcFactor: 'zero', dstFactor: 'one-minus-src-alpha', operation: 'add' },
  };
  return device.createRenderPipeline({
    label: `gs.rasterize.quads.${format}`,
    layout: pipelineLayout,
    vertex: { module, entryPoint: 'vertex' },
    fragment: { module, entryPoint: 'fragment', targets: [{ format, blend }], constants },
    primitive: { topology: 'triangle-list', cullMode: 'none' },
  });
}

/** Creates the indices for a batch of quads: each has the triangles 0, 1, 2 and 2, 1, 3 of its corners. */
function makeIndices(device: GPUDevice): GPUBuffer {
  const indices = Uint16Array.from(
    { length: QUAD_BATCH * INDICES_PER_QUAD },
    (_, i) => 4 * Math.floor(i / INDICES_PER_QUAD) + [0, 1, 2, 2, 1, 3][i % INDICES_PER_QUAD],
  );
  const buffer = device.createBuffer({
    label: 'gs.rasterize.indices',
    size: indices.byteLength,
    usage: BUFFER_USAGE.index,
    mappedAtCreation: true,
  });
  new Uint16Array(buffer.getMappedRange()).set(indices);
  buffer.unmap();
  return buffer;
}
