/** The app of the page React. With scenes in the address it is what tests drive. */
import { StrictMode } from 'react';
import { createRoot } from 'react-dom/client';
import { Harness } from './harness.js';
import { Product } from './product.js';

const isTested = new URLSearchParams(location.search).has('first');
createRoot(document.getElementById('app')!).render(<StrictMode>{isTested ? <Harness /> : <Product />}</StrictMode>);
