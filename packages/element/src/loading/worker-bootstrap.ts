/** Request of a text worker to the page: a chunk of its code. */
export interface CodeQuestion {
  readonly id: number;
  readonly chunk: string;
}

/** The texts of that chunk and of its missing dependencies; or the reason of a failure. */
export type CodeAnswer =
  { readonly id: number; readonly texts: readonly string[] } | { readonly id: number; readonly failure: string };

/**
 * The script of a text worker, for `spawnText`: a promise of its main chunk. The first message contains the port for
 * its code. Each text is `"name":(exports,require,gaussianSplatChunk)=>{…}`. They run in sequence, and an answer
 * without texts waits, too: the second of two concurrent requests may need the texts of the first, or be the same. It
 * is written as text itself, because bundlers change functions.
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
