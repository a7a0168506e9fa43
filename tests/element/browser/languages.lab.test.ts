/** The element speaks the language of the page. */
import '@gaussian-splat/element';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { violationsIn } from './support/axe.js';
import { assertEqual, showLoaded, until } from './support/harness.js';

const roleOf = (element: GaussianSplatElement): string =>
  element.shadowRoot?.querySelector('#view')?.getAttribute('aria-roledescription') ?? '';
const keysOf = (element: GaussianSplatElement): HTMLElement | null =>
  element.shadowRoot?.querySelector<HTMLElement>('#keys') ?? null;

afterEach(() => document.documentElement.setAttribute('lang', 'en'));

describe('the words of the element', () => {
  it('are those of the language of the page, its own or that of the element', async () => {
    document.documentElement.setAttribute('lang', 'fr-CA');
    const element = await showLoaded({ 'camera-controls': '', alt: 'Une boussole', a11y: '{"pause": "Arrêter"}' });
    await until(() => roleOf(element) === 'Visionneuse de scène 3D', 'French words');
    await until(() => keysOf(element)?.textContent.startsWith('Les flèches') === true, 'French keys');
    assertEqual(keysOf(element)?.hasAttribute('lang'), false, 'words are marked as English');
    assertEqual(await violationsIn(element), [], 'violations');
    element.lang = 'de';
    await until(() => roleOf(element) === '3D-Ansicht', 'German words');
    element.lang = 'sv';
    await until(() => roleOf(element) === '3D scene viewer', 'English words for a language that it has not');
  });

  it('are those of the page in a component, too', async () => {
    document.documentElement.setAttribute('lang', 'fr');
    const component = document.createElement('div');
    document.body.append(component);
    const element = await showLoaded({ 'camera-controls': '' });
    component.attachShadow({ mode: 'open' }).append(element);
    element.requestUpdate();
    await until(() => roleOf(element) === 'Visionneuse de scène 3D', 'French words');
    component.lang = 'de';
    element.requestUpdate();
    await until(() => roleOf(element) === '3D-Ansicht', 'German words');
  });

  it('are replaced by those of the page', async () => {
    const element = await showLoaded({ 'camera-controls': '', lang: 'es', a11y: '{"role": "Mi visor"}' });
    await until(() => keysOf(element)?.textContent.startsWith('Las flechas') === true, 'Spanish keys');
    assertEqual(roleOf(element), 'Mi visor', 'role');
  });
});
