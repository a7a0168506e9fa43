import { GaussianSplat } from '@gaussian-splat/react';

export default function Page() {
  return (
    <GaussianSplat
      src="/scene.spz"
      aria-label="A scene"
      loading="eager"
      cameraControls
      style={{ display: 'block', width: 300, height: 200 }}
    />
  );
}
