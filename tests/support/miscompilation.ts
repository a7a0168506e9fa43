/** Compilers that err, or that round otherwise than SwiftShader's: shaders are changed on their way to the device. */

/** A change that a compiler might make. */
export interface Miscompilation {
  /** Label of the shaders that it befalls, for example `gs.project`; their variants too. */
  readonly shader: RegExp;
  readonly from: string;
  readonly to: string;
}

/** The code of a shader as such a compiler takes it; `befallen` gets the label of each that was changed, once for each change. */
export function miscompile(
  { label = '', code }: GPUShaderModuleDescriptor,
  faults: readonly Miscompilation[],
  befallen: string[],
): string {
  let changed = code;
  for (const { shader, from, to } of faults) {
    if (!shader.test(label) || !changed.includes(from)) continue;
    changed = changed.replaceAll(from, to);
    befallen.push(label);
  }
  return changed;
}

/** The same device behind another compiler. Resources that exist once for each device are created again for it, and belong to the same device. */
export function miscompiling(
  device: GPUDevice,
  faults: readonly Miscompilation[],
): { readonly device: GPUDevice; readonly befallen: readonly string[] } {
  const befallen: string[] = [];
  const createShaderModule = (descriptor: GPUShaderModuleDescriptor): GPUShaderModule =>
    device.createShaderModule({ ...descriptor, code: miscompile(descriptor, faults, befallen) });
  const other = new Proxy(device, {
    get(target, name) {
      if (name === 'createShaderModule') return createShaderModule;
      const value: unknown = Reflect.get(target, name, target);
      return typeof value === 'function' ? (value.bind(target) as unknown) : value;
    },
  });
  return { device: other, befallen };
}
