/** `node scripts/studio/compress.mjs MADE DATA SCENES`: what `make.py` left in the folder MADE becomes a scene of the studio: images and references in DATA, the scene in SCENES. */
import { copyFileSync, mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { encodingsFor } from '@gaussian-splat/optimize';
import { toDegree } from '@gaussian-splat/core';
import { readScene } from '@gaussian-splat/formats';

const [made, data, scenes] = process.argv.slice(2);
const truth = JSON.parse(readFileSync(join(made, 'truth.json'), 'utf8'));
const read = await readScene(readFileSync(join(made, 'scene.ply')), { name: 'scene.ply' });
// The garden is the largest: harmonics of degree 2 keep all scenes and references below 40 MB.
const cloud = { ...toDegree(truth.name === 'garden' ? 2 : 3, read), antialiased: truth.training.antialiased };
// Harmonics of 4 bits, or of 5 where 4 cost more than 1 dB PSNR of the trainer's image.
const encoding = encodingsFor('scene.spz', cloud)[['apartment', 'hall', 'product'].includes(truth.name) ? 1 : 0];
const scene = await encoding.write({ cloud, degrees: new Uint8Array(cloud.count).fill(cloud.shDegree) });
const out = join(data, truth.name);
mkdirSync(join(out, 'images'), { recursive: true });
mkdirSync(scenes, { recursive: true });
writeFileSync(join(scenes, `${truth.name}.spz`), scene);
for (const name of ['truth.json', 'views.json', 'depth.bin.gz', 'mesh.bin.gz'])
  copyFileSync(join(made, name), join(out, name));
for (const { image } of JSON.parse(readFileSync(join(made, 'views.json'), 'utf8')).views)
  copyFileSync(join(made, 'held', image), join(out, 'images', image));
console.log(`${truth.name}: ${cloud.count} splats as ${encoding.title}, ${(scene.length / 1e6).toFixed(2)} MB`);
