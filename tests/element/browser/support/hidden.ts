/** Runs work with the page hidden, as scripts see it. */
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
