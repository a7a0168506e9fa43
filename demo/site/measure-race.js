/** The race of the first page, on the visitor's GPU: the frontier page measures it in a frame. */
import { adapterName } from './measure.js';
import { raceOf } from './race.mjs';

const NAMES = ['default', 'PlayCanvas', 'Spark'];
const ADDRESS = `bench/frontier.html?${new URLSearchParams({ only: `^(${NAMES.join('|')})$`, w: 960, h: 540, frames: 30, warmup: 5, views: 2 })}`;

/**
 * Measures, and writes the figures into the table. The page's address may replace parameters of the measurement: `?race=frames=3,views=1`.
 * @param page {{ button: HTMLButtonElement, status: HTMLElement, table: HTMLTableElement, place: HTMLElement }}
 */
export async function measureRace({ button, status, table, place }) {
  button.disabled = true;
  const url = new URL(ADDRESS, document.baseURI);
  for (const pair of new URLSearchParams(location.search).get('race')?.split(',') ?? [])
    url.searchParams.set(...pair.split('='));
  const frame = Object.assign(document.createElement('iframe'), { src: url, title: 'Measurement' });
  place.replaceChildren(frame);
  try {
    const report = await reportOf(frame, status);
    if (report.error) throw new Error(report.error.split('\n')[0]);
    showRows(table, raceOf(report, NAMES));
    const failed = report.results.filter(({ error }) => error).map(({ configuration }) => configuration.name);
    status.textContent = `Measured here, on ${await adapterName()}${failed.length > 0 ? `; without ${failed.join(' and ')}, which failed` : ''}.`;
  } catch (error) {
    status.textContent = `It did not work: ${error.message}`;
  } finally {
    frame.remove();
    button.disabled = false;
  }
}

async function reportOf(frame, status) {
  for (;;) {
    const page = frame.contentWindow;
    if (page?.report) return page.report;
    status.textContent = page?.document.getElementById('status')?.textContent || 'Starting…';
    await new Promise((resolve) => setTimeout(resolve, 250));
  }
}

function showRows(table, rows) {
  for (const { name, share, milliseconds, decibels, eye } of rows) {
    const row = [...table.tBodies[0].rows].find(({ cells }) => cells[0].textContent === name);
    row.cells[1].querySelector('.bar').style.setProperty('--share', share);
    row.cells[1].lastChild.textContent = ` ${milliseconds}`;
    row.cells[2].textContent = decibels;
    row.cells[3].textContent = eye;
  }
}
