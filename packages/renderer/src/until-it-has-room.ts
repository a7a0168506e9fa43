/** Frames drawn at most: each allocates a quarter more than the one before lacked. */
const MAX_DRAWS = 4;

/** Draws until there was room for all that a frame should show, at most four times. @param draw returns whether there was room */
export async function untilItHasRoom(draw: () => Promise<boolean>): Promise<void> {
  for (let draws = 0; draws < MAX_DRAWS; draws++) if (await draw()) return;
}
