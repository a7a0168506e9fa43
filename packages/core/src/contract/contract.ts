import type { ShDegree, SplatFilter } from '../gaussian-cloud.js';
import type { Vector3 } from '../vector.js';

/**
 * A Gaussian Generator contract, version 1: the meaning of an ONNX file's inputs and the layout of its outputs.
 * docs/contract.md documents it with examples; contract.schema.json is its JSON Schema.
 */
export interface Contract {
  /** Address of the JSON Schema for text editors; readers of contracts ignore it. */
  readonly $schema?: string;
  readonly version: 1;
  /** Display name of the model. */
  readonly name?: string;
  /** Meaning of each input of the ONNX file, by its name; `{}` for a file without inputs. */
  readonly inputs: Readonly<Record<string, InputBinding>>;
  /** Layout of the Gaussian outputs. */
  readonly outputs: OutputBinding;
  /**
   * Maximum number of Gaussians in one run; required if the file leaves their number N symbolic. If the outputs have a
   * `count`, `nMax` may be less than N: the rows after `nMax` are padding.
   */
  readonly nMax?: number;
  /** Axis of instances of a model that computes several instances in one run. */
  readonly instances?: Instances;
  /** Element type of the Gaussian outputs. Optional, because the file has it; a declared type is checked. */
  readonly dtype?: 'float32' | 'float16';
  /** Degree of the spherical harmonics. Optional, because it follows from the shape; a declared degree is checked. */
  readonly shDegree?: ShDegree;
  /** Box around all centers at all times, in world units, for default controls, poses and shapes. */
  readonly bounds?: { readonly min: Vector3; readonly max: Vector3 };
  /** Duration in seconds of the animation that the input `time` or `frame` plays. */
  readonly duration?: number;
  /** Frames per second of the input `frame`. */
  readonly fps?: number;
  readonly coordinates?: Coordinates;
  /**
   * Whether the model was trained with opacity compensation for the variance that the screen-space filter adds.
   * Default: false.
   */
  readonly antialiased?: boolean;
  /** Screen-space low-pass filter of training; overrides {@link antialiased}. */
  readonly filter?: SplatFilter;
  /** SPDX identifier, or a short description. */
  readonly license?: string;
  /** Author to credit. */
  readonly attribution?: string;
}

/**
 * The axis of a model that computes several instances in one run. It is a symbolic dimension, and the first of every
 * Gaussian output, of the count, and of the inputs that may differ between instances. The other dimensions are those of
 * one instance, with N fixed. All instances of a run share the inputs without the axis.
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

/** Order of the 16 numbers of a matrix that acts on column vectors. Default: `row-major`, as in PyTorch. */
export type MatrixOrder = 'row-major' | 'column-major';

/**
 * Directions of the camera's x, y and z axes: left or right, up or down, forward or back. The default `RDF` is the
 * convention of OpenCV, `RUB` that of OpenGL, and `LUF` that of PyTorch3D and Visionary.
 */
export type CameraAxes = 'RDF' | 'RDB' | 'RUF' | 'RUB' | 'LDF' | 'LDB' | 'LUF' | 'LUB';

/** Order of the components of a quaternion. */
export type QuaternionOrder = 'wxyz' | 'xyzw';

/** Order of harmonics: `coefficient-major` is [(d+1)², 3], `channel-major` is [3, (d+1)²] as in INRIA's PLY files. */
export type ShOrder = 'coefficient-major' | 'channel-major';

/** World-to-camera matrix: [4,4] or flat [16], float32. */
export interface ViewInput {
  readonly role: 'view';
  readonly order?: MatrixOrder;
  readonly axes?: CameraAxes;
}

/** Camera-to-world matrix, the inverse of `view`: [4,4] or flat [16], float32. Its last column is the position of the eye. */
export interface CameraToWorldInput {
  readonly role: 'camera_to_world';
  readonly order?: MatrixOrder;
  readonly axes?: CameraAxes;
}

/** Intrinsics of the camera: [3,3] float32, row-major, fx 0 cx, 0 fy cy, 0 0 1; or [4] float32, fx, fy, cx, cy. */
export interface IntrinsicsInput {
  readonly role: 'intrinsics';
  /** `normalized`: focal lengths and principal point as fractions of the image's width and height. */
  readonly unit: 'pixels' | 'normalized';
}

