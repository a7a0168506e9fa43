import { GaussianSplat } from '@gaussian-splat/react';
import { StrictMode } from 'react';
import { createRoot } from 'react-dom/client';

createRoot(document.getElementById('root')).render(
  <StrictMode>
    <GaussianSplat src="/scene.spz" alt="A scene" loading="eager" cameraControls style={{ width: 300, height: 200 }} />
  </StrictMode>,
);
