/** Environment variables with which Node's `webgpu` package (Dawn) finds a GPU, or SwiftShader if there is none. */
import { copyFileSync, existsSync, mkdirSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { findSwiftShader } from './chromium.mjs';

const cache = fileURLToPath(new URL('../../.cache/vulkan/', import.meta.url));

/**
 * Variables for a child process that uses Dawn. On Linux that is SwiftShader, which gives the same image on every
 * machine; GAUSSIAN_SPLAT_GPU=system leaves the choice to the system's Vulkan. Elsewhere Dawn has Metal or Direct3D.
 */
export function gpuEnvironment() {
  if (process.platform !== 'linux' || process.env.GAUSSIAN_SPLAT_GPU === 'system') return {};
  const folder = findSwiftShader();
  if (folder === undefined) return {};
  // Only the loader: the folder's other libraries must not shadow the system's.
  const loader = join(cache, 'libvulkan.so.1');
  if (!existsSync(loader)) {
    mkdirSync(cache, { recursive: true });
    copyFileSync(join(folder, 'libvulkan.so.1'), loader);
  }
  return {
    LD_LIBRARY_PATH: [cache, process.env.LD_LIBRARY_PATH].filter(Boolean).join(':'),
    VK_ICD_FILENAMES: join(folder, 'vk_swiftshader_icd.json'),
    VK_DRIVER_FILES: join(folder, 'vk_swiftshader_icd.json'),
  };
}
