import type {} from '@gaussian-splat/element/preact';
import '@gaussian-splat/element';
import { render } from 'preact';

render(
  <gaussian-splat
    src="/scene.spz"
    alt="A scene"
    loading="eager"
    cameraControls
    onLoad={({ detail }) => console.log(detail.url)}
    oncamera-change={({ detail }) => console.log(detail.source)}
    style={{ display: 'block', width: 300, height: 200 }}
  />,
  document.getElementById('root')!,
);
