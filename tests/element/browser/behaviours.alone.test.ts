/** Behavior around the camera: posters, prompts, automatic rotation, flights, announcements. */
import '@gaussian-splat/element';
import type { GaussianSplatElement } from '@gaussian-splat/element';
import { emulateMedia, resetMouse, sendKeys, sendMouse } from '@web/test-runner-commands';
import { itInLab } from '../../support/extent-in-pages.js';
import {
  assert,
  assertEqual,
  atRest,
  COMPASS,
  delay,
  frames,
  nextEvent,
  show,
  showLoaded,
  submits,
  until,
  hurry,
} from './support/harness.js';
import { isRed, screenOf } from './support/screen.js';

const POSTER = 'data:image/gif;base64,R0lGODlhAQABAIAAAP///wAAACwAAAAAAQABAAACAkQBADs=';
const partOf = (element: GaussianSplatElement, selector: string): HTMLElement | null =>
  element.shadowRoot?.querySelector<HTMLElement>(selector) ?? null;
const theta = (element: GaussianSplatElement): number => (element.getCameraOrbit().theta * 180) / Math.PI;

/** The camera's position in viewer space. */
function eyeOf(element: GaussianSplatElement): number[] {
  const { theta, phi, radius } = element.getCameraOrbit();
  const { x, y, z } = element.getCameraTarget();
  const [sin, cos] = [Math.sin(phi), Math.cos(phi)];
  return [x + radius * Math.sin(theta) * sin, y + radius * cos, z + radius * Math.cos(theta) * sin];
}

const distance = (a: readonly number[], b: readonly number[]): number =>
  Math.hypot(...a.map((value, axis) => value - b[axis]));

/** Many events that these tests check come after a rest, or must not come. */
beforeEach(() => hurry(3));

afterEach(async () => {
  await resetMouse();
  await emulateMedia({ reducedMotion: 'no-preference' });
});

describe('the poster', () => {
  it('with reveal="manual" waits for a person: no byte, no device, one button', async () => {
    const src = `${COMPASS}?manual`;
    const element = show({ src, poster: POSTER, reveal: 'manual', 'camera-controls': '', alt: 'A compass' });
    const fetched = (): number =>
      performance.getEntriesByType('resource').filter(({ name }) => name.includes('?manual')).length;
    await delay(400);
    assertEqual([fetched(), element.loaded, element.revealed], [0, false, false], 'before the click');
    const button = partOf(element, 'button');
    assertEqual(button?.getAttribute('aria-label'), 'Show A compass');
    let dismissed = 0;
    element.addEventListener('poster-dismissed', () => dismissed++);
    button?.click();
    await nextEvent(element, 'load');
    await until(() => dismissed > 0, 'poster-dismissed');
    assertEqual([element.loaded, element.revealed, dismissed], [true, true, 1], 'after it');
    assertEqual(element.shadowRoot?.activeElement?.id, 'view', 'the keyboard continues in the scene');
  });

  it('of the page itself is a button, too, with a sign that there is something to start', async () => {
    const element = show({ src: COMPASS, reveal: 'manual', alt: 'Ein Kompass' });
    const own = document.createElement('b');
    Object.assign(own, { slot: 'poster', textContent: 'Unser Poster' });
    element.append(own);
    await element.updateComplete;
    const cue = partOf(element, '[part=poster-icon]')?.getBoundingClientRect();
    const box = element.getBoundingClientRect();
    assert(cue && cue.width > 20, 'a sign');
    assertEqual(Math.round(cue.x + cue.width / 2 - box.x), Math.round(box.width / 2), 'in the middle');
    own.click();
    await nextEvent(element, 'load');
    assert(element.revealed, 'revealed');
  });

  it('covers a scene that was loaded eagerly until dismissPoster(), and again after showPoster()', async () => {
    const element = await showLoaded({ reveal: 'manual', loading: 'eager' });
    assert(!element.revealed, 'covered');
    assertEqual((await screenOf(element)).middleOf(isRed), null, 'nothing is seen');
    element.dismissPoster();
    await nextEvent(element, 'poster-dismissed');
    await delay(400);
    assert((await screenOf(element)).middleOf(isRed), 'the scene is seen');
    element.showPoster();
    await element.updateComplete;
    assertEqual((await screenOf(element)).middleOf(isRed), null, 'covered again');
  });

  it('is dismissed automatically otherwise', async () => {
    const element = show({ src: COMPASS, poster: POSTER });
    await nextEvent(element, 'poster-dismissed');
    assert(element.loaded && element.revealed, 'revealed');
  });
});

