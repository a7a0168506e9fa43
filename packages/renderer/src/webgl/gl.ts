/** Helpers to create WebGL 2 objects. */
import { GaussianSplatError } from '@gaussian-splat/core';
import { writeStruct, type StructLayout, type StructValues } from '../gpu/struct.js';
import { DATA_WIDTH } from './shaders.js';

/**
 * Texels in a row of the textures that hold arrays. Browsers that hide the device, and some old GPUs, allow only 2048,
 * the least that WebGL 2 guarantees. Whole rows of `DATA_WIDTH` are whole rows of this width, too.
 */
export const dataWidth = (gl: WebGL2RenderingContext): number =>
  Math.min(DATA_WIDTH, gl.getParameter(gl.MAX_TEXTURE_SIZE) as number);

/** A shader program, the names of its textures, and a uniform buffer that contains one struct. */
export class GlProgram<L extends StructLayout> {
  readonly #gl: WebGL2RenderingContext;
  readonly #program: WebGLProgram;
  /** Shaders of the program; empty after {@link check}. */
  #shaders: readonly WebGLShader[];
  readonly #textures: readonly string[];
  readonly #uniform: WebGLBuffer;
  readonly #layout: L;
  readonly #bytes: ArrayBuffer;

  /** Starts the compilation of the shaders without blocking the thread. */
  constructor(
    gl: WebGL2RenderingContext,
    texts: readonly [vertex: string, fragment: string],
    layout: L,
    textures: readonly string[],
  ) {
    this.#gl = gl;
    this.#layout = layout;
    this.#textures = textures;
    this.#bytes = new ArrayBuffer(layout.size);
    [this.#program, this.#shaders] = link(gl, texts);
    this.#uniform = gl.createBuffer();
    gl.bindBuffer(gl.UNIFORM_BUFFER, this.#uniform);
    gl.bufferData(gl.UNIFORM_BUFFER, layout.size, gl.DYNAMIC_DRAW);
  }

  /** Whether {@link check} would return at once. Always true in browsers without `KHR_parallel_shader_compile`. */
  get isCompiled(): boolean {
    const gl = this.#gl;
    const extension = gl.getExtension('KHR_parallel_shader_compile');
    if (this.#shaders.length === 0 || extension === null || gl.isContextLost()) return true;
    return gl.getProgramParameter(this.#program, extension.COMPLETION_STATUS_KHR) as boolean;
  }

  /**
   * Blocks the thread until the program is compiled, and prepares it to draw.
   * @throws GaussianSplatError `unsupported/webgl` if the browser does not compile the shaders.
   */
  check(): void {
    const gl = this.#gl;
    if (this.#shaders.length === 0) return;
    requireLinked(gl, this.#program, this.#shaders);
    this.#shaders = [];
    gl.useProgram(this.#program);
    this.#textures.forEach((name, unit) => gl.uniform1i(gl.getUniformLocation(this.#program, `t_${name}`), unit));
  }

  /**
   * Makes the program current. @param values Values of the uniform struct. @param textures Textures in the order of
   * their names.
   */
  use(values: StructValues<L>, textures: readonly WebGLTexture[]): void {
    const gl = this.#gl;
    gl.useProgram(this.#program);
    writeStruct(this.#layout, values, this.#bytes);
    gl.bindBuffer(gl.UNIFORM_BUFFER, this.#uniform);
    gl.bufferSubData(gl.UNIFORM_BUFFER, 0, this.#bytes);
    gl.bindBufferBase(gl.UNIFORM_BUFFER, 0, this.#uniform);
    textures.forEach((texture, unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
    });
  }

  destroy(): void {
    this.#gl.deleteProgram(this.#program);
    this.#gl.deleteBuffer(this.#uniform);
  }
}

function link(
  gl: WebGL2RenderingContext,
  texts: readonly [vertex: string, fragment: string],
): [WebGLProgram, WebGLShader[]] {
  const program = gl.createProgram();
  const shaders = [gl.VERTEX_SHADER, gl.FRAGMENT_SHADER].map((type, i) => {
    const shader = gl.createShader(type)!;
    gl.shaderSource(shader, texts[i]!.replace(`DATA_WIDTH = ${DATA_WIDTH}u`, `DATA_WIDTH = ${dataWidth(gl)}u`));
    gl.compileShader(shader);
    gl.attachShader(program, shader);
    return shader;
  });
  gl.linkProgram(program);
  return [program, shaders];
}

function requireLinked(gl: WebGL2RenderingContext, program: WebGLProgram, shaders: readonly WebGLShader[]): void {
  const isLinked = gl.getProgramParameter(program, gl.LINK_STATUS) as boolean;
  // A lost context links no program, and its loss is reported elsewhere.
  if (isLinked || gl.isContextLost()) return shaders.forEach((shader) => gl.deleteShader(shader));
  const said = [gl.getProgramInfoLog(program), ...shaders.map((shader) => gl.getShaderInfoLog(shader))];
  throw new GaussianSplatError('unsupported/webgl', {
    where: 'the WebGL 2 renderer',
    expected: 'shaders that this browser compiles',
    found: said.filter(Boolean).join(' ').trim() || 'a program that does not link',
    remedy: 'update the browser or the graphics driver, or use a browser with WebGPU',
  });
}

/** Creates a texture with one level, whose texels are read without filtering. */
export function makeTexture(
  gl: WebGL2RenderingContext,
  format: GLenum,
  [width, height]: readonly [number, number],
): WebGLTexture {
  const texture = gl.createTexture();
  gl.activeTexture(gl.TEXTURE0);
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, height);
  for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER])
    gl.texParameteri(gl.TEXTURE_2D, filter, gl.NEAREST);
  return texture;
}

/** Creates a framebuffer with the textures as its color attachments. */
export function makeTarget(gl: WebGL2RenderingContext, textures: readonly WebGLTexture[]): WebGLFramebuffer {
  const target = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, target);
  textures.forEach((texture, i) =>
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0 + i, gl.TEXTURE_2D, texture, 0),
  );
  gl.drawBuffers(textures.map((_, i) => gl.COLOR_ATTACHMENT0 + i));
  return target;
}

/**
 * Checks whether the last allocations succeeded. The check waits for the browser: do not call it for each frame.
 * @param what Name of the allocated object in the error.
 * @throws GaussianSplatError `out-of-memory/allocation` if an allocation failed.
 */
export function requireMemory(gl: WebGL2RenderingContext, what: string): void {
  if (gl.getError() !== gl.OUT_OF_MEMORY) return;
  throw new GaussianSplatError('out-of-memory/allocation', {
    where: what,
    expected: 'enough free GPU memory',
    found: 'an allocation that failed (WebGL: OUT_OF_MEMORY)',
    remedy: 'show a smaller scene, or close other pages and elements that use the GPU',
  });
}