/** Matrix from camera to clip space: [4,4] or flat [16], float32. Clip space has x right, y up, and depth 0..1 as in WebGPU. */
export interface ProjectionInput {
  readonly role: 'projection';
  readonly order?: MatrixOrder;
  /** Axes of the camera space that the matrix transforms. */
  readonly axes?: CameraAxes;
}

/** Matrix from world to clip space, projection · view: [4,4] or flat [16], float32. */
export interface ViewProjectionInput {
  readonly role: 'view_projection';
  readonly order?: MatrixOrder;
}

/** Position of the eye in world units: [3] float32. */
export interface CameraPositionInput {
  readonly role: 'camera_position';
}

/** Width and height of the image in pixels: [2] float32. */
export interface ViewportInput {
  readonly role: 'viewport';
}

/** Time of playback: one float32. `normalized` is a fraction 0..1 of `duration`, which the contract must then declare. */
export interface TimeInput {
  readonly role: 'time';
  readonly unit: 'seconds' | 'normalized';
}

/**
 * Index of the frame at the current time, 0 or more: one int32 or int64. It is 0 if the contract declares no `fps`. At the
 * end of `duration` it is the last frame.
 */
export interface FrameInput {
  readonly role: 'frame';
}

/** Seed of random numbers: one int32 or int64. Outputs of a model without a seed must be reproducible. */
export interface SeedInput {
  readonly role: 'seed';
}

/**
 * Pose of a skeleton, float32: [J,3] axis-angle in radians, [J,4] quaternions, or [J,3,3] row-major rotation matrices of J
 * joints. Each may be flat ([3J], [4J], [9J]). Or [P] model-specific parameters.
 */
export interface PoseInput {
  readonly role: 'pose';
  readonly format: 'axis-angle' | 'quaternion' | 'matrix' | 'parameters';
  /** Order of the quaternions' components; required for `quaternion`. */
  readonly quaternionOrder?: QuaternionOrder;
  /** Names of the J joints, in the order of the tensor. */
  readonly joints?: readonly string[];
  /** Index of the parent of each joint, -1 for roots; parents precede their children. */
  readonly parents?: readonly number[];
  /** Initial pose, flattened. Default: no rotations, or zeros for `parameters`. */
  readonly default?: readonly number[];
}

/** Coefficients of a body shape or an expression: [B] float32. */
export interface ShapeInput {
  readonly role: 'shape';
  /** Names of the B coefficients. */
  readonly names?: readonly string[];
  /** Initial coefficients. Default: zeros. */
  readonly default?: readonly number[];
}

/** A control for visitors, with the name of the input: float32, int32 or int64 of any fixed shape. */
export interface ControlInput {
  readonly role: 'control';
  /** Minimum and maximum of each element. */
  readonly range: readonly [min: number, max: number];
  /** Initial value: one number for all elements, or the flattened elements. */
  readonly default: number | readonly number[];
  /** Step between values. */
  readonly step?: number;
  /** Display name; default: the name of the input. */
  readonly label?: string;
}

/**
 * Output of the model's previous run, for physics and temporal filters: float32, float16 or int32, with the fixed shape
 * of that output. A run happens whenever another input changes. The state is reset to its default when the time goes
 * backward.
 */
export interface StateInput {
  readonly role: 'state';
  /** Name of the output that feeds the next run. */
  readonly output: string;
  /** Initial value of all elements. Default 0. */
  readonly default?: number;
}

/** One tensor of the Gaussians of the previous generator in a chain. */
export interface GaussiansInput extends Activations {
  readonly role: 'gaussians';
  /** Tensor that feeds this input. */
  readonly attribute: GaussianTensor;
}

/**
 * Image: [1,3,H,W] float32 or float16, red, green and blue planes in 0..1, top row first. [1,4,H,W] adds a plane of
 * alpha. [V,3,H,W] contains V images of one size, in the order that the page specifies.
 */
export interface ImageInput {
  readonly role: 'image';
}

/**
 * Depth of the frame, for a post-processor: [1,1,H,W] float32 or float16, top row first. It is the distance along the
 * camera's axis, in world units, at which half of the light is absorbed; 0 if more than half passes.
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

/** Content of a tensor of Gaussians: all attributes (`packed`), one attribute, or the number of valid rows (`count`). */
export type GaussianTensor = 'packed' | GaussianAttribute | 'count';