describe('the interaction prompt', () => {
  const prompted = { 'camera-controls': '', 'interaction-prompt-threshold': '150' };

  it('comes after a rest, costs no frame, and goes with the first touch', async () => {
    const element = await showLoaded(prompted);
    // Frames after the first one are not the prompt's.
    await atRest(element);
    element.resetInteractionPrompt();
    const before = submits;
    await until(() => partOf(element, '[part=interaction-prompt]') !== null, 'the prompt');
    await delay(300);
    assert(submits - before <= 1, `${submits - before} submits`);
    element.focus();
    await sendKeys({ press: 'ArrowRight' });
    await until(() => partOf(element, '[part=interaction-prompt]') === null, 'the prompt to go');
    await delay(400);
    assertEqual(partOf(element, '[part=interaction-prompt]'), null, 'it stays away');
    element.resetInteractionPrompt();
    await until(() => partOf(element, '[part=interaction-prompt]') !== null, 'the prompt after a reset');
  });

  it('comes once in a gallery', async () => {
    const elements = await Promise.all([1, 2, 3].map(() => showLoaded({ ...prompted, loading: 'eager' })));
    const prompts = (): number =>
      elements.filter((element) => partOf(element, '[part=interaction-prompt]') !== null).length;
    await until(() => prompts() > 0, 'a prompt');
    await delay(600);
    assertEqual(prompts(), 1);
  });

  it('does not come without controls, nor with interaction-prompt="none"', async () => {
    const [plain, none] = [
      await showLoaded({ 'interaction-prompt-threshold': '50' }),
      await showLoaded({ ...prompted, 'interaction-prompt': 'none' }),
    ];
    await delay(500);
    assertEqual([partOf(plain, '.prompt'), partOf(none, '.prompt')], [null, null]);
  });

  itInLab('that wiggles moves the camera to and fro and leaves it where it was', async () => {
    // A busy machine sees few moments of it.
    hurry(0.5);
    const element = await showLoaded({ ...prompted, 'interaction-prompt-style': 'wiggle' });
    const seen: number[] = [];
    const sources = new Set<string>();
    element.addEventListener('camera-change', ({ detail }) => {
      seen.push(theta(element));
      sources.add(detail.source);
    });
    await until(() => seen.length > 0, 'the wiggle');
    const moving = seen.length;
    await delay(5_200);
    const after = submits;
    assert(Math.max(...seen) > 5 && Math.min(...seen) < -5, `from ${Math.min(...seen)} to ${Math.max(...seen)}`);
    assert(seen.length > moving + 10, `${seen.length} frames`);
    assert(Math.abs(theta(element)) < 1e-9, `theta ${theta(element)}`);
    assertEqual([...sources], ['automatic'], 'sources');
    await delay(300);
    assertEqual(submits - after, 0, 'submits afterwards');
  });

  it('does not wiggle for people who want less motion', async () => {
    await emulateMedia({ reducedMotion: 'reduce' });
    const element = await showLoaded({ ...prompted, 'interaction-prompt-style': 'wiggle' });
    let changes = 0;
    element.addEventListener('camera-change', () => changes++);
    await until(() => partOf(element, '[part=interaction-prompt].basic') !== null, 'the prompt');
    await delay(500);
    assertEqual(changes, 0, 'moves');
  });
});

