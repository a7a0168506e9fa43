/** The camera of the element, for tests: grammar, poses, gestures. */
export { CameraController } from '../../../packages/element/src/viewer/camera-controller.js';
export {
  poseOfView,
  type CameraView,
  type ViewContext,
} from '../../../packages/element/src/viewer/camera/camera-view.js';
export { Damper } from '../../../packages/element/src/viewer/camera/damper.js';
export { DoubleTap } from '../../../packages/element/src/viewer/camera/double-tap.js';
export {
  keyOf,
  orbitOf,
  panOf,
  pinchOf,
  wheelOf,
  type CameraAction,
} from '../../../packages/element/src/viewer/camera/gestures.js';
export {
  fieldOfViewGrammar,
  numberGrammar,
  orbitGrammar,
  readAttribute,
  targetGrammar,
  upGrammar,
  type AttributeGrammar,
} from '../../../packages/element/src/viewer/camera/grammar.js';
export { lengthGrammar, optionalLengthGrammar } from '../../../packages/element/src/viewer/camera/lengths.js';
export { OrbitCamera } from '../../../packages/element/src/viewer/camera/orbit-camera.js';
export {
  cameraOfPose,
  eyeOfPose,
  framingDistance,
  nearPlane,
  orbitAxes,
  toScene,
  toViewer,
  viewerFrame,
  type CameraPose,
} from '../../../packages/element/src/viewer/camera/orbit.js';
export { easingOf, pathThrough, unwound } from '../../../packages/element/src/viewer/camera/path.js';
export { project } from '../../../packages/element/src/viewer/camera/projection.js';
export { readViews } from '../../../packages/element/src/viewer/camera/read-views.js';
export { limitsOf, poseOf, type CameraSettings } from '../../../packages/element/src/viewer/camera/settings.js';
export { CameraOrbit, CameraTarget, FieldOfView } from '../../../packages/element/src/viewer/camera/values.js';