/** Encoding of the attributes. Each field is required if its attribute is present. */
export interface Activations {
  /** Content of the color columns of a packed tensor. */
  readonly color?: 'rgb' | 'sh';
  /** `linear`: opacities are in 0..1. `logit`: the reader applies the sigmoid. */
  readonly opacityActivation?: 'linear' | 'logit';
  /** `linear`: scales are standard deviations in world units. `log`: scales are their natural logarithms. */
  readonly scaleActivation?: 'linear' | 'log';
  readonly rotationOrder?: QuaternionOrder;
  readonly shOrder?: ShOrder;
}

/**
 * All attributes in one tensor [N, D], float32 or float16. A row contains the position (3), the covariance xx, xy, xz, yy,
 * yz, zz (6), the color (3) or spherical harmonics (3(d+1)²), and the opacity (1), unless {@link columns} declares
 * other columns.
 */
export interface PackedOutputs {
  readonly layout: 'packed';
  /** Name of the output. */
  readonly gaussians: string;
  readonly color: 'rgb' | 'sh';
  readonly opacityActivation: 'linear' | 'logit';
  /** Order of the harmonics; required if {@link color} is `sh`. */
  readonly shOrder?: ShOrder;
  /**
   * Attributes of a row in their order: positions (3), covariances (6) or scales (3) and rotations (4), colors (3) or sh,
   * and opacities (1). Default: positions, covariances, colors or sh, opacities.
   */
  readonly columns?: readonly GaussianAttribute[];
  /**
   * Encoding of the scales: standard deviations (`linear`) or their natural logarithms (`log`). Required if
   * {@link columns} contains scales.
   */
  readonly scaleActivation?: 'linear' | 'log';
  /** Order of the quaternions' components; required if {@link columns} contains rotations. */
  readonly rotationOrder?: QuaternionOrder;
  /** Name of an output [1] int32 or int64: number of valid rows of the N. */
  readonly count?: string;
}

/** One output for each attribute, by name. All are float32 or all are float16, with the same N. */
export interface SplitOutputs {
  readonly layout: 'split';
  /** [N,3] centers in world units. */
  readonly positions: string;
  /**
   * [N,6] covariances xx, xy, xz, yy, yz, zz in square world units, or [N,3,3]; an alternative to scales and rotations.
   */
  readonly covariances?: string;
  /** [N,3] standard deviations along the local axes in world units; [N,1] or [N] for equal axes. */
  readonly scales?: string;
  readonly scaleActivation?: 'linear' | 'log';
  /** [N,4] quaternions, local axes to world; not necessarily normalized. */
  readonly rotations?: string;
  readonly rotationOrder?: QuaternionOrder;
  /** [N,3] red, green and blue in 0..1, or [N,4], whose fourth component is ignored; an alternative to {@link sh}. */
  readonly colors?: string;
  /** Spherical harmonics: [N,(d+1)²,3] or [N,3,(d+1)²] according to {@link shOrder}, or [N,3(d+1)²]. */
  readonly sh?: string;
  readonly shOrder?: ShOrder;
  /** [N] or [N,1] opacities. */
  readonly opacities: string;
  readonly opacityActivation: 'linear' | 'logit';
  /** Name of an output [1] int32 or int64: number of valid rows of the N. */
  readonly count?: string;
}

/**
 * Layout of Visionary's exporters, in two tensors. `gaussians` is [N,10]: position, opacity 0..1, and covariance xx, xy,
 * xz, yy, yz, zz. The other is `colors`, [N,3] or [N,4] whose fourth component is padding, or `sh`, coefficient-major
 * harmonics [N,3(d+1)²].
 */
export interface VisionaryOutputs {
  readonly layout: 'visionary';
  readonly gaussians: string;
  /** Name of the output with colors; exactly one of `colors` and `sh` is required. */
  readonly colors?: string;
  readonly sh?: string;
  readonly count?: string;
}

/** Output of a post-processor: one tensor [1,3,H,W], red, green and blue planes in 0..1. A fourth plane is ignored. */
export interface ImageOutputs {
  readonly layout: 'image';
  readonly image: string;
}

export type OutputBinding = PackedOutputs | SplitOutputs | VisionaryOutputs | ImageOutputs;
