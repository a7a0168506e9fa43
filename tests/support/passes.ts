/** Notes the labels of all passes that a device records, until `stop` is called. */
export function notePasses(device: GPUDevice): { readonly labels: string[]; stop(): void } {
  const labels: string[] = [];
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
  return { labels, stop: () => void Reflect.deleteProperty(device, 'createCommandEncoder') };
}
