/** Watches every device of the page: its resources and its errors. Must run before the page requests a device. */

const BYTES_PER_PIXEL = { rgba8unorm: 4, bgra8unorm: 4, rgba16float: 8, rgba32float: 16 };

/** Living devices, newest last, each with its living objects and their bytes. */
export const devices = [];
/** Everything that went wrong: validation, uncaught errors, warnings. */
export const faults = [];

const requestDevice = GPUAdapter.prototype.requestDevice;
GPUAdapter.prototype.requestDevice = async function watched(descriptor) {
  const device = await requestDevice.call(this, descriptor);
  const entry = { device, objects: new Map() };
  devices.push(entry);
  device.addEventListener('uncapturederror', ({ error }) => faults.push(`GPU: ${error.message}`));
  device.lost.then(() => devices.splice(devices.indexOf(entry), 1));
  return device;
};

function watch(name, bytesOf) {
  const create = GPUDevice.prototype[name];
  GPUDevice.prototype[name] = function counting(descriptor) {
    const made = create.call(this, descriptor);
    devices.find(({ device }) => device === this)?.objects.set(made, bytesOf(descriptor, made));
    return made;
  };
}
watch('createBuffer', ({ size }) => size);
watch('createTexture', (_, { format, width, height }) => (BYTES_PER_PIXEL[format] ?? 4) * width * height);
for (const { prototype } of [GPUBuffer, GPUTexture]) {
  const destroy = prototype.destroy;
  prototype.destroy = function counting() {
    for (const { objects } of devices) objects.delete(this);
    return destroy.call(this);
  };
}

/** Bytes of a texel by the format's name, as far as the renderer uses it. */
const BYTES_PER_TEXEL = {
  R8: 1,
  RG8: 2,
  RGBA8: 4,
  R32UI: 4,
  RG32UI: 8,
  RGBA32UI: 16,
  R32F: 4,
  RGBA16F: 8,
  RGBA32F: 16,
};
/** Contexts of WebGL, each with its living textures and buffers and their bytes. A lost one has none. */
export const contexts = new Map();

const getContext = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function watched(kind, ...rest) {
  const context = getContext.call(this, kind, ...rest);
  if (kind === 'webgl2' && context && !contexts.has(context)) {
    contexts.set(context, new Map());
    this.addEventListener('webglcontextlost', () => contexts.delete(context));
  }
  return context;
};

/** Counts the objects bound to the target of a call that allocates. */
function watchGl(name, bindingOf, bytesOf) {
  const { prototype } = WebGL2RenderingContext;
  const allocate = prototype[name];
  prototype[name] = function counting(...args) {
    allocate.apply(this, args);
    contexts.get(this)?.set(this.getParameter(bindingOf(this, args[0])), bytesOf(this, args));
  };
}
watchGl(
  'texStorage2D',
  (gl) => gl.TEXTURE_BINDING_2D,
  (gl, [, , format, width, height]) => {
    const [name] = Object.keys(BYTES_PER_TEXEL).filter((each) => gl[each] === format);
    if (!name) faults.push(`ledger: a texture of the format 0x${format.toString(16)}, whose bytes are not known`);
    return BYTES_PER_TEXEL[name] * width * height;
  },
);
watchGl(
  'bufferData',
  (gl, target) => (target === gl.UNIFORM_BUFFER ? gl.UNIFORM_BUFFER_BINDING : gl.ELEMENT_ARRAY_BUFFER_BINDING),
  (_, [, data]) => data.byteLength ?? data,
);
for (const name of ['deleteTexture', 'deleteBuffer']) {
  const free = WebGL2RenderingContext.prototype[name];
  WebGL2RenderingContext.prototype[name] = function counting(object) {
    contexts.get(this)?.delete(object);
    return free.call(this, object);
  };
}

addEventListener('error', ({ message }) => faults.push(`uncaught: ${message}`));
addEventListener('unhandledrejection', ({ reason }) => faults.push(`unhandled: ${reason}`));
for (const level of ['warn', 'error']) {
  console[level] = (...words) => faults.push(`console.${level}: ${words.join(' ')}`);
}

/** Created once for a device and kept as long as it lives. The set depends on the variants that were tried. */
const OF_DEVICE = /^gs\.(sort\.pass_\d|rasterize\.indices|no_\w+)$/;

/** Bytes of our objects, of the device's objects, and of others' (ONNX Runtime); and the classes of our objects. */
export function ledger() {
  const sum = { own: 0, device: 0, others: 0, byLabel: {} };
  for (const { objects } of devices) {
    for (const [{ label }, bytes] of objects) {
      const kind = OF_DEVICE.test(label) ? 'device' : label.startsWith('gs.') ? 'own' : 'others';
      sum[kind] += bytes;
      if (kind === 'own') sum.byLabel[label] = (sum.byLabel[label] ?? 0) + bytes;
    }
  }
  for (const objects of contexts.values()) for (const bytes of objects.values()) sum.own += bytes;
  return sum;
}
