/** Scene files that follow one another in time, with the words of HTMLMediaElement. */
import '@gaussian-splat/element';
import { GaussianSplatElement } from '@gaussian-splat/element';
import { itInLab } from '../../support/extent-in-pages.js';
import {
  assert,
  assertEqual,
  COMPASS,
  delay,
  devices,
  frames,
  nextEvent,
  show,
  showLoaded,
  until,
} from './support/harness.js';
import { whileHidden } from './support/hidden.js';
import { isBlue, isGreen, isRed, screenOf, type Rgb } from './support/screen.js';

const MOVIE = '/net/sequence/movie.json';

/** Frames of the movie that were fetched since this was last asked. */
const fetchedFrames = async (): Promise<number[]> => (await (await fetch('/net/sequence/asked')).json()) as number[];

async function shows(element: GaussianSplatElement, isColor: (color: Rgb) => boolean): Promise<boolean> {
  return (await screenOf(element)).middleOf(isColor) !== null;
}

async function seek(element: GaussianSplatElement, seconds: number): Promise<void> {
  const seeked = nextEvent(element, 'seeked');
  element.currentTime = seconds;
  assert(element.seeking, 'seeking');
  await seeked;
  assert(!element.seeking, 'no longer seeking');
}

describe('a sequence of files', () => {
  it('has a duration, shows the frame of every time, also one with more splats than there was room for', async () => {
    const element = await showLoaded({ src: MOVIE });
    assertEqual([element.duration, element.paused, element.currentTime], [1.2, true, 0], 'duration, paused, time');
    assertEqual(element.stats?.splats, 200, 'splats of the first frame');
    assert(await shows(element, isRed), 'the first frame');
    for (const [seconds, isColor, splats] of [
      [0.15, isGreen, 220],
      [0.25, isBlue, 240],
      [1.15, isBlue, 420],
      [0, isRed, 200],
    ] as const) {
      await seek(element, seconds);
      await until(() => element.stats?.splats === splats, `${splats} splats at ${seconds} s`);
      assert(await shows(element, isColor), `the frame at ${seconds} s`);
      for (const other of [isRed, isGreen, isBlue]) {
        if (other !== isColor) assert(!(await shows(element, other)), `nothing of other frames at ${seconds} s`);
      }
    }
  });

  it('asks for frames with the query of its manifest, and leaves alone what urlModifier makes of them', async () => {
    const src = '/net/signed/movie.json?token=a';
    assert(await shows(await showLoaded({ src }), isRed), 'a frame with the token');
    GaussianSplatElement.urlModifier = (url) => (url.endsWith('.splat') ? `${url}?signed=b` : url);
    try {
      assert(await shows(await showLoaded({ src }), isBlue), 'a frame with a signature of its own');
    } finally {
      GaussianSplatElement.urlModifier = null;
    }
  });

  it('plays to its end, and over and over with loop', async () => {
    const element = await showLoaded({ src: MOVIE });
    const ended = nextEvent(element, 'ended');
    await element.play();
    await ended;
    assertEqual([element.currentTime, element.ended, element.paused], [1.2, true, true], 'at the end');
    await until(() => element.stats?.splats === 420, 'the last frame');
    element.loop = true;
    await element.play();
    let wraps = 0;
    let last = element.currentTime;
    await until(() => {
      if (element.currentTime < last) wraps++;
      last = element.currentTime;
      return wraps >= 2;
    }, 'two rounds');
    element.pause();
    await frames(5);
  });

  itInLab('if every frame is late, in a second round too, frames follow the clock at a distance', async () => {
    // Three seconds, two of them prefetched, and each frame takes longer than eight of them.
    const element = await showLoaded({ src: `${MOVIE}?count=72&fps=24&ms=350`, loop: '' });
    const seen = [new Set<number>(), new Set<number>()];
    let [round, last] = [0, 0];
    await element.play();
    await until(() => {
      const { currentTime } = element;
      if (currentTime < last) round++;
      last = currentTime;
      seen[round]?.add(element.stats?.splats ?? 0);
      return round >= 2;
    }, 'two rounds');
    element.pause();
    assert(
      seen.every(({ size }) => size >= 3),
      `frames in each round: ${seen.map((one) => [...one].join(' ')).join('; ')}`,
    );
  });

  itInLab('played backward with late frames, frames follow the clock, too', async () => {
    const element = await showLoaded({ src: `${MOVIE}?count=72&fps=24&ms=350` });
    await seek(element, 2.9);
    element.playbackRate = -1;
    const seen = new Set<number>();
    await element.play();
    await until(() => {
      seen.add(element.stats?.splats ?? 0);
      return element.paused;
    }, 'the beginning');
    assert(seen.size >= 3, `frames on the way: ${[...seen].join(' ')}`);
  });

  itInLab('a late frame leaves the last one visible, and is shown when it arrives', async () => {
    const element = await showLoaded({ src: `${MOVIE}?ms=1200` });
    element.currentTime = 0.15;
    await delay(300);
    assert(element.seeking && (await shows(element, isRed)), 'the first frame still');
    await until(() => !element.seeking, 'the frame');
    assert(await shows(element, isGreen), 'the second frame');
  });

  itInLab('fetches two seconds of frames ahead, for any length', async () => {
    await fetchedFrames();
    const element = await showLoaded({ src: `${MOVIE}?count=300&fps=10` });
    let max = 0;
    for (const seconds of [0, 5, 29, 12]) {
      await seek(element, seconds);
      await delay(300);
      const fetched = await fetchedFrames();
      assert(fetched.length <= 20, `${fetched.length} frames fetched at ${seconds} s`);
      assert(
        fetched.every((frame) => frame === 0 || frame >= 10 * seconds - 1),
        `frames ${fetched.join()} at ${seconds} s`,
      );
      assert(seconds === 0 || fetched.includes(10 * seconds), `frames ${fetched.join()} at ${seconds} s`);
      max = Math.max(max, fetched.length);
      // A request that was sent before the next seek may arrive after it.
      await until(async () => {
        await delay(150);
        return (await fetchedFrames()).length === 0;
      }, 'no more requests');
    }
    assert(max > 5, 'and fetches ahead');
  });

  it('a missing frame is reported once and skipped', async () => {
    const element = show({ src: `${MOVIE}?lost=1` });
    const messages: string[] = [];
    element.addEventListener('generator-error', ({ detail }) => messages.push(detail.reason));
    await element.ready;
    await seek(element, 0.15);
    await seek(element, 0.25);
    assert(await shows(element, isBlue), 'the frame behind it');
    assertEqual(messages, ['network/status'], 'errors');
  });
});

