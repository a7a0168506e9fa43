import { retiredNames } from './names.mjs';

/** A plugin for the linter. */
export default { meta: { name: 'words' }, rules: { 'retired-names': retiredNames } };
