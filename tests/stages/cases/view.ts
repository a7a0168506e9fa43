/** Values of a `View` without settings, for a page without levels of detail, and for a scene without a placement. */
export const DEFAULT_SETTINGS = {
  has_detail: 0,
  detail: 0,
  detail_fade: 0,
  splat_budget: 0,
  opacity: 1,
  crop_low: [-3e38, -3e38, -3e38],
  crop_high: [3e38, 3e38, 3e38],
} as const;
