// Result of a probe: written by `probe_depth`, refined by `probe_surface`.
#import shared/probe_levels

struct ProbeAnswer {
  // Depths of the splats behind which less light is left than `light_left` of each level; 0 if all splats together
  // transmit more.
  depths: array<f32, PROBE_LEVELS>,
  // Slots of these splats.
  slots: array<u32, PROBE_LEVELS>,
  // Indices of these splats among those of all blocks, plus 1; 0 until `probe_surface` has found them.
  stored: array<u32, PROBE_LEVELS>,
  // Standard deviation of the middle splat along the ray, world units.
  thickness: f32,
  // 1 - transmittance of all splats.
  opacity: f32,
  // Transmittance of the splats in front of the depth of the point.
  in_front: f32,
}
