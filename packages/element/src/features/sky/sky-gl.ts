/** Sky with WebGL 2: one triangle that is drawn beneath the splats, in their context. */
import type { Camera } from '@gaussian-splat/core';
import type { ViewerFrame } from '../../viewer/camera/orbit.js';
import { viewRays } from './view-rays.js';

const VERTEX = `#version 300 es
void main() {
  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}`;
const FRAGMENT = `#version 300 es
precision highp float;
uniform vec4 rays[3];
uniform float height;
uniform sampler2D image;
out vec4 color;
void main() {
  // Rows are counted from below.
  vec3 way = normalize(gl_FragCoord.x * rays[0].xyz + (height - gl_FragCoord.y) * rays[1].xyz + rays[2].xyz);
  vec2 place = vec2(atan(way.z, way.x) / 6.2831853 + 0.5, acos(clamp(way.y, -1.0, 1.0)) / 3.14159265);
  color = vec4(textureLod(image, place, 0.0).rgb, 1.0);
}`;

export class SkyGl {
  readonly gl: WebGL2RenderingContext;
  readonly #program: WebGLProgram;
  readonly #texture: WebGLTexture;
  readonly #rays: WebGLUniformLocation | null;
  readonly #height: WebGLUniformLocation | null;

  /** Uploads the sky. @param image Equirectangular image; the caller closes it. */
  constructor(gl: WebGL2RenderingContext, image: ImageBitmap) {
    this.gl = gl;
    this.#program = gl.createProgram();
    for (const [type, text] of [
      [gl.VERTEX_SHADER, VERTEX],
      [gl.FRAGMENT_SHADER, FRAGMENT],
    ] as const) {
      const shader = gl.createShader(type)!;
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(this.#program, shader);
      gl.deleteShader(shader);
    }
    gl.linkProgram(this.#program);
    this.#rays = gl.getUniformLocation(this.#program, 'rays');
    this.#height = gl.getUniformLocation(this.#program, 'height');
    this.#texture = gl.createTexture();
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.#texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, image);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.REPEAT);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
  }

  /** Draws the sky into the framebuffer that is bound. */
  draw(camera: Camera, frame: ViewerFrame): void {
    const { gl } = this;
    gl.viewport(0, 0, camera.width, camera.height);
    gl.disable(gl.BLEND);
    gl.useProgram(this.#program);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.#texture);
    gl.uniform4fv(this.#rays, viewRays(camera, frame));
    gl.uniform1f(this.#height, camera.height);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  destroy(): void {
    this.gl.deleteProgram(this.#program);
    this.gl.deleteTexture(this.#texture);
  }
}
