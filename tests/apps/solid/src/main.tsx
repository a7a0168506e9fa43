import type {} from '@gaussian-splat/element/solid';
import '@gaussian-splat/element';
import { render } from 'solid-js/web';

render(
  () => (
    <gaussian-splat
      src="/scene.spz"
      alt="A scene"
      loading="eager"
      prop:cameraControls={true}
      on:load={({ detail }) => console.log(detail.url)}
      on:camera-change={({ detail }) => console.log(detail.source)}
      style={{ display: 'block', width: '300px', height: '200px' }}
    />
  ),
  document.getElementById('root')!,
);
