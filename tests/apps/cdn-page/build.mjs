/** The folder of the CDN build, which the page takes from another origin. */
import { cpSync } from 'node:fs';

cpSync('node_modules/@gaussian-splat/element/cdn', 'elsewhere', { recursive: true });
