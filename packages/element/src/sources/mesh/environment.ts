/**
 * The light of meshes: the environment of model-viewer and of three.js's `RoomEnvironment`, prefiltered for each
 * roughness as in three.js's `PMREMGenerator`.
 */
import { CubeRenderTarget, HalfFloatType, LinearMipmapLinearFilter, type WebGPURenderer } from './three.js';

/**
 * Side of a face in pixels at the level for mirrors; each rougher level has half of it. Lights are blurred by {@link
 * SHADER}'s SIGMA, so that a higher resolution would not be visible.
 */
const SIZE = 128;
/** Number of levels. The faces of the last level are 8 x 8 pixels. */
const LEVELS = 5;
/** Level from which all rougher levels are filtered. */
const SHARPER = 2;
/** Number of invocations of a workgroup along each side. */
const GROUP = 8;

/**
 * Casts rays into boxes. Rendering the scene with three.js would compile the shaders of six materials on the main
 * thread for a quarter of a second. It would filter faces of 256 pixels with 256 samples each, which takes a software
 * adapter seconds.
 */
const SHADER = /* wgsl */ `
const SIZE = ${SIZE}.0;
const LAST = ${LEVELS - 1}.0;
// Rougher ones are made of this level: two wide lobes in turn are wider than their squares say.
const SHARPER = ${SHARPER}.0;
const PI = 3.14159265;
const GOLDEN_ANGLE = 2.39996323;
// Standard deviation of the Gaussian that blurs the room, radians.
const SIGMA = 0.04;
const RAYS = 24u;

// half: of its sides. turn: around y, cosine and sine. emitted: radiance, 0 for the white boxes.
struct Box { center: vec3f, half: vec3f, turn: vec2f, emitted: f32 }
const STRAIGHT = vec2f(1.0, 0.0);

const ROOM = Box(vec3f(-0.757, 9.719, 0.717), vec3f(15.8565, 14.1525, 14.2955), STRAIGHT, 0.0);
const LAMP = vec3f(0.418, 12.699, 0.3);
const LAMP_INTENSITY = 900.0;
const LAMP_REACH = 28.0;
const BOXES = array<Box, 12>(
  Box(vec3f(-10.906, -1.491, 1.846), vec3f(1.164, 3.9525, 2.3255), vec2f(cos(-0.195), sin(-0.195)), 0.0),
  Box(vec3f(-5.607, -4.254, -0.758), vec3f(0.985, 0.767, 1.9775), vec2f(cos(0.994), sin(0.994)), 0.0),
  Box(vec3f(6.167, -2.643, 7.803), vec3f(1.9635, 3.1425, 1.8435), vec2f(cos(0.561), sin(0.561)), 0.0),
  Box(vec3f(-2.017, -3.482, 6.124), vec3f(1.001, 2.283, 1.032), vec2f(cos(0.333), sin(0.333)), 0.0),
  Box(vec3f(2.291, -4.256, -2.621), vec3f(0.773, 0.776, 0.748), vec2f(cos(-0.286), sin(-0.286)), 0.0),
  Box(vec3f(-2.193, -3.869, -5.547), vec3f(1.9375, 1.7435, 1.493), vec2f(cos(0.516), sin(0.516)), 0.0),
  Box(vec3f(-16.116, 10.87, 8.208), vec3f(0.05, 1.214, 1.3695), STRAIGHT, 50.0),
  Box(vec3f(-16.109, 14.521, -8.207), vec3f(0.05, 1.2125, 1.3755), STRAIGHT, 50.0),
  Box(vec3f(14.904, 8.698, -1.832), vec3f(0.075, 2.1325, 3.1655), STRAIGHT, 17.0),
  Box(vec3f(-0.462, 5.39, 14.52), vec3f(2.19, 2.7205, 0.044), STRAIGHT, 43.0),
  Box(vec3f(3.235, 7.986, -12.541), vec3f(1.25, 1.0, 0.05), STRAIGHT, 20.0),
  Box(vec3f(0.0, 16.5, 0.0), vec3f(0.5, 0.05, 0.5), STRAIGHT, 100.0));

@group(0) @binding(0) var level: texture_storage_2d_array<rgba16float, write>;
// Six faces, not a cube: SwiftShader filters across the edges of a cube with texels that compute shaders do not update.
@group(0) @binding(1) var sharper: texture_2d_array<f32>;
@group(0) @binding(2) var linear: sampler;

fn turned(v: vec3f, turn: vec2f) -> vec3f {
  return vec3f(turn.x * v.x + turn.y * v.z, v.y, turn.x * v.z - turn.y * v.x);
}

// Light of the lamp that a white, rough, dielectric surface sends toward the origin.
fn lit(point: vec3f, normal: vec3f) -> f32 {
  let way = LAMP - point;
  let distance = length(way);
  let toLamp = way / distance;
  let toEye = -normalize(point);
  let cosLamp = saturate(dot(normal, toLamp));
  let cosEye = saturate(dot(normal, toEye));
  let window = saturate(1.0 - pow(distance / LAMP_REACH, 4.0));
  let irradiance = cosLamp * LAMP_INTENSITY * window * window / (distance * distance);
  let fresnel = 0.04 + 0.96 * pow(1.0 - saturate(dot(toEye, normalize(toEye + toLamp))), 5.0);
  // GGX of roughness 1.
  let specular = fresnel * 0.5 / max(cosLamp + cosEye, 1e-6) / PI;
  return irradiance * ((1.0 - fresnel) / PI + specular);
}

// Radiance that reaches the origin from a direction: all of the room is gray.
fn radiance(direction: vec3f) -> f32 {
  let exits = (ROOM.center + sign(direction) * ROOM.half) / direction;
  var nearest = min(exits.x, min(exits.y, exits.z));
  var normal = -sign(direction) * step(exits, vec3f(nearest));
  var emitted = 0.0;
  for (var i = 0u; i < 12u; i++) {
    let box = BOXES[i];
    let back = vec2f(box.turn.x, -box.turn.y);
    let ray = turned(direction, back);
    let center = turned(box.center, back);
    let enters = (center - sign(ray) * box.half) / ray;
    let leaves = (center + sign(ray) * box.half) / ray;
    let enter = max(enters.x, max(enters.y, enters.z));
    if (enter > 0.0 && enter < nearest && enter < min(leaves.x, min(leaves.y, leaves.z))) {
      nearest = enter;
      normal = turned(-sign(ray) * step(vec3f(enter), enters), box.turn);
      emitted = box.emitted;
    }
  }
  return select(lit(nearest * direction, normal), emitted, emitted > 0.0);
}

// Direction of a pixel of a face, in the convention of WebGPU cube maps.
fn directionOf(id: vec3u, size: f32) -> vec3f {
  let s = 2.0 * (f32(id.x) + 0.5) / size - 1.0;
  let t = 2.0 * (f32(id.y) + 0.5) / size - 1.0;
  let faces = array<vec3f, 6>(
    vec3f(1.0, -t, -s), vec3f(-1.0, -t, s), vec3f(s, 1.0, t), vec3f(s, -1.0, -t), vec3f(s, -t, 1.0), vec3f(-s, -t, -1.0));
  return normalize(faces[id.z]);
}

// The sharper level in a direction: inverse of directionOf.
fn sampled(d: vec3f) -> f32 {
  let a = abs(d);
  var face = select(5, 4, d.z > 0.0);
  var st = vec2f(select(-d.x, d.x, d.z > 0.0), -d.y) / a.z;
  if (a.x >= a.y && a.x >= a.z) {
    face = select(1, 0, d.x > 0.0);
    st = vec2f(select(d.z, -d.z, d.x > 0.0), -d.y) / a.x;
  } else if (a.y >= a.z) {
    face = select(3, 2, d.y > 0.0);
    st = vec2f(d.x, select(-d.z, d.z, d.y > 0.0)) / a.y;
  }
  return textureSampleLevel(sharper, linear, 0.5 * st + 0.5, face, 0.0).r;
}

// The direction of a spherical angle from another.
fn around(axis: vec3f, cosTheta: f32, phi: f32) -> vec3f {
  let up = select(vec3f(1.0, 0.0, 0.0), vec3f(0.0, 0.0, 1.0), abs(axis.z) < 0.999);
  let tangent = normalize(cross(up, axis));
  let sinTheta = sqrt(max(0.0, 1.0 - cosTheta * cosTheta));
  return cosTheta * axis + sinTheta * (cos(phi) * tangent + sin(phi) * cross(axis, tangent));
}

@compute @workgroup_size(${GROUP}, ${GROUP})
fn mirror(@builtin(global_invocation_id) id: vec3u) {
  let direction = directionOf(id, SIZE);
  var sum = 0.0;
  for (var i = 0u; i < RAYS; i++) {
    let theta = SIGMA * sqrt(-2.0 * log(1.0 - (f32(i) + 0.5) / f32(RAYS)));
    // three.js samples cubes with x turned around.
    sum += radiance(around(direction, cos(theta), f32(i) * GOLDEN_ANGLE) * vec3f(-1.0, 1.0, 1.0));
  }
  textureStore(level, id.xy, id.z, vec4f(vec3f(sum / f32(RAYS)), 1.0));
}

// GGX's alpha, the square of the roughness, of a level.
fn alphaOf(lod: f32) -> f32 {
  let roughness = 1.0 - sqrt(1.0 - lod / LAST);
  return roughness * roughness;
}

// A level is a sharper one, filtered by as much as that lacks: normals that face the eye, as PMREMGenerator has it.
@compute @workgroup_size(${GROUP}, ${GROUP})
fn rougher(@builtin(global_invocation_id) id: vec3u) {
  let size = f32(textureDimensions(level).x);
  let lod = log2(SIZE / size);
  let before = alphaOf(min(lod - 1.0, SHARPER));
  let alpha2 = alphaOf(lod) * alphaOf(lod) - before * before;
  let direction = directionOf(id, size);
  let samples = u32(32.0 * exp2(lod - 1.0));
  var sum = 0.0;
  var weights = 0.0;
  for (var i = 0u; i < samples; i++) {
    let u = (f32(i) + 0.5) / f32(samples);
    // The reflected ray is sampled by visible normals (Heitz 2018).
    let cosTheta = (1.0 - u - alpha2 * u) / (1.0 - u + alpha2 * u);
    if (cosTheta <= 0.0) { continue; }
    sum += cosTheta * sampled(around(direction, cosTheta, f32(i) * GOLDEN_ANGLE));
    weights += cosTheta;
  }
  textureStore(level, id.xy, id.z, vec4f(vec3f(sum / weights), 1.0));
}
`;

