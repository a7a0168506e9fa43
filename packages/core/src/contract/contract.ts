import type { ShDegree, SplatFilter } from '../gaussian-cloud.js';
import type { Vector3 } from '../vector.js';

/**
 * A Gaussian Generator contract, version 1: the meaning of an ONNX file's inputs and the layout of its outputs.
 * Documentation with examples: docs/contract.md; JSON Schema: contract.schema.json.
 */
export interface Contract {
  /** Address of the JSON Schema, for editors; not read. */
  readonly $schema?: string;
  readonly version: 1;
  /** Display name. */
  readonly name?: string;
  /** Meaning of each input of the ONNX file, by its name; `{}` for a file without inputs. */
  readonly inputs: Readonly<Record<string, InputBinding>>;
  /** Layout of the Gaussian outputs. */
  readonly outputs: OutputBinding;
  /**
   * Maximum number of Gaussians in one run: required if the file leaves their number N symbolic. With a `count` it may
   * be less than N: rows after it are padding.
   */
  readonly nMax?: number;
  /** For a model that computes several instances in one run. */
  readonly instances?: Instances;
  /** Element type of the Gaussian outputs. It follows from the file; declare it to have it checked. */
  readonly dtype?: 'float32' | 'float16';
  /** Degree of the spherical harmonics. It follows from the shape; declare it to have it checked. */
  readonly shDegree?: ShDegree;
  /** Box around all centers at all times, in world units, for default controls, poses and shapes. */
  readonly bounds?: { readonly min: Vector3; readonly max: Vector3 };
  /** Duration in seconds of the animation of the input `time` or `frame`. */
  readonly duration?: number;
  /** Frames per second of the input `frame`. */
  readonly fps?: number;
  readonly coordinates?: Coordinates;
  /**
   * Whether the model was trained with opacity compensation for the screen-space dilation (Mip-Splatting style).
   * Default false.
   */
  readonly antialiased?: boolean;
  /** The screen-space low-pass filter of training; overrides `antialiased`. */
  readonly filter?: SplatFilter;
  /** SPDX identifier, or a short description. */
  readonly license?: string;
  /** Author to credit. */
  readonly attribution?: string;
}

/**
 * A symbolic axis that comes first in every Gaussian output, in the count, and in the inputs that may differ between
 * instances. The remaining dimensions are those of one instance, with N fixed. Inputs without the axis are shared by
 * all instances of a run.
 */
export interface Instances {
  /** Name of the symbolic dimension in the file. */
  readonly axis: string;
  /** Maximum number of instances in one run. */
  readonly most: number;
}

/** Coordinate system of the Gaussians. Default: y down, right-handed, as in training; units unknown. */
export interface Coordinates {
  readonly up?: '+x' | '-x' | '+y' | '-y' | '+z' | '-z';
  readonly handedness?: 'right' | 'left';
  /** Meters in one world unit. */
  readonly metresPerUnit?: number;
}

/** Layout of the 16 numbers of a matrix that acts on column vectors; default `row-major`, as in PyTorch. */
export type MatrixOrder = 'row-major' | 'column-major';

/**
 * Directions of the camera's x, y and z axes: left or right, up or down, forward or back. `RDF` is OpenCV's and the
 * default, `RUB` OpenGL's, `LUF` PyTorch3D's and Visionary's.
 */
export type CameraAxes = 'RDF' | 'RDB' | 'RUF' | 'RUB' | 'LDF' | 'LDB' | 'LUF' | 'LUB';

/** Order of the components of a quaternion. */
export type QuaternionOrder = 'wxyz' | 'xyzw';

/** Innermost dimension: red, green and blue ([(d+1)², 3]), or the coefficients ([3, (d+1)²], as in INRIA's PLY files). */
export type ShOrder = 'coefficient-major' | 'channel-major';

/** [4,4] float32: world to camera. */
export interface ViewInput {
  readonly role: 'view';
  readonly order?: MatrixOrder;
  readonly axes?: CameraAxes;
}

/** [4,4] float32: camera to world, the inverse of `view`; its last column is the eye. */
export interface CameraToWorldInput {
  readonly role: 'camera_to_world';
  readonly order?: MatrixOrder;
  readonly axes?: CameraAxes;
}

