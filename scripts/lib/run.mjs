/** Child processes of the scripts: output passes through, a failure ends the script. */
import { spawn, spawnSync } from 'node:child_process';
import { fileURLToPath } from 'node:url';

export const root = fileURLToPath(new URL('../../', import.meta.url));

/** TypeScript's native compiler. Tests and scripts that parse programs need the API of the older compiler. */
export const TSC = 'node_modules/typescript-7/bin/tsc';

/** Runs a command, in the project's root by default, and returns its exit status. */
export function run(command, args, { env = {}, stdio = 'inherit', cwd = root } = {}) {
  const result = spawnSync(command, args, { cwd, stdio, env: { ...process.env, ...env } });
  if (result.error) throw result.error;
  return result.status ?? 1;
}

/** Runs a command and ends this process if it fails. */
export function must(command, args, options) {
  const status = run(command, args, options);
  if (status !== 0) {
    console.error(`failed with status ${status}: ${command} ${args.join(' ')}`);
    process.exit(status);
  }
}

/** The same in the background: resolves when the command has ended. */
export async function mustSoon(command, args, { cwd = root } = {}) {
  const child = spawn(command, args, { cwd, stdio: 'inherit' });
  const status = await new Promise((resolve, reject) => child.on('error', reject).on('close', resolve));
  if (status === 0) return;
  console.error(`failed with status ${status}: ${command} ${args.join(' ')}`);
  process.exit(status ?? 1);
}
