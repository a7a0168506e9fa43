/** Number of texture units that the renderer's programs use. */
const UNITS = 6;

/** Capabilities that the renderer changes, or that would disturb its drawing. */
const ENABLED = [
  'BLEND',
  'CULL_FACE',
  'DEPTH_TEST',
  'RASTERIZER_DISCARD',
  'SAMPLE_ALPHA_TO_COVERAGE',
  'SAMPLE_COVERAGE',
  'SCISSOR_TEST',
  'STENCIL_TEST',
] as const;

/** Pixel storage parameters, with the values that the renderer assumes. */
const PIXEL_STORE = {
  UNPACK_ALIGNMENT: 4,
  UNPACK_FLIP_Y_WEBGL: false,
  UNPACK_IMAGE_HEIGHT: 0,
  UNPACK_PREMULTIPLY_ALPHA_WEBGL: false,
  UNPACK_ROW_LENGTH: 0,
  UNPACK_SKIP_PIXELS: 0,
  UNPACK_SKIP_ROWS: 0,
  PACK_ALIGNMENT: 4,
  PACK_ROW_LENGTH: 0,
  PACK_SKIP_PIXELS: 0,
  PACK_SKIP_ROWS: 0,
} as const;

/** Sets the state that the renderer assumes, without reading any. */
export function setState(gl: WebGL2RenderingContext): void {
  for (const name of ENABLED) gl.disable(gl[name]);
  for (const [name, value] of Object.entries(PIXEL_STORE)) gl.pixelStorei(gl[name as keyof typeof PIXEL_STORE], value);
  for (let i = 0; i < UNITS; i++) gl.bindSampler(i, null);
  gl.bindBuffer(gl.PIXEL_UNPACK_BUFFER, null);
  gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
  gl.bindVertexArray(null);
  gl.colorMask(true, true, true, true);
  gl.blendEquation(gl.FUNC_ADD);
}

/**
 * Saves the state of a context that other code also uses, and sets the state that the renderer assumes.
 * @returns A function that restores the saved state.
 */
export function borrowState(gl: WebGL2RenderingContext): () => void {
  const get = (name: GLenum): never => gl.getParameter(name) as never;
  const enabled = ENABLED.map((name) => [gl[name], gl.isEnabled(gl[name])] as const);
  const stored = Object.keys(PIXEL_STORE).map((name) => {
    const key = gl[name as keyof typeof PIXEL_STORE];
    return [key, get(key) as number | boolean] as const;
  });
  const unit = get(gl.ACTIVE_TEXTURE) as GLenum;
  const textures = Array.from({ length: UNITS }, (_, i) => {
    gl.activeTexture(gl.TEXTURE0 + i);
    return [get(gl.TEXTURE_BINDING_2D), get(gl.SAMPLER_BINDING)] as const;
  });
  const program = get(gl.CURRENT_PROGRAM);
  const corners = get(gl.VERTEX_ARRAY_BINDING);
  const [drawn, read] = [get(gl.DRAW_FRAMEBUFFER_BINDING), get(gl.READ_FRAMEBUFFER_BINDING)];
  const [unpack, pack] = [get(gl.PIXEL_UNPACK_BUFFER_BINDING), get(gl.PIXEL_PACK_BUFFER_BINDING)];
  const uniforms = get(gl.UNIFORM_BUFFER_BINDING);
  const [first, start, size] = [gl.UNIFORM_BUFFER_BINDING, gl.UNIFORM_BUFFER_START, gl.UNIFORM_BUFFER_SIZE].map(
    (name) => gl.getIndexedParameter(name, 0) as never,
  );
  const [viewport, scissor] = [get(gl.VIEWPORT), get(gl.SCISSOR_BOX)] as Int32Array[];
  const mask = get(gl.COLOR_WRITEMASK) as boolean[];
  const equations = [get(gl.BLEND_EQUATION_RGB), get(gl.BLEND_EQUATION_ALPHA)] as const;
  const factors = [gl.BLEND_SRC_RGB, gl.BLEND_DST_RGB, gl.BLEND_SRC_ALPHA, gl.BLEND_DST_ALPHA].map(get);

  setState(gl);
  return () => {
    for (const [name, was] of enabled) gl[was ? 'enable' : 'disable'](name);
    for (const [name, was] of stored) gl.pixelStorei(name, was);
    textures.forEach(([texture, sampler], i) => {
      gl.activeTexture(gl.TEXTURE0 + i);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.bindSampler(i, sampler);
    });
    gl.activeTexture(unit);
    gl.useProgram(program);
    gl.bindVertexArray(corners);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, drawn);
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, read);
    gl.bindBuffer(gl.PIXEL_UNPACK_BUFFER, unpack);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, pack);
    // A size of 0 bytes means that the whole buffer was bound.
    if (size === 0 || first === null) gl.bindBufferBase(gl.UNIFORM_BUFFER, 0, first);
    else gl.bindBufferRange(gl.UNIFORM_BUFFER, 0, first, start, size);
    gl.bindBuffer(gl.UNIFORM_BUFFER, uniforms);
    gl.viewport(viewport[0], viewport[1], viewport[2], viewport[3]);
    gl.scissor(scissor[0], scissor[1], scissor[2], scissor[3]);
    gl.colorMask(mask[0], mask[1], mask[2], mask[3]);
    gl.blendEquationSeparate(...equations);
    gl.blendFuncSeparate(factors[0], factors[1], factors[2], factors[3]);
  };
}
