import { GaussianSplatError } from '@gaussian-splat/core';
import { deviceReading, type DepthPlanes } from '../depth-reading.js';
import { GlProgram, makeTarget, makeTexture, requireMemory } from './gl.js';
import type { GlFrameRequest, GlFrameTarget, GlQuads, GlQuadsFrame } from './gl-renderer.js';
import { hostedQuadsFragment, hostedQuadsVertex, HostedView } from './shaders.js';

const TEXTURES = ['shapes', 'paints', 'order', 'stored_depth'];

/** Destination of splats in a host's frame, and the host's depth. */
export interface GlHostFrame extends Omit<GlFrameTarget, 'keeps'>, DepthPlanes {
  /**
   * Depth that hides splats. `framebuffer`, the default: the depth buffer of the framebuffer, which is copied. A depth
   * texture without comparison: it must be as large as the region of the framebuffer up to the upper right corner of
   * the rectangle. Null: no depth.
   */
  readonly depth?: 'framebuffer' | WebGLTexture | null | undefined;
  /** `DEPTH_RANGE` of the host's objects. Default: that of the context, a query that waits for the GPU process. */
  readonly depthRange?: readonly [near: number, far: number] | undefined;
}

/** A copy of the depth of a framebuffer. */
interface DepthCopy {
  readonly texture: WebGLTexture;
  readonly target: WebGLFramebuffer;
  readonly of: WebGLFramebuffer | null;
  readonly width: number;
  readonly height: number;
}

/** Hides splats by the depth of a host: copies it if it is no texture, and draws quads with a program that compares it. */
export class HostDepth {
  readonly #gl: WebGL2RenderingContext;
  #program: GlProgram<typeof HostedView> | undefined;
  #copy: DepthCopy | undefined;

  constructor(gl: WebGL2RenderingContext) {
    this.#gl = gl;
  }

  /**
   * Returns the program for the quads of a frame; undefined for a frame without depth.
   * @throws GaussianSplatError `argument/value` for a framebuffer whose depth cannot be copied.
   */
  quads(request: GlFrameRequest, frame: GlHostFrame): GlQuads | undefined {
    const { depth = 'framebuffer', x = 0, y = 0 } = frame;
    if (depth === null) return undefined;
    const texture = depth === 'framebuffer' ? this.#copyDepth(request, frame) : depth;
    const gl = this.#gl;
    const { camera: whole } = request;
    this.#program ??= new GlProgram(gl, [hostedQuadsVertex, hostedQuadsFragment], HostedView, TEXTURES);
    this.#program.check();
    const program = this.#program;
    return {
      use({ camera, count, textures }: GlQuadsFrame): void {
        const values = {
          ...{ viewport: [camera.width, camera.height], count },
          ...deviceReading(frame, whole, frame.depthRange ?? (gl.getParameter(gl.DEPTH_RANGE) as [number, number])),
          scale: [whole.width / camera.width, whole.height / camera.height],
          corner: [x, y + whole.height],
        };
        program.use(values, [...textures, texture]);
      },
    };
  }

  destroy(): void {
    this.#program?.destroy();
    this.#program = undefined;
    this.#forgetCopy();
  }

  /**
   * Copies the depth of a framebuffer. A rectangle of a multisampled framebuffer can be copied only to the same
   * position, so the copy begins at the corner of the framebuffer.
   */
  #copyDepth({ camera }: GlFrameRequest, { framebuffer = null, x = 0, y = 0 }: GlHostFrame): WebGLTexture {
    const gl = this.#gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    const [width, height] = [x + camera.width, y + camera.height];
    const blit = ({ target }: DepthCopy): void => {
      gl.bindFramebuffer(gl.READ_FRAMEBUFFER, framebuffer);
      gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, target);
      gl.blitFramebuffer(x, y, width, height, x, y, width, height, gl.DEPTH_BUFFER_BIT, gl.NEAREST);
    };
    const copy = this.#copy;
    if (copy?.of === framebuffer && copy.width === width && copy.height === height) {
      blit(copy);
      return copy.texture;
    }
    // The formats must be equal, and the depth format of a canvas may differ from the one its attributes suggest.
    for (const format of depthFormats(gl, framebuffer === null)) {
      const made = this.#makeCopy(format, framebuffer, width, height);
      blit(made);
      if (gl.getError() === gl.NO_ERROR) return made.texture;
    }
    throw noDepth('one that cannot be copied');
  }

  #makeCopy(format: GLenum, of: WebGLFramebuffer | null, width: number, height: number): DepthCopy {
    const gl = this.#gl;
    this.#forgetCopy();
    const texture = makeTexture(gl, format, [width, height]);
    const target = makeTarget(gl, []);
    const hasStencil = format === gl.DEPTH24_STENCIL8 || format === gl.DEPTH32F_STENCIL8;
    const attachment = hasStencil ? gl.DEPTH_STENCIL_ATTACHMENT : gl.DEPTH_ATTACHMENT;
    gl.framebufferTexture2D(gl.FRAMEBUFFER, attachment, gl.TEXTURE_2D, texture, 0);
    requireMemory(gl, `depth of ${width} x ${height} pixels`);
    return (this.#copy = { texture, target, of, width, height });
  }

  #forgetCopy(): void {
    this.#gl.deleteFramebuffer(this.#copy?.target ?? null);
    this.#gl.deleteTexture(this.#copy?.texture ?? null);
    this.#copy = undefined;
  }
}

/** Returns the formats that the depth buffer of the bound framebuffer may have, the most likely one first. */
function depthFormats(gl: WebGL2RenderingContext, isCanvas: boolean): GLenum[] {
  const [depth, stencil] = isCanvas ? [gl.DEPTH, gl.STENCIL] : [gl.DEPTH_ATTACHMENT, gl.STENCIL_ATTACHMENT];
  const ask = (attachment: GLenum, name: GLenum): number =>
    gl.getFramebufferAttachmentParameter(gl.FRAMEBUFFER, attachment, name) as number;
  const has = (attachment: GLenum): boolean => ask(attachment, gl.FRAMEBUFFER_ATTACHMENT_OBJECT_TYPE) !== gl.NONE;
  if (!has(depth)) throw noDepth('one without depth');
  const bits = ask(depth, gl.FRAMEBUFFER_ATTACHMENT_DEPTH_SIZE);
  const [alone, both] =
    bits > 24 ? [gl.DEPTH_COMPONENT32F, gl.DEPTH32F_STENCIL8] : [gl.DEPTH_COMPONENT24, gl.DEPTH24_STENCIL8];
  const preferred = isCanvas || has(stencil) ? [both, alone] : [alone, both];
  return bits > 16 ? preferred : [gl.DEPTH_COMPONENT16, ...preferred];
}

const noDepth = (found: string): GaussianSplatError =>
  new GaussianSplatError('argument/value', {
    where: 'GlHost.draw(): depth',
    expected: 'a framebuffer with a depth buffer that can be copied, a texture of depth, or null',
    found,
    remedy: 'give depth: null, or give the framebuffer (or the context) a depth buffer',
  });