/** Creates the environment, prefiltered on the GPU. Its texture is the `envMap` of three.js's materials. */
export async function makeEnvironment(device: GPUDevice, renderer: WebGPURenderer): Promise<CubeRenderTarget> {
  const label = 'gs.mesh_environment';
  const module = device.createShaderModule({ label, code: SHADER });
  const made = ['mirror', 'rougher'].map((entryPoint) =>
    device.createComputePipelineAsync({ label, layout: 'auto', compute: { module, entryPoint } }),
  );
  const [mirror, rougher] = await Promise.all(made);
  const { STORAGE_BINDING, TEXTURE_BINDING, COPY_SRC } = GPUTextureUsage;
  const cube = device.createTexture({
    label,
    size: [SIZE, SIZE, 6],
    format: 'rgba16float',
    mipLevelCount: LEVELS,
    usage: STORAGE_BINDING | TEXTURE_BINDING | COPY_SRC,
  });
  const view = (baseMipLevel: number): GPUTextureView =>
    cube.createView({ dimension: '2d-array', baseMipLevel, mipLevelCount: 1 });
  const linear = device.createSampler({ label, magFilter: 'linear', minFilter: 'linear' });
  const encoder = device.createCommandEncoder({ label });
  const target = targetOf(renderer);
  for (let level = 0; level < LEVELS; level++) {
    const pipeline = level === 0 ? mirror : rougher;
    const resources = [view(level), ...(level === 0 ? [] : [view(Math.min(level - 1, SHARPER)), linear])];
    const pass = encoder.beginComputePass({ label });
    pass.setPipeline(pipeline);
    pass.setBindGroup(
      0,
      device.createBindGroup({
        label,
        layout: pipeline.getBindGroupLayout(0),
        entries: resources.map((resource, binding) => ({ binding, resource })),
      }),
    );
    const groups = (SIZE >> level) / GROUP;
    pass.dispatchWorkgroups(groups, groups, 6);
    pass.end();
    const texture = renderer.backend.get(target.texture).texture!;
    const size = [SIZE >> level, SIZE >> level, 6];
    encoder.copyTextureToTexture({ texture: cube, mipLevel: level }, { texture, mipLevel: level }, size);
  }
  device.queue.submit([encoder.finish()]);
  cube.destroy();
  return target;
}

/** Allocates a cube texture of three.js with its mip levels on the GPU. */
function targetOf(renderer: WebGPURenderer): CubeRenderTarget {
  const target = new CubeRenderTarget(SIZE, {
    type: HalfFloatType,
    minFilter: LinearMipmapLinearFilter,
    generateMipmaps: false,
    depthBuffer: false,
  });
  const { texture } = target;
  for (let level = 0; level < LEVELS; level++) texture.mipmaps.push({ width: SIZE >> level, height: SIZE >> level });
  texture.isPMREMTexture = true;
  renderer.initRenderTarget(target);
  return target;
}