const REPORTED = [
  'emptied',
  'loadstart',
  'durationchange',
  'loadedmetadata',
  'loadeddata',
  'canplay',
  'canplaythrough',
  'error',
];

function eventsOf(element: GaussianSplatElement): string[] {
  const reported: string[] = [];
  for (const type of REPORTED) element.addEventListener(type, () => reported.push(type));
  return reported;
}

/** The name of the error that a promise is rejected with. */
const refusal = (promise: Promise<void>): Promise<string> =>
  promise.then(
    () => 'none',
    (error: Error) => error.name,
  );

describe('the clock', () => {
  it('starts again with another scene, of the same length or of none', async () => {
    const element = await showLoaded({ src: MOVIE });
    const ended = nextEvent(element, 'ended');
    element.playbackRate = 8;
    await element.play();
    await ended;
    const reported = eventsOf(element);
    element.src = `${MOVIE}?another`;
    await nextEvent(element, 'load');
    assertEqual([element.currentTime, element.ended, element.paused], [0, false, true], 'time, ended, paused');
    const fresh = [
      'emptied',
      'loadstart',
      'durationchange',
      'loadedmetadata',
      'loadeddata',
      'canplay',
      'canplaythrough',
    ];
    assertEqual(reported.splice(0), ['durationchange', ...fresh], 'events');
    element.src = '/net/status/404';
    await nextEvent(element, 'error');
    assertEqual(reported.splice(0), ['durationchange', 'emptied', 'loadstart', 'error'], 'events of one that fails');
    assertEqual(element.duration, NaN, 'its duration');
  });

  it('begins at the attribute time whenever a scene comes', async () => {
    const { releaseDelay } = GaussianSplatElement;
    GaussianSplatElement.releaseDelay = 0;
    try {
      const element = await showLoaded({ src: MOVIE, time: '0.3' });
      await seek(element, 0.8);
      element.remove();
      await until(() => !element.loaded, 'the release');
      document.body.append(element);
      await nextEvent(element, 'load');
      assertEqual(element.currentTime, 0.3, 'after the release');
      await seek(element, 0.8);
      element.src = COMPASS;
      await nextEvent(element, 'load');
      element.src = MOVIE;
      await nextEvent(element, 'load');
      assertEqual(element.currentTime, 0.3, 'after a scene that does not move');
    } finally {
      GaussianSplatElement.releaseDelay = releaseDelay;
    }
  });

  it('stands still while nothing is drawn', async () => {
    const element = await showLoaded({ src: `${MOVIE}?count=600&fps=2` });
    await element.play();
    const goesOnFrom = async (seconds: number, what: string): Promise<void> => {
      // The event fires before the clock continues.
      await nextEvent(element, 'playing');
      assertEqual(element.currentTime, seconds, what);
      await until(() => element.currentTime > seconds, 'the time to continue');
    };
    await until(() => element.currentTime > 0, 'the time to run');
    let before = 0;
    await whileHidden(async () => {
      before = element.currentTime;
      await delay(200);
    });
    await goesOnFrom(before, 'after the page was hidden');
    element.remove();
    before = element.currentTime;
    await delay(200);
    document.body.append(element);
    await goesOnFrom(before, 'after the element was away');
    element.addEventListener('contextlost', () => (before = element.currentTime));
    devices[devices.length - 1].destroy();
    await nextEvent(element, 'contextlost');
    await goesOnFrom(before, 'after the device was lost');
  });
});

