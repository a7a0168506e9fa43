/** Which buffers, textures and query sets of a device live, and their bytes: what `byteLength` of our own objects is held against. */

export interface Ledger {
  /** Bytes of live resources that were created since the watch began. */
  readonly bytes: number;
  /** Number of such objects. */
  readonly objects: number;
  /** Bytes of all that was created, freed or not. */
  readonly allocated: number;
  /** Labels of what lives. */
  readonly labels: string[];
  stop(): void;
}

const BYTES_PER_PIXEL: Readonly<Record<string, number>> = { rgba8unorm: 4, rgba16float: 8, rgba32float: 16 };

type Destroyable = { destroy(): undefined; label: string };

export function watchMemory(device: GPUDevice): Ledger {
  const living = new Map<Destroyable, number>();
  let allocated = 0;
  const undo = [
    watch(device, 'createBuffer', ({ size }: GPUBufferDescriptor) => size),
    watch(device, 'createTexture', (_, texture: GPUTexture) => {
      const pixel = BYTES_PER_PIXEL[texture.format];
      if (pixel === undefined) throw new RangeError(`ledger: bytes of a pixel of ${texture.format} are not known`);
      return pixel * texture.width * texture.height;
    }),
    watch(device, 'createQuerySet', ({ count }: GPUQuerySetDescriptor) => 8 * count),
  ];

  function watch<D, T>(target: object, name: string, bytesOf: (descriptor: D, made: T) => number): () => void {
    const original = Reflect.get(target, name) as (descriptor: D) => T & Destroyable;
    Reflect.set(target, name, (descriptor: D) => {
      const made = original.call(target, descriptor);
      const bytes = bytesOf(descriptor, made);
      living.set(made, bytes);
      allocated += bytes;
      const destroy = made.destroy.bind(made);
      made.destroy = () => {
        living.delete(made);
        return destroy();
      };
      return made;
    });
    return () => void (Reflect.deleteProperty(target, name) || Reflect.set(target, name, original));
  }

  return {
    get bytes() {
      return [...living.values()].reduce((sum, bytes) => sum + bytes, 0);
    },
    get objects() {
      return living.size;
    },
    get allocated() {
      return allocated;
    },
    get labels() {
      return [...living.keys()].map(({ label }) => label);
    },
    stop: () => undo.forEach((one) => one()),
  };
}
