/** The clipboard, where the browser lets the page have it. */

/**
 * @param text {string}
 * @returns {Promise<string>} what to tell the person.
 */
export async function copy(text) {
  try {
    await navigator.clipboard.writeText(text);
    return 'Copied.';
  } catch {
    return 'Shown above: the browser did not allow copying.';
  }
}
