/** Maximum number of draws. Each draw allocates a quarter more than the previous one lacked. */
const MAX_DRAWS = 4;

/**
 * Draws until everything has fitted the buffers, at most four times. @param draw Draws, and returns whether everything
 * fitted.
 */
export async function untilItHasRoom(draw: () => Promise<boolean>): Promise<void> {
  for (let draws = 0; draws < MAX_DRAWS; draws++) if (await draw()) return;
}
