/** Actions for tests: mount, unmount, another source, a ref, events, a property by reference. */
import { GaussianSplat, type GaussianSplatElement } from '@gaussian-splat/react';
import type {} from '@gaussian-splat/react/jsx';
import { useEffect, useRef, useState } from 'react';

const query = new URLSearchParams(location.search);
/** The scenes that the app goes to and fro between. */
const SCENES = [query.get('first') ?? '../scenes/skull.spz', query.get('second') ?? '../scenes/knot/knot.gsv'];
/** Sliders of a generator: an object that must arrive as it is. */
const CONTROLS = { smile: 0.4 };

export function Harness() {
  const splat = useRef<GaussianSplatElement>(null);
  const [isShown, setShown] = useState(true);
  const [scene, setScene] = useState(0);
  const [status, setStatus] = useState('waiting');
  const [loads, setLoads] = useState(0);
  const [moves, setMoves] = useState(0);
  const [times, setTimes] = useState(0);
  const [view, setView] = useState('');
  const [mounts, setMounts] = useState(0);
  // Twice under StrictMode in React's development build, which mounts everything, takes it away and mounts it again.
  useEffect(() => setMounts((count) => count + 1), []);
  const describe = () => {
    const element = splat.current;
    setView(
      element
        ? `${element.getCameraOrbit()}, controls by reference: ${element.inputValues === CONTROLS}`
        : 'no element',
    );
  };
  return (
    <>
      <h1>React</h1>
      <p>
        <button id="toggle" onClick={() => setShown(!isShown)}>
          {isShown ? 'Take it away' : 'Bring it back'}
        </button>{' '}
        <button id="swap" onClick={() => setScene(1 - scene)}>
          Another scene
        </button>{' '}
        <button id="view" onClick={describe}>
          Where is the camera?
        </button>
      </p>
      {isShown && (
        <GaussianSplat
          ref={splat}
          src={SCENES[scene]}
          alt="A scene in a React app"
          loading="eager"
          cameraControls
          cameraOrbit="0deg 75deg auto"
          inputValues={CONTROLS}
          style={{ width: '100%', maxWidth: 320, height: 240 }}
          onLoad={({ detail }) => {
            setStatus(`loaded ${detail.url}`);
            setLoads((count) => count + 1);
          }}
          onError={({ detail }) => setStatus(`${detail.code}: ${detail.message}`)}
          onTimeUpdate={() => setTimes((count) => count + 1)}
          onCameraChange={() => setMoves((count) => count + 1)}
        >
          <button slot="hotspot-forehead" data-position="0m 0.33m 0.25m">
            The forehead
          </button>
        </GaussianSplat>
      )}
      <p role="status">
        <output id="status">{status}</output>
      </p>
      <p>
        Events: load <output id="loads">{loads}</output>, camera-change <output id="moves">{moves}</output>, timeupdate{' '}
        <output id="times">{times}</output>; effects of the mount: <output id="mounts">{mounts}</output>
      </p>
      <p>
        <output id="where">{view}</output>
      </p>
    </>
  );
}
