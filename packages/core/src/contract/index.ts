export * from './contract.js';
export { checkContract } from './check-contract.js';
export { checkFile, RUNTIME_LIMITS, isInside, type CheckFileOptions } from './check-file.js';
export { checkBounds, checkOutputs, compareRuns, type OutputReport, type OutputTensor } from './check-outputs.js';
export type { ContractErrorCode } from '../errors.js';
export { ContractError, describeFault, type ContractErrorData, type ContractFault } from './contract-error.js';
export { hasInstances, ofInstances, oneInstance, outputsOfInstance } from './instances.js';
export { gaussianLayout, type AttributeSlice, type GaussianLayout } from './layout.js';
export { CONTRACT_VERSION, parseContract, tensorNames } from './parse-contract.js';
export { contractReport, type ReportSection } from './report.js';
export {
  carriesContract,
  CONTRACT_METADATA_KEY,
  resolveContract,
  sidecarName,
  sidecarPath,
  type ContractSource,
  type ContractSources,
  type ResolvedContract,
} from './resolve-contract.js';
export { CONTRACT_SCHEMA } from './schema.js';
export { bareDims, inputRule, shOrderOf } from './tensor-rules.js';
