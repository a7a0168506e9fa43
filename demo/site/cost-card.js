/** A cost card: known facts, and measurements of this machine while it shows a scene. */
import { adapterName, measureFrames, timeLoading } from './measure.js';

const LIVE = { warmUp: 'First frame', memory: 'GPU memory', frame: 'Frame time' };

const make = (name, text, properties = {}) =>
  Object.assign(document.createElement(name), { textContent: text, ...properties });

/**
 * Fills a description list.
 * @param list {HTMLElement} a `<dl>`
 * @param facts {[string, string][]} facts known without showing the scene.
 * @param element {HTMLElement | null} the `<gaussian-splat>` that the card is about; null for none.
 */
export function fillCostCard(list, facts, element) {
  list.replaceChildren(...facts.flatMap(([term, text]) => [make('dt', term), make('dd', text)]));
  if (element === null) return;
  const places = Object.fromEntries(
    Object.entries(LIVE).map(([key, term]) => {
      const place = make('dd', key === 'frame' ? '' : 'once it is loaded');
      list.append(make('dt', term), place);
      return [key, place];
    }),
  );
  const button = make('button', 'Measure here', { type: 'button', disabled: !element.loaded });
  places.frame.append(button);
  button.addEventListener('click', () => measureInto(places.frame, button, element));
  const showMemory = () => {
    button.disabled = false;
    places.memory.textContent = `${(element.stats.bytes.scene / 1e6).toFixed(1)} MB for the splats`;
  };
  timeLoading(element, (ms) => {
    places.warmUp.textContent = `after ${ms < 1000 ? `${ms.toFixed(0)} ms` : `${(ms / 1000).toFixed(1)} s`}, here`;
    showMemory();
  });
  if (!element.loaded) return;
  places.warmUp.textContent = 'was loaded before this card';
  showMemory();
}

async function measureInto(place, button, element) {
  button.disabled = true;
  button.textContent = 'Measuring…';
  try {
    const { median, frames, width, height } = await measureFrames(element);
    const adapter = await adapterName();
    place.replaceChildren(
      `${median.toFixed(median < 10 ? 2 : 0)} ms at ${width} × ${height}, median of ${frames}, on ${adapter} `,
      button,
    );
    button.textContent = 'Again';
  } catch (error) {
    place.replaceChildren(`${error.message} `, button);
    button.textContent = 'Measure here';
  }
  button.disabled = false;
}
