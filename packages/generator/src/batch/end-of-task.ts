/**
 * Fulfils when the task that runs now has ended. All callbacks of one animation frame are one task: whatever the elements of a page ask for
 * in a frame has then been asked. A timer would do as well, but browsers hold timers back.
 */
export function endOfTask(): Promise<void> {
  return new Promise((resolve) => {
    const { port1, port2 } = new MessageChannel();
    port1.onmessage = () => {
      port1.close();
      resolve();
    };
    port2.postMessage(undefined);
  });
}
