/**
 * Turns shaders/*.wgsl into packages/renderer/src/generated/: code with its `#import`s resolved, and every
 * binding number, struct layout, workgroup size and numeric constant reflected from the WGSL itself, so that the code neither counts padding nor repeats numbers by hand. `shaders.ts` has the shaders that every scene needs, `live-shaders.ts` those that only generators and image models need, `streamed-shaders.ts` those that only streamed scenes need: pages without them never load these. The stages of optimize are in its own
 * package, with the structs and constants that only they have.
 */
import { mkdirSync, readdirSync, writeFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { ResourceType } from 'wgsl_reflect/wgsl_reflect.module.js';
import { modifiedCode, ownCode, partsOf, reflect, reflectStruct, shaderFolder } from './lib/shader-source.mjs';

const generatedOf = (name) => fileURLToPath(new URL(`../packages/${name}/src/generated/`, import.meta.url));

/** Stages that few pages need, by the file that has them. */
const RARE = {
  'budget-shaders': ['detail_allow', 'detail_count'],
  'live-shaders': ['image_to_tensor', 'ingest', 'present', 'tensor_to_image'],
  'clip-shaders': ['animate'],
  'streamed-shaders': ['move_slots', 'page_feedback'],
  'quantized-shaders': ['cull_quantized', 'cull_serial_quantized', 'project_quantized', 'move_quantized_slots'],
  'few-shaders': ['bin_cut', 'bin_index_few', 'bin_order_few', 'rasterize_tiles_few'],
  'auxiliary-shaders': ['rasterize_tiles_auxiliary', 'rasterize_tiles_auxiliary_few'],
  'probe-shaders': ['probe_depth', 'probe_surface', 'probe_surface_quantized'],
  'depth-shaders': ['blend_layers', 'rasterize_quads_depth', 'rasterize_tiles_depth', 'rasterize_tiles_depth_few'],
  'linear-shaders': ['compose_linear'],
  'rectangle-shaders': ['compose_rectangle'],
  'maps-shaders': ['rasterize_tiles_maps', 'splat_owners'],
  'order-shaders': ['pixel_depths', 'pixel_depths_quantized', 'rasterize_tiles_order'],
};
/** Stages that are made a second time, `cull_quantized` of `cull` and so on, with another part in place of one. */
const QUANTIZED = {
  stages: ['cull', 'cull_serial', 'pixel_depths', 'probe_surface', 'project'],
  replaced: { 'shared/stored_gaussian': 'shared/quantized_gaussian' },
};
/** Stages that are made a second time for images of few tiles: `bin_index_few` of `bin_index` and so on. */
const SEGMENTS = {
  'shared/column': 'shared/single',
  'shared/column_rows': 'shared/single_rows',
  'shared/whole_lists': 'shared/segments',
};
const PLAIN_SEGMENTS = { ...SEGMENTS, 'shared/whole_lists': 'shared/plain_segments' };
const FEW = {
  bin_index: { 'shared/undivided': 'shared/tile_counts' },
  bin_order: { 'shared/undivided': 'shared/divide_lists' },
  rasterize_tiles: PLAIN_SEGMENTS,
  rasterize_tiles_auxiliary: PLAIN_SEGMENTS,
  rasterize_tiles_depth: SEGMENTS,
};
/**
 * Stages that are made once more for splats that a page cuts, reveals or moves: `cull_modified` of `cull` and so on, which call other functions in place of those that
 * read and pack a splat. The text of the stages themselves stays as it is.
 */
const MODIFIED = {
  stages: {
    cull_chunks: 'shared/modified_chunk',
    ...Object.fromEntries(QUANTIZED.stages.map((stage) => [stage, 'shared/modified_gaussian'])),
  },
  called: {
    may_be_visible: 'may_be_modified',
    gaussian_at: 'loaded_gaussian_at',
    unpack_gaussian: 'modified_gaussian',
    pack_splat: 'pack_modified',
  },
};
RARE['modified-shaders'] = [
  'cull_chunks_modified',
  ...QUANTIZED.stages.flatMap((stage) => [`${stage}_modified`, `${stage}_quantized_modified`]),
];
/** Shaders of another package, which imports shared parts from the renderer. */
const OPTIMIZE = 'optimize';
RARE[OPTIMIZE] = [
  'optimize_cut',
  'optimize_lower',
  'optimize_moments',
  'optimize_score',
  'optimize_take',
  'image_error',
  'image_error_sum',
  'refine_backward',
  'refine_chain',
  'refine_step',
];
const fileOf = (stage) => Object.keys(RARE).find((file) => RARE[file].includes(stage)) ?? 'shaders';
/** The contents of a binding, as fields of GPUBindGroupLayoutEntry. */
function resourceOf({ resourceType, type, access }) {
  if (resourceType === ResourceType.Texture) return { type: 'texture' };
  if (resourceType === ResourceType.StorageTexture) return { type: 'storage-texture', format: type.format.name };
  if (resourceType === ResourceType.Uniform) return { type: 'uniform' };
  return { type: access === 'read' ? 'read-only-storage' : 'storage' };
}

function reflectBindings(reflection) {
  const variables = [...reflection.uniforms, ...reflection.storage, ...reflection.textures];
  return Object.fromEntries(
    variables
      .sort((a, b) => a.binding - b.binding)
      .map((variable) => {
        if (variable.group !== 0) throw new Error(`${variable.name}: only @group(0) is used`);
        return [variable.name, { binding: variable.binding, ...resourceOf(variable) }];
      }),
  );
}

function reflectConstants(code) {
  const constants = {};
  for (const [, name, text] of code.matchAll(/^const (\w+) = ([^;]+);$/gm)) {
    const expression = text
      .replace(/(\d)[uif]\b/g, '$1')
      .replace(/\b[A-Z][A-Z_0-9]*\b/g, (used) => constants[used] ?? used);
    if (/^[\d\s+\-*/().e]+$/.test(expression)) constants[name] = Number(new Function(`return ${expression}`)());
  }
  return constants;
}

function note(named, name, value, file) {
  const homes = named.get(name)?.homes ?? new Set();
  named.set(name, { value, homes: homes.add(file) });
}

const camelCase = (name) => name.replace(/_(\w)/g, (_, letter) => letter.toUpperCase());
const literal = (value) => JSON.stringify(value, null, 2);

const plainStages = readdirSync(shaderFolder)
  .filter((file) => file.endsWith('.wgsl'))
  .map((file) => file.slice(0, -5))
  .sort()
  .map((path) => ({ stage: path, path, replaced: {} }));
const quantizedStages = QUANTIZED.stages.map((path) => ({
  stage: `${path}_quantized`,
  path,
  replaced: QUANTIZED.replaced,
}));
const fewStages = Object.entries(FEW).map(([path, replaced]) => ({ stage: `${path}_few`, path, replaced }));
const modifiedStages = [...plainStages, ...quantizedStages]
  .filter(({ path }) => path in MODIFIED.stages)
  .map((plain) => ({ ...plain, stage: `${plain.stage}_modified`, added: MODIFIED.stages[plain.path] }));
const stages = [...plainStages, ...quantizedStages, ...fewStages, ...modifiedStages];
/** The layout or the number by name, with the files whose stages declare it. */
const structs = new Map();
const constants = new Map();
/** Each file once, however many stages import it: a page loads them all. */
const parts = new Map();
/** The parts of a stage with other functions called in them, and those parts that have the functions. */
function modifiedParts(plainPaths, added) {
  for (const path of added) parts.set(path, ownCode(path));
  const paths = plainPaths.map((path) => {
    const code = modifiedCode(path, MODIFIED.called);
    if (added.includes(path) || code === parts.get(path)) return path;
    parts.set(`${path}_modified`, code);
    return `${path}_modified`;
  });
  return [...paths, ...added.filter((path) => !plainPaths.includes(path))];
}
const partName = (path) => `${camelCase(path.replace('/', '_'))}Part`;
const stageFiles = ['shaders', ...Object.keys(RARE)];
const partsIn = Object.fromEntries(stageFiles.map((file) => [file, new Set()]));
const sections = Object.fromEntries(stageFiles.map((file) => [file, []]));
for (const { stage, path: ownPath, replaced, added } of stages) {
  const home = fileOf(stage);
  const plainPaths = partsOf(ownPath, replaced);
  for (const path of plainPaths) parts.set(path, ownCode(path));
  const paths = added ? modifiedParts(plainPaths, partsOf(added, replaced)) : plainPaths;
  for (const path of paths) partsIn[home].add(path);
  const code = paths.map((path) => parts.get(path)).join('\n');
  const reflection = reflect(stage, code);
  for (const struct of reflection.structs) note(structs, struct.name, reflectStruct(struct), home);
  for (const [name, value] of Object.entries(reflectConstants(code))) {
    const known = constants.get(name)?.value ?? value;
    if (known !== value) throw new Error(`${stage}: ${name} has two values`);
    note(constants, name, value, home);
  }
  const joined = paths.map(partName).join(" + '\\n' + ");
  const bindings = literal(reflectBindings(reflection));
  sections[home].push(
    `export const ${camelCase(stage)} = {\n  name: '${stage}',\n  bindings: ${bindings},\n  code: ${joined},\n} as const;\n`,
  );
}

const header = '/** Written by scripts/build-shaders.mjs from shaders/. Do not edit. */\n/* eslint-disable */\n';
const define = ([name, value]) => `export const ${name} = ${literal(value)} as const;`;
/** As any string: declarations would hold all of the code once more. */
const part = (path) => `export const ${partName(path)}: string = ${JSON.stringify(parts.get(path))};`;
/** The file that exports a part to the others: `shaders.ts` only if its own stages need it. */
const homeOf = (path) => stageFiles.find((file) => partsIn[file].has(path));

/** The declarations of stages of the given kind, by name. */
function saidBy(named, isMeant) {
  return [...named].filter(([, { homes }]) => isMeant(homes)).map(([name, { value }]) => [name, value]);
}

/** Files whose own structs lie beside them: pages without these stages do not load their layouts either. */
const LAYOUTS = {
  'clip-shaders': 'clip-layouts',
  'live-shaders': 'live-layouts',
  'modified-shaders': 'modified-layouts',
};
const layoutsOf = (homes) => (homes.size === 1 ? LAYOUTS[[...homes][0]] : undefined);
const isOfRenderer = (homes) => [...homes].some((file) => file !== OPTIMIZE);
const byName = ([a], [b]) => (a < b ? -1 : 1);

/** @param from the file that has the parts of all other files; by default each part comes from its own file */
function rareFile(file, from) {
  const paths = [...partsIn[file]];
  const moduleOf = (path) => from ?? `./${homeOf(path)}.js`;
  const others = paths.filter((path) => homeOf(path) !== file);
  const importOf = (module) => {
    const names = others.filter((path) => moduleOf(path) === module).map(partName);
    return `import { ${names.join(', ')} } from '${module}';`;
  };
  return [
    ...[...new Set(others.map(moduleOf))].map(importOf),
    ...paths.filter((path) => homeOf(path) === file).map(part),
    ...sections[file],
  ];
}

const files = {
  // Modules and not objects, so that bundlers leave out the unused ones.
  layouts: [
    '/** Byte sizes and offsets of the WGSL structs. */',
    ...saidBy(structs, (homes) => isOfRenderer(homes) && !layoutsOf(homes))
      .sort(byName)
      .map(define),
  ],
  ...Object.fromEntries(
    Object.values(LAYOUTS).map((file) => [
      file,
      saidBy(structs, (homes) => layoutsOf(homes) === file)
        .sort(byName)
        .map(define),
    ]),
  ),
  constants: [
    '/** Numeric constants of the WGSL, by their names there. */',
    ...saidBy(constants, isOfRenderer).map(define),
  ],
  shaders: [
    "export * as layouts from './layouts.js';",
    "export * as constants from './constants.js';",
    ...[...partsIn.shaders].map(part),
    ...sections.shaders,
  ],
  ...Object.fromEntries(
    Object.keys(RARE)
      .filter((file) => file !== OPTIMIZE)
      .map((file) => [file, rareFile(file)]),
  ),
};
const isOwn = (homes) => !isOfRenderer(homes);
const ownFile = [
  ...rareFile(OPTIMIZE, '@gaussian-splat/renderer/stages'),
  ...[structs, constants].flatMap((named) => saidBy(named, isOwn).sort(byName).map(define)),
];

function write(folder, name, lines) {
  mkdirSync(folder, { recursive: true });
  writeFileSync(`${folder}${name}.ts`, `${header}${lines.join('\n')}\n`);
}

for (const [name, lines] of Object.entries(files)) write(generatedOf('renderer'), name, lines);
write(generatedOf('optimize'), 'shaders', ownFile);
console.log(`shaders: ${stages.length} stages, ${structs.size} structs`);
