/** Maximum number of draws: each allocates a quarter more than the previous one lacked. */
const MAX_DRAWS = 4;

/** Draws until everything fitted, at most four times. @param draw Returns whether everything fitted. */
export async function untilItHasRoom(draw: () => Promise<boolean>): Promise<void> {
  for (let draws = 0; draws < MAX_DRAWS; draws++) if (await draw()) return;
}