describe('auto-rotate', () => {
  const rotating = { 'auto-rotate': '', 'auto-rotate-delay': '100', 'rotation-per-second': '60deg' };

  it('turns after a rest, stops for a visitor, and continues', async () => {
    const element = await showLoaded({ ...rotating, 'camera-controls': '' });
    const sources: string[] = [];
    element.addEventListener('camera-change', ({ detail }) => sources.push(detail.source));
    const start = performance.now();
    await until(() => sources.length > 5, 'some frames');
    const turned = theta(element);
    const seconds = (performance.now() - start) / 1000;
    assert(turned < -1 && turned > -60 * seconds - 10, `${turned} degrees in ${seconds} s`);
    assertEqual([...new Set(sources)], ['automatic'], 'sources');
    element.autoRotateDelay = 60_000;
    await element.updateComplete;
    await sendMouse({ type: 'move', position: [60, 50] });
    await sendMouse({ type: 'down' });
    await sendMouse({ type: 'move', position: [50, 50] });
    await sendMouse({ type: 'up' });
    await until(() => sources.at(-1) === 'user-interaction', 'the drag');
    // The drag's own motion dies away first.
    await delay(600);
    element.jumpCameraToGoal();
    await frames();
    const rest = theta(element);
    await delay(300);
    assertEqual(theta(element), rest, 'theta at rest');
    element.autoRotate = false;
    await element.updateComplete;
    element.autoRotate = true;
    element.autoRotateDelay = 50;
    await until(() => theta(element) < rest, 'to continue');
  });

  it('stands still for people who want less motion, and while the keyboard is on it', async () => {
    await emulateMedia({ reducedMotion: 'reduce' });
    const still = await showLoaded(rotating);
    await delay(500);
    assertEqual(theta(still), 0, 'reduced motion');
    await emulateMedia({ reducedMotion: 'no-preference' });
    still.remove();
    const element = await showLoaded({ ...rotating, 'auto-rotate-delay': '400', 'camera-controls': '' });
    await sendKeys({ press: 'Tab' });
    assertEqual(element.shadowRoot?.activeElement?.id, 'view', 'focus');
    await delay(900);
    assertEqual(theta(element), 0, 'under the keyboard');
  });
});

describe('the preference for less motion', () => {
  it('counts when it comes and when it goes', async () => {
    const element = await showLoaded({ 'auto-rotate': '', 'auto-rotate-delay': '100', 'rotation-per-second': '60deg' });
    const button = (): HTMLElement | null => partOf(element, '[part=pause-button]');
    await until(() => theta(element) < -2, 'the camera to turn');
    await emulateMedia({ reducedMotion: 'reduce' });
    await until(() => button() === null, 'the button to go', 2_000);
    const still = theta(element);
    await delay(300);
    assertEqual(theta(element), still, 'while it lasts');
    await emulateMedia({ reducedMotion: 'no-preference' });
    await until(() => theta(element) < still - 2 && button() !== null, 'the camera to turn again', 3_000);
  });
});

