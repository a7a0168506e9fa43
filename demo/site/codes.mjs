/** Comments of the sources as HTML: what stands between backticks is code, everything else is text. */

/**
 * @param text {string} of a comment.
 * @returns {string} markup, marked as safe for Nunjucks, whose own filter of that name this context has.
 */
export function codes(text) {
  const escaped = text.replaceAll('&', '&amp;').replaceAll('<', '&lt;').replaceAll('"', '&quot;');
  return this.env.filters.safe(escaped.replace(/`([^`]+)`/g, '<code>$1</code>'));
}
