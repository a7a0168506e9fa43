/** What a `View` says of levers where none is set, of a page without levels of detail, and of a scene that is placed as it is. */
export const WITHOUT_LEVERS = {
  has_detail: 0,
  detail: 0,
  detail_fade: 0,
  splat_budget: 0,
  opacity: 1,
  crop_low: [-3e38, -3e38, -3e38],
  crop_high: [3e38, 3e38, 3e38],
} as const;