describe('automatic motion', () => {
  const rotating = { 'auto-rotate': '', 'auto-rotate-delay': '60', 'rotation-per-second': '60deg' };
  const MOVIE = '/net/sequence/movie.json?count=600&fps=2';
  const buttonOf = (element: GaussianSplatElement): HTMLElement | null => partOf(element, '[part=pause-button]');
  const does = (element: GaussianSplatElement): string | null => buttonOf(element)?.getAttribute('aria-label') ?? null;

  async function isMoving(element: GaussianSplatElement): Promise<boolean> {
    const before = [theta(element), element.currentTime];
    await delay(250);
    return String(before) !== String([theta(element), element.currentTime]);
  }

  it('has a button that stops it and starts it again, seen under the pointer and the keyboard', async () => {
    await showLoaded();
    const element = await showLoaded(rotating);
    await until(() => theta(element) < -1, 'the camera to turn');
    const button = buttonOf(element);
    assert(button, 'a button');
    const opacity = (): string => getComputedStyle(button).opacity;
    assertEqual([does(element), opacity()], ['Pause', '0'], 'at first');
    await sendKeys({ press: 'Tab' });
    assertEqual([element.shadowRoot?.activeElement, opacity()], [button, '1'], 'under the keyboard');
    await sendKeys({ press: 'Space' });
    await element.updateComplete;
    assertEqual([does(element), await isMoving(element)], ['Start the motion', false], 'stopped');
    button.blur();
    assertEqual(opacity(), '0', 'without the keyboard');
    const { x, y, width, height } = button.getBoundingClientRect();
    assert(width >= 24 && height >= 24, `${width} x ${height} px`);
    // A start by hand does not wait.
    element.autoRotateDelay = 60_000;
    await sendMouse({ type: 'click', position: [Math.round(x + width / 2), Math.round(y + height / 2)] });
    await element.updateComplete;
    assertEqual([does(element), opacity(), await isMoving(element)], ['Pause', '1', true], 'started');
    element.style.setProperty('--pause-button-display', 'none');
    assertEqual(getComputedStyle(button).display, 'none', 'where the page brings its own');
    element.autoRotate = false;
    await element.updateComplete;
    assertEqual(does(element), null, 'nothing moves automatically');
  });

  it('stops by the space bar, and stays so with another scene', async () => {
    const element = await showLoaded({ src: MOVIE, autoplay: '', 'camera-controls': '', ...rotating });
    await until(() => element.currentTime > 0 && theta(element) < 0, 'time and camera to continue');
    element.focus();
    await sendKeys({ press: 'Space' });
    await element.updateComplete;
    assertEqual([element.paused, does(element)], [true, 'Start the motion'], 'paused, button');
    partOf(element, '#view')?.blur();
    assert(!(await isMoving(element)), 'all stands still');
    element.src = `${MOVIE}&another`;
    await nextEvent(element, 'load');
    assert(element.paused && !(await isMoving(element)), 'and stays so');
    buttonOf(element)?.click();
    await until(() => element.currentTime > 0, 'the time to continue');
  });

  it("what a script plays, a still scene, and a player's scene have no button; less motion has one to start", async () => {
    const elements = [await showLoaded({ src: MOVIE }), await showLoaded({ src: MOVIE, slot: 'media', autoplay: '' })];
    await elements[0].play();
    elements.push(await showLoaded({ autoplay: '' }));
    assertEqual(elements.map(does), [null, null, null], 'buttons');
    await emulateMedia({ reducedMotion: 'reduce' });
    const calm = await showLoaded({ src: MOVIE, autoplay: '', ...rotating });
    await calm.updateComplete;
    assertEqual([calm.paused, does(calm)], [true, 'Start the motion'], 'for less motion');
    buttonOf(calm)?.click();
    await until(() => !calm.paused, 'a scene that was asked for');
    assertEqual(theta(calm), 0, 'which the camera does not turn around');
  });
});

describe('fly', () => {
  it('W moves the camera ahead, D to the right, and a drag looks around from where it is', async () => {
    const element = await showLoaded({
      ...{ navigation: 'fly', 'camera-controls': '', 'camera-orbit': '0deg 90deg 10m' },
      ...{ 'interpolation-decay': '60', 'disable-tap': '' },
    });
    element.focus();
    // The code for it may still be on its way: a press before that goes nowhere.
    let pressedAt = -Infinity;
    const isAhead = (): boolean => {
      const [now, is] = [performance.now(), eyeOf(element)[2] < 9.999];
      if (!is && now - pressedAt > 1000) {
        pressedAt = now;
        void sendKeys({ press: 'w' });
      }
      return is;
    };
    await until(isAhead, 'the way ahead');
    await atRest(element);
    const ahead = eyeOf(element);
    assert(Math.abs(ahead[0]) < 1e-9 && Math.abs(ahead[1]) < 1e-9, `straight on: ${ahead.join()}`);
    await sendKeys({ press: 'd' });
    await until(() => eyeOf(element)[0] > 1e-3, 'the way to the right');
    await atRest(element);
    const from = eyeOf(element);
    const strayed: number[] = [];
    element.addEventListener('camera-change', () => strayed.push(distance(eyeOf(element), from)));
    await sendMouse({ type: 'move', position: [60, 50] });
    await sendMouse({ type: 'down' });
    await sendMouse({ type: 'move', position: [90, 70] });
    await sendMouse({ type: 'up' });
    await until(() => strayed.length > 2, 'the look around');
    await atRest(element);
    assert(theta(element) > 5, `the scene follows the pointer: ${theta(element)} degrees`);
    assert(Math.max(...strayed) < 1e-9, `the eye stays: ${Math.max(...strayed)}`);
    const orbit = String(element.getCameraOrbit());
    const copy = await showLoaded({ 'camera-orbit': orbit, 'camera-target': String(element.getCameraTarget()) });
    assert(distance(eyeOf(copy), eyeOf(element)) < 1e-9, 'the place survives its strings');
  });

  it('holds speed while a key is held, and stops with it', async () => {
    const element = await showLoaded({ navigation: 'fly', 'camera-controls': '', 'interpolation-decay': '0' });
    element.focus();
    await sendKeys({ down: 's' });
    await delay(500);
    await sendKeys({ up: 's' });
    await frames(3);
    const place = eyeOf(element);
    assert(place[2] > 0.2, `${place.join()}`);
    await delay(300);
    assertEqual(distance(eyeOf(element), place), 0, 'motion after the key');
  });
});

