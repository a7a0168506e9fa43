import type { Camera } from '@gaussian-splat/core';
import type { PerFrameSettings, RenderSettings, Rgba, SceneDepth } from '@gaussian-splat/renderer';
import type { GeneratorInput } from './inputs.js';

/** A frame to draw. */
export interface Frame {
  readonly camera: Camera;
  readonly target: GPUTexture;
  /** Premultiplied. */
  readonly background?: Rgba | undefined;
  /** Settings that differ from those at rest. */
  readonly settings?: Partial<PerFrameSettings> | undefined;
  /** Takes the depth of the splats, too. */
  readonly depth?: SceneDepth | undefined;
}

/** A filter between the renderer and the canvas. Independent of the runtime, which is loaded on demand. */
export interface FrameFilter {
  /** Inputs that the page may set. */
  readonly inputs: readonly GeneratorInput[];
  /** Settings that the frames which it takes need. */
  readonly settings?: Partial<RenderSettings> | undefined;
  /** Bytes of GPU memory of its own images. */
  readonly byteLength: number;
  /**
   * Shows a frame.
   * @param content Changes whenever the same camera would give another frame.
   * @param draw Renders the frame into the given target.
   */
  render(frame: Frame, content: string, draw: (frame: Frame) => void): void;
  /** Call if the last frame was incomplete and is drawn again. */
  invalidate(): void;
  close(): void;
}
