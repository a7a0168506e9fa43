/** Accepted and refused types of React's wrapper and of the bare tag. Only type-checked, by types.test.ts. */
import {
  GaussianSplat,
  SplatCut,
  SplatMesh,
  SplatScene,
  type HandlerName,
  type SplatCutProps,
} from '@gaussian-splat/react';
import type { GaussianSplatEventMap, ImmersiveStatusDetail, MeasureDetail } from '@gaussian-splat/element';
import type { ChildEventMap } from '@gaussian-splat/element/scenes.js';
import type {} from '@gaussian-splat/react/jsx';
import type { DOMAttributes } from 'react';

type Ours = Lowercase<`on${keyof GaussianSplatEventMap}`>;
/** Names that React has for handlers of our events: on the component each must be ours, or React swallows it. */
type Reacts = { [Name in keyof DOMAttributes<Element>]-?: Lowercase<Name> extends Ours ? Name : never };
type Swallowed = Exclude<Reacts[keyof Reacts], HandlerName>;
/** Fails to compile if a name is not checked, and reports the name. */
export const noneIsSwallowed: [Swallowed] extends [never] ? true : Swallowed = true;

export const component = (
  <GaussianSplat
    currentTime={1}
    playbackRate={2}
    pose={[0, 1]}
    onTimeUpdate={({ currentTarget, type }) => console.log(currentTarget, type)}
    onLoadedMetadata={() => undefined}
    onCameraChange={({ detail }) => console.log(detail.source)}
    onClick={({ clientX }) => console.log(clientX)}
  />
);
// @ts-expect-error The name is React's own.
export const misspelt = <GaussianSplat onTimeupdate={() => undefined} />;
// @ts-expect-error It can only be read.
export const readOnly = <GaussianSplat duration={1} />;
// @ts-expect-error It is a method.
export const method = <GaussianSplat play={async () => undefined} />;

export const composed = (
  <GaussianSplat src="room.sog">
    <SplatScene
      src="plant.spz"
      position={[1, 0, 0]}
      rotation="0 90deg 0"
      matrix={new DOMMatrix()}
      crop={[0, 0, 0, 1, 1, 1]}
      inputValues={{ smile: 1 }}
      hidden
      onError={({ detail }) => console.log(detail.reason)}
    />
    <SplatMesh src="chair.glb" scale={2} autoplay loop onLoad={({ detail }) => console.log(detail.url)} />
    <SplatScene
      src="walker.onnx"
      onInputsChange={() => undefined}
      onGeneratorMemory={({ detail }) => detail.weightBytes satisfies number}
    />
    <SplatCut shape="plane" position={[0, 0.8, 0]} hidden />
  </GaussianSplat>
);
export const cut: SplatCutProps = { shape: 'sphere', effect: 'tint', color: 'tomato' };
export const immersive = (
  <GaussianSplat
    vr
    measure
    onVrStatus={({ detail }) => detail satisfies ImmersiveStatusDetail}
    onMeasure={({ detail }) => detail satisfies MeasureDetail}
  />
);
/** Events of the parent alone are not declared on children. */
export const noDeadEvent: Extract<'view-change' | 'measure' | 'vr-status', keyof ChildEventMap> extends never
  ? true
  : never = true;
// @ts-expect-error It is the scene's.
export const cropped = <SplatMesh crop="0 0 0 1 1 1" />;
// @ts-expect-error It can only be read.
export const loadedScene = <SplatScene loaded />;
export const bareScene = (
  <splat-scene src="a.ply" position={[0, 1, 0]} onerror={({ detail }) => console.log(detail.code)} />
);

export const bare = <gaussian-splat src="a.ply" currentTime={1} onload={({ detail }) => console.log(detail.url)} />;
// @ts-expect-error It would never fire.
export const deadLoad = <gaussian-splat onLoad={() => undefined} />;
// @ts-expect-error It would never fire.
export const deadTime = <gaussian-splat onTimeUpdate={() => undefined} />;
// @ts-expect-error It would never fire.
export const deadCamera = <gaussian-splat onCameraChange={() => undefined} />;
// @ts-expect-error It can only be read.
export const readOnlyBare = <gaussian-splat error={null} />;

const scene = document.createElement('gaussian-splat');
scene.addEventListener('click', ({ clientX }) => clientX satisfies number);
scene.removeEventListener('keydown', ({ key }) => key satisfies string);
scene.addEventListener('load', ({ detail }) => detail.url satisfies string);
scene.addEventListener('own-event', (event) => event satisfies Event);

document.createElement('button').addEventListener('hotspot-visibility', ({ detail }) => {
  detail.visible satisfies boolean;
});