/** [3,3] float32, row-major: fx 0 cx, 0 fy cy, 0 0 1; or [4]: fx, fy, cx, cy. */
export interface IntrinsicsInput {
  readonly role: 'intrinsics';
  /** `normalized`: focal lengths and principal point as fractions of the image's width and height. */
  readonly unit: 'pixels' | 'normalized';
}

/** [4,4] float32: camera to clip space, depth 0..1 from near to far as in WebGPU, x right and y up. */
export interface ProjectionInput {
  readonly role: 'projection';
  readonly order?: MatrixOrder;
  /** Axes of the camera space that the matrix transforms. */
  readonly axes?: CameraAxes;
}

/** [4,4] float32: world to clip space, the product projection · view. */
export interface ViewProjectionInput {
  readonly role: 'view_projection';
  readonly order?: MatrixOrder;
}

/** [3] float32: the eye, in world units. */
export interface CameraPositionInput {
  readonly role: 'camera_position';
}

/** [2] float32: width and height of the image in pixels. */
export interface ViewportInput {
  readonly role: 'viewport';
}

/** One float32: seconds, or a fraction 0..1 of the contract's `duration`, which must then be declared. */
export interface TimeInput {
  readonly role: 'time';
  readonly unit: 'seconds' | 'normalized';
}

/**
 * One int32 or int64: index of a frame, 0 or more. With `fps` it is the frame at the current time, at the end of
 * `duration` the last one; without `fps` it is 0.
 */
export interface FrameInput {
  readonly role: 'frame';
}

/** One int32 or int64: seed of a generator of random numbers. Without it outputs must be reproducible. */
export interface SeedInput {
  readonly role: 'seed';
}

/**
 * [J,3] axis-angle in radians, [J,4] quaternions, [J,3,3] row-major rotation matrices, any of them flat ([3J], [4J],
 * [9J]), or [P] model-specific parameters; float32.
 */
export interface PoseInput {
  readonly role: 'pose';
  readonly format: 'axis-angle' | 'quaternion' | 'matrix' | 'parameters';
  /** Required for quaternions. */
  readonly quaternionOrder?: QuaternionOrder;
  /** Names of the J joints, in the order of the tensor. */
  readonly joints?: readonly string[];
  /** Index of the parent of each joint, -1 for roots; parents precede their children. */
  readonly parents?: readonly number[];
  /** Flattened; default: no rotation, or zeros. */
  readonly default?: readonly number[];
}

/** [B] float32: coefficients of a body shape or an expression. */
export interface ShapeInput {
  readonly role: 'shape';
  /** Names of the B coefficients. */
  readonly names?: readonly string[];
  /** Default: zeros. */
  readonly default?: readonly number[];
}

/** Float32, int32 or int64 of any fixed shape: a control for visitors, with the name of the input. */
export interface ControlInput {
  readonly role: 'control';
  /** Minimum and maximum of each element. */
  readonly range: readonly [min: number, max: number];
  /** One number for all elements, or the flattened elements. */
  readonly default: number | readonly number[];
  /** Step between values. */
  readonly step?: number;
  /** Display name; default: the name of the input. */
  readonly label?: string;
}

/**
 * Output of the model's previous run: float32, float16 or int32 of any fixed shape, that of an output. Used for physics
 * and temporal filters. A run happens whenever another input changes; when the time goes back, the state is reset.
 */
export interface StateInput {
  readonly role: 'state';
  /** Name of the output that feeds the next run. */
  readonly output: string;
  /** Initial value of all elements. Default 0. */
  readonly default?: number;
}

/** Gaussians of the previous generator in a chain, in one of the output layouts: one input for each tensor. */
export interface GaussiansInput extends Activations {
  readonly role: 'gaussians';
  /** Tensor of the layout that feeds this input. */
  readonly attribute: GaussianTensor;
}

/**
 * [1,3,H,W] float32 or float16: red, green and blue planes in 0..1, top row first. [1,4,H,W] includes alpha; [V,3,H,W]
 * are V images of one size, in the order that the page specifies.
 */
export interface ImageInput {
  readonly role: 'image';
}

/**
 * Input of a post-processor. [1,1,H,W] float32 or float16: the depth of the frame along the camera's axis, in world
 * units, at which half of the light is absorbed, top row first; 0 if more than half passes.
 */
export interface DepthInput {
  readonly role: 'depth';
}

