/** Notes the labels of all passes that a device records, until `stop` is called. */
export function notePasses(device: GPUDevice): { readonly labels: string[]; stop(): void } {
  const labels: string[] = [];
  // Set if others wrap it, too.
  const own = Object.getOwnPropertyDescriptor(device, 'createCommandEncoder');
  const original = device.createCommandEncoder.bind(device);
  device.createCommandEncoder = (descriptor) => {
    const encoder = original(descriptor);
    for (const name of ['beginComputePass', 'beginRenderPass'] as const) {
      const begin = encoder[name].bind(encoder) as (pass?: { label?: string }) => unknown;
      Reflect.set(encoder, name, (pass?: { label?: string }) => {
        labels.push(pass?.label ?? '');
        return begin(pass);
      });
    }
    return encoder;
  };
  const stop = (): void => {
    Reflect.deleteProperty(device, 'createCommandEncoder');
    if (own) Object.defineProperty(device, 'createCommandEncoder', own);
  };
  return { labels, stop };
}
