/**
 * Errors for people: what was expected, what was found, where, and what to do; with a code that never changes.
 */

/** Stable codes. The part before the slash is the family that `<gaussian-splat>` reports as `error.code`. */
export type ErrorCode =
  /** The bytes are not a Gaussian splat scene that any reader knows. */
  | 'decode/unknown-format'
  /** The file is a web page (often a 404 or a login page served with status 200). */
  | 'decode/html'
  /** The file is a git-LFS pointer: the real file was never downloaded. */
  | 'decode/lfs-pointer'
  /** A known format without splats in it, for example a PLY triangle mesh or point cloud. */
  | 'decode/not-splats'
  /** The header of a known format contradicts itself or its specification. */
  | 'decode/header'
  /** The file ends before the data that its header announces. */
  | 'decode/truncated'
  /** The body contradicts the header, or a compressed stream is damaged. */
  | 'decode/corrupt'
  /** A known format, in a version or variant that this reader does not read. */
  | 'decode/unsupported'
  /** A scene file with no valid splat in it. */
  | 'decode/empty'
  /** The server could not be reached, or the browser refused the answer (CORS, mixed content, offline): of a scene, or of code that is loaded when it is needed. */
  | 'network/unreachable'
  /** The server answered with an HTTP error status. */
  | 'network/status'
  /** The connection broke off before the last byte. */
  | 'network/interrupted'
  /** The URL cannot be parsed. */
  | 'network/url'
  /** The page cannot use WebGPU: no API, insecure context, no adapter, or a limit too low. */
  | 'unsupported/insecure-context'
  | 'unsupported/no-webgpu'
  | 'unsupported/no-adapter'
  | 'unsupported/limits'
  /** A script of the page has replaced a function of the language by another. */
  | 'unsupported/page'
  /** Every variant of the renderer fails its known answer on this device: its shader compiler or driver errs. */
  | 'unsupported/wrong-image'
  /** There is no WebGPU, and WebGL 2 in its place cannot show what is asked for, or fails. */
  | 'unsupported/webgl'
  /** There is no session of VR or AR: no device, no browser for it, or the page may not. */
  | 'unsupported/xr'
  /** The scene needs more GPU memory than a buffer or the device may hold. */
  | 'out-of-memory/buffer-limit'
  | 'out-of-memory/budget'
  | 'out-of-memory/allocation'
  /** The GPU device was lost and could not be brought back. */
  | 'device-lost/unrecoverable'
  /** An ONNX file and its Gaussian Generator contract do not fit: see `ContractError`, and docs/contract.md for each. */
  | ContractErrorCode
  /** A caller's argument breaks the documented contract of a function. */
  | 'argument/camera'
  | 'argument/cloud'
  /** A function of a page for its splats is not WGSL that compiles. */
  | 'argument/splat-shader'
  /** A method was called outside of a person's click. */
  | 'argument/activation'
  | 'argument/value';

/** Stable codes of everything that can be wrong between an ONNX file, its contract and what it writes. */
export type ContractErrorCode =
  /** The contract cannot be read as JSON. */
  | 'contract/json'
  /** A field of the contract is missing, unknown, or not what the schema asks for. */
  | 'contract/schema'
  /** The contract is of a version that this reader does not know. */
  | 'contract/version'
  /** There is no contract, and the names of inputs and outputs do not say enough to infer one. */
  | 'contract/inference'
  /** An input of the ONNX file has no role in the contract. */
  | 'contract/unbound-input'
  /** The contract names a tensor that the ONNX file does not have. */
  | 'contract/missing-tensor'
  /** A tensor's shape is not the one that its role asks for. */
  | 'contract/shape'
  /** A tensor's element type is not one that its role allows, or not the one that the contract declares. */
  | 'contract/dtype'
  /** Outputs disagree on the number of Gaussians, or it is above `nMax`, or symbolic without `nMax`. */
  | 'contract/rows'
  /** The degree of spherical harmonics that the shape tells is none, or not the one declared. */
  | 'contract/sh-degree'
  /** A model of several instances whose axis is not where it must be, or whose instances come out differently in one run and in several. */
  | 'contract/instances'
  /** Facts within one contract contradict each other. */
  | 'contract/conflict'
  /** The file asks for an IR version or an opset newer than the runtime knows. */
  | 'contract/opset'
  /** The file uses an operator of a domain that the runtime does not have. */
  | 'contract/operator'
  /** A file with external data is missing, too short, or outside the model's folder. */
  | 'contract/external-data'
  /** The runtime refused or failed to run the model. */
  | 'contract/run'
  /** A value is NaN or infinite where it must be finite. */
  | 'contract/not-finite'
  /** A covariance is not positive semi-definite, or a scale is negative, or a rotation is zero. */
  | 'contract/covariance'
  /** An opacity is outside 0..1. */
  | 'contract/opacity'
  /** The live count is negative or above the number of rows. */
  | 'contract/count'
  /** The same inputs gave other outputs although no input is a seed. */
  | 'contract/not-deterministic'
  /** Models of a chain do not fit one another, or stand where they cannot. */
  | 'contract/chain';

/** What a person needs to mend the fault. Every field is a full phrase without a trailing full stop. */
export interface ErrorDetails {
  /** What was expected. */
  readonly expected: string;
  /** What was found instead. */
  readonly found: string;
  /** File, element, byte or property in question. */
  readonly where: string;
  /** What to do about it. */
  readonly remedy: string;
  /** The lower-level error, if one caused this. */
  readonly cause?: unknown;
}

/** A `GaussianSplatError` as plain data: structured clone (workers) drops class and fields of errors. */
export interface ErrorData extends Omit<ErrorDetails, 'cause'> {
  readonly code: ErrorCode;
}

/** The one error class of all packages. */
export class GaussianSplatError extends Error implements ErrorDetails {
  override readonly name: string = 'GaussianSplatError';
  readonly code: ErrorCode;
  readonly expected: string;
  readonly found: string;
  readonly where: string;
  readonly remedy: string;

  constructor(code: ErrorCode, details: ErrorDetails) {
    const { expected, found, where, remedy, cause } = details;
    // Messages of browsers, which may be what was found, bring their own full stop.
    super(`${where}: expected ${expected}, found ${found.replace(/\.$/, '')}. ${capitalise(remedy)}. [${code}]`, {
      cause,
    });
    this.code = code;
    this.expected = expected;
    this.found = found;
    this.where = where;
    this.remedy = remedy;
  }

  /** Family of the code: `decode`, `network`, `unsupported`, `out-of-memory`, `device-lost`, `contract` or `argument`. */
  get family(): string {
    return this.code.slice(0, this.code.indexOf('/'));
  }

  /** Plain data that survives `postMessage`; {@link GaussianSplatError.fromData} restores it. */
  toData(): ErrorData {
    const { code, expected, found, where, remedy } = this;
    return { code, expected, found, where, remedy };
  }

  static fromData(data: ErrorData): GaussianSplatError {
    return new GaussianSplatError(data.code, data);
  }
}

function capitalise(text: string): string {
  return text.charAt(0).toUpperCase() + text.slice(1);
}
