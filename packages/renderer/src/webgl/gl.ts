/** Helpers to create WebGL 2 objects. */
import { GaussianSplatError } from '@gaussian-splat/core';
import { writeStruct, type StructLayout, type StructValues } from '../gpu/struct.js';

/** A shader's program, its textures by name, and the one struct of its uniforms. */
export class GlProgram<L extends StructLayout> {
  readonly #gl: WebGL2RenderingContext;
  readonly #program: WebGLProgram;
  readonly #uniform: WebGLBuffer;
  readonly #layout: L;
  readonly #bytes: ArrayBuffer;

  constructor(
    gl: WebGL2RenderingContext,
    texts: readonly [vertex: string, fragment: string],
    layout: L,
    textures: readonly string[],
  ) {
    this.#gl = gl;
    this.#layout = layout;
    this.#bytes = new ArrayBuffer(layout.size);
    this.#program = link(gl, texts);
    this.#uniform = gl.createBuffer();
    gl.bindBuffer(gl.UNIFORM_BUFFER, this.#uniform);
    gl.bufferData(gl.UNIFORM_BUFFER, layout.size, gl.DYNAMIC_DRAW);
    gl.useProgram(this.#program);
    textures.forEach((name, unit) => gl.uniform1i(gl.getUniformLocation(this.#program, `t_${name}`), unit));
  }

  /** Makes the program current. @param textures In the order of their names. */
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

function link(gl: WebGL2RenderingContext, texts: readonly [vertex: string, fragment: string]): WebGLProgram {
  const program = gl.createProgram();
  const shaders = [gl.VERTEX_SHADER, gl.FRAGMENT_SHADER].map((type, i) => {
    const shader = gl.createShader(type)!;
    gl.shaderSource(shader, texts[i]);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
    return shader;
  });
  gl.linkProgram(program);
  const isLinked = gl.getProgramParameter(program, gl.LINK_STATUS) as boolean;
  const said = [gl.getProgramInfoLog(program), ...shaders.map((shader) => gl.getShaderInfoLog(shader))];
  for (const shader of shaders) gl.deleteShader(shader);
  // A lost context links nothing, and reports its own error.
  if (isLinked || gl.isContextLost()) return program;
  throw new GaussianSplatError('unsupported/webgl', {
    where: 'the WebGL 2 renderer',
    expected: 'shaders that this browser compiles',
    found: said.filter(Boolean).join(' ').trim() || 'a program that does not link',
    remedy: 'update the browser or the graphics driver, or use a browser with WebGPU',
  });
}

/** A texture with one level, whose texels are read without filtering. */
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

/** Creates a framebuffer. */
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
 * @throws GaussianSplatError `out-of-memory/allocation` if the last creation ran out of memory. Waits for the browser:
 * not for frames.
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
