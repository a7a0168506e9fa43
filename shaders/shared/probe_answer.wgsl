// Result of a probe: written by `probe_depth`, refined by `probe_surface`.
struct ProbeAnswer {
  // Depths of the splats behind which less than 90, 50 and 10 % of the light are left; 0 if all splats together
  // transmit more.
  depths: vec3f,
  // 1 - transmittance of all splats.
  opacity: f32,
  // Slots of these splats.
  slots: vec3u,
  // Transmittance of the splats in front of the depth of the point.
  in_front: f32,
  // Indices of these splats among those of all blocks, plus 1; 0 until `probe_surface` has found them.
  stored: vec3u,
}

const PROBE_LEVELS = 3u;

fn light_left(level: u32) -> f32 {
  return select(select(0.1, 0.5, level == 1u), 0.9, level == 0u);
}
