import '@gaussian-splat/element';
import { render } from 'preact';

render(
  <gaussian-splat
    src="/scene.spz"
    alt="A scene"
    loading="eager"
    camera-controls
    style={{ display: 'block', width: 300, height: 200 }}
  />,
  document.getElementById('root'),
);
