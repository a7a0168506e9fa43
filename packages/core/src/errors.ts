/** Errors for users. Each one has a stable code, the expected and the found value, the place, and a remedy. */

/** Stable codes. The part before the slash is the family that `<gaussian-splat>` reports as `error.code`. */
export type ErrorCode =
  /** The bytes are not a Gaussian splat scene in any known format. */
  | 'decode/unknown-format'
  /** The file is a web page (often a 404 or a login page served with status 200). */
  | 'decode/html'
  /** The file is a git-LFS pointer: the real file was never downloaded. */
  | 'decode/lfs-pointer'
  /** A known format without splats in it, for example a PLY triangle mesh or point cloud. */
  | 'decode/not-splats'
  /** The header of a known format contradicts itself or its specification. */
  | 'decode/header'
  /** The file ends before the data that its header declares. */
  | 'decode/truncated'
  /** The data after the header contradict it, or a compressed stream is damaged. */
  | 'decode/corrupt'
  /** A known format, in a version or variant that this reader does not support. */
  | 'decode/unsupported'
  /** A scene file with no valid splat in it. */
  | 'decode/empty'
  /**
   * The server could not be reached, or the browser blocked the response (CORS, mixed content, offline): for a scene,
   * or for code that is loaded on demand.
   */
  | 'network/unreachable'
  /** The server answered with an HTTP error status. */
  | 'network/status'
  /** The connection ended before the last byte. */
  | 'network/interrupted'
  /** The file was replaced on its server while it was loading. */
  | 'network/changed'
  /** The URL cannot be parsed. */
  | 'network/url'
  /** The page is not in a secure context, so that WebGPU is unavailable. */
  | 'unsupported/insecure-context'
  /** The browser has no WebGPU. */
  | 'unsupported/no-webgpu'
  /** The browser provides no GPU adapter. */
  | 'unsupported/no-adapter'
  /** A limit or feature of the GPU device is insufficient. */
  | 'unsupported/limits'
  /** A script of the page has replaced a built-in function of JavaScript. */
  | 'unsupported/page'
  /** Every variant of the renderer fails its self-test on this device: the shader compiler or driver is faulty. */
  | 'unsupported/wrong-image'
  /** WebGPU is unavailable, and WebGL 2 cannot show the requested content, or fails. */
  | 'unsupported/webgl'
  /** A VR or AR session is unavailable: no device, no browser support, or no permission. */
  | 'unsupported/xr'
  /** The scene needs a buffer that is larger than the GPU device allows. */
  | 'out-of-memory/buffer-limit'
  /** The scene needs more GPU memory than its budget, or than the rest of the device's budget. */
  | 'out-of-memory/budget'
  /** The GPU device failed to allocate memory. */
  | 'out-of-memory/allocation'
  /** The GPU device was lost and could not be recovered. */
  | 'device-lost/unrecoverable'
  /**
   * An ONNX file and its Gaussian Generator contract do not match: see `ContractError`, and docs/contract.md for each
   * code.
   */
  | ContractErrorCode
  /** The camera that a caller passed is invalid. */
  | 'argument/camera'
  /** The arrays of a cloud that a caller passed do not match its count and degree. */
  | 'argument/cloud'
  /** A scene has more cuts than one scene may have. */
  | 'argument/splat-cut'
  /** The splat shader of a page does not compile as WGSL, or is not allowed. */
  | 'argument/splat-shader'
  /** A method was called outside of a user activation. */
  | 'argument/activation'
  /** A value that a caller passed violates the documented contract of a function. */
  | 'argument/value';

/** Stable codes of all faults of an ONNX file, its contract and its output. */
export type ContractErrorCode =
  /** The contract cannot be read as JSON. */
  | 'contract/json'
  /** A field of the contract is missing, unknown, or invalid under the schema. */
  | 'contract/schema'
  /** The version of the contract is not supported by this reader. */
  | 'contract/version'
  /** There is no contract, and the names of inputs and outputs are too ambiguous to infer one. */
  | 'contract/inference'
  /** An input of the ONNX file has no role in the contract. */
  | 'contract/unbound-input'
  /** The contract names a tensor that the ONNX file does not have. */
  | 'contract/missing-tensor'
  /** The shape of a tensor does not match its role. */
  | 'contract/shape'
  /** The element type of a tensor does not match its role, or the type that the contract declares. */
  | 'contract/dtype'
  /** Outputs have different numbers of Gaussians; or the number is above `nMax`, or symbolic without `nMax`. */
  | 'contract/rows'
  /** The shape of a tensor matches no degree of spherical harmonics, or not the declared degree. */
  | 'contract/sh-degree'
  /**
   * The axis of instances violates its rules, or an instance has other results in a run of several instances than
   * alone.
   */
  | 'contract/instances'
  /** Fields of one contract contradict each other. */
  | 'contract/conflict'
  /** The file requires an IR version or an opset that is newer than the runtime supports. */
  | 'contract/opset'
  /** The file uses an operator of a domain that the runtime does not have. */
  | 'contract/operator'
  /** A file with external data is missing, too short, or outside the model's folder. */
  | 'contract/external-data'
  /** The runtime rejected or failed to run the model. */
  | 'contract/run'
  /** A value is NaN or infinite but must be finite. */
  | 'contract/not-finite'
  /** A covariance is not positive semi-definite, or a scale is negative, or a rotation is zero. */
  | 'contract/covariance'
  /** An opacity is outside 0..1. */
  | 'contract/opacity'
  /** The count of valid rows is negative or above the number of rows. */
  | 'contract/count'
  /** The same inputs gave different outputs although no input is a seed. */
  | 'contract/not-deterministic'
  /** Two models of a chain do not match, or a model is in an invalid position. */
  | 'contract/chain';

/** Information for correcting the error. Each field is a phrase without a full stop at its end. */
export interface ErrorDetails {
  /** Allowed value or content, for example `a number from 0 to 1`. */
  readonly expected: string;
  /** Value or content that was found instead, for example `1.5`. */
  readonly found: string;
  /** File, element, byte or property that the error is about. */
  readonly where: string;
  /** Suggested correction. */
  readonly remedy: string;
  /** Error of a lower level that caused this error; undefined for none. */
  readonly cause?: unknown;
}

/**
 * A `GaussianSplatError` as plain data, because structured clone (workers) drops the class and the fields of errors.
 */
export interface ErrorData extends Omit<ErrorDetails, 'cause'> {
  readonly code: ErrorCode;
}

/** The error class of all packages. */
export class GaussianSplatError extends Error implements ErrorDetails {
  override readonly name: string = 'GaussianSplatError';
  readonly code: ErrorCode;
  readonly expected: string;
  readonly found: string;
  readonly where: string;
  readonly remedy: string;

  constructor(code: ErrorCode, details: ErrorDetails) {
    const { expected, found, where, remedy, cause } = details;
    // Removes the full stop of a found value, because messages of browsers end with one.
    super(`${where}: expected ${expected}, found ${found.replace(/\.$/, '')}. ${capitalize(remedy)}. [${code}]`, {
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

  /** Returns plain data for `postMessage`, without the cause. {@link GaussianSplatError.fromData} restores the error. */
  toData(): ErrorData {
    const { code, expected, found, where, remedy } = this;
    return { code, expected, found, where, remedy };
  }

  static fromData(data: ErrorData): GaussianSplatError {
    return new GaussianSplatError(data.code, data);
  }
}

function capitalize(text: string): string {
  return text.charAt(0).toUpperCase() + text.slice(1);
}
