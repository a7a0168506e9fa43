import { GaussianSplat, type GaussianSplatElement } from '@gaussian-splat/react';
import type {} from '@gaussian-splat/react/jsx';
import { useRef, useState } from 'react';

const VARIANTS = [
  { name: 'Skull', src: '../scenes/skull.spz', poster: '../scenes/skull-poster.webp', alt: 'A human skull' },
  {
    name: 'Statue',
    src: '../scenes/st-peter.sog',
    poster: '../scenes/st-peter-poster.webp',
    alt: 'A statue of Saint Peter',
  },
];
const VIEWS = [
  { name: 'Front', orbit: '0deg 78deg 100%' },
  { name: 'Side', orbit: '80deg 78deg 100%' },
  { name: 'Close', orbit: '25deg 70deg 55%' },
];

export function Product() {
  const scene = useRef<GaussianSplatElement>(null);
  const [variant, setVariant] = useState(VARIANTS[0]);
  const [status, setStatus] = useState('');
  const [isOpen, setOpen] = useState(false);
  return (
    <>
      <h1>{variant.name}</h1>
      <GaussianSplat
        ref={scene}
        src={variant.src}
        poster={variant.poster}
        alt={variant.alt}
        cameraControls
        className="product"
        onLoad={() => setStatus('Drag to turn it.')}
        onError={({ detail }) => setStatus(detail.message)}
      >
        {variant === VARIANTS[0] && (
          <button slot="hotspot-forehead" data-position="0m 0.33m 0.25m" onClick={() => setOpen(!isOpen)}>
            The forehead
          </button>
        )}
      </GaussianSplat>
      {isOpen && <p>The frontal bone. It was captured, with all else, from 65 photographs.</p>}
      <p role="status">{status}</p>
      <p>
        {VARIANTS.map((each) => (
          <button key={each.name} aria-pressed={each === variant} onClick={() => setVariant(each)}>
            {each.name}
          </button>
        ))}
      </p>
      <p>
        {VIEWS.map(({ name, orbit }) => (
          <button key={name} onClick={() => scene.current?.flyTo({ orbit })}>
            {name}
          </button>
        ))}
      </p>
    </>
  );
}
