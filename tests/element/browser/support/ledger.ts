/** A book of what lives on the GPU: every buffer and texture that a page's devices have made and not destroyed. */

const alive = new Map<object, number>();
const owners = new WeakMap<object, GPUDevice>();

const texelBytes = (format: string): number => (/32float/.test(format) ? 16 : /16float/.test(format) ? 8 : 4);

function keep<T extends object>(resource: T, bytes: number, device: GPUDevice): T {
  alive.set(resource, bytes);
  owners.set(resource, device);
  return resource;
}

const { createBuffer, createTexture, destroy } = GPUDevice.prototype;
GPUDevice.prototype.createBuffer = function bookedBuffer(this: GPUDevice, descriptor) {
  return keep(createBuffer.call(this, descriptor), descriptor.size, this);
};
GPUDevice.prototype.createTexture = function bookedTexture(this: GPUDevice, descriptor) {
  const texture = createTexture.call(this, descriptor);
  return keep(texture, texture.width * texture.height * texelBytes(texture.format), this);
};
GPUDevice.prototype.destroy = function bookedDestroy(this: GPUDevice) {
  for (const resource of alive.keys()) if (owners.get(resource) === this) alive.delete(resource);
  return destroy.call(this);
};
for (const type of [GPUBuffer, GPUTexture]) {
  const original = type.prototype.destroy as () => undefined;
  type.prototype.destroy = function booked(this: object) {
    alive.delete(this);
    return original.call(this);
  };
}

/** The live resources. */
export interface Holdings {
  readonly objects: number;
  readonly bytes: number;
}

export function holdings(): Holdings {
  return { objects: alive.size, bytes: [...alive.values()].reduce((sum, bytes) => sum + bytes, 0) };
}
