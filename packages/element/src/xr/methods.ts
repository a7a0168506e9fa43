/** Methods of elements with `vr` or `ar`, present once their code has loaded. */
export interface ImmersiveMethods {
  /**
   * Starts VR, like a click on its button: call it in a click handler, without an earlier await. Rejects with
   * GaussianSplatError `unsupported/xr`, `argument/activation`.
   */
  activateVR?(): Promise<void>;
  /** The same for AR. */
  activateAR?(): Promise<void>;
  /** Leaves VR or AR. */
  exitXR?(): void;
  /** Whether VR can be started now. */
  readonly canActivateVR?: boolean;
  /** Whether AR can be started now. */
  readonly canActivateAR?: boolean;
}
