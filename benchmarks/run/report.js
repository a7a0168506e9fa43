/** Sends a report to a URL if one was given, and to scripts as `window.report`. */
export async function sendReport(report, url) {
  if (url) await fetch(url, { method: 'POST', body: JSON.stringify(report) });
  window.report = report;
}
