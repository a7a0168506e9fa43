import { GaussianSplat } from '@gaussian-splat/react';

export default function Home() {
  return (
    <GaussianSplat src="/scene.spz" alt="A scene" loading="eager" cameraControls style={{ width: 300, height: 200 }} />
  );
}
