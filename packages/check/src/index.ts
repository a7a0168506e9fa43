export { checkModel, type CheckFault, type CheckOptions, type CheckReport } from './check-model.js';
export { formatReport, main } from './main.js';
export { draftContract, type Draft } from './draft-contract.js';
