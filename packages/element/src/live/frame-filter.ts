import type { Camera } from '@gaussian-splat/core';
import type { PerFrameSettings, RenderSettings, Rgba, SceneDepth } from '@gaussian-splat/renderer';
import type { GeneratorInput } from './inputs.js';

/** A frame to draw. */
export interface Frame {
  readonly camera: Camera;
  readonly target: GPUTexture;
  /** Premultiplied. */
  readonly background?: Rgba | undefined;
  /** What is other than at rest. */
  readonly settings?: Partial<PerFrameSettings> | undefined;
  /** Takes the depth of the splats, too. */
  readonly depth?: SceneDepth | undefined;
}

/** Something between the renderer and the canvas. Knows no runtime: what does is loaded when first needed. */
export interface FrameFilter {
  /** What the page may set. */
  readonly inputs: readonly GeneratorInput[];
  /** Settings that the frames which it takes need. */
  readonly settings?: Partial<RenderSettings> | undefined;
  /** Bytes of GPU memory that its own pictures take. */
  readonly byteLength: number;
  /**
   * Shows a frame.
   * @param content changes whenever the same camera would give another picture
   * @param draw renders the frame into the target that it names
   */
  render(frame: Frame, content: string, draw: (frame: Frame) => void): void;
  /** The frame drawn last lacked something: it is drawn again. */
  invalidate(): void;
  close(): void;
}
