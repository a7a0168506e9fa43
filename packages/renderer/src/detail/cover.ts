/**
 * What a splat covers, as a share of its own area 2π √|Σ|: its opacity, as long as that is at most 1. A merged splat may have to cover more
 * than its area: an opacity above 1, cut off where it would be opaque, gives it a flat top (∫ min(1, o e^(−r²/2)) = 2π (1 + ln o)).
 */
export const coverOfOpacity = (opacity: number): number => (opacity <= 1 ? opacity : 1 + Math.log(opacity));

/** Most that a splat may cover: opacities end at e. */
const MOST_COVER = 2;

/** The opacity of a splat that covers so much of its area. */
export function opacityOfCover(cover: number): number {
  return cover <= 1 ? cover : Math.exp(Math.min(MOST_COVER, cover) - 1);
}
