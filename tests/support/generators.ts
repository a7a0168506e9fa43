/** The small ONNX files of tests/fixtures/generators, and the real ones of the shared data. */
import { existsSync, readdirSync, readFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { bytesSource, readOnnxHeader, type OnnxHeader } from '@gaussian-splat/core/onnx';

const folder = fileURLToPath(new URL('../fixtures/generators/', import.meta.url));

export const fixturePath = (name: string): string => folder + name;
export const fixtureBytes = (name: string): Uint8Array => new Uint8Array(readFileSync(fixturePath(name)));
export const fixtureNames = (): string[] => readdirSync(folder).filter((name) => name.endsWith('.onnx'));
export const fixtureHeader = (name: string): Promise<OnnxHeader> =>
  readOnnxHeader(bytesSource(fixtureBytes(name), name));

/** The text of the contract beside a file, or undefined. */
export function fixtureSidecar(name: string): string | undefined {
  const path = fixturePath(name.replace(/\.onnx$/, '.contract.json'));
  return existsSync(path) ? readFileSync(path, 'utf8') : undefined;
}
