/** Methods of elements with `vr` or `ar`. They are undefined until their code is loaded. */
export interface ImmersiveMethods {
  /**
   * Starts VR, like a click on its button. Call it in a click handler, without an earlier await. Rejects with
   * GaussianSplatError `unsupported/xr`, or `argument/activation` outside a click.
   */
  activateVR?(): Promise<void>;
  /**
   * Starts AR, like a click on its button. Call it in a click handler, without an earlier await. Rejects with
   * GaussianSplatError `unsupported/xr`, or `argument/activation` outside a click.
   */
  activateAR?(): Promise<void>;
  /** Ends the VR or AR session. */
  exitXR?(): void;
  /** Whether {@link activateVR} can start a session at present. */
  readonly canActivateVR?: boolean;
  /** Whether {@link activateAR} can start a session at present. */
  readonly canActivateAR?: boolean;
}
