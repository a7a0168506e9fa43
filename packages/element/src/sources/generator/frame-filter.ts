import type { Camera } from '@gaussian-splat/core';
import type { PerFrameSettings, RenderSettings, Rgba, SceneDepth } from '@gaussian-splat/renderer';
import type { GeneratorInput } from './inputs.js';

/** Parameters of a frame that is to be drawn. */
export interface Frame {
  readonly camera: Camera;
  readonly target: GPUTexture;
  /** Premultiplied color behind the splats. */
  readonly background?: Rgba | undefined;
  /** Settings in which the frame differs from frames at rest. */
  readonly settings?: Partial<PerFrameSettings> | undefined;
  /** Receives the depth of the splats, if present. */
  readonly depth?: SceneDepth | undefined;
  /** Whether a script reads the canvas in the same task. */
  readonly isRead?: boolean;
}

/**
 * A filter that processes frames between the renderer and the canvas. The interface does not depend on the ONNX
 * runtime, which is loaded on demand.
 */
export interface FrameFilter {
  /** Inputs of the filter's models that the page may set. */
  readonly inputs: readonly GeneratorInput[];
  /** Renderer settings that the filter requires for its input frames. */
  readonly settings?: Partial<RenderSettings> | undefined;
  /** GPU memory of the filter's images, bytes. */
  readonly byteLength: number;
  /**
   * Draws a frame if it has changed, and presents it or a processed frame.
   * @param content Key of the scene's content. It changes whenever the same camera would give another frame.
   * @param draw Renders a frame into the target of its argument.
   */
  render(frame: Frame, content: string, draw: (frame: Frame) => void): void;
  /** Whether the last frame was presented unprocessed, although a run may process it. */
  readonly isPending: boolean;
  /** Fulfills when no run is in progress. Never rejects. */
  readonly idle: Promise<void>;
  /** Frees the images of frames of another size than those of the page, which scripts have read. */
  forgetCapture(): void;
  /** Call if the last frame was incomplete, so that the next one is drawn even if nothing has changed. */
  invalidate(): void;
  close(): void;
}
