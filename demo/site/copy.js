/** The clipboard, if the browser allows the page to use it. */

/**
 * @param text {string}
 * @returns {Promise<string>} a message for the person.
 */
export async function copy(text) {
  try {
    await navigator.clipboard.writeText(text);
    return 'Copied.';
  } catch {
    return 'Shown above: the browser did not allow copying.';
  }
}
