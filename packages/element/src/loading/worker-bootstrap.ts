/** Request of a worker that was started from text: the page must send a chunk of its code. */
export interface CodeQuestion {
  readonly id: number;
  readonly chunk: string;
}

/** The texts of the requested chunk and of its dependencies that were not sent before, or the reason of a failure. */
export type CodeAnswer =
  { readonly id: number; readonly texts: readonly string[] } | { readonly id: number; readonly failure: string };

/**
 * The script of a worker that is started from text: an expression for `spawnText`, which resolves when the main chunk
 * has run. The first message to the worker contains the port on which it requests chunks. Each text is
 * `"name":(exports,require,gaussianSplatChunk)=>{…}`. Answers are run in sequence, also one without texts, because the
 * second of two concurrent requests may need the texts of the first. The script is written as a string, because
 * bundlers change functions.
 */
export const BOOTSTRAP = `new Promise((start)=>addEventListener('message',({ports})=>{
early.length=0;
start(ports[0]);
},{once:true})).then((port)=>{
const code={},done={},asked=[];
let tail=Promise.resolve(),violated;
addEventListener('securitypolicyviolation',(event)=>violated??=event.effectiveDirective);
self.gaussianSplatCode=(more)=>{for(const name in more)code[name]??=more[name]};
port.onmessage=({data})=>asked[data.id](data);
const require=(name)=>{
if(!done[name])code[name](done[name]={},require,load);
return done[name];
};
const run=async(texts)=>{
const url=URL.createObjectURL(new Blob(['gaussianSplatCode({'+texts+'})'],{type:'text/javascript'}));
try{await import(url)}
catch(error){throw violated?new Error('Content-Security-Policy: '+violated):error}
finally{URL.revokeObjectURL(url)}
};
const load=async(chunk)=>{
if(!code[chunk]){
const answer=await new Promise((resolve)=>port.postMessage({id:asked.push(resolve)-1,chunk}));
if(answer.failure)throw new Error(answer.failure);
await(tail=tail.catch(()=>0).then(()=>answer.texts.length&&run(answer.texts)));
}
return require(chunk);
};
return load('./scene-worker.js');
})`;