/** A second and a fifth of silence, for the platform's own element. */
function silence(): string {
  const [rate, count] = [8_000, 9_600];
  const bytes = new DataView(new ArrayBuffer(44 + count));
  const write = (at: number, text: string): void =>
    [...text].forEach((c, i) => bytes.setUint8(at + i, c.charCodeAt(0)));
  write(0, 'RIFF');
  bytes.setUint32(4, 36 + count, true);
  write(8, 'WAVEfmt ');
  for (const [at, value] of [
    [16, 16],
    [20, 0x10001],
    [24, rate],
    [28, rate],
    [32, 0x80001],
  ])
    bytes.setUint32(at, value, true);
  write(36, 'data');
  bytes.setUint32(40, count, true);
  for (let i = 0; i < count; i++) bytes.setUint8(44 + i, 128);
  return URL.createObjectURL(new Blob([bytes], { type: 'audio/wav' }));
}

type Timed = Pick<HTMLMediaElement, 'currentTime' | 'readyState' | 'seeking'> & { src: string | Blob | null };

/** Actions of a page on a source and a time within one task, and the clock's time then and in the end. */
const SCRIPTS: Readonly<Record<string, (media: Timed, a: string, b: string) => void>> = {
  'another src, then a time': (media, _, b) => {
    media.src = b;
    media.currentTime = 0.5;
  },
  'a time, then another src': (media, _, b) => {
    media.currentTime = 0.5;
    media.src = b;
  },
  'a time beyond the end': (media, _, b) => {
    media.src = b;
    media.currentTime = 99;
  },
  'another src, a time, and the first src again': (media, a, b) => {
    media.src = b;
    media.currentTime = 0.5;
    media.src = a;
  },
  'a source without waiting callers': (media, a, b) => {
    media.src = b;
    media.currentTime = 0.5;
    media.src = `${b}#`;
    media.currentTime = 0.75;
    media.src = a;
  },
};

describe('a source and a time in one task', () => {
  async function timesOf(media: Timed, a: string, b: string): Promise<unknown[]> {
    const reported: unknown[] = [];
    const settled = (): Promise<void> => until(() => media.readyState > 0 && !media.seeking, 'the source');
    for (const isFirst of [true, false]) {
      for (const [name, script] of Object.entries(SCRIPTS)) {
        media.src = isFirst ? null : a;
        if (isFirst && 'load' in media) (media as HTMLAudioElement).removeAttribute('src');
        await frames(2);
        if (!isFirst) await settled();
        script(media, a, b);
        const now = media.currentTime;
        await frames(2);
        await settled();
        reported.push([name, isFirst, now, media.currentTime]);
      }
    }
    return reported;
  }

  it('are those of the audio element', async () => {
    const [a, b] = [silence(), silence()];
    const expected = await timesOf(new Audio(), a, b);
    // Another element keeps the device: a new one takes seconds here.
    await showLoaded();
    const element = show({});
    assertEqual(await timesOf(element, MOVIE, `${MOVIE}?another`), expected, 'times');
  });

  it('whichever of the attributes src and time comes first', async () => {
    const element = await showLoaded({ src: MOVIE });
    let seeks = 0;
    element.addEventListener('seeking', () => seeks++);
    for (const order of [
      ['src', 'time'],
      ['time', 'src'],
    ]) {
      const values = { src: `${MOVIE}?${order[0]}`, time: order[0] === 'src' ? '0.25' : '0.35' };
      for (const name of order as (keyof typeof values)[]) element.setAttribute(name, values[name]);
      await nextEvent(element, 'load');
      assertEqual([element.currentTime, seeks], [Number(values.time), 0], `${order.join(', then ')}: time, seeks`);
    }
  });
});

describe('play()', () => {
  itInLab('loads a scene that waits for a click, or for the viewport', async () => {
    const covered = show({ src: MOVIE, reveal: 'manual' });
    const below = show({ src: MOVIE }, 'width: 100px; height: 100px; margin-top: 5000px');
    await Promise.all([covered.play(), below.play()]);
    assertEqual([covered.paused, covered.revealed, below.paused], [false, true, false], 'paused, revealed, paused');
  });

  it('that waits is taken back by pause() and by another scene', async () => {
    const element = show({ src: MOVIE });
    const paused = refusal(element.play());
    element.pause();
    assertEqual(await paused, 'AbortError', 'after pause()');
    await element.ready;
    assertEqual(element.paused, true, 'paused');
    element.src = '/net/slow/compass.ply?ms=20000';
    const replaced = refusal(element.play());
    await nextEvent(element, 'loadstart');
    element.src = `${MOVIE}?another`;
    // Asked of the scene that was set just now.
    await element.play();
    assertEqual([await replaced, element.paused], ['AbortError', false], 'after another src');
  });
});