/** Role of one input of the ONNX file. */
export type InputBinding =
  | ViewInput
  | CameraToWorldInput
  | IntrinsicsInput
  | ProjectionInput
  | ViewProjectionInput
  | CameraPositionInput
  | ViewportInput
  | TimeInput
  | FrameInput
  | SeedInput
  | PoseInput
  | ShapeInput
  | ControlInput
  | StateInput
  | GaussiansInput
  | ImageInput
  | DepthInput;

/** Attributes of a Gaussian. */
export type GaussianAttribute = 'positions' | 'covariances' | 'scales' | 'rotations' | 'colors' | 'sh' | 'opacities';

/** A tensor of Gaussians: all attributes, one attribute, or the live count. */
export type GaussianTensor = 'packed' | GaussianAttribute | 'count';

/** Encoding of the numbers. Each field is required if its attribute is present; nothing is guessed. */
export interface Activations {
  /** Content of the color columns of a packed tensor. */
  readonly color?: 'rgb' | 'sh';
  /** Opacities in 0..1, or before the sigmoid. */
  readonly opacityActivation?: 'linear' | 'logit';
  /** Scales as standard deviations, or as their natural logarithms. */
  readonly scaleActivation?: 'linear' | 'log';
  readonly rotationOrder?: QuaternionOrder;
  readonly shOrder?: ShOrder;
}

/**
 * One tensor [N, D], float32 or float16: position (3), covariance xx, xy, xz, yy, yz, zz (6), color (3) or spherical
 * harmonics (3(d+1)²), opacity (1); or in the order of `columns`.
 */
export interface PackedOutputs {
  readonly layout: 'packed';
  /** Name of the output. */
  readonly gaussians: string;
  readonly color: 'rgb' | 'sh';
  readonly opacityActivation: 'linear' | 'logit';
  /** Required with `sh`. */
  readonly shOrder?: ShOrder;
  /**
   * Attributes of a row, in order: positions (3), covariances (6) or scales (3) and rotations (4), colors (3) or sh,
   * opacities (1). Default: positions, covariances, colors, opacities.
   */
  readonly columns?: readonly GaussianAttribute[];
  /** Required if `columns` contains scales. */
  readonly scaleActivation?: 'linear' | 'log';
  /** Required if `columns` contains rotations. */
  readonly rotationOrder?: QuaternionOrder;
  /** Name of an output [1] int32 or int64: number of live rows of the N. */
  readonly count?: string;
}

/** One tensor for each attribute, all float32 or all float16, all with the same N. Values are names of outputs. */
export interface SplitOutputs {
  readonly layout: 'split';
  /** [N,3] centers in world units. */
  readonly positions: string;
  /** [N,6] xx, xy, xz, yy, yz, zz in square world units, or [N,3,3]. Alternative to scales and rotations. */
  readonly covariances?: string;
  /** [N,3] standard deviations in world units, along the rotated axes; [N,1] or [N] for all three. */
  readonly scales?: string;
  readonly scaleActivation?: 'linear' | 'log';
  /** [N,4] quaternions, local axes to world; not necessarily normalized. */
  readonly rotations?: string;
  readonly rotationOrder?: QuaternionOrder;
  /** [N,3] red, green, blue in 0..1, or [N,4], whose fourth component is ignored. Alternative to `sh`. */
  readonly colors?: string;
  /** [N,(d+1)²,3] or [N,3,(d+1)²], according to `shOrder`, or flat. */
  readonly sh?: string;
  readonly shOrder?: ShOrder;
  /** [N] or [N,1]. */
  readonly opacities: string;
  readonly opacityActivation: 'linear' | 'logit';
  /** Name of an output [1] int32 or int64: number of live rows of the N. */
  readonly count?: string;
}

/**
 * Layout of Visionary's exporters: one tensor [N,10] = position, opacity 0..1, covariance xx, xy, xz, yy, yz, zz; and
 * another with colors [N,4] (the fourth is padding) or [N,3], or coefficient-major harmonics [N,3(d+1)²].
 */
export interface VisionaryOutputs {
  readonly layout: 'visionary';
  readonly gaussians: string;
  /** Alternative to `sh`. */
  readonly colors?: string;
  readonly sh?: string;
  readonly count?: string;
}

/** Output of a post-processor: one tensor [1,3,H,W] of red, green and blue planes in 0..1; a fourth plane is ignored. */
export interface ImageOutputs {
  readonly layout: 'image';
  readonly image: string;
}

export type OutputBinding = PackedOutputs | SplitOutputs | VisionaryOutputs | ImageOutputs;