describe('screen readers', () => {
  const spoken = (element: GaussianSplatElement): string => partOf(element, '[role=status]')?.textContent ?? '?';

  it('are notified of the camera position while the scene has the focus, and not too often', async () => {
    const element = await showLoaded({ 'camera-controls': '', 'camera-orbit': '0deg 90deg auto' });
    const heard: string[] = [];
    const status = partOf(element, '[role=status]');
    assert(status, 'a live region');
    new MutationObserver(() => heard.push(spoken(element))).observe(status, {
      ...{ childList: true, characterData: true, subtree: true },
    });
    element.cameraOrbit = '90deg 90deg auto';
    await delay(1_000);
    assertEqual(heard, [], 'without focus');
    element.focus();
    for (let i = 0; i < 4; i++) await sendKeys({ press: 'ArrowRight' });
    await until(() => heard.length > 0, 'words');
    assertEqual(heard, ['View from back'], 'four turns, one sentence');
    for (let i = 0; i < 3; i++) await sendKeys({ press: 'ArrowUp' });
    await until(() => heard.length > 1, 'more words');
    assertEqual(heard[1], 'View from upper back');
    element.blur();
    (element.shadowRoot?.activeElement as HTMLElement | null)?.blur();
    await until(() => spoken(element) === '', 'silence');
  });

  it('are informed that words are English, except for those of the page', async () => {
    const languages = (element: Element, ...parts: string[]): (string | null | undefined)[] =>
      parts.map((part) => element.shadowRoot?.querySelector(part)?.getAttribute('lang'));
    const controls = { 'camera-controls': '' };
    const failed = async (attributes: Record<string, string>) => {
      const element = show({ src: '/net/status/404', ...controls, ...attributes });
      await nextEvent(element, 'error');
      await element.updateComplete;
      assertEqual(partOf(element, '#keys'), null, 'nothing can be moved');
      return languages(element, '#view', '[part=error] p', '[part=error] summary');
    };
    assertEqual(await failed({}), ['en', 'en', 'en']);
    assertEqual(await failed({ alt: 'Ein Kompass' }), [null, 'en', 'en']);
    assertEqual(languages(await showLoaded({ ...controls, alt: 'Ein Kompass' }), '#view', '#keys'), [null, 'en']);
    const words = { 'keys-orbit': 'Pfeiltasten drehen.', 'error-network': 'Nicht da.', details: 'Genaueres' };
    const german = { alt: 'Ein Kompass', a11y: JSON.stringify(words) };
    assertEqual(await failed(german), [null, null, null]);
    const element = document.querySelector<GaussianSplatElement>('gaussian-splat:last-of-type')!;
    assertEqual(partOf(element, '[part=error] p')?.textContent, words['error-network']);
    assertEqual(partOf(element, '[part=error] summary')?.textContent, words.details);
    const shown = await showLoaded({ ...controls, ...german });
    assertEqual(languages(shown, '#view', '#keys'), [null, null]);
    assertEqual(partOf(shown, '#keys')?.textContent, words['keys-orbit']);
  });

  it('read the words of the page', async () => {
    const element = await showLoaded({
      ...{ 'camera-controls': '', 'interpolation-decay': '0', 'camera-orbit': '0deg 90deg auto' },
      a11y: '{"right": "Blick von rechts", "interaction-prompt": "Ziehen"}',
      'interaction-prompt-threshold': '50',
    });
    await until(
      () => partOf(element, '[part=interaction-prompt]')?.getAttribute('aria-label') === 'Ziehen',
      'the prompt',
    );
    element.focus();
    for (let i = 0; i < 4; i++) await sendKeys({ press: 'ArrowRight' });
    await until(() => spoken(element) !== '', 'words');
    assertEqual(spoken(element), 'Blick von rechts');
  });
});
