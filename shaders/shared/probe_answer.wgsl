// What lies under a point of the image: written by `probe_depth`, and made exact by `probe_surface`.
struct ProbeAnswer {
  // Depths of the splats behind which less than 90, 50 and 10 % of the light are left; 0 if more passes all.
  depths: vec3f,
  // 1 - transmittance of all splats.
  opacity: f32,
  // Slots of these splats.
  slots: vec3u,
  // Transmittance of the splats in front of the point's depth.
  in_front: f32,
  // Numbers of these splats among those of all pages, plus 1; 0 until `probe_surface` has found them.
  stored: vec3u,
}

const PROBE_LEVELS = 3u;

fn light_left(level: u32) -> f32 {
  return select(select(0.1, 0.5, level == 1u), 0.9, level == 0u);
}
