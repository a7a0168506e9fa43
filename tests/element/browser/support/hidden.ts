/** Runs work with the page hidden, as far as scripts can tell. */
export async function whileHidden(work: () => Promise<void>): Promise<void> {
  Object.defineProperty(document, 'visibilityState', { configurable: true, get: () => 'hidden' });
  document.dispatchEvent(new Event('visibilitychange'));
  try {
    await work();
  } finally {
    Reflect.deleteProperty(document, 'visibilityState');
    document.dispatchEvent(new Event('visibilitychange'));
  }
}
