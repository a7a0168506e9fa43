/** What a `View` says of levers where none is set, and of a page without levels of detail. */
export const WITHOUT_LEVERS = {
  has_detail: 0,
  detail: 0,
  detail_fade: 0,
  splat_budget: 0,
} as const;
