/** Names of the rows of `SOURCE_KINDS`. */
export type SourceKindName = 'mesh' | 'splats' | 'generator' | 'clip' | 'stream' | 'sequence' | 'file';

/** Contents of an element that a backend may not be able to draw: kinds of sources, and others. */
export type Content = SourceKindName | 'children' | 'modifiers' | 'levels' | 'post-processor';
