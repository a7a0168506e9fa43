/** What elements have besides while they have `vr` or `ar`: present once their code is. */
export interface ImmersiveMethods {
  /** Starts VR, as a click on its button does: call it in the handler of a click, with nothing awaited before it. Rejects with GaussianSplatError `unsupported/xr`, `argument/activation`. */
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
