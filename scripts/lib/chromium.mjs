/** Finds a Chromium, or installs Debian's. Its SwiftShader also serves Dawn in Node if there is no GPU. */
import { execFileSync, spawnSync } from 'node:child_process';
import { accessSync, constants, existsSync } from 'node:fs';
import { delimiter, join } from 'node:path';

const NAMES = ['chromium', 'chromium-browser', 'google-chrome', 'google-chrome-stable'];
const MAC_PATHS = [
  '/Applications/Chromium.app/Contents/MacOS/Chromium',
  '/Applications/Google Chrome.app/Contents/MacOS/Google Chrome',
];

/** Path of a Chromium executable, or undefined. The environment variable CHROMIUM wins. */
export function findChromium() {
  const onPath = (process.env.PATH ?? '').split(delimiter).flatMap((folder) => NAMES.map((name) => join(folder, name)));
  return [process.env.CHROMIUM, ...onPath, ...MAC_PATHS].find((path) => path && isExecutable(path));
}

/** Path of a Chromium executable, installed from Debian's packages if none is there and this may be done. */
export function ensureChromium() {
  const found = findChromium();
  if (found !== undefined) return found;
  console.log('No Chromium found: installing it from Debian packages.');
  const root = process.getuid?.() === 0;
  const apt = (...args) =>
    spawnSync(root ? 'apt-get' : 'sudo', root ? args : ['-n', 'apt-get', ...args], {
      stdio: 'inherit',
      env: { ...process.env, DEBIAN_FRONTEND: 'noninteractive' },
    });
  apt('update', '-qq');
  apt('install', '-y', '-qq', '--no-install-recommends', 'chromium');
  const installed = findChromium();
  if (installed === undefined) {
    throw new Error(
      'No Chromium: expected one on the PATH or in the variable CHROMIUM, found none, and apt-get could not install it. ' +
        'Install Chromium or Chrome, or set CHROMIUM to its path.',
    );
  }
  return installed;
}

/** Folder with Chromium's Vulkan loader and SwiftShader, or undefined. */
export function findSwiftShader() {
  const folders = ['/usr/lib/chromium', '/usr/lib/chromium-browser', '/opt/google/chrome', '/usr/lib64/chromium'];
  return folders.find((folder) => existsSync(join(folder, 'vk_swiftshader_icd.json')));
}

/** Flags under which WebGPU runs on SwiftShader and a canvas is really presented, so that screenshots are right. */
export const SWIFTSHADER_FLAGS = [
  '--no-sandbox',
  '--enable-unsafe-webgpu',
  '--use-angle=swiftshader',
  '--enable-unsafe-swiftshader',
  '--enable-features=Vulkan',
  '--use-vulkan=swiftshader',
];

const SYSTEM_FLAGS = ['--no-sandbox', '--enable-unsafe-webgpu', '--ignore-gpu-blocklist'];
const SYSTEM_LINUX_FLAGS = ['--enable-features=Vulkan', '--use-angle=vulkan'];

/** Flags for SwiftShader, the same everywhere; GAUSSIAN_SPLAT_GPU=system takes the machine's own GPU. */
export function gpuFlags() {
  if (process.env.GAUSSIAN_SPLAT_GPU !== 'system') return SWIFTSHADER_FLAGS;
  return [...SYSTEM_FLAGS, ...(process.platform === 'linux' ? SYSTEM_LINUX_FLAGS : [])];
}

/** Version line of a Chromium, for logs. */
export function chromiumVersion(executable) {
  return execFileSync(executable, ['--version'], { encoding: 'utf8' }).trim();
}

function isExecutable(path) {
  try {
    accessSync(path, constants.X_OK);
    return true;
  } catch {
    return false;
  }
}
