import type { ExternalFile, OnnxDtype, OnnxHeader } from '../onnx/header.js';
import { uncastableTypes } from '../onnx/webgpu-provider.js';
import type { ContractFault } from './contract-error.js';

/** Versions that ONNX Runtime 1.30 supports. */
export const RUNTIME_LIMITS = { irVersion: 13, oldestOpset: 7, newestOpset: 26 } as const;

/** Maximum number of files with weights. Exporters write one, or on request one for each large tensor. */
const MAX_EXTERNAL_FILES = 256;

/** Domains besides ONNX's own for whose operators onnxruntime-web has kernels. */
const RUNTIME_DOMAINS = ['com.microsoft', 'ai.onnx.ml'];

export interface CheckFileOptions {
  /**
   * Sizes in bytes of the available external files, by their location in the model. Undefined: missing and incomplete
   * files are not reported.
   */
  readonly files?: ReadonlyMap<string, number>;
}

/** Returns the faults of a file that do not depend on its contract: versions, operators, casts, external data. */
export function checkFile(header: OnnxHeader, { files }: CheckFileOptions): ContractFault[] {
  return [
    ...checkVersions(header),
    ...checkOperators(header),
    ...checkAttributes(header),
    ...uncastableTypes(header).map(uncastable),
    ...checkExternalFiles(header.externalFiles, files),
  ];
}

function checkVersions({ irVersion, opsets, operators }: OnnxHeader): ContractFault[] {
  const faults: ContractFault[] = [];
  const opset = opsets.get('ai.onnx');
  const { oldestOpset, newestOpset } = RUNTIME_LIMITS;
  if (irVersion > RUNTIME_LIMITS.irVersion) {
    faults.push({
      code: 'contract/opset',
      where: 'IR version',
      expected: `at most ${RUNTIME_LIMITS.irVersion}`,
      found: String(irVersion),
      remedy: 'save the model with an older IR version (model.ir_version in Python)',
    });
  }
  // A file whose operators are all from other domains need not declare the opset of ai.onnx.
  const isNeeded = [...operators.keys()].some((name) => !name.includes(':'));
  if (opset === undefined ? isNeeded : opset < oldestOpset || opset > newestOpset) {
    faults.push({
      code: 'contract/opset',
      where: 'opset of ai.onnx',
      expected: `${oldestOpset} to ${newestOpset}`,
      found: opset === undefined ? 'none' : String(opset),
      remedy: 'export the model with opset_version=18',
    });
  }
  return faults;
}

function checkOperators({ operators, functions }: OnnxHeader): ContractFault[] {
  return [...operators.keys()]
    .filter((name) => name.includes(':') && !functions.has(name))
    .filter((name) => !RUNTIME_DOMAINS.includes(name.slice(0, name.lastIndexOf(':'))))
    .map((name) => ({
      code: 'contract/operator',
      where: `operator ${name}`,
      expected: `operators of ONNX itself or of ${RUNTIME_DOMAINS.join(' or ')}`,
      found: `an operator of the domain ${name.slice(0, name.lastIndexOf(':'))}`,
      remedy: 'export the model with standard operators',
    }));
}

/**
 * Finds an attribute of a later opset than the file declares, which ONNX Runtime rejects. PyTorch's exporter writes
 * reductions of opset 18 into files of opset 17.
 */
function checkAttributes({ nodes, opsets }: OnnxHeader): ContractFault[] {
  const opset = opsets.get('ai.onnx') ?? Infinity;
  const later = nodes.find(({ operator, numbers }) => {
    const since = operator === 'ReduceSum' ? 13 : 18;
    return /^Reduce[A-Z]/.test(operator) && opset < since && numbers?.noop_with_empty_axes !== undefined;
  });
  if (later === undefined) return [];
  return [
    {
      code: 'contract/operator',
      where: `operator ${later.operator} (${later.outputs[0]})`,
      expected: `attributes of opset ${opset}, as the file declares`,
      found: 'noop_with_empty_axes, of a later opset',
      remedy: 'export with opset_version=18: PyTorch exports 17 incorrectly',
    },
  ];
}

const uncastable = (dtype: OnnxDtype): ContractFault => ({
  code: 'contract/operator',
  where: 'operator Cast',
  expected: 'casts of types that ONNX Runtime in a page can cast',
  found: `a cast from or to ${dtype}`,
  remedy: 'store such numbers as uint8 (two of them for 16 bits), float16, int32 or float32',
});

function checkExternalFiles(external: readonly ExternalFile[], files: CheckFileOptions['files']): ContractFault[] {
  if (external.length <= MAX_EXTERNAL_FILES) return external.flatMap((file) => checkExternalFile(file, files));
  return [
    {
      code: 'contract/external-data',
      where: 'external data',
      expected: `at most ${MAX_EXTERNAL_FILES} files of weights beside a model`,
      found: String(external.length),
      remedy: 'write the weights into one file: onnx.save_model(model, path, save_as_external_data=True)',
    },
  ];
}

function checkExternalFile({ location, byteLength }: ExternalFile, files: CheckFileOptions['files']): ContractFault[] {
  const fault = (expected: string, found: string, remedy: string): ContractFault[] => [
    { code: 'contract/external-data', where: `external data ${JSON.stringify(location)}`, expected, found, remedy },
  ];
  if (!isInside(location)) {
    return fault('a path inside the folder of the model', 'a path outside it', 'save the model with plain file names');
  }
  const size = files?.get(location);
  if (files === undefined || (size !== undefined && size >= byteLength)) return [];
  return size === undefined
    ? fault('this file beside the model', 'none', 'put it beside the model; it holds weights')
    : fault(`at least ${byteLength} bytes`, `${size}`, 'copy the file again; it is incomplete');
}

/** Whether a relative path stays inside its folder on every operating system. */
export function isInside(location: string): boolean {
  const parts = location.split(/[/\\]/);
  return location !== '' && !/^[a-z][a-z0-9+.-]*:/i.test(location) && parts[0] !== '' && !parts.includes('..');
}
