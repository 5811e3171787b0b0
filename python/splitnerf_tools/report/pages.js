/* sources 5f5bc53e7584b9e83ece9ab760b44205e2e10cb0680c383e2cc4a9c6acc2db07: main.js report/compare.js report/curves.js report/differences.js report/files.js report/light.js report/main.js report/object.js report/style.css view/cameras.js view/channels.js view/chart.js view/connection.js view/controls.css view/controls.js view/drop.js view/elements.js view/final.js view/ground.js view/halves.js view/main.js view/panel.js view/server.js view/style.css view/training.js view/view.js view/viewer.js
contains three:

The MIT License

Copyright © 2010-2026 three.js authors

Permission is hereby granted, free of charge, to any person obtaining a copy
of this software and associated documentation files (the "Software"), to deal
in the Software without restriction, including without limitation the rights
to use, copy, modify, merge, publish, distribute, sublicense, and/or sell
copies of the Software, and to permit persons to whom the Software is
furnished to do so, subject to the following conditions:

The above copyright notice and this permission notice shall be included in
all copies or substantial portions of the Software.

THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR
IMPLIED, INCLUDING BUT NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY,
FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE
AUTHORS OR COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER
LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM,
OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN
THE SOFTWARE.


uplot:

The MIT License (MIT)

Copyright (c) 2022 Leon Sorokin

Permission is hereby granted, free of charge, to any person obtaining a copy
of this software and associated documentation files (the "Software"), to deal
in the Software without restriction, including without limitation the rights
to use, copy, modify, merge, publish, distribute, sublicense, and/or sell
copies of the Software, and to permit persons to whom the Software is
furnished to do so, subject to the following conditions:

The above copyright notice and this permission notice shall be included in
all copies or substantial portions of the Software.

THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR
IMPLIED, INCLUDING BUT NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY,
FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE
AUTHORS OR COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER
LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM,
OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN
THE SOFTWARE.
*/
(()=>{var Gl='.uplot, .uplot *, .uplot *::before, .uplot *::after {box-sizing: border-box;}.uplot {font-family: system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, "Noto Sans", sans-serif, "Apple Color Emoji", "Segoe UI Emoji", "Segoe UI Symbol", "Noto Color Emoji";line-height: 1.5;width: min-content;}.u-title {text-align: center;font-size: 18px;font-weight: bold;}.u-wrap {position: relative;user-select: none;}.u-over, .u-under {position: absolute;}.u-under {overflow: hidden;}.uplot canvas {display: block;position: relative;width: 100%;height: 100%;}.u-axis {position: absolute;}.u-legend {font-size: 14px;margin: auto;text-align: center;}.u-inline {display: block;}.u-inline * {display: inline-block;}.u-inline tr {margin-right: 16px;}.u-legend th {font-weight: 600;}.u-legend th > * {vertical-align: middle;display: inline-block;}.u-legend .u-marker {width: 1em;height: 1em;margin-right: 4px;background-clip: padding-box !important;}.u-inline.u-live th::after {content: ":";vertical-align: middle;}.u-inline:not(.u-live) .u-value {display: none;}.u-series > * {padding: 4px;}.u-series th {cursor: pointer;}.u-legend .u-off > * {opacity: 0.3;}.u-select {background: rgba(0,0,0,0.07);position: absolute;pointer-events: none;}.u-cursor-x, .u-cursor-y {position: absolute;left: 0;top: 0;pointer-events: none;will-change: transform;}.u-hz .u-cursor-x, .u-vt .u-cursor-y {height: 100%;border-right: 1px dashed #607D8B;}.u-hz .u-cursor-y, .u-vt .u-cursor-x {width: 100%;border-bottom: 1px dashed #607D8B;}.u-cursor-pt {position: absolute;top: 0;left: 0;border-radius: 50%;border: 0 solid;pointer-events: none;will-change: transform;/*this has to be !important since we set inline "background" shorthand */background-clip: padding-box !important;}.u-axis.u-off, .u-select.u-off, .u-cursor-x.u-off, .u-cursor-y.u-off, .u-cursor-pt.u-off {display: none;}';var Vl=`.controls label { display: block; }
.controls label.check { display: flex; gap: 6px; align-items: center; }
.controls input { accent-color: var(--accent); }
.controls input[type=range], .controls select { display: block; width: 100%; margin: 2px 0 0; }
.controls select, .controls button { padding: 3px 8px; border: 1px solid var(--line); border-radius: 5px; background: none; color: inherit; font: inherit; cursor: pointer; }
.controls select option { background: var(--card); color: var(--text); }
.controls fieldset { display: grid; gap: 10px; min-width: 0; margin: 0; padding: 0; border: 0; transition: opacity .15s; }
.controls fieldset:disabled { opacity: .4; }
.controls fieldset.pills { display: flex; flex-wrap: wrap; gap: 4px; }
.pills label { position: relative; }
.pills input { position: absolute; inset: 0; margin: 0; opacity: 0; cursor: pointer; }
.pills span { display: block; padding: 3px 10px; border: 1px solid var(--line); border-radius: 999px; }
.pills label:hover span { border-color: var(--accent); }
.pills input:checked + span { border-color: var(--accent); background: var(--accent); color: #fff; }
.pills input:focus-visible + span, .controls :focus-visible { outline: 2px solid var(--accent); outline-offset: 1px; }
.controls .pair { display: flex; flex-wrap: wrap; gap: 6px 14px; }
.controls .pair { align-items: baseline; }
.controls .pair select { display: inline; width: auto; margin: 0; padding: 1px 4px; }
.controls .hint a { color: var(--accent); }
.controls .hint { margin: 0; color: var(--dim); font-size: 12.5px; }
.controls output { float: right; color: var(--dim); font-variant-numeric: tabular-nums; }
.controls dl { display: grid; grid-template-columns: auto 1fr; gap: 2px 10px; margin: 8px 0 0; font-size: 12px; }
.controls dt { font-family: ui-monospace, monospace; white-space: nowrap; }
.controls dd { margin: 0; }

.bar3d { position: absolute; z-index: 1; left: 14px; bottom: 12px; padding-bottom: 3px; border: solid #fff; border-width: 0 1.5px 1.5px; color: #fff; font-size: 12px; line-height: 1.2;
  text-align: center; text-shadow: 0 0 3px #000; filter: drop-shadow(0 0 1px #0008); }
.bar3d[hidden] { display: none; }
.axes3d { bottom: 36px; border: 0; pointer-events: none; }
.axes3d svg { display: block; fill: #fff; stroke-width: 2.5; text-anchor: middle; }
.axes3d .x { stroke: #ff6b6b; } .axes3d .y { stroke: #6fcf6f; } .axes3d .z { stroke: #6aa5ff; }

.divider { position: absolute; top: 0; bottom: 0; width: 2px; margin-left: -1px; background: #fff; box-shadow: 0 0 3px #0009; pointer-events: none; }
.divider::after { content: "◂ ▸"; position: absolute; top: 50%; left: 50%; padding: 3px 5px; border-radius: 999px; background: #fff; color: #333;
  font-size: 11px; line-height: 1; white-space: nowrap; transform: translate(-50%, -50%); }
.stage > input { position: absolute; inset: 0; width: 100%; height: 100%; margin: 0; opacity: 0; cursor: ew-resize; appearance: none; background: none; }
.stage > input::-webkit-slider-thumb { appearance: none; width: 1px; height: 100%; }
.stage > input::-moz-range-thumb { width: 1px; height: 100%; border: 0; }
.tag { position: absolute; top: 8px; left: 8px; padding: 1px 8px; border-radius: 4px; background: #000a; color: #fff; font-size: 12px; pointer-events: none; }
.tag.other { left: auto; right: 8px; }
.tag.covered { opacity: 0; }
#drop { position: fixed; z-index: 9; inset: 12px; display: grid; place-content: center; border: 3px dashed #fff; border-radius: 12px;
  background: #000a; color: #fff; font-size: 20px; text-align: center; pointer-events: none; }
#drop[hidden], .hint:empty { display: none; }
`;function We(i,e={},...t){let n=document.createElement(i);for(let[s,r]of Object.entries(e))s.startsWith("on")?n.addEventListener(s.slice(2),r):r===!0?n.setAttribute(s,""):r!==!1&&r!=null&&n.setAttribute(s,r);return n.append(...t),n}var Wl=i=>document.head.append(We("style",{},i));function Ta(i,e,t){let n=e.map((a,l)=>We("button",{type:"button",role:"radio",onclick:()=>s(l)},a)),s=a=>{n.forEach((l,c)=>{l.setAttribute("aria-checked",String(c===a)),l.tabIndex=c===a?0:-1}),t(a)},r={ArrowLeft:-1,ArrowUp:-1,ArrowRight:1,ArrowDown:1},o=We("div",{class:"tabs",role:"radiogroup","aria-label":i},...n);return o.addEventListener("keydown",a=>{if(!(a.key in r))return;a.preventDefault();let l=(n.indexOf(document.activeElement)+r[a.key]+n.length)%n.length;s(l),n[l].focus()}),s(0),o}var go=class{constructor(e,t){this.line=We("div",{class:"divider"}),this.tags=[We("span",{class:"tag"}),We("span",{class:"tag other"})],this.slider=We("input",{type:"range",min:0,max:100,step:.5,value:50,"aria-label":e}),this.nodes=[this.line,...this.tags,this.slider],this.slider.addEventListener("input",t),this.slider.addEventListener("pointerdown",()=>this.before=this.slider.value),this.slider.addEventListener("pointercancel",()=>{this.slider.value=this.before,t()})}cut(e,t=Number(this.slider.value)){e.style.clipPath=`inset(0 ${100-t}% 0 0)`,this.line.style.left=`${t}%`,this.tags.forEach((n,s)=>n.classList.toggle("covered",!this.slider.hidden&&(s?t>85:t<15)))}};function Xl(i,e){let{left:t,top:n,width:s,height:r}=i.getBoundingClientRect(),o=a=>Math.min(Math.max(a,0),.999999);return[o((e.clientX-t)/s),o((e.clientY-n)/r)]}async function Aa(i){let e=atob(i.trim()),t=new Uint8Array(e.length);for(let n=0;n<t.length;n++)t[n]=e.charCodeAt(n);return new Response(new Blob([t]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer()}function Is(i,e=3){return Number.isFinite(i)?Math.abs(i)>=1e5||i!==0&&Math.abs(i)<1e-4?i.toExponential(e-1).replace(/\.?0+e/,"e"):String(Number(i.toPrecision(e))):"–"}var Vp=`@media not print { .live .static { display: none !important; } }
@media not print { .live .cards { display: grid; } }
.toolbar [hidden], .stage [hidden], .stage[hidden], .tip[hidden] { display: none; }
.toolbar { display: flex; flex-wrap: wrap; gap: 8px 16px; align-items: center; margin: 0 0 12px; font-size: 13.5px; }
.tabs { display: flex; flex-wrap: wrap; gap: 4px; }
.tabs button, .toolbar > button { padding: 4px 11px; border: 1px solid var(--line); border-radius: 999px; background: var(--card); color: var(--text); font: inherit; cursor: pointer; }
.tabs button:hover, .toolbar > button:hover { border-color: var(--accent); }
.tabs button[aria-checked=true] { border-color: var(--accent); background: var(--accent); color: #fff; }
.toolbar :focus-visible { outline: 2px solid var(--accent); outline-offset: 1px; }
.toolbar.controls label { flex: 0 1 220px; min-width: 160px; }
.axis { color: var(--dim); white-space: nowrap; }
.axis input { accent-color: var(--accent); vertical-align: -2px; }
.legend-row { margin: 0; color: var(--dim); }
.legend-row:empty { display: none; }
.legend-row i { display: inline-block; width: 140px; height: 11px; margin: 0 4px; border-radius: 3px; vertical-align: -1px; }
.said { margin: 6px 0 0; min-height: 1.5em; color: var(--dim); font-size: 12.5px; overflow-wrap: anywhere; }

.stage { position: relative; overflow: hidden; border-radius: 6px; background: #8d8f91; }
.stage img, .stage canvas { position: absolute; inset: 0; width: 100%; height: 100%; }
.stage.coarse img, .stage canvas, .sky canvas { image-rendering: pixelated; }
.stage > input { touch-action: pan-y; }
.stage:focus-within { outline: 2px solid var(--accent); outline-offset: 2px; }
.sky { position: relative; overflow: hidden; border-radius: 6px; }
.sky canvas { display: block; width: 100%; aspect-ratio: 2; cursor: crosshair; }
.cross { position: absolute; width: 11px; height: 11px; margin: -5.5px; border: 1.5px solid #fff; border-radius: 50%; box-shadow: 0 0 0 1px #000; pointer-events: none; }
.cross[hidden] { display: none; }

.plot { position: relative; min-height: 260px; }
.chart figcaption { display: flex; justify-content: space-between; }
.chart figcaption .axis { font-weight: 400; font-size: 13px; }
.uplot, .uplot *, .uplot *::before, .uplot *::after { box-sizing: border-box; }
.uplot { font: inherit; width: 100%; }
.u-legend { font-size: 13px; text-align: left; color: var(--dim); }
.u-legend th { font-weight: 400; }
.tip { position: absolute; top: 6px; z-index: 2; padding: 5px 9px; border: 1px solid var(--line); border-radius: 6px; background: var(--card); color: var(--text);
  font-size: 12px; line-height: 1.45; white-space: nowrap; pointer-events: none; }
.tip i { display: inline-block; width: 8px; height: 8px; margin-right: 6px; border-radius: 2px; }

.view3d { position: relative; min-height: min(62vh, 560px, 90vw); }
.view3d canvas { position: absolute; inset: 0; width: 100%; height: 100%; border-radius: 6px; outline: 0; cursor: grab; }
.view3d canvas:active { cursor: grabbing; }
.object form { display: grid; gap: 10px; align-content: start; margin: 12px 0 0; font-size: 13.5px; }
.object:fullscreen { grid-template-rows: 1fr; border-radius: 0; background: var(--card); }
.object:fullscreen .view3d { height: 100%; }
@media (min-width: 900px) {
  .object { display: grid; grid-template-columns: 1fr 260px; gap: 18px; }
  .object form { margin: 0; }
}

@media print {
  .toolbar, .stage, .said, .widget { display: none !important; }
}
`;var Ra=[[16,14,40],[92,28,110],[186,54,85],[242,129,38],[252,240,150]],Wp=`linear-gradient(90deg, ${Ra.map(i=>`rgb(${i.join(" ")})`).join(", ")})`;async function Xp(i,e){await i.decode();let{naturalWidth:t,naturalHeight:n}=i,r=Object.assign(document.createElement("canvas"),{width:t,height:n}).getContext("2d",{willReadFrequently:!0});e&&(r.fillStyle="#fff",r.fillRect(0,0,t,n)),r.drawImage(i,0,0);let o=r.getImageData(0,0,t,n).data;return{width:t,height:n,pixels:o}}function ql({pixels:i,width:e},t,n,s){let r=4*(n*e+t);if(i[r+3]/255<=.9)return null;let o=[0,1,2].map(c=>i[r+c]/255);if(s==="number")return[o[0]];if(s==="colour")return o;let a=o.map(c=>2*c-1),l=Math.hypot(...a);return a.map(c=>c/Math.max(l,1e-6))}function Cu(i,e,t){if(!i||!e)return null;if(t==="normal"){let n=i.reduce((s,r,o)=>s+r*e[o],0);return Math.acos(Math.min(1,Math.max(-1,n)))*180/Math.PI}return i.reduce((n,s,r)=>n+Math.abs(s-e[r]),0)/i.length}function qp(i,e,t,n,s){let[r,o]=[e.width,e.height];Object.assign(i,{width:r,height:o});let a=new ImageData(r,o),[l,c]=[0,0];for(let h=0;h<o;h++)for(let u=0;u<r;u++){let f=Cu(ql(e,u,h,n),ql(t,u,h,n),n);f!==null&&(l+=f,c+=1,a.data.set([...Ex(f/s),255],4*(h*r+u)))}return i.getContext("2d").putImageData(a,0,0),c?l/c:null}function Ex(i){let e=Math.min(i,1)*(Ra.length-1),t=Math.min(Math.floor(e),Ra.length-2);return Ra[t].map((n,s)=>Math.round(n+(e-t)*(Ra[t+1][s]-n)))}var Iu={colour:"",number:"",normal:"°"},Tx={colour:"|difference| of sRGB values, mean of the three channels",number:"|difference|",normal:"angle between the normals"};function Yp(i){let e=JSON.parse(i.dataset.pairs),t=i.dataset.sides?JSON.parse(i.dataset.sides):null,n=[...i.querySelectorAll("article")].map(l=>new Pu(l));if(!e.length||!n.length)return!1;let s={pair:e[0],error:!1},r=We("p",{class:"legend-row","aria-live":"polite"}),o=()=>{for(let u of n)u.show(s.pair,s.pair.sides??t,s.error);let{kind:l,largest:c}=s.pair,h=We("i",{style:`background:${Wp}`});r.replaceChildren(...s.error?[`${Tx[l]}: 0 `,h,` ${c}${Iu[l]} and more`]:[])},a=We("div",{class:"toolbar"});return i.querySelector(".cards").before(a),a.append(Ta("What is compared",e.map(l=>l.name),l=>{s.pair=e[l],o()}),Ta("How",["slider","error"],l=>{s.error=l===1,o()}),r),!0}var Pu=class{constructor(e){this.pictures=Object.fromEntries([...e.querySelectorAll("img")].map(r=>[r.dataset.picture,r])),this.right=We("img",{alt:""}),this.left=We("img",{alt:""}),this.error=We("canvas",{role:"img"}),this.divider=new go("",()=>this.place());let{line:t,tags:n,slider:s}=this.divider;Object.assign(this,{line:t,names:n,slider:s}),this.box=We("div",{class:"stage whole"},this.right,this.left,this.error,...this.divider.nodes),this.said=We("p",{class:"said"}),e.append(this.box,this.said),this.box.addEventListener("pointermove",r=>this.point(r)),this.box.addEventListener("pointerleave",()=>this.say()),this.name=e.querySelector("h3").firstChild.textContent.trim()}async show(e,t,n){this.pair=e;let[s,r]=[this.pictures[e.left],this.pictures[e.right]];this.sides=[s&&t[0],r&&t[1]],this.values=null,this.about="";let o=!!(s&&r);if(this.box.hidden=!s&&!r,this.box.hidden)return this.say("no such map");let[a,l]=[s??r,r??s];this.left.src=a.src,this.right.src=l.src,this.left.alt=a.alt,this.right.alt=l.alt,this.slider.hidden=this.line.hidden=!o||n,this.slider.setAttribute("aria-label",`${this.name}: how much of ${t[0]} is shown`),this.error.setAttribute("aria-label",`difference of ${a.alt} and ${l.alt}`),this.error.hidden=!o||!n,this.left.hidden=this.right.hidden=!this.error.hidden,this.names.forEach((p,x)=>{p.textContent=this.sides[x]??"",p.hidden=!this.sides[x]||!this.error.hidden}),this.place(),this.say(o?"":"no truth to compare with");let c=e.kind==="colour"&&a.dataset.picture!=="albedo"&&!e.left.endsWith("albedo"),h=await Promise.all([s,r].map(p=>p&&Xp(p,c)));if(this.pair!==e)return;this.values=h;let{naturalWidth:u,naturalHeight:f}=a;if(this.box.style.aspectRatio=`${u} / ${f}`,this.box.classList.toggle("coarse",this.box.clientWidth>2*u),o&&n){let p=qp(this.error,h[0],h[1],e.kind,e.largest);this.about=p===null?"nothing to compare":`mean ${Is(p)}${Iu[e.kind]}`,this.say()}}place(){this.divider.cut(this.left,this.slider.hidden?this.sides?.[0]?100:0:void 0)}say(e=""){this.said.textContent=e||this.about}point(e){if(!this.values)return;let[t,n]=Xl(this.box,e),s=this.values.find(Boolean),[r,o]=[Math.floor(t*s.width),Math.floor(n*s.height)],a=this.values.map(h=>h&&ql(h,r,o,this.pair.kind)),l=a.map((h,u)=>this.sides[u]&&`${this.sides[u]} ${h?h.map(f=>f.toFixed(2)).join(" "):"–"}`),c=Cu(a[0],a[1],this.pair.kind);c!==null&&l.push(`difference ${Is(c)}${Iu[this.pair.kind]}`),this.say(`${r}, ${o}: ${l.filter(Boolean).join(" · ")}`)}};var Ax="uplot",Rx="u-hz",Cx="u-vt",Ix="u-title",Px="u-wrap",Lx="u-under",Dx="u-over",Nx="u-axis",Fr="u-off",Ux="u-select",Ox="u-cursor-x",Fx="u-cursor-y",Bx="u-cursor-pt",kx="u-legend",zx="u-live",Hx="u-inline",Gx="u-series",Vx="u-marker",Zp="u-label",Wx="u-value",Ia="width",Pa="height";var Kp="bottom",_o="left",Lu="right",Ku="#000",$p=Ku+"0",Du="mousemove",Jp="mousedown",Nu="mouseup",jp="mouseenter",Qp="mouseleave",em="dblclick",Xx="resize",qx="scroll",tm="change",Jl="dppxchange",$u="--",wo=typeof window<"u",ku=wo?document:null,vo=wo?window:null,Yx=wo?navigator:null,zt,Yl;function zu(){let i=devicePixelRatio;zt!=i&&(zt=i,Yl&&Gu(tm,Yl,zu),Yl=matchMedia(`(min-resolution: ${zt-.001}dppx) and (max-resolution: ${zt+.001}dppx)`),Br(tm,Yl,zu),vo.dispatchEvent(new CustomEvent(Jl)))}function Ai(i,e){if(e!=null){let t=i.classList;!t.contains(e)&&t.add(e)}}function Hu(i,e){let t=i.classList;t.contains(e)&&t.remove(e)}function ln(i,e,t){i.style[e]=t+"px"}function Qi(i,e,t,n){let s=ku.createElement(i);return e!=null&&Ai(s,e),t?.insertBefore(s,n),s}function ki(i,e){return Qi("div",i,e)}var nm=new WeakMap;function _s(i,e,t,n,s){let r="translate("+e+"px,"+t+"px)",o=nm.get(i);r!=o&&(i.style.transform=r,nm.set(i,r),e<0||t<0||e>n||t>s?Ai(i,Fr):Hu(i,Fr))}var im=new WeakMap;function sm(i,e,t){let n=e+t,s=im.get(i);n!=s&&(im.set(i,n),i.style.background=e,i.style.borderColor=t)}var rm=new WeakMap;function om(i,e,t,n){let s=e+""+t,r=rm.get(i);s!=r&&(rm.set(i,s),i.style.height=t+"px",i.style.width=e+"px",i.style.marginLeft=n?-e/2+"px":0,i.style.marginTop=n?-t/2+"px":0)}var Ju={passive:!0},Zx={...Ju,capture:!0};function Br(i,e,t,n){e.addEventListener(i,t,n?Zx:Ju)}function Gu(i,e,t,n){e.removeEventListener(i,t,Ju)}wo&&zu();function es(i,e,t,n){let s;t=t||0,n=n||e.length-1;let r=n<=2147483647;for(;n-t>1;)s=r?t+n>>1:Ri((t+n)/2),e[s]<i?t=s:n=s;return i-e[t]<=e[n]-i?t:n}function Nm(i){return(t,n,s)=>{let r=-1,o=-1;for(let a=n;a<=s;a++)if(i(t[a])){r=a;break}for(let a=s;a>=n;a--)if(i(t[a])){o=a;break}return[r,o]}}var Um=i=>i!=null,Om=i=>i!=null&&i>0,ec=Nm(Um),Kx=Nm(Om);function $x(i,e,t,n=0,s=!1){let r=s?Kx:ec,o=s?Om:Um;[e,t]=r(i,e,t);let a=i[e],l=i[e];if(e>-1)if(n==1)a=i[e],l=i[t];else if(n==-1)a=i[t],l=i[e];else for(let c=e;c<=t;c++){let h=i[c];o(h)&&(h<a?a=h:h>l&&(l=h))}return[a??Qt,l??-Qt]}function tc(i,e,t,n){let s=cm(i),r=cm(e);i==e&&(s==-1?(i*=t,e/=t):(i/=t,e*=t));let o=t==10?Ps:Fm,a=s==1?Ri:zi,l=r==1?zi:Ri,c=a(o(Dn(i))),h=l(o(Dn(e))),u=yo(t,c),f=yo(t,h);return t==10&&(c<0&&(u=en(u,-c)),h<0&&(f=en(f,-h))),n||t==2?(i=u*s,e=f*r):(i=Hm(i,u),e=nc(e,f)),[i,e]}function ju(i,e,t,n){let s=tc(i,e,t,n);return i==0&&(s[0]=0),e==0&&(s[1]=0),s}var Qu=.1,am={mode:3,pad:Qu},Da={pad:0,soft:null,mode:0},Jx={min:Da,max:Da};function jl(i,e,t,n){return ic(t)?lm(i,e,t):(Da.pad=t,Da.soft=n?0:null,Da.mode=n?3:0,lm(i,e,Jx))}function Ot(i,e){return i??e}function jx(i,e,t){for(e=Ot(e,0),t=Ot(t,i.length-1);e<=t;){if(i[e]!=null)return!0;e++}return!1}function lm(i,e,t){let n=t.min,s=t.max,r=Ot(n.pad,0),o=Ot(s.pad,0),a=Ot(n.hard,-Qt),l=Ot(s.hard,Qt),c=Ot(n.soft,Qt),h=Ot(s.soft,-Qt),u=Ot(n.mode,0),f=Ot(s.mode,0),p=e-i,x=Ps(p),M=ai(Dn(i),Dn(e)),g=Ps(M),_=Dn(g-x);(p<1e-24||_>10)&&(p=0,(i==0||e==0)&&(p=1e-24,u==2&&c!=Qt&&(r=0),f==2&&h!=-Qt&&(o=0)));let b=p||M||1e3,P=Ps(b),w=yo(10,Ri(P)),D=b*(p==0?i==0?.1:1:r),I=en(Hm(i-D,w/10),24),y=i>=c&&(u==1||u==3&&I<=c||u==2&&I>=c)?c:Qt,T=ai(a,I<y&&i>=y?y:ts(y,I)),G=b*(p==0?e==0?.1:1:o),k=en(nc(e+G,w/10),24),O=e<=h&&(f==1||f==3&&k>=h||f==2&&k<=h)?h:-Qt,Y=ts(l,k>O&&e<=O?O:ai(O,k));return T==Y&&T==0&&(Y=100),[T,Y]}var Qx=new Intl.NumberFormat(wo?Yx.language:"en-US"),ef=i=>Qx.format(i),Ci=Math,$l=Ci.PI,Dn=Ci.abs,Ri=Ci.floor,Ln=Ci.round,zi=Ci.ceil,ts=Ci.min,ai=Ci.max,yo=Ci.pow,cm=Ci.sign,Ps=Ci.log10,Fm=Ci.log2,ev=(i,e=1)=>Ci.sinh(i)*e,Uu=(i,e=1)=>Ci.asinh(i/e),Qt=1/0;function hm(i){return(Ps((i^i>>31)-(i>>31))|0)+1}function Vu(i,e,t){return ts(ai(i,e),t)}function Bm(i){return typeof i=="function"}function Dt(i){return Bm(i)?i:()=>i}var tv=()=>{},km=i=>i,zm=(i,e)=>e,nv=i=>null,um=i=>!0,fm=(i,e)=>i==e,iv=/\.\d*?(?=9{6,}|0{6,})/gm,kr=i=>{if(Vm(i)||pr.has(i))return i;let e=`${i}`,t=e.match(iv);if(t==null)return i;let n=t[0].length-1;if(e.indexOf("e-")!=-1){let[s,r]=e.split("e");return+`${kr(s)}e${r}`}return en(i,n)};function Ur(i,e){return kr(en(kr(i/e))*e)}function nc(i,e){return kr(zi(kr(i/e))*e)}function Hm(i,e){return kr(Ri(kr(i/e))*e)}function en(i,e=0){if(Vm(i))return i;let t=10**e,n=i*t*(1+Number.EPSILON);return Ln(n)/t}var pr=new Map;function Gm(i){return((""+i).split(".")[1]||"").length}function Ua(i,e,t,n){let s=[],r=n.map(Gm);for(let o=e;o<t;o++){let a=Dn(o),l=en(yo(i,o),a);for(let c=0;c<n.length;c++){let h=i==10?+`${n[c]}e${o}`:n[c]*l,u=(o>=0?0:a)+(o>=r[c]?0:r[c]),f=i==10?h:en(h,u);s.push(f),pr.set(f,u)}}return s}var Na={},tf=[],So=[null,null],dr=Array.isArray,Vm=Number.isInteger,sv=i=>i===void 0;function dm(i){return typeof i=="string"}function ic(i){let e=!1;if(i!=null){let t=i.constructor;e=t==null||t==Object}return e}function rv(i){return i!=null&&typeof i=="object"}var ov=Object.getPrototypeOf(Uint8Array),Wm="__proto__";function Mo(i,e=ic){let t;if(dr(i)){let n=i.find(s=>s!=null);if(dr(n)||e(n)){t=Array(i.length);for(let s=0;s<i.length;s++)t[s]=Mo(i[s],e)}else t=i.slice()}else if(i instanceof ov)t=i.slice();else if(e(i)){t={};for(let n in i)n!=Wm&&(t[n]=Mo(i[n],e))}else t=i;return t}function Rn(i){let e=arguments;for(let t=1;t<e.length;t++){let n=e[t];for(let s in n)s!=Wm&&(ic(i[s])?Rn(i[s],Mo(n[s])):i[s]=Mo(n[s]))}return i}var av=0,lv=1,cv=2;function hv(i,e,t){for(let n=0,s,r=-1;n<e.length;n++){let o=e[n];if(o>r){for(s=o-1;s>=0&&i[s]==null;)i[s--]=null;for(s=o+1;s<t&&i[s]==null;)i[r=s++]=null}}}function uv(i,e){if(pv(i)){let o=i[0].slice();for(let a=1;a<i.length;a++)o.push(...i[a].slice(1));return mv(o[0])||(o=dv(o)),o}let t=new Set;for(let o=0;o<i.length;o++){let l=i[o][0],c=l.length;for(let h=0;h<c;h++)t.add(l[h])}let n=[Array.from(t).sort((o,a)=>o-a)],s=n[0].length,r=new Map;for(let o=0;o<s;o++)r.set(n[0][o],o);for(let o=0;o<i.length;o++){let a=i[o],l=a[0];for(let c=1;c<a.length;c++){let h=a[c],u=Array(s).fill(void 0),f=e?e[o][c]:lv,p=[];for(let x=0;x<h.length;x++){let M=h[x],g=r.get(l[x]);M===null?f!=av&&(u[g]=M,f==cv&&p.push(g)):u[g]=M}hv(u,p,s),n.push(u)}}return n}var fv=typeof queueMicrotask>"u"?i=>Promise.resolve().then(i):queueMicrotask;function dv(i){let e=i[0],t=e.length,n=Array(t);for(let r=0;r<n.length;r++)n[r]=r;n.sort((r,o)=>e[r]-e[o]);let s=[];for(let r=0;r<i.length;r++){let o=i[r],a=Array(t);for(let l=0;l<t;l++)a[l]=o[n[l]];s.push(a)}return s}function pv(i){let e=i[0][0],t=e.length;for(let n=1;n<i.length;n++){let s=i[n][0];if(s.length!=t)return!1;if(s!=e){for(let r=0;r<t;r++)if(s[r]!=e[r])return!1}}return!0}function mv(i,e=100){let t=i.length;if(t<=1)return!0;let n=0,s=t-1;for(;n<=s&&i[n]==null;)n++;for(;s>=n&&i[s]==null;)s--;if(s<=n)return!0;let r=ai(1,Ri((s-n+1)/e));for(let o=i[n],a=n+r;a<=s;a+=r){let l=i[a];if(l!=null){if(l<=o)return!1;o=l}}return!0}var Xm=["January","February","March","April","May","June","July","August","September","October","November","December"],qm=["Sunday","Monday","Tuesday","Wednesday","Thursday","Friday","Saturday"];function Ym(i){return i.slice(0,3)}var gv=qm.map(Ym),_v=Xm.map(Ym),xv={MMMM:Xm,MMM:_v,WWWW:qm,WWW:gv};function Ca(i){return(i<10?"0":"")+i}function vv(i){return(i<10?"00":i<100?"0":"")+i}var yv={YYYY:i=>i.getFullYear(),YY:i=>(i.getFullYear()+"").slice(2),MMMM:(i,e)=>e.MMMM[i.getMonth()],MMM:(i,e)=>e.MMM[i.getMonth()],MM:i=>Ca(i.getMonth()+1),M:i=>i.getMonth()+1,DD:i=>Ca(i.getDate()),D:i=>i.getDate(),WWWW:(i,e)=>e.WWWW[i.getDay()],WWW:(i,e)=>e.WWW[i.getDay()],HH:i=>Ca(i.getHours()),H:i=>i.getHours(),h:i=>{let e=i.getHours();return e==0?12:e>12?e-12:e},AA:i=>i.getHours()>=12?"PM":"AM",aa:i=>i.getHours()>=12?"pm":"am",a:i=>i.getHours()>=12?"p":"a",mm:i=>Ca(i.getMinutes()),m:i=>i.getMinutes(),ss:i=>Ca(i.getSeconds()),s:i=>i.getSeconds(),fff:i=>vv(i.getMilliseconds())};function nf(i,e){e=e||xv;let t=[],n=/\{([a-z]+)\}|[^{]+/gi,s;for(;s=n.exec(i);)t.push(s[0][0]=="{"?yv[s[1]]:s[0]);return r=>{let o="";for(let a=0;a<t.length;a++)o+=typeof t[a]=="string"?t[a]:t[a](r,e);return o}}var Sv=new Intl.DateTimeFormat().resolvedOptions().timeZone;function Mv(i,e){let t;return e=="UTC"||e=="Etc/UTC"?t=new Date(+i+i.getTimezoneOffset()*6e4):e==Sv?t=i:(t=new Date(i.toLocaleString("en-US",{timeZone:e})),t.setMilliseconds(i.getMilliseconds())),t}var Zm=i=>i%1==0,Ql=[1,2,2.5,5],bv=Ua(10,-32,0,Ql),Km=Ua(10,0,32,Ql),wv=Km.filter(Zm),Or=bv.concat(Km),sf=`
`,$m="{YYYY}",pm=sf+$m,Jm="{M}/{D}",La=sf+Jm,Zl=La+"/{YY}",jm="{aa}",Ev="{h}:{mm}",xo=Ev+jm,mm=sf+xo,gm=":{ss}",Wt=null;function Qm(i){let e=i*1e3,t=e*60,n=t*60,s=n*24,r=s*30,o=s*365,l=(i==1?Ua(10,0,3,Ql).filter(Zm):Ua(10,-3,0,Ql)).concat([e,e*5,e*10,e*15,e*30,t,t*5,t*10,t*15,t*30,n,n*2,n*3,n*4,n*6,n*8,n*12,s,s*2,s*3,s*4,s*5,s*6,s*7,s*8,s*9,s*10,s*15,r,r*2,r*3,r*4,r*6,o,o*2,o*5,o*10,o*25,o*50,o*100]),c=[[o,$m,Wt,Wt,Wt,Wt,Wt,Wt,1],[s*28,"{MMM}",pm,Wt,Wt,Wt,Wt,Wt,1],[s,Jm,pm,Wt,Wt,Wt,Wt,Wt,1],[n,"{h}"+jm,Zl,Wt,La,Wt,Wt,Wt,1],[t,xo,Zl,Wt,La,Wt,Wt,Wt,1],[e,gm,Zl+" "+xo,Wt,La+" "+xo,Wt,mm,Wt,1],[i,gm+".{fff}",Zl+" "+xo,Wt,La+" "+xo,Wt,mm,Wt,1]];function h(u){return(f,p,x,M,g,_)=>{let b=[],P=g>=o,w=g>=r&&g<o,D=u(x),I=en(D*i,3),y=Ou(D.getFullYear(),P?0:D.getMonth(),w||P?1:D.getDate()),T=en(y*i,3);if(w||P){let G=w?g/r:0,k=P?g/o:0,O=I==T?I:en(Ou(y.getFullYear()+k,y.getMonth()+G,1)*i,3),Y=new Date(Ln(O/i)),Z=Y.getFullYear(),U=Y.getMonth();for(let W=0;O<=M;W++){let $=Ou(Z+k*W,U+G*W,1),q=$-u(en($*i,3));O=en((+$+q)*i,3),O<=M&&b.push(O)}}else{let G=g>=s?s:g,k=Ri(x)-Ri(I),O=T+k+nc(I-T,G);b.push(O);let Y=u(O),Z=Y.getHours()+Y.getMinutes()/t+Y.getSeconds()/n,U=g/n,W=f.axes[p]._space,$=_/W;for(;O=en(O+g,i==1?0:3),!(O>M);)if(U>1){let q=Ri(en(Z+U,6))%24,se=u(O).getHours()-q;se>1&&(se=-1),O-=se*n,Z=(Z+U)%24;let de=b[b.length-1];en((O-de)/g,3)*$>=.7&&b.push(O)}else b.push(O)}return b}}return[l,c,h]}var[Tv,Av,Rv]=Qm(1),[Cv,Iv,Pv]=Qm(.001);Ua(2,-53,53,[1]);function _m(i,e){return i.map(t=>t.map((n,s)=>s==0||s==8||n==null?n:e(s==1||t[8]==0?n:t[1]+n)))}function xm(i,e){return(t,n,s,r,o)=>{let a=e.find(x=>o>=x[0])||e[e.length-1],l,c,h,u,f,p;return n.map(x=>{let M=i(x),g=M.getFullYear(),_=M.getMonth(),b=M.getDate(),P=M.getHours(),w=M.getMinutes(),D=M.getSeconds(),I=g!=l&&a[2]||_!=c&&a[3]||b!=h&&a[4]||P!=u&&a[5]||w!=f&&a[6]||D!=p&&a[7]||a[1];return l=g,c=_,h=b,u=P,f=w,p=D,I(M)})}}function Lv(i,e){let t=nf(e);return(n,s,r,o,a)=>s.map(l=>t(i(l)))}function Ou(i,e,t){return new Date(i,e,t)}function vm(i,e){return e(i)}var Dv="{YYYY}-{MM}-{DD} {h}:{mm}{aa}";function ym(i,e){return(t,n,s,r)=>r==null?$u:e(i(n))}function Nv(i,e){let t=i.series[e];return t.width?t.stroke(i,e):t.points.width?t.points.stroke(i,e):null}function Uv(i,e){return i.series[e].fill(i,e)}var Ov={show:!0,live:!0,isolate:!1,mount:tv,markers:{show:!0,width:2,stroke:Nv,fill:Uv,dash:"solid"},idx:null,idxs:null,values:[]};function Fv(i,e){let t=i.cursor.points,n=ki(),s=t.size(i,e);ln(n,Ia,s),ln(n,Pa,s);let r=s/-2;ln(n,"marginLeft",r),ln(n,"marginTop",r);let o=t.width(i,e,s);return o&&ln(n,"borderWidth",o),n}function Bv(i,e){let t=i.series[e].points;return t._fill||t._stroke}function kv(i,e){let t=i.series[e].points;return t._stroke||t._fill}function zv(i,e){return i.series[e].points.size}var Fu=[0,0];function Hv(i,e,t){return Fu[0]=e,Fu[1]=t,Fu}function Kl(i,e,t,n=!0){return s=>{s.button==0&&(!n||s.target==e)&&t(s)}}function Bu(i,e,t,n=!0){return s=>{(!n||s.target==e)&&t(s)}}var Gv={show:!0,x:!0,y:!0,lock:!1,move:Hv,points:{one:!1,show:Fv,size:zv,width:0,stroke:kv,fill:Bv},bind:{mousedown:Kl,mouseup:Kl,click:Kl,dblclick:Kl,mousemove:Bu,mouseleave:Bu,mouseenter:Bu},drag:{setScale:!0,x:!0,y:!1,dist:0,uni:null,click:(i,e)=>{e.stopPropagation(),e.stopImmediatePropagation()},_x:!1,_y:!1},focus:{dist:(i,e,t,n,s)=>n-s,prox:-1,bias:0},hover:{skip:[void 0],prox:null,bias:0},left:-10,top:-10,idx:null,dataIdx:null,idxs:null,event:null},eg={show:!0,stroke:"rgba(0,0,0,0.07)",width:2},rf=Rn({},eg,{filter:zm}),tg=Rn({},rf,{size:10}),ng=Rn({},eg,{show:!1}),of='12px system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, "Noto Sans", sans-serif, "Apple Color Emoji", "Segoe UI Emoji", "Segoe UI Symbol", "Noto Color Emoji"',ig="bold "+of,sg=1.5,Sm={show:!0,scale:"x",stroke:Ku,space:50,gap:5,alignTo:1,size:50,labelGap:0,labelSize:30,labelFont:ig,side:2,grid:rf,ticks:tg,border:ng,font:of,lineGap:sg,rotate:0},Vv="Value",Wv="Time",Mm={show:!0,scale:"x",auto:!1,sorted:1,min:Qt,max:-Qt,idxs:[]};function Xv(i,e,t,n,s){return e.map(r=>r==null?"":ef(r))}function qv(i,e,t,n,s,r,o){let a=[],l=pr.get(s)||0;t=o?t:en(nc(t,s),l);for(let c=t;c<=n;c=en(c+s,l))a.push(Object.is(c,-0)?0:c);return a}function Wu(i,e,t,n,s,r,o){let a=[],l=i.scales[i.axes[e].scale].log,c=l==10?Ps:Fm,h=Ri(c(t));s=yo(l,h),l==10&&(s=Or[es(s,Or)]);let u=t,f=s*l;l==10&&(f=Or[es(f,Or)]);do a.push(u),u=u+s,l==10&&!pr.has(u)&&(u=en(u,pr.get(s))),u>=f&&(s=u,f=s*l,l==10&&(f=Or[es(f,Or)]));while(u<=n);return a}function Yv(i,e,t,n,s,r,o){let l=i.scales[i.axes[e].scale].asinh,c=n>l?Wu(i,e,ai(l,t),n,s):[l],h=n>=0&&t<=0?[0]:[];return(t<-l?Wu(i,e,ai(l,-n),-t,s):[l]).reverse().map(f=>-f).concat(h,c)}var rg=/./,Zv=/[12357]/,Kv=/[125]/,bm=/1/,Xu=(i,e,t,n)=>i.map((s,r)=>e==4&&s==0||r%n==0&&t.test(s.toExponential()[s<0?1:0])?s:null);function $v(i,e,t,n,s){let r=i.axes[t],o=r.scale,a=i.scales[o],l=i.valToPos,c=r._space,h=l(10,o),u=l(9,o)-h>=c?rg:l(7,o)-h>=c?Zv:l(5,o)-h>=c?Kv:bm;if(u==bm){let f=Dn(l(1,o)-h);if(f<c)return Xu(e.slice().reverse(),a.distr,u,zi(c/f)).reverse()}return Xu(e,a.distr,u,1)}function Jv(i,e,t,n,s){let r=i.axes[t],o=r.scale,a=r._space,l=i.valToPos,c=Dn(l(1,o)-l(2,o));return c<a?Xu(e.slice().reverse(),3,rg,zi(a/c)).reverse():e}function jv(i,e,t,n){return n==null?$u:e==null?"":ef(e)}var wm={show:!0,scale:"y",stroke:Ku,space:30,gap:5,alignTo:1,size:50,labelGap:0,labelSize:30,labelFont:ig,side:3,grid:rf,ticks:tg,border:ng,font:of,lineGap:sg,rotate:0};function Qv(i,e){let t=3+(i||1)*2;return en(t*e,3)}function ey(i,e){let{scale:t,idxs:n}=i.series[0],s=i._data[0],r=i.valToPos(s[n[0]],t,!0),o=i.valToPos(s[n[1]],t,!0),a=Dn(o-r),l=i.series[e],c=a/(l.points.space*zt);return n[1]-n[0]<=c}var Em={scale:null,auto:!0,sorted:0,min:Qt,max:-Qt},og=(i,e,t,n,s)=>s,Tm={show:!0,auto:!0,sorted:0,gaps:og,alpha:1,facets:[Rn({},Em,{scale:"x"}),Rn({},Em,{scale:"y"})]},Am={scale:"y",auto:!0,sorted:0,show:!0,spanGaps:!1,gaps:og,alpha:1,points:{show:ey,filter:null},values:null,min:Qt,max:-Qt,idxs:[],path:null,clip:null};function ty(i,e,t,n,s){return t/10}var ag={time:!0,auto:!0,distr:1,log:10,asinh:1,min:null,max:null,dir:1,ori:0},ny=Rn({},ag,{time:!1,ori:1}),Rm={};function lg(i,e){let t=Rm[i];return t||(t={key:i,plots:[],sub(n){t.plots.push(n)},unsub(n){t.plots=t.plots.filter(s=>s!=n)},pub(n,s,r,o,a,l,c){for(let h=0;h<t.plots.length;h++)t.plots[h]!=s&&t.plots[h].pub(n,s,r,o,a,l,c)}},i!=null&&(Rm[i]=t)),t}var bo=1,qu=2;function zr(i,e,t){let n=i.mode,s=i.series[e],r=n==2?i._data[e]:i._data,o=i.scales,a=i.bbox,l=r[0],c=n==2?r[1]:r[e],h=n==2?o[s.facets[0].scale]:o[i.series[0].scale],u=n==2?o[s.facets[1].scale]:o[s.scale],f=a.left,p=a.top,x=a.width,M=a.height,g=i.valToPosH,_=i.valToPosV;return h.ori==0?t(s,l,c,h,u,g,_,f,p,x,M,rc,Eo,ac,hg,fg):t(s,l,c,h,u,_,g,p,f,M,x,oc,To,cf,ug,dg)}function af(i,e){let t=0,n=0,s=Ot(i.bands,tf);for(let r=0;r<s.length;r++){let o=s[r];o.series[0]==e?t=o.dir:o.series[1]==e&&(o.dir==1?n|=1:n|=2)}return[t,n==1?-1:n==2?1:n==3?2:0]}function iy(i,e,t,n,s){let r=i.mode,o=i.series[e],a=r==2?o.facets[1].scale:o.scale,l=i.scales[a];return s==-1?l.min:s==1?l.max:l.distr==3?l.dir==1?l.min:l.max:0}function Ls(i,e,t,n,s,r){return zr(i,e,(o,a,l,c,h,u,f,p,x,M,g)=>{let _=o.pxRound,b=c.dir*(c.ori==0?1:-1),P=c.ori==0?Eo:To,w,D;b==1?(w=t,D=n):(w=n,D=t);let I=_(u(a[w],c,M,p)),y=_(f(l[w],h,g,x)),T=_(u(a[D],c,M,p)),G=_(f(r==1?h.max:h.min,h,g,x)),k=new Path2D(s);return P(k,T,G),P(k,I,G),P(k,I,y),k})}function sc(i,e,t,n,s,r){let o=null;if(i.length>0){o=new Path2D;let a=e==0?ac:cf,l=t;for(let u=0;u<i.length;u++){let f=i[u];if(f[1]>f[0]){let p=f[0]-l;p>0&&a(o,l,n,p,n+r),l=f[1]}}let c=t+s-l,h=10;c>0&&a(o,l,n-h/2,c,n+r+h)}return o}function sy(i,e,t){let n=i[i.length-1];n&&n[0]==e?n[1]=t:i.push([e,t])}function lf(i,e,t,n,s,r,o){let a=[],l=i.length;for(let c=s==1?t:n;c>=t&&c<=n;c+=s)if(e[c]===null){let u=c,f=c;if(s==1)for(;++c<=n&&e[c]===null;)f=c;else for(;--c>=t&&e[c]===null;)f=c;let p=r(i[u]),x=f==u?p:r(i[f]),M=u-s;p=o<=0&&M>=0&&M<l?r(i[M]):p;let _=f+s;x=o>=0&&_>=0&&_<l?r(i[_]):x,x>=p&&a.push([p,x])}return a}function Cm(i){return i==0?km:i==1?Ln:e=>Ur(e,i)}function cg(i){let e=i==0?rc:oc,t=i==0?(s,r,o,a,l,c)=>{s.arcTo(r,o,a,l,c)}:(s,r,o,a,l,c)=>{s.arcTo(o,r,l,a,c)},n=i==0?(s,r,o,a,l)=>{s.rect(r,o,a,l)}:(s,r,o,a,l)=>{s.rect(o,r,l,a)};return(s,r,o,a,l,c=0,h=0)=>{c==0&&h==0?n(s,r,o,a,l):(c=ts(c,a/2,l/2),h=ts(h,a/2,l/2),e(s,r+c,o),t(s,r+a,o,r+a,o+l,c),t(s,r+a,o+l,r,o+l,h),t(s,r,o+l,r,o,h),t(s,r,o,r+a,o,c),s.closePath())}}var rc=(i,e,t)=>{i.moveTo(e,t)},oc=(i,e,t)=>{i.moveTo(t,e)},Eo=(i,e,t)=>{i.lineTo(e,t)},To=(i,e,t)=>{i.lineTo(t,e)},ac=cg(0),cf=cg(1),hg=(i,e,t,n,s,r)=>{i.arc(e,t,n,s,r)},ug=(i,e,t,n,s,r)=>{i.arc(t,e,n,s,r)},fg=(i,e,t,n,s,r,o)=>{i.bezierCurveTo(e,t,n,s,r,o)},dg=(i,e,t,n,s,r,o)=>{i.bezierCurveTo(t,e,s,n,o,r)};function pg(i){return(e,t,n,s,r)=>zr(e,t,(o,a,l,c,h,u,f,p,x,M,g)=>{let{pxRound:_,points:b}=o,P,w;c.ori==0?(P=rc,w=hg):(P=oc,w=ug);let D=en(b.width*zt,3),I=(b.size-b.width)/2*zt,y=en(I*2,3),T=new Path2D,G=new Path2D,{left:k,top:O,width:Y,height:Z}=e.bbox;ac(G,k-y,O-y,Y+y*2,Z+y*2);let U=W=>{if(l[W]!=null){let $=_(u(a[W],c,M,p)),q=_(f(l[W],h,g,x));P(T,$+I,q),w(T,$,q,I,0,$l*2)}};if(r)r.forEach(U);else for(let W=n;W<=s;W++)U(W);return{stroke:D>0?T:null,fill:T,clip:G,flags:bo|qu}})}function mg(i){return(e,t,n,s,r,o)=>{n!=s&&(r!=n&&o!=n&&i(e,t,n),r!=s&&o!=s&&i(e,t,s),i(e,t,o))}}var ry=mg(Eo),oy=mg(To);function gg(i){let e=Ot(i?.alignGaps,0);return(t,n,s,r)=>zr(t,n,(o,a,l,c,h,u,f,p,x,M,g)=>{[s,r]=ec(l,s,r);let _=o.pxRound,b=Z=>_(u(Z,c,M,p)),P=Z=>_(f(Z,h,g,x)),w,D;c.ori==0?(w=Eo,D=ry):(w=To,D=oy);let I=c.dir*(c.ori==0?1:-1),y={stroke:new Path2D,fill:null,clip:null,band:null,gaps:null,flags:bo},T=y.stroke,G=!1;if(r-s>=M*4){let Z=pe=>t.posToVal(pe,c.key,!0),U=null,W=null,$,q,xe,ne=b(a[I==1?s:r]),se=b(a[s]),de=b(a[r]),ge=Z(I==1?se+1:de-1);for(let pe=I==1?s:r;pe>=s&&pe<=r;pe+=I){let re=a[pe],Ie=(I==1?re<ge:re>ge)?ne:b(re),Oe=l[pe];Ie==ne?Oe!=null?(q=Oe,U==null?(w(T,Ie,P(q)),$=U=W=q):q<U?U=q:q>W&&(W=q)):Oe===null&&(G=!0):(U!=null&&D(T,ne,P(U),P(W),P($),P(q)),Oe!=null?(q=Oe,w(T,Ie,P(q)),U=W=$=q):(U=W=null,Oe===null&&(G=!0)),ne=Ie,ge=Z(ne+I))}U!=null&&U!=W&&xe!=ne&&D(T,ne,P(U),P(W),P($),P(q))}else for(let Z=I==1?s:r;Z>=s&&Z<=r;Z+=I){let U=l[Z];U===null?G=!0:U!=null&&w(T,b(a[Z]),P(U))}let[O,Y]=af(t,n);if(o.fill!=null||O!=0){let Z=y.fill=new Path2D(T),U=o.fillTo(t,n,o.min,o.max,O),W=P(U),$=b(a[s]),q=b(a[r]);I==-1&&([q,$]=[$,q]),w(Z,q,W),w(Z,$,W)}if(!o.spanGaps){let Z=[];G&&Z.push(...lf(a,l,s,r,I,b,e)),y.gaps=Z=o.gaps(t,n,s,r,Z),y.clip=sc(Z,c.ori,p,x,M,g)}return Y!=0&&(y.band=Y==2?[Ls(t,n,s,r,T,-1),Ls(t,n,s,r,T,1)]:Ls(t,n,s,r,T,Y)),y})}function ay(i){let e=Ot(i.align,1),t=Ot(i.ascDesc,!1),n=Ot(i.alignGaps,0),s=Ot(i.extend,!1);return(r,o,a,l)=>zr(r,o,(c,h,u,f,p,x,M,g,_,b,P)=>{[a,l]=ec(u,a,l);let w=c.pxRound,{left:D,width:I}=r.bbox,y=se=>w(x(se,f,b,g)),T=se=>w(M(se,p,P,_)),G=f.ori==0?Eo:To,k={stroke:new Path2D,fill:null,clip:null,band:null,gaps:null,flags:bo},O=k.stroke,Y=f.dir*(f.ori==0?1:-1),Z=T(u[Y==1?a:l]),U=y(h[Y==1?a:l]),W=U,$=U;s&&e==-1&&($=D,G(O,$,Z)),G(O,U,Z);for(let se=Y==1?a:l;se>=a&&se<=l;se+=Y){let de=u[se];if(de==null)continue;let ge=y(h[se]),pe=T(de);e==1?G(O,ge,Z):G(O,W,pe),G(O,ge,pe),Z=pe,W=ge}let q=W;s&&e==1&&(q=D+I,G(O,q,Z));let[xe,ne]=af(r,o);if(c.fill!=null||xe!=0){let se=k.fill=new Path2D(O),de=c.fillTo(r,o,c.min,c.max,xe),ge=T(de);G(se,q,ge),G(se,$,ge)}if(!c.spanGaps){let se=[];se.push(...lf(h,u,a,l,Y,y,n));let de=c.width*zt/2,ge=t||e==1?de:-de,pe=t||e==-1?-de:de;se.forEach(re=>{re[0]+=ge,re[1]+=pe}),k.gaps=se=c.gaps(r,o,a,l,se),k.clip=sc(se,f.ori,g,_,b,P)}return ne!=0&&(k.band=ne==2?[Ls(r,o,a,l,O,-1),Ls(r,o,a,l,O,1)]:Ls(r,o,a,l,O,ne)),k})}function Im(i,e,t,n,s,r,o=Qt){if(i.length>1){let a=null;for(let l=0,c=1/0;l<i.length;l++)if(e[l]!==void 0){if(a!=null){let h=Dn(i[l]-i[a]);h<c&&(c=h,o=Dn(t(i[l],n,s,r)-t(i[a],n,s,r)))}a=l}}return o}function ly(i){i=i||Na;let e=Ot(i.size,[.6,Qt,1]),t=i.align||0,n=i.gap||0,s=i.radius;s=s==null?[0,0]:typeof s=="number"?[s,0]:s;let r=Dt(s),o=1-e[0],a=Ot(e[1],Qt),l=Ot(e[2],1),c=Ot(i.disp,Na),h=Ot(i.each,p=>{}),{fill:u,stroke:f}=c;return(p,x,M,g)=>zr(p,x,(_,b,P,w,D,I,y,T,G,k,O)=>{let Y=_.pxRound,Z=t,U=n*zt,W=a*zt,$=l*zt,q,xe;w.ori==0?[q,xe]=r(p,x):[xe,q]=r(p,x);let ne=w.dir*(w.ori==0?1:-1),se=w.ori==0?ac:cf,de=w.ori==0?h:(He,ct,xt,Ne,Zt,je,at)=>{h(He,ct,xt,Zt,Ne,at,je)},ge=Ot(p.bands,tf).find(He=>He.series[0]==x),pe=ge!=null?ge.dir:0,re=_.fillTo(p,x,_.min,_.max,pe),Te=Y(y(re,D,O,G)),Ie,Oe,ye,$e=k,ut=Y(_.width*zt),et=!1,bt=null,vt=null,_t=null,Yt=null;u!=null&&(ut==0||f!=null)&&(et=!0,bt=u.values(p,x,M,g),vt=new Map,new Set(bt).forEach(He=>{He!=null&&vt.set(He,new Path2D)}),ut>0&&(_t=f.values(p,x,M,g),Yt=new Map,new Set(_t).forEach(He=>{He!=null&&Yt.set(He,new Path2D)})));let{x0:Ft,size:fn}=c;if(Ft!=null&&fn!=null){Z=1,b=Ft.values(p,x,M,g),Ft.unit==2&&(b=b.map(xt=>p.posToVal(T+xt*k,w.key,!0)));let He=fn.values(p,x,M,g);fn.unit==2?Oe=He[0]*k:Oe=I(He[0],w,k,T)-I(0,w,k,T),$e=Im(b,P,I,w,k,T,$e),ye=$e-Oe+U}else $e=Im(b,P,I,w,k,T,$e),ye=$e*o+U,Oe=$e-ye;ye<1&&(ye=0),ut>=Oe/2&&(ut=0),ye<5&&(Y=km);let Vt=ye>0,Tn=$e-ye-(Vt?ut:0);Oe=Y(Vu(Tn,$,W)),Ie=(Z==0?Oe/2:Z==ne?0:Oe)-Z*ne*((Z==0?U/2:0)+(Vt?ut/2:0));let Pt={stroke:null,fill:null,clip:null,band:null,gaps:null,flags:0},yn=et?null:new Path2D,nn=null;if(ge!=null)nn=p.data[ge.series[1]];else{let{y0:He,y1:ct}=c;He!=null&&ct!=null&&(P=ct.values(p,x,M,g),nn=He.values(p,x,M,g))}let Sn=q*Oe,V=xe*Oe;for(let He=ne==1?M:g;He>=M&&He<=g;He+=ne){let ct=P[He];if(ct==null)continue;if(nn!=null){let ee=nn[He]??0;if(ct-ee==0)continue;Te=y(ee,D,O,G)}let xt=w.distr!=2||c!=null?b[He]:He,Ne=I(xt,w,k,T),Zt=y(Ot(ct,re),D,O,G),je=Y(Ne-Ie),at=Y(ai(Zt,Te)),N=Y(ts(Zt,Te)),E=at-N;if(ct!=null){let ee=ct<0?V:Sn,Se=ct<0?Sn:V;et?(ut>0&&_t[He]!=null&&se(Yt.get(_t[He]),je,N+Ri(ut/2),Oe,ai(0,E-ut),ee,Se),bt[He]!=null&&se(vt.get(bt[He]),je,N+Ri(ut/2),Oe,ai(0,E-ut),ee,Se)):se(yn,je,N+Ri(ut/2),Oe,ai(0,E-ut),ee,Se),de(p,x,He,je-ut/2,N,Oe+ut,E)}}return ut>0?Pt.stroke=et?Yt:yn:et||(Pt._fill=_.width==0?_._fill:_._stroke??_._fill,Pt.width=0),Pt.fill=et?vt:yn,Pt})}function cy(i,e){let t=Ot(e?.alignGaps,0);return(n,s,r,o)=>zr(n,s,(a,l,c,h,u,f,p,x,M,g,_)=>{[r,o]=ec(c,r,o);let b=a.pxRound,P=q=>b(f(q,h,g,x)),w=q=>b(p(q,u,_,M)),D,I,y;h.ori==0?(D=rc,y=Eo,I=fg):(D=oc,y=To,I=dg);let T=h.dir*(h.ori==0?1:-1),G=P(l[T==1?r:o]),k=G,O=[],Y=[];for(let q=T==1?r:o;q>=r&&q<=o;q+=T)if(c[q]!=null){let ne=l[q],se=P(ne);O.push(k=se),Y.push(w(c[q]))}let Z={stroke:i(O,Y,D,y,I,b),fill:null,clip:null,band:null,gaps:null,flags:bo},U=Z.stroke,[W,$]=af(n,s);if(a.fill!=null||W!=0){let q=Z.fill=new Path2D(U),xe=a.fillTo(n,s,a.min,a.max,W),ne=w(xe);y(q,k,ne),y(q,G,ne)}if(!a.spanGaps){let q=[];q.push(...lf(l,c,r,o,T,P,t)),Z.gaps=q=a.gaps(n,s,r,o,q),Z.clip=sc(q,h.ori,x,M,g,_)}return $!=0&&(Z.band=$==2?[Ls(n,s,r,o,U,-1),Ls(n,s,r,o,U,1)]:Ls(n,s,r,o,U,$)),Z})}function hy(i){return cy(uy,i)}function uy(i,e,t,n,s,r){let o=i.length;if(o<2)return null;let a=new Path2D;if(t(a,i[0],e[0]),o==2)n(a,i[1],e[1]);else{let l=Array(o),c=Array(o-1),h=Array(o-1),u=Array(o-1);for(let f=0;f<o-1;f++)h[f]=e[f+1]-e[f],u[f]=i[f+1]-i[f],c[f]=h[f]/u[f];l[0]=c[0];for(let f=1;f<o-1;f++)c[f]===0||c[f-1]===0||c[f-1]>0!=c[f]>0?l[f]=0:(l[f]=3*(u[f-1]+u[f])/((2*u[f]+u[f-1])/c[f-1]+(u[f]+2*u[f-1])/c[f]),isFinite(l[f])||(l[f]=0));l[o-1]=c[o-2];for(let f=0;f<o-1;f++)s(a,i[f]+u[f]/3,e[f]+l[f]*u[f]/3,i[f+1]-u[f]/3,e[f+1]-l[f+1]*u[f]/3,i[f+1],e[f+1])}return a}var Yu=new Set;function Pm(){for(let i of Yu)i.syncRect(!0)}wo&&(Br(Xx,vo,Pm),Br(qx,vo,Pm,!0),Br(Jl,vo,()=>{Nn.pxRatio=zt}));var fy=gg(),dy=pg();function Lm(i,e,t,n){return(n?[i[0],i[1]].concat(i.slice(2)):[i[0]].concat(i.slice(1))).map((r,o)=>Zu(r,o,e,t))}function py(i,e){return i.map((t,n)=>n==0?{}:Rn({},e,t))}function Zu(i,e,t,n){return Rn({},e==0?t:n,i)}function _g(i,e,t){return e==null?So:[e,t]}var my=_g;function gy(i,e,t){return e==null?So:jl(e,t,Qu,!0)}function xg(i,e,t,n){return e==null?So:tc(e,t,i.scales[n].log,!1)}var _y=xg;function vg(i,e,t,n){return e==null?So:ju(e,t,i.scales[n].log,!1)}var xy=vg;function vy(i,e,t,n,s){let r=ai(hm(i),hm(e)),o=e-i,a=es(s/n*o,t);do{let l=t[a],c=n*l/o;if(c>=s&&r+(l<5?pr.get(l):0)<=17)return[l,c]}while(++a<t.length);return[0,0]}function Dm(i){let e,t;return i=i.replace(/(\d+)px/,(n,s)=>(e=Ln((t=+s)*zt))+"px"),[i,e,t]}function yy(i){i.show&&[i.font,i.labelFont].forEach(e=>{let t=en(e[2]*zt,1);e[0]=e[0].replace(/[0-9.]+px/,t+"px"),e[1]=t})}function Nn(i,e,t){let n={mode:Ot(i.mode,1)},s=n.mode;function r(S,R,B,z){let K=R.valToPct(S);return z+B*(R.dir==-1?1-K:K)}function o(S,R,B,z){let K=R.valToPct(S);return z+B*(R.dir==-1?K:1-K)}function a(S,R,B,z){return R.ori==0?r(S,R,B,z):o(S,R,B,z)}n.valToPosH=r,n.valToPosV=o;let l=!1;n.status=0;let c=n.root=ki(Ax);if(i.id!=null&&(c.id=i.id),Ai(c,i.class),i.title){let S=ki(Ix,c);S.textContent=i.title}let h=Qi("canvas"),u=n.ctx=h.getContext("2d"),f=ki(Px,c);Br("click",f,S=>{S.target===x&&(rn!=ho||dn!=uo)&&Kn.click(n,S)},!0);let p=n.under=ki(Lx,f);f.appendChild(h);let x=n.over=ki(Dx,f);i=Mo(i);let M=+Ot(i.pxAlign,1),g=Cm(M);(i.plugins||[]).forEach(S=>{S.opts&&(i=S.opts(n,i)||i)});let _=i.ms||.001,b=n.series=s==1?Lm(i.series||[],Mm,Am,!1):py(i.series||[null],Tm),P=n.axes=Lm(i.axes||[],Sm,wm,!0),w=n.scales={},D=n.bands=i.bands||[];D.forEach(S=>{S.fill=Dt(S.fill||null),S.dir=Ot(S.dir,-1)});let I=s==2?b[1].facets[0].scale:b[0].scale,y={axes:ht,series:be},T=(i.drawOrder||["axes","series"]).map(S=>y[S]);function G(S){let R=S.distr==3?B=>Ps(B>0?B:S.clamp(n,B,S.min,S.max,S.key)):S.distr==4?B=>Uu(B,S.asinh):S.distr==100?B=>S.fwd(B):B=>B;return B=>{let z=R(B),{_min:K,_max:ie}=S,_e=ie-K;return(z-K)/_e}}function k(S){let R=w[S];if(R==null){let B=(i.scales||Na)[S]||Na;if(B.from!=null){k(B.from);let z=Rn({},w[B.from],B,{key:S});z.valToPct=G(z),w[S]=z}else{R=w[S]=Rn({},S==I?ag:ny,B),R.key=S;let z=R.time,K=R.range,ie=dr(K);if((S!=I||s==2&&!z)&&(ie&&(K[0]==null||K[1]==null)&&(K={min:K[0]==null?am:{mode:1,hard:K[0],soft:K[0]},max:K[1]==null?am:{mode:1,hard:K[1],soft:K[1]}},ie=!1),!ie&&ic(K))){let _e=K;K=(Ce,Be,Ze)=>Be==null?So:jl(Be,Ze,_e)}R.range=Dt(K||(z?my:S==I?R.distr==3?_y:R.distr==4?xy:_g:R.distr==3?xg:R.distr==4?vg:gy)),R.auto=Dt(ie?!1:R.auto),R.clamp=Dt(R.clamp||ty),R._min=R._max=null,R.valToPct=G(R)}}}k("x"),k("y"),s==1&&b.forEach(S=>{k(S.scale)}),P.forEach(S=>{k(S.scale)});for(let S in i.scales)k(S);let O=w[I],Y=O.distr,Z,U;O.ori==0?(Ai(c,Rx),Z=r,U=o):(Ai(c,Cx),Z=o,U=r);let W={};for(let S in w){let R=w[S];(R.min!=null||R.max!=null)&&(W[S]={min:R.min,max:R.max},R.min=R.max=null)}let $=i.tzDate||(S=>new Date(Ln(S/_))),q=i.fmtDate||nf,xe=_==1?Rv($):Pv($),ne=xm($,_m(_==1?Av:Iv,q)),se=ym($,vm(Dv,q)),de=[],ge=n.legend=Rn({},Ov,i.legend),pe=n.cursor=Rn({},Gv,{drag:{y:s==2}},i.cursor),re=ge.show,Te=pe.show,Ie=ge.markers;ge.idxs=de,Ie.width=Dt(Ie.width),Ie.dash=Dt(Ie.dash),Ie.stroke=Dt(Ie.stroke),Ie.fill=Dt(Ie.fill);let Oe,ye,$e,ut=[],et=[],bt,vt=!1,_t={};if(ge.live){let S=b[1]?b[1].values:null;vt=S!=null,bt=vt?S(n,1,0):{_:0};for(let R in bt)_t[R]=$u}if(re)if(Oe=Qi("table",kx,c),$e=Qi("tbody",null,Oe),ge.mount(n,Oe),vt){ye=Qi("thead",null,Oe,$e);let S=Qi("tr",null,ye);Qi("th",null,S);for(var Yt in bt)Qi("th",Zp,S).textContent=Yt}else Ai(Oe,Hx),ge.live&&Ai(Oe,zx);let Ft={show:!0},fn={show:!1};function Vt(S,R){if(R==0&&(vt||!ge.live||s==2))return So;let B=[],z=Qi("tr",Gx,$e,$e.childNodes[R]);Ai(z,S.class),S.show||Ai(z,Fr);let K=Qi("th",null,z);if(Ie.show){let Ce=ki(Vx,K);if(R>0){let Be=Ie.width(n,R);Be&&(Ce.style.border=Be+"px "+Ie.dash(n,R)+" "+Ie.stroke(n,R)),Ce.style.background=Ie.fill(n,R)}}let ie=ki(Zp,K);S.label instanceof HTMLElement?ie.appendChild(S.label):ie.textContent=S.label,R>0&&(Ie.show||(ie.style.color=S.width>0?Ie.stroke(n,R):Ie.fill(n,R)),Pt("click",K,Ce=>{if(pe._lock)return;dt(Ce);let Be=b.indexOf(S);if((Ce.ctrlKey||Ce.metaKey)!=ge.isolate){let Ze=b.some((Ke,Qe)=>Qe>0&&Qe!=Be&&Ke.show);b.forEach((Ke,Qe)=>{Qe>0&&ds(Qe,Ze?Qe==Be?Ft:fn:Ft,!0,An.setSeries)})}else ds(Be,{show:!S.show},!0,An.setSeries)},!1),pt&&Pt(jp,K,Ce=>{pe._lock||(dt(Ce),ds(b.indexOf(S),po,!0,An.setSeries))},!1));for(var _e in bt){let Ce=Qi("td",Wx,z);Ce.textContent="--",B.push(Ce)}return[z,B]}let Tn=new Map;function Pt(S,R,B,z=!0){let K=Tn.get(R)||{},ie=pe.bind[S](n,R,B,z);ie&&(Br(S,R,K[S]=ie),Tn.set(R,K))}function yn(S,R,B){let z=Tn.get(R)||{};for(let K in z)(S==null||K==S)&&(Gu(K,R,z[K]),delete z[K]);S==null&&Tn.delete(R)}let nn=0,Sn=0,V=0,He=0,ct=0,xt=0,Ne=ct,Zt=xt,je=V,at=He,N=0,E=0,ee=0,Se=0;n.bbox={};let me=!1,De=!1,Ue=!1,ae=!1,ue=!1,Ae=!1;function H(S,R,B){(B||S!=n.width||R!=n.height)&&he(S,R),qe(!1),Ue=!0,De=!0,_n()}function he(S,R){n.width=nn=V=S,n.height=Sn=He=R,ct=xt=0,Fe(),tt();let B=n.bbox;N=B.left=Ur(ct*zt,.5),E=B.top=Ur(xt*zt,.5),ee=B.width=Ur(V*zt,.5),Se=B.height=Ur(He*zt,.5)}let oe=3;function ke(){let S=!1,R=0;for(;!S;){R++;let B=Nt(R),z=Et(R);S=R==oe||B&&z,S||(he(n.width,n.height),De=!0)}}function Pe({width:S,height:R}){H(S,R)}n.setSize=Pe;function Fe(){let S=!1,R=!1,B=!1,z=!1;P.forEach((K,ie)=>{if(K.show&&K._show){let{side:_e,_size:Ce}=K,Be=_e%2,Ze=K.label!=null?K.labelSize:0,Ke=Ce+Ze;Ke>0&&(Be?(V-=Ke,_e==3?(ct+=Ke,z=!0):B=!0):(He-=Ke,_e==0?(xt+=Ke,S=!0):R=!0))}}),Ui[0]=S,Ui[1]=B,Ui[2]=R,Ui[3]=z,V-=Mi[1]+Mi[3],ct+=Mi[3],He-=Mi[2]+Mi[0],xt+=Mi[0]}function tt(){let S=ct+V,R=xt+He,B=ct,z=xt;function K(ie,_e){switch(ie){case 1:return S+=_e,S-_e;case 2:return R+=_e,R-_e;case 3:return B-=_e,B+_e;case 0:return z-=_e,z+_e}}P.forEach((ie,_e)=>{if(ie.show&&ie._show){let Ce=ie.side;ie._pos=K(Ce,ie._size),ie.label!=null&&(ie._lpos=K(Ce,ie.labelSize))}})}if(pe.dataIdx==null){let S=pe.hover,R=S.skip=new Set(S.skip??[]);R.add(void 0);let B=S.prox=Dt(S.prox),z=S.bias??=0;pe.dataIdx=(K,ie,_e,Ce)=>{if(ie==0)return _e;let Be=_e,Ze=B(K,ie,_e,Ce)??Qt,Ke=Ze>=0&&Ze<Qt,Qe=O.ori==0?V:He,St=pe.left,kt=e[0],Ut=e[ie];if(R.has(Ut[_e])){Be=null;let Lt=null,mt=null,st;if(z==0||z==-1)for(st=_e;Lt==null&&st-- >0;)R.has(Ut[st])||(Lt=st);if(z==0||z==1)for(st=_e;mt==null&&st++<Ut.length;)R.has(Ut[st])||(mt=st);if(Lt!=null||mt!=null)if(Ke){let an=Lt==null?-1/0:Z(kt[Lt],O,Qe,0),Mn=mt==null?1/0:Z(kt[mt],O,Qe,0),Wn=St-an,Jt=Mn-St;Wn<=Jt?Wn<=Ze&&(Be=Lt):Jt<=Ze&&(Be=mt)}else Be=mt==null?Lt:Lt==null?mt:_e-Lt<=mt-_e?Lt:mt}else Ke&&Dn(St-Z(kt[_e],O,Qe,0))>Ze&&(Be=null);return Be}}let dt=S=>{pe.event=S};pe.idxs=de,pe._lock=!1;let Me=pe.points;Me.show=Dt(Me.show),Me.size=Dt(Me.size),Me.stroke=Dt(Me.stroke),Me.width=Dt(Me.width),Me.fill=Dt(Me.fill);let Je=n.focus=Rn({},i.focus||{alpha:.3},pe.focus),pt=Je.prox>=0,Ge=pt&&Me.one,wt=[],jt=[],Zn=[];function Ir(S,R){let B=Me.show(n,R);if(B instanceof HTMLElement)return Ai(B,Bx),Ai(B,S.class),_s(B,-10,-10,V,He),x.insertBefore(B,wt[R]),B}function sr(S,R){if(s==1||R>0){let B=s==1&&w[S.scale].time,z=S.value;S.value=B?dm(z)?ym($,vm(z,q)):z||se:z||jv,S.label=S.label||(B?Wv:Vv)}if(Ge||R>0){S.width=S.width==null?1:S.width,S.paths=S.paths||fy||nv,S.fillTo=Dt(S.fillTo||iy),S.pxAlign=+Ot(S.pxAlign,M),S.pxRound=Cm(S.pxAlign),S.stroke=Dt(S.stroke||null),S.fill=Dt(S.fill||null),S._stroke=S._fill=S._paths=S._focus=null;let B=Qv(ai(1,S.width),1),z=S.points=Rn({},{size:B,width:ai(1,B*.2),stroke:S.stroke,space:B*2,paths:dy,_stroke:null,_fill:null},S.points);z.show=Dt(z.show),z.filter=Dt(z.filter),z.fill=Dt(z.fill),z.stroke=Dt(z.stroke),z.paths=Dt(z.paths),z.pxAlign=S.pxAlign}if(re){let B=Vt(S,R);ut.splice(R,0,B[0]),et.splice(R,0,B[1]),ge.values.push(null)}if(Te){de.splice(R,0,null);let B=null;Ge?R==0&&(B=Ir(S,R)):R>0&&(B=Ir(S,R)),wt.splice(R,0,B),jt.splice(R,0,0),Zn.splice(R,0,0)}Vn("addSeries",R)}function Sa(S,R){R=R??b.length,S=s==1?Zu(S,R,Mm,Am):Zu(S,R,{},Tm),b.splice(R,0,S),sr(b[R],R)}n.addSeries=Sa;function Pr(S){if(b.splice(S,1),re){ge.values.splice(S,1),et.splice(S,1);let R=ut.splice(S,1)[0];yn(null,R.firstChild),R.remove()}Te&&(de.splice(S,1),wt.splice(S,1)[0].remove(),jt.splice(S,1),Zn.splice(S,1)),Vn("delSeries",S)}n.delSeries=Pr;let Ui=[!1,!1,!1,!1];function Yi(S,R){if(S._show=S.show,S.show){let B=S.side%2,z=w[S.scale];z==null&&(S.scale=B?b[1].scale:I,z=w[S.scale]);let K=z.time;S.size=Dt(S.size),S.space=Dt(S.space),S.rotate=Dt(S.rotate),dr(S.incrs)&&S.incrs.forEach(_e=>{!pr.has(_e)&&pr.set(_e,Gm(_e))}),S.incrs=Dt(S.incrs||(z.distr==2?wv:K?_==1?Tv:Cv:Or)),S.splits=Dt(S.splits||(K&&z.distr==1?xe:z.distr==3?Wu:z.distr==4?Yv:qv)),S.stroke=Dt(S.stroke),S.grid.stroke=Dt(S.grid.stroke),S.ticks.stroke=Dt(S.ticks.stroke),S.border.stroke=Dt(S.border.stroke);let ie=S.values;S.values=dr(ie)&&!dr(ie[0])?Dt(ie):K?dr(ie)?xm($,_m(ie,q)):dm(ie)?Lv($,ie):ie||ne:ie||Xv,S.filter=Dt(S.filter||(z.distr>=3&&z.log==10?$v:z.distr==3&&z.log==2?Jv:zm)),S.font=Dm(S.font),S.labelFont=Dm(S.labelFont),S._size=S.size(n,null,R,0),S._space=S._rotate=S._incrs=S._found=S._splits=S._values=null,S._size>0&&(Ui[R]=!0,S._el=ki(Nx,f))}}function Zi(S,R,B,z){let[K,ie,_e,Ce]=B,Be=R%2,Ze=0;return Be==0&&(Ce||ie)&&(Ze=R==0&&!K||R==2&&!_e?Ln(Sm.size/3):0),Be==1&&(K||_e)&&(Ze=R==1&&!ie||R==3&&!Ce?Ln(wm.size/2):0),Ze}let rr=n.padding=(i.padding||[Zi,Zi,Zi,Zi]).map(S=>Dt(Ot(S,Zi))),Mi=n._padding=rr.map((S,R)=>S(n,R,Ui,0)),sn,pn=null,mn=null,ii=s==1?b[0].idxs:null,zn=null,hs=!1;function us(S,R){if(e=S??[],n.data=n._data=e,s==2){sn=0;for(let B=1;B<b.length;B++)sn+=e[B][0].length}else{e.length==0&&(n.data=n._data=e=[[]]),zn=e[0],sn=zn.length;let B=e;if(Y==2){B=e.slice();let z=B[0]=Array(sn);for(let K=0;K<sn;K++)z[K]=K}n._data=e=B}if(qe(!0),Vn("setData"),Y==2&&(Ue=!0),R!==!1){let B=O;B.auto(n,hs)?or():hr(I,B.min,B.max),ae=ae||pe.left>=0,Ae=!0,_n()}}n.setData=us;function or(){hs=!0;let S,R;s==1&&(sn>0?(pn=ii[0]=0,mn=ii[1]=sn-1,S=e[0][pn],R=e[0][mn],Y==2?(S=pn,R=mn):S==R&&(Y==3?[S,R]=tc(S,S,O.log,!1):Y==4?[S,R]=ju(S,S,O.log,!1):O.time?R=S+Ln(86400/_):[S,R]=jl(S,R,Qu,!0))):(pn=ii[0]=S=null,mn=ii[1]=R=null)),hr(I,S,R)}let gn,wn,m,d,v,A,C,F,L,J;function X(S,R,B,z,K,ie){S??=$p,B??=tf,z??="butt",K??=$p,ie??="round",S!=gn&&(u.strokeStyle=gn=S),K!=wn&&(u.fillStyle=wn=K),R!=m&&(u.lineWidth=m=R),ie!=v&&(u.lineJoin=v=ie),z!=A&&(u.lineCap=A=z),B!=d&&u.setLineDash(d=B)}function j(S,R,B,z){R!=wn&&(u.fillStyle=wn=R),S!=C&&(u.font=C=S),B!=F&&(u.textAlign=F=B),z!=L&&(u.textBaseline=L=z)}function te(S,R,B,z,K=0){if(z.length>0&&S.auto(n,hs)&&(R==null||R.min==null)){let ie=Ot(pn,0),_e=Ot(mn,z.length-1),Ce=B.min==null?$x(z,ie,_e,K,S.distr==3):[B.min,B.max];S.min=ts(S.min,B.min=Ce[0]),S.max=ai(S.max,B.max=Ce[1])}}let fe={min:null,max:null};function le(){for(let z in w){let K=w[z];W[z]==null&&(K.min==null||W[I]!=null&&K.auto(n,hs))&&(W[z]=fe)}for(let z in w){let K=w[z];W[z]==null&&K.from!=null&&W[K.from]!=null&&(W[z]=fe)}W[I]!=null&&qe(!0);let S={};for(let z in W){let K=W[z];if(K!=null){let ie=S[z]=Mo(w[z],rv);if(K.min!=null)Rn(ie,K);else if(z!=I||s==2)if(sn==0&&ie.from==null){let _e=ie.range(n,null,null,z);ie.min=_e[0],ie.max=_e[1]}else ie.min=Qt,ie.max=-Qt}}if(sn>0){b.forEach((z,K)=>{if(s==1){let ie=z.scale,_e=W[ie];if(_e==null)return;let Ce=S[ie];if(K==0){let Be=Ce.range(n,Ce.min,Ce.max,ie);Ce.min=Be[0],Ce.max=Be[1],pn=es(Ce.min,e[0]),mn=es(Ce.max,e[0]),mn-pn>1&&(e[0][pn]<Ce.min&&pn++,e[0][mn]>Ce.max&&mn--),z.min=zn[pn],z.max=zn[mn]}else z.show&&z.auto&&te(Ce,_e,z,e[K],z.sorted);z.idxs[0]=pn,z.idxs[1]=mn}else if(K>0&&z.show&&z.auto){let[ie,_e]=z.facets,Ce=ie.scale,Be=_e.scale,[Ze,Ke]=e[K],Qe=S[Ce],St=S[Be];Qe!=null&&te(Qe,W[Ce],ie,Ze,ie.sorted),St!=null&&te(St,W[Be],_e,Ke,_e.sorted),z.min=_e.min,z.max=_e.max}});for(let z in S){let K=S[z],ie=W[z];if(K.from==null&&(ie==null||ie.min==null)){let _e=K.range(n,K.min==Qt?null:K.min,K.max==-Qt?null:K.max,z);K.min=_e[0],K.max=_e[1]}}}for(let z in S){let K=S[z];if(K.from!=null){let ie=S[K.from];if(ie.min==null)K.min=K.max=null;else{let _e=K.range(n,ie.min,ie.max,z);K.min=_e[0],K.max=_e[1]}}}let R={},B=!1;for(let z in S){let K=S[z],ie=w[z];if(ie.min!=K.min||ie.max!=K.max){ie.min=K.min,ie.max=K.max;let _e=ie.distr;ie._min=_e==3?Ps(ie.min):_e==4?Uu(ie.min,ie.asinh):_e==100?ie.fwd(ie.min):ie.min,ie._max=_e==3?Ps(ie.max):_e==4?Uu(ie.max,ie.asinh):_e==100?ie.fwd(ie.max):ie.max,R[z]=B=!0}}if(B){b.forEach((z,K)=>{s==2?K>0&&R.y&&(z._paths=null):R[z.scale]&&(z._paths=null)});for(let z in R)Ue=!0,Vn("setScale",z);Te&&pe.left>=0&&(ae=Ae=!0)}for(let z in W)W[z]=null}function ce(S){let R=Vu(pn-1,0,sn-1),B=Vu(mn+1,0,sn-1);for(;S[R]==null&&R>0;)R--;for(;S[B]==null&&B<sn-1;)B++;return[R,B]}function be(){if(sn>0){let S=b.some(R=>R._focus)&&J!=Je.alpha;S&&(u.globalAlpha=J=Je.alpha),b.forEach((R,B)=>{if(B>0&&R.show&&(we(B,!1),we(B,!0),R._paths==null)){let z=J;J!=R.alpha&&(u.globalAlpha=J=R.alpha);let K=s==2?[0,e[B][0].length-1]:ce(e[B]);R._paths=R.paths(n,B,K[0],K[1]),J!=z&&(u.globalAlpha=J=z)}}),b.forEach((R,B)=>{if(B>0&&R.show){let z=J;J!=R.alpha&&(u.globalAlpha=J=R.alpha),R._paths!=null&&Ee(B,!1);{let K=R._paths!=null?R._paths.gaps:null,ie=R.points.show(n,B,pn,mn,K),_e=R.points.filter(n,B,ie,K);(ie||_e)&&(R.points._paths=R.points.paths(n,B,pn,mn,_e),Ee(B,!0))}J!=z&&(u.globalAlpha=J=z),Vn("drawSeries",B)}}),S&&(u.globalAlpha=J=1)}}function we(S,R){let B=R?b[S].points:b[S];B._stroke=B.stroke(n,S),B._fill=B.fill(n,S)}function Ee(S,R){let B=R?b[S].points:b[S],{stroke:z,fill:K,clip:ie,flags:_e,_stroke:Ce=B._stroke,_fill:Be=B._fill,_width:Ze=B.width}=B._paths;Ze=en(Ze*zt,3);let Ke=null,Qe=Ze%2/2;R&&Be==null&&(Be=Ze>0?"#fff":Ce);let St=B.pxAlign==1&&Qe>0;if(St&&u.translate(Qe,Qe),!R){let kt=N-Ze/2,Ut=E-Ze/2,Lt=ee+Ze,mt=Se+Ze;Ke=new Path2D,Ke.rect(kt,Ut,Lt,mt)}R?ve(Ce,Ze,B.dash,B.cap,Be,z,K,_e,ie):ze(S,Ce,Ze,B.dash,B.cap,Be,z,K,_e,Ke,ie),St&&u.translate(-Qe,-Qe)}function ze(S,R,B,z,K,ie,_e,Ce,Be,Ze,Ke){let Qe=!1;Be!=0&&D.forEach((St,kt)=>{if(St.series[0]==S){let Ut=b[St.series[1]],Lt=e[St.series[1]],mt=(Ut._paths||Na).band;dr(mt)&&(mt=St.dir==1?mt[0]:mt[1]);let st,an=null;Ut.show&&mt&&jx(Lt,pn,mn)?(an=St.fill(n,kt)||ie,st=Ut._paths.clip):mt=null,ve(R,B,z,K,an,_e,Ce,Be,Ze,Ke,st,mt),Qe=!0}}),Qe||ve(R,B,z,K,ie,_e,Ce,Be,Ze,Ke)}let it=bo|qu;function ve(S,R,B,z,K,ie,_e,Ce,Be,Ze,Ke,Qe){X(S,R,B,z,K),(Be||Ze||Qe)&&(u.save(),Be&&u.clip(Be),Ze&&u.clip(Ze)),Qe?(Ce&it)==it?(u.clip(Qe),Ke&&u.clip(Ke),Re(K,_e),rt(S,ie,R)):Ce&qu?(Re(K,_e),u.clip(Qe),rt(S,ie,R)):Ce&bo&&(u.save(),u.clip(Qe),Ke&&u.clip(Ke),Re(K,_e),u.restore(),rt(S,ie,R)):(Re(K,_e),rt(S,ie,R)),(Be||Ze||Qe)&&u.restore()}function rt(S,R,B){B>0&&(R instanceof Map?R.forEach((z,K)=>{u.strokeStyle=gn=K,u.stroke(z)}):R!=null&&S&&u.stroke(R))}function Re(S,R){R instanceof Map?R.forEach((B,z)=>{u.fillStyle=wn=z,u.fill(B)}):R!=null&&S&&u.fill(R)}function Xe(S,R,B,z){let K=P[S],ie;if(z<=0)ie=[0,0];else{let _e=K._space=K.space(n,S,R,B,z),Ce=K._incrs=K.incrs(n,S,R,B,z,_e);ie=vy(R,B,Ce,z,_e)}return K._found=ie}function Ve(S,R,B,z,K,ie,_e,Ce,Be,Ze){let Ke=_e%2/2;M==1&&u.translate(Ke,Ke),X(Ce,_e,Be,Ze,Ce),u.beginPath();let Qe,St,kt,Ut,Lt=K+(z==0||z==3?-ie:ie);B==0?(St=K,Ut=Lt):(Qe=K,kt=Lt);for(let mt=0;mt<S.length;mt++)R[mt]!=null&&(B==0?Qe=kt=S[mt]:St=Ut=S[mt],u.moveTo(Qe,St),u.lineTo(kt,Ut));u.stroke(),M==1&&u.translate(-Ke,-Ke)}function Nt(S){let R=!0;return P.forEach((B,z)=>{if(!B.show)return;let K=w[B.scale];if(K.min==null){B._show&&(R=!1,B._show=!1,qe(!1));return}else B._show||(R=!1,B._show=!0,qe(!1));let ie=B.side,_e=ie%2,{min:Ce,max:Be}=K,[Ze,Ke]=Xe(z,Ce,Be,_e==0?V:He);if(Ke==0)return;let Qe=K.distr==2,St=B._splits=B.splits(n,z,Ce,Be,Ze,Ke,Qe),kt=K.distr==2?St.map(st=>zn[st]):St,Ut=K.distr==2?zn[St[1]]-zn[St[0]]:Ze,Lt=B._values=B.values(n,B.filter(n,kt,z,Ke,Ut),z,Ke,Ut);B._rotate=ie==2?B.rotate(n,Lt,z,Ke):0;let mt=B._size;B._size=zi(B.size(n,Lt,z,S)),mt!=null&&B._size!=mt&&(R=!1)}),R}function Et(S){let R=!0;return rr.forEach((B,z)=>{let K=B(n,z,Ui,S);K!=Mi[z]&&(R=!1),Mi[z]=K}),R}function ht(){for(let S=0;S<P.length;S++){let R=P[S];if(!R.show||!R._show)continue;let B=R.side,z=B%2,K,ie,_e=R.stroke(n,S),Ce=B==0||B==3?-1:1,[Be,Ze]=R._found;if(R.label!=null){let ri=R.labelGap*Ce,Ti=Ln((R._lpos+ri)*zt);j(R.labelFont[0],_e,"center",B==2?"top":Kp),u.save(),z==1?(K=ie=0,u.translate(Ti,Ln(E+Se/2)),u.rotate((B==3?-$l:$l)/2)):(K=Ln(N+ee/2),ie=Ti);let Nr=Bm(R.label)?R.label(n,S,Be,Ze):R.label;u.fillText(Nr,K,ie),u.restore()}if(Ze==0)continue;let Ke=w[R.scale],Qe=z==0?ee:Se,St=z==0?N:E,kt=R._splits,Ut=Ke.distr==2?kt.map(ri=>zn[ri]):kt,Lt=Ke.distr==2?zn[kt[1]]-zn[kt[0]]:Be,mt=R.ticks,st=R.border,an=mt.show?mt.size:0,Mn=Ln(an*zt),Wn=Ln((R.alignTo==2?R._size-an-R.gap:R.gap)*zt),Jt=R._rotate*-$l/180,bn=g(R._pos*zt),wi=(Mn+Wn)*Ce,si=bn+wi;ie=z==0?si:0,K=z==1?si:0;let Fi=R.font[0],Ji=R.align==1?_o:R.align==2?Lu:Jt>0?_o:Jt<0?Lu:z==0?"center":B==3?Lu:_o,ms=Jt||z==1?"middle":B==2?"top":Kp;j(Fi,_e,Ji,ms);let Ei=R.font[1]*R.lineGap,Bi=kt.map(ri=>g(a(ri,Ke,Qe,St))),ji=R._values;for(let ri=0;ri<ji.length;ri++){let Ti=ji[ri];if(Ti!=null){z==0?K=Bi[ri]:ie=Bi[ri],Ti=""+Ti;let Nr=Ti.indexOf(`
`)==-1?[Ti]:Ti.split(/\n/gm);for(let oi=0;oi<Nr.length;oi++){let Gp=Nr[oi];Jt?(u.save(),u.translate(K,ie+oi*Ei),u.rotate(Jt),u.fillText(Gp,0,0),u.restore()):u.fillText(Gp,K,ie+oi*Ei)}}}mt.show&&Ve(Bi,mt.filter(n,Ut,S,Ze,Lt),z,B,bn,Mn,en(mt.width*zt,3),mt.stroke(n,S),mt.dash,mt.cap);let gs=R.grid;gs.show&&Ve(Bi,gs.filter(n,Ut,S,Ze,Lt),z,z==0?2:1,z==0?E:N,z==0?Se:ee,en(gs.width*zt,3),gs.stroke(n,S),gs.dash,gs.cap),st.show&&Ve([bn],[1],z==0?1:0,z==0?1:2,z==1?E:N,z==1?Se:ee,en(st.width*zt,3),st.stroke(n,S),st.dash,st.cap)}Vn("drawAxes")}function qe(S){b.forEach((R,B)=>{B>0&&(R._paths=null,S&&(s==1?(R.min=null,R.max=null):R.facets.forEach(z=>{z.min=null,z.max=null})))})}let Tt=!1,Kt=!1,ot=[];function Bt(){Kt=!1;for(let S=0;S<ot.length;S++)Vn(...ot[S]);ot.length=0}function _n(){Tt||(fv(bi),Tt=!0)}function fs(S,R=!1){Tt=!0,Kt=R,S(n),bi(),R&&ot.length>0&&queueMicrotask(Bt)}n.batch=fs;function bi(){if(me&&(le(),me=!1),Ue&&(ke(),Ue=!1),De){if(ln(p,_o,ct),ln(p,"top",xt),ln(p,Ia,V),ln(p,Pa,He),ln(x,_o,ct),ln(x,"top",xt),ln(x,Ia,V),ln(x,Pa,He),ln(f,Ia,nn),ln(f,Pa,Sn),h.width=Ln(nn*zt),h.height=Ln(Sn*zt),P.forEach(({_el:S,_show:R,_size:B,_pos:z,side:K})=>{if(S!=null)if(R){let ie=K===3||K===0?B:0,_e=K%2==1;ln(S,_e?"left":"top",z-ie),ln(S,_e?"width":"height",B),ln(S,_e?"top":"left",_e?xt:ct),ln(S,_e?"height":"width",_e?He:V),Hu(S,Fr)}else Ai(S,Fr)}),gn=wn=m=v=A=C=F=L=d=null,J=1,wa(!0),ct!=Ne||xt!=Zt||V!=je||He!=at){qe(!1);let S=V/je,R=He/at;if(Te&&!ae&&pe.left>=0){pe.left*=S,pe.top*=R,$i&&_s($i,Ln(pe.left),0,V,He),Oi&&_s(Oi,0,Ln(pe.top),V,He);for(let B=0;B<wt.length;B++){let z=wt[B];z!=null&&(jt[B]*=S,Zn[B]*=R,_s(z,zi(jt[B]),zi(Zn[B]),V,He))}}if(on.show&&!ue&&on.left>=0&&on.width>0){on.left*=S,on.width*=S,on.top*=R,on.height*=R;for(let B in Eu)ln(fo,B,on[B])}Ne=ct,Zt=xt,je=V,at=He}Vn("setSize"),De=!1}nn>0&&Sn>0&&(u.clearRect(0,0,h.width,h.height),Vn("drawClear"),T.forEach(S=>S()),Vn("draw")),on.show&&ue&&(zl(on),ue=!1),Te&&ae&&(Dr(null,!0,!1),ae=!1),ge.show&&ge.live&&Ae&&(bu(),Ae=!1),l||(l=!0,n.status=1,Vn("ready")),hs=!1,Tt=!1}n.redraw=(S,R)=>{Ue=R||!1,S!==!1?hr(I,O.min,O.max):_n()};function Ki(S,R){let B=w[S];if(B.from==null){if(sn==0){let z=B.range(n,R.min,R.max,S);R.min=z[0],R.max=z[1]}if(R.min>R.max){let z=R.min;R.min=R.max,R.max=z}if(sn>1&&R.min!=null&&R.max!=null&&R.max-R.min<1e-16)return;S==I&&B.distr==2&&sn>0&&(R.min=es(R.min,e[0]),R.max=es(R.max,e[0]),R.min==R.max&&R.max++),W[S]=R,me=!0,_n()}}n.setScale=Ki;let ar,lr,$i,Oi,Rs,Tp,ho,uo,Ap,Rp,rn,dn,cr=!1,Kn=pe.drag,Hn=Kn.x,Gn=Kn.y;Te&&(pe.x&&(ar=ki(Ox,x)),pe.y&&(lr=ki(Fx,x)),O.ori==0?($i=ar,Oi=lr):($i=lr,Oi=ar),rn=pe.left,dn=pe.top);let on=n.select=Rn({show:!0,over:!0,left:0,width:0,top:0,height:0},i.select),fo=on.show?ki(Ux,on.over?x:p):null;function zl(S,R){if(on.show){for(let B in S)on[B]=S[B],B in Eu&&ln(fo,B,S[B]);R!==!1&&Vn("setSelect")}}n.setSelect=zl;function hx(S){if(b[S].show)re&&Hu(ut[S],Fr);else if(re&&Ai(ut[S],Fr),Te){let B=Ge?wt[0]:wt[S];B!=null&&_s(B,-10,-10,V,He)}}function hr(S,R,B){Ki(S,{min:R,max:B})}function ds(S,R,B,z){R.focus!=null&&mx(S),R.show!=null&&b.forEach((K,ie)=>{ie>0&&(S==ie||S==null)&&(K.show=R.show,hx(ie),s==2?(hr(K.facets[0].scale,null,null),hr(K.facets[1].scale,null,null)):hr(K.scale,null,null),_n())}),B!==!1&&Vn("setSeries",S,R),z&&Ea("setSeries",n,S,R)}n.setSeries=ds;function ux(S,R){Rn(D[S],R)}function fx(S,R){S.fill=Dt(S.fill||null),S.dir=Ot(S.dir,-1),R=R??D.length,D.splice(R,0,S)}function dx(S){S==null?D.length=0:D.splice(S,1)}n.addBand=fx,n.setBand=ux,n.delBand=dx;function px(S,R){b[S].alpha=R,Te&&wt[S]!=null&&(wt[S].style.opacity=R),re&&ut[S]&&(ut[S].style.opacity=R)}let Cs,ur,Lr,po={focus:!0};function mx(S){if(S!=Lr){let R=S==null,B=Je.alpha!=1;b.forEach((z,K)=>{if(s==1||K>0){let ie=R||K==0||K==S;z._focus=R?null:ie,B&&px(K,ie?1:Je.alpha)}}),Lr=S,B&&_n()}}re&&pt&&Pt(Qp,Oe,S=>{pe._lock||(dt(S),Lr!=null&&ds(null,po,!0,An.setSeries))});function ps(S,R,B){let z=w[R];B&&(S=S/zt-(z.ori==1?xt:ct));let K=V;z.ori==1&&(K=He,S=K-S),z.dir==-1&&(S=K-S);let ie=z._min,_e=z._max,Ce=S/K,Be=ie+(_e-ie)*Ce,Ze=z.distr;return Ze==3?yo(10,Be):Ze==4?ev(Be,z.asinh):Ze==100?z.bwd(Be):Be}function gx(S,R){let B=ps(S,I,R);return es(B,e[0],pn,mn)}n.valToIdx=S=>es(S,e[0]),n.posToIdx=gx,n.posToVal=ps,n.valToPos=(S,R,B)=>w[R].ori==0?r(S,w[R],B?ee:V,B?N:0):o(S,w[R],B?Se:He,B?E:0),n.setCursor=(S,R,B)=>{rn=S.left,dn=S.top,Dr(null,R,B)};function Cp(S,R){ln(fo,_o,on.left=S),ln(fo,Ia,on.width=R)}function Ip(S,R){ln(fo,"top",on.top=S),ln(fo,Pa,on.height=R)}let Ma=O.ori==0?Cp:Ip,ba=O.ori==1?Cp:Ip;function _x(){if(re&&ge.live)for(let S=s==2?1:0;S<b.length;S++){if(S==0&&vt)continue;let R=ge.values[S],B=0;for(let z in R)et[S][B++].firstChild.nodeValue=R[z]}}function bu(S,R){if(S!=null&&(S.idxs?S.idxs.forEach((B,z)=>{de[z]=B}):sv(S.idx)||de.fill(S.idx),ge.idx=de[0]),re&&ge.live){for(let B=0;B<b.length;B++)(B>0||s==1&&!vt)&&xx(B,de[B]);_x()}Ae=!1,R!==!1&&Vn("setLegend")}n.setLegend=bu;function xx(S,R){let B=b[S],z=S==0&&Y==2?zn:e[S],K;vt?K=B.values(n,S,R)??_t:(K=B.value(n,R==null?null:z[R],S,R),K=K==null?_t:{_:K}),ge.values[S]=K}function Dr(S,R,B){Ap=rn,Rp=dn,[rn,dn]=pe.move(n,rn,dn),pe.left=rn,pe.top=dn,Te&&($i&&_s($i,Ln(rn),0,V,He),Oi&&_s(Oi,0,Ln(dn),V,He));let z,K=pn>mn;Cs=Qt,ur=null;let ie=O.ori==0?V:He,_e=O.ori==1?V:He;if(rn<0||sn==0||K){z=pe.idx=null;for(let Ce=0;Ce<b.length;Ce++){let Be=wt[Ce];Be!=null&&_s(Be,-10,-10,V,He)}pt&&ds(null,po,!0,S==null&&An.setSeries),ge.live&&(de.fill(z),Ae=!0)}else{let Ce,Be,Ze;s==1&&(Ce=O.ori==0?rn:dn,Be=ps(Ce,I),z=pe.idx=es(Be,e[0],pn,mn),Ze=Z(e[0][z],O,ie,0));let Ke=-10,Qe=-10,St=0,kt=0,Ut=!0,Lt="",mt="";for(let st=s==2?1:0;st<b.length;st++){let an=b[st],Mn=de[st],Wn=Mn==null?null:s==1?e[st][Mn]:e[st][1][Mn],Jt=pe.dataIdx(n,st,z,Be),bn=Jt==null?null:s==1?e[st][Jt]:e[st][1][Jt];if(Ae=Ae||bn!=Wn||Jt!=Mn,de[st]=Jt,st>0&&an.show){let wi=Jt==null?-10:Jt==z?Ze:Z(s==1?e[0][Jt]:e[st][0][Jt],O,ie,0),si=bn==null?-10:U(bn,s==1?w[an.scale]:w[an.facets[1].scale],_e,0);if(pt&&bn!=null){let Fi=O.ori==1?rn:dn,Ji=Dn(Je.dist(n,st,Jt,si,Fi));if(Ji<Cs){let ms=Je.bias;if(ms!=0){let Ei=ps(Fi,an.scale),Bi=bn>=0?1:-1,ji=Ei>=0?1:-1;ji==Bi&&(ji==1?ms==1?bn>=Ei:bn<=Ei:ms==1?bn<=Ei:bn>=Ei)&&(Cs=Ji,ur=st)}else Cs=Ji,ur=st}}if(Ae||Ge){let Fi,Ji;O.ori==0?(Fi=wi,Ji=si):(Fi=si,Ji=wi);let ms,Ei,Bi,ji,gs,ri,Ti=!0,Nr=Me.bbox;if(Nr!=null){Ti=!1;let oi=Nr(n,st);Bi=oi.left,ji=oi.top,ms=oi.width,Ei=oi.height}else Bi=Fi,ji=Ji,ms=Ei=Me.size(n,st);if(ri=Me.fill(n,st),gs=Me.stroke(n,st),Ge)st==ur&&Cs<=Je.prox&&(Ke=Bi,Qe=ji,St=ms,kt=Ei,Ut=Ti,Lt=ri,mt=gs);else{let oi=wt[st];oi!=null&&(jt[st]=Bi,Zn[st]=ji,om(oi,ms,Ei,Ti),sm(oi,ri,gs),_s(oi,zi(Bi),zi(ji),V,He))}}}}if(Ge){let st=Je.prox,an=Lr==null?Cs<=st:Cs>st||ur!=Lr;if(Ae||an){let Mn=wt[0];Mn!=null&&(jt[0]=Ke,Zn[0]=Qe,om(Mn,St,kt,Ut),sm(Mn,Lt,mt),_s(Mn,zi(Ke),zi(Qe),V,He))}}}if(on.show&&cr)if(S!=null){let[Ce,Be]=An.scales,[Ze,Ke]=An.match,[Qe,St]=S.cursor.sync.scales,kt=S.cursor.drag;if(Hn=kt._x,Gn=kt._y,Hn||Gn){let{left:Ut,top:Lt,width:mt,height:st}=S.select,an=S.scales[Qe].ori,Mn=S.posToVal,Wn,Jt,bn,wi,si,Fi=Ce!=null&&Ze(Ce,Qe),Ji=Be!=null&&Ke(Be,St);Fi&&Hn?(an==0?(Wn=Ut,Jt=mt):(Wn=Lt,Jt=st),bn=w[Ce],wi=Z(Mn(Wn,Qe),bn,ie,0),si=Z(Mn(Wn+Jt,Qe),bn,ie,0),Ma(ts(wi,si),Dn(si-wi))):Ma(0,ie),Ji&&Gn?(an==1?(Wn=Ut,Jt=mt):(Wn=Lt,Jt=st),bn=w[Be],wi=U(Mn(Wn,St),bn,_e,0),si=U(Mn(Wn+Jt,St),bn,_e,0),ba(ts(wi,si),Dn(si-wi))):ba(0,_e)}else Tu()}else{let Ce=Dn(Ap-Rs),Be=Dn(Rp-Tp);if(O.ori==1){let St=Ce;Ce=Be,Be=St}Hn=Kn.x&&Ce>=Kn.dist,Gn=Kn.y&&Be>=Kn.dist;let Ze=Kn.uni;Ze!=null?Hn&&Gn&&(Hn=Ce>=Ze,Gn=Be>=Ze,!Hn&&!Gn&&(Be>Ce?Gn=!0:Hn=!0)):Kn.x&&Kn.y&&(Hn||Gn)&&(Hn=Gn=!0);let Ke,Qe;Hn&&(O.ori==0?(Ke=ho,Qe=rn):(Ke=uo,Qe=dn),Ma(ts(Ke,Qe),Dn(Qe-Ke)),Gn||ba(0,_e)),Gn&&(O.ori==1?(Ke=ho,Qe=rn):(Ke=uo,Qe=dn),ba(ts(Ke,Qe),Dn(Qe-Ke)),Hn||Ma(0,ie)),!Hn&&!Gn&&(Ma(0,0),ba(0,0))}if(Kn._x=Hn,Kn._y=Gn,S==null){if(B){if(Hp!=null){let[Ce,Be]=An.scales;An.values[0]=Ce!=null?ps(O.ori==0?rn:dn,Ce):null,An.values[1]=Be!=null?ps(O.ori==1?rn:dn,Be):null}Ea(Du,n,rn,dn,V,He,z)}if(pt){let Ce=B&&An.setSeries,Be=Je.prox;Lr==null?Cs<=Be&&ds(ur,po,!0,Ce):Cs>Be?ds(null,po,!0,Ce):ur!=Lr&&ds(ur,po,!0,Ce)}}Ae&&(ge.idx=z,bu()),R!==!1&&Vn("setCursor")}let fr=null;Object.defineProperty(n,"rect",{get(){return fr==null&&wa(!1),fr}});function wa(S=!1){S?fr=null:(fr=x.getBoundingClientRect(),Vn("syncRect",fr))}function Pp(S,R,B,z,K,ie,_e){pe._lock||cr&&S!=null&&S.movementX==0&&S.movementY==0||(wu(S,R,B,z,K,ie,_e,!1,S!=null),S!=null?Dr(null,!0,!0):Dr(R,!0,!1))}function wu(S,R,B,z,K,ie,_e,Ce,Be){if(fr==null&&wa(!1),dt(S),S!=null)B=S.clientX-fr.left,z=S.clientY-fr.top;else{if(B<0||z<0){rn=-10,dn=-10;return}let[Ze,Ke]=An.scales,Qe=R.cursor.sync,[St,kt]=Qe.values,[Ut,Lt]=Qe.scales,[mt,st]=An.match,an=R.axes[0].side%2==1,Mn=O.ori==0?V:He,Wn=O.ori==1?V:He,Jt=an?ie:K,bn=an?K:ie,wi=an?z:B,si=an?B:z;if(Ut!=null?B=mt(Ze,Ut)?a(St,w[Ze],Mn,0):-10:B=Mn*(wi/Jt),Lt!=null?z=st(Ke,Lt)?a(kt,w[Ke],Wn,0):-10:z=Wn*(si/bn),O.ori==1){let Fi=B;B=z,z=Fi}}Be&&(R==null||R.cursor.event.type==Du)&&((B<=1||B>=V-1)&&(B=Ur(B,V)),(z<=1||z>=He-1)&&(z=Ur(z,He))),Ce?(Rs=B,Tp=z,[ho,uo]=pe.move(n,B,z)):(rn=B,dn=z)}let Eu={width:0,height:0,left:0,top:0};function Tu(){zl(Eu,!1)}let Lp,Dp,Np,Up;function Op(S,R,B,z,K,ie,_e){cr=!0,Hn=Gn=Kn._x=Kn._y=!1,wu(S,R,B,z,K,ie,_e,!0,!1),S!=null&&(Pt(Nu,ku,Fp,!1),Ea(Jp,n,ho,uo,V,He,null));let{left:Ce,top:Be,width:Ze,height:Ke}=on;Lp=Ce,Dp=Be,Np=Ze,Up=Ke}function Fp(S,R,B,z,K,ie,_e){cr=Kn._x=Kn._y=!1,wu(S,R,B,z,K,ie,_e,!1,!0);let{left:Ce,top:Be,width:Ze,height:Ke}=on,Qe=Ze>0||Ke>0,St=Lp!=Ce||Dp!=Be||Np!=Ze||Up!=Ke;if(Qe&&St&&zl(on),Kn.setScale&&Qe&&St){let kt=Ce,Ut=Ze,Lt=Be,mt=Ke;if(O.ori==1&&(kt=Be,Ut=Ke,Lt=Ce,mt=Ze),Hn&&hr(I,ps(kt,I),ps(kt+Ut,I)),Gn)for(let st in w){let an=w[st];st!=I&&an.from==null&&an.min!=Qt&&hr(st,ps(Lt+mt,st),ps(Lt,st))}Tu()}else pe.lock&&(pe._lock=!pe._lock,Dr(R,!0,S!=null));S!=null&&(yn(Nu,ku),Ea(Nu,n,rn,dn,V,He,null))}function vx(S,R,B,z,K,ie,_e){if(pe._lock)return;dt(S);let Ce=cr;if(cr){let Be=!0,Ze=!0,Ke=10,Qe,St;O.ori==0?(Qe=Hn,St=Gn):(Qe=Gn,St=Hn),Qe&&St&&(Be=rn<=Ke||rn>=V-Ke,Ze=dn<=Ke||dn>=He-Ke),Qe&&Be&&(rn=rn<ho?0:V),St&&Ze&&(dn=dn<uo?0:He),Dr(null,!0,!0),cr=!1}rn=-10,dn=-10,de.fill(null),Dr(null,!0,!0),Ce&&(cr=Ce)}function Bp(S,R,B,z,K,ie,_e){pe._lock||(dt(S),or(),Tu(),S!=null&&Ea(em,n,rn,dn,V,He,null))}function kp(){P.forEach(yy),H(n.width,n.height,!0)}Br(Jl,vo,kp);let mo={};mo.mousedown=Op,mo.mousemove=Pp,mo.mouseup=Fp,mo.dblclick=Bp,mo.setSeries=(S,R,B,z)=>{let K=An.match[2];B=K(n,R,B),B!=-1&&ds(B,z,!0,!1)},Te&&(Pt(Jp,x,Op),Pt(Du,x,Pp),Pt(jp,x,S=>{dt(S),wa(!1)}),Pt(Qp,x,vx),Pt(em,x,Bp),Yu.add(n),n.syncRect=wa);let Hl=n.hooks=i.hooks||{};function Vn(S,R,B){Kt?ot.push([S,R,B]):S in Hl&&Hl[S].forEach(z=>{z.call(null,n,R,B)})}(i.plugins||[]).forEach(S=>{for(let R in S.hooks)Hl[R]=(Hl[R]||[]).concat(S.hooks[R])});let zp=(S,R,B)=>B,An=Rn({key:null,setSeries:!1,filters:{pub:um,sub:um},scales:[I,b[1]?b[1].scale:null],match:[fm,fm,zp],values:[null,null]},pe.sync);An.match.length==2&&An.match.push(zp),pe.sync=An;let Hp=An.key,Au=lg(Hp);function Ea(S,R,B,z,K,ie,_e){An.filters.pub(S,R,B,z,K,ie,_e)&&Au.pub(S,R,B,z,K,ie,_e)}Au.sub(n);function yx(S,R,B,z,K,ie,_e){An.filters.sub(S,R,B,z,K,ie,_e)&&mo[S](null,R,B,z,K,ie,_e)}n.pub=yx;function Sx(){Au.unsub(n),Yu.delete(n),Tn.clear(),Gu(Jl,vo,kp),c.remove(),Oe?.remove(),Vn("destroy")}n.destroy=Sx;function Ru(){Vn("init",i,e),us(e||i.data,!1),W[I]?Ki(I,W[I]):or(),ue=on.show&&(on.width>0||on.height>0),ae=Ae=!0,H(i.width,i.height)}return b.forEach(sr),P.forEach(Yi),t?t instanceof HTMLElement?(t.appendChild(c),Ru()):t(n,Ru):Ru(),n}Nn.assign=Rn;Nn.fmtNum=ef;Nn.rangeNum=jl;Nn.rangeLog=tc;Nn.rangeAsinh=ju;Nn.orient=zr;Nn.pxRatio=zt;Nn.join=uv;Nn.fmtDate=nf,Nn.tzDate=Mv;Nn.sync=lg;{Nn.addGap=sy,Nn.clipGaps=sc;let i=Nn.paths={points:pg};i.linear=gg,i.stepped=ay,i.bars=ly,i.spline=hy}var yg=260,Sy=8;function Sg(i,{charts:e,colours:t}){let n=e.filter(Boolean);if(!n.length)return!1;let s=We("div",{class:"grid-cards widget"});i.querySelector(".static").after(s),i.classList.add("live");let r=n.map(o=>new hf(o,t,s));return matchMedia("(prefers-color-scheme: dark)").addEventListener("change",()=>r.forEach(o=>o.make())),!0}var hf=class{constructor(e,t,n){Object.assign(this,{chart:e,colours:t}),this.log=e.log,this.hidden=new Set,this.tip=We("div",{class:"tip",hidden:!0}),this.place=We("div",{class:"plot"});let s=We("input",{type:"checkbox",checked:this.log,onchange:()=>this.make(s.checked)}),r=We("label",{class:"axis"},s," logarithmic");this.figure=We("figure",{class:"chart"},We("figcaption",{},e.title,r),this.place),n.append(this.figure),this.make(),new ResizeObserver(()=>this.plot.setSize({width:this.place.clientWidth,height:yg})).observe(this.place)}make(e=this.log){this.log=e,this.plot?.destroy();let t=getComputedStyle(document.documentElement),n={stroke:t.getPropertyValue("--dim"),grid:{stroke:t.getPropertyValue("--line"),width:1},ticks:{show:!1}},{x:s,series:r}=this.chart,o=r.map(l=>e?l.values.map(c=>c>0?c:null):l.values),a={width:this.place.clientWidth,height:yg,scales:{x:{time:!1},y:e?{distr:3,range:(l,c,h)=>My(c,h)}:{}},axes:[{...n,values:(l,c)=>c.map(h=>h>=1e3?`${h/1e3}k`:h)},{...n,size:56,values:(l,c)=>c.map(h=>h==null?"":Is(h))}],series:[{label:"step"},...r.map(({name:l},c)=>({label:l,stroke:this.colour(c),width:1.8,spanGaps:!0,show:!this.hidden.has(l),points:{show:s.length<3}}))],cursor:{drag:{x:!0,y:!1},points:{size:6}},legend:{show:r.length>1,live:!1},hooks:{setCursor:[l=>this.point(l)],setSeries:[(l,c,h)=>c>0&&"show"in h&&this.keep(r[c-1].name,h.show)]}};this.plot=new Nn(a,[s,...o],this.place),this.plot.over.append(this.tip)}colour(e){return this.colours[e%this.colours.length]}keep(e,t){t?this.hidden.delete(e):this.hidden.add(e)}point(e){let{idx:t,left:n}=e.cursor;if(this.tip.hidden=t==null||n<0,this.tip.hidden)return;let s=e.series.slice(1).flatMap((o,a)=>{let l=e.data[a+1][t];return!o.show||l==null?[]:[We("div",{},We("i",{style:`background:${this.colour(a)}`}),`${o.label} ${Is(l,4)}`)]});this.tip.replaceChildren(We("b",{},`step ${Math.round(e.data[0][t])}`),...s);let r=n>e.over.clientWidth/2;Object.assign(this.tip.style,{left:r?"":`${n+12}px`,right:r?`${e.over.clientWidth-n+12}px`:""})}};function My(i,e){if(!(e>0))return[.1,1];let t=Math.ceil(Math.log10(e)-1e-9),n=Math.max(Math.floor(Math.log10(i)+1e-9),t-Sy);return[10**Math.min(n,t-1),10**t]}var Ar={LEFT:0,MIDDLE:1,RIGHT:2,ROTATE:0,DOLLY:1,PAN:2},Rr={ROTATE:0,PAN:1,DOLLY_PAN:2,DOLLY_ROTATE:3},l0=0,Yf=1,c0=2;var ml=1,h0=2,ia=3,bs=0,pi=1,ei=2,to=0,sa=1,Zf=2,Kf=3,$f=4,rh=5;var no=100,u0=101,f0=102,d0=103,p0=104,m0=200,gl=201,g0=202,_0=203,Jf=204,jf=205,x0=206,v0=207,y0=208,S0=209,M0=210,b0=211,w0=212,E0=213,T0=214,Uc=0,Oc=1,Fc=2,Go=3,Bc=4,kc=5,zc=6,Hc=7,Qf=0,A0=1,R0=2,Wi=0,_l=1,ed=2,td=3,nd=4,id=5,xl=6,vl=7,Uf="attached",C0="detached",sd=300,io=301,ra=302,oa=303,oh=304,Mr=1e3,gi=1001,Vo=1002,En=1003,ah=1004;var so=1005;var Xt=1006,aa=1007;var Ni=1008;var ti=1009,rd=1010,od=1011,la=1012,lh=1013,as=1014,Pn=1015,hn=1016,ch=1017,hh=1018,ro=1020,ad=35902,ld=35899,cd=1021,hd=1022,un=1023,Hs=1026,Qs=1027,er=1028,uh=1029,yi=1030,fh=1031;var dh=1033,yl=33776,Sl=33777,Ml=33778,bl=33779,ph=35840,mh=35841,gh=35842,_h=35843,xh=36196,vh=37492,yh=37496,Sh=37488,Mh=37489,wl=37490,bh=37491,wh=37808,Eh=37809,Th=37810,Ah=37811,Rh=37812,Ch=37813,Ih=37814,Ph=37815,Lh=37816,Dh=37817,Nh=37818,Uh=37819,Oh=37820,Fh=37821,Bh=36492,kh=36494,zh=36495,Hh=36283,Gh=36284,El=36285,Vh=36286;var qr=2300,Yr=2301,Dc=2302,Of=2303,Ff=2400,Bf=2401,kf=2402,I0=2500;var ud=0,Tl=1,ca=2,P0=3200;var Wh=0,L0=1,tr="",Un="srgb",cn="srgb-linear",Ya="linear",qt="srgb";var Nc=7680;var D0=519,N0=512,U0=513,O0=514,fd=515,F0=516,B0=517,dd=518,pd=519,md=35044;var gd="300 es",Gi=2e3,Wo=2001;function by(i){for(let e=i.length-1;e>=0;--e)if(i[e]>=65535)return!0;return!1}function wy(i){return ArrayBuffer.isView(i)&&!(i instanceof DataView)}function Xo(i){return document.createElementNS("http://www.w3.org/1999/xhtml",i)}function k0(){let i=Xo("canvas");return i.style.display="block",i}var Mg={},qo=null;function Za(...i){let e="THREE."+i.shift();qo?qo("log",e,...i):console.log(e,...i)}function z0(i){let e=i[0];if(typeof e=="string"&&e.startsWith("TSL:")){let t=i[1];t&&t.isStackTrace?i[0]+=" "+t.getLocation():i[1]='Stack trace not available. Enable "THREE.Node.captureStackTrace" to capture stack traces.'}return i}function nt(...i){i=z0(i);let e="THREE."+i.shift();if(qo)qo("warn",e,...i);else{let t=i[0];t&&t.isStackTrace?console.warn(t.getError(e)):console.warn(e,...i)}}function gt(...i){i=z0(i);let e="THREE."+i.shift();if(qo)qo("error",e,...i);else{let t=i[0];t&&t.isStackTrace?console.error(t.getError(e)):console.error(e,...i)}}function Xr(...i){let e=i.join(" ");e in Mg||(Mg[e]=!0,nt(...i))}function H0(i,e,t){return new Promise(function(n,s){function r(){switch(i.clientWaitSync(e,i.SYNC_FLUSH_COMMANDS_BIT,0)){case i.WAIT_FAILED:s();break;case i.TIMEOUT_EXPIRED:setTimeout(r,t);break;default:n()}}setTimeout(r,t)})}var G0={[Uc]:Uc,[Fc]:zc,[Bc]:Bc,[Go]:kc,[Oc]:Oc,[zc]:Fc,[Hc]:Hc,[kc]:Go},rs=class{addEventListener(e,t){this._listeners===void 0&&(this._listeners={});let n=this._listeners;n[e]===void 0&&(n[e]=[]),n[e].indexOf(t)===-1&&n[e].push(t)}hasEventListener(e,t){let n=this._listeners;return n===void 0?!1:n[e]!==void 0&&n[e].indexOf(t)!==-1}removeEventListener(e,t){let n=this._listeners;if(n===void 0)return;let s=n[e];if(s!==void 0){let r=s.indexOf(t);r!==-1&&s.splice(r,1)}}dispatchEvent(e){let t=this._listeners;if(t===void 0)return;let n=t[e.type];if(n!==void 0){e.target=this;let s=n.slice(0);for(let r=0,o=s.length;r<o;r++)s[r].call(this,e);e.target=null}}},Jn=["00","01","02","03","04","05","06","07","08","09","0a","0b","0c","0d","0e","0f","10","11","12","13","14","15","16","17","18","19","1a","1b","1c","1d","1e","1f","20","21","22","23","24","25","26","27","28","29","2a","2b","2c","2d","2e","2f","30","31","32","33","34","35","36","37","38","39","3a","3b","3c","3d","3e","3f","40","41","42","43","44","45","46","47","48","49","4a","4b","4c","4d","4e","4f","50","51","52","53","54","55","56","57","58","59","5a","5b","5c","5d","5e","5f","60","61","62","63","64","65","66","67","68","69","6a","6b","6c","6d","6e","6f","70","71","72","73","74","75","76","77","78","79","7a","7b","7c","7d","7e","7f","80","81","82","83","84","85","86","87","88","89","8a","8b","8c","8d","8e","8f","90","91","92","93","94","95","96","97","98","99","9a","9b","9c","9d","9e","9f","a0","a1","a2","a3","a4","a5","a6","a7","a8","a9","aa","ab","ac","ad","ae","af","b0","b1","b2","b3","b4","b5","b6","b7","b8","b9","ba","bb","bc","bd","be","bf","c0","c1","c2","c3","c4","c5","c6","c7","c8","c9","ca","cb","cc","cd","ce","cf","d0","d1","d2","d3","d4","d5","d6","d7","d8","d9","da","db","dc","dd","de","df","e0","e1","e2","e3","e4","e5","e6","e7","e8","e9","ea","eb","ec","ed","ee","ef","f0","f1","f2","f3","f4","f5","f6","f7","f8","f9","fa","fb","fc","fd","fe","ff"],bg=1234567,Xa=Math.PI/180,Zr=180/Math.PI;function ws(){let i=Math.random()*4294967295|0,e=Math.random()*4294967295|0,t=Math.random()*4294967295|0,n=Math.random()*4294967295|0;return(Jn[i&255]+Jn[i>>8&255]+Jn[i>>16&255]+Jn[i>>24&255]+"-"+Jn[e&255]+Jn[e>>8&255]+"-"+Jn[e>>16&15|64]+Jn[e>>24&255]+"-"+Jn[t&63|128]+Jn[t>>8&255]+"-"+Jn[t>>16&255]+Jn[t>>24&255]+Jn[n&255]+Jn[n>>8&255]+Jn[n>>16&255]+Jn[n>>24&255]).toLowerCase()}function Rt(i,e,t){return Math.max(e,Math.min(t,i))}function _d(i,e){return(i%e+e)%e}function Ey(i,e,t,n,s){return n+(i-e)*(s-n)/(t-e)}function Ty(i,e,t){return i!==e?(t-i)/(e-i):0}function qa(i,e,t){return(1-t)*i+t*e}function Ay(i,e,t,n){return qa(i,e,1-Math.exp(-t*n))}function Ry(i,e=1){return e-Math.abs(_d(i,e*2)-e)}function Cy(i,e,t){return i<=e?0:i>=t?1:(i=(i-e)/(t-e),i*i*(3-2*i))}function Iy(i,e,t){return i<=e?0:i>=t?1:(i=(i-e)/(t-e),i*i*i*(i*(i*6-15)+10))}function Py(i,e){return i+Math.floor(Math.random()*(e-i+1))}function Ly(i,e){return i+Math.random()*(e-i)}function Dy(i){return i*(.5-Math.random())}function Ny(i){i!==void 0&&(bg=i);let e=bg+=1831565813;return e=Math.imul(e^e>>>15,e|1),e^=e+Math.imul(e^e>>>7,e|61),((e^e>>>14)>>>0)/4294967296}function Uy(i){return i*Xa}function Oy(i){return i*Zr}function Fy(i){return i>0&&Number.isInteger(i)&&2**Math.round(Math.log2(i))===i}function By(i){return Math.pow(2,Math.ceil(Math.log(i)/Math.LN2))}function xd(i){return Math.pow(2,Math.floor(Math.log(i)/Math.LN2))}function ky(i,e,t,n,s){let r=Math.cos,o=Math.sin,a=r(t/2),l=o(t/2),c=r((e+n)/2),h=o((e+n)/2),u=r((e-n)/2),f=o((e-n)/2),p=r((n-e)/2),x=o((n-e)/2);switch(s){case"XYX":i.set(a*h,l*u,l*f,a*c);break;case"YZY":i.set(l*f,a*h,l*u,a*c);break;case"ZXZ":i.set(l*u,l*f,a*h,a*c);break;case"XZX":i.set(a*h,l*x,l*p,a*c);break;case"YXY":i.set(l*p,a*h,l*x,a*c);break;case"ZYZ":i.set(l*x,l*p,a*h,a*c);break;default:nt("MathUtils: .setQuaternionFromProperEuler() encountered an unknown order: "+s)}}function Xh(i){switch(i.constructor){case Uint32Array:return 4294967295;case Uint16Array:return 65535;case Uint8Array:case Uint8ClampedArray:return 255;case Int32Array:return 2147483647;case Int16Array:return 32767;case Int8Array:return 127;default:return}}function vd(i,e){if(e.constructor===Float32Array)return i;let t=Xh(e);if(t===void 0)throw new Error("THREE.MathUtils: Invalid component type.");return Math.max(i/t,-1)}function yd(i,e){if(e.constructor===Float32Array)return i;let t=Xh(e);if(t===void 0)throw new Error("THREE.MathUtils: Invalid component type.");return Math.round(i*t)}var ha={DEG2RAD:Xa,RAD2DEG:Zr,generateUUID:ws,clamp:Rt,euclideanModulo:_d,mapLinear:Ey,inverseLerp:Ty,lerp:qa,damp:Ay,pingpong:Ry,smoothstep:Cy,smootherstep:Iy,randInt:Py,randFloat:Ly,randFloatSpread:Dy,seededRandom:Ny,degToRad:Uy,radToDeg:Oy,isPowerOfTwo:Fy,ceilPowerOfTwo:By,floorPowerOfTwo:xd,setQuaternionFromProperEuler:ky,normalize:yd,denormalize:vd},lt=class{static{this.prototype.isVector2=!0}constructor(e=0,t=0){this.x=e,this.y=t}get width(){return this.x}set width(e){this.x=e}get height(){return this.y}set height(e){this.y=e}set(e,t){return this.x=e,this.y=t,this}setScalar(e){return this.x=e,this.y=e,this}setX(e){return this.x=e,this}setY(e){return this.y=e,this}setComponent(e,t){switch(e){case 0:this.x=t;break;case 1:this.y=t;break;default:throw new Error("THREE.Vector2: index is out of range: "+e)}return this}getComponent(e){switch(e){case 0:return this.x;case 1:return this.y;default:throw new Error("THREE.Vector2: index is out of range: "+e)}}clone(){return new this.constructor(this.x,this.y)}copy(e){return this.x=e.x,this.y=e.y,this}add(e){return this.x+=e.x,this.y+=e.y,this}addScalar(e){return this.x+=e,this.y+=e,this}addVectors(e,t){return this.x=e.x+t.x,this.y=e.y+t.y,this}addScaledVector(e,t){return this.x+=e.x*t,this.y+=e.y*t,this}sub(e){return this.x-=e.x,this.y-=e.y,this}subScalar(e){return this.x-=e,this.y-=e,this}subVectors(e,t){return this.x=e.x-t.x,this.y=e.y-t.y,this}multiply(e){return this.x*=e.x,this.y*=e.y,this}multiplyScalar(e){return this.x*=e,this.y*=e,this}divide(e){return this.x/=e.x,this.y/=e.y,this}divideScalar(e){return this.multiplyScalar(1/e)}applyMatrix3(e){let t=this.x,n=this.y,s=e.elements;return this.x=s[0]*t+s[3]*n+s[6],this.y=s[1]*t+s[4]*n+s[7],this}min(e){return this.x=Math.min(this.x,e.x),this.y=Math.min(this.y,e.y),this}max(e){return this.x=Math.max(this.x,e.x),this.y=Math.max(this.y,e.y),this}clamp(e,t){return this.x=Rt(this.x,e.x,t.x),this.y=Rt(this.y,e.y,t.y),this}clampScalar(e,t){return this.x=Rt(this.x,e,t),this.y=Rt(this.y,e,t),this}clampLength(e,t){let n=this.length();return this.divideScalar(n||1).multiplyScalar(Rt(n,e,t))}floor(){return this.x=Math.floor(this.x),this.y=Math.floor(this.y),this}ceil(){return this.x=Math.ceil(this.x),this.y=Math.ceil(this.y),this}round(){return this.x=Math.round(this.x),this.y=Math.round(this.y),this}roundToZero(){return this.x=Math.trunc(this.x),this.y=Math.trunc(this.y),this}negate(){return this.x=-this.x,this.y=-this.y,this}dot(e){return this.x*e.x+this.y*e.y}cross(e){return this.x*e.y-this.y*e.x}lengthSq(){return this.x*this.x+this.y*this.y}length(){return Math.sqrt(this.x*this.x+this.y*this.y)}manhattanLength(){return Math.abs(this.x)+Math.abs(this.y)}normalize(){return this.divideScalar(this.length()||1)}angle(){return Math.atan2(-this.y,-this.x)+Math.PI}angleTo(e){let t=Math.sqrt(this.lengthSq()*e.lengthSq());if(t===0)return Math.PI/2;let n=this.dot(e)/t;return Math.acos(Rt(n,-1,1))}distanceTo(e){return Math.sqrt(this.distanceToSquared(e))}distanceToSquared(e){let t=this.x-e.x,n=this.y-e.y;return t*t+n*n}manhattanDistanceTo(e){return Math.abs(this.x-e.x)+Math.abs(this.y-e.y)}setLength(e){return this.normalize().multiplyScalar(e)}lerp(e,t){return this.x+=(e.x-this.x)*t,this.y+=(e.y-this.y)*t,this}lerpVectors(e,t,n){return this.x=e.x+(t.x-e.x)*n,this.y=e.y+(t.y-e.y)*n,this}equals(e){return e.x===this.x&&e.y===this.y}fromArray(e,t=0){return this.x=e[t],this.y=e[t+1],this}toArray(e=[],t=0){return e[t]=this.x,e[t+1]=this.y,e}fromBufferAttribute(e,t){return this.x=e.getX(t),this.y=e.getY(t),this}rotateAround(e,t){let n=Math.cos(t),s=Math.sin(t),r=this.x-e.x,o=this.y-e.y;return this.x=r*n-o*s+e.x,this.y=r*s+o*n+e.y,this}random(){return this.x=Math.random(),this.y=Math.random(),this}*[Symbol.iterator](){yield this.x,yield this.y}},qn=class{constructor(e=0,t=0,n=0,s=1){this.isQuaternion=!0,this._x=e,this._y=t,this._z=n,this._w=s}static slerpFlat(e,t,n,s,r,o,a){let l=n[s+0],c=n[s+1],h=n[s+2],u=n[s+3],f=r[o+0],p=r[o+1],x=r[o+2],M=r[o+3];if(u!==M||l!==f||c!==p||h!==x){let g=l*f+c*p+h*x+u*M;g<0&&(f=-f,p=-p,x=-x,M=-M,g=-g);let _=1-a;if(g<.9995){let b=Math.acos(g),P=Math.sin(b);_=Math.sin(_*b)/P,a=Math.sin(a*b)/P,l=l*_+f*a,c=c*_+p*a,h=h*_+x*a,u=u*_+M*a}else{l=l*_+f*a,c=c*_+p*a,h=h*_+x*a,u=u*_+M*a;let b=1/Math.sqrt(l*l+c*c+h*h+u*u);l*=b,c*=b,h*=b,u*=b}}e[t]=l,e[t+1]=c,e[t+2]=h,e[t+3]=u}static multiplyQuaternionsFlat(e,t,n,s,r,o){let a=n[s],l=n[s+1],c=n[s+2],h=n[s+3],u=r[o],f=r[o+1],p=r[o+2],x=r[o+3];return e[t]=a*x+h*u+l*p-c*f,e[t+1]=l*x+h*f+c*u-a*p,e[t+2]=c*x+h*p+a*f-l*u,e[t+3]=h*x-a*u-l*f-c*p,e}get x(){return this._x}set x(e){this._x=e,this._onChangeCallback()}get y(){return this._y}set y(e){this._y=e,this._onChangeCallback()}get z(){return this._z}set z(e){this._z=e,this._onChangeCallback()}get w(){return this._w}set w(e){this._w=e,this._onChangeCallback()}set(e,t,n,s){return this._x=e,this._y=t,this._z=n,this._w=s,this._onChangeCallback(),this}clone(){return new this.constructor(this._x,this._y,this._z,this._w)}copy(e){return this._x=e.x,this._y=e.y,this._z=e.z,this._w=e.w,this._onChangeCallback(),this}setFromEuler(e,t=!0){let n=e._x,s=e._y,r=e._z,o=e._order,a=Math.cos,l=Math.sin,c=a(n/2),h=a(s/2),u=a(r/2),f=l(n/2),p=l(s/2),x=l(r/2);switch(o){case"XYZ":this._x=f*h*u+c*p*x,this._y=c*p*u-f*h*x,this._z=c*h*x+f*p*u,this._w=c*h*u-f*p*x;break;case"YXZ":this._x=f*h*u+c*p*x,this._y=c*p*u-f*h*x,this._z=c*h*x-f*p*u,this._w=c*h*u+f*p*x;break;case"ZXY":this._x=f*h*u-c*p*x,this._y=c*p*u+f*h*x,this._z=c*h*x+f*p*u,this._w=c*h*u-f*p*x;break;case"ZYX":this._x=f*h*u-c*p*x,this._y=c*p*u+f*h*x,this._z=c*h*x-f*p*u,this._w=c*h*u+f*p*x;break;case"YZX":this._x=f*h*u+c*p*x,this._y=c*p*u+f*h*x,this._z=c*h*x-f*p*u,this._w=c*h*u-f*p*x;break;case"XZY":this._x=f*h*u-c*p*x,this._y=c*p*u-f*h*x,this._z=c*h*x+f*p*u,this._w=c*h*u+f*p*x;break;default:nt("Quaternion: .setFromEuler() encountered an unknown order: "+o)}return t===!0&&this._onChangeCallback(),this}setFromAxisAngle(e,t){let n=t/2,s=Math.sin(n);return this._x=e.x*s,this._y=e.y*s,this._z=e.z*s,this._w=Math.cos(n),this._onChangeCallback(),this}setFromRotationMatrix(e){let t=e.elements,n=t[0],s=t[4],r=t[8],o=t[1],a=t[5],l=t[9],c=t[2],h=t[6],u=t[10],f=n+a+u;if(f>0){let p=.5/Math.sqrt(f+1);this._w=.25/p,this._x=(h-l)*p,this._y=(r-c)*p,this._z=(o-s)*p}else if(n>a&&n>u){let p=2*Math.sqrt(1+n-a-u);this._w=(h-l)/p,this._x=.25*p,this._y=(s+o)/p,this._z=(r+c)/p}else if(a>u){let p=2*Math.sqrt(1+a-n-u);this._w=(r-c)/p,this._x=(s+o)/p,this._y=.25*p,this._z=(l+h)/p}else{let p=2*Math.sqrt(1+u-n-a);this._w=(o-s)/p,this._x=(r+c)/p,this._y=(l+h)/p,this._z=.25*p}return this._onChangeCallback(),this}setFromUnitVectors(e,t){let n=e.dot(t)+1;return n<1e-8?(n=0,Math.abs(e.x)>Math.abs(e.z)?(this._x=-e.y,this._y=e.x,this._z=0,this._w=n):(this._x=0,this._y=-e.z,this._z=e.y,this._w=n)):(this._x=e.y*t.z-e.z*t.y,this._y=e.z*t.x-e.x*t.z,this._z=e.x*t.y-e.y*t.x,this._w=n),this.normalize()}angleTo(e){return 2*Math.acos(Math.abs(Rt(this.dot(e),-1,1)))}rotateTowards(e,t){let n=this.angleTo(e);if(n===0)return this;let s=Math.min(1,t/n);return this.slerp(e,s),this}identity(){return this.set(0,0,0,1)}invert(){return this.conjugate()}conjugate(){return this._x*=-1,this._y*=-1,this._z*=-1,this._onChangeCallback(),this}dot(e){return this._x*e._x+this._y*e._y+this._z*e._z+this._w*e._w}lengthSq(){return this._x*this._x+this._y*this._y+this._z*this._z+this._w*this._w}length(){return Math.sqrt(this._x*this._x+this._y*this._y+this._z*this._z+this._w*this._w)}normalize(){let e=this.length();return e===0?(this._x=0,this._y=0,this._z=0,this._w=1):(e=1/e,this._x=this._x*e,this._y=this._y*e,this._z=this._z*e,this._w=this._w*e),this._onChangeCallback(),this}multiply(e){return this.multiplyQuaternions(this,e)}premultiply(e){return this.multiplyQuaternions(e,this)}multiplyQuaternions(e,t){let n=e._x,s=e._y,r=e._z,o=e._w,a=t._x,l=t._y,c=t._z,h=t._w;return this._x=n*h+o*a+s*c-r*l,this._y=s*h+o*l+r*a-n*c,this._z=r*h+o*c+n*l-s*a,this._w=o*h-n*a-s*l-r*c,this._onChangeCallback(),this}slerp(e,t){let n=e._x,s=e._y,r=e._z,o=e._w,a=this.dot(e);a<0&&(n=-n,s=-s,r=-r,o=-o,a=-a);let l=1-t;if(a<.9995){let c=Math.acos(a),h=Math.sin(c);l=Math.sin(l*c)/h,t=Math.sin(t*c)/h,this._x=this._x*l+n*t,this._y=this._y*l+s*t,this._z=this._z*l+r*t,this._w=this._w*l+o*t,this._onChangeCallback()}else this._x=this._x*l+n*t,this._y=this._y*l+s*t,this._z=this._z*l+r*t,this._w=this._w*l+o*t,this.normalize();return this}slerpQuaternions(e,t,n){return this.copy(e).slerp(t,n)}random(){let e=2*Math.PI*Math.random(),t=2*Math.PI*Math.random(),n=Math.random(),s=Math.sqrt(1-n),r=Math.sqrt(n);return this.set(s*Math.sin(e),s*Math.cos(e),r*Math.sin(t),r*Math.cos(t))}equals(e){return e._x===this._x&&e._y===this._y&&e._z===this._z&&e._w===this._w}fromArray(e,t=0){return this._x=e[t],this._y=e[t+1],this._z=e[t+2],this._w=e[t+3],this._onChangeCallback(),this}toArray(e=[],t=0){return e[t]=this._x,e[t+1]=this._y,e[t+2]=this._z,e[t+3]=this._w,e}fromBufferAttribute(e,t){return this._x=e.getX(t),this._y=e.getY(t),this._z=e.getZ(t),this._w=e.getW(t),this._onChangeCallback(),this}toJSON(){return this.toArray()}_onChange(e){return this._onChangeCallback=e,this}_onChangeCallback(){}*[Symbol.iterator](){yield this._x,yield this._y,yield this._z,yield this._w}},Q=class{static{this.prototype.isVector3=!0}constructor(e=0,t=0,n=0){this.x=e,this.y=t,this.z=n}set(e,t,n){return n===void 0&&(n=this.z),this.x=e,this.y=t,this.z=n,this}setScalar(e){return this.x=e,this.y=e,this.z=e,this}setX(e){return this.x=e,this}setY(e){return this.y=e,this}setZ(e){return this.z=e,this}setComponent(e,t){switch(e){case 0:this.x=t;break;case 1:this.y=t;break;case 2:this.z=t;break;default:throw new Error("THREE.Vector3: index is out of range: "+e)}return this}getComponent(e){switch(e){case 0:return this.x;case 1:return this.y;case 2:return this.z;default:throw new Error("THREE.Vector3: index is out of range: "+e)}}clone(){return new this.constructor(this.x,this.y,this.z)}copy(e){return this.x=e.x,this.y=e.y,this.z=e.z,this}add(e){return this.x+=e.x,this.y+=e.y,this.z+=e.z,this}addScalar(e){return this.x+=e,this.y+=e,this.z+=e,this}addVectors(e,t){return this.x=e.x+t.x,this.y=e.y+t.y,this.z=e.z+t.z,this}addScaledVector(e,t){return this.x+=e.x*t,this.y+=e.y*t,this.z+=e.z*t,this}sub(e){return this.x-=e.x,this.y-=e.y,this.z-=e.z,this}subScalar(e){return this.x-=e,this.y-=e,this.z-=e,this}subVectors(e,t){return this.x=e.x-t.x,this.y=e.y-t.y,this.z=e.z-t.z,this}multiply(e){return this.x*=e.x,this.y*=e.y,this.z*=e.z,this}multiplyScalar(e){return this.x*=e,this.y*=e,this.z*=e,this}multiplyVectors(e,t){return this.x=e.x*t.x,this.y=e.y*t.y,this.z=e.z*t.z,this}applyEuler(e){return this.applyQuaternion(wg.setFromEuler(e))}applyAxisAngle(e,t){return this.applyQuaternion(wg.setFromAxisAngle(e,t))}applyMatrix3(e){let t=this.x,n=this.y,s=this.z,r=e.elements;return this.x=r[0]*t+r[3]*n+r[6]*s,this.y=r[1]*t+r[4]*n+r[7]*s,this.z=r[2]*t+r[5]*n+r[8]*s,this}applyNormalMatrix(e){return this.applyMatrix3(e).normalize()}applyMatrix4(e){let t=this.x,n=this.y,s=this.z,r=e.elements,o=1/(r[3]*t+r[7]*n+r[11]*s+r[15]);return this.x=(r[0]*t+r[4]*n+r[8]*s+r[12])*o,this.y=(r[1]*t+r[5]*n+r[9]*s+r[13])*o,this.z=(r[2]*t+r[6]*n+r[10]*s+r[14])*o,this}applyQuaternion(e){let t=this.x,n=this.y,s=this.z,r=e.x,o=e.y,a=e.z,l=e.w,c=2*(o*s-a*n),h=2*(a*t-r*s),u=2*(r*n-o*t);return this.x=t+l*c+o*u-a*h,this.y=n+l*h+a*c-r*u,this.z=s+l*u+r*h-o*c,this}project(e){return this.applyMatrix4(e.matrixWorldInverse).applyMatrix4(e.projectionMatrix)}unproject(e){return this.applyMatrix4(e.projectionMatrixInverse).applyMatrix4(e.matrixWorld)}transformDirection(e){let t=this.x,n=this.y,s=this.z,r=e.elements;return this.x=r[0]*t+r[4]*n+r[8]*s,this.y=r[1]*t+r[5]*n+r[9]*s,this.z=r[2]*t+r[6]*n+r[10]*s,this.normalize()}divide(e){return this.x/=e.x,this.y/=e.y,this.z/=e.z,this}divideScalar(e){return this.multiplyScalar(1/e)}min(e){return this.x=Math.min(this.x,e.x),this.y=Math.min(this.y,e.y),this.z=Math.min(this.z,e.z),this}max(e){return this.x=Math.max(this.x,e.x),this.y=Math.max(this.y,e.y),this.z=Math.max(this.z,e.z),this}clamp(e,t){return this.x=Rt(this.x,e.x,t.x),this.y=Rt(this.y,e.y,t.y),this.z=Rt(this.z,e.z,t.z),this}clampScalar(e,t){return this.x=Rt(this.x,e,t),this.y=Rt(this.y,e,t),this.z=Rt(this.z,e,t),this}clampLength(e,t){let n=this.length();return this.divideScalar(n||1).multiplyScalar(Rt(n,e,t))}floor(){return this.x=Math.floor(this.x),this.y=Math.floor(this.y),this.z=Math.floor(this.z),this}ceil(){return this.x=Math.ceil(this.x),this.y=Math.ceil(this.y),this.z=Math.ceil(this.z),this}round(){return this.x=Math.round(this.x),this.y=Math.round(this.y),this.z=Math.round(this.z),this}roundToZero(){return this.x=Math.trunc(this.x),this.y=Math.trunc(this.y),this.z=Math.trunc(this.z),this}negate(){return this.x=-this.x,this.y=-this.y,this.z=-this.z,this}dot(e){return this.x*e.x+this.y*e.y+this.z*e.z}lengthSq(){return this.x*this.x+this.y*this.y+this.z*this.z}length(){return Math.sqrt(this.x*this.x+this.y*this.y+this.z*this.z)}manhattanLength(){return Math.abs(this.x)+Math.abs(this.y)+Math.abs(this.z)}normalize(){return this.divideScalar(this.length()||1)}setLength(e){return this.normalize().multiplyScalar(e)}lerp(e,t){return this.x+=(e.x-this.x)*t,this.y+=(e.y-this.y)*t,this.z+=(e.z-this.z)*t,this}lerpVectors(e,t,n){return this.x=e.x+(t.x-e.x)*n,this.y=e.y+(t.y-e.y)*n,this.z=e.z+(t.z-e.z)*n,this}cross(e){return this.crossVectors(this,e)}crossVectors(e,t){let n=e.x,s=e.y,r=e.z,o=t.x,a=t.y,l=t.z;return this.x=s*l-r*a,this.y=r*o-n*l,this.z=n*a-s*o,this}projectOnVector(e){let t=e.lengthSq();if(t===0)return this.set(0,0,0);let n=e.dot(this)/t;return this.copy(e).multiplyScalar(n)}projectOnPlane(e){return uf.copy(this).projectOnVector(e),this.sub(uf)}reflect(e){return this.sub(uf.copy(e).multiplyScalar(2*this.dot(e)))}angleTo(e){let t=Math.sqrt(this.lengthSq()*e.lengthSq());if(t===0)return Math.PI/2;let n=this.dot(e)/t;return Math.acos(Rt(n,-1,1))}distanceTo(e){return Math.sqrt(this.distanceToSquared(e))}distanceToSquared(e){let t=this.x-e.x,n=this.y-e.y,s=this.z-e.z;return t*t+n*n+s*s}manhattanDistanceTo(e){return Math.abs(this.x-e.x)+Math.abs(this.y-e.y)+Math.abs(this.z-e.z)}setFromSpherical(e){return this.setFromSphericalCoords(e.radius,e.phi,e.theta)}setFromSphericalCoords(e,t,n){let s=Math.sin(t)*e;return this.x=s*Math.sin(n),this.y=Math.cos(t)*e,this.z=s*Math.cos(n),this}setFromCylindrical(e){return this.setFromCylindricalCoords(e.radius,e.theta,e.y)}setFromCylindricalCoords(e,t,n){return this.x=e*Math.sin(t),this.y=n,this.z=e*Math.cos(t),this}setFromMatrixPosition(e){let t=e.elements;return this.x=t[12],this.y=t[13],this.z=t[14],this}setFromMatrixScale(e){let t=this.setFromMatrixColumn(e,0).length(),n=this.setFromMatrixColumn(e,1).length(),s=this.setFromMatrixColumn(e,2).length();return this.x=t,this.y=n,this.z=s,this}setFromMatrixColumn(e,t){return this.fromArray(e.elements,t*4)}setFromMatrix3Column(e,t){return this.fromArray(e.elements,t*3)}setFromEuler(e){return this.x=e._x,this.y=e._y,this.z=e._z,this}setFromColor(e){return this.x=e.r,this.y=e.g,this.z=e.b,this}equals(e){return e.x===this.x&&e.y===this.y&&e.z===this.z}fromArray(e,t=0){return this.x=e[t],this.y=e[t+1],this.z=e[t+2],this}toArray(e=[],t=0){return e[t]=this.x,e[t+1]=this.y,e[t+2]=this.z,e}fromBufferAttribute(e,t){return this.x=e.getX(t),this.y=e.getY(t),this.z=e.getZ(t),this}random(){return this.x=Math.random(),this.y=Math.random(),this.z=Math.random(),this}randomDirection(){let e=Math.random()*Math.PI*2,t=Math.random()*2-1,n=Math.sqrt(1-t*t);return this.x=n*Math.cos(e),this.y=t,this.z=n*Math.sin(e),this}*[Symbol.iterator](){yield this.x,yield this.y,yield this.z}},uf=new Q,wg=new qn,yt=class{static{this.prototype.isMatrix3=!0}constructor(e,t,n,s,r,o,a,l,c){this.elements=[1,0,0,0,1,0,0,0,1],e!==void 0&&this.set(e,t,n,s,r,o,a,l,c)}set(e,t,n,s,r,o,a,l,c){let h=this.elements;return h[0]=e,h[1]=s,h[2]=a,h[3]=t,h[4]=r,h[5]=l,h[6]=n,h[7]=o,h[8]=c,this}identity(){return this.set(1,0,0,0,1,0,0,0,1),this}copy(e){let t=this.elements,n=e.elements;return t[0]=n[0],t[1]=n[1],t[2]=n[2],t[3]=n[3],t[4]=n[4],t[5]=n[5],t[6]=n[6],t[7]=n[7],t[8]=n[8],this}extractBasis(e,t,n){return e.setFromMatrix3Column(this,0),t.setFromMatrix3Column(this,1),n.setFromMatrix3Column(this,2),this}setFromMatrix4(e){let t=e.elements;return this.set(t[0],t[4],t[8],t[1],t[5],t[9],t[2],t[6],t[10]),this}multiply(e){return this.multiplyMatrices(this,e)}premultiply(e){return this.multiplyMatrices(e,this)}multiplyMatrices(e,t){let n=e.elements,s=t.elements,r=this.elements,o=n[0],a=n[3],l=n[6],c=n[1],h=n[4],u=n[7],f=n[2],p=n[5],x=n[8],M=s[0],g=s[3],_=s[6],b=s[1],P=s[4],w=s[7],D=s[2],I=s[5],y=s[8];return r[0]=o*M+a*b+l*D,r[3]=o*g+a*P+l*I,r[6]=o*_+a*w+l*y,r[1]=c*M+h*b+u*D,r[4]=c*g+h*P+u*I,r[7]=c*_+h*w+u*y,r[2]=f*M+p*b+x*D,r[5]=f*g+p*P+x*I,r[8]=f*_+p*w+x*y,this}multiplyScalar(e){let t=this.elements;return t[0]*=e,t[3]*=e,t[6]*=e,t[1]*=e,t[4]*=e,t[7]*=e,t[2]*=e,t[5]*=e,t[8]*=e,this}determinant(){let e=this.elements,t=e[0],n=e[1],s=e[2],r=e[3],o=e[4],a=e[5],l=e[6],c=e[7],h=e[8];return t*o*h-t*a*c-n*r*h+n*a*l+s*r*c-s*o*l}invert(){let e=this.elements,t=e[0],n=e[1],s=e[2],r=e[3],o=e[4],a=e[5],l=e[6],c=e[7],h=e[8],u=h*o-a*c,f=a*l-h*r,p=c*r-o*l,x=t*u+n*f+s*p;if(x===0)return this.set(0,0,0,0,0,0,0,0,0);let M=1/x;return e[0]=u*M,e[1]=(s*c-h*n)*M,e[2]=(a*n-s*o)*M,e[3]=f*M,e[4]=(h*t-s*l)*M,e[5]=(s*r-a*t)*M,e[6]=p*M,e[7]=(n*l-c*t)*M,e[8]=(o*t-n*r)*M,this}transpose(){let e,t=this.elements;return e=t[1],t[1]=t[3],t[3]=e,e=t[2],t[2]=t[6],t[6]=e,e=t[5],t[5]=t[7],t[7]=e,this}getNormalMatrix(e){return this.setFromMatrix4(e).invert().transpose()}transposeIntoArray(e){let t=this.elements;return e[0]=t[0],e[1]=t[3],e[2]=t[6],e[3]=t[1],e[4]=t[4],e[5]=t[7],e[6]=t[2],e[7]=t[5],e[8]=t[8],this}setUvTransform(e,t,n,s,r,o,a){let l=Math.cos(r),c=Math.sin(r);return this.set(n*l,n*c,-n*(l*o+c*a)+o+e,-s*c,s*l,-s*(-c*o+l*a)+a+t,0,0,1),this}scale(e,t){return Xr("Matrix3: .scale() is deprecated. Use .makeScale() instead."),this.premultiply(ff.makeScale(e,t)),this}rotate(e){return Xr("Matrix3: .rotate() is deprecated. Use .makeRotation() instead."),this.premultiply(ff.makeRotation(-e)),this}translate(e,t){return Xr("Matrix3: .translate() is deprecated. Use .makeTranslation() instead."),this.premultiply(ff.makeTranslation(e,t)),this}makeTranslation(e,t){return e.isVector2?this.set(1,0,e.x,0,1,e.y,0,0,1):this.set(1,0,e,0,1,t,0,0,1),this}makeRotation(e){let t=Math.cos(e),n=Math.sin(e);return this.set(t,-n,0,n,t,0,0,0,1),this}makeScale(e,t){return this.set(e,0,0,0,t,0,0,0,1),this}equals(e){let t=this.elements,n=e.elements;for(let s=0;s<9;s++)if(t[s]!==n[s])return!1;return!0}fromArray(e,t=0){for(let n=0;n<9;n++)this.elements[n]=e[n+t];return this}toArray(e=[],t=0){let n=this.elements;return e[t]=n[0],e[t+1]=n[1],e[t+2]=n[2],e[t+3]=n[3],e[t+4]=n[4],e[t+5]=n[5],e[t+6]=n[6],e[t+7]=n[7],e[t+8]=n[8],e}clone(){return new this.constructor().fromArray(this.elements)}},ff=new yt,Eg=new yt().set(.4123908,.3575843,.1804808,.212639,.7151687,.0721923,.0193308,.1191948,.9505322),Tg=new yt().set(3.2409699,-1.5373832,-.4986108,-.9692436,1.8759675,.0415551,.0556301,-.203977,1.0569715);function zy(){let i={enabled:!0,workingColorSpace:cn,spaces:{},convert:function(s,r,o){return this.enabled===!1||r===o||!r||!o||(this.spaces[r].transfer===qt&&(s.r=zs(s.r),s.g=zs(s.g),s.b=zs(s.b)),this.spaces[r].primaries!==this.spaces[o].primaries&&(s.applyMatrix3(this.spaces[r].toXYZ),s.applyMatrix3(this.spaces[o].fromXYZ)),this.spaces[o].transfer===qt&&(s.r=Ho(s.r),s.g=Ho(s.g),s.b=Ho(s.b))),s},workingToColorSpace:function(s,r){return this.convert(s,this.workingColorSpace,r)},colorSpaceToWorking:function(s,r){return this.convert(s,r,this.workingColorSpace)},getPrimaries:function(s){return this.spaces[s].primaries},getTransfer:function(s){return s===tr?Ya:this.spaces[s].transfer},getToneMappingMode:function(s){return this.spaces[s].outputColorSpaceConfig.toneMappingMode||"standard"},getLuminanceCoefficients:function(s,r=this.workingColorSpace){return s.fromArray(this.spaces[r].luminanceCoefficients)},define:function(s){Object.assign(this.spaces,s)},_getMatrix:function(s,r,o){return s.copy(this.spaces[o].fromXYZ).multiply(this.spaces[r].toXYZ)},_getDrawingBufferColorSpace:function(s){return this.spaces[s].outputColorSpaceConfig.drawingBufferColorSpace},_getUnpackColorSpace:function(s=this.workingColorSpace){return this.spaces[s].workingColorSpaceConfig.unpackColorSpace}},e=[.64,.33,.3,.6,.15,.06],t=[.2126,.7152,.0722],n=[.3127,.329];return i.define({[cn]:{primaries:e,whitePoint:n,transfer:Ya,toXYZ:Eg,fromXYZ:Tg,luminanceCoefficients:t,workingColorSpaceConfig:{unpackColorSpace:Un},outputColorSpaceConfig:{drawingBufferColorSpace:Un}},[Un]:{primaries:e,whitePoint:n,transfer:qt,toXYZ:Eg,fromXYZ:Tg,luminanceCoefficients:t,outputColorSpaceConfig:{drawingBufferColorSpace:Un}}}),i}var Ct=zy();function zs(i){return i<.04045?i*.0773993808:Math.pow(i*.9478672986+.0521327014,2.4)}function Ho(i){return i<.0031308?i*12.92:1.055*Math.pow(i,.41666)-.055}var Ao,Gc=class{static getDataURL(e,t="image/png"){if(/^data:/i.test(e.src)||typeof HTMLCanvasElement>"u")return e.src;let n;if(e instanceof HTMLCanvasElement)n=e;else{Ao===void 0&&(Ao=Xo("canvas")),Ao.width=e.width,Ao.height=e.height;let s=Ao.getContext("2d");e instanceof ImageData?s.putImageData(e,0,0):s.drawImage(e,0,0,e.width,e.height),n=Ao}return n.toDataURL(t)}static sRGBToLinear(e){if(typeof HTMLImageElement<"u"&&e instanceof HTMLImageElement||typeof HTMLCanvasElement<"u"&&e instanceof HTMLCanvasElement||typeof ImageBitmap<"u"&&e instanceof ImageBitmap){let t=Xo("canvas");t.width=e.width,t.height=e.height;let n=t.getContext("2d");n.drawImage(e,0,0,e.width,e.height);let s=n.getImageData(0,0,e.width,e.height),r=s.data;for(let o=0;o<r.length;o++)r[o]=zs(r[o]/255)*255;return n.putImageData(s,0,0),t}else if(e.data){let t=e.data.slice(0);for(let n=0;n<t.length;n++)t instanceof Uint8Array||t instanceof Uint8ClampedArray?t[n]=Math.floor(zs(t[n]/255)*255):t[n]=zs(t[n]);return{data:t,width:e.width,height:e.height}}else return nt("ImageUtils.sRGBToLinear(): Unsupported image type. No color space conversion applied."),e}},Hy=0,Yo=class{constructor(e=null){this.isTextureSource=!0,Object.defineProperty(this,"id",{value:Hy++}),this.uuid=ws(),this.data=e,this.dataReady=!0,this.version=0}getSize(e){let t=this.data;return typeof HTMLVideoElement<"u"&&t instanceof HTMLVideoElement?e.set(t.videoWidth,t.videoHeight,0):typeof VideoFrame<"u"&&t instanceof VideoFrame?e.set(t.displayWidth,t.displayHeight,0):t!==null?e.set(t.width||0,t.height||0,t.depth||0):e.set(0,0,0),e}set needsUpdate(e){e===!0&&this.version++}toJSON(e){let t=e===void 0||typeof e=="string";if(!t&&e.images[this.uuid]!==void 0)return e.images[this.uuid];let n={uuid:this.uuid,url:""},s=this.data;if(s!==null){let r;if(Array.isArray(s)){r=[];for(let o=0,a=s.length;o<a;o++)s[o].isDataTexture?r.push(df(s[o].image)):r.push(df(s[o]))}else r=df(s);n.url=r}return t||(e.images[this.uuid]=n),n}};function df(i){return typeof HTMLImageElement<"u"&&i instanceof HTMLImageElement||typeof HTMLCanvasElement<"u"&&i instanceof HTMLCanvasElement||typeof ImageBitmap<"u"&&i instanceof ImageBitmap?Gc.getDataURL(i):i.data?{data:Array.from(i.data),width:i.width,height:i.height,type:i.data.constructor.name}:(nt("Texture: Unable to serialize Texture."),{})}var Gy=0,pf=new Q,Yn=class i extends rs{constructor(e=i.DEFAULT_IMAGE,t=i.DEFAULT_MAPPING,n=gi,s=gi,r=Xt,o=Ni,a=un,l=ti,c=i.DEFAULT_ANISOTROPY,h=tr){super(),this.isTexture=!0,Object.defineProperty(this,"id",{value:Gy++}),this.uuid=ws(),this.name="",this.source=new Yo(e),this.mipmaps=[],this.mapping=t,this.channel=0,this.wrapS=n,this.wrapT=s,this.magFilter=r,this.minFilter=o,this.anisotropy=c,this.format=a,this.internalFormat=null,this.type=l,this.offset=new lt(0,0),this.repeat=new lt(1,1),this.center=new lt(0,0),this.rotation=0,this.matrixAutoUpdate=!0,this.matrix=new yt,this.generateMipmaps=!0,this.mipmapsAutoUpdate=!0,this.premultiplyAlpha=!1,this.flipY=!0,this.unpackAlignment=4,this.colorSpace=h,this.userData={},this.updateRanges=[],this.version=0,this.onUpdate=null,this.renderTarget=null,this.isRenderTargetTexture=!1,this.isArrayTexture=!!(e&&e.depth&&e.depth>1),this.pmremVersion=0,this.isPMREMTexture=!1,this.normalized=!1}get width(){return this.source.getSize(pf).x}get height(){return this.source.getSize(pf).y}get depth(){return this.source.getSize(pf).z}get image(){return this.source.data}set image(e){this.source.data=e}updateMatrix(){this.matrix.setUvTransform(this.offset.x,this.offset.y,this.repeat.x,this.repeat.y,this.rotation,this.center.x,this.center.y)}addUpdateRange(e,t){this.updateRanges.push({start:e,count:t})}clearUpdateRanges(){this.updateRanges.length=0}clone(){return new this.constructor().copy(this)}copy(e){return this.name=e.name,this.source=e.source,this.mipmaps=e.mipmaps.slice(0),this.mapping=e.mapping,this.channel=e.channel,this.wrapS=e.wrapS,this.wrapT=e.wrapT,this.magFilter=e.magFilter,this.minFilter=e.minFilter,this.anisotropy=e.anisotropy,this.format=e.format,this.internalFormat=e.internalFormat,this.type=e.type,this.normalized=e.normalized,this.offset.copy(e.offset),this.repeat.copy(e.repeat),this.center.copy(e.center),this.rotation=e.rotation,this.matrixAutoUpdate=e.matrixAutoUpdate,this.matrix.copy(e.matrix),this.generateMipmaps=e.generateMipmaps,this.mipmapsAutoUpdate=e.mipmapsAutoUpdate,this.premultiplyAlpha=e.premultiplyAlpha,this.flipY=e.flipY,this.unpackAlignment=e.unpackAlignment,this.colorSpace=e.colorSpace,this.renderTarget=e.renderTarget,this.isRenderTargetTexture=e.isRenderTargetTexture,this.isPMREMTexture=e.isPMREMTexture,this.isArrayTexture=e.isArrayTexture,this.userData=JSON.parse(JSON.stringify(e.userData)),this.needsUpdate=!0,this}setValues(e){for(let t in e){let n=e[t];if(n===void 0){nt(`Texture.setValues(): parameter '${t}' has value of undefined.`);continue}let s=this[t];if(s===void 0){nt(`Texture.setValues(): property '${t}' does not exist.`);continue}s&&n&&s.isVector2&&n.isVector2||s&&n&&s.isVector3&&n.isVector3||s&&n&&s.isMatrix3&&n.isMatrix3?s.copy(n):this[t]=n}}toJSON(e){let t=e===void 0||typeof e=="string";if(!t&&e.textures[this.uuid]!==void 0)return e.textures[this.uuid];let n={metadata:{version:4.7,type:"Texture",generator:"Texture.toJSON"},uuid:this.uuid,name:this.name,image:this.source.toJSON(e).uuid,mapping:this.mapping,channel:this.channel,repeat:[this.repeat.x,this.repeat.y],offset:[this.offset.x,this.offset.y],center:[this.center.x,this.center.y],rotation:this.rotation,wrap:[this.wrapS,this.wrapT],format:this.format,internalFormat:this.internalFormat,type:this.type,normalized:this.normalized,colorSpace:this.colorSpace,minFilter:this.minFilter,magFilter:this.magFilter,anisotropy:this.anisotropy,flipY:this.flipY,generateMipmaps:this.generateMipmaps,mipmapsAutoUpdate:this.mipmapsAutoUpdate,premultiplyAlpha:this.premultiplyAlpha,unpackAlignment:this.unpackAlignment};return Object.keys(this.userData).length>0&&(n.userData=this.userData),t||(e.textures[this.uuid]=n),n}dispose(){this.dispatchEvent({type:"dispose"})}transformUv(e){if(this.mapping!==sd)return e;if(e.applyMatrix3(this.matrix),e.x<0||e.x>1)switch(this.wrapS){case Mr:e.x=e.x-Math.floor(e.x);break;case gi:e.x=e.x<0?0:1;break;case Vo:Math.abs(Math.floor(e.x)%2)===1?e.x=Math.ceil(e.x)-e.x:e.x=e.x-Math.floor(e.x);break}if(e.y<0||e.y>1)switch(this.wrapT){case Mr:e.y=e.y-Math.floor(e.y);break;case gi:e.y=e.y<0?0:1;break;case Vo:Math.abs(Math.floor(e.y)%2)===1?e.y=Math.ceil(e.y)-e.y:e.y=e.y-Math.floor(e.y);break}return this.flipY&&(e.y=1-e.y),e}set needsUpdate(e){e===!0&&(this.version++,this.source.needsUpdate=!0)}set needsPMREMUpdate(e){e===!0&&this.pmremVersion++}};Yn.DEFAULT_IMAGE=null;Yn.DEFAULT_MAPPING=sd;Yn.DEFAULT_ANISOTROPY=1;var $t=class{static{this.prototype.isVector4=!0}constructor(e=0,t=0,n=0,s=1){this.x=e,this.y=t,this.z=n,this.w=s}get width(){return this.z}set width(e){this.z=e}get height(){return this.w}set height(e){this.w=e}set(e,t,n,s){return this.x=e,this.y=t,this.z=n,this.w=s,this}setScalar(e){return this.x=e,this.y=e,this.z=e,this.w=e,this}setX(e){return this.x=e,this}setY(e){return this.y=e,this}setZ(e){return this.z=e,this}setW(e){return this.w=e,this}setComponent(e,t){switch(e){case 0:this.x=t;break;case 1:this.y=t;break;case 2:this.z=t;break;case 3:this.w=t;break;default:throw new Error("THREE.Vector4: index is out of range: "+e)}return this}getComponent(e){switch(e){case 0:return this.x;case 1:return this.y;case 2:return this.z;case 3:return this.w;default:throw new Error("THREE.Vector4: index is out of range: "+e)}}clone(){return new this.constructor(this.x,this.y,this.z,this.w)}copy(e){return this.x=e.x,this.y=e.y,this.z=e.z,this.w=e.w!==void 0?e.w:1,this}add(e){return this.x+=e.x,this.y+=e.y,this.z+=e.z,this.w+=e.w,this}addScalar(e){return this.x+=e,this.y+=e,this.z+=e,this.w+=e,this}addVectors(e,t){return this.x=e.x+t.x,this.y=e.y+t.y,this.z=e.z+t.z,this.w=e.w+t.w,this}addScaledVector(e,t){return this.x+=e.x*t,this.y+=e.y*t,this.z+=e.z*t,this.w+=e.w*t,this}sub(e){return this.x-=e.x,this.y-=e.y,this.z-=e.z,this.w-=e.w,this}subScalar(e){return this.x-=e,this.y-=e,this.z-=e,this.w-=e,this}subVectors(e,t){return this.x=e.x-t.x,this.y=e.y-t.y,this.z=e.z-t.z,this.w=e.w-t.w,this}multiply(e){return this.x*=e.x,this.y*=e.y,this.z*=e.z,this.w*=e.w,this}multiplyScalar(e){return this.x*=e,this.y*=e,this.z*=e,this.w*=e,this}applyMatrix4(e){let t=this.x,n=this.y,s=this.z,r=this.w,o=e.elements;return this.x=o[0]*t+o[4]*n+o[8]*s+o[12]*r,this.y=o[1]*t+o[5]*n+o[9]*s+o[13]*r,this.z=o[2]*t+o[6]*n+o[10]*s+o[14]*r,this.w=o[3]*t+o[7]*n+o[11]*s+o[15]*r,this}divide(e){return this.x/=e.x,this.y/=e.y,this.z/=e.z,this.w/=e.w,this}divideScalar(e){return this.multiplyScalar(1/e)}setAxisAngleFromQuaternion(e){this.w=2*Math.acos(e.w);let t=Math.sqrt(1-e.w*e.w);return t<1e-4?(this.x=1,this.y=0,this.z=0):(this.x=e.x/t,this.y=e.y/t,this.z=e.z/t),this}setAxisAngleFromRotationMatrix(e){let t,n,s,r,l=e.elements,c=l[0],h=l[4],u=l[8],f=l[1],p=l[5],x=l[9],M=l[2],g=l[6],_=l[10];if(Math.abs(h-f)<.01&&Math.abs(u-M)<.01&&Math.abs(x-g)<.01){if(Math.abs(h+f)<.1&&Math.abs(u+M)<.1&&Math.abs(x+g)<.1&&Math.abs(c+p+_-3)<.1)return this.set(1,0,0,0),this;t=Math.PI;let P=(c+1)/2,w=(p+1)/2,D=(_+1)/2,I=(h+f)/4,y=(u+M)/4,T=(x+g)/4;return P>w&&P>D?P<.01?(n=0,s=.707106781,r=.707106781):(n=Math.sqrt(P),s=I/n,r=y/n):w>D?w<.01?(n=.707106781,s=0,r=.707106781):(s=Math.sqrt(w),n=I/s,r=T/s):D<.01?(n=.707106781,s=.707106781,r=0):(r=Math.sqrt(D),n=y/r,s=T/r),this.set(n,s,r,t),this}let b=Math.sqrt((g-x)*(g-x)+(u-M)*(u-M)+(f-h)*(f-h));return Math.abs(b)<.001&&(b=1),this.x=(g-x)/b,this.y=(u-M)/b,this.z=(f-h)/b,this.w=Math.acos((c+p+_-1)/2),this}setFromMatrixPosition(e){let t=e.elements;return this.x=t[12],this.y=t[13],this.z=t[14],this.w=t[15],this}min(e){return this.x=Math.min(this.x,e.x),this.y=Math.min(this.y,e.y),this.z=Math.min(this.z,e.z),this.w=Math.min(this.w,e.w),this}max(e){return this.x=Math.max(this.x,e.x),this.y=Math.max(this.y,e.y),this.z=Math.max(this.z,e.z),this.w=Math.max(this.w,e.w),this}clamp(e,t){return this.x=Rt(this.x,e.x,t.x),this.y=Rt(this.y,e.y,t.y),this.z=Rt(this.z,e.z,t.z),this.w=Rt(this.w,e.w,t.w),this}clampScalar(e,t){return this.x=Rt(this.x,e,t),this.y=Rt(this.y,e,t),this.z=Rt(this.z,e,t),this.w=Rt(this.w,e,t),this}clampLength(e,t){let n=this.length();return this.divideScalar(n||1).multiplyScalar(Rt(n,e,t))}floor(){return this.x=Math.floor(this.x),this.y=Math.floor(this.y),this.z=Math.floor(this.z),this.w=Math.floor(this.w),this}ceil(){return this.x=Math.ceil(this.x),this.y=Math.ceil(this.y),this.z=Math.ceil(this.z),this.w=Math.ceil(this.w),this}round(){return this.x=Math.round(this.x),this.y=Math.round(this.y),this.z=Math.round(this.z),this.w=Math.round(this.w),this}roundToZero(){return this.x=Math.trunc(this.x),this.y=Math.trunc(this.y),this.z=Math.trunc(this.z),this.w=Math.trunc(this.w),this}negate(){return this.x=-this.x,this.y=-this.y,this.z=-this.z,this.w=-this.w,this}dot(e){return this.x*e.x+this.y*e.y+this.z*e.z+this.w*e.w}lengthSq(){return this.x*this.x+this.y*this.y+this.z*this.z+this.w*this.w}length(){return Math.sqrt(this.x*this.x+this.y*this.y+this.z*this.z+this.w*this.w)}manhattanLength(){return Math.abs(this.x)+Math.abs(this.y)+Math.abs(this.z)+Math.abs(this.w)}normalize(){return this.divideScalar(this.length()||1)}setLength(e){return this.normalize().multiplyScalar(e)}lerp(e,t){return this.x+=(e.x-this.x)*t,this.y+=(e.y-this.y)*t,this.z+=(e.z-this.z)*t,this.w+=(e.w-this.w)*t,this}lerpVectors(e,t,n){return this.x=e.x+(t.x-e.x)*n,this.y=e.y+(t.y-e.y)*n,this.z=e.z+(t.z-e.z)*n,this.w=e.w+(t.w-e.w)*n,this}equals(e){return e.x===this.x&&e.y===this.y&&e.z===this.z&&e.w===this.w}fromArray(e,t=0){return this.x=e[t],this.y=e[t+1],this.z=e[t+2],this.w=e[t+3],this}toArray(e=[],t=0){return e[t]=this.x,e[t+1]=this.y,e[t+2]=this.z,e[t+3]=this.w,e}fromBufferAttribute(e,t){return this.x=e.getX(t),this.y=e.getY(t),this.z=e.getZ(t),this.w=e.getW(t),this}random(){return this.x=Math.random(),this.y=Math.random(),this.z=Math.random(),this.w=Math.random(),this}*[Symbol.iterator](){yield this.x,yield this.y,yield this.z,yield this.w}},Vc=class extends rs{constructor(e=1,t=1,n={}){super(),n=Object.assign({generateMipmaps:!1,internalFormat:null,minFilter:Xt,depthBuffer:!0,stencilBuffer:!1,resolveColorBuffer:!0,resolveDepthBuffer:!0,resolveStencilBuffer:!0,storeMultisampledColorBuffer:!0,storeMultisampledDepthBuffer:!0,storeMultisampledStencilBuffer:!0,depthTexture:null,samples:0,count:1,depth:1,multiview:!1,useArrayDepthTexture:!1},n),this.isRenderTarget=!0,this.width=e,this.height=t,this.depth=n.depth,this.scissor=new $t(0,0,e,t),this.scissorTest=!1,this.viewport=new $t(0,0,e,t),this.textures=[];let s=n.count;for(let r=0;r<s;r++)this.textures[r]=new Yn({width:e,height:t,depth:n.depth}),this.textures[r].isRenderTargetTexture=!0,this.textures[r].renderTarget=this;this._setTextureOptions(n),this.depthBuffer=n.depthBuffer,this.stencilBuffer=n.stencilBuffer,this.resolveColorBuffer=n.resolveColorBuffer,this.resolveDepthBuffer=n.resolveDepthBuffer,this.resolveStencilBuffer=n.resolveStencilBuffer,this.storeMultisampledColorBuffer=n.storeMultisampledColorBuffer,this.storeMultisampledDepthBuffer=n.storeMultisampledDepthBuffer,this.storeMultisampledStencilBuffer=n.storeMultisampledStencilBuffer,this._depthTexture=null,this.depthTexture=n.depthTexture,this.samples=n.samples,this.multiview=n.multiview,this.useArrayDepthTexture=n.useArrayDepthTexture}_setTextureOptions(e={}){let t={minFilter:Xt,generateMipmaps:!1,flipY:!1,internalFormat:null};e.mapping!==void 0&&(t.mapping=e.mapping),e.wrapS!==void 0&&(t.wrapS=e.wrapS),e.wrapT!==void 0&&(t.wrapT=e.wrapT),e.wrapR!==void 0&&(t.wrapR=e.wrapR),e.magFilter!==void 0&&(t.magFilter=e.magFilter),e.minFilter!==void 0&&(t.minFilter=e.minFilter),e.format!==void 0&&(t.format=e.format),e.type!==void 0&&(t.type=e.type),e.anisotropy!==void 0&&(t.anisotropy=e.anisotropy),e.colorSpace!==void 0&&(t.colorSpace=e.colorSpace),e.flipY!==void 0&&(t.flipY=e.flipY),e.generateMipmaps!==void 0&&(t.generateMipmaps=e.generateMipmaps),e.mipmapsAutoUpdate!==void 0&&(t.mipmapsAutoUpdate=e.mipmapsAutoUpdate),e.internalFormat!==void 0&&(t.internalFormat=e.internalFormat);for(let n=0;n<this.textures.length;n++)this.textures[n].setValues(t)}get texture(){return this.textures[0]}set texture(e){this.textures[0]=e}set depthTexture(e){this._depthTexture!==null&&this._depthTexture.renderTarget===this&&(this._depthTexture.renderTarget=null),e!==null&&e.renderTarget===null&&(e.renderTarget=this),this._depthTexture=e}get depthTexture(){return this._depthTexture}setSize(e,t,n=1){if(this.width!==e||this.height!==t||this.depth!==n){this.width=e,this.height=t,this.depth=n;for(let s=0,r=this.textures.length;s<r;s++)this.textures[s].image.width=e,this.textures[s].image.height=t,this.textures[s].image.depth=n,this.textures[s].isData3DTexture!==!0&&(this.textures[s].isArrayTexture=this.textures[s].image.depth>1);this.dispose()}this.viewport.set(0,0,e,t),this.scissor.set(0,0,e,t)}clone(){return new this.constructor().copy(this)}copy(e){this.width=e.width,this.height=e.height,this.depth=e.depth,this.scissor.copy(e.scissor),this.scissorTest=e.scissorTest,this.viewport.copy(e.viewport),this.textures.length=0;for(let t=0,n=e.textures.length;t<n;t++){this.textures[t]=e.textures[t].clone(),this.textures[t].isRenderTargetTexture=!0,this.textures[t].renderTarget=this;let s=Object.assign({},e.textures[t].image);this.textures[t].source=new Yo(s)}if(this.depthBuffer=e.depthBuffer,this.stencilBuffer=e.stencilBuffer,this.resolveColorBuffer=e.resolveColorBuffer,this.resolveDepthBuffer=e.resolveDepthBuffer,this.resolveStencilBuffer=e.resolveStencilBuffer,this.storeMultisampledColorBuffer=e.storeMultisampledColorBuffer,this.storeMultisampledDepthBuffer=e.storeMultisampledDepthBuffer,this.storeMultisampledStencilBuffer=e.storeMultisampledStencilBuffer,e.depthTexture!==null)if(e.depthTexture.renderTarget===e){let t=e.depthTexture.clone();t.renderTarget=null,this.depthTexture=t}else this.depthTexture=e.depthTexture;else this.depthTexture=null;return this.samples=e.samples,this.multiview=e.multiview,this.useArrayDepthTexture=e.useArrayDepthTexture,this}dispose(){this.dispatchEvent({type:"dispose"})}},hi=class extends Vc{constructor(e=1,t=1,n={}){super(e,t,n),this.isWebGLRenderTarget=!0}},Ka=class extends Yn{constructor(e=null,t=1,n=1,s=1){super(null),this.isDataArrayTexture=!0,this.image={data:e,width:t,height:n,depth:s},this.magFilter=En,this.minFilter=En,this.wrapR=gi,this.generateMipmaps=!1,this.flipY=!1,this.unpackAlignment=1,this.layerUpdates=new Set}copy(e){return super.copy(e),this.wrapR=e.wrapR,this}addLayerUpdate(e){this.layerUpdates.add(e)}clearLayerUpdates(){this.layerUpdates.clear()}};var Wc=class extends Yn{constructor(e=null,t=1,n=1,s=1){super(null),this.isData3DTexture=!0,this.image={data:e,width:t,height:n,depth:s},this.magFilter=En,this.minFilter=En,this.wrapR=gi,this.generateMipmaps=!1,this.flipY=!1,this.unpackAlignment=1}copy(e){return super.copy(e),this.wrapR=e.wrapR,this}};var Mt=class i{static{this.prototype.isMatrix4=!0}constructor(e,t,n,s,r,o,a,l,c,h,u,f,p,x,M,g){this.elements=[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1],e!==void 0&&this.set(e,t,n,s,r,o,a,l,c,h,u,f,p,x,M,g)}set(e,t,n,s,r,o,a,l,c,h,u,f,p,x,M,g){let _=this.elements;return _[0]=e,_[4]=t,_[8]=n,_[12]=s,_[1]=r,_[5]=o,_[9]=a,_[13]=l,_[2]=c,_[6]=h,_[10]=u,_[14]=f,_[3]=p,_[7]=x,_[11]=M,_[15]=g,this}identity(){return this.set(1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1),this}clone(){return new i().fromArray(this.elements)}copy(e){let t=this.elements,n=e.elements;return t[0]=n[0],t[1]=n[1],t[2]=n[2],t[3]=n[3],t[4]=n[4],t[5]=n[5],t[6]=n[6],t[7]=n[7],t[8]=n[8],t[9]=n[9],t[10]=n[10],t[11]=n[11],t[12]=n[12],t[13]=n[13],t[14]=n[14],t[15]=n[15],this}copyPosition(e){let t=this.elements,n=e.elements;return t[12]=n[12],t[13]=n[13],t[14]=n[14],this}setFromMatrix3(e){let t=e.elements;return this.set(t[0],t[3],t[6],0,t[1],t[4],t[7],0,t[2],t[5],t[8],0,0,0,0,1),this}extractBasis(e,t,n){return this.determinantAffine()===0?(e.set(1,0,0),t.set(0,1,0),n.set(0,0,1),this):(e.setFromMatrixColumn(this,0),t.setFromMatrixColumn(this,1),n.setFromMatrixColumn(this,2),this)}makeBasis(e,t,n){return this.set(e.x,t.x,n.x,0,e.y,t.y,n.y,0,e.z,t.z,n.z,0,0,0,0,1),this}extractRotation(e){if(e.determinantAffine()===0)return this.identity();let t=this.elements,n=e.elements,s=1/Ro.setFromMatrixColumn(e,0).length(),r=1/Ro.setFromMatrixColumn(e,1).length(),o=1/Ro.setFromMatrixColumn(e,2).length();return t[0]=n[0]*s,t[1]=n[1]*s,t[2]=n[2]*s,t[3]=0,t[4]=n[4]*r,t[5]=n[5]*r,t[6]=n[6]*r,t[7]=0,t[8]=n[8]*o,t[9]=n[9]*o,t[10]=n[10]*o,t[11]=0,t[12]=0,t[13]=0,t[14]=0,t[15]=1,this}makeRotationFromEuler(e){let t=this.elements,n=e.x,s=e.y,r=e.z,o=Math.cos(n),a=Math.sin(n),l=Math.cos(s),c=Math.sin(s),h=Math.cos(r),u=Math.sin(r);if(e.order==="XYZ"){let f=o*h,p=o*u,x=a*h,M=a*u;t[0]=l*h,t[4]=-l*u,t[8]=c,t[1]=p+x*c,t[5]=f-M*c,t[9]=-a*l,t[2]=M-f*c,t[6]=x+p*c,t[10]=o*l}else if(e.order==="YXZ"){let f=l*h,p=l*u,x=c*h,M=c*u;t[0]=f+M*a,t[4]=x*a-p,t[8]=o*c,t[1]=o*u,t[5]=o*h,t[9]=-a,t[2]=p*a-x,t[6]=M+f*a,t[10]=o*l}else if(e.order==="ZXY"){let f=l*h,p=l*u,x=c*h,M=c*u;t[0]=f-M*a,t[4]=-o*u,t[8]=x+p*a,t[1]=p+x*a,t[5]=o*h,t[9]=M-f*a,t[2]=-o*c,t[6]=a,t[10]=o*l}else if(e.order==="ZYX"){let f=o*h,p=o*u,x=a*h,M=a*u;t[0]=l*h,t[4]=x*c-p,t[8]=f*c+M,t[1]=l*u,t[5]=M*c+f,t[9]=p*c-x,t[2]=-c,t[6]=a*l,t[10]=o*l}else if(e.order==="YZX"){let f=o*l,p=o*c,x=a*l,M=a*c;t[0]=l*h,t[4]=M-f*u,t[8]=x*u+p,t[1]=u,t[5]=o*h,t[9]=-a*h,t[2]=-c*h,t[6]=p*u+x,t[10]=f-M*u}else if(e.order==="XZY"){let f=o*l,p=o*c,x=a*l,M=a*c;t[0]=l*h,t[4]=-u,t[8]=c*h,t[1]=f*u+M,t[5]=o*h,t[9]=p*u-x,t[2]=x*u-p,t[6]=a*h,t[10]=M*u+f}return t[3]=0,t[7]=0,t[11]=0,t[12]=0,t[13]=0,t[14]=0,t[15]=1,this}makeRotationFromQuaternion(e){return this.compose(Vy,e,Wy)}lookAt(e,t,n){let s=this.elements;return Ii.subVectors(e,t),Ii.lengthSq()===0&&(Ii.z=1),Ii.normalize(),mr.crossVectors(n,Ii),mr.lengthSq()===0&&(Math.abs(n.z)===1?Ii.x+=1e-4:Ii.z+=1e-4,Ii.normalize(),mr.crossVectors(n,Ii)),mr.normalize(),lc.crossVectors(Ii,mr),s[0]=mr.x,s[4]=lc.x,s[8]=Ii.x,s[1]=mr.y,s[5]=lc.y,s[9]=Ii.y,s[2]=mr.z,s[6]=lc.z,s[10]=Ii.z,this}multiply(e){return this.multiplyMatrices(this,e)}premultiply(e){return this.multiplyMatrices(e,this)}multiplyMatrices(e,t){let n=e.elements,s=t.elements,r=this.elements,o=n[0],a=n[4],l=n[8],c=n[12],h=n[1],u=n[5],f=n[9],p=n[13],x=n[2],M=n[6],g=n[10],_=n[14],b=n[3],P=n[7],w=n[11],D=n[15],I=s[0],y=s[4],T=s[8],G=s[12],k=s[1],O=s[5],Y=s[9],Z=s[13],U=s[2],W=s[6],$=s[10],q=s[14],xe=s[3],ne=s[7],se=s[11],de=s[15];return r[0]=o*I+a*k+l*U+c*xe,r[4]=o*y+a*O+l*W+c*ne,r[8]=o*T+a*Y+l*$+c*se,r[12]=o*G+a*Z+l*q+c*de,r[1]=h*I+u*k+f*U+p*xe,r[5]=h*y+u*O+f*W+p*ne,r[9]=h*T+u*Y+f*$+p*se,r[13]=h*G+u*Z+f*q+p*de,r[2]=x*I+M*k+g*U+_*xe,r[6]=x*y+M*O+g*W+_*ne,r[10]=x*T+M*Y+g*$+_*se,r[14]=x*G+M*Z+g*q+_*de,r[3]=b*I+P*k+w*U+D*xe,r[7]=b*y+P*O+w*W+D*ne,r[11]=b*T+P*Y+w*$+D*se,r[15]=b*G+P*Z+w*q+D*de,this}multiplyScalar(e){let t=this.elements;return t[0]*=e,t[4]*=e,t[8]*=e,t[12]*=e,t[1]*=e,t[5]*=e,t[9]*=e,t[13]*=e,t[2]*=e,t[6]*=e,t[10]*=e,t[14]*=e,t[3]*=e,t[7]*=e,t[11]*=e,t[15]*=e,this}determinant(){let e=this.elements,t=e[0],n=e[4],s=e[8],r=e[12],o=e[1],a=e[5],l=e[9],c=e[13],h=e[2],u=e[6],f=e[10],p=e[14],x=e[3],M=e[7],g=e[11],_=e[15],b=l*p-c*f,P=a*p-c*u,w=a*f-l*u,D=o*p-c*h,I=o*f-l*h,y=o*u-a*h;return t*(M*b-g*P+_*w)-n*(x*b-g*D+_*I)+s*(x*P-M*D+_*y)-r*(x*w-M*I+g*y)}determinantAffine(){let e=this.elements,t=e[0],n=e[4],s=e[8],r=e[1],o=e[5],a=e[9],l=e[2],c=e[6],h=e[10];return t*(o*h-a*c)-n*(r*h-a*l)+s*(r*c-o*l)}transpose(){let e=this.elements,t;return t=e[1],e[1]=e[4],e[4]=t,t=e[2],e[2]=e[8],e[8]=t,t=e[6],e[6]=e[9],e[9]=t,t=e[3],e[3]=e[12],e[12]=t,t=e[7],e[7]=e[13],e[13]=t,t=e[11],e[11]=e[14],e[14]=t,this}setPosition(e,t,n){let s=this.elements;return e.isVector3?(s[12]=e.x,s[13]=e.y,s[14]=e.z):(s[12]=e,s[13]=t,s[14]=n),this}invert(){let e=this.elements,t=e[0],n=e[1],s=e[2],r=e[3],o=e[4],a=e[5],l=e[6],c=e[7],h=e[8],u=e[9],f=e[10],p=e[11],x=e[12],M=e[13],g=e[14],_=e[15],b=t*a-n*o,P=t*l-s*o,w=t*c-r*o,D=n*l-s*a,I=n*c-r*a,y=s*c-r*l,T=h*M-u*x,G=h*g-f*x,k=h*_-p*x,O=u*g-f*M,Y=u*_-p*M,Z=f*_-p*g,U=b*Z-P*Y+w*O+D*k-I*G+y*T;if(U===0)return this.set(0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0);let W=1/U;return e[0]=(a*Z-l*Y+c*O)*W,e[1]=(s*Y-n*Z-r*O)*W,e[2]=(M*y-g*I+_*D)*W,e[3]=(f*I-u*y-p*D)*W,e[4]=(l*k-o*Z-c*G)*W,e[5]=(t*Z-s*k+r*G)*W,e[6]=(g*w-x*y-_*P)*W,e[7]=(h*y-f*w+p*P)*W,e[8]=(o*Y-a*k+c*T)*W,e[9]=(n*k-t*Y-r*T)*W,e[10]=(x*I-M*w+_*b)*W,e[11]=(u*w-h*I-p*b)*W,e[12]=(a*G-o*O-l*T)*W,e[13]=(t*O-n*G+s*T)*W,e[14]=(M*P-x*D-g*b)*W,e[15]=(h*D-u*P+f*b)*W,this}scale(e){let t=this.elements,n=e.x,s=e.y,r=e.z;return t[0]*=n,t[4]*=s,t[8]*=r,t[1]*=n,t[5]*=s,t[9]*=r,t[2]*=n,t[6]*=s,t[10]*=r,t[3]*=n,t[7]*=s,t[11]*=r,this}getMaxScaleOnAxis(){let e=this.elements,t=e[0]*e[0]+e[1]*e[1]+e[2]*e[2],n=e[4]*e[4]+e[5]*e[5]+e[6]*e[6],s=e[8]*e[8]+e[9]*e[9]+e[10]*e[10];return Math.sqrt(Math.max(t,n,s))}makeTranslation(e,t,n){return e.isVector3?this.set(1,0,0,e.x,0,1,0,e.y,0,0,1,e.z,0,0,0,1):this.set(1,0,0,e,0,1,0,t,0,0,1,n,0,0,0,1),this}makeRotationX(e){let t=Math.cos(e),n=Math.sin(e);return this.set(1,0,0,0,0,t,-n,0,0,n,t,0,0,0,0,1),this}makeRotationY(e){let t=Math.cos(e),n=Math.sin(e);return this.set(t,0,n,0,0,1,0,0,-n,0,t,0,0,0,0,1),this}makeRotationZ(e){let t=Math.cos(e),n=Math.sin(e);return this.set(t,-n,0,0,n,t,0,0,0,0,1,0,0,0,0,1),this}makeRotationAxis(e,t){let n=Math.cos(t),s=Math.sin(t),r=1-n,o=e.x,a=e.y,l=e.z,c=r*o,h=r*a;return this.set(c*o+n,c*a-s*l,c*l+s*a,0,c*a+s*l,h*a+n,h*l-s*o,0,c*l-s*a,h*l+s*o,r*l*l+n,0,0,0,0,1),this}makeScale(e,t,n){return this.set(e,0,0,0,0,t,0,0,0,0,n,0,0,0,0,1),this}makeShear(e,t,n,s,r,o){return this.set(1,n,r,0,e,1,o,0,t,s,1,0,0,0,0,1),this}compose(e,t,n){let s=this.elements,r=t._x,o=t._y,a=t._z,l=t._w,c=r+r,h=o+o,u=a+a,f=r*c,p=r*h,x=r*u,M=o*h,g=o*u,_=a*u,b=l*c,P=l*h,w=l*u,D=n.x,I=n.y,y=n.z;return s[0]=(1-(M+_))*D,s[1]=(p+w)*D,s[2]=(x-P)*D,s[3]=0,s[4]=(p-w)*I,s[5]=(1-(f+_))*I,s[6]=(g+b)*I,s[7]=0,s[8]=(x+P)*y,s[9]=(g-b)*y,s[10]=(1-(f+M))*y,s[11]=0,s[12]=e.x,s[13]=e.y,s[14]=e.z,s[15]=1,this}decompose(e,t,n){let s=this.elements;e.x=s[12],e.y=s[13],e.z=s[14];let r=this.determinantAffine();if(r===0)return n.set(1,1,1),t.identity(),this;let o=Ro.set(s[0],s[1],s[2]).length(),a=Ro.set(s[4],s[5],s[6]).length(),l=Ro.set(s[8],s[9],s[10]).length();r<0&&(o=-o),ns.copy(this);let c=1/o,h=1/a,u=1/l;return ns.elements[0]*=c,ns.elements[1]*=c,ns.elements[2]*=c,ns.elements[4]*=h,ns.elements[5]*=h,ns.elements[6]*=h,ns.elements[8]*=u,ns.elements[9]*=u,ns.elements[10]*=u,t.setFromRotationMatrix(ns),n.x=o,n.y=a,n.z=l,this}makePerspective(e,t,n,s,r,o,a=Gi,l=!1){let c=this.elements,h=2*r/(t-e),u=2*r/(n-s),f=(t+e)/(t-e),p=(n+s)/(n-s),x,M;if(l)x=r/(o-r),M=o*r/(o-r);else if(a===Gi)x=-(o+r)/(o-r),M=-2*o*r/(o-r);else if(a===Wo)x=-o/(o-r),M=-o*r/(o-r);else throw new Error("THREE.Matrix4.makePerspective(): Invalid coordinate system: "+a);return c[0]=h,c[4]=0,c[8]=f,c[12]=0,c[1]=0,c[5]=u,c[9]=p,c[13]=0,c[2]=0,c[6]=0,c[10]=x,c[14]=M,c[3]=0,c[7]=0,c[11]=-1,c[15]=0,this}makeOrthographic(e,t,n,s,r,o,a=Gi,l=!1){let c=this.elements,h=2/(t-e),u=2/(n-s),f=-(t+e)/(t-e),p=-(n+s)/(n-s),x,M;if(l)x=1/(o-r),M=o/(o-r);else if(a===Gi)x=-2/(o-r),M=-(o+r)/(o-r);else if(a===Wo)x=-1/(o-r),M=-r/(o-r);else throw new Error("THREE.Matrix4.makeOrthographic(): Invalid coordinate system: "+a);return c[0]=h,c[4]=0,c[8]=0,c[12]=f,c[1]=0,c[5]=u,c[9]=0,c[13]=p,c[2]=0,c[6]=0,c[10]=x,c[14]=M,c[3]=0,c[7]=0,c[11]=0,c[15]=1,this}equals(e){let t=this.elements,n=e.elements;for(let s=0;s<16;s++)if(t[s]!==n[s])return!1;return!0}fromArray(e,t=0){for(let n=0;n<16;n++)this.elements[n]=e[n+t];return this}toArray(e=[],t=0){let n=this.elements;return e[t]=n[0],e[t+1]=n[1],e[t+2]=n[2],e[t+3]=n[3],e[t+4]=n[4],e[t+5]=n[5],e[t+6]=n[6],e[t+7]=n[7],e[t+8]=n[8],e[t+9]=n[9],e[t+10]=n[10],e[t+11]=n[11],e[t+12]=n[12],e[t+13]=n[13],e[t+14]=n[14],e[t+15]=n[15],e}},Ro=new Q,ns=new Mt,Vy=new Q(0,0,0),Wy=new Q(1,1,1),mr=new Q,lc=new Q,Ii=new Q,Ag=new Mt,Rg=new qn,Gs=class i{constructor(e=0,t=0,n=0,s=i.DEFAULT_ORDER){this.isEuler=!0,this._x=e,this._y=t,this._z=n,this._order=s}get x(){return this._x}set x(e){this._x=e,this._onChangeCallback()}get y(){return this._y}set y(e){this._y=e,this._onChangeCallback()}get z(){return this._z}set z(e){this._z=e,this._onChangeCallback()}get order(){return this._order}set order(e){this._order=e,this._onChangeCallback()}set(e,t,n,s=this._order){return this._x=e,this._y=t,this._z=n,this._order=s,this._onChangeCallback(),this}clone(){return new this.constructor(this._x,this._y,this._z,this._order)}copy(e){return this._x=e._x,this._y=e._y,this._z=e._z,this._order=e._order,this._onChangeCallback(),this}setFromRotationMatrix(e,t=this._order,n=!0){let s=e.elements,r=s[0],o=s[4],a=s[8],l=s[1],c=s[5],h=s[9],u=s[2],f=s[6],p=s[10];switch(t){case"XYZ":this._y=Math.asin(Rt(a,-1,1)),Math.abs(a)<.9999999?(this._x=Math.atan2(-h,p),this._z=Math.atan2(-o,r)):(this._x=Math.atan2(f,c),this._z=0);break;case"YXZ":this._x=Math.asin(-Rt(h,-1,1)),Math.abs(h)<.9999999?(this._y=Math.atan2(a,p),this._z=Math.atan2(l,c)):(this._y=Math.atan2(-u,r),this._z=0);break;case"ZXY":this._x=Math.asin(Rt(f,-1,1)),Math.abs(f)<.9999999?(this._y=Math.atan2(-u,p),this._z=Math.atan2(-o,c)):(this._y=0,this._z=Math.atan2(l,r));break;case"ZYX":this._y=Math.asin(-Rt(u,-1,1)),Math.abs(u)<.9999999?(this._x=Math.atan2(f,p),this._z=Math.atan2(l,r)):(this._x=0,this._z=Math.atan2(-o,c));break;case"YZX":this._z=Math.asin(Rt(l,-1,1)),Math.abs(l)<.9999999?(this._x=Math.atan2(-h,c),this._y=Math.atan2(-u,r)):(this._x=0,this._y=Math.atan2(a,p));break;case"XZY":this._z=Math.asin(-Rt(o,-1,1)),Math.abs(o)<.9999999?(this._x=Math.atan2(f,c),this._y=Math.atan2(a,r)):(this._x=Math.atan2(-h,p),this._y=0);break;default:nt("Euler: .setFromRotationMatrix() encountered an unknown order: "+t)}return this._order=t,n===!0&&this._onChangeCallback(),this}setFromQuaternion(e,t,n){return Ag.makeRotationFromQuaternion(e),this.setFromRotationMatrix(Ag,t,n)}setFromVector3(e,t=this._order){return this.set(e.x,e.y,e.z,t)}reorder(e){return Rg.setFromEuler(this),this.setFromQuaternion(Rg,e)}equals(e){return e._x===this._x&&e._y===this._y&&e._z===this._z&&e._order===this._order}fromArray(e){return this._x=e[0],this._y=e[1],this._z=e[2],e[3]!==void 0&&(this._order=e[3]),this._onChangeCallback(),this}toArray(e=[],t=0){return e[t]=this._x,e[t+1]=this._y,e[t+2]=this._z,e[t+3]=this._order,e}_onChange(e){return this._onChangeCallback=e,this}_onChangeCallback(){}*[Symbol.iterator](){yield this._x,yield this._y,yield this._z,yield this._order}};Gs.DEFAULT_ORDER="XYZ";var $a=class{constructor(){this.mask=1}set(e){this.mask=(1<<e|0)>>>0}enable(e){this.mask|=1<<e|0}enableAll(){this.mask=-1}toggle(e){this.mask^=1<<e|0}disable(e){this.mask&=~(1<<e|0)}disableAll(){this.mask=0}test(e){return(this.mask&e.mask)!==0}isEnabled(e){return(this.mask&(1<<e|0))!==0}},Xy=0,Cg=new Q,Co=new qn,Ds=new Mt,cc=new Q,Oa=new Q,qy=new Q,Yy=new qn,Ig=new Q(1,0,0),Pg=new Q(0,1,0),Lg=new Q(0,0,1),Dg={type:"added"},Zy={type:"removed"},Io={type:"childadded",child:null},mf={type:"childremoved",child:null},xn=class i extends rs{constructor(){super(),this.isObject3D=!0,Object.defineProperty(this,"id",{value:Xy++}),this.uuid=ws(),this.name="",this.type="Object3D",this.parent=null,this.children=[],this.up=i.DEFAULT_UP.clone();let e=new Q,t=new Gs,n=new qn,s=new Q(1,1,1);function r(){n.setFromEuler(t,!1)}function o(){t.setFromQuaternion(n,void 0,!1)}t._onChange(r),n._onChange(o),Object.defineProperties(this,{position:{configurable:!0,enumerable:!0,value:e},rotation:{configurable:!0,enumerable:!0,value:t},quaternion:{configurable:!0,enumerable:!0,value:n},scale:{configurable:!0,enumerable:!0,value:s},modelViewMatrix:{value:new Mt},normalMatrix:{value:new yt}}),this.matrix=new Mt,this.matrixWorld=new Mt,this.matrixAutoUpdate=i.DEFAULT_MATRIX_AUTO_UPDATE,this.matrixWorldAutoUpdate=i.DEFAULT_MATRIX_WORLD_AUTO_UPDATE,this.matrixWorldNeedsUpdate=!1,this.layers=new $a,this.visible=!0,this.castShadow=!1,this.receiveShadow=!1,this.frustumCulled=!0,this.renderOrder=0,this.animations=[],this.customDepthMaterial=void 0,this.customDistanceMaterial=void 0,this.static=!1,this.userData={},this.pivot=null}onBeforeShadow(){}onAfterShadow(){}onBeforeRender(){}onAfterRender(){}applyMatrix4(e){this.matrixAutoUpdate&&this.updateMatrix(),this.matrix.premultiply(e),this.matrix.decompose(this.position,this.quaternion,this.scale),this.pivot!==null&&this.position.copy(this.pivot).applyMatrix4(this.matrix).sub(this.pivot)}applyQuaternion(e){return this.quaternion.premultiply(e),this}setRotationFromAxisAngle(e,t){this.quaternion.setFromAxisAngle(e,t)}setRotationFromEuler(e){this.quaternion.setFromEuler(e,!0)}setRotationFromMatrix(e){this.quaternion.setFromRotationMatrix(e)}setRotationFromQuaternion(e){this.quaternion.copy(e)}rotateOnAxis(e,t){return Co.setFromAxisAngle(e,t),this.quaternion.multiply(Co),this}rotateOnWorldAxis(e,t){return Co.setFromAxisAngle(e,t),this.quaternion.premultiply(Co),this}rotateX(e){return this.rotateOnAxis(Ig,e)}rotateY(e){return this.rotateOnAxis(Pg,e)}rotateZ(e){return this.rotateOnAxis(Lg,e)}translateOnAxis(e,t){return Cg.copy(e).applyQuaternion(this.quaternion),this.position.add(Cg.multiplyScalar(t)),this}translateX(e){return this.translateOnAxis(Ig,e)}translateY(e){return this.translateOnAxis(Pg,e)}translateZ(e){return this.translateOnAxis(Lg,e)}localToWorld(e){return this.updateWorldMatrix(!0,!1),e.applyMatrix4(this.matrixWorld)}worldToLocal(e){return this.updateWorldMatrix(!0,!1),e.applyMatrix4(Ds.copy(this.matrixWorld).invert())}lookAt(e,t,n){e.isVector3?cc.copy(e):cc.set(e,t,n);let s=this.parent;this.updateWorldMatrix(!0,!1),Oa.setFromMatrixPosition(this.matrixWorld),this.isCamera||this.isLight?Ds.lookAt(Oa,cc,this.up):Ds.lookAt(cc,Oa,this.up),this.quaternion.setFromRotationMatrix(Ds),s&&(Ds.extractRotation(s.matrixWorld),Co.setFromRotationMatrix(Ds),this.quaternion.premultiply(Co.invert()))}add(e){if(arguments.length>1){for(let t=0;t<arguments.length;t++)this.add(arguments[t]);return this}return e===this?(gt("Object3D.add: object can't be added as a child of itself.",e),this):(e&&e.isObject3D?(e.removeFromParent(),e.parent=this,this.children.push(e),e.dispatchEvent(Dg),Io.child=e,this.dispatchEvent(Io),Io.child=null):gt("Object3D.add: object not an instance of THREE.Object3D.",e),this)}remove(e){if(arguments.length>1){for(let n=0;n<arguments.length;n++)this.remove(arguments[n]);return this}let t=this.children.indexOf(e);return t!==-1&&(e.parent=null,this.children.splice(t,1),e.dispatchEvent(Zy),mf.child=e,this.dispatchEvent(mf),mf.child=null),this}removeFromParent(){let e=this.parent;return e!==null&&e.remove(this),this}clear(){return this.remove(...this.children)}attach(e){return this.updateWorldMatrix(!0,!1),Ds.copy(this.matrixWorld).invert(),e.parent!==null&&(e.parent.updateWorldMatrix(!0,!1),Ds.multiply(e.parent.matrixWorld)),e.applyMatrix4(Ds),e.removeFromParent(),e.parent=this,this.children.push(e),e.updateWorldMatrix(!1,!0),e.dispatchEvent(Dg),Io.child=e,this.dispatchEvent(Io),Io.child=null,this}getObjectById(e){return this.getObjectByProperty("id",e)}getObjectByName(e){return this.getObjectByProperty("name",e)}getObjectByProperty(e,t){if(this[e]===t)return this;for(let n=0,s=this.children.length;n<s;n++){let o=this.children[n].getObjectByProperty(e,t);if(o!==void 0)return o}}getObjectsByProperty(e,t,n=[]){this[e]===t&&n.push(this);let s=this.children;for(let r=0,o=s.length;r<o;r++)s[r].getObjectsByProperty(e,t,n);return n}getWorldPosition(e){return this.updateWorldMatrix(!0,!1),e.setFromMatrixPosition(this.matrixWorld)}getWorldQuaternion(e){return this.updateWorldMatrix(!0,!1),this.matrixWorld.decompose(Oa,e,qy),e}getWorldScale(e){return this.updateWorldMatrix(!0,!1),this.matrixWorld.decompose(Oa,Yy,e),e}getWorldDirection(e){this.updateWorldMatrix(!0,!1);let t=this.matrixWorld.elements;return e.set(t[8],t[9],t[10]).normalize()}raycast(){}intersectsFrustum(){return!0}traverse(e){e(this);let t=this.children;for(let n=0,s=t.length;n<s;n++)t[n].traverse(e)}traverseVisible(e){if(this.visible===!1)return;e(this);let t=this.children;for(let n=0,s=t.length;n<s;n++)t[n].traverseVisible(e)}traverseAncestors(e){let t=this.parent;t!==null&&(e(t),t.traverseAncestors(e))}updateMatrix(){this.matrix.compose(this.position,this.quaternion,this.scale);let e=this.pivot;if(e!==null){let t=e.x,n=e.y,s=e.z,r=this.matrix.elements;r[12]+=t-r[0]*t-r[4]*n-r[8]*s,r[13]+=n-r[1]*t-r[5]*n-r[9]*s,r[14]+=s-r[2]*t-r[6]*n-r[10]*s}this.matrixWorldNeedsUpdate=!0}updateMatrixWorld(e){this.matrixAutoUpdate&&this.updateMatrix(),(this.matrixWorldNeedsUpdate||e)&&(this.matrixWorldAutoUpdate===!0&&(this.parent===null?this.matrixWorld.copy(this.matrix):this.matrixWorld.multiplyMatrices(this.parent.matrixWorld,this.matrix)),this.matrixWorldNeedsUpdate=!1,e=!0);let t=this.children;for(let n=0,s=t.length;n<s;n++)t[n].updateMatrixWorld(e)}updateWorldMatrix(e,t,n=!1){let s=this.parent;if(e===!0&&s!==null&&s.updateWorldMatrix(!0,!1),this.matrixAutoUpdate&&this.updateMatrix(),(this.matrixWorldNeedsUpdate||n)&&(this.matrixWorldAutoUpdate===!0&&(this.parent===null?this.matrixWorld.copy(this.matrix):this.matrixWorld.multiplyMatrices(this.parent.matrixWorld,this.matrix)),this.matrixWorldNeedsUpdate=!1,n=!0),t===!0){let r=this.children;for(let o=0,a=r.length;o<a;o++)r[o].updateWorldMatrix(!1,!0,n)}}toJSON(e){let t=e===void 0||typeof e=="string",n={};t&&(e={geometries:{},materials:{},textures:{},images:{},shapes:{},skeletons:{},animations:{},nodes:{}},n.metadata={version:4.7,type:"Object",generator:"Object3D.toJSON"});let s={};s.uuid=this.uuid,s.type=this.type,s.name=this.name,s.castShadow=this.castShadow,s.receiveShadow=this.receiveShadow,s.visible=this.visible,s.frustumCulled=this.frustumCulled,s.renderOrder=this.renderOrder,s.static=this.static,s.matrixAutoUpdate=this.matrixAutoUpdate,Object.keys(this.userData).length>0&&(s.userData=this.userData),s.layers=this.layers.mask,s.matrix=this.matrix.toArray(),s.up=this.up.toArray(),this.pivot!==null&&(s.pivot=this.pivot.toArray()),this.morphTargetDictionary!==void 0&&(s.morphTargetDictionary=Object.assign({},this.morphTargetDictionary)),this.morphTargetInfluences!==void 0&&(s.morphTargetInfluences=this.morphTargetInfluences.slice()),this.isInstancedMesh&&(s.type="InstancedMesh",s.count=this.count,s.instanceMatrix=this.instanceMatrix.toJSON(),this.instanceColor!==null&&(s.instanceColor=this.instanceColor.toJSON())),this.isBatchedMesh&&(s.type="BatchedMesh",s.perObjectFrustumCulled=this.perObjectFrustumCulled,s.sortObjects=this.sortObjects,s.drawRanges=this._drawRanges,s.reservedRanges=this._reservedRanges,s.geometryInfo=this._geometryInfo.map(a=>({...a,boundingBox:a.boundingBox?a.boundingBox.toJSON():void 0,boundingSphere:a.boundingSphere?a.boundingSphere.toJSON():void 0})),s.instanceInfo=this._instanceInfo.map(a=>({...a})),s.availableInstanceIds=this._availableInstanceIds.slice(),s.availableGeometryIds=this._availableGeometryIds.slice(),s.nextIndexStart=this._nextIndexStart,s.nextVertexStart=this._nextVertexStart,s.geometryCount=this._geometryCount,s.maxInstanceCount=this._maxInstanceCount,s.maxVertexCount=this._maxVertexCount,s.maxIndexCount=this._maxIndexCount,s.geometryInitialized=this._geometryInitialized,s.matricesTexture=this._matricesTexture.toJSON(e),s.indirectTexture=this._indirectTexture.toJSON(e),this._colorsTexture!==null&&(s.colorsTexture=this._colorsTexture.toJSON(e)),this.boundingSphere!==null&&(s.boundingSphere=this.boundingSphere.toJSON()),this.boundingBox!==null&&(s.boundingBox=this.boundingBox.toJSON()));function r(a,l){return a[l.uuid]===void 0&&(a[l.uuid]=l.toJSON(e)),l.uuid}if(this.isScene)this.background&&(this.background.isColor?s.background=this.background.toJSON():this.background.isTexture&&(s.background=this.background.toJSON(e).uuid)),this.environment&&this.environment.isTexture&&this.environment.isRenderTargetTexture!==!0&&(s.environment=this.environment.toJSON(e).uuid);else if(this.isMesh||this.isLine||this.isPoints){s.geometry=r(e.geometries,this.geometry);let a=this.geometry.parameters;if(a!==void 0&&a.shapes!==void 0){let l=a.shapes;if(Array.isArray(l))for(let c=0,h=l.length;c<h;c++){let u=l[c];r(e.shapes,u)}else r(e.shapes,l)}}if(this.isSkinnedMesh&&(s.bindMode=this.bindMode,s.bindMatrix=this.bindMatrix.toArray(),this.skeleton!==void 0&&(r(e.skeletons,this.skeleton),s.skeleton=this.skeleton.uuid)),this.material!==void 0)if(Array.isArray(this.material)){let a=[];for(let l=0,c=this.material.length;l<c;l++)a.push(r(e.materials,this.material[l]));s.material=a}else s.material=r(e.materials,this.material);if(this.children.length>0){s.children=[];for(let a=0;a<this.children.length;a++)s.children.push(this.children[a].toJSON(e).object)}if(this.animations.length>0){s.animations=[];for(let a=0;a<this.animations.length;a++){let l=this.animations[a];s.animations.push(r(e.animations,l))}}if(t){let a=o(e.geometries),l=o(e.materials),c=o(e.textures),h=o(e.images),u=o(e.shapes),f=o(e.skeletons),p=o(e.animations),x=o(e.nodes);a.length>0&&(n.geometries=a),l.length>0&&(n.materials=l),c.length>0&&(n.textures=c),h.length>0&&(n.images=h),u.length>0&&(n.shapes=u),f.length>0&&(n.skeletons=f),p.length>0&&(n.animations=p),x.length>0&&(n.nodes=x)}return n.object=s,n;function o(a){let l=[];for(let c in a){let h=a[c];delete h.metadata,l.push(h)}return l}}clone(e){return new this.constructor().copy(this,e)}copy(e,t=!0){if(this.name=e.name,this.up.copy(e.up),this.position.copy(e.position),this.rotation.order=e.rotation.order,this.quaternion.copy(e.quaternion),this.scale.copy(e.scale),this.pivot=e.pivot!==null?e.pivot.clone():null,this.matrix.copy(e.matrix),this.matrixWorld.copy(e.matrixWorld),this.matrixAutoUpdate=e.matrixAutoUpdate,this.matrixWorldAutoUpdate=e.matrixWorldAutoUpdate,this.matrixWorldNeedsUpdate=e.matrixWorldNeedsUpdate,this.layers.mask=e.layers.mask,this.visible=e.visible,this.castShadow=e.castShadow,this.receiveShadow=e.receiveShadow,this.frustumCulled=e.frustumCulled,this.renderOrder=e.renderOrder,this.static=e.static,this.animations=e.animations.slice(),this.userData=JSON.parse(JSON.stringify(e.userData)),t===!0)for(let n=0;n<e.children.length;n++){let s=e.children[n];this.add(s.clone())}return this}dispose(){this.dispatchEvent({type:"dispose"})}};xn.DEFAULT_UP=new Q(0,1,0);xn.DEFAULT_MATRIX_AUTO_UPDATE=!0;xn.DEFAULT_MATRIX_WORLD_AUTO_UPDATE=!0;var Di=class extends xn{constructor(){super(),this.isGroup=!0,this.type="Group"}},Ky={type:"move"},Zo=class{constructor(){this._targetRay=null,this._grip=null,this._hand=null}getHandSpace(){return this._hand===null&&(this._hand=new Di,this._hand.matrixAutoUpdate=!1,this._hand.visible=!1,this._hand.joints={},this._hand.inputState={pinching:!1}),this._hand}getTargetRaySpace(){return this._targetRay===null&&(this._targetRay=new Di,this._targetRay.matrixAutoUpdate=!1,this._targetRay.visible=!1,this._targetRay.hasLinearVelocity=!1,this._targetRay.linearVelocity=new Q,this._targetRay.hasAngularVelocity=!1,this._targetRay.angularVelocity=new Q),this._targetRay}getGripSpace(){return this._grip===null&&(this._grip=new Di,this._grip.matrixAutoUpdate=!1,this._grip.visible=!1,this._grip.hasLinearVelocity=!1,this._grip.linearVelocity=new Q,this._grip.hasAngularVelocity=!1,this._grip.angularVelocity=new Q,this._grip.eventsEnabled=!1),this._grip}dispatchEvent(e){return this._targetRay!==null&&this._targetRay.dispatchEvent(e),this._grip!==null&&this._grip.dispatchEvent(e),this._hand!==null&&this._hand.dispatchEvent(e),this}connect(e){if(e&&e.hand){let t=this._hand;if(t)for(let n of e.hand.values())this._getHandJoint(t,n)}return this.dispatchEvent({type:"connected",data:e}),this}disconnect(e){return this.dispatchEvent({type:"disconnected",data:e}),this._targetRay!==null&&(this._targetRay.visible=!1),this._grip!==null&&(this._grip.visible=!1),this._hand!==null&&(this._hand.visible=!1),this}update(e,t,n){let s=null,r=null,o=null,a=this._targetRay,l=this._grip,c=this._hand;if(e&&t.session.visibilityState!=="visible-blurred"){if(c&&e.hand){o=!0;for(let M of e.hand.values()){let g=t.getJointPose(M,n),_=this._getHandJoint(c,M);g!==null&&(_.matrix.fromArray(g.transform.matrix),_.matrix.decompose(_.position,_.quaternion,_.scale),_.matrixWorldNeedsUpdate=!0,_.jointRadius=g.radius),_.visible=g!==null}let h=c.joints["index-finger-tip"],u=c.joints["thumb-tip"],f=h.position.distanceTo(u.position),p=.02,x=.005;c.inputState.pinching&&f>p+x?(c.inputState.pinching=!1,this.dispatchEvent({type:"pinchend",handedness:e.handedness,target:this})):!c.inputState.pinching&&f<=p-x&&(c.inputState.pinching=!0,this.dispatchEvent({type:"pinchstart",handedness:e.handedness,target:this}))}else l!==null&&e.gripSpace&&(r=t.getPose(e.gripSpace,n),r!==null&&(l.matrix.fromArray(r.transform.matrix),l.matrix.decompose(l.position,l.quaternion,l.scale),l.matrixWorldNeedsUpdate=!0,r.linearVelocity?(l.hasLinearVelocity=!0,l.linearVelocity.copy(r.linearVelocity)):l.hasLinearVelocity=!1,r.angularVelocity?(l.hasAngularVelocity=!0,l.angularVelocity.copy(r.angularVelocity)):l.hasAngularVelocity=!1,l.eventsEnabled&&l.dispatchEvent({type:"gripUpdated",data:e,target:this})));a!==null&&(s=t.getPose(e.targetRaySpace,n),s===null&&r!==null&&(s=r),s!==null&&(a.matrix.fromArray(s.transform.matrix),a.matrix.decompose(a.position,a.quaternion,a.scale),a.matrixWorldNeedsUpdate=!0,s.linearVelocity?(a.hasLinearVelocity=!0,a.linearVelocity.copy(s.linearVelocity)):a.hasLinearVelocity=!1,s.angularVelocity?(a.hasAngularVelocity=!0,a.angularVelocity.copy(s.angularVelocity)):a.hasAngularVelocity=!1,this.dispatchEvent(Ky)))}return a!==null&&(a.visible=s!==null),l!==null&&(l.visible=r!==null),c!==null&&(c.visible=o!==null),this}_getHandJoint(e,t){if(e.joints[t.jointName]===void 0){let n=new Di;n.matrixAutoUpdate=!1,n.visible=!1,e.joints[t.jointName]=n,e.add(n)}return e.joints[t.jointName]}},V0={aliceblue:15792383,antiquewhite:16444375,aqua:65535,aquamarine:8388564,azure:15794175,beige:16119260,bisque:16770244,black:0,blanchedalmond:16772045,blue:255,blueviolet:9055202,brown:10824234,burlywood:14596231,cadetblue:6266528,chartreuse:8388352,chocolate:13789470,coral:16744272,cornflowerblue:6591981,cornsilk:16775388,crimson:14423100,cyan:65535,darkblue:139,darkcyan:35723,darkgoldenrod:12092939,darkgray:11119017,darkgreen:25600,darkgrey:11119017,darkkhaki:12433259,darkmagenta:9109643,darkolivegreen:5597999,darkorange:16747520,darkorchid:10040012,darkred:9109504,darksalmon:15308410,darkseagreen:9419919,darkslateblue:4734347,darkslategray:3100495,darkslategrey:3100495,darkturquoise:52945,darkviolet:9699539,deeppink:16716947,deepskyblue:49151,dimgray:6908265,dimgrey:6908265,dodgerblue:2003199,firebrick:11674146,floralwhite:16775920,forestgreen:2263842,fuchsia:16711935,gainsboro:14474460,ghostwhite:16316671,gold:16766720,goldenrod:14329120,gray:8421504,green:32768,greenyellow:11403055,grey:8421504,honeydew:15794160,hotpink:16738740,indianred:13458524,indigo:4915330,ivory:16777200,khaki:15787660,lavender:15132410,lavenderblush:16773365,lawngreen:8190976,lemonchiffon:16775885,lightblue:11393254,lightcoral:15761536,lightcyan:14745599,lightgoldenrodyellow:16448210,lightgray:13882323,lightgreen:9498256,lightgrey:13882323,lightpink:16758465,lightsalmon:16752762,lightseagreen:2142890,lightskyblue:8900346,lightslategray:7833753,lightslategrey:7833753,lightsteelblue:11584734,lightyellow:16777184,lime:65280,limegreen:3329330,linen:16445670,magenta:16711935,maroon:8388608,mediumaquamarine:6737322,mediumblue:205,mediumorchid:12211667,mediumpurple:9662683,mediumseagreen:3978097,mediumslateblue:8087790,mediumspringgreen:64154,mediumturquoise:4772300,mediumvioletred:13047173,midnightblue:1644912,mintcream:16121850,mistyrose:16770273,moccasin:16770229,navajowhite:16768685,navy:128,oldlace:16643558,olive:8421376,olivedrab:7048739,orange:16753920,orangered:16729344,orchid:14315734,palegoldenrod:15657130,palegreen:10025880,paleturquoise:11529966,palevioletred:14381203,papayawhip:16773077,peachpuff:16767673,peru:13468991,pink:16761035,plum:14524637,powderblue:11591910,purple:8388736,rebeccapurple:6697881,red:16711680,rosybrown:12357519,royalblue:4286945,saddlebrown:9127187,salmon:16416882,sandybrown:16032864,seagreen:3050327,seashell:16774638,sienna:10506797,silver:12632256,skyblue:8900331,slateblue:6970061,slategray:7372944,slategrey:7372944,snow:16775930,springgreen:65407,steelblue:4620980,tan:13808780,teal:32896,thistle:14204888,tomato:16737095,turquoise:4251856,violet:15631086,wheat:16113331,white:16777215,whitesmoke:16119285,yellow:16776960,yellowgreen:10145074},gr={h:0,s:0,l:0},hc={h:0,s:0,l:0};function gf(i,e,t){return t<0&&(t+=1),t>1&&(t-=1),t<1/6?i+(e-i)*6*t:t<1/2?e:t<2/3?i+(e-i)*6*(2/3-t):i}var ft=class{constructor(e,t,n){return this.isColor=!0,this.r=1,this.g=1,this.b=1,this.set(e,t,n)}set(e,t,n){if(t===void 0&&n===void 0){let s=e;s&&s.isColor?this.copy(s):typeof s=="number"?this.setHex(s):typeof s=="string"&&this.setStyle(s)}else this.setRGB(e,t,n);return this}setScalar(e){return this.r=e,this.g=e,this.b=e,this}setHex(e,t=Un){return e=Math.floor(e),this.r=(e>>16&255)/255,this.g=(e>>8&255)/255,this.b=(e&255)/255,Ct.colorSpaceToWorking(this,t),this}setRGB(e,t,n,s=Ct.workingColorSpace){return this.r=e,this.g=t,this.b=n,Ct.colorSpaceToWorking(this,s),this}setHSL(e,t,n,s=Ct.workingColorSpace){if(e=_d(e,1),t=Rt(t,0,1),n=Rt(n,0,1),t===0)this.r=this.g=this.b=n;else{let r=n<=.5?n*(1+t):n+t-n*t,o=2*n-r;this.r=gf(o,r,e+1/3),this.g=gf(o,r,e),this.b=gf(o,r,e-1/3)}return Ct.colorSpaceToWorking(this,s),this}setStyle(e,t=Un){function n(r){r!==void 0&&parseFloat(r)<1&&nt("Color: Alpha component of "+e+" will be ignored.")}let s;if(s=/^(\w+)\(([^\)]*)\)/.exec(e)){let r,o=s[1],a=s[2];switch(o){case"rgb":case"rgba":if(r=/^\s*(\d+)\s*,\s*(\d+)\s*,\s*(\d+)\s*(?:,\s*(\d+(?:\.\d+)?|\.\d+)\s*)?$/.exec(a))return n(r[4]),this.setRGB(Math.min(255,parseInt(r[1],10))/255,Math.min(255,parseInt(r[2],10))/255,Math.min(255,parseInt(r[3],10))/255,t);if(r=/^\s*(\d+(?:\.\d+)?|\.\d+)\%\s*,\s*(\d+(?:\.\d+)?|\.\d+)\%\s*,\s*(\d+(?:\.\d+)?|\.\d+)\%\s*(?:,\s*(\d+(?:\.\d+)?|\.\d+)\s*)?$/.exec(a))return n(r[4]),this.setRGB(Math.min(100,parseFloat(r[1]))/100,Math.min(100,parseFloat(r[2]))/100,Math.min(100,parseFloat(r[3]))/100,t);break;case"hsl":case"hsla":if(r=/^\s*([+-]?(?:\d+(?:\.\d+)?|\.\d+))\s*,\s*(\d+(?:\.\d+)?|\.\d+)\%\s*,\s*(\d+(?:\.\d+)?|\.\d+)\%\s*(?:,\s*(\d+(?:\.\d+)?|\.\d+)\s*)?$/.exec(a))return n(r[4]),this.setHSL(parseFloat(r[1])/360,parseFloat(r[2])/100,parseFloat(r[3])/100,t);break;default:nt("Color: Unknown color model "+e)}}else if(s=/^\#([A-Fa-f\d]+)$/.exec(e)){let r=s[1],o=r.length;if(o===3)return this.setRGB(parseInt(r.charAt(0),16)/15,parseInt(r.charAt(1),16)/15,parseInt(r.charAt(2),16)/15,t);if(o===6)return this.setHex(parseInt(r,16),t);nt("Color: Invalid hex color "+e)}else if(e&&e.length>0)return this.setColorName(e,t);return this}setColorName(e,t=Un){let n=V0[e.toLowerCase()];return n!==void 0?this.setHex(n,t):nt("Color: Unknown color "+e),this}clone(){return new this.constructor(this.r,this.g,this.b)}copy(e){return this.r=e.r,this.g=e.g,this.b=e.b,this}copySRGBToLinear(e){return this.r=zs(e.r),this.g=zs(e.g),this.b=zs(e.b),this}copyLinearToSRGB(e){return this.r=Ho(e.r),this.g=Ho(e.g),this.b=Ho(e.b),this}convertSRGBToLinear(){return this.copySRGBToLinear(this),this}convertLinearToSRGB(){return this.copyLinearToSRGB(this),this}getHex(e=Un){return Ct.workingToColorSpace(jn.copy(this),e),Math.round(Rt(jn.r*255,0,255))*65536+Math.round(Rt(jn.g*255,0,255))*256+Math.round(Rt(jn.b*255,0,255))}getHexString(e=Un){return("000000"+this.getHex(e).toString(16)).slice(-6)}getHSL(e,t=Ct.workingColorSpace){Ct.workingToColorSpace(jn.copy(this),t);let n=jn.r,s=jn.g,r=jn.b,o=Math.max(n,s,r),a=Math.min(n,s,r),l,c,h=(a+o)/2;if(a===o)l=0,c=0;else{let u=o-a;switch(c=h<=.5?u/(o+a):u/(2-o-a),o){case n:l=(s-r)/u+(s<r?6:0);break;case s:l=(r-n)/u+2;break;case r:l=(n-s)/u+4;break}l/=6}return e.h=l,e.s=c,e.l=h,e}getRGB(e,t=Ct.workingColorSpace){return Ct.workingToColorSpace(jn.copy(this),t),e.r=jn.r,e.g=jn.g,e.b=jn.b,e}getStyle(e=Un){Ct.workingToColorSpace(jn.copy(this),e);let t=jn.r,n=jn.g,s=jn.b;return e!==Un?`color(${e} ${t.toFixed(3)} ${n.toFixed(3)} ${s.toFixed(3)})`:`rgb(${Math.round(t*255)},${Math.round(n*255)},${Math.round(s*255)})`}offsetHSL(e,t,n){return this.getHSL(gr),this.setHSL(gr.h+e,gr.s+t,gr.l+n)}add(e){return this.r+=e.r,this.g+=e.g,this.b+=e.b,this}addColors(e,t){return this.r=e.r+t.r,this.g=e.g+t.g,this.b=e.b+t.b,this}addScalar(e){return this.r+=e,this.g+=e,this.b+=e,this}sub(e){return this.r=Math.max(0,this.r-e.r),this.g=Math.max(0,this.g-e.g),this.b=Math.max(0,this.b-e.b),this}multiply(e){return this.r*=e.r,this.g*=e.g,this.b*=e.b,this}multiplyScalar(e){return this.r*=e,this.g*=e,this.b*=e,this}lerp(e,t){return this.r+=(e.r-this.r)*t,this.g+=(e.g-this.g)*t,this.b+=(e.b-this.b)*t,this}lerpColors(e,t,n){return this.r=e.r+(t.r-e.r)*n,this.g=e.g+(t.g-e.g)*n,this.b=e.b+(t.b-e.b)*n,this}lerpHSL(e,t){this.getHSL(gr),e.getHSL(hc);let n=qa(gr.h,hc.h,t),s=qa(gr.s,hc.s,t),r=qa(gr.l,hc.l,t);return this.setHSL(n,s,r),this}setFromVector3(e){return this.r=e.x,this.g=e.y,this.b=e.z,this}applyMatrix3(e){let t=this.r,n=this.g,s=this.b,r=e.elements;return this.r=r[0]*t+r[3]*n+r[6]*s,this.g=r[1]*t+r[4]*n+r[7]*s,this.b=r[2]*t+r[5]*n+r[8]*s,this}equals(e){return e.r===this.r&&e.g===this.g&&e.b===this.b}fromArray(e,t=0){return this.r=e[t],this.g=e[t+1],this.b=e[t+2],this}toArray(e=[],t=0){return e[t]=this.r,e[t+1]=this.g,e[t+2]=this.b,e}fromBufferAttribute(e,t){return this.r=e.getX(t),this.g=e.getY(t),this.b=e.getZ(t),this}toJSON(){return this.getHex()}*[Symbol.iterator](){yield this.r,yield this.g,yield this.b}},jn=new ft;ft.NAMES=V0;var Vs=class extends xn{constructor(){super(),this.isScene=!0,this.type="Scene",this.background=null,this.environment=null,this.fog=null,this.backgroundBlurriness=0,this.backgroundIntensity=1,this.backgroundRotation=new Gs,this.environmentIntensity=1,this.environmentRotation=new Gs,this.overrideMaterial=null,typeof __THREE_DEVTOOLS__<"u"&&__THREE_DEVTOOLS__.dispatchEvent(new CustomEvent("observe",{detail:this}))}copy(e,t){return super.copy(e,t),this.background=e.background!==null?e.background.clone():null,this.environment=e.environment!==null?e.environment.clone():null,this.fog=e.fog!==null?e.fog.clone():null,this.backgroundBlurriness=e.backgroundBlurriness,this.backgroundIntensity=e.backgroundIntensity,this.backgroundRotation.copy(e.backgroundRotation),this.environmentIntensity=e.environmentIntensity,this.environmentRotation.copy(e.environmentRotation),this.overrideMaterial=e.overrideMaterial!==null?e.overrideMaterial.clone():null,this.matrixAutoUpdate=e.matrixAutoUpdate,this}toJSON(e){let t=super.toJSON(e);return this.fog!==null&&(t.object.fog=this.fog.toJSON()),t.object.backgroundBlurriness=this.backgroundBlurriness,t.object.backgroundIntensity=this.backgroundIntensity,t.object.backgroundRotation=this.backgroundRotation.toArray(),t.object.environmentIntensity=this.environmentIntensity,t.object.environmentRotation=this.environmentRotation.toArray(),t}},is=new Q,Ns=new Q,_f=new Q,Us=new Q,Po=new Q,Lo=new Q,Ng=new Q,xf=new Q,vf=new Q,yf=new Q,Sf=new $t,Mf=new $t,bf=new $t,Sr=class i{constructor(e=new Q,t=new Q,n=new Q){this.a=e,this.b=t,this.c=n}static getNormal(e,t,n,s){s.subVectors(n,t),is.subVectors(e,t),s.cross(is);let r=s.lengthSq();return r>0?s.multiplyScalar(1/Math.sqrt(r)):s.set(0,0,0)}static getBarycoord(e,t,n,s,r){is.subVectors(s,t),Ns.subVectors(n,t),_f.subVectors(e,t);let o=is.dot(is),a=is.dot(Ns),l=is.dot(_f),c=Ns.dot(Ns),h=Ns.dot(_f),u=o*c-a*a;if(u===0)return r.set(0,0,0),null;let f=1/u,p=(c*l-a*h)*f,x=(o*h-a*l)*f;return r.set(1-p-x,x,p)}static containsPoint(e,t,n,s){return this.getBarycoord(e,t,n,s,Us)===null?!1:Us.x>=0&&Us.y>=0&&Us.x+Us.y<=1}static getInterpolation(e,t,n,s,r,o,a,l){return this.getBarycoord(e,t,n,s,Us)===null?(l.x=0,l.y=0,"z"in l&&(l.z=0),"w"in l&&(l.w=0),null):(l.setScalar(0),l.addScaledVector(r,Us.x),l.addScaledVector(o,Us.y),l.addScaledVector(a,Us.z),l)}static getInterpolatedAttribute(e,t,n,s,r,o){return Sf.setScalar(0),Mf.setScalar(0),bf.setScalar(0),Sf.fromBufferAttribute(e,t),Mf.fromBufferAttribute(e,n),bf.fromBufferAttribute(e,s),o.setScalar(0),o.addScaledVector(Sf,r.x),o.addScaledVector(Mf,r.y),o.addScaledVector(bf,r.z),o}static isFrontFacing(e,t,n,s){return is.subVectors(n,t),Ns.subVectors(e,t),is.cross(Ns).dot(s)<0}set(e,t,n){return this.a.copy(e),this.b.copy(t),this.c.copy(n),this}setFromPointsAndIndices(e,t,n,s){return this.a.copy(e[t]),this.b.copy(e[n]),this.c.copy(e[s]),this}setFromAttributeAndIndices(e,t,n,s){return this.a.fromBufferAttribute(e,t),this.b.fromBufferAttribute(e,n),this.c.fromBufferAttribute(e,s),this}clone(){return new this.constructor().copy(this)}copy(e){return this.a.copy(e.a),this.b.copy(e.b),this.c.copy(e.c),this}getArea(){return is.subVectors(this.c,this.b),Ns.subVectors(this.a,this.b),is.cross(Ns).length()*.5}getMidpoint(e){return e.addVectors(this.a,this.b).add(this.c).multiplyScalar(1/3)}getNormal(e){return i.getNormal(this.a,this.b,this.c,e)}getPlane(e){return e.setFromCoplanarPoints(this.a,this.b,this.c)}getBarycoord(e,t){return i.getBarycoord(e,this.a,this.b,this.c,t)}getInterpolation(e,t,n,s,r){return i.getInterpolation(e,this.a,this.b,this.c,t,n,s,r)}containsPoint(e){return i.containsPoint(e,this.a,this.b,this.c)}isFrontFacing(e){return i.isFrontFacing(this.a,this.b,this.c,e)}intersectsBox(e){return e.intersectsTriangle(this)}closestPointToPoint(e,t){let n=this.a,s=this.b,r=this.c,o,a;Po.subVectors(s,n),Lo.subVectors(r,n),xf.subVectors(e,n);let l=Po.dot(xf),c=Lo.dot(xf);if(l<=0&&c<=0)return t.copy(n);vf.subVectors(e,s);let h=Po.dot(vf),u=Lo.dot(vf);if(h>=0&&u<=h)return t.copy(s);let f=l*u-h*c;if(f<=0&&l>=0&&h<=0&&l-h>0)return o=l/(l-h),t.copy(n).addScaledVector(Po,o);yf.subVectors(e,r);let p=Po.dot(yf),x=Lo.dot(yf);if(x>=0&&p<=x)return t.copy(r);let M=p*c-l*x;if(M<=0&&c>=0&&x<=0)return a=c/(c-x),t.copy(n).addScaledVector(Lo,a);let g=h*x-p*u;if(g<=0&&u-h>=0&&p-x>=0)return Ng.subVectors(r,s),a=(u-h)/(u-h+(p-x)),t.copy(s).addScaledVector(Ng,a);let _=1/(g+M+f);return o=M*_,a=f*_,t.copy(n).addScaledVector(Po,o).addScaledVector(Lo,a)}equals(e){return e.a.equals(this.a)&&e.b.equals(this.b)&&e.c.equals(this.c)}},ui=class{constructor(e=new Q(1/0,1/0,1/0),t=new Q(-1/0,-1/0,-1/0)){this.isBox3=!0,this.min=e,this.max=t}set(e,t){return this.min.copy(e),this.max.copy(t),this}setFromArray(e){this.makeEmpty();for(let t=0,n=e.length;t<n;t+=3)this.expandByPoint(ss.fromArray(e,t));return this}setFromBufferAttribute(e){this.makeEmpty();for(let t=0,n=e.count;t<n;t++)this.expandByPoint(ss.fromBufferAttribute(e,t));return this}setFromPoints(e){this.makeEmpty();for(let t=0,n=e.length;t<n;t++)this.expandByPoint(e[t]);return this}setFromCenterAndSize(e,t){let n=ss.copy(t).multiplyScalar(.5);return this.min.copy(e).sub(n),this.max.copy(e).add(n),this}setFromObject(e,t=!1){return this.makeEmpty(),this.expandByObject(e,t)}clone(){return new this.constructor().copy(this)}copy(e){return this.min.copy(e.min),this.max.copy(e.max),this}makeEmpty(){return this.min.x=this.min.y=this.min.z=1/0,this.max.x=this.max.y=this.max.z=-1/0,this}isEmpty(){return this.max.x<this.min.x||this.max.y<this.min.y||this.max.z<this.min.z}getCenter(e){return this.isEmpty()?e.set(0,0,0):e.addVectors(this.min,this.max).multiplyScalar(.5)}getSize(e){return this.isEmpty()?e.set(0,0,0):e.subVectors(this.max,this.min)}expandByPoint(e){return this.min.min(e),this.max.max(e),this}expandByVector(e){return this.min.sub(e),this.max.add(e),this}expandByScalar(e){return this.min.addScalar(-e),this.max.addScalar(e),this}expandByObject(e,t=!1){e.updateWorldMatrix(!1,!1);let n=e.geometry;if(n!==void 0){let r=n.getAttribute("position");if(t===!0&&r!==void 0&&e.isInstancedMesh!==!0&&e.isBatchedMesh!==!0)for(let o=0,a=r.count;o<a;o++)e.isMesh===!0?e.getVertexPosition(o,ss):ss.fromBufferAttribute(r,o),ss.applyMatrix4(e.matrixWorld),this.expandByPoint(ss);else e.boundingBox!==void 0?(e.boundingBox===null&&e.computeBoundingBox(),uc.copy(e.boundingBox)):(n.boundingBox===null&&n.computeBoundingBox(),uc.copy(n.boundingBox)),uc.applyMatrix4(e.matrixWorld),this.union(uc)}let s=e.children;for(let r=0,o=s.length;r<o;r++)this.expandByObject(s[r],t);return this}containsPoint(e){return e.x>=this.min.x&&e.x<=this.max.x&&e.y>=this.min.y&&e.y<=this.max.y&&e.z>=this.min.z&&e.z<=this.max.z}containsBox(e){return this.min.x<=e.min.x&&e.max.x<=this.max.x&&this.min.y<=e.min.y&&e.max.y<=this.max.y&&this.min.z<=e.min.z&&e.max.z<=this.max.z}getParameter(e,t){return t.set((e.x-this.min.x)/(this.max.x-this.min.x),(e.y-this.min.y)/(this.max.y-this.min.y),(e.z-this.min.z)/(this.max.z-this.min.z))}intersectsBox(e){return e.max.x>=this.min.x&&e.min.x<=this.max.x&&e.max.y>=this.min.y&&e.min.y<=this.max.y&&e.max.z>=this.min.z&&e.min.z<=this.max.z}intersectsSphere(e){return this.clampPoint(e.center,ss),ss.distanceToSquared(e.center)<=e.radius*e.radius}intersectsPlane(e){let t,n;return e.normal.x>0?(t=e.normal.x*this.min.x,n=e.normal.x*this.max.x):(t=e.normal.x*this.max.x,n=e.normal.x*this.min.x),e.normal.y>0?(t+=e.normal.y*this.min.y,n+=e.normal.y*this.max.y):(t+=e.normal.y*this.max.y,n+=e.normal.y*this.min.y),e.normal.z>0?(t+=e.normal.z*this.min.z,n+=e.normal.z*this.max.z):(t+=e.normal.z*this.max.z,n+=e.normal.z*this.min.z),t<=-e.constant&&n>=-e.constant}intersectsTriangle(e){if(this.isEmpty())return!1;this.getCenter(Fa),fc.subVectors(this.max,Fa),Do.subVectors(e.a,Fa),No.subVectors(e.b,Fa),Uo.subVectors(e.c,Fa),_r.subVectors(No,Do),xr.subVectors(Uo,No),Hr.subVectors(Do,Uo);let t=[0,-_r.z,_r.y,0,-xr.z,xr.y,0,-Hr.z,Hr.y,_r.z,0,-_r.x,xr.z,0,-xr.x,Hr.z,0,-Hr.x,-_r.y,_r.x,0,-xr.y,xr.x,0,-Hr.y,Hr.x,0];return!wf(t,Do,No,Uo,fc)||(t=[1,0,0,0,1,0,0,0,1],!wf(t,Do,No,Uo,fc))?!1:(dc.crossVectors(_r,xr),t=[dc.x,dc.y,dc.z],wf(t,Do,No,Uo,fc))}clampPoint(e,t){return t.copy(e).clamp(this.min,this.max)}distanceToPoint(e){return this.clampPoint(e,ss).distanceTo(e)}getBoundingSphere(e){return this.isEmpty()?e.makeEmpty():(this.getCenter(e.center),e.radius=this.getSize(ss).length()*.5),e}intersect(e){return this.min.max(e.min),this.max.min(e.max),this.isEmpty()&&this.makeEmpty(),this}union(e){return this.min.min(e.min),this.max.max(e.max),this}applyMatrix4(e){return this.isEmpty()?this:(Os[0].set(this.min.x,this.min.y,this.min.z).applyMatrix4(e),Os[1].set(this.min.x,this.min.y,this.max.z).applyMatrix4(e),Os[2].set(this.min.x,this.max.y,this.min.z).applyMatrix4(e),Os[3].set(this.min.x,this.max.y,this.max.z).applyMatrix4(e),Os[4].set(this.max.x,this.min.y,this.min.z).applyMatrix4(e),Os[5].set(this.max.x,this.min.y,this.max.z).applyMatrix4(e),Os[6].set(this.max.x,this.max.y,this.min.z).applyMatrix4(e),Os[7].set(this.max.x,this.max.y,this.max.z).applyMatrix4(e),this.setFromPoints(Os),this)}translate(e){return this.min.add(e),this.max.add(e),this}equals(e){return e.min.equals(this.min)&&e.max.equals(this.max)}toJSON(){return{min:this.min.toArray(),max:this.max.toArray()}}fromJSON(e){return this.min.fromArray(e.min),this.max.fromArray(e.max),this}},Os=[new Q,new Q,new Q,new Q,new Q,new Q,new Q,new Q],ss=new Q,uc=new ui,Do=new Q,No=new Q,Uo=new Q,_r=new Q,xr=new Q,Hr=new Q,Fa=new Q,fc=new Q,dc=new Q,Gr=new Q;function wf(i,e,t,n,s){for(let r=0,o=i.length-3;r<=o;r+=3){Gr.fromArray(i,r);let a=s.x*Math.abs(Gr.x)+s.y*Math.abs(Gr.y)+s.z*Math.abs(Gr.z),l=e.dot(Gr),c=t.dot(Gr),h=n.dot(Gr);if(Math.max(-Math.max(l,c,h),Math.min(l,c,h))>a)return!1}return!0}var ks=$y();function $y(){let i=new ArrayBuffer(4),e=new Float32Array(i),t=new Uint32Array(i),n=new Uint32Array(512),s=new Uint32Array(512);for(let l=0;l<256;++l){let c=l-127;c<-27?(n[l]=0,n[l|256]=32768,s[l]=24,s[l|256]=24):c<-14?(n[l]=1024>>-c-14,n[l|256]=1024>>-c-14|32768,s[l]=-c-1,s[l|256]=-c-1):c<=15?(n[l]=c+15<<10,n[l|256]=c+15<<10|32768,s[l]=13,s[l|256]=13):c<128?(n[l]=31744,n[l|256]=64512,s[l]=24,s[l|256]=24):(n[l]=31744,n[l|256]=64512,s[l]=13,s[l|256]=13)}let r=new Uint32Array(2048),o=new Uint32Array(64),a=new Uint32Array(64);for(let l=1;l<1024;++l){let c=l<<13,h=0;for(;(c&8388608)===0;)c<<=1,h-=8388608;c&=-8388609,h+=947912704,r[l]=c|h}for(let l=1024;l<2048;++l)r[l]=939524096+(l-1024<<13);for(let l=1;l<31;++l)o[l]=l<<23;o[31]=1199570944,o[32]=2147483648;for(let l=33;l<63;++l)o[l]=2147483648+(l-32<<23);o[63]=3347054592;for(let l=1;l<64;++l)l!==32&&(a[l]=1024);return{floatView:e,uint32View:t,baseTable:n,shiftTable:s,mantissaTable:r,exponentTable:o,offsetTable:a}}function Jy(i){Math.abs(i)>65504&&nt("DataUtils.toHalfFloat(): Value out of range."),i=Rt(i,-65504,65504),ks.floatView[0]=i;let e=ks.uint32View[0],t=e>>23&511;return ks.baseTable[t]+((e&8388607)>>ks.shiftTable[t])}function jy(i){let e=i>>10;return ks.uint32View[0]=ks.mantissaTable[ks.offsetTable[e]+(i&1023)]+ks.exponentTable[e],ks.floatView[0]}var Le=class{static toHalfFloat(e){return Jy(e)}static fromHalfFloat(e){return jy(e)}},Cn=new Q,pc=new lt,Qy=0,$n=class extends rs{constructor(e,t,n=!1){if(super(),Array.isArray(e))throw new TypeError("THREE.BufferAttribute: array should be a Typed Array.");this.isBufferAttribute=!0,Object.defineProperty(this,"id",{value:Qy++}),this.name="",this.array=e,this.itemSize=t,this.count=e!==void 0?e.length/t:0,this.normalized=n,this.usage=md,this.updateRanges=[],this.gpuType=Pn,this.version=0,this._normalizationScale=e!==void 0?Xh(e):void 0}onUploadCallback(){}set needsUpdate(e){e===!0&&this.version++}setUsage(e){return this.usage=e,this}addUpdateRange(e,t){this.updateRanges.push({start:e,count:t})}clearUpdateRanges(){this.updateRanges.length=0}copy(e){return this.name=e.name,this.array=new e.array.constructor(e.array),this.itemSize=e.itemSize,this.count=e.count,this.normalized=e.normalized,this.usage=e.usage,this.gpuType=e.gpuType,this._normalizationScale=e._normalizationScale,this}copyAt(e,t,n){e*=this.itemSize,n*=t.itemSize;for(let s=0,r=this.itemSize;s<r;s++)this.array[e+s]=t.array[n+s];return this}copyArray(e){return this.array.set(e),this}applyMatrix3(e){if(this.itemSize===2)for(let t=0,n=this.count;t<n;t++)pc.fromBufferAttribute(this,t),pc.applyMatrix3(e),this.setXY(t,pc.x,pc.y);else if(this.itemSize===3)for(let t=0,n=this.count;t<n;t++)Cn.fromBufferAttribute(this,t),Cn.applyMatrix3(e),this.setXYZ(t,Cn.x,Cn.y,Cn.z);return this}applyMatrix4(e){for(let t=0,n=this.count;t<n;t++)Cn.fromBufferAttribute(this,t),Cn.applyMatrix4(e),this.setXYZ(t,Cn.x,Cn.y,Cn.z);return this}applyNormalMatrix(e){for(let t=0,n=this.count;t<n;t++)Cn.fromBufferAttribute(this,t),Cn.applyNormalMatrix(e),this.setXYZ(t,Cn.x,Cn.y,Cn.z);return this}transformDirection(e){for(let t=0,n=this.count;t<n;t++)Cn.fromBufferAttribute(this,t),Cn.transformDirection(e),this.setXYZ(t,Cn.x,Cn.y,Cn.z);return this}set(e,t=0){return this.array.set(e,t),this}getComponent(e,t){let n=this.array[e*this.itemSize+t];return this.normalized&&(n=this._denormalize(n)),n}setComponent(e,t,n){return this.normalized&&(n=this._normalize(n)),this.array[e*this.itemSize+t]=n,this}getX(e){let t=this.array[e*this.itemSize];return this.normalized&&(t=this._denormalize(t)),t}setX(e,t){return this.normalized&&(t=this._normalize(t)),this.array[e*this.itemSize]=t,this}getY(e){let t=this.array[e*this.itemSize+1];return this.normalized&&(t=this._denormalize(t)),t}setY(e,t){return this.normalized&&(t=this._normalize(t)),this.array[e*this.itemSize+1]=t,this}getZ(e){let t=this.array[e*this.itemSize+2];return this.normalized&&(t=this._denormalize(t)),t}setZ(e,t){return this.normalized&&(t=this._normalize(t)),this.array[e*this.itemSize+2]=t,this}getW(e){let t=this.array[e*this.itemSize+3];return this.normalized&&(t=this._denormalize(t)),t}setW(e,t){return this.normalized&&(t=this._normalize(t)),this.array[e*this.itemSize+3]=t,this}setXY(e,t,n){return e*=this.itemSize,this.normalized&&(t=this._normalize(t),n=this._normalize(n)),this.array[e+0]=t,this.array[e+1]=n,this}setXYZ(e,t,n,s){return e*=this.itemSize,this.normalized&&(t=this._normalize(t),n=this._normalize(n),s=this._normalize(s)),this.array[e+0]=t,this.array[e+1]=n,this.array[e+2]=s,this}setXYZW(e,t,n,s,r){return e*=this.itemSize,this.normalized&&(t=this._normalize(t),n=this._normalize(n),s=this._normalize(s),r=this._normalize(r)),this.array[e+0]=t,this.array[e+1]=n,this.array[e+2]=s,this.array[e+3]=r,this}onUpload(e){return this.onUploadCallback=e,this}clone(){return new this.constructor(this.array,this.itemSize).copy(this)}toJSON(){let e={itemSize:this.itemSize,type:this.array.constructor.name,array:Array.from(this.array),normalized:this.normalized};return e.name=this.name,e.usage=this.usage,e.gpuType=this.gpuType,e}dispose(){this.dispatchEvent({type:"dispose"})}_denormalize(e){let t=this._normalizationScale;return t!==void 0?Math.max(e/t,-1):vd(e,this.array)}_normalize(e){let t=this._normalizationScale;return t!==void 0?Math.round(e*t):yd(e,this.array)}};var Ja=class extends $n{constructor(e,t,n){super(new Uint16Array(e),t,n)}};var ja=class extends $n{constructor(e,t,n){super(new Uint32Array(e),t,n)}};var ci=class extends $n{constructor(e,t,n){super(new Float32Array(e),t,n)}},eS=new ui,Ba=new Q,Ef=new Q,_i=class{constructor(e=new Q,t=-1){this.isSphere=!0,this.center=e,this.radius=t}set(e,t){return this.center.copy(e),this.radius=t,this}setFromPoints(e,t){let n=this.center;t!==void 0?n.copy(t):eS.setFromPoints(e).getCenter(n);let s=0;for(let r=0,o=e.length;r<o;r++)s=Math.max(s,n.distanceToSquared(e[r]));return this.radius=Math.sqrt(s),this}copy(e){return this.center.copy(e.center),this.radius=e.radius,this}isEmpty(){return this.radius<0}makeEmpty(){return this.center.set(0,0,0),this.radius=-1,this}containsPoint(e){return e.distanceToSquared(this.center)<=this.radius*this.radius}distanceToPoint(e){return e.distanceTo(this.center)-this.radius}intersectsSphere(e){let t=this.radius+e.radius;return e.center.distanceToSquared(this.center)<=t*t}intersectsBox(e){return e.intersectsSphere(this)}intersectsPlane(e){return Math.abs(e.distanceToPoint(this.center))<=this.radius}clampPoint(e,t){let n=this.center.distanceToSquared(e);return t.copy(e),n>this.radius*this.radius&&(t.sub(this.center).normalize(),t.multiplyScalar(this.radius).add(this.center)),t}getBoundingBox(e){return this.isEmpty()?(e.makeEmpty(),e):(e.set(this.center,this.center),e.expandByScalar(this.radius),e)}applyMatrix4(e){return this.center.applyMatrix4(e),this.radius=this.radius*e.getMaxScaleOnAxis(),this}translate(e){return this.center.add(e),this}expandByPoint(e){if(this.isEmpty())return this.center.copy(e),this.radius=0,this;Ba.subVectors(e,this.center);let t=Ba.lengthSq();if(t>this.radius*this.radius){let n=Math.sqrt(t),s=(n-this.radius)*.5;this.center.addScaledVector(Ba,s/n),this.radius+=s}return this}union(e){return e.isEmpty()?this:this.isEmpty()?(this.copy(e),this):(this.center.equals(e.center)===!0?this.radius=Math.max(this.radius,e.radius):(Ef.subVectors(e.center,this.center).setLength(e.radius),this.expandByPoint(Ba.copy(e.center).add(Ef)),this.expandByPoint(Ba.copy(e.center).sub(Ef))),this)}equals(e){return e.center.equals(this.center)&&e.radius===this.radius}clone(){return new this.constructor().copy(this)}toJSON(){return{radius:this.radius,center:this.center.toArray()}}fromJSON(e){return this.radius=e.radius,this.center.fromArray(e.center),this}},tS=0,Hi=new Mt,Tf=new xn,Oo=new Q,Pi=new ui,ka=new ui,Xn=new Q,Qn=class i extends rs{constructor(){super(),this.isBufferGeometry=!0,Object.defineProperty(this,"id",{value:tS++}),this.uuid=ws(),this.name="",this.type="BufferGeometry",this.index=null,this.indirect=null,this.indirectOffset=0,this.attributes={},this.morphAttributes={},this.morphTargetsRelative=!1,this.groups=[],this.boundingBox=null,this.boundingSphere=null,this.drawRange={start:0,count:1/0},this.userData={},this._transformed=!1}getIndex(){return this.index}setIndex(e){return Array.isArray(e)?this.index=new(by(e)?ja:Ja)(e,1):this.index=e,this}setIndirect(e,t=0){return this.indirect=e,this.indirectOffset=t,this}getIndirect(){return this.indirect}getAttribute(e){return this.attributes[e]}setAttribute(e,t){return this.attributes[e]=t,this}deleteAttribute(e){return delete this.attributes[e],this}hasAttribute(e){return this.attributes[e]!==void 0}addGroup(e,t,n=0){this.groups.push({start:e,count:t,materialIndex:n})}clearGroups(){this.groups=[]}setDrawRange(e,t){this.drawRange.start=e,this.drawRange.count=t}applyMatrix4(e){let t=this.attributes.position;t!==void 0&&(t.applyMatrix4(e),t.needsUpdate=!0);let n=this.attributes.normal;if(n!==void 0){let r=new yt().getNormalMatrix(e);n.applyNormalMatrix(r),n.needsUpdate=!0}let s=this.attributes.tangent;return s!==void 0&&(s.transformDirection(e),s.needsUpdate=!0),this.boundingBox!==null&&this.computeBoundingBox(),this.boundingSphere!==null&&this.computeBoundingSphere(),this._transformed=!0,this}applyQuaternion(e){return Hi.makeRotationFromQuaternion(e),this.applyMatrix4(Hi),this}rotateX(e){return Hi.makeRotationX(e),this.applyMatrix4(Hi),this}rotateY(e){return Hi.makeRotationY(e),this.applyMatrix4(Hi),this}rotateZ(e){return Hi.makeRotationZ(e),this.applyMatrix4(Hi),this}translate(e,t,n){return Hi.makeTranslation(e,t,n),this.applyMatrix4(Hi),this}scale(e,t,n){return Hi.makeScale(e,t,n),this.applyMatrix4(Hi),this}lookAt(e){return Tf.lookAt(e),Tf.updateMatrix(),this.applyMatrix4(Tf.matrix),this}center(){return this.computeBoundingBox(),this.boundingBox.getCenter(Oo).negate(),this.translate(Oo.x,Oo.y,Oo.z),this}setFromPoints(e){let t=this.getAttribute("position");if(t===void 0){let n=[];for(let s=0,r=e.length;s<r;s++){let o=e[s];n.push(o.x,o.y,o.z||0)}this.setAttribute("position",new ci(n,3))}else{let n=Math.min(e.length,t.count);for(let s=0;s<n;s++){let r=e[s];t.setXYZ(s,r.x,r.y,r.z||0)}e.length>t.count&&nt("BufferGeometry: Buffer size too small for points data. Use .dispose() and create a new geometry."),t.needsUpdate=!0}return this}computeBoundingBox(){this.boundingBox===null&&(this.boundingBox=new ui);let e=this.attributes.position,t=this.morphAttributes.position;if(e&&e.isGLBufferAttribute){gt("BufferGeometry.computeBoundingBox(): GLBufferAttribute requires a manual bounding box.",this),this.boundingBox.set(new Q(-1/0,-1/0,-1/0),new Q(1/0,1/0,1/0));return}if(e!==void 0){if(this.boundingBox.setFromBufferAttribute(e),t)for(let n=0,s=t.length;n<s;n++){let r=t[n];Pi.setFromBufferAttribute(r),this.morphTargetsRelative?(Xn.addVectors(this.boundingBox.min,Pi.min),this.boundingBox.expandByPoint(Xn),Xn.addVectors(this.boundingBox.max,Pi.max),this.boundingBox.expandByPoint(Xn)):(this.boundingBox.expandByPoint(Pi.min),this.boundingBox.expandByPoint(Pi.max))}}else this.boundingBox.makeEmpty();(isNaN(this.boundingBox.min.x)||isNaN(this.boundingBox.min.y)||isNaN(this.boundingBox.min.z))&&gt('BufferGeometry.computeBoundingBox(): Computed min/max have NaN values. The "position" attribute is likely to have NaN values.',this)}computeBoundingSphere(){this.boundingSphere===null&&(this.boundingSphere=new _i);let e=this.attributes.position,t=this.morphAttributes.position;if(e&&e.isGLBufferAttribute){gt("BufferGeometry.computeBoundingSphere(): GLBufferAttribute requires a manual bounding sphere.",this),this.boundingSphere.set(new Q,1/0);return}if(e){let n=this.boundingSphere.center;if(Pi.setFromBufferAttribute(e),t)for(let r=0,o=t.length;r<o;r++){let a=t[r];ka.setFromBufferAttribute(a),this.morphTargetsRelative?(Xn.addVectors(Pi.min,ka.min),Pi.expandByPoint(Xn),Xn.addVectors(Pi.max,ka.max),Pi.expandByPoint(Xn)):(Pi.expandByPoint(ka.min),Pi.expandByPoint(ka.max))}Pi.getCenter(n);let s=0;for(let r=0,o=e.count;r<o;r++)Xn.fromBufferAttribute(e,r),s=Math.max(s,n.distanceToSquared(Xn));if(t)for(let r=0,o=t.length;r<o;r++){let a=t[r],l=this.morphTargetsRelative;for(let c=0,h=a.count;c<h;c++)Xn.fromBufferAttribute(a,c),l&&(Oo.fromBufferAttribute(e,c),Xn.add(Oo)),s=Math.max(s,n.distanceToSquared(Xn))}this.boundingSphere.radius=Math.sqrt(s),isNaN(this.boundingSphere.radius)&&gt('BufferGeometry.computeBoundingSphere(): Computed radius is NaN. The "position" attribute is likely to have NaN values.',this)}}computeTangents(){let e=this.index,t=this.attributes;if(e===null||t.position===void 0||t.normal===void 0||t.uv===void 0){gt("BufferGeometry: .computeTangents() failed. Missing required attributes (index, position, normal or uv)");return}let n=t.position,s=t.normal,r=t.uv,o=this.getAttribute("tangent");(o===void 0||o.count!==n.count)&&(o=new $n(new Float32Array(4*n.count),4),this.setAttribute("tangent",o));let a=[],l=[],c=new Uint8Array(n.count);for(let G=0;G<n.count;G++)a[G]=new Q,l[G]=new Q;let h=new Q,u=new Q,f=new Q,p=new lt,x=new lt,M=new lt,g=new Q,_=new Q;function b(G,k,O){c[G]=c[k]=c[O]=1,h.fromBufferAttribute(n,G),u.fromBufferAttribute(n,k),f.fromBufferAttribute(n,O),p.fromBufferAttribute(r,G),x.fromBufferAttribute(r,k),M.fromBufferAttribute(r,O),u.sub(h),f.sub(h),x.sub(p),M.sub(p);let Y=1/(x.x*M.y-M.x*x.y);isFinite(Y)&&(g.copy(u).multiplyScalar(M.y).addScaledVector(f,-x.y).multiplyScalar(Y),_.copy(f).multiplyScalar(x.x).addScaledVector(u,-M.x).multiplyScalar(Y),a[G].add(g),a[k].add(g),a[O].add(g),l[G].add(_),l[k].add(_),l[O].add(_))}let P=this.groups;P.length===0&&(P=[{start:0,count:e.count}]);for(let G=0,k=P.length;G<k;++G){let O=P[G],Y=O.start,Z=O.count;for(let U=Y,W=Y+Z;U<W;U+=3)b(e.getX(U+0),e.getX(U+1),e.getX(U+2))}let w=new Q,D=new Q,I=new Q,y=new Q;function T(G){I.fromBufferAttribute(s,G),y.copy(I);let k=a[G];w.copy(k),w.sub(I.multiplyScalar(I.dot(k))).normalize(),D.crossVectors(y,k);let Y=D.dot(l[G])<0?-1:1;o.setXYZW(G,w.x,w.y,w.z,Y)}for(let G=0,k=n.count;G<k;++G)c[G]&&T(G);this._transformed=!0}computeVertexNormals(){let e=this.index,t=this.getAttribute("position");if(t!==void 0){let n=this.getAttribute("normal");if(n===void 0||n.count!==t.count)n=new $n(new Float32Array(t.count*3),3),this.setAttribute("normal",n);else for(let f=0,p=n.count;f<p;f++)n.setXYZ(f,0,0,0);let s=new Q,r=new Q,o=new Q,a=new Q,l=new Q,c=new Q,h=new Q,u=new Q;if(e)for(let f=0,p=e.count;f<p;f+=3){let x=e.getX(f+0),M=e.getX(f+1),g=e.getX(f+2);s.fromBufferAttribute(t,x),r.fromBufferAttribute(t,M),o.fromBufferAttribute(t,g),h.subVectors(o,r),u.subVectors(s,r),h.cross(u),a.fromBufferAttribute(n,x),l.fromBufferAttribute(n,M),c.fromBufferAttribute(n,g),a.add(h),l.add(h),c.add(h),n.setXYZ(x,a.x,a.y,a.z),n.setXYZ(M,l.x,l.y,l.z),n.setXYZ(g,c.x,c.y,c.z)}else for(let f=0,p=t.count;f<p;f+=3)s.fromBufferAttribute(t,f+0),r.fromBufferAttribute(t,f+1),o.fromBufferAttribute(t,f+2),h.subVectors(o,r),u.subVectors(s,r),h.cross(u),n.setXYZ(f+0,h.x,h.y,h.z),n.setXYZ(f+1,h.x,h.y,h.z),n.setXYZ(f+2,h.x,h.y,h.z);this.normalizeNormals(),n.needsUpdate=!0}}normalizeNormals(){let e=this.attributes.normal;for(let t=0,n=e.count;t<n;t++)Xn.fromBufferAttribute(e,t),Xn.normalize(),e.setXYZ(t,Xn.x,Xn.y,Xn.z)}toNonIndexed(){function e(a,l){let c=a.array,h=a.itemSize,u=a.normalized,f=new c.constructor(l.length*h),p=0,x=0;for(let M=0,g=l.length;M<g;M++){a.isInterleavedBufferAttribute?p=l[M]*a.data.stride+a.offset:p=l[M]*h;for(let _=0;_<h;_++)f[x++]=c[p++]}return new $n(f,h,u)}if(this.index===null)return nt("BufferGeometry.toNonIndexed(): BufferGeometry is already non-indexed."),this;let t=new i,n=this.index.array,s=this.attributes;for(let a in s){let l=s[a],c=e(l,n);t.setAttribute(a,c)}let r=this.morphAttributes;for(let a in r){let l=[],c=r[a];for(let h=0,u=c.length;h<u;h++){let f=c[h],p=e(f,n);l.push(p)}t.morphAttributes[a]=l}t.morphTargetsRelative=this.morphTargetsRelative;let o=this.groups;for(let a=0,l=o.length;a<l;a++){let c=o[a];t.addGroup(c.start,c.count,c.materialIndex)}return t}toJSON(){let e={metadata:{version:4.7,type:"BufferGeometry",generator:"BufferGeometry.toJSON"}};if(e.uuid=this.uuid,e.type=this.parameters!==void 0&&this._transformed===!0?"BufferGeometry":this.type,e.name=this.name,Object.keys(this.userData).length>0&&(e.userData=this.userData),this.parameters!==void 0&&this._transformed!==!0){let l=this.parameters;for(let c in l)l[c]!==void 0&&(e[c]=l[c]);return e}e.data={attributes:{}};let t=this.index;t!==null&&(e.data.index={type:t.array.constructor.name,array:Array.prototype.slice.call(t.array)});let n=this.attributes;for(let l in n){let c=n[l];e.data.attributes[l]=c.toJSON(e.data)}let s={},r=!1;for(let l in this.morphAttributes){let c=this.morphAttributes[l],h=[];for(let u=0,f=c.length;u<f;u++){let p=c[u];h.push(p.toJSON(e.data))}h.length>0&&(s[l]=h,r=!0)}r&&(e.data.morphAttributes=s,e.data.morphTargetsRelative=this.morphTargetsRelative);let o=this.groups;o.length>0&&(e.data.groups=JSON.parse(JSON.stringify(o)));let a=this.boundingSphere;return a!==null&&(e.data.boundingSphere=a.toJSON()),e}clone(){return new this.constructor().copy(this)}copy(e){this.index=null,this.attributes={},this.morphAttributes={},this.groups=[],this.boundingBox=null,this.boundingSphere=null;let t={};this.name=e.name;let n=e.index;n!==null&&this.setIndex(n.clone());let s=e.attributes;for(let c in s){let h=s[c];this.setAttribute(c,h.clone(t))}let r=e.morphAttributes;for(let c in r){let h=[],u=r[c];for(let f=0,p=u.length;f<p;f++)h.push(u[f].clone(t));this.morphAttributes[c]=h}this.morphTargetsRelative=e.morphTargetsRelative;let o=e.groups;for(let c=0,h=o.length;c<h;c++){let u=o[c];this.addGroup(u.start,u.count,u.materialIndex)}let a=e.boundingBox;a!==null&&(this.boundingBox=a.clone());let l=e.boundingSphere;return l!==null&&(this.boundingSphere=l.clone()),this.drawRange.start=e.drawRange.start,this.drawRange.count=e.drawRange.count,this.userData=e.userData,this._transformed=e._transformed,this}dispose(){this.dispatchEvent({type:"dispose"})}},Ko=class{constructor(e,t){this.isInterleavedBuffer=!0,this.array=e,this.stride=t,this.count=e!==void 0?e.length/t:0,this.usage=md,this.updateRanges=[],this.version=0,this.uuid=ws()}onUploadCallback(){}set needsUpdate(e){e===!0&&this.version++}setUsage(e){return this.usage=e,this}addUpdateRange(e,t){this.updateRanges.push({start:e,count:t})}clearUpdateRanges(){this.updateRanges.length=0}copy(e){return this.array=new e.array.constructor(e.array),this.count=e.count,this.stride=e.stride,this.usage=e.usage,this}copyAt(e,t,n){e*=this.stride,n*=t.stride;for(let s=0,r=this.stride;s<r;s++)this.array[e+s]=t.array[n+s];return this}set(e,t=0){return this.array.set(e,t),this}clone(e){e.arrayBuffers===void 0&&(e.arrayBuffers={});let t=Ug(this.array);e.arrayBuffers[t]===void 0&&(e.arrayBuffers[t]=this.array.slice(0).buffer);let n=new this.array.constructor(e.arrayBuffers[t]),s=new this.constructor(n,this.stride);return s.setUsage(this.usage),s}onUpload(e){return this.onUploadCallback=e,this}toJSON(e){e.arrayBuffers===void 0&&(e.arrayBuffers={});let t=Ug(this.array);e.arrayBuffers[t]===void 0&&(e.arrayBuffers[t]=Array.from(new Uint32Array(this.array.slice(0).buffer)));let n={uuid:this.uuid,buffer:t,type:this.array.constructor.name,stride:this.stride};return n.usage=this.usage,n}};function Ug(i){return i.buffer._uuid===void 0&&(i.buffer._uuid=ws()),i.byteOffset===0&&i.byteLength===i.buffer.byteLength?i.buffer._uuid:i.buffer._uuid+":"+i.byteOffset+":"+i.byteLength}var li=new Q,$o=class i{constructor(e,t,n,s=!1){this.isInterleavedBufferAttribute=!0,this.name="",this.data=e,this.itemSize=t,this.offset=n,this.normalized=s,this._normalizationScale=e!==void 0?Xh(e.array):void 0}get count(){return this.data.count}get array(){return this.data.array}set needsUpdate(e){this.data.needsUpdate=e}applyMatrix4(e){for(let t=0,n=this.data.count;t<n;t++)li.fromBufferAttribute(this,t),li.applyMatrix4(e),this.setXYZ(t,li.x,li.y,li.z);return this}applyNormalMatrix(e){for(let t=0,n=this.count;t<n;t++)li.fromBufferAttribute(this,t),li.applyNormalMatrix(e),this.setXYZ(t,li.x,li.y,li.z);return this}transformDirection(e){for(let t=0,n=this.count;t<n;t++)li.fromBufferAttribute(this,t),li.transformDirection(e),this.setXYZ(t,li.x,li.y,li.z);return this}getComponent(e,t){let n=this.array[e*this.data.stride+this.offset+t];return this.normalized&&(n=this._denormalize(n)),n}setComponent(e,t,n){return this.normalized&&(n=this._normalize(n)),this.data.array[e*this.data.stride+this.offset+t]=n,this}setX(e,t){return this.normalized&&(t=this._normalize(t)),this.data.array[e*this.data.stride+this.offset]=t,this}setY(e,t){return this.normalized&&(t=this._normalize(t)),this.data.array[e*this.data.stride+this.offset+1]=t,this}setZ(e,t){return this.normalized&&(t=this._normalize(t)),this.data.array[e*this.data.stride+this.offset+2]=t,this}setW(e,t){return this.normalized&&(t=this._normalize(t)),this.data.array[e*this.data.stride+this.offset+3]=t,this}getX(e){let t=this.data.array[e*this.data.stride+this.offset];return this.normalized&&(t=this._denormalize(t)),t}getY(e){let t=this.data.array[e*this.data.stride+this.offset+1];return this.normalized&&(t=this._denormalize(t)),t}getZ(e){let t=this.data.array[e*this.data.stride+this.offset+2];return this.normalized&&(t=this._denormalize(t)),t}getW(e){let t=this.data.array[e*this.data.stride+this.offset+3];return this.normalized&&(t=this._denormalize(t)),t}setXY(e,t,n){return e=e*this.data.stride+this.offset,this.normalized&&(t=this._normalize(t),n=this._normalize(n)),this.data.array[e+0]=t,this.data.array[e+1]=n,this}setXYZ(e,t,n,s){return e=e*this.data.stride+this.offset,this.normalized&&(t=this._normalize(t),n=this._normalize(n),s=this._normalize(s)),this.data.array[e+0]=t,this.data.array[e+1]=n,this.data.array[e+2]=s,this}setXYZW(e,t,n,s,r){return e=e*this.data.stride+this.offset,this.normalized&&(t=this._normalize(t),n=this._normalize(n),s=this._normalize(s),r=this._normalize(r)),this.data.array[e+0]=t,this.data.array[e+1]=n,this.data.array[e+2]=s,this.data.array[e+3]=r,this}clone(e){if(e===void 0){Za("InterleavedBufferAttribute.clone(): Cloning an interleaved buffer attribute will de-interleave buffer data.");let t=[];for(let n=0;n<this.count;n++){let s=n*this.data.stride+this.offset;for(let r=0;r<this.itemSize;r++)t.push(this.data.array[s+r])}return new $n(new this.array.constructor(t),this.itemSize,this.normalized)}else return e.interleavedBuffers===void 0&&(e.interleavedBuffers={}),e.interleavedBuffers[this.data.uuid]===void 0&&(e.interleavedBuffers[this.data.uuid]=this.data.clone(e)),new i(e.interleavedBuffers[this.data.uuid],this.itemSize,this.offset,this.normalized)}toJSON(e){if(e===void 0){Za("InterleavedBufferAttribute.toJSON(): Serializing an interleaved buffer attribute will de-interleave buffer data.");let t=[];for(let n=0;n<this.count;n++){let s=n*this.data.stride+this.offset;for(let r=0;r<this.itemSize;r++)t.push(this.data.array[s+r])}return{itemSize:this.itemSize,type:this.array.constructor.name,array:t,normalized:this.normalized}}else return e.interleavedBuffers===void 0&&(e.interleavedBuffers={}),e.interleavedBuffers[this.data.uuid]===void 0&&(e.interleavedBuffers[this.data.uuid]=this.data.toJSON(e)),{isInterleavedBufferAttribute:!0,itemSize:this.itemSize,data:this.data.uuid,offset:this.offset,normalized:this.normalized}}_denormalize(e){let t=this._normalizationScale;return t!==void 0?Math.max(e/t,-1):vd(e,this.data.array)}_normalize(e){let t=this._normalizationScale;return t!==void 0?Math.round(e*t):yd(e,this.data.array)}},Af=new Q,nS=new Q,iS=new yt,Li=class{constructor(e=new Q(1,0,0),t=0){this.isPlane=!0,this.normal=e,this.constant=t}set(e,t){return this.normal.copy(e),this.constant=t,this}setComponents(e,t,n,s){return this.normal.set(e,t,n),this.constant=s,this}setFromNormalAndCoplanarPoint(e,t){return this.normal.copy(e),this.constant=-t.dot(this.normal),this}setFromCoplanarPoints(e,t,n){let s=Af.subVectors(n,t).cross(nS.subVectors(e,t)).normalize();return this.setFromNormalAndCoplanarPoint(s,e),this}copy(e){return this.normal.copy(e.normal),this.constant=e.constant,this}normalize(){let e=1/this.normal.length();return this.normal.multiplyScalar(e),this.constant*=e,this}negate(){return this.constant*=-1,this.normal.negate(),this}distanceToPoint(e){return this.normal.dot(e)+this.constant}distanceToSphere(e){return this.distanceToPoint(e.center)-e.radius}projectPoint(e,t){return t.copy(e).addScaledVector(this.normal,-this.distanceToPoint(e))}intersectLine(e,t,n=!0){let s=e.delta(Af),r=this.normal.dot(s);if(r===0)return this.distanceToPoint(e.start)===0?t.copy(e.start):null;let o=-(e.start.dot(this.normal)+this.constant)/r;return n===!0&&(o<0||o>1)?null:t.copy(e.start).addScaledVector(s,o)}intersectsLine(e){let t=this.distanceToPoint(e.start),n=this.distanceToPoint(e.end);return t<0&&n>0||n<0&&t>0}intersectsBox(e){return e.intersectsPlane(this)}intersectsSphere(e){return e.intersectsPlane(this)}coplanarPoint(e){return e.copy(this.normal).multiplyScalar(-this.constant)}applyMatrix4(e,t){let n=t||iS.getNormalMatrix(e),s=this.coplanarPoint(Af).applyMatrix4(e),r=this.normal.applyMatrix3(n).normalize();return this.constant=-s.dot(r),this}translate(e){return this.constant-=e.dot(this.normal),this}equals(e){return e.normal.equals(this.normal)&&e.constant===this.constant}clone(){return new this.constructor().copy(this)}toJSON(){return{normal:this.normal.toArray(),constant:this.constant}}fromJSON(e){return this.normal.fromArray(e.normal),this.constant=e.constant,this}},sS=0,xi=class extends rs{constructor(){super(),this.isMaterial=!0,Object.defineProperty(this,"id",{value:sS++}),this.uuid=ws(),this.name="",this.type="Material",this.blending=sa,this.side=bs,this.vertexColors=!1,this.opacity=1,this.transparent=!1,this.alphaHash=!1,this.blendSrc=Jf,this.blendDst=jf,this.blendEquation=no,this.blendSrcAlpha=null,this.blendDstAlpha=null,this.blendEquationAlpha=null,this.blendColor=new ft(0,0,0),this.blendAlpha=0,this.depthFunc=Go,this.depthTest=!0,this.depthWrite=!0,this.stencilWriteMask=255,this.stencilFunc=D0,this.stencilRef=0,this.stencilFuncMask=255,this.stencilFail=Nc,this.stencilZFail=Nc,this.stencilZPass=Nc,this.stencilWrite=!1,this.clippingPlanes=null,this.clipIntersection=!1,this.clipShadows=!1,this.shadowSide=null,this.colorWrite=!0,this.precision=null,this.polygonOffset=!1,this.polygonOffsetFactor=0,this.polygonOffsetUnits=0,this.dithering=!1,this.alphaToCoverage=!1,this.premultipliedAlpha=!1,this.forceSinglePass=!1,this.allowOverride=!0,this.visible=!0,this.toneMapped=!0,this.userData={},this.version=0,this._alphaTest=0}get alphaTest(){return this._alphaTest}set alphaTest(e){this._alphaTest>0!=e>0&&this.version++,this._alphaTest=e}onBeforeRender(){}onBeforeCompile(){}customProgramCacheKey(){return this.onBeforeCompile.toString()}setValues(e){if(e!==void 0)for(let t in e){let n=e[t];if(n===void 0){nt(`Material: parameter '${t}' has value of undefined.`);continue}let s=this[t];if(s===void 0){nt(`Material: '${t}' is not a property of THREE.${this.type}.`);continue}s&&s.isColor?s.set(n):s&&s.isVector2&&n&&n.isVector2||s&&s.isEuler&&n&&n.isEuler||s&&s.isVector3&&n&&n.isVector3?s.copy(n):this[t]=n}}toJSON(e){let t=e===void 0||typeof e=="string";t&&(e={textures:{},images:{}});let n={metadata:{version:4.7,type:"Material",generator:"Material.toJSON"}};n.uuid=this.uuid,n.type=this.type,n.blending=this.blending,n.side=this.side,n.shadowSide=this.shadowSide,n.vertexColors=this.vertexColors,n.opacity=this.opacity,n.transparent=this.transparent,n.blendSrc=this.blendSrc,n.blendDst=this.blendDst,n.blendEquation=this.blendEquation,n.blendSrcAlpha=this.blendSrcAlpha,n.blendDstAlpha=this.blendDstAlpha,n.blendEquationAlpha=this.blendEquationAlpha,n.blendColor=this.blendColor.getHex(),n.blendAlpha=this.blendAlpha,n.depthFunc=this.depthFunc,n.depthTest=this.depthTest,n.depthWrite=this.depthWrite,n.colorWrite=this.colorWrite,n.clipIntersection=this.clipIntersection,n.clipShadows=this.clipShadows,n.stencilWriteMask=this.stencilWriteMask,n.stencilFunc=this.stencilFunc,n.stencilRef=this.stencilRef,n.stencilFuncMask=this.stencilFuncMask,n.stencilFail=this.stencilFail,n.stencilZFail=this.stencilZFail,n.stencilZPass=this.stencilZPass,n.stencilWrite=this.stencilWrite,n.polygonOffset=this.polygonOffset,n.polygonOffsetFactor=this.polygonOffsetFactor,n.polygonOffsetUnits=this.polygonOffsetUnits,n.dithering=this.dithering,n.alphaTest=this.alphaTest,n.alphaHash=this.alphaHash,n.alphaToCoverage=this.alphaToCoverage,n.premultipliedAlpha=this.premultipliedAlpha,n.forceSinglePass=this.forceSinglePass,n.allowOverride=this.allowOverride,n.visible=this.visible,n.toneMapped=this.toneMapped,n.name=this.name,this.color&&this.color.isColor&&(n.color=this.color.getHex()),this.roughness!==void 0&&(n.roughness=this.roughness),this.metalness!==void 0&&(n.metalness=this.metalness),this.sheen!==void 0&&(n.sheen=this.sheen),this.sheenColor&&this.sheenColor.isColor&&(n.sheenColor=this.sheenColor.getHex()),this.sheenRoughness!==void 0&&(n.sheenRoughness=this.sheenRoughness),this.emissive&&this.emissive.isColor&&(n.emissive=this.emissive.getHex()),this.emissiveIntensity!==void 0&&(n.emissiveIntensity=this.emissiveIntensity),this.specular&&this.specular.isColor&&(n.specular=this.specular.getHex()),this.specularIntensity!==void 0&&(n.specularIntensity=this.specularIntensity),this.specularColor&&this.specularColor.isColor&&(n.specularColor=this.specularColor.getHex()),this.shininess!==void 0&&(n.shininess=this.shininess),this.clearcoat!==void 0&&(n.clearcoat=this.clearcoat),this.clearcoatRoughness!==void 0&&(n.clearcoatRoughness=this.clearcoatRoughness),this.diffuseRoughness!==void 0&&(n.diffuseRoughness=this.diffuseRoughness),this.diffuseRoughnessMap&&this.diffuseRoughnessMap.isTexture&&(n.diffuseRoughnessMap=this.diffuseRoughnessMap.toJSON(e).uuid),this.clearcoatMap&&this.clearcoatMap.isTexture&&(n.clearcoatMap=this.clearcoatMap.toJSON(e).uuid),this.clearcoatRoughnessMap&&this.clearcoatRoughnessMap.isTexture&&(n.clearcoatRoughnessMap=this.clearcoatRoughnessMap.toJSON(e).uuid),this.clearcoatNormalMap&&this.clearcoatNormalMap.isTexture&&(n.clearcoatNormalMap=this.clearcoatNormalMap.toJSON(e).uuid,n.clearcoatNormalScale=this.clearcoatNormalScale.toArray()),this.sheenColorMap&&this.sheenColorMap.isTexture&&(n.sheenColorMap=this.sheenColorMap.toJSON(e).uuid),this.sheenRoughnessMap&&this.sheenRoughnessMap.isTexture&&(n.sheenRoughnessMap=this.sheenRoughnessMap.toJSON(e).uuid),this.dispersion!==void 0&&(n.dispersion=this.dispersion),this.retroreflectivity!==void 0&&(n.retroreflectivity=this.retroreflectivity),this.iridescence!==void 0&&(n.iridescence=this.iridescence),this.iridescenceIOR!==void 0&&(n.iridescenceIOR=this.iridescenceIOR),this.iridescenceThicknessMinimum!==void 0&&(n.iridescenceThicknessMinimum=this.iridescenceThicknessMinimum),this.iridescenceThicknessMaximum!==void 0&&(n.iridescenceThicknessMaximum=this.iridescenceThicknessMaximum),this.iridescenceMap&&this.iridescenceMap.isTexture&&(n.iridescenceMap=this.iridescenceMap.toJSON(e).uuid),this.iridescenceThicknessMap&&this.iridescenceThicknessMap.isTexture&&(n.iridescenceThicknessMap=this.iridescenceThicknessMap.toJSON(e).uuid),this.anisotropy!==void 0&&(n.anisotropy=this.anisotropy),this.anisotropyRotation!==void 0&&(n.anisotropyRotation=this.anisotropyRotation),this.anisotropyMap&&this.anisotropyMap.isTexture&&(n.anisotropyMap=this.anisotropyMap.toJSON(e).uuid),this.map&&this.map.isTexture&&(n.map=this.map.toJSON(e).uuid),this.matcap&&this.matcap.isTexture&&(n.matcap=this.matcap.toJSON(e).uuid),this.alphaMap&&this.alphaMap.isTexture&&(n.alphaMap=this.alphaMap.toJSON(e).uuid),this.lightMap&&this.lightMap.isTexture&&(n.lightMap=this.lightMap.toJSON(e).uuid,n.lightMapIntensity=this.lightMapIntensity),this.aoMap&&this.aoMap.isTexture&&(n.aoMap=this.aoMap.toJSON(e).uuid,n.aoMapIntensity=this.aoMapIntensity),this.bumpMap&&this.bumpMap.isTexture&&(n.bumpMap=this.bumpMap.toJSON(e).uuid,n.bumpScale=this.bumpScale),this.normalMap&&this.normalMap.isTexture&&(n.normalMap=this.normalMap.toJSON(e).uuid,n.normalMapType=this.normalMapType,n.normalScale=this.normalScale.toArray()),this.displacementMap&&this.displacementMap.isTexture&&(n.displacementMap=this.displacementMap.toJSON(e).uuid,n.displacementScale=this.displacementScale,n.displacementBias=this.displacementBias),this.roughnessMap&&this.roughnessMap.isTexture&&(n.roughnessMap=this.roughnessMap.toJSON(e).uuid),this.metalnessMap&&this.metalnessMap.isTexture&&(n.metalnessMap=this.metalnessMap.toJSON(e).uuid),this.emissiveMap&&this.emissiveMap.isTexture&&(n.emissiveMap=this.emissiveMap.toJSON(e).uuid),this.specularMap&&this.specularMap.isTexture&&(n.specularMap=this.specularMap.toJSON(e).uuid),this.specularIntensityMap&&this.specularIntensityMap.isTexture&&(n.specularIntensityMap=this.specularIntensityMap.toJSON(e).uuid),this.specularColorMap&&this.specularColorMap.isTexture&&(n.specularColorMap=this.specularColorMap.toJSON(e).uuid),this.envMap&&this.envMap.isTexture&&(n.envMap=this.envMap.toJSON(e).uuid,this.combine!==void 0&&(n.combine=this.combine)),this.envMapRotation!==void 0&&(n.envMapRotation=this.envMapRotation.toArray()),this.envMapIntensity!==void 0&&(n.envMapIntensity=this.envMapIntensity),this.reflectivity!==void 0&&(n.reflectivity=this.reflectivity),this.refractionRatio!==void 0&&(n.refractionRatio=this.refractionRatio),this.gradientMap&&this.gradientMap.isTexture&&(n.gradientMap=this.gradientMap.toJSON(e).uuid),this.transmission!==void 0&&(n.transmission=this.transmission),this.transmissionMap&&this.transmissionMap.isTexture&&(n.transmissionMap=this.transmissionMap.toJSON(e).uuid),this.thickness!==void 0&&(n.thickness=this.thickness),this.thicknessMap&&this.thicknessMap.isTexture&&(n.thicknessMap=this.thicknessMap.toJSON(e).uuid),this.attenuationDistance!==void 0&&(n.attenuationDistance=this.attenuationDistance),this.attenuationColor!==void 0&&(n.attenuationColor=this.attenuationColor.getHex()),this.size!==void 0&&(n.size=this.size),this.sizeAttenuation!==void 0&&(n.sizeAttenuation=this.sizeAttenuation),Array.isArray(this.clippingPlanes)&&this.clippingPlanes.length>0&&(n.clippingPlanes=this.clippingPlanes.map(r=>r.toJSON())),this.rotation!==void 0&&(n.rotation=this.rotation),this.depthPacking!==void 0&&(n.depthPacking=this.depthPacking),this.linewidth!==void 0&&(n.linewidth=this.linewidth),this.linecap!==void 0&&(n.linecap=this.linecap),this.linejoin!==void 0&&(n.linejoin=this.linejoin),this.dashSize!==void 0&&(n.dashSize=this.dashSize),this.gapSize!==void 0&&(n.gapSize=this.gapSize),this.scale!==void 0&&(n.scale=this.scale),this.wireframe!==void 0&&(n.wireframe=this.wireframe),this.wireframeLinewidth!==void 0&&(n.wireframeLinewidth=this.wireframeLinewidth),this.wireframeLinecap!==void 0&&(n.wireframeLinecap=this.wireframeLinecap),this.wireframeLinejoin!==void 0&&(n.wireframeLinejoin=this.wireframeLinejoin),this.flatShading!==void 0&&(n.flatShading=this.flatShading),this.fog!==void 0&&(n.fog=this.fog),Object.keys(this.userData).length>0&&(n.userData=this.userData);function s(r){let o=[];for(let a in r){let l=r[a];delete l.metadata,o.push(l)}return o}if(t){let r=s(e.textures),o=s(e.images);r.length>0&&(n.textures=r),o.length>0&&(n.images=o)}return n}fromJSON(e,t){if(e.uuid!==void 0&&(this.uuid=e.uuid),e.name!==void 0&&(this.name=e.name),e.color!==void 0&&this.color!==void 0&&this.color.setHex(e.color),e.roughness!==void 0&&(this.roughness=e.roughness),e.metalness!==void 0&&(this.metalness=e.metalness),e.sheen!==void 0&&(this.sheen=e.sheen),e.sheenColor!==void 0&&(this.sheenColor=new ft().setHex(e.sheenColor)),e.sheenRoughness!==void 0&&(this.sheenRoughness=e.sheenRoughness),e.emissive!==void 0&&this.emissive!==void 0&&this.emissive.setHex(e.emissive),e.specular!==void 0&&this.specular!==void 0&&this.specular.setHex(e.specular),e.specularIntensity!==void 0&&(this.specularIntensity=e.specularIntensity),e.specularColor!==void 0&&this.specularColor!==void 0&&this.specularColor.setHex(e.specularColor),e.shininess!==void 0&&(this.shininess=e.shininess),e.clearcoat!==void 0&&(this.clearcoat=e.clearcoat),e.clearcoatRoughness!==void 0&&(this.clearcoatRoughness=e.clearcoatRoughness),e.diffuseRoughness!==void 0&&(this.diffuseRoughness=e.diffuseRoughness),e.dispersion!==void 0&&(this.dispersion=e.dispersion),e.retroreflectivity!==void 0&&(this.retroreflectivity=e.retroreflectivity),e.iridescence!==void 0&&(this.iridescence=e.iridescence),e.iridescenceIOR!==void 0&&(this.iridescenceIOR=e.iridescenceIOR),e.iridescenceThicknessMinimum!==void 0&&(this.iridescenceThicknessMinimum=e.iridescenceThicknessMinimum),e.iridescenceThicknessMaximum!==void 0&&(this.iridescenceThicknessMaximum=e.iridescenceThicknessMaximum),e.iridescenceThicknessRange!==void 0&&(this.iridescenceThicknessMinimum=e.iridescenceThicknessRange[0],this.iridescenceThicknessMaximum=e.iridescenceThicknessRange[1]),e.transmission!==void 0&&(this.transmission=e.transmission),e.thickness!==void 0&&(this.thickness=e.thickness),e.attenuationDistance!==void 0&&(this.attenuationDistance=e.attenuationDistance),e.attenuationColor!==void 0&&this.attenuationColor!==void 0&&this.attenuationColor.setHex(e.attenuationColor),e.anisotropy!==void 0&&(this.anisotropy=e.anisotropy),e.anisotropyRotation!==void 0&&(this.anisotropyRotation=e.anisotropyRotation),e.fog!==void 0&&(this.fog=e.fog),e.flatShading!==void 0&&(this.flatShading=e.flatShading),e.blending!==void 0&&(this.blending=e.blending),e.combine!==void 0&&(this.combine=e.combine),e.side!==void 0&&(this.side=e.side),e.shadowSide!==void 0&&(this.shadowSide=e.shadowSide),e.opacity!==void 0&&(this.opacity=e.opacity),e.transparent!==void 0&&(this.transparent=e.transparent),e.alphaTest!==void 0&&(this.alphaTest=e.alphaTest),e.alphaHash!==void 0&&(this.alphaHash=e.alphaHash),e.depthFunc!==void 0&&(this.depthFunc=e.depthFunc),e.depthTest!==void 0&&(this.depthTest=e.depthTest),e.depthWrite!==void 0&&(this.depthWrite=e.depthWrite),e.colorWrite!==void 0&&(this.colorWrite=e.colorWrite),e.clippingPlanes!==void 0&&(this.clippingPlanes=e.clippingPlanes.map(n=>new Li().fromJSON(n))),e.clipIntersection!==void 0&&(this.clipIntersection=e.clipIntersection),e.clipShadows!==void 0&&(this.clipShadows=e.clipShadows),e.depthPacking!==void 0&&(this.depthPacking=e.depthPacking),e.blendSrc!==void 0&&(this.blendSrc=e.blendSrc),e.blendDst!==void 0&&(this.blendDst=e.blendDst),e.blendEquation!==void 0&&(this.blendEquation=e.blendEquation),e.blendSrcAlpha!==void 0&&(this.blendSrcAlpha=e.blendSrcAlpha),e.blendDstAlpha!==void 0&&(this.blendDstAlpha=e.blendDstAlpha),e.blendEquationAlpha!==void 0&&(this.blendEquationAlpha=e.blendEquationAlpha),e.blendColor!==void 0&&this.blendColor!==void 0&&this.blendColor.setHex(e.blendColor),e.blendAlpha!==void 0&&(this.blendAlpha=e.blendAlpha),e.stencilWriteMask!==void 0&&(this.stencilWriteMask=e.stencilWriteMask),e.stencilFunc!==void 0&&(this.stencilFunc=e.stencilFunc),e.stencilRef!==void 0&&(this.stencilRef=e.stencilRef),e.stencilFuncMask!==void 0&&(this.stencilFuncMask=e.stencilFuncMask),e.stencilFail!==void 0&&(this.stencilFail=e.stencilFail),e.stencilZFail!==void 0&&(this.stencilZFail=e.stencilZFail),e.stencilZPass!==void 0&&(this.stencilZPass=e.stencilZPass),e.stencilWrite!==void 0&&(this.stencilWrite=e.stencilWrite),e.wireframe!==void 0&&(this.wireframe=e.wireframe),e.wireframeLinewidth!==void 0&&(this.wireframeLinewidth=e.wireframeLinewidth),e.wireframeLinecap!==void 0&&(this.wireframeLinecap=e.wireframeLinecap),e.wireframeLinejoin!==void 0&&(this.wireframeLinejoin=e.wireframeLinejoin),e.rotation!==void 0&&(this.rotation=e.rotation),e.linewidth!==void 0&&(this.linewidth=e.linewidth),e.linecap!==void 0&&(this.linecap=e.linecap),e.linejoin!==void 0&&(this.linejoin=e.linejoin),e.dashSize!==void 0&&(this.dashSize=e.dashSize),e.gapSize!==void 0&&(this.gapSize=e.gapSize),e.scale!==void 0&&(this.scale=e.scale),e.polygonOffset!==void 0&&(this.polygonOffset=e.polygonOffset),e.polygonOffsetFactor!==void 0&&(this.polygonOffsetFactor=e.polygonOffsetFactor),e.polygonOffsetUnits!==void 0&&(this.polygonOffsetUnits=e.polygonOffsetUnits),e.dithering!==void 0&&(this.dithering=e.dithering),e.alphaToCoverage!==void 0&&(this.alphaToCoverage=e.alphaToCoverage),e.premultipliedAlpha!==void 0&&(this.premultipliedAlpha=e.premultipliedAlpha),e.forceSinglePass!==void 0&&(this.forceSinglePass=e.forceSinglePass),e.allowOverride!==void 0&&(this.allowOverride=e.allowOverride),e.visible!==void 0&&(this.visible=e.visible),e.toneMapped!==void 0&&(this.toneMapped=e.toneMapped),e.userData!==void 0&&(this.userData=e.userData),e.vertexColors!==void 0&&(typeof e.vertexColors=="number"?this.vertexColors=e.vertexColors>0:this.vertexColors=e.vertexColors),e.size!==void 0&&(this.size=e.size),e.sizeAttenuation!==void 0&&(this.sizeAttenuation=e.sizeAttenuation),e.map!==void 0&&(this.map=t[e.map]||null),e.matcap!==void 0&&(this.matcap=t[e.matcap]||null),e.alphaMap!==void 0&&(this.alphaMap=t[e.alphaMap]||null),e.bumpMap!==void 0&&(this.bumpMap=t[e.bumpMap]||null),e.bumpScale!==void 0&&(this.bumpScale=e.bumpScale),e.normalMap!==void 0&&(this.normalMap=t[e.normalMap]||null),e.normalMapType!==void 0&&(this.normalMapType=e.normalMapType),e.normalScale!==void 0){let n=e.normalScale;Array.isArray(n)===!1&&(n=[n,n]),this.normalScale=new lt().fromArray(n)}return e.displacementMap!==void 0&&(this.displacementMap=t[e.displacementMap]||null),e.displacementScale!==void 0&&(this.displacementScale=e.displacementScale),e.displacementBias!==void 0&&(this.displacementBias=e.displacementBias),e.roughnessMap!==void 0&&(this.roughnessMap=t[e.roughnessMap]||null),e.metalnessMap!==void 0&&(this.metalnessMap=t[e.metalnessMap]||null),e.emissiveMap!==void 0&&(this.emissiveMap=t[e.emissiveMap]||null),e.emissiveIntensity!==void 0&&(this.emissiveIntensity=e.emissiveIntensity),e.specularMap!==void 0&&(this.specularMap=t[e.specularMap]||null),e.specularIntensityMap!==void 0&&(this.specularIntensityMap=t[e.specularIntensityMap]||null),e.specularColorMap!==void 0&&(this.specularColorMap=t[e.specularColorMap]||null),e.envMap!==void 0&&(this.envMap=t[e.envMap]||null),e.envMapRotation!==void 0&&this.envMapRotation.fromArray(e.envMapRotation),e.envMapIntensity!==void 0&&(this.envMapIntensity=e.envMapIntensity),e.reflectivity!==void 0&&(this.reflectivity=e.reflectivity),e.refractionRatio!==void 0&&(this.refractionRatio=e.refractionRatio),e.lightMap!==void 0&&(this.lightMap=t[e.lightMap]||null),e.lightMapIntensity!==void 0&&(this.lightMapIntensity=e.lightMapIntensity),e.aoMap!==void 0&&(this.aoMap=t[e.aoMap]||null),e.aoMapIntensity!==void 0&&(this.aoMapIntensity=e.aoMapIntensity),e.gradientMap!==void 0&&(this.gradientMap=t[e.gradientMap]||null),e.clearcoatMap!==void 0&&(this.clearcoatMap=t[e.clearcoatMap]||null),e.clearcoatRoughnessMap!==void 0&&(this.clearcoatRoughnessMap=t[e.clearcoatRoughnessMap]||null),e.clearcoatNormalMap!==void 0&&(this.clearcoatNormalMap=t[e.clearcoatNormalMap]||null),e.clearcoatNormalScale!==void 0&&(this.clearcoatNormalScale=new lt().fromArray(e.clearcoatNormalScale)),e.diffuseRoughnessMap!==void 0&&(this.diffuseRoughnessMap=t[e.diffuseRoughnessMap]||null),e.iridescenceMap!==void 0&&(this.iridescenceMap=t[e.iridescenceMap]||null),e.iridescenceThicknessMap!==void 0&&(this.iridescenceThicknessMap=t[e.iridescenceThicknessMap]||null),e.transmissionMap!==void 0&&(this.transmissionMap=t[e.transmissionMap]||null),e.thicknessMap!==void 0&&(this.thicknessMap=t[e.thicknessMap]||null),e.anisotropyMap!==void 0&&(this.anisotropyMap=t[e.anisotropyMap]||null),e.sheenColorMap!==void 0&&(this.sheenColorMap=t[e.sheenColorMap]||null),e.sheenRoughnessMap!==void 0&&(this.sheenRoughnessMap=t[e.sheenRoughnessMap]||null),this}clone(){return new this.constructor().copy(this)}copy(e){this.name=e.name,this.blending=e.blending,this.side=e.side,this.vertexColors=e.vertexColors,this.opacity=e.opacity,this.transparent=e.transparent,this.blendSrc=e.blendSrc,this.blendDst=e.blendDst,this.blendEquation=e.blendEquation,this.blendSrcAlpha=e.blendSrcAlpha,this.blendDstAlpha=e.blendDstAlpha,this.blendEquationAlpha=e.blendEquationAlpha,this.blendColor.copy(e.blendColor),this.blendAlpha=e.blendAlpha,this.depthFunc=e.depthFunc,this.depthTest=e.depthTest,this.depthWrite=e.depthWrite,this.stencilWriteMask=e.stencilWriteMask,this.stencilFunc=e.stencilFunc,this.stencilRef=e.stencilRef,this.stencilFuncMask=e.stencilFuncMask,this.stencilFail=e.stencilFail,this.stencilZFail=e.stencilZFail,this.stencilZPass=e.stencilZPass,this.stencilWrite=e.stencilWrite;let t=e.clippingPlanes,n=null;if(t!==null){let s=t.length;n=new Array(s);for(let r=0;r!==s;++r)n[r]=t[r].clone()}return this.clippingPlanes=n,this.clipIntersection=e.clipIntersection,this.clipShadows=e.clipShadows,this.shadowSide=e.shadowSide,this.colorWrite=e.colorWrite,this.precision=e.precision,this.polygonOffset=e.polygonOffset,this.polygonOffsetFactor=e.polygonOffsetFactor,this.polygonOffsetUnits=e.polygonOffsetUnits,this.dithering=e.dithering,this.alphaTest=e.alphaTest,this.alphaHash=e.alphaHash,this.alphaToCoverage=e.alphaToCoverage,this.premultipliedAlpha=e.premultipliedAlpha,this.forceSinglePass=e.forceSinglePass,this.allowOverride=e.allowOverride,this.visible=e.visible,this.toneMapped=e.toneMapped,this.userData=JSON.parse(JSON.stringify(e.userData)),this}dispose(){this.dispatchEvent({type:"dispose"})}set needsUpdate(e){e===!0&&this.version++}};var Fs=new Q,Rf=new Q,mc=new Q,gc=new Q,Ws=class{constructor(e=new Q,t=new Q(0,0,-1)){this.origin=e,this.direction=t}set(e,t){return this.origin.copy(e),this.direction.copy(t),this}copy(e){return this.origin.copy(e.origin),this.direction.copy(e.direction),this}at(e,t){return t.copy(this.origin).addScaledVector(this.direction,e)}lookAt(e){return this.direction.copy(e).sub(this.origin).normalize(),this}recast(e){return this.origin.copy(this.at(e,Fs)),this}closestPointToPoint(e,t){t.subVectors(e,this.origin);let n=t.dot(this.direction);return n<0?t.copy(this.origin):t.copy(this.origin).addScaledVector(this.direction,n)}distanceToPoint(e){return Math.sqrt(this.distanceSqToPoint(e))}distanceSqToPoint(e){let t=Fs.subVectors(e,this.origin).dot(this.direction);return t<0?this.origin.distanceToSquared(e):(Fs.copy(this.origin).addScaledVector(this.direction,t),Fs.distanceToSquared(e))}distanceSqToSegment(e,t,n,s){Rf.copy(e).add(t).multiplyScalar(.5),mc.copy(t).sub(e).normalize(),gc.copy(this.origin).sub(Rf);let r=e.distanceTo(t)*.5,o=-this.direction.dot(mc),a=gc.dot(this.direction),l=-gc.dot(mc),c=gc.lengthSq(),h=Math.abs(1-o*o),u,f,p,x;if(h>0)if(u=o*l-a,f=o*a-l,x=r*h,u>=0)if(f>=-x)if(f<=x){let M=1/h;u*=M,f*=M,p=u*(u+o*f+2*a)+f*(o*u+f+2*l)+c}else f=r,u=Math.max(0,-(o*f+a)),p=-u*u+f*(f+2*l)+c;else f=-r,u=Math.max(0,-(o*f+a)),p=-u*u+f*(f+2*l)+c;else f<=-x?(u=Math.max(0,-(-o*r+a)),f=u>0?-r:Math.min(Math.max(-r,-l),r),p=-u*u+f*(f+2*l)+c):f<=x?(u=0,f=Math.min(Math.max(-r,-l),r),p=f*(f+2*l)+c):(u=Math.max(0,-(o*r+a)),f=u>0?r:Math.min(Math.max(-r,-l),r),p=-u*u+f*(f+2*l)+c);else f=o>0?-r:r,u=Math.max(0,-(o*f+a)),p=-u*u+f*(f+2*l)+c;return n&&n.copy(this.origin).addScaledVector(this.direction,u),s&&s.copy(Rf).addScaledVector(mc,f),p}intersectSphere(e,t){if(e.radius<0)return null;Fs.subVectors(e.center,this.origin);let n=Fs.dot(this.direction),s=Fs.dot(Fs)-n*n,r=e.radius*e.radius;if(s>r)return null;let o=Math.sqrt(r-s),a=n-o,l=n+o;return l<0?null:a<0?this.at(l,t):this.at(a,t)}intersectsSphere(e){return e.radius<0?!1:this.distanceSqToPoint(e.center)<=e.radius*e.radius}distanceToPlane(e){let t=e.normal.dot(this.direction);if(t===0)return e.distanceToPoint(this.origin)===0?0:null;let n=-(this.origin.dot(e.normal)+e.constant)/t;return n>=0?n:null}intersectPlane(e,t){let n=this.distanceToPlane(e);return n===null?null:this.at(n,t)}intersectsPlane(e){let t=e.distanceToPoint(this.origin);return t===0||e.normal.dot(this.direction)*t<0}intersectBox(e,t){let n,s,r,o,a,l,c=1/this.direction.x,h=1/this.direction.y,u=1/this.direction.z,f=this.origin;return c>=0?(n=(e.min.x-f.x)*c,s=(e.max.x-f.x)*c):(n=(e.max.x-f.x)*c,s=(e.min.x-f.x)*c),h>=0?(r=(e.min.y-f.y)*h,o=(e.max.y-f.y)*h):(r=(e.max.y-f.y)*h,o=(e.min.y-f.y)*h),n>o||r>s||((r>n||isNaN(n))&&(n=r),(o<s||isNaN(s))&&(s=o),u>=0?(a=(e.min.z-f.z)*u,l=(e.max.z-f.z)*u):(a=(e.max.z-f.z)*u,l=(e.min.z-f.z)*u),n>l||a>s)||((a>n||n!==n)&&(n=a),(l<s||s!==s)&&(s=l),s<0)?null:this.at(n>=0?n:s,t)}intersectsBox(e){return this.intersectBox(e,Fs)!==null}intersectTriangle(e,t,n,s,r){let o=this.origin,a=this.direction,l=a.x,c=a.y,h=a.z,u=e.x-o.x,f=e.y-o.y,p=e.z-o.z,x=t.x-o.x,M=t.y-o.y,g=t.z-o.z,_=n.x-o.x,b=n.y-o.y,P=n.z-o.z,w=Math.abs(l),D=Math.abs(c),I=Math.abs(h),y,T,G,k,O,Y,Z,U,W,$,q,xe;if(w>=D&&w>=I?(G=l,Y=u,W=x,xe=_,l>=0?(y=c,T=h,k=f,O=p,Z=M,U=g,$=b,q=P):(y=h,T=c,k=p,O=f,Z=g,U=M,$=P,q=b)):D>=I?(G=c,Y=f,W=M,xe=b,c>=0?(y=h,T=l,k=p,O=u,Z=g,U=x,$=P,q=_):(y=l,T=h,k=u,O=p,Z=x,U=g,$=_,q=P)):(G=h,Y=p,W=g,xe=P,h>=0?(y=l,T=c,k=u,O=f,Z=x,U=M,$=_,q=b):(y=c,T=l,k=f,O=u,Z=M,U=x,$=b,q=_)),G===0)return null;let ne=y/G,se=T/G,de=1/G,ge=k-ne*Y,pe=O-se*Y,re=Z-ne*W,Te=U-se*W,Ie=$-ne*xe,Oe=q-se*xe,ye=Ie*Te-Oe*re,$e=ge*Oe-pe*Ie,ut=re*pe-Te*ge;if(s){if(ye<0||$e<0||ut<0)return null}else if((ye<0||$e<0||ut<0)&&(ye>0||$e>0||ut>0))return null;let et=ye+$e+ut;if(et===0)return null;let bt=de*(ye*Y+$e*W+ut*xe);return(et>0?bt<0:bt>0)?null:this.at(bt/et,r)}applyMatrix4(e){return this.origin.applyMatrix4(e),this.direction.transformDirection(e),this}equals(e){return e.origin.equals(this.origin)&&e.direction.equals(this.direction)}clone(){return new this.constructor().copy(this)}},Vi=class extends xi{constructor(e){super(),this.isMeshBasicMaterial=!0,this.type="MeshBasicMaterial",this.color=new ft(16777215),this.map=null,this.lightMap=null,this.lightMapIntensity=1,this.aoMap=null,this.aoMapIntensity=1,this.specularMap=null,this.alphaMap=null,this.envMap=null,this.envMapRotation=new Gs,this.combine=Qf,this.reflectivity=1,this.refractionRatio=.98,this.wireframe=!1,this.wireframeLinewidth=1,this.wireframeLinecap="round",this.wireframeLinejoin="round",this.fog=!0,this.setValues(e)}copy(e){return super.copy(e),this.color.copy(e.color),this.map=e.map,this.lightMap=e.lightMap,this.lightMapIntensity=e.lightMapIntensity,this.aoMap=e.aoMap,this.aoMapIntensity=e.aoMapIntensity,this.specularMap=e.specularMap,this.alphaMap=e.alphaMap,this.envMap=e.envMap,this.envMapRotation.copy(e.envMapRotation),this.combine=e.combine,this.reflectivity=e.reflectivity,this.refractionRatio=e.refractionRatio,this.wireframe=e.wireframe,this.wireframeLinewidth=e.wireframeLinewidth,this.wireframeLinecap=e.wireframeLinecap,this.wireframeLinejoin=e.wireframeLinejoin,this.fog=e.fog,this}},Og=new Mt,Vr=new Ws,_c=new _i,Fg=new Q,xc=new Q,vc=new Q,yc=new Q,Cf=new Q,Sc=new Q,Bg=new Q,Mc=new Q,In=class extends xn{constructor(e=new Qn,t=new Vi){super(),this.isMesh=!0,this.type="Mesh",this.geometry=e,this.material=t,this.morphTargetDictionary=void 0,this.morphTargetInfluences=void 0,this.count=1,this.updateMorphTargets()}copy(e,t){return super.copy(e,t),e.morphTargetInfluences!==void 0?this.morphTargetInfluences=e.morphTargetInfluences.slice():this.morphTargetInfluences=void 0,e.morphTargetDictionary!==void 0?this.morphTargetDictionary=Object.assign({},e.morphTargetDictionary):this.morphTargetDictionary=void 0,this.material=Array.isArray(e.material)?e.material.slice():e.material,this.geometry=e.geometry,this}updateMorphTargets(){let t=this.geometry.morphAttributes,n=Object.keys(t);if(n.length>0){let s=t[n[0]];if(s!==void 0){this.morphTargetInfluences=[],this.morphTargetDictionary={};for(let r=0,o=s.length;r<o;r++){let a=s[r].name||String(r);this.morphTargetInfluences.push(0),this.morphTargetDictionary[a]=r}}}}getVertexPosition(e,t){let n=this.geometry,s=n.attributes.position,r=n.morphAttributes.position,o=n.morphTargetsRelative;t.fromBufferAttribute(s,e);let a=this.morphTargetInfluences;if(r&&a){Sc.set(0,0,0);for(let l=0,c=r.length;l<c;l++){let h=a[l],u=r[l];h!==0&&(Cf.fromBufferAttribute(u,e),o?Sc.addScaledVector(Cf,h):Sc.addScaledVector(Cf.sub(t),h))}t.add(Sc)}return t}intersectsFrustum(e){return e.intersectsObject(this)}raycast(e,t){let n=this.geometry,s=this.material,r=this.matrixWorld;s!==void 0&&(n.boundingSphere===null&&n.computeBoundingSphere(),_c.copy(n.boundingSphere),_c.applyMatrix4(r),Vr.copy(e.ray).recast(e.near),!(_c.containsPoint(Vr.origin)===!1&&(Vr.intersectSphere(_c,Fg)===null||Vr.origin.distanceToSquared(Fg)>(e.far-e.near)**2))&&(Og.copy(r).invert(),Vr.copy(e.ray).applyMatrix4(Og),!(n.boundingBox!==null&&Vr.intersectsBox(n.boundingBox)===!1)&&this._computeIntersections(e,t,Vr)))}_computeIntersections(e,t,n){let s,r=this.geometry,o=this.material,a=r.index,l=r.attributes.position,c=r.attributes.uv,h=r.attributes.uv1,u=r.attributes.normal,f=r.groups,p=r.drawRange;if(a!==null)if(Array.isArray(o))for(let x=0,M=f.length;x<M;x++){let g=f[x],_=o[g.materialIndex],b=Math.max(g.start,p.start),P=Math.min(a.count,Math.min(g.start+g.count,p.start+p.count));for(let w=b,D=P;w<D;w+=3){let I=a.getX(w),y=a.getX(w+1),T=a.getX(w+2);s=bc(this,_,e,n,c,h,u,I,y,T),s&&(s.faceIndex=Math.floor(w/3),s.face.materialIndex=g.materialIndex,t.push(s))}}else{let x=Math.max(0,p.start),M=Math.min(a.count,p.start+p.count);for(let g=x,_=M;g<_;g+=3){let b=a.getX(g),P=a.getX(g+1),w=a.getX(g+2);s=bc(this,o,e,n,c,h,u,b,P,w),s&&(s.faceIndex=Math.floor(g/3),t.push(s))}}else if(l!==void 0)if(Array.isArray(o))for(let x=0,M=f.length;x<M;x++){let g=f[x],_=o[g.materialIndex],b=Math.max(g.start,p.start),P=Math.min(l.count,Math.min(g.start+g.count,p.start+p.count));for(let w=b,D=P;w<D;w+=3){let I=w,y=w+1,T=w+2;s=bc(this,_,e,n,c,h,u,I,y,T),s&&(s.faceIndex=Math.floor(w/3),s.face.materialIndex=g.materialIndex,t.push(s))}}else{let x=Math.max(0,p.start),M=Math.min(l.count,p.start+p.count);for(let g=x,_=M;g<_;g+=3){let b=g,P=g+1,w=g+2;s=bc(this,o,e,n,c,h,u,b,P,w),s&&(s.faceIndex=Math.floor(g/3),t.push(s))}}}};function rS(i,e,t,n,s,r,o,a){let l;if(e.side===pi?l=n.intersectTriangle(o,r,s,!0,a):l=n.intersectTriangle(s,r,o,e.side===bs,a),l===null)return null;Mc.copy(a),Mc.applyMatrix4(i.matrixWorld);let c=t.ray.origin.distanceTo(Mc);return c<t.near||c>t.far?null:{distance:c,point:Mc.clone(),object:i}}function bc(i,e,t,n,s,r,o,a,l,c){i.getVertexPosition(a,xc),i.getVertexPosition(l,vc),i.getVertexPosition(c,yc);let h=rS(i,e,t,n,xc,vc,yc,Bg);if(h){let u=new Q;Sr.getBarycoord(Bg,xc,vc,yc,u),s&&(h.uv=Sr.getInterpolatedAttribute(s,a,l,c,u,new lt)),r&&(h.uv1=Sr.getInterpolatedAttribute(r,a,l,c,u,new lt)),o&&(h.normal=Sr.getInterpolatedAttribute(o,a,l,c,u,new Q),h.normal.dot(n.direction)>0&&h.normal.multiplyScalar(-1));let f={a,b:l,c,normal:new Q,materialIndex:0};Sr.getNormal(xc,vc,yc,f.normal),h.face=f,h.barycoord=u}return h}var za=new $t,kg=new $t,zg=new $t,oS=new $t,Hg=new Mt,wc=new Q,If=new _i,Gg=new Mt,Pf=new Ws,Qa=class extends In{constructor(e,t){super(e,t),this.isSkinnedMesh=!0,this.type="SkinnedMesh",this.bindMode=Uf,this.bindMatrix=new Mt,this.bindMatrixInverse=new Mt,this.boundingBox=null,this.boundingSphere=null}computeBoundingBox(){let e=this.geometry;this.boundingBox===null&&(this.boundingBox=new ui),this.boundingBox.makeEmpty();let t=e.getAttribute("position");for(let n=0;n<t.count;n++)this.getVertexPosition(n,wc),this.boundingBox.expandByPoint(wc)}computeBoundingSphere(){let e=this.geometry;this.boundingSphere===null&&(this.boundingSphere=new _i),this.boundingSphere.makeEmpty();let t=e.getAttribute("position");for(let n=0;n<t.count;n++)this.getVertexPosition(n,wc),this.boundingSphere.expandByPoint(wc)}copy(e,t){return super.copy(e,t),this.bindMode=e.bindMode,this.bindMatrix.copy(e.bindMatrix),this.bindMatrixInverse.copy(e.bindMatrixInverse),this.skeleton=e.skeleton,this.boundingBox=e.boundingBox!==null?e.boundingBox.clone():null,this.boundingSphere=e.boundingSphere!==null?e.boundingSphere.clone():null,this}raycast(e,t){let n=this.material,s=this.matrixWorld;n!==void 0&&(this.boundingSphere===null&&this.computeBoundingSphere(),If.copy(this.boundingSphere),If.applyMatrix4(s),e.ray.intersectsSphere(If)!==!1&&(Gg.copy(s).invert(),Pf.copy(e.ray).applyMatrix4(Gg),!(this.boundingBox!==null&&Pf.intersectsBox(this.boundingBox)===!1)&&this._computeIntersections(e,t,Pf)))}getVertexPosition(e,t){return super.getVertexPosition(e,t),this.applyBoneTransform(e,t),t}bind(e,t){this.skeleton=e,t===void 0&&(this.updateMatrixWorld(!0),this.skeleton.calculateInverses(),t=this.matrixWorld),this.bindMatrix.copy(t),this.bindMatrixInverse.copy(t).invert()}pose(){this.skeleton.pose()}normalizeSkinWeights(){let e=new $t,t=this.geometry.attributes.skinWeight;for(let n=0,s=t.count;n<s;n++){e.fromBufferAttribute(t,n);let r=1/e.manhattanLength();r!==1/0?e.multiplyScalar(r):e.set(1,0,0,0),t.setXYZW(n,e.x,e.y,e.z,e.w)}}updateMatrixWorld(e){super.updateMatrixWorld(e),this.bindMode===Uf?this.bindMatrixInverse.copy(this.matrixWorld).invert():this.bindMode===C0?this.bindMatrixInverse.copy(this.bindMatrix).invert():nt("SkinnedMesh: Unrecognized bindMode: "+this.bindMode)}applyBoneTransform(e,t){let n=this.skeleton,s=this.geometry;kg.fromBufferAttribute(s.attributes.skinIndex,e),zg.fromBufferAttribute(s.attributes.skinWeight,e),t.isVector4?(za.copy(t),t.set(0,0,0,0)):(za.set(t.x,t.y,t.z,1),t.set(0,0,0)),za.applyMatrix4(this.bindMatrix);for(let r=0;r<4;r++){let o=zg.getComponent(r);if(o!==0){let a=kg.getComponent(r);Hg.multiplyMatrices(n.bones[a].matrixWorld,n.boneInverses[a]),t.addScaledVector(oS.copy(za).applyMatrix4(Hg),o)}}return t.isVector4&&(t.w=za.w),t.applyMatrix4(this.bindMatrixInverse)}},Jo=class extends xn{constructor(){super(),this.isBone=!0,this.type="Bone"}},ys=class extends Yn{constructor(e=null,t=1,n=1,s,r,o,a,l,c=En,h=En,u,f){super(null,o,a,l,c,h,s,r,u,f),this.isDataTexture=!0,this.image={data:e,width:t,height:n},this.generateMipmaps=!1,this.flipY=!1,this.unpackAlignment=1}},Vg=new Mt,aS=new Mt,el=class i{constructor(e=[],t=[]){this.uuid=ws(),this.bones=e.slice(0),this.boneInverses=t,this.boneMatrices=null,this.previousBoneMatrices=null,this.boneTexture=null,this.previousBoneTexture=null,this.init()}init(){let e=this.bones,t=this.boneInverses;if(this.boneMatrices=new Float32Array(e.length*16),t.length===0)this.calculateInverses();else if(e.length!==t.length){nt("Skeleton: Number of inverse bone matrices does not match amount of bones."),this.boneInverses=[];for(let n=0,s=this.bones.length;n<s;n++)this.boneInverses.push(new Mt)}}calculateInverses(){this.boneInverses.length=0;for(let e=0,t=this.bones.length;e<t;e++){let n=new Mt;this.bones[e]&&n.copy(this.bones[e].matrixWorld).invert(),this.boneInverses.push(n)}}pose(){for(let e=0,t=this.bones.length;e<t;e++){let n=this.bones[e];n&&n.matrixWorld.copy(this.boneInverses[e]).invert()}for(let e=0,t=this.bones.length;e<t;e++){let n=this.bones[e];n&&(n.parent&&n.parent.isBone?(n.matrix.copy(n.parent.matrixWorld).invert(),n.matrix.multiply(n.matrixWorld)):n.matrix.copy(n.matrixWorld),n.matrix.decompose(n.position,n.quaternion,n.scale))}}update(){let e=this.bones,t=this.boneInverses,n=this.boneMatrices,s=this.boneTexture;for(let r=0,o=e.length;r<o;r++){let a=e[r]?e[r].matrixWorld:aS;Vg.multiplyMatrices(a,t[r]),Vg.toArray(n,r*16)}s!==null&&(s.needsUpdate=!0)}clone(){return new i(this.bones,this.boneInverses)}computeBoneTexture(){let e=Math.sqrt(this.bones.length*4);e=Math.ceil(e/4)*4,e=Math.max(e,4);let t=new Float32Array(e*e*4);t.set(this.boneMatrices);let n=new ys(t,e,e,un,Pn);return n.needsUpdate=!0,this.boneMatrices=t,this.boneTexture=n,this}getBoneByName(e){for(let t=0,n=this.bones.length;t<n;t++){let s=this.bones[t];if(s.name===e)return s}}dispose(){this.boneTexture!==null&&(this.boneTexture.dispose(),this.boneTexture=null),this.previousBoneTexture!==null&&(this.previousBoneTexture.dispose(),this.previousBoneTexture=null)}fromJSON(e,t){this.uuid=e.uuid;for(let n=0,s=e.bones.length;n<s;n++){let r=e.bones[n],o=t[r];o===void 0&&(nt("Skeleton: No bone found with UUID:",r),o=new Jo),this.bones.push(o),this.boneInverses.push(new Mt().fromArray(e.boneInverses[n]))}return this.init(),this}toJSON(){let e={metadata:{version:4.7,type:"Skeleton",generator:"Skeleton.toJSON"},bones:[],boneInverses:[]};e.uuid=this.uuid;let t=this.bones,n=this.boneInverses;for(let s=0,r=t.length;s<r;s++){let o=t[s];e.bones.push(o.uuid);let a=n[s];e.boneInverses.push(a.toArray())}return e}},Xs=class extends $n{constructor(e,t,n,s=1){super(e,t,n),this.isInstancedBufferAttribute=!0,this.meshPerAttribute=s}copy(e){return super.copy(e),this.meshPerAttribute=e.meshPerAttribute,this}toJSON(){let e=super.toJSON();return e.meshPerAttribute=this.meshPerAttribute,e.isInstancedBufferAttribute=!0,e}},Fo=new Mt,Wg=new Mt,Ec=[],Xg=new ui,lS=new Mt,Ha=new In,Ga=new _i,tl=class extends In{constructor(e,t,n){super(e,t),this.isInstancedMesh=!0,this.instanceMatrix=new Xs(new Float32Array(n*16),16),this.instanceColor=null,this.morphTexture=null,this.count=n,this.boundingBox=null,this.boundingSphere=null;for(let s=0;s<n;s++)this.setMatrixAt(s,lS)}computeBoundingBox(){let e=this.geometry,t=this.count;this.boundingBox===null&&(this.boundingBox=new ui),e.boundingBox===null&&e.computeBoundingBox(),this.boundingBox.makeEmpty();for(let n=0;n<t;n++)this.getMatrixAt(n,Fo),Xg.copy(e.boundingBox).applyMatrix4(Fo),this.boundingBox.union(Xg)}computeBoundingSphere(){let e=this.geometry,t=this.count;this.boundingSphere===null&&(this.boundingSphere=new _i),e.boundingSphere===null&&e.computeBoundingSphere(),this.boundingSphere.makeEmpty();for(let n=0;n<t;n++)this.getMatrixAt(n,Fo),Ga.copy(e.boundingSphere).applyMatrix4(Fo),this.boundingSphere.union(Ga)}copy(e,t){return super.copy(e,t),this.instanceMatrix.copy(e.instanceMatrix),this.morphTexture=e.morphTexture!==null?e.morphTexture.clone():null,this.instanceColor=e.instanceColor!==null?e.instanceColor.clone():null,this.count=e.count,this.boundingBox=e.boundingBox!==null?e.boundingBox.clone():null,this.boundingSphere=e.boundingSphere!==null?e.boundingSphere.clone():null,this}getColorAt(e,t){return this.instanceColor===null?t.setRGB(1,1,1):t.fromArray(this.instanceColor.array,e*3)}getMatrixAt(e,t){return t.fromArray(this.instanceMatrix.array,e*16)}getMorphAt(e,t){let n=t.morphTargetInfluences,s=this.morphTexture.source.data.data,r=n.length+1,o=e*r+1;for(let a=0;a<n.length;a++)n[a]=s[o+a]}raycast(e,t){let n=this.matrixWorld,s=this.count;if(Ha.geometry=this.geometry,Ha.material=this.material,Ha.material!==void 0&&(this.boundingSphere===null&&this.computeBoundingSphere(),Ga.copy(this.boundingSphere),Ga.applyMatrix4(n),e.ray.intersectsSphere(Ga)!==!1))for(let r=0;r<s;r++){this.getMatrixAt(r,Fo),Wg.multiplyMatrices(n,Fo),Ha.matrixWorld=Wg,Ha.raycast(e,Ec);for(let o=0,a=Ec.length;o<a;o++){let l=Ec[o];l.instanceId=r,l.object=this,t.push(l)}Ec.length=0}}setColorAt(e,t){return this.instanceColor===null&&(this.instanceColor=new Xs(new Float32Array(this.instanceMatrix.count*3).fill(1),3)),t.toArray(this.instanceColor.array,e*3),this}setMatrixAt(e,t){return t.toArray(this.instanceMatrix.array,e*16),this}setMorphAt(e,t){let n=t.morphTargetInfluences,s=n.length+1;this.morphTexture===null&&(this.morphTexture=new ys(new Float32Array(s*this.count),s,this.count,er,Pn));let r=this.morphTexture.source.data.data,o=0;for(let c=0;c<n.length;c++)o+=n[c];let a=this.geometry.morphTargetsRelative?1:1-o,l=s*e;return r[l]=a,r.set(n,l+1),this}updateMorphTargets(){}dispose(){super.dispose(),this.instanceMatrix.dispose(),this.instanceColor!==null&&this.instanceColor.dispose(),this.morphTexture!==null&&(this.morphTexture.dispose(),this.morphTexture=null)}},Wr=new _i,cS=new lt(.5,.5),Tc=new Q,br=class{constructor(e=new Li,t=new Li,n=new Li,s=new Li,r=new Li,o=new Li){this.planes=[e,t,n,s,r,o]}set(e,t,n,s,r,o){let a=this.planes;return a[0].copy(e),a[1].copy(t),a[2].copy(n),a[3].copy(s),a[4].copy(r),a[5].copy(o),this}copy(e){let t=this.planes;for(let n=0;n<6;n++)t[n].copy(e.planes[n]);return this}setFromProjectionMatrix(e,t=Gi,n=!1){let s=this.planes,r=e.elements,o=r[0],a=r[1],l=r[2],c=r[3],h=r[4],u=r[5],f=r[6],p=r[7],x=r[8],M=r[9],g=r[10],_=r[11],b=r[12],P=r[13],w=r[14],D=r[15];if(s[0].setComponents(c-o,p-h,_-x,D-b).normalize(),s[1].setComponents(c+o,p+h,_+x,D+b).normalize(),s[2].setComponents(c+a,p+u,_+M,D+P).normalize(),s[3].setComponents(c-a,p-u,_-M,D-P).normalize(),n)s[4].setComponents(l,f,g,w).normalize(),s[5].setComponents(c-l,p-f,_-g,D-w).normalize();else if(s[4].setComponents(c-l,p-f,_-g,D-w).normalize(),t===Gi)s[5].setComponents(c+l,p+f,_+g,D+w).normalize();else if(t===Wo)s[5].setComponents(l,f,g,w).normalize();else throw new Error("THREE.Frustum.setFromProjectionMatrix(): Invalid coordinate system: "+t);return this}intersectsObject(e){if(e.boundingSphere!==void 0)e.boundingSphere===null&&e.computeBoundingSphere(),Wr.copy(e.boundingSphere).applyMatrix4(e.matrixWorld);else{let t=e.geometry;t.boundingSphere===null&&t.computeBoundingSphere(),Wr.copy(t.boundingSphere).applyMatrix4(e.matrixWorld)}return this.intersectsSphere(Wr)}intersectsSprite(e){Wr.center.set(0,0,0);let t=cS.distanceTo(e.center);return Wr.radius=.7071067811865476+t,Wr.applyMatrix4(e.matrixWorld),this.intersectsSphere(Wr)}intersectsSphere(e){let t=this.planes,n=e.center,s=-e.radius;for(let r=0;r<6;r++)if(t[r].distanceToPoint(n)<s)return!1;return!0}intersectsBox(e){let t=this.planes;for(let n=0;n<6;n++){let s=t[n];if(Tc.x=s.normal.x>0?e.max.x:e.min.x,Tc.y=s.normal.y>0?e.max.y:e.min.y,Tc.z=s.normal.z>0?e.max.z:e.min.z,s.distanceToPoint(Tc)<0)return!1}return!0}containsPoint(e){let t=this.planes;for(let n=0;n<6;n++)if(t[n].distanceToPoint(e)<0)return!1;return!0}clone(){return new this.constructor().copy(this)}},qg=new Mt,Xc=class i{constructor(){this.coordinateSystem=Gi,this._frustums=[],this._count=0}setFromArrayCamera(e){let t=e.cameras,n=this._frustums;for(let s=0;s<t.length;s++){let r=t[s];qg.multiplyMatrices(r.projectionMatrix,r.matrixWorldInverse),n[s]===void 0&&(n[s]=new br),n[s].setFromProjectionMatrix(qg,r.coordinateSystem,r.reversedDepth)}return this._count=t.length,this}getFrustum(e){return this._frustums[e]}intersectsObject(e){let t=this._frustums;for(let n=0;n<this._count;n++)if(t[n].intersectsObject(e))return!0;return!1}intersectsSprite(e){let t=this._frustums;for(let n=0;n<this._count;n++)if(t[n].intersectsSprite(e))return!0;return!1}intersectsSphere(e){let t=this._frustums;for(let n=0;n<this._count;n++)if(t[n].intersectsSphere(e))return!0;return!1}intersectsBox(e){let t=this._frustums;for(let n=0;n<this._count;n++)if(t[n].intersectsBox(e))return!0;return!1}containsPoint(e){let t=this._frustums;for(let n=0;n<this._count;n++)if(t[n].containsPoint(e))return!0;return!1}copy(e){this.coordinateSystem=e.coordinateSystem;let t=this._frustums,n=e._frustums;for(let s=0;s<e._count;s++)t[s]===void 0&&(t[s]=new br),t[s].copy(n[s]);return this._count=e._count,this}clone(){return new i().copy(this)}};var wr=class extends xi{constructor(e){super(),this.isLineBasicMaterial=!0,this.type="LineBasicMaterial",this.color=new ft(16777215),this.map=null,this.linewidth=1,this.linecap="round",this.linejoin="round",this.fog=!0,this.setValues(e)}copy(e){return super.copy(e),this.color.copy(e.color),this.map=e.map,this.linewidth=e.linewidth,this.linecap=e.linecap,this.linejoin=e.linejoin,this.fog=e.fog,this}},qc=new Q,Yc=new Q,Yg=new Mt,Va=new Ws,Ac=new _i,Lf=new Q,Zg=new Q,Kr=class extends xn{constructor(e=new Qn,t=new wr){super(),this.isLine=!0,this.type="Line",this.geometry=e,this.material=t,this.morphTargetDictionary=void 0,this.morphTargetInfluences=void 0,this.updateMorphTargets()}copy(e,t){return super.copy(e,t),e.morphTargetInfluences!==void 0?this.morphTargetInfluences=e.morphTargetInfluences.slice():this.morphTargetInfluences=void 0,e.morphTargetDictionary!==void 0?this.morphTargetDictionary=Object.assign({},e.morphTargetDictionary):this.morphTargetDictionary=void 0,this.material=Array.isArray(e.material)?e.material.slice():e.material,this.geometry=e.geometry,this}computeLineDistances(){let e=this.geometry;if(e.index===null){let t=e.attributes.position,n=[0];for(let s=1,r=t.count;s<r;s++)qc.fromBufferAttribute(t,s-1),Yc.fromBufferAttribute(t,s),n[s]=n[s-1],n[s]+=qc.distanceTo(Yc);e.setAttribute("lineDistance",new ci(n,1))}else nt("Line.computeLineDistances(): Computation only possible with non-indexed BufferGeometry.");return this}intersectsFrustum(e){return e.intersectsObject(this)}raycast(e,t){let n=this.geometry,s=this.matrixWorld,r=e.params.Line.threshold,o=n.drawRange;if(n.boundingSphere===null&&n.computeBoundingSphere(),Ac.copy(n.boundingSphere),Ac.applyMatrix4(s),Ac.radius+=r,e.ray.intersectsSphere(Ac)===!1)return;Yg.copy(s).invert(),Va.copy(e.ray).applyMatrix4(Yg);let a=r/((this.scale.x+this.scale.y+this.scale.z)/3),l=a*a,c=this.isLineSegments?2:1,h=n.index,f=n.attributes.position;if(h!==null){let p=Math.max(0,o.start),x=Math.min(h.count,o.start+o.count);for(let M=p,g=x-1;M<g;M+=c){let _=h.getX(M),b=h.getX(M+1),P=Rc(this,e,Va,l,_,b,M);P&&t.push(P)}if(this.isLineLoop){let M=h.getX(x-1),g=h.getX(p),_=Rc(this,e,Va,l,M,g,x-1);_&&t.push(_)}}else{let p=Math.max(0,o.start),x=Math.min(f.count,o.start+o.count);for(let M=p,g=x-1;M<g;M+=c){let _=Rc(this,e,Va,l,M,M+1,M);_&&t.push(_)}if(this.isLineLoop){let M=Rc(this,e,Va,l,x-1,p,x-1);M&&t.push(M)}}}updateMorphTargets(){let t=this.geometry.morphAttributes,n=Object.keys(t);if(n.length>0){let s=t[n[0]];if(s!==void 0){this.morphTargetInfluences=[],this.morphTargetDictionary={};for(let r=0,o=s.length;r<o;r++){let a=s[r].name||String(r);this.morphTargetInfluences.push(0),this.morphTargetDictionary[a]=r}}}}};function Rc(i,e,t,n,s,r,o){let a=i.geometry.attributes.position;if(qc.fromBufferAttribute(a,s),Yc.fromBufferAttribute(a,r),t.distanceSqToSegment(qc,Yc,Lf,Zg)>n)return;Lf.applyMatrix4(i.matrixWorld);let c=e.ray.origin.distanceTo(Lf);if(!(c<e.near||c>e.far))return{distance:c,point:Zg.clone().applyMatrix4(i.matrixWorld),index:o,face:null,faceIndex:null,barycoord:null,object:i}}var Kg=new Q,$g=new Q,$r=class extends Kr{constructor(e,t){super(e,t),this.isLineSegments=!0,this.type="LineSegments"}computeLineDistances(){let e=this.geometry;if(e.index===null){let t=e.attributes.position,n=[];for(let s=0,r=t.count;s<r;s+=2)Kg.fromBufferAttribute(t,s),$g.fromBufferAttribute(t,s+1),n[s]=s===0?0:n[s-1],n[s+1]=n[s]+Kg.distanceTo($g);e.setAttribute("lineDistance",new ci(n,1))}else nt("LineSegments.computeLineDistances(): Computation only possible with non-indexed BufferGeometry.");return this}},nl=class extends Kr{constructor(e,t){super(e,t),this.isLineLoop=!0,this.type="LineLoop"}},jo=class extends xi{constructor(e){super(),this.isPointsMaterial=!0,this.type="PointsMaterial",this.color=new ft(16777215),this.map=null,this.alphaMap=null,this.size=1,this.sizeAttenuation=!0,this.fog=!0,this.setValues(e)}copy(e){return super.copy(e),this.color.copy(e.color),this.map=e.map,this.alphaMap=e.alphaMap,this.size=e.size,this.sizeAttenuation=e.sizeAttenuation,this.fog=e.fog,this}},Jg=new Mt,zf=new Ws,Cc=new _i,Ic=new Q,il=class extends xn{constructor(e=new Qn,t=new jo){super(),this.isPoints=!0,this.type="Points",this.geometry=e,this.material=t,this.morphTargetDictionary=void 0,this.morphTargetInfluences=void 0,this.updateMorphTargets()}copy(e,t){return super.copy(e,t),e.morphTargetInfluences!==void 0?this.morphTargetInfluences=e.morphTargetInfluences.slice():this.morphTargetInfluences=void 0,e.morphTargetDictionary!==void 0?this.morphTargetDictionary=Object.assign({},e.morphTargetDictionary):this.morphTargetDictionary=void 0,this.material=Array.isArray(e.material)?e.material.slice():e.material,this.geometry=e.geometry,this}intersectsFrustum(e){return e.intersectsObject(this)}raycast(e,t){let n=this.geometry,s=this.matrixWorld,r=e.params.Points.threshold,o=n.drawRange;if(n.boundingSphere===null&&n.computeBoundingSphere(),Cc.copy(n.boundingSphere),Cc.applyMatrix4(s),Cc.radius+=r,e.ray.intersectsSphere(Cc)===!1)return;Jg.copy(s).invert(),zf.copy(e.ray).applyMatrix4(Jg);let a=r/((this.scale.x+this.scale.y+this.scale.z)/3),l=a*a,c=n.index,u=n.attributes.position;if(c!==null){let f=Math.max(0,o.start),p=Math.min(c.count,o.start+o.count);for(let x=f,M=p;x<M;x++){let g=c.getX(x);Ic.fromBufferAttribute(u,g),jg(Ic,g,l,s,e,t,this)}}else{let f=Math.max(0,o.start),p=Math.min(u.count,o.start+o.count);for(let x=f,M=p;x<M;x++)Ic.fromBufferAttribute(u,x),jg(Ic,x,l,s,e,t,this)}}updateMorphTargets(){let t=this.geometry.morphAttributes,n=Object.keys(t);if(n.length>0){let s=t[n[0]];if(s!==void 0){this.morphTargetInfluences=[],this.morphTargetDictionary={};for(let r=0,o=s.length;r<o;r++){let a=s[r].name||String(r);this.morphTargetInfluences.push(0),this.morphTargetDictionary[a]=r}}}}};function jg(i,e,t,n,s,r,o){let a=zf.distanceSqToPoint(i);if(a<t){let l=new Q;zf.closestPointToPoint(i,l),l.applyMatrix4(n);let c=s.ray.origin.distanceTo(l);if(c<s.near||c>s.far)return;r.push({distance:c,distanceToRay:Math.sqrt(a),point:l,index:e,face:null,faceIndex:null,barycoord:null,object:o})}}var sl=class extends Yn{constructor(e=[],t=io,n,s,r,o,a,l,c,h){super(e,t,n,s,r,o,a,l,c,h),this.isCubeTexture=!0,this.flipY=!1}get images(){return this.image}set images(e){this.image=e}};var qs=class extends Yn{constructor(e,t,n=as,s,r,o,a=En,l=En,c,h=Hs,u=1){if(h!==Hs&&h!==Qs)throw new Error("THREE.DepthTexture: format must be either THREE.DepthFormat or THREE.DepthStencilFormat");let f={width:e,height:t,depth:u};super(f,s,r,o,a,l,h,n,c),this.isDepthTexture=!0,this.flipY=!1,this.generateMipmaps=!1,this.compareFunction=null}copy(e){return super.copy(e),this.source=new Yo(Object.assign({},e.image)),this.compareFunction=e.compareFunction,this}toJSON(e){let t=super.toJSON(e);return t.compareFunction=this.compareFunction,t}},rl=class extends qs{constructor(e,t=as,n=io,s,r,o=En,a=En,l,c=Hs){let h={width:e,height:e,depth:1},u=[h,h,h,h,h,h];super(e,e,t,n,s,r,o,a,l,c),this.image=u,this.isCubeDepthTexture=!0,this.isCubeTexture=!0}get images(){return this.image}set images(e){this.image=e}},ol=class extends Yn{constructor(e=null){super(),this.sourceTexture=e,this.isExternalTexture=!0}copy(e){return super.copy(e),this.sourceTexture=e.sourceTexture,this}},Qo=class i extends Qn{constructor(e=1,t=1,n=1,s=1,r=1,o=1){super(),this.type="BoxGeometry",this.parameters={width:e,height:t,depth:n,widthSegments:s,heightSegments:r,depthSegments:o};let a=this;s=Math.floor(s),r=Math.floor(r),o=Math.floor(o);let l=[],c=[],h=[],u=[],f=0,p=0;x("z","y","x",-1,-1,n,t,e,o,r,0),x("z","y","x",1,-1,n,t,-e,o,r,1),x("x","z","y",1,1,e,n,t,s,o,2),x("x","z","y",1,-1,e,n,-t,s,o,3),x("x","y","z",1,-1,e,t,n,s,r,4),x("x","y","z",-1,-1,e,t,-n,s,r,5),this.setIndex(l),this.setAttribute("position",new ci(c,3)),this.setAttribute("normal",new ci(h,3)),this.setAttribute("uv",new ci(u,2));function x(M,g,_,b,P,w,D,I,y,T,G){let k=w/y,O=D/T,Y=w/2,Z=D/2,U=I/2,W=y+1,$=T+1,q=0,xe=0,ne=new Q;for(let se=0;se<$;se++){let de=se*O-Z;for(let ge=0;ge<W;ge++){let pe=ge*k-Y;ne[M]=pe*b,ne[g]=de*P,ne[_]=U,c.push(ne.x,ne.y,ne.z),ne[M]=0,ne[g]=0,ne[_]=I>0?1:-1,h.push(ne.x,ne.y,ne.z),u.push(ge/y),u.push(1-se/T),q+=1}}for(let se=0;se<T;se++)for(let de=0;de<y;de++){let ge=f+de+W*se,pe=f+de+W*(se+1),re=f+(de+1)+W*(se+1),Te=f+(de+1)+W*se;l.push(ge,pe,Te),l.push(pe,re,Te),xe+=6}a.addGroup(p,xe,G),p+=xe,f+=q}}copy(e){return super.copy(e),this.parameters=Object.assign({},e.parameters),this}static fromJSON(e){return new i(e.width,e.height,e.depth,e.widthSegments,e.heightSegments,e.depthSegments)}};var Ss=class i extends Qn{constructor(e=1,t=1,n=1,s=1){super(),this.type="PlaneGeometry",this.parameters={width:e,height:t,widthSegments:n,heightSegments:s};let r=e/2,o=t/2,a=Math.floor(n),l=Math.floor(s),c=a+1,h=l+1,u=e/a,f=t/l,p=[],x=[],M=[],g=[];for(let _=0;_<h;_++){let b=_*f-o;for(let P=0;P<c;P++){let w=P*u-r;x.push(w,-b,0),M.push(0,0,1),g.push(P/a),g.push(1-_/l)}}for(let _=0;_<l;_++)for(let b=0;b<a;b++){let P=b+c*_,w=b+c*(_+1),D=b+1+c*(_+1),I=b+1+c*_;p.push(P,w,I),p.push(w,D,I)}this.setIndex(p),this.setAttribute("position",new ci(x,3)),this.setAttribute("normal",new ci(M,3)),this.setAttribute("uv",new ci(g,2))}copy(e){return super.copy(e),this.parameters=Object.assign({},e.parameters),this}static fromJSON(e){return new i(e.width,e.height,e.widthSegments,e.heightSegments)}};function oo(i){let e={};for(let t in i){e[t]={};for(let n in i[t]){let s=i[t][n];if(Qg(s))s.isRenderTargetTexture?(nt("UniformsUtils: Textures of render targets cannot be cloned via cloneUniforms() or mergeUniforms()."),e[t][n]=null):e[t][n]=s.clone();else if(Array.isArray(s))if(Qg(s[0])){let r=[];for(let o=0,a=s.length;o<a;o++)r[o]=s[o].clone();e[t][n]=r}else e[t][n]=s.slice();else e[t][n]=s}}return e}function ni(i){let e={};for(let t=0;t<i.length;t++){let n=oo(i[t]);for(let s in n)e[s]=n[s]}return e}function Qg(i){return i&&(i.isColor||i.isMatrix3||i.isMatrix4||i.isVector2||i.isVector3||i.isVector4||i.isTexture||i.isQuaternion)}function hS(i){let e=[];for(let t=0;t<i.length;t++)e.push(i[t].clone());return e}function Sd(i){let e=i.getRenderTarget();return e===null?i.outputColorSpace:e.isXRRenderTarget===!0?e.texture.colorSpace:Ct.workingColorSpace}var W0={clone:oo,merge:ni},uS=`void main() {
	gl_Position = projectionMatrix * modelViewMatrix * vec4( position, 1.0 );
}`,fS=`void main() {
	gl_FragColor = vec4( 1.0, 0.0, 0.0, 1.0 );
}`,fi=class extends xi{constructor(e){super(),this.isShaderMaterial=!0,this.type="ShaderMaterial",this.defines={},this.uniforms={},this.uniformsGroups=[],this.vertexShader=uS,this.fragmentShader=fS,this.linewidth=1,this.wireframe=!1,this.wireframeLinewidth=1,this.fog=!1,this.lights=!1,this.clipping=!1,this.forceSinglePass=!0,this.extensions={clipCullDistance:!1,multiDraw:!1},this.defaultAttributeValues={color:[1,1,1],uv:[0,0],uv1:[0,0]},this.index0AttributeName=void 0,this.uniformsNeedUpdate=!1,this.glslVersion=null,e!==void 0&&this.setValues(e)}copy(e){return super.copy(e),this.fragmentShader=e.fragmentShader,this.vertexShader=e.vertexShader,this.uniforms=oo(e.uniforms),this.uniformsGroups=hS(e.uniformsGroups),this.defines=Object.assign({},e.defines),this.wireframe=e.wireframe,this.wireframeLinewidth=e.wireframeLinewidth,this.fog=e.fog,this.lights=e.lights,this.clipping=e.clipping,this.extensions=Object.assign({},e.extensions),this.glslVersion=e.glslVersion,this.defaultAttributeValues=Object.assign({},e.defaultAttributeValues),this.index0AttributeName=e.index0AttributeName,this.uniformsNeedUpdate=e.uniformsNeedUpdate,this}toJSON(e){let t=super.toJSON(e);t.glslVersion=this.glslVersion,t.uniforms={};for(let s in this.uniforms){let o=this.uniforms[s].value;o&&o.isTexture?t.uniforms[s]={type:"t",value:o.toJSON(e).uuid}:o&&o.isColor?t.uniforms[s]={type:"c",value:o.getHex()}:o&&o.isVector2?t.uniforms[s]={type:"v2",value:o.toArray()}:o&&o.isVector3?t.uniforms[s]={type:"v3",value:o.toArray()}:o&&o.isVector4?t.uniforms[s]={type:"v4",value:o.toArray()}:o&&o.isMatrix3?t.uniforms[s]={type:"m3",value:o.toArray()}:o&&o.isMatrix4?t.uniforms[s]={type:"m4",value:o.toArray()}:t.uniforms[s]={value:o}}Object.keys(this.defines).length>0&&(t.defines=this.defines),t.vertexShader=this.vertexShader,t.fragmentShader=this.fragmentShader,t.lights=this.lights,t.clipping=this.clipping;let n={};for(let s in this.extensions)this.extensions[s]===!0&&(n[s]=!0);return Object.keys(n).length>0&&(t.extensions=n),t}fromJSON(e,t){if(super.fromJSON(e,t),e.uniforms!==void 0)for(let n in e.uniforms){let s=e.uniforms[n];switch(this.uniforms[n]={},s.type){case"t":this.uniforms[n].value=t[s.value]||null;break;case"c":this.uniforms[n].value=new ft().setHex(s.value);break;case"v2":this.uniforms[n].value=new lt().fromArray(s.value);break;case"v3":this.uniforms[n].value=new Q().fromArray(s.value);break;case"v4":this.uniforms[n].value=new $t().fromArray(s.value);break;case"m3":this.uniforms[n].value=new yt().fromArray(s.value);break;case"m4":this.uniforms[n].value=new Mt().fromArray(s.value);break;default:this.uniforms[n].value=s.value}}if(e.defines!==void 0&&(this.defines=e.defines),e.vertexShader!==void 0&&(this.vertexShader=e.vertexShader),e.fragmentShader!==void 0&&(this.fragmentShader=e.fragmentShader),e.glslVersion!==void 0&&(this.glslVersion=e.glslVersion),e.extensions!==void 0)for(let n in e.extensions)this.extensions[n]=e.extensions[n];return e.lights!==void 0&&(this.lights=e.lights),e.clipping!==void 0&&(this.clipping=e.clipping),this}},Zc=class extends fi{constructor(e){super(e),this.isRawShaderMaterial=!0,this.type="RawShaderMaterial"}},Ys=class extends xi{constructor(e){super(),this.isMeshStandardMaterial=!0,this.type="MeshStandardMaterial",this.defines={STANDARD:""},this.color=new ft(16777215),this.roughness=1,this.metalness=0,this.map=null,this.lightMap=null,this.lightMapIntensity=1,this.aoMap=null,this.aoMapIntensity=1,this.emissive=new ft(0),this.emissiveIntensity=1,this.emissiveMap=null,this.bumpMap=null,this.bumpScale=1,this.normalMap=null,this.normalMapType=Wh,this.normalScale=new lt(1,1),this.displacementMap=null,this.displacementScale=1,this.displacementBias=0,this.roughnessMap=null,this.metalnessMap=null,this.alphaMap=null,this.envMap=null,this.envMapRotation=new Gs,this.envMapIntensity=1,this.wireframe=!1,this.wireframeLinewidth=1,this.wireframeLinecap="round",this.wireframeLinejoin="round",this.flatShading=!1,this.fog=!0,this.setValues(e)}copy(e){return super.copy(e),this.defines={STANDARD:""},this.color.copy(e.color),this.roughness=e.roughness,this.metalness=e.metalness,this.map=e.map,this.lightMap=e.lightMap,this.lightMapIntensity=e.lightMapIntensity,this.aoMap=e.aoMap,this.aoMapIntensity=e.aoMapIntensity,this.emissive.copy(e.emissive),this.emissiveMap=e.emissiveMap,this.emissiveIntensity=e.emissiveIntensity,this.bumpMap=e.bumpMap,this.bumpScale=e.bumpScale,this.normalMap=e.normalMap,this.normalMapType=e.normalMapType,this.normalScale.copy(e.normalScale),this.displacementMap=e.displacementMap,this.displacementScale=e.displacementScale,this.displacementBias=e.displacementBias,this.roughnessMap=e.roughnessMap,this.metalnessMap=e.metalnessMap,this.alphaMap=e.alphaMap,this.envMap=e.envMap,this.envMapRotation.copy(e.envMapRotation),this.envMapIntensity=e.envMapIntensity,this.wireframe=e.wireframe,this.wireframeLinewidth=e.wireframeLinewidth,this.wireframeLinecap=e.wireframeLinecap,this.wireframeLinejoin=e.wireframeLinejoin,this.flatShading=e.flatShading,this.fog=e.fog,this}},di=class extends Ys{constructor(e){super(),this.isMeshPhysicalMaterial=!0,this.defines={STANDARD:"",PHYSICAL:""},this.type="MeshPhysicalMaterial",this.anisotropyRotation=0,this.anisotropyMap=null,this.clearcoatMap=null,this.clearcoatRoughness=0,this.clearcoatRoughnessMap=null,this.clearcoatNormalScale=new lt(1,1),this.clearcoatNormalMap=null,this.diffuseRoughnessMap=null,this.ior=1.5,Object.defineProperty(this,"reflectivity",{get:function(){return Rt(2.5*(this.ior-1)/(this.ior+1),0,1)},set:function(t){this.ior=(1+.4*t)/(1-.4*t)}}),this.iridescenceMap=null,this.iridescenceIOR=1.3,this.iridescenceThicknessMinimum=100,this.iridescenceThicknessMaximum=400,this.iridescenceThicknessMap=null,this.sheenColor=new ft(0),this.sheenColorMap=null,this.sheenRoughness=1,this.sheenRoughnessMap=null,this.transmissionMap=null,this.thickness=0,this.thicknessMap=null,this.attenuationDistance=1/0,this.attenuationColor=new ft(1,1,1),this.specularIntensity=1,this.specularIntensityMap=null,this.specularColor=new ft(1,1,1),this.specularColorMap=null,this._anisotropy=0,this._clearcoat=0,this._diffuseRoughness=0,this._dispersion=0,this._iridescence=0,this._retroreflectivity=0,this._sheen=0,this._transmission=0,this.setValues(e)}get anisotropy(){return this._anisotropy}set anisotropy(e){this._anisotropy>0!=e>0&&this.version++,this._anisotropy=e}get clearcoat(){return this._clearcoat}set clearcoat(e){this._clearcoat>0!=e>0&&this.version++,this._clearcoat=e}get diffuseRoughness(){return this._diffuseRoughness}set diffuseRoughness(e){this._diffuseRoughness>0!=e>0&&this.version++,this._diffuseRoughness=e}get iridescence(){return this._iridescence}set iridescence(e){this._iridescence>0!=e>0&&this.version++,this._iridescence=e}get dispersion(){return this._dispersion}set dispersion(e){this._dispersion>0!=e>0&&this.version++,this._dispersion=e}get retroreflectivity(){return this._retroreflectivity}set retroreflectivity(e){this._retroreflectivity>0!=e>0&&this.version++,this._retroreflectivity=e}get sheen(){return this._sheen}set sheen(e){this._sheen>0!=e>0&&this.version++,this._sheen=e}get transmission(){return this._transmission}set transmission(e){this._transmission>0!=e>0&&this.version++,this._transmission=e}get iridescenceThicknessRange(){return Xr('MeshPhysicalMaterial: The "iridescenceThicknessRange" property has been replaced by "iridescenceThicknessMinimum" and "iridescenceThicknessMaximum".'),[this.iridescenceThicknessMinimum,this.iridescenceThicknessMaximum]}set iridescenceThicknessRange(e){Xr('MeshPhysicalMaterial: The "iridescenceThicknessRange" property has been replaced by "iridescenceThicknessMinimum" and "iridescenceThicknessMaximum".'),this.iridescenceThicknessMinimum=e[0],this.iridescenceThicknessMaximum=e[1]}copy(e){return super.copy(e),this.defines={STANDARD:"",PHYSICAL:""},this.anisotropy=e.anisotropy,this.anisotropyRotation=e.anisotropyRotation,this.anisotropyMap=e.anisotropyMap,this.clearcoat=e.clearcoat,this.clearcoatMap=e.clearcoatMap,this.clearcoatRoughness=e.clearcoatRoughness,this.clearcoatRoughnessMap=e.clearcoatRoughnessMap,this.clearcoatNormalMap=e.clearcoatNormalMap,this.clearcoatNormalScale.copy(e.clearcoatNormalScale),this.diffuseRoughness=e.diffuseRoughness,this.diffuseRoughnessMap=e.diffuseRoughnessMap,this.dispersion=e.dispersion,this.ior=e.ior,this.iridescence=e.iridescence,this.iridescenceMap=e.iridescenceMap,this.iridescenceIOR=e.iridescenceIOR,this.iridescenceThicknessMinimum=e.iridescenceThicknessMinimum,this.iridescenceThicknessMaximum=e.iridescenceThicknessMaximum,this.iridescenceThicknessMap=e.iridescenceThicknessMap,this.retroreflectivity=e.retroreflectivity,this.sheen=e.sheen,this.sheenColor.copy(e.sheenColor),this.sheenColorMap=e.sheenColorMap,this.sheenRoughness=e.sheenRoughness,this.sheenRoughnessMap=e.sheenRoughnessMap,this.transmission=e.transmission,this.transmissionMap=e.transmissionMap,this.thickness=e.thickness,this.thicknessMap=e.thicknessMap,this.attenuationDistance=e.attenuationDistance,this.attenuationColor.copy(e.attenuationColor),this.specularIntensity=e.specularIntensity,this.specularIntensityMap=e.specularIntensityMap,this.specularColor.copy(e.specularColor),this.specularColorMap=e.specularColorMap,this}};var Kc=class extends xi{constructor(e){super(),this.isMeshDepthMaterial=!0,this.type="MeshDepthMaterial",this.depthPacking=P0,this.map=null,this.alphaMap=null,this.displacementMap=null,this.displacementScale=1,this.displacementBias=0,this.wireframe=!1,this.wireframeLinewidth=1,this.setValues(e)}copy(e){return super.copy(e),this.depthPacking=e.depthPacking,this.map=e.map,this.alphaMap=e.alphaMap,this.displacementMap=e.displacementMap,this.displacementScale=e.displacementScale,this.displacementBias=e.displacementBias,this.wireframe=e.wireframe,this.wireframeLinewidth=e.wireframeLinewidth,this}},$c=class extends xi{constructor(e){super(),this.isMeshDistanceMaterial=!0,this.type="MeshDistanceMaterial",this.map=null,this.alphaMap=null,this.displacementMap=null,this.displacementScale=1,this.displacementBias=0,this.setValues(e)}copy(e){return super.copy(e),this.map=e.map,this.alphaMap=e.alphaMap,this.displacementMap=e.displacementMap,this.displacementScale=e.displacementScale,this.displacementBias=e.displacementBias,this}};function yr(i,e){return!i||i.constructor===e?i:typeof e.BYTES_PER_ELEMENT=="number"?new e(i):Array.prototype.slice.call(i)}function Wa(i){return i!==void 0&&i.inTangents!==void 0&&i.outTangents!==void 0}function dS(i){function e(s,r){return i[s]-i[r]}let t=i.length,n=new Array(t);for(let s=0;s!==t;++s)n[s]=s;return n.sort(e),n}function e0(i,e,t){let n=i.length,s=new i.constructor(n);for(let r=0,o=0;o!==n;++r){let a=t[r]*e;for(let l=0;l!==e;++l)s[o++]=i[a+l]}return s}function pS(i,e,t,n){let s=1,r=i[0];for(;r!==void 0&&r[n]===void 0;)r=i[s++];if(r===void 0)return;let o=r[n];if(o!==void 0)if(Array.isArray(o))do o=r[n],o!==void 0&&(e.push(r.time),t.push(...o)),r=i[s++];while(r!==void 0);else if(o.toArray!==void 0)do o=r[n],o!==void 0&&(e.push(r.time),o.toArray(t,t.length)),r=i[s++];while(r!==void 0);else do o=r[n],o!==void 0&&(e.push(r.time),t.push(o)),r=i[s++];while(r!==void 0)}var Ms=class{constructor(e,t,n,s){this.parameterPositions=e,this._cachedIndex=0,this.resultBuffer=s!==void 0?s:new t.constructor(n),this.sampleValues=t,this.valueSize=n,this.settings=null,this.DefaultSettings_={}}evaluate(e){let t=this.parameterPositions,n=this._cachedIndex,s=t[n],r=t[n-1];n:{e:{let o;t:{i:if(!(e<s)){for(let a=n+2;;){if(s===void 0){if(e<r)break i;return n=t.length,this._cachedIndex=n,this.copySampleValue_(n-1)}if(n===a)break;if(r=s,s=t[++n],e<s)break e}o=t.length;break t}if(!(e>=r)){let a=t[1];e<a&&(n=2,r=a);for(let l=n-2;;){if(r===void 0)return this._cachedIndex=0,this.copySampleValue_(0);if(n===l)break;if(s=r,r=t[--n-1],e>=r)break e}o=n,n=0;break t}break n}for(;n<o;){let a=n+o>>>1;e<t[a]?o=a:n=a+1}if(s=t[n],r=t[n-1],r===void 0)return this._cachedIndex=0,this.copySampleValue_(0);if(s===void 0)return n=t.length,this._cachedIndex=n,this.copySampleValue_(n-1)}this._cachedIndex=n,this.intervalChanged_(n,r,s)}return this.interpolate_(n,r,e,s)}getSettings_(){return this.settings||this.DefaultSettings_}copySampleValue_(e){let t=this.resultBuffer,n=this.sampleValues,s=this.valueSize,r=e*s;for(let o=0;o!==s;++o)t[o]=n[r+o];return t}interpolate_(){throw new Error("THREE.Interpolant: Call to abstract method.")}intervalChanged_(){}},Jc=class extends Ms{constructor(e,t,n,s){super(e,t,n,s),this._weightPrev=-0,this._offsetPrev=-0,this._weightNext=-0,this._offsetNext=-0,this.DefaultSettings_={endingStart:Ff,endingEnd:Ff}}intervalChanged_(e,t,n){let s=this.parameterPositions,r=e-2,o=e+1,a=s[r],l=s[o];if(a===void 0)switch(this.getSettings_().endingStart){case Bf:r=e,a=2*t-n;break;case kf:r=s.length-2,a=t+s[r]-s[r+1];break;default:r=e,a=n}if(l===void 0)switch(this.getSettings_().endingEnd){case Bf:o=e,l=2*n-t;break;case kf:o=1,l=n+s[1]-s[0];break;default:o=e-1,l=t}let c=(n-t)*.5,h=this.valueSize;this._weightPrev=c/(t-a),this._weightNext=c/(l-n),this._offsetPrev=r*h,this._offsetNext=o*h}interpolate_(e,t,n,s){let r=this.resultBuffer,o=this.sampleValues,a=this.valueSize,l=e*a,c=l-a,h=this._offsetPrev,u=this._offsetNext,f=this._weightPrev,p=this._weightNext,x=(n-t)/(s-t),M=x*x,g=M*x,_=-f*g+2*f*M-f*x,b=(1+f)*g+(-1.5-2*f)*M+(-.5+f)*x+1,P=(-1-p)*g+(1.5+p)*M+.5*x,w=p*g-p*M;for(let D=0;D!==a;++D)r[D]=_*o[h+D]+b*o[c+D]+P*o[l+D]+w*o[u+D];return r}},jc=class extends Ms{constructor(e,t,n,s){super(e,t,n,s)}interpolate_(e,t,n,s){let r=this.resultBuffer,o=this.sampleValues,a=this.valueSize,l=e*a,c=l-a,h=(n-t)/(s-t),u=1-h;for(let f=0;f!==a;++f)r[f]=o[c+f]*u+o[l+f]*h;return r}},Qc=class extends Ms{constructor(e,t,n,s){super(e,t,n,s)}interpolate_(e){return this.copySampleValue_(e-1)}},eh=class extends Ms{interpolate_(e,t,n,s){let r=this.resultBuffer,o=this.sampleValues,a=this.valueSize,l=e*a,c=l-a,h=this.inTangents,u=this.outTangents;if(!h||!u){let x=(n-t)/(s-t),M=1-x;for(let g=0;g!==a;++g)r[g]=o[c+g]*M+o[l+g]*x;return r}let f=a*2,p=e-1;for(let x=0;x!==a;++x){let M=o[c+x],g=o[l+x],_=p*f+x*2,b=u[_],P=u[_+1],w=e*f+x*2,D=h[w],I=h[w+1],y=gS(n,t,b,D,s);r[x]=X0(y,M,P,I,g)}return r}};function X0(i,e,t,n,s){let r=1-i;return r*r*r*e+3*r*r*i*t+3*r*i*i*n+i*i*i*s}function mS(i,e,t,n,s){let r=1-i;return 3*r*r*(t-e)+6*r*i*(n-t)+3*i*i*(s-n)}function gS(i,e,t,n,s){let r=(i-e)/(s-e);for(let o=0;o<8;o++){let a=X0(r,e,t,n,s)-i;if(Math.abs(a)<1e-10)break;let l=mS(r,e,t,n,s);if(Math.abs(l)<1e-10)break;r=Math.max(0,Math.min(1,r-a/l))}return r}var vi=class{constructor(e,t,n,s){if(e===void 0)throw new Error("THREE.KeyframeTrack: track name is undefined");if(t===void 0||t.length===0)throw new Error("THREE.KeyframeTrack: no keyframes in track named "+e);this.name=e,this.times=yr(t,this.TimeBufferType),this.values=yr(n,this.ValueBufferType),this.setInterpolation(s||this.DefaultInterpolation)}static toJSON(e){let t=e.constructor,n;if(t.toJSON!==this.toJSON)n=t.toJSON(e);else{n={name:e.name,times:yr(e.times,Array),values:yr(e.values,Array)};let s=e.getInterpolation();s!==e.DefaultInterpolation&&(n.interpolation=s),Wa(e.settings)&&(n.settings={inTangents:yr(e.settings.inTangents,Array),outTangents:yr(e.settings.outTangents,Array)})}return n.type=e.ValueTypeName,n}InterpolantFactoryMethodDiscrete(e){return new Qc(this.times,this.values,this.getValueSize(),e)}InterpolantFactoryMethodLinear(e){return new jc(this.times,this.values,this.getValueSize(),e)}InterpolantFactoryMethodSmooth(e){return new Jc(this.times,this.values,this.getValueSize(),e)}InterpolantFactoryMethodBezier(e){let t=new eh(this.times,this.values,this.getValueSize(),e);return this.settings&&(t.inTangents=this.settings.inTangents,t.outTangents=this.settings.outTangents),t}setInterpolation(e){let t;switch(e){case qr:t=this.InterpolantFactoryMethodDiscrete;break;case Yr:t=this.InterpolantFactoryMethodLinear;break;case Dc:t=this.InterpolantFactoryMethodSmooth;break;case Of:t=this.InterpolantFactoryMethodBezier;break}if(t===void 0){let n="unsupported interpolation for "+this.ValueTypeName+" keyframe track named "+this.name;if(this.createInterpolant===void 0)if(e!==this.DefaultInterpolation)this.setInterpolation(this.DefaultInterpolation);else throw new Error(n);return nt("KeyframeTrack:",n),this}return this.createInterpolant=t,this}getInterpolation(){switch(this.createInterpolant){case this.InterpolantFactoryMethodDiscrete:return qr;case this.InterpolantFactoryMethodLinear:return Yr;case this.InterpolantFactoryMethodSmooth:return Dc;case this.InterpolantFactoryMethodBezier:return Of}}getValueSize(){return this.values.length/this.times.length}shift(e){if(e!==0){let t=this.times;for(let n=0,s=t.length;n!==s;++n)t[n]+=e;Wa(this.settings)&&(t0(this.settings.inTangents,e),t0(this.settings.outTangents,e))}return this}scale(e){if(e!==1){let t=this.times;for(let n=0,s=t.length;n!==s;++n)t[n]*=e;Wa(this.settings)&&(n0(this.settings.inTangents,e),n0(this.settings.outTangents,e))}return this}trim(e,t){let n=this.times,s=n.length,r=0,o=s-1;for(;r!==s&&n[r]<e;)++r;for(;o!==-1&&n[o]>t;)--o;if(++o,r!==0||o!==s){r>=o&&(o=Math.max(o,1),r=o-1);let a=this.getValueSize();this.times=n.slice(r,o),this.values=this.values.slice(r*a,o*a)}return this}validate(){let e=!0,t=this.getValueSize();t-Math.floor(t)!==0&&(gt("KeyframeTrack: Invalid value size in track.",this),e=!1);let n=this.times,s=this.values,r=n.length;r===0&&(gt("KeyframeTrack: Track is empty.",this),e=!1);let o=null;for(let a=0;a!==r;a++){let l=n[a];if(typeof l=="number"&&isNaN(l)){gt("KeyframeTrack: Time is not a valid number.",this,a,l),e=!1;break}if(o!==null&&o>l){gt("KeyframeTrack: Out of order keys.",this,a,l,o),e=!1;break}o=l}if(s!==void 0&&wy(s))for(let a=0,l=s.length;a!==l;++a){let c=s[a];if(isNaN(c)){gt("KeyframeTrack: Value is not a valid number.",this,a,c),e=!1;break}}return e}optimize(){let e=this.times.slice(),t=this.values.slice(),n=this.getValueSize(),s=this.getInterpolation()===Dc,r=e.length-1,o=1;for(let a=1;a<r;++a){let l=!1,c=e[a],h=e[a+1];if(c!==h&&(a!==1||c!==e[0]))if(s)l=!0;else{let u=a*n,f=u-n,p=u+n;for(let x=0;x!==n;++x){let M=t[u+x];if(M!==t[f+x]||M!==t[p+x]){l=!0;break}}}if(l){if(a!==o){e[o]=e[a];let u=a*n,f=o*n;for(let p=0;p!==n;++p)t[f+p]=t[u+p]}++o}}if(r>0){e[o]=e[r];for(let a=r*n,l=o*n,c=0;c!==n;++c)t[l+c]=t[a+c];++o}return o!==e.length?(this.times=e.slice(0,o),this.values=t.slice(0,o*n)):(this.times=e,this.values=t),this}clone(){let e=this.times.slice(),t=this.values.slice(),n=this.constructor,s=new n(this.name,e,t);return s.createInterpolant=this.createInterpolant,Wa(this.settings)&&(s.settings={inTangents:this.settings.inTangents.slice(),outTangents:this.settings.outTangents.slice()}),s}};function t0(i,e){for(let t=0,n=i.length;t!==n;t+=2)i[t]+=e}function n0(i,e){for(let t=0,n=i.length;t!==n;t+=2)i[t]*=e}vi.prototype.ValueTypeName="";vi.prototype.TimeBufferType=Float32Array;vi.prototype.ValueBufferType=Float32Array;vi.prototype.DefaultInterpolation=Yr;var Zs=class extends vi{constructor(e,t,n){super(e,t,n)}};Zs.prototype.ValueTypeName="bool";Zs.prototype.ValueBufferType=Array;Zs.prototype.DefaultInterpolation=qr;Zs.prototype.InterpolantFactoryMethodLinear=void 0;Zs.prototype.InterpolantFactoryMethodSmooth=void 0;var al=class extends vi{constructor(e,t,n,s){super(e,t,n,s)}};al.prototype.ValueTypeName="color";var Ks=class extends vi{constructor(e,t,n,s){super(e,t,n,s)}};Ks.prototype.ValueTypeName="number";var th=class extends Ms{constructor(e,t,n,s){super(e,t,n,s)}interpolate_(e,t,n,s){let r=this.resultBuffer,o=this.sampleValues,a=this.valueSize,l=(n-t)/(s-t),c=e*a;for(let h=c+a;c!==h;c+=4)qn.slerpFlat(r,0,o,c-a,o,c,l);return r}},$s=class extends vi{constructor(e,t,n,s){super(e,t,n,s)}InterpolantFactoryMethodLinear(e){return new th(this.times,this.values,this.getValueSize(),e)}};$s.prototype.ValueTypeName="quaternion";$s.prototype.InterpolantFactoryMethodSmooth=void 0;var Js=class extends vi{constructor(e,t,n){super(e,t,n)}};Js.prototype.ValueTypeName="string";Js.prototype.ValueBufferType=Array;Js.prototype.DefaultInterpolation=qr;Js.prototype.InterpolantFactoryMethodLinear=void 0;Js.prototype.InterpolantFactoryMethodSmooth=void 0;var Er=class extends vi{constructor(e,t,n,s){super(e,t,n,s)}};Er.prototype.ValueTypeName="vector";var ll=class{constructor(e="",t=-1,n=[],s=I0){this.name=e,this.tracks=n,this.duration=t,this.blendMode=s,this.uuid=ws(),this.userData={},this.duration<0&&this.resetDuration()}static parse(e){let t=[],n=e.tracks,s=1/(e.fps||1);for(let o=0,a=n.length;o!==a;++o)t.push(xS(n[o]).scale(s));let r=new this(e.name,e.duration,t,e.blendMode);return r.uuid=e.uuid,r.userData=JSON.parse(e.userData||"{}"),r}static toJSON(e){let t=[],n=e.tracks,s={name:e.name,duration:e.duration,tracks:t,uuid:e.uuid,blendMode:e.blendMode,userData:JSON.stringify(e.userData)};for(let r=0,o=n.length;r!==o;++r)t.push(vi.toJSON(n[r]));return s}static CreateFromMorphTargetSequence(e,t,n,s){let r=t.length,o=[];for(let a=0;a<r;a++){let l=[],c=[];l.push((a+r-1)%r,a,(a+1)%r),c.push(0,1,0);let h=dS(l);l=e0(l,1,h),c=e0(c,1,h),!s&&l[0]===0&&(l.push(r),c.push(c[0])),o.push(new Ks(".morphTargetInfluences["+t[a].name+"]",l,c).scale(1/n))}return new this(e,-1,o)}static findByName(e,t){let n=e;if(!Array.isArray(e)){let s=e;n=s.geometry&&s.geometry.animations||s.animations}for(let s=0;s<n.length;s++)if(n[s].name===t)return n[s];return null}static CreateClipsFromMorphTargetSequences(e,t,n){let s={},r=/^([\w-]*?)([\d]+)$/;for(let a=0,l=e.length;a<l;a++){let c=e[a],h=c.name.match(r);if(h&&h.length>1){let u=h[1],f=s[u];f||(s[u]=f=[]),f.push(c)}}let o=[];for(let a in s)o.push(this.CreateFromMorphTargetSequence(a,s[a],t,n));return o}resetDuration(){let e=this.tracks,t=0;for(let n=0,s=e.length;n!==s;++n){let r=this.tracks[n];t=Math.max(t,r.times[r.times.length-1])}return this.duration=t,this}trim(){for(let e=0;e<this.tracks.length;e++)this.tracks[e].trim(0,this.duration);return this}validate(){let e=!0;for(let t=0;t<this.tracks.length;t++)e=e&&this.tracks[t].validate();return e}optimize(){for(let e=0;e<this.tracks.length;e++)this.tracks[e].optimize();return this}clone(){let e=[];for(let n=0;n<this.tracks.length;n++)e.push(this.tracks[n].clone());let t=new this.constructor(this.name,this.duration,e,this.blendMode);return t.userData=JSON.parse(JSON.stringify(this.userData)),t}toJSON(){return this.constructor.toJSON(this)}};function _S(i){switch(i.toLowerCase()){case"scalar":case"double":case"float":case"number":case"integer":return Ks;case"vector":case"vector2":case"vector3":case"vector4":return Er;case"color":return al;case"quaternion":return $s;case"bool":case"boolean":return Zs;case"string":return Js}throw new Error("THREE.KeyframeTrack: Unsupported typeName: "+i)}function xS(i){if(i.type===void 0)throw new Error("THREE.KeyframeTrack: track type undefined, can not parse");let e=_S(i.type);if(i.times===void 0){let n=[],s=[];pS(i.keys,n,s,"value"),i.times=n,i.values=s}let t;return e.parse!==void 0?t=e.parse(i):t=new e(i.name,i.times,i.values,i.interpolation),Wa(i.settings)&&(t.settings={inTangents:yr(i.settings.inTangents,Float32Array),outTangents:yr(i.settings.outTangents,Float32Array)}),t}var vs={enabled:!1,files:{},add:function(i,e){this.enabled!==!1&&(i0(i)||(this.files[i]=e))},get:function(i){if(this.enabled!==!1&&!i0(i))return this.files[i]},remove:function(i){delete this.files[i]},clear:function(){this.files={}}};function i0(i){try{let e=i.slice(i.indexOf(":")+1);return new URL(e).protocol==="blob:"}catch{return!1}}var nh=class{constructor(e,t,n){let s=this,r=!1,o=0,a=0,l,c=[];this.onStart=void 0,this.onLoad=e,this.onProgress=t,this.onError=n,this._abortController=null,this.itemStart=function(h){a++,r===!1&&s.onStart!==void 0&&s.onStart(h,o,a),r=!0},this.itemEnd=function(h){o++,s.onProgress!==void 0&&s.onProgress(h,o,a),o===a&&(r=!1,s.onLoad!==void 0&&s.onLoad())},this.itemError=function(h){s.onError!==void 0&&s.onError(h)},this.resolveURL=function(h){return h=h.normalize("NFC"),l?l(h):h},this.setURLModifier=function(h){return l=h,this},this.addHandler=function(h,u){return c.push(h,u),this},this.removeHandler=function(h){let u=c.indexOf(h);return u!==-1&&c.splice(u,2),this},this.getHandler=function(h){for(let u=0,f=c.length;u<f;u+=2){let p=c[u],x=c[u+1];if(p.global&&(p.lastIndex=0),p.test(h))return x}return null},this.abort=function(){return this.abortController.abort(),this._abortController=null,this}}get abortController(){return this._abortController||(this._abortController=new AbortController),this._abortController}},q0=new nh,os=class{constructor(e){this.manager=e!==void 0?e:q0,this.crossOrigin="anonymous",this.withCredentials=!1,this.path="",this.resourcePath="",this.requestHeader={},this.priority="auto",this.cache="default",typeof __THREE_DEVTOOLS__<"u"&&__THREE_DEVTOOLS__.dispatchEvent(new CustomEvent("observe",{detail:this}))}load(){}loadAsync(e,t){let n=this;return new Promise(function(s,r){n.load(e,s,t,r)})}parse(){}setCrossOrigin(e){return this.crossOrigin=e,this}setWithCredentials(e){return this.withCredentials=e,this}setPath(e){return this.path=e,this}setResourcePath(e){return this.resourcePath=e,this}setRequestHeader(e){return this.requestHeader=e,this}setPriority(e){return this.priority=e,this}setCache(e){return this.cache=e,this}abort(){return this}};os.DEFAULT_MATERIAL_NAME="__DEFAULT";var Bs={},Hf=class extends Error{constructor(e,t){super(e),this.response=t}},Jr=class extends os{constructor(e){super(e),this.mimeType="",this.responseType="",this._abortController=new AbortController}load(e,t,n,s){e===void 0&&(e=""),this.path!==void 0&&(e=this.path+e),e=this.manager.resolveURL(e);let r=vs.get(`file:${e}`);if(r!==void 0){this.manager.itemStart(e),setTimeout(()=>{t&&t(r),this.manager.itemEnd(e)},0);return}if(Bs[e]!==void 0){Bs[e].push({onLoad:t,onProgress:n,onError:s});return}Bs[e]=[],Bs[e].push({onLoad:t,onProgress:n,onError:s});let o=new Request(e,{headers:new Headers(this.requestHeader),credentials:this.withCredentials?"include":"same-origin",priority:this.priority,cache:this.cache,signal:typeof AbortSignal.any=="function"?AbortSignal.any([this._abortController.signal,this.manager.abortController.signal]):this._abortController.signal}),a=this.mimeType,l=this.responseType;fetch(o).then(c=>{if(c.status===200||c.status===0){if(c.status===0&&nt("FileLoader: HTTP Status 0 received."),typeof ReadableStream>"u"||c.body===void 0||c.body.getReader===void 0)return c;let h=Bs[e],u=c.body.getReader(),f=c.headers.get("X-File-Size")||c.headers.get("Content-Length"),p=f?parseInt(f):0,x=p!==0,M=0,g=new ReadableStream({start(_){b();function b(){u.read().then(({done:P,value:w})=>{if(P)_.close();else{M+=w.byteLength;let D=new ProgressEvent("progress",{lengthComputable:x,loaded:M,total:p});for(let I=0,y=h.length;I<y;I++){let T=h[I];T.onProgress&&T.onProgress(D)}_.enqueue(w),b()}},P=>{_.error(P)})}}});return new Response(g)}else throw new Hf(`fetch for "${c.url}" responded with ${c.status}: ${c.statusText}`,c)}).then(c=>{switch(l){case"arraybuffer":return c.arrayBuffer();case"blob":return c.blob();case"document":return c.text().then(h=>new DOMParser().parseFromString(h,a));case"json":return c.json();default:if(a==="")return c.text();{let u=/charset="?([^;"\s]*)"?/i.exec(a),f=u&&u[1]?u[1].toLowerCase():void 0,p=new TextDecoder(f);return c.arrayBuffer().then(x=>p.decode(x))}}}).then(c=>{vs.add(`file:${e}`,c);let h=Bs[e];delete Bs[e];for(let u=0,f=h.length;u<f;u++){let p=h[u];p.onLoad&&p.onLoad(c)}}).catch(c=>{let h=Bs[e];if(h===void 0)throw this.manager.itemError(e),c;delete Bs[e];for(let u=0,f=h.length;u<f;u++){let p=h[u];p.onError&&p.onError(c)}this.manager.itemError(e)}).finally(()=>{this.manager.itemEnd(e)}),this.manager.itemStart(e)}setResponseType(e){return this.responseType=e,this}setMimeType(e){return this.mimeType=e,this}abort(){return this._abortController.abort(),this._abortController=new AbortController,this}};var Bo=new WeakMap,ih=class extends os{constructor(e){super(e)}load(e,t,n,s){this.path!==void 0&&(e=this.path+e),e=this.manager.resolveURL(e);let r=this,o=vs.get(`image:${e}`);if(o!==void 0){if(o.complete===!0)r.manager.itemStart(e),setTimeout(function(){t&&t(o),r.manager.itemEnd(e)},0);else{let u=Bo.get(o);u===void 0&&(u=[],Bo.set(o,u)),u.push({onLoad:t,onError:s})}return o}let a=Xo("img");function l(){h(),t&&t(this);let u=Bo.get(this)||[];for(let f=0;f<u.length;f++){let p=u[f];p.onLoad&&p.onLoad(this)}Bo.delete(this),r.manager.itemEnd(e)}function c(u){h(),s&&s(u),vs.remove(`image:${e}`);let f=Bo.get(this)||[];for(let p=0;p<f.length;p++){let x=f[p];x.onError&&x.onError(u)}Bo.delete(this),r.manager.itemError(e),r.manager.itemEnd(e)}function h(){a.removeEventListener("load",l,!1),a.removeEventListener("error",c,!1)}return a.addEventListener("load",l,!1),a.addEventListener("error",c,!1),e.slice(0,5)!=="data:"&&this.crossOrigin!==void 0&&(a.crossOrigin=this.crossOrigin),vs.add(`image:${e}`,a),r.manager.itemStart(e),a.fetchPriority=this.priority,a.src=e,a}};var jr=class extends os{constructor(e){super(e)}load(e,t,n,s){let r=this,o=new ys,a=new Jr(this.manager);return a.setPriority(this.priority),a.setCache(this.cache),a.setResponseType("arraybuffer"),a.setRequestHeader(this.requestHeader),a.setPath(this.path),a.setWithCredentials(r.withCredentials),a.load(e,function(l){let c;try{c=r.parse(l)}catch(h){s!==void 0?s(h):gt(h);return}r._applyTexData(o,c),t&&t(o,c)},n,s),o}createDataTexture(e){let t=new ys;return this._applyTexData(t,this.parse(e)),t}_applyTexData(e,t){t.image!==void 0?e.image=t.image:t.data!==void 0&&(e.image.width=t.width,e.image.height=t.height,e.image.data=t.data),e.wrapS=t.wrapS!==void 0?t.wrapS:gi,e.wrapT=t.wrapT!==void 0?t.wrapT:gi,e.magFilter=t.magFilter!==void 0?t.magFilter:Xt,e.minFilter=t.minFilter!==void 0?t.minFilter:Xt,e.anisotropy=t.anisotropy!==void 0?t.anisotropy:1,t.colorSpace!==void 0&&(e.colorSpace=t.colorSpace),t.flipY!==void 0&&(e.flipY=t.flipY),t.format!==void 0&&(e.format=t.format),t.type!==void 0&&(e.type=t.type),t.mipmaps!==void 0&&(e.mipmaps=t.mipmaps,e.minFilter=Ni),t.mipmapCount===1&&(e.minFilter=Xt),t.generateMipmaps!==void 0&&(e.generateMipmaps=t.generateMipmaps),e.needsUpdate=!0}},cl=class extends os{constructor(e){super(e)}load(e,t,n,s){let r=new Yn,o=new ih(this.manager);return o.setPriority(this.priority),o.setCache(this.cache),o.setCrossOrigin(this.crossOrigin),o.setPath(this.path),o.load(e,function(a){r.image=a,r.needsUpdate=!0,t!==void 0&&t(r)},n,s),r}},ea=class extends xn{static registerNode(e){this.prototype._lightNode=e}constructor(e,t=1){super(),this.isLight=!0,this.type="Light",this.color=new ft(e),this.intensity=t}copy(e,t){return super.copy(e,t),this.color.copy(e.color),this.intensity=e.intensity,this}toJSON(e){let t=super.toJSON(e);return t.object.color=this.color.getHex(),t.object.intensity=this.intensity,t}};var Df=new Mt,s0=new Q,r0=new Q,ta=class{constructor(e){this.camera=e,this.intensity=1,this.bias=0,this.biasNode=null,this.normalBias=0,this.radius=1,this.blurSamples=8,this.mapSize=new lt(512,512),this.mapType=ti,this.map=null,this.mapPass=null,this.matrix=new Mt,this.autoUpdate=!0,this.needsUpdate=!1,this._frustum=new br,this._frameExtents=new lt(1,1),this._viewportCount=1,this._viewports=[new $t(0,0,1,1)]}getViewportCount(){return this._viewportCount}getCamera(){return this.camera}getFrustum(){return this._frustum}updateMatrices(e){let t=this.camera;s0.setFromMatrixPosition(e.matrixWorld),t.position.copy(s0),r0.setFromMatrixPosition(e.target.matrixWorld),t.lookAt(r0),t.updateMatrixWorld(),this._updateMatrix(t,this.matrix,this._frustum)}_updateMatrix(e,t,n,s){Df.multiplyMatrices(e.projectionMatrix,e.matrixWorldInverse),n.setFromProjectionMatrix(Df,e.coordinateSystem,e.reversedDepth);let r=this._frameExtents,o=s?s.z/r.x:1,a=s?s.w/r.y:1,l=s?s.x/r.x:0,c=s?s.y/r.y:0;e.coordinateSystem===Wo||e.reversedDepth?t.set(.5*o,0,0,.5*o+l,0,.5*a,0,.5*a+c,0,0,1,0,0,0,0,1):t.set(.5*o,0,0,.5*o+l,0,.5*a,0,.5*a+c,0,0,.5,.5,0,0,0,1),t.multiply(Df)}getViewport(e){return this._viewports[e]}getFrameExtents(){return this._frameExtents}dispose(){this.map&&this.map.dispose(),this.mapPass&&this.mapPass.dispose()}copy(e){return this.camera=e.camera.clone(),this.intensity=e.intensity,this.bias=e.bias,this.radius=e.radius,this.autoUpdate=e.autoUpdate,this.needsUpdate=e.needsUpdate,this.normalBias=e.normalBias,this.blurSamples=e.blurSamples,this.mapSize.copy(e.mapSize),this.mapType=e.mapType,this.biasNode=e.biasNode,this}clone(){return new this.constructor().copy(this)}toJSON(){let e={};return e.intensity=this.intensity,e.bias=this.bias,e.normalBias=this.normalBias,e.radius=this.radius,e.blurSamples=this.blurSamples,e.mapSize=this.mapSize.toArray(),e.mapType=this.mapType,e.camera=this.camera.toJSON(!1).object,delete e.camera.matrix,e}},Pc=new Q,Lc=new qn,xs=new Q,Qr=class extends xn{constructor(){super(),this.isCamera=!0,this.type="Camera",this.matrixWorldInverse=new Mt,this.projectionMatrix=new Mt,this.projectionMatrixInverse=new Mt,this.coordinateSystem=Gi,this._reversedDepth=!1}get reversedDepth(){return this._reversedDepth}copy(e,t){return super.copy(e,t),this.matrixWorldInverse.copy(e.matrixWorldInverse),this.projectionMatrix.copy(e.projectionMatrix),this.projectionMatrixInverse.copy(e.projectionMatrixInverse),this.coordinateSystem=e.coordinateSystem,this}getWorldDirection(e){return super.getWorldDirection(e).negate()}updateMatrixWorld(e){super.updateMatrixWorld(e),this.matrixWorld.decompose(Pc,Lc,xs),xs.x===1&&xs.y===1&&xs.z===1?this.matrixWorldInverse.copy(this.matrixWorld).invert():this.matrixWorldInverse.compose(Pc,Lc,xs.set(1,1,1)).invert()}updateWorldMatrix(e,t,n=!1){super.updateWorldMatrix(e,t,n),this.matrixWorld.decompose(Pc,Lc,xs),xs.x===1&&xs.y===1&&xs.z===1?this.matrixWorldInverse.copy(this.matrixWorld).invert():this.matrixWorldInverse.compose(Pc,Lc,xs.set(1,1,1)).invert()}clone(){return new this.constructor().copy(this)}},vr=new Q,o0=new lt,a0=new lt,On=class extends Qr{constructor(e=50,t=1,n=.1,s=2e3){super(),this.isPerspectiveCamera=!0,this.type="PerspectiveCamera",this.fov=e,this.zoom=1,this.near=n,this.far=s,this.focus=10,this.aspect=t,this.view=null,this.filmGauge=35,this.filmOffset=0,this.updateProjectionMatrix()}copy(e,t){return super.copy(e,t),this.fov=e.fov,this.zoom=e.zoom,this.near=e.near,this.far=e.far,this.focus=e.focus,this.aspect=e.aspect,this.view=e.view===null?null:Object.assign({},e.view),this.filmGauge=e.filmGauge,this.filmOffset=e.filmOffset,this}setFocalLength(e){let t=.5*this.getFilmHeight()/e;this.fov=Zr*2*Math.atan(t),this.updateProjectionMatrix()}getFocalLength(){let e=Math.tan(Xa*.5*this.fov);return .5*this.getFilmHeight()/e}getEffectiveFOV(){return Zr*2*Math.atan(Math.tan(Xa*.5*this.fov)/this.zoom)}getFilmWidth(){return this.filmGauge*Math.min(this.aspect,1)}getFilmHeight(){return this.filmGauge/Math.max(this.aspect,1)}getViewBounds(e,t,n){vr.set(-1,-1,.5).applyMatrix4(this.projectionMatrixInverse),t.set(vr.x,vr.y).multiplyScalar(-e/vr.z),vr.set(1,1,.5).applyMatrix4(this.projectionMatrixInverse),n.set(vr.x,vr.y).multiplyScalar(-e/vr.z)}getViewSize(e,t){return this.getViewBounds(e,o0,a0),t.subVectors(a0,o0)}setViewOffset(e,t,n,s,r,o){this.aspect=e/t,this.view===null&&(this.view={enabled:!0,fullWidth:1,fullHeight:1,offsetX:0,offsetY:0,width:1,height:1}),this.view.enabled=!0,this.view.fullWidth=e,this.view.fullHeight=t,this.view.offsetX=n,this.view.offsetY=s,this.view.width=r,this.view.height=o,this.updateProjectionMatrix()}clearViewOffset(){this.view!==null&&(this.view.enabled=!1),this.updateProjectionMatrix()}updateProjectionMatrix(){let e=this.near,t=e*Math.tan(Xa*.5*this.fov)/this.zoom,n=2*t,s=this.aspect*n,r=-.5*s,o=this.view;if(this.view!==null&&this.view.enabled){let l=o.fullWidth,c=o.fullHeight;r+=o.offsetX*s/l,t-=o.offsetY*n/c,s*=o.width/l,n*=o.height/c}let a=this.filmOffset;a!==0&&(r+=e*a/this.getFilmWidth()),this.projectionMatrix.makePerspective(r,r+s,t,t-n,e,this.far,this.coordinateSystem,this.reversedDepth),this.projectionMatrixInverse.copy(this.projectionMatrix).invert()}toJSON(e){let t=super.toJSON(e);return t.object.fov=this.fov,t.object.zoom=this.zoom,t.object.near=this.near,t.object.far=this.far,t.object.focus=this.focus,t.object.aspect=this.aspect,this.view!==null&&(t.object.view=Object.assign({},this.view)),t.object.filmGauge=this.filmGauge,t.object.filmOffset=this.filmOffset,t}},Gf=class extends ta{constructor(){super(new On(50,1,.5,500)),this.isSpotLightShadow=!0,this.focus=1,this.aspect=1}updateMatrices(e){let t=this.camera,n=Zr*2*e.angle*this.focus,s=this.mapSize.width/this.mapSize.height*this.aspect,r=e.distance||t.far;(n!==t.fov||s!==t.aspect||r!==t.far)&&(t.fov=n,t.aspect=s,t.far=r,t.updateProjectionMatrix()),super.updateMatrices(e)}copy(e){return super.copy(e),this.focus=e.focus,this.aspect=e.aspect,this}toJSON(){let e=super.toJSON();return e.focus=this.focus,e.aspect=this.aspect,e}},hl=class extends ea{constructor(e,t,n=0,s=Math.PI/3,r=0,o=2){super(e,t),this.isSpotLight=!0,this.type="SpotLight",this.position.copy(xn.DEFAULT_UP),this.updateMatrix(),this.target=new xn,this.distance=n,this.angle=s,this.penumbra=r,this.decay=o,this.map=null,this.shadow=new Gf}get power(){return this.intensity*Math.PI}set power(e){this.intensity=e/Math.PI}dispose(){super.dispose(),this.shadow.dispose()}copy(e,t){return super.copy(e,t),this.distance=e.distance,this.angle=e.angle,this.penumbra=e.penumbra,this.decay=e.decay,this.target=e.target.clone(),this.map=e.map,this.shadow=e.shadow.clone(),this}toJSON(e){let t=super.toJSON(e);return t.object.distance=this.distance,t.object.angle=this.angle,t.object.decay=this.decay,t.object.penumbra=this.penumbra,t.object.target=this.target.uuid,this.map&&this.map.isTexture&&(t.object.map=this.map.toJSON(e).uuid),t.object.shadow=this.shadow.toJSON(),t}},Vf=class extends ta{constructor(){super(new On(90,1,.5,500)),this.isPointLightShadow=!0}},ul=class extends ea{constructor(e,t,n=0,s=2){super(e,t),this.isPointLight=!0,this.type="PointLight",this.distance=n,this.decay=s,this.shadow=new Vf}get power(){return this.intensity*4*Math.PI}set power(e){this.intensity=e/(4*Math.PI)}dispose(){super.dispose(),this.shadow.dispose()}copy(e,t){return super.copy(e,t),this.distance=e.distance,this.decay=e.decay,this.shadow=e.shadow.clone(),this}toJSON(e){let t=super.toJSON(e);return t.object.distance=this.distance,t.object.decay=this.decay,t.object.shadow=this.shadow.toJSON(),t}},eo=class extends Qr{constructor(e=-1,t=1,n=1,s=-1,r=.1,o=2e3){super(),this.isOrthographicCamera=!0,this.type="OrthographicCamera",this.zoom=1,this.view=null,this.left=e,this.right=t,this.top=n,this.bottom=s,this.near=r,this.far=o,this.updateProjectionMatrix()}copy(e,t){return super.copy(e,t),this.left=e.left,this.right=e.right,this.top=e.top,this.bottom=e.bottom,this.near=e.near,this.far=e.far,this.zoom=e.zoom,this.view=e.view===null?null:Object.assign({},e.view),this}setViewOffset(e,t,n,s,r,o){this.view===null&&(this.view={enabled:!0,fullWidth:1,fullHeight:1,offsetX:0,offsetY:0,width:1,height:1}),this.view.enabled=!0,this.view.fullWidth=e,this.view.fullHeight=t,this.view.offsetX=n,this.view.offsetY=s,this.view.width=r,this.view.height=o,this.updateProjectionMatrix()}clearViewOffset(){this.view!==null&&(this.view.enabled=!1),this.updateProjectionMatrix()}updateProjectionMatrix(){let e=(this.right-this.left)/(2*this.zoom),t=(this.top-this.bottom)/(2*this.zoom),n=(this.right+this.left)/2,s=(this.top+this.bottom)/2,r=n-e,o=n+e,a=s+t,l=s-t;if(this.view!==null&&this.view.enabled){let c=(this.right-this.left)/this.view.fullWidth/this.zoom,h=(this.top-this.bottom)/this.view.fullHeight/this.zoom;r+=c*this.view.offsetX,o=r+c*this.view.width,a-=h*this.view.offsetY,l=a-h*this.view.height}this.projectionMatrix.makeOrthographic(r,o,a,l,this.near,this.far,this.coordinateSystem,this.reversedDepth),this.projectionMatrixInverse.copy(this.projectionMatrix).invert()}toJSON(e){let t=super.toJSON(e);return t.object.zoom=this.zoom,t.object.left=this.left,t.object.right=this.right,t.object.top=this.top,t.object.bottom=this.bottom,t.object.near=this.near,t.object.far=this.far,this.view!==null&&(t.object.view=Object.assign({},this.view)),t}},Wf=class extends ta{constructor(){super(new eo(-5,5,5,-5,.5,500)),this.isDirectionalLightShadow=!0}},fl=class extends ea{constructor(e,t){super(e,t),this.isDirectionalLight=!0,this.type="DirectionalLight",this.position.copy(xn.DEFAULT_UP),this.updateMatrix(),this.target=new xn,this.shadow=new Wf}dispose(){super.dispose(),this.shadow.dispose()}copy(e){return super.copy(e),this.target=e.target.clone(),this.shadow=e.shadow.clone(),this}toJSON(e){let t=super.toJSON(e);return t.object.shadow=this.shadow.toJSON(),t.object.target=this.target.uuid,t}};var js=class{static extractUrlBase(e){let t=e.lastIndexOf("/");return t===-1?"./":e.slice(0,t+1)}static resolveURL(e,t){return typeof e!="string"||e===""?"":(/^https?:\/\//i.test(t)&&/^\//.test(e)&&(t=t.replace(/(^https?:\/\/[^\/]+).*/i,"$1")),/^(https?:)?\/\//i.test(e)||/^data:.*,.*$/i.test(e)||/^blob:.*$/i.test(e)?e:t+e)}};var Nf=new WeakMap,dl=class extends os{constructor(e){super(e),this.isImageBitmapLoader=!0,typeof createImageBitmap>"u"&&nt("ImageBitmapLoader: createImageBitmap() not supported."),typeof fetch>"u"&&nt("ImageBitmapLoader: fetch() not supported."),this.options={premultiplyAlpha:"none"},this._abortController=new AbortController}setOptions(e){return this.options=e,this}load(e,t,n,s){e===void 0&&(e=""),this.path!==void 0&&(e=this.path+e),e=this.manager.resolveURL(e);let r=this,o=vs.get(`image-bitmap:${e}`);if(o!==void 0){if(r.manager.itemStart(e),o.then){o.then(c=>{Nf.has(o)===!0?(s&&s(Nf.get(o)),r.manager.itemError(e),r.manager.itemEnd(e)):(t&&t(c),r.manager.itemEnd(e))});return}setTimeout(function(){t&&t(o),r.manager.itemEnd(e)},0);return}let a={};a.credentials=this.withCredentials||this.crossOrigin!=="anonymous"?"include":"same-origin",a.headers=this.requestHeader,a.priority=this.priority,a.cache=this.cache,a.signal=typeof AbortSignal.any=="function"?AbortSignal.any([this._abortController.signal,this.manager.abortController.signal]):this._abortController.signal;let l=fetch(e,a).then(function(c){return c.blob()}).then(function(c){return createImageBitmap(c,Object.assign({},r.options,{colorSpaceConversion:"none"}))}).then(function(c){return vs.add(`image-bitmap:${e}`,c),t&&t(c),r.manager.itemEnd(e),c}).catch(function(c){s&&s(c),Nf.set(l,c),vs.remove(`image-bitmap:${e}`),r.manager.itemError(e),r.manager.itemEnd(e)});vs.add(`image-bitmap:${e}`,l),r.manager.itemStart(e)}abort(){return this._abortController.abort(),this._abortController=new AbortController,this}};var ko=-90,zo=1,na=class extends xn{constructor(e,t,n){super(),this.type="CubeCamera",this.renderTarget=n,this.coordinateSystem=null,this.activeMipmapLevel=0;let s=new On(ko,zo,e,t);s.layers=this.layers,this.add(s);let r=new On(ko,zo,e,t);r.layers=this.layers,this.add(r);let o=new On(ko,zo,e,t);o.layers=this.layers,this.add(o);let a=new On(ko,zo,e,t);a.layers=this.layers,this.add(a);let l=new On(ko,zo,e,t);l.layers=this.layers,this.add(l);let c=new On(ko,zo,e,t);c.layers=this.layers,this.add(c)}updateCoordinateSystem(){let e=this.coordinateSystem,t=this.children.concat(),[n,s,r,o,a,l]=t;for(let c of t)this.remove(c);if(e===Gi)n.up.set(0,1,0),n.lookAt(1,0,0),s.up.set(0,1,0),s.lookAt(-1,0,0),r.up.set(0,0,-1),r.lookAt(0,1,0),o.up.set(0,0,1),o.lookAt(0,-1,0),a.up.set(0,1,0),a.lookAt(0,0,1),l.up.set(0,1,0),l.lookAt(0,0,-1);else if(e===Wo)n.up.set(0,-1,0),n.lookAt(-1,0,0),s.up.set(0,-1,0),s.lookAt(1,0,0),r.up.set(0,0,1),r.lookAt(0,1,0),o.up.set(0,0,-1),o.lookAt(0,-1,0),a.up.set(0,-1,0),a.lookAt(0,0,1),l.up.set(0,-1,0),l.lookAt(0,0,-1);else throw new Error("THREE.CubeCamera.updateCoordinateSystem(): Invalid coordinate system: "+e);for(let c of t)this.add(c),c.updateMatrixWorld()}update(e,t){this.parent===null&&this.updateMatrixWorld();let{renderTarget:n,activeMipmapLevel:s}=this;this.coordinateSystem!==e.coordinateSystem&&(this.coordinateSystem=e.coordinateSystem,this.updateCoordinateSystem());let[r,o,a,l,c,h]=this.children,u=e.getRenderTarget(),f=e.getActiveCubeFace(),p=e.getActiveMipmapLevel(),x=e.xr.enabled;e.xr.enabled=!1;let M=n.texture.mipmapsAutoUpdate;n.texture.mipmapsAutoUpdate=!1;let g=!1;e.isWebGLRenderer===!0?g=e.state.buffers.depth.getReversed():g=e.reversedDepthBuffer,e.setRenderTarget(n,0,s),g&&e.autoClear===!1&&e.clearDepth(),e.render(t,r),e.setRenderTarget(n,1,s),g&&e.autoClear===!1&&e.clearDepth(),e.render(t,o),e.setRenderTarget(n,2,s),g&&e.autoClear===!1&&e.clearDepth(),e.render(t,a),e.setRenderTarget(n,3,s),g&&e.autoClear===!1&&e.clearDepth(),e.render(t,l),e.setRenderTarget(n,4,s),g&&e.autoClear===!1&&e.clearDepth(),e.render(t,c),n.texture.mipmapsAutoUpdate=M,e.setRenderTarget(n,5,s),g&&e.autoClear===!1&&e.clearDepth(),e.render(t,h),e.setRenderTarget(u,f,p),e.xr.enabled=x,n.texture.needsPMREMUpdate=!0}},sh=class extends On{constructor(e=[]){super(),this.isArrayCamera=!0,this.isMultiViewCamera=!1,this.cameras=e,this.perCameraFrustumCulled=!1}};var Md="\\[\\]\\.:\\/",vS=new RegExp("["+Md+"]","g"),bd="[^"+Md+"]",yS="[^"+Md.replace("\\.","")+"]",SS=/((?:WC+[\/:])*)/.source.replace("WC",bd),MS=/(WCOD+)?/.source.replace("WCOD",yS),bS=/(?:\.(WC+)(?:\[(.+)\])?)?/.source.replace("WC",bd),wS=/\.(WC+)(?:\[(.+)\])?/.source.replace("WC",bd),ES=new RegExp("^"+SS+MS+bS+wS+"$"),TS=["material","materials","bones","map"],Xf=class{constructor(e,t,n){let s=n||tn.parseTrackName(t);this._targetGroup=e,this._bindings=e.subscribe_(t,s)}getValue(e,t){this.bind();let n=this._targetGroup.nCachedObjects_,s=this._bindings[n];s!==void 0&&s.getValue(e,t)}setValue(e,t){let n=this._bindings;for(let s=this._targetGroup.nCachedObjects_,r=n.length;s!==r;++s)n[s].setValue(e,t)}bind(){let e=this._bindings;for(let t=this._targetGroup.nCachedObjects_,n=e.length;t!==n;++t)e[t].bind()}unbind(){let e=this._bindings;for(let t=this._targetGroup.nCachedObjects_,n=e.length;t!==n;++t)e[t].unbind()}},tn=class i{constructor(e,t,n){this.path=t,this.parsedPath=n||i.parseTrackName(t),this.node=i.findNode(e,this.parsedPath.nodeName),this.rootNode=e,this.getValue=this._getValue_unbound,this.setValue=this._setValue_unbound}static create(e,t,n){return e&&e.isAnimationObjectGroup?new i.Composite(e,t,n):new i(e,t,n)}static sanitizeNodeName(e){return e.replace(/\s/g,"_").replace(vS,"")}static parseTrackName(e){let t=ES.exec(e);if(t===null)throw new Error("THREE.PropertyBinding: Cannot parse trackName: "+e);let n={nodeName:t[2],objectName:t[3],objectIndex:t[4],propertyName:t[5],propertyIndex:t[6]},s=n.nodeName&&n.nodeName.lastIndexOf(".");if(s!==void 0&&s!==-1){let r=n.nodeName.substring(s+1);TS.indexOf(r)!==-1&&(n.nodeName=n.nodeName.substring(0,s),n.objectName=r)}if(n.propertyName===null||n.propertyName.length===0)throw new Error("THREE.PropertyBinding: can not parse propertyName from trackName: "+e);return n}static findNode(e,t){if(t===void 0||t===""||t==="."||t===-1||t===e.name||t===e.uuid)return e;if(e.skeleton){let n=e.skeleton.getBoneByName(t);if(n!==void 0)return n}if(e.children){let n=function(r){for(let o=0;o<r.length;o++){let a=r[o];if(a.name===t||a.uuid===t)return a;let l=n(a.children);if(l)return l}return null},s=n(e.children);if(s)return s}return null}_getValue_unavailable(){}_setValue_unavailable(){}_getValue_direct(e,t){e[t]=this.targetObject[this.propertyName]}_getValue_array(e,t){let n=this.resolvedProperty;for(let s=0,r=n.length;s!==r;++s)e[t++]=n[s]}_getValue_arrayElement(e,t){e[t]=this.resolvedProperty[this.propertyIndex]}_getValue_toArray(e,t){this.resolvedProperty.toArray(e,t)}_setValue_direct(e,t){this.targetObject[this.propertyName]=e[t]}_setValue_direct_setNeedsUpdate(e,t){this.targetObject[this.propertyName]=e[t],this.targetObject.needsUpdate=!0}_setValue_direct_setMatrixWorldNeedsUpdate(e,t){this.targetObject[this.propertyName]=e[t],this.targetObject.matrixWorldNeedsUpdate=!0}_setValue_array(e,t){let n=this.resolvedProperty;for(let s=0,r=n.length;s!==r;++s)n[s]=e[t++]}_setValue_array_setNeedsUpdate(e,t){let n=this.resolvedProperty;for(let s=0,r=n.length;s!==r;++s)n[s]=e[t++];this.targetObject.needsUpdate=!0}_setValue_array_setMatrixWorldNeedsUpdate(e,t){let n=this.resolvedProperty;for(let s=0,r=n.length;s!==r;++s)n[s]=e[t++];this.targetObject.matrixWorldNeedsUpdate=!0}_setValue_arrayElement(e,t){this.resolvedProperty[this.propertyIndex]=e[t]}_setValue_arrayElement_setNeedsUpdate(e,t){this.resolvedProperty[this.propertyIndex]=e[t],this.targetObject.needsUpdate=!0}_setValue_arrayElement_setMatrixWorldNeedsUpdate(e,t){this.resolvedProperty[this.propertyIndex]=e[t],this.targetObject.matrixWorldNeedsUpdate=!0}_setValue_fromArray(e,t){this.resolvedProperty.fromArray(e,t)}_setValue_fromArray_setNeedsUpdate(e,t){this.resolvedProperty.fromArray(e,t),this.targetObject.needsUpdate=!0}_setValue_fromArray_setMatrixWorldNeedsUpdate(e,t){this.resolvedProperty.fromArray(e,t),this.targetObject.matrixWorldNeedsUpdate=!0}_getValue_unbound(e,t){this.bind(),this.getValue(e,t)}_setValue_unbound(e,t){this.bind(),this.setValue(e,t)}bind(){let e=this.node,t=this.parsedPath,n=t.objectName,s=t.propertyName,r=t.propertyIndex;if(e||(e=i.findNode(this.rootNode,t.nodeName),this.node=e),this.getValue=this._getValue_unavailable,this.setValue=this._setValue_unavailable,!e){nt("PropertyBinding: No target node found for track: "+this.path+".");return}if(n){let c=t.objectIndex;switch(n){case"materials":if(!e.material){gt("PropertyBinding: Can not bind to material as node does not have a material.",this);return}if(!e.material.materials){gt("PropertyBinding: Can not bind to material.materials as node.material does not have a materials array.",this);return}e=e.material.materials;break;case"bones":if(!e.skeleton){gt("PropertyBinding: Can not bind to bones as node does not have a skeleton.",this);return}e=e.skeleton.bones;for(let h=0;h<e.length;h++)if(e[h].name===c){c=h;break}break;case"map":if("map"in e){e=e.map;break}if(!e.material){gt("PropertyBinding: Can not bind to material as node does not have a material.",this);return}if(!e.material.map){gt("PropertyBinding: Can not bind to material.map as node.material does not have a map.",this);return}e=e.material.map;break;default:if(e[n]===void 0){gt("PropertyBinding: Can not bind to objectName of node undefined.",this);return}e=e[n]}if(c!==void 0){if(e[c]===void 0){gt("PropertyBinding: Trying to bind to objectIndex of objectName, but is undefined.",this,e);return}e=e[c]}}let o=e[s];if(o===void 0){let c=t.nodeName;gt("PropertyBinding: Trying to update property for track: "+c+"."+s+" but it wasn't found.",e);return}let a=this.Versioning.None;this.targetObject=e,e.isMaterial===!0?a=this.Versioning.NeedsUpdate:e.isObject3D===!0&&(a=this.Versioning.MatrixWorldNeedsUpdate);let l=this.BindingType.Direct;if(r!==void 0){if(s==="morphTargetInfluences"){if(!e.geometry){gt("PropertyBinding: Can not bind to morphTargetInfluences because node does not have a geometry.",this);return}if(!e.geometry.morphAttributes){gt("PropertyBinding: Can not bind to morphTargetInfluences because node does not have a geometry.morphAttributes.",this);return}e.morphTargetDictionary[r]!==void 0&&(r=e.morphTargetDictionary[r])}l=this.BindingType.ArrayElement,this.resolvedProperty=o,this.propertyIndex=r}else o.fromArray!==void 0&&o.toArray!==void 0?(l=this.BindingType.HasFromToArray,this.resolvedProperty=o):Array.isArray(o)?(l=this.BindingType.EntireArray,this.resolvedProperty=o):this.propertyName=s;this.getValue=this.GetterByBindingType[l],this.setValue=this.SetterByBindingTypeAndVersioning[l][a]}unbind(){this.node=null,this.getValue=this._getValue_unbound,this.setValue=this._setValue_unbound}};tn.Composite=Xf;tn.prototype.BindingType={Direct:0,EntireArray:1,ArrayElement:2,HasFromToArray:3};tn.prototype.Versioning={None:0,NeedsUpdate:1,MatrixWorldNeedsUpdate:2};tn.prototype.GetterByBindingType=[tn.prototype._getValue_direct,tn.prototype._getValue_array,tn.prototype._getValue_arrayElement,tn.prototype._getValue_toArray];tn.prototype.SetterByBindingTypeAndVersioning=[[tn.prototype._setValue_direct,tn.prototype._setValue_direct_setNeedsUpdate,tn.prototype._setValue_direct_setMatrixWorldNeedsUpdate],[tn.prototype._setValue_array,tn.prototype._setValue_array_setNeedsUpdate,tn.prototype._setValue_array_setMatrixWorldNeedsUpdate],[tn.prototype._setValue_arrayElement,tn.prototype._setValue_arrayElement_setNeedsUpdate,tn.prototype._setValue_arrayElement_setMatrixWorldNeedsUpdate],[tn.prototype._setValue_fromArray,tn.prototype._setValue_fromArray_setNeedsUpdate,tn.prototype._setValue_fromArray_setMatrixWorldNeedsUpdate]];var HT=new Float32Array(1);var Tr=class{constructor(e=1,t=0,n=0){this.radius=e,this.phi=t,this.theta=n}set(e,t,n){return this.radius=e,this.phi=t,this.theta=n,this}copy(e){return this.radius=e.radius,this.phi=e.phi,this.theta=e.theta,this}makeSafe(){return this.phi=Rt(this.phi,1e-6,Math.PI-1e-6),this}setFromVector3(e){return this.setFromCartesianCoords(e.x,e.y,e.z)}setFromCartesianCoords(e,t,n){return this.radius=Math.sqrt(e*e+t*t+n*n),this.radius===0?(this.theta=0,this.phi=0):(this.theta=Math.atan2(e,n),this.phi=Math.acos(Rt(t/this.radius,-1,1))),this}clone(){return new this.constructor().copy(this)}};var qf=class{static{this.prototype.isMatrix2=!0}constructor(e,t,n,s){this.elements=[1,0,0,1],e!==void 0&&this.set(e,t,n,s)}identity(){return this.set(1,0,0,1),this}fromArray(e,t=0){for(let n=0;n<4;n++)this.elements[n]=e[n+t];return this}set(e,t,n,s){let r=this.elements;return r[0]=e,r[2]=t,r[1]=n,r[3]=s,this}};var pl=class extends rs{constructor(e,t=null){super(),this.object=e,this.domElement=t,this.enabled=!0,this.state=-1,this.keys={},this.mouseButtons={LEFT:null,MIDDLE:null,RIGHT:null},this.touches={ONE:null,TWO:null}}connect(e){this.domElement!==null&&this.disconnect(),this.domElement=e}disconnect(){}dispose(){}update(){}};function wd(i,e,t,n){let s=AS(n);switch(t){case cd:return i*e;case er:return i*e/s.components*s.byteLength;case uh:return i*e/s.components*s.byteLength;case yi:return i*e*2/s.components*s.byteLength;case fh:return i*e*2/s.components*s.byteLength;case hd:return i*e*3/s.components*s.byteLength;case un:return i*e*4/s.components*s.byteLength;case dh:return i*e*4/s.components*s.byteLength;case yl:case Sl:return Math.floor((i+3)/4)*Math.floor((e+3)/4)*8;case Ml:case bl:return Math.floor((i+3)/4)*Math.floor((e+3)/4)*16;case mh:case _h:return Math.max(i,16)*Math.max(e,8)/4;case ph:case gh:return Math.max(i,8)*Math.max(e,8)/2;case xh:case vh:case Sh:case Mh:return Math.floor((i+3)/4)*Math.floor((e+3)/4)*8;case yh:case wl:case bh:return Math.floor((i+3)/4)*Math.floor((e+3)/4)*16;case wh:return Math.floor((i+3)/4)*Math.floor((e+3)/4)*16;case Eh:return Math.floor((i+4)/5)*Math.floor((e+3)/4)*16;case Th:return Math.floor((i+4)/5)*Math.floor((e+4)/5)*16;case Ah:return Math.floor((i+5)/6)*Math.floor((e+4)/5)*16;case Rh:return Math.floor((i+5)/6)*Math.floor((e+5)/6)*16;case Ch:return Math.floor((i+7)/8)*Math.floor((e+4)/5)*16;case Ih:return Math.floor((i+7)/8)*Math.floor((e+5)/6)*16;case Ph:return Math.floor((i+7)/8)*Math.floor((e+7)/8)*16;case Lh:return Math.floor((i+9)/10)*Math.floor((e+4)/5)*16;case Dh:return Math.floor((i+9)/10)*Math.floor((e+5)/6)*16;case Nh:return Math.floor((i+9)/10)*Math.floor((e+7)/8)*16;case Uh:return Math.floor((i+9)/10)*Math.floor((e+9)/10)*16;case Oh:return Math.floor((i+11)/12)*Math.floor((e+9)/10)*16;case Fh:return Math.floor((i+11)/12)*Math.floor((e+11)/12)*16;case Bh:case kh:case zh:return Math.ceil(i/4)*Math.ceil(e/4)*16;case Hh:case Gh:return Math.ceil(i/4)*Math.ceil(e/4)*8;case El:case Vh:return Math.ceil(i/4)*Math.ceil(e/4)*16}throw new Error(`Unable to determine texture byte length for ${t} format.`)}function AS(i){switch(i){case ti:case rd:return{byteLength:1,components:1};case la:case od:case hn:return{byteLength:2,components:1};case ch:case hh:return{byteLength:2,components:4};case as:case lh:case Pn:return{byteLength:4,components:1};case ad:case ld:return{byteLength:4,components:3}}throw new Error(`THREE.TextureUtils: Unknown texture type ${i}.`)}typeof __THREE_DEVTOOLS__<"u"&&__THREE_DEVTOOLS__.dispatchEvent(new CustomEvent("register",{detail:{revision:"187"}}));typeof window<"u"&&(window.__THREE__?nt("WARNING: Multiple instances of Three.js being imported."):window.__THREE__="187");function p_(){let i=null,e=!1,t=null,n=null;function s(r,o){n=i.requestAnimationFrame(s),t(r,o)}return{start:function(){e!==!0&&t!==null&&i!==null&&(n=i.requestAnimationFrame(s),e=!0)},stop:function(){i!==null&&i.cancelAnimationFrame(n),e=!1},setAnimationLoop:function(r){t=r},setContext:function(r){i=r}}}function CS(i){let e=new WeakMap;function t(a,l){let c=a.array,h=a.usage,u=c.byteLength,f=i.createBuffer();i.bindBuffer(l,f),i.bufferData(l,c,h),a.onUploadCallback();let p;if(c instanceof Float32Array)p=i.FLOAT;else if(typeof Float16Array<"u"&&c instanceof Float16Array)p=i.HALF_FLOAT;else if(c instanceof Uint16Array)a.isFloat16BufferAttribute?p=i.HALF_FLOAT:p=i.UNSIGNED_SHORT;else if(c instanceof Int16Array)p=i.SHORT;else if(c instanceof Uint32Array)p=i.UNSIGNED_INT;else if(c instanceof Int32Array)p=i.INT;else if(c instanceof Int8Array)p=i.BYTE;else if(c instanceof Uint8Array)p=i.UNSIGNED_BYTE;else if(c instanceof Uint8ClampedArray)p=i.UNSIGNED_BYTE;else throw new Error("THREE.WebGLAttributes: Unsupported buffer data format: "+c);return{buffer:f,type:p,bytesPerElement:c.BYTES_PER_ELEMENT,version:a.version,size:u}}function n(a,l,c){let h=l.array,u=l.updateRanges;if(i.bindBuffer(c,a),u.length===0)i.bufferSubData(c,0,h);else{u.sort((p,x)=>p.start-x.start);let f=0;for(let p=1;p<u.length;p++){let x=u[f],M=u[p];M.start<=x.start+x.count+1?x.count=Math.max(x.count,M.start+M.count-x.start):(++f,u[f]=M)}u.length=f+1;for(let p=0,x=u.length;p<x;p++){let M=u[p];i.bufferSubData(c,M.start*h.BYTES_PER_ELEMENT,h,M.start,M.count)}l.clearUpdateRanges()}l.onUploadCallback()}function s(a){return a.isInterleavedBufferAttribute&&(a=a.data),e.get(a)}function r(a){a.isInterleavedBufferAttribute&&(a=a.data);let l=e.get(a);l&&(i.deleteBuffer(l.buffer),e.delete(a))}function o(a,l){if(a.isInterleavedBufferAttribute&&(a=a.data),a.isGLBufferAttribute){let h=e.get(a);(!h||h.version<a.version)&&e.set(a,{buffer:a.buffer,type:a.type,bytesPerElement:a.elementSize,version:a.version});return}let c=e.get(a);if(c===void 0)e.set(a,t(a,l));else if(c.version<a.version){if(c.size!==a.array.byteLength)throw new Error("THREE.WebGLAttributes: The size of the buffer attribute's array buffer does not match the original size. Resizing buffer attributes is not supported.");n(c.buffer,a,l),c.version=a.version}}return{get:s,remove:r,update:o}}var IS=`#ifdef USE_ALPHAHASH
	if ( diffuseColor.a < getAlphaHashThreshold( vPosition ) ) discard;
#endif`,PS=`#ifdef USE_ALPHAHASH
	const float ALPHA_HASH_SCALE = 0.05;
	float hash2D( vec2 value ) {
		return fract( 1.0e4 * sin( 17.0 * value.x + 0.1 * value.y ) * ( 0.1 + abs( sin( 13.0 * value.y + value.x ) ) ) );
	}
	float hash3D( vec3 value ) {
		return hash2D( vec2( hash2D( value.xy ), value.z ) );
	}
	float getAlphaHashThreshold( vec3 position ) {
		float maxDeriv = max(
			length( dFdx( position.xyz ) ),
			length( dFdy( position.xyz ) )
		);
		float pixScale = 1.0 / ( ALPHA_HASH_SCALE * maxDeriv );
		vec2 pixScales = vec2(
			exp2( floor( log2( pixScale ) ) ),
			exp2( ceil( log2( pixScale ) ) )
		);
		vec2 alpha = vec2(
			hash3D( floor( pixScales.x * position.xyz ) ),
			hash3D( floor( pixScales.y * position.xyz ) )
		);
		float lerpFactor = fract( log2( pixScale ) );
		float x = ( 1.0 - lerpFactor ) * alpha.x + lerpFactor * alpha.y;
		float a = min( lerpFactor, 1.0 - lerpFactor );
		vec3 cases = vec3(
			x * x / ( 2.0 * a * ( 1.0 - a ) ),
			( x - 0.5 * a ) / ( 1.0 - a ),
			1.0 - ( ( 1.0 - x ) * ( 1.0 - x ) / ( 2.0 * a * ( 1.0 - a ) ) )
		);
		float threshold = ( x < ( 1.0 - a ) )
			? ( ( x < a ) ? cases.x : cases.y )
			: cases.z;
		return clamp( threshold , 1.0e-6, 1.0 );
	}
#endif`,LS=`#ifdef USE_ALPHAMAP
	diffuseColor.a *= texture2D( alphaMap, vAlphaMapUv ).g;
#endif`,DS=`#ifdef USE_ALPHAMAP
	uniform sampler2D alphaMap;
#endif`,NS=`#ifdef USE_ALPHATEST
	#ifdef ALPHA_TO_COVERAGE
	diffuseColor.a = smoothstep( alphaTest, alphaTest + fwidth( diffuseColor.a ), diffuseColor.a );
	if ( diffuseColor.a == 0.0 ) discard;
	#else
	if ( diffuseColor.a < alphaTest ) discard;
	#endif
#endif`,US=`#ifdef USE_ALPHATEST
	uniform float alphaTest;
#endif`,OS=`#ifdef USE_AOMAP
	float ambientOcclusion = ( texture2D( aoMap, vAoMapUv ).r - 1.0 ) * aoMapIntensity + 1.0;
	reflectedLight.indirectDiffuse *= ambientOcclusion;
	#if defined( USE_CLEARCOAT ) 
		clearcoatSpecularIndirect *= ambientOcclusion;
	#endif
	#if defined( USE_SHEEN ) 
		sheenSpecularIndirect *= ambientOcclusion;
	#endif
	#if defined( USE_ENVMAP ) && defined( STANDARD )
		float dotNV = saturate( dot( geometryNormal, geometryViewDir ) );
		reflectedLight.indirectSpecular *= computeSpecularOcclusion( dotNV, ambientOcclusion, material.roughness );
	#endif
#endif`,FS=`#ifdef USE_AOMAP
	uniform sampler2D aoMap;
	uniform float aoMapIntensity;
#endif`,BS=`#ifdef USE_BATCHING
	#if ! defined( GL_ANGLE_multi_draw )
	#define gl_DrawID _gl_DrawID
	uniform int _gl_DrawID;
	#endif
	uniform highp sampler2D batchingTexture;
	uniform highp usampler2D batchingIdTexture;
	mat4 getBatchingMatrix( const in float i ) {
		int size = textureSize( batchingTexture, 0 ).x;
		int j = int( i ) * 4;
		int x = j % size;
		int y = j / size;
		vec4 v1 = texelFetch( batchingTexture, ivec2( x, y ), 0 );
		vec4 v2 = texelFetch( batchingTexture, ivec2( x + 1, y ), 0 );
		vec4 v3 = texelFetch( batchingTexture, ivec2( x + 2, y ), 0 );
		vec4 v4 = texelFetch( batchingTexture, ivec2( x + 3, y ), 0 );
		return mat4( v1, v2, v3, v4 );
	}
	float getIndirectIndex( const in int i ) {
		int size = textureSize( batchingIdTexture, 0 ).x;
		int x = i % size;
		int y = i / size;
		return float( texelFetch( batchingIdTexture, ivec2( x, y ), 0 ).r );
	}
#endif
#ifdef USE_BATCHING_COLOR
	uniform sampler2D batchingColorTexture;
	vec4 getBatchingColor( const in float i ) {
		int size = textureSize( batchingColorTexture, 0 ).x;
		int j = int( i );
		int x = j % size;
		int y = j / size;
		return texelFetch( batchingColorTexture, ivec2( x, y ), 0 );
	}
#endif`,kS=`#ifdef USE_BATCHING
	mat4 batchingMatrix = getBatchingMatrix( getIndirectIndex( gl_DrawID ) );
#endif`,zS=`vec3 transformed = vec3( position );
#ifdef USE_ALPHAHASH
	vPosition = vec3( position );
#endif`,HS=`vec3 objectNormal = vec3( normal );
#ifdef USE_TANGENT
	vec3 objectTangent = vec3( tangent.xyz );
#endif`,GS=`float G_BlinnPhong_Implicit( ) {
	return 0.25;
}
float D_BlinnPhong( const in float shininess, const in float dotNH ) {
	return RECIPROCAL_PI * ( shininess * 0.5 + 1.0 ) * pow( dotNH, shininess );
}
vec3 BRDF_BlinnPhong( const in vec3 lightDir, const in vec3 viewDir, const in vec3 normal, const in vec3 specularColor, const in float shininess ) {
	vec3 halfDir = normalize( lightDir + viewDir );
	float dotNH = saturate( dot( normal, halfDir ) );
	float dotVH = saturate( dot( viewDir, halfDir ) );
	vec3 F = F_Schlick( specularColor, 1.0, dotVH );
	float G = G_BlinnPhong_Implicit( );
	float D = D_BlinnPhong( shininess, dotNH );
	return F * ( G * D );
} // validated`,VS=`#ifdef USE_IRIDESCENCE
	const mat3 XYZ_TO_REC709 = mat3(
		 3.2404542, -0.9692660,  0.0556434,
		-1.5371385,  1.8760108, -0.2040259,
		-0.4985314,  0.0415560,  1.0572252
	);
	vec3 Fresnel0ToIor( vec3 fresnel0 ) {
		vec3 sqrtF0 = sqrt( fresnel0 );
		return ( vec3( 1.0 ) + sqrtF0 ) / ( vec3( 1.0 ) - sqrtF0 );
	}
	vec3 IorToFresnel0( vec3 transmittedIor, float incidentIor ) {
		return pow2( ( transmittedIor - vec3( incidentIor ) ) / ( transmittedIor + vec3( incidentIor ) ) );
	}
	float IorToFresnel0( float transmittedIor, float incidentIor ) {
		return pow2( ( transmittedIor - incidentIor ) / ( transmittedIor + incidentIor ));
	}
	vec3 evalSensitivity( float OPD, vec3 shift ) {
		float phase = 2.0 * PI * OPD * 1.0e-9;
		vec3 val = vec3( 5.4856e-13, 4.4201e-13, 5.2481e-13 );
		vec3 pos = vec3( 1.6810e+06, 1.7953e+06, 2.2084e+06 );
		vec3 var = vec3( 4.3278e+09, 9.3046e+09, 6.6121e+09 );
		vec3 xyz = val * sqrt( 2.0 * PI * var ) * cos( pos * phase + shift ) * exp( - pow2( phase ) * var );
		xyz.x += 9.7470e-14 * sqrt( 2.0 * PI * 4.5282e+09 ) * cos( 2.2399e+06 * phase + shift[ 0 ] ) * exp( - 4.5282e+09 * pow2( phase ) );
		xyz /= 1.0685e-7;
		vec3 rgb = XYZ_TO_REC709 * xyz;
		return rgb;
	}
	vec3 evalIridescence( float outsideIOR, float eta2, float cosTheta1, float thinFilmThickness, vec3 baseF0 ) {
		vec3 I;
		float iridescenceIOR = mix( outsideIOR, eta2, smoothstep( 0.0, 0.03, thinFilmThickness ) );
		float sinTheta2Sq = pow2( outsideIOR / iridescenceIOR ) * ( 1.0 - pow2( cosTheta1 ) );
		float cosTheta2Sq = 1.0 - sinTheta2Sq;
		if ( cosTheta2Sq < 0.0 ) {
			return vec3( 1.0 );
		}
		float cosTheta2 = sqrt( cosTheta2Sq );
		float R0 = IorToFresnel0( iridescenceIOR, outsideIOR );
		float R12 = F_Schlick( R0, 1.0, cosTheta1 );
		float T121 = 1.0 - R12;
		float phi12 = 0.0;
		if ( iridescenceIOR < outsideIOR ) phi12 = PI;
		float phi21 = PI - phi12;
		vec3 baseIOR = Fresnel0ToIor( clamp( baseF0, 0.0, 0.9999 ) );		vec3 R1 = IorToFresnel0( baseIOR, iridescenceIOR );
		vec3 R23 = F_Schlick( R1, 1.0, cosTheta2 );
		vec3 phi23 = vec3( 0.0 );
		if ( baseIOR[ 0 ] < iridescenceIOR ) phi23[ 0 ] = PI;
		if ( baseIOR[ 1 ] < iridescenceIOR ) phi23[ 1 ] = PI;
		if ( baseIOR[ 2 ] < iridescenceIOR ) phi23[ 2 ] = PI;
		float OPD = 2.0 * iridescenceIOR * thinFilmThickness * cosTheta2;
		vec3 phi = vec3( phi21 ) + phi23;
		vec3 R123 = clamp( R12 * R23, 1e-5, 0.9999 );
		vec3 r123 = sqrt( R123 );
		vec3 Rs = pow2( T121 ) * R23 / ( vec3( 1.0 ) - R123 );
		vec3 C0 = R12 + Rs;
		I = C0;
		vec3 Cm = Rs - T121;
		for ( int m = 1; m <= 2; ++ m ) {
			Cm *= r123;
			vec3 Sm = 2.0 * evalSensitivity( float( m ) * OPD, float( m ) * phi );
			I += Cm * Sm;
		}
		return max( I, vec3( 0.0 ) );
	}
#endif`,WS=`#ifdef USE_BUMPMAP
	uniform sampler2D bumpMap;
	uniform float bumpScale;
	vec2 dHdxy_fwd() {
		vec2 dSTdx = dFdx( vBumpMapUv );
		vec2 dSTdy = dFdy( vBumpMapUv );
		float Hll = bumpScale * texture2D( bumpMap, vBumpMapUv ).x;
		float dBx = bumpScale * texture2D( bumpMap, vBumpMapUv + dSTdx ).x - Hll;
		float dBy = bumpScale * texture2D( bumpMap, vBumpMapUv + dSTdy ).x - Hll;
		return vec2( dBx, dBy );
	}
	vec3 perturbNormalArb( vec3 surf_pos, vec3 surf_norm, vec2 dHdxy, float faceDirection ) {
		vec3 vSigmaX = normalize( dFdx( surf_pos.xyz ) );
		vec3 vSigmaY = normalize( dFdy( surf_pos.xyz ) );
		vec3 vN = surf_norm;
		vec3 R1 = cross( vSigmaY, vN );
		vec3 R2 = cross( vN, vSigmaX );
		float fDet = dot( vSigmaX, R1 ) * faceDirection;
		vec3 vGrad = sign( fDet ) * ( dHdxy.x * R1 + dHdxy.y * R2 );
		return normalize( abs( fDet ) * surf_norm - vGrad );
	}
#endif`,XS=`#if NUM_CLIPPING_PLANES > 0
	vec4 plane;
	#ifdef ALPHA_TO_COVERAGE
		float distanceToPlane, distanceGradient;
		float clipOpacity = 1.0;
		#pragma unroll_loop_start
		for ( int i = 0; i < UNION_CLIPPING_PLANES; i ++ ) {
			plane = clippingPlanes[ i ];
			distanceToPlane = - dot( vClipPosition, plane.xyz ) + plane.w;
			distanceGradient = fwidth( distanceToPlane ) / 2.0;
			clipOpacity *= smoothstep( - distanceGradient, distanceGradient, distanceToPlane );
			if ( clipOpacity == 0.0 ) discard;
		}
		#pragma unroll_loop_end
		#if UNION_CLIPPING_PLANES < NUM_CLIPPING_PLANES
			float unionClipOpacity = 1.0;
			#pragma unroll_loop_start
			for ( int i = UNION_CLIPPING_PLANES; i < NUM_CLIPPING_PLANES; i ++ ) {
				plane = clippingPlanes[ i ];
				distanceToPlane = - dot( vClipPosition, plane.xyz ) + plane.w;
				distanceGradient = fwidth( distanceToPlane ) / 2.0;
				unionClipOpacity *= 1.0 - smoothstep( - distanceGradient, distanceGradient, distanceToPlane );
			}
			#pragma unroll_loop_end
			clipOpacity *= 1.0 - unionClipOpacity;
		#endif
		diffuseColor.a *= clipOpacity;
		if ( diffuseColor.a == 0.0 ) discard;
	#else
		#pragma unroll_loop_start
		for ( int i = 0; i < UNION_CLIPPING_PLANES; i ++ ) {
			plane = clippingPlanes[ i ];
			if ( dot( vClipPosition, plane.xyz ) > plane.w ) discard;
		}
		#pragma unroll_loop_end
		#if UNION_CLIPPING_PLANES < NUM_CLIPPING_PLANES
			bool clipped = true;
			#pragma unroll_loop_start
			for ( int i = UNION_CLIPPING_PLANES; i < NUM_CLIPPING_PLANES; i ++ ) {
				plane = clippingPlanes[ i ];
				clipped = ( dot( vClipPosition, plane.xyz ) > plane.w ) && clipped;
			}
			#pragma unroll_loop_end
			if ( clipped ) discard;
		#endif
	#endif
#endif`,qS=`#if NUM_CLIPPING_PLANES > 0
	varying vec3 vClipPosition;
	uniform vec4 clippingPlanes[ NUM_CLIPPING_PLANES ];
#endif`,YS=`#if NUM_CLIPPING_PLANES > 0
	varying vec3 vClipPosition;
#endif`,ZS=`#if NUM_CLIPPING_PLANES > 0
	vClipPosition = - mvPosition.xyz;
#endif`,KS=`#if defined( USE_COLOR ) || defined( USE_COLOR_ALPHA )
	diffuseColor *= vColor;
#endif`,$S=`#if defined( USE_COLOR ) || defined( USE_COLOR_ALPHA )
	varying vec4 vColor;
#endif`,JS=`#if defined( USE_COLOR ) || defined( USE_COLOR_ALPHA ) || defined( USE_INSTANCING_COLOR ) || defined( USE_BATCHING_COLOR )
	varying vec4 vColor;
#endif`,jS=`#if defined( USE_COLOR ) || defined( USE_COLOR_ALPHA ) || defined( USE_INSTANCING_COLOR ) || defined( USE_BATCHING_COLOR )
	vColor = vec4( 1.0 );
#endif
#ifdef USE_COLOR_ALPHA
	vColor *= color;
#elif defined( USE_COLOR )
	vColor.rgb *= color;
#endif
#ifdef USE_INSTANCING_COLOR
	vColor.rgb *= instanceColor.rgb;
#endif
#ifdef USE_BATCHING_COLOR
	vColor *= getBatchingColor( getIndirectIndex( gl_DrawID ) );
#endif`,QS=`#define PI 3.141592653589793
#define PI2 6.283185307179586
#define PI_HALF 1.5707963267948966
#define RECIPROCAL_PI 0.3183098861837907
#define RECIPROCAL_PI2 0.15915494309189535
#define EPSILON 1e-6
#ifndef saturate
#define saturate( a ) clamp( a, 0.0, 1.0 )
#endif
#define whiteComplement( a ) ( 1.0 - saturate( a ) )
float pow2( const in float x ) { return x*x; }
vec3 pow2( const in vec3 x ) { return x*x; }
float pow3( const in float x ) { return x*x*x; }
float pow4( const in float x ) { float x2 = x*x; return x2*x2; }
float max3( const in vec3 v ) { return max( max( v.x, v.y ), v.z ); }
float average( const in vec3 v ) { return dot( v, vec3( 0.3333333 ) ); }
highp float rand( const in vec2 uv ) {
	const highp float a = 12.9898, b = 78.233, c = 43758.5453;
	highp float dt = dot( uv.xy, vec2( a,b ) ), sn = mod( dt, PI );
	return fract( sin( sn ) * c );
}
#ifdef HIGH_PRECISION
	float precisionSafeLength( vec3 v ) { return length( v ); }
#else
	float precisionSafeLength( vec3 v ) {
		float maxComponent = max3( abs( v ) );
		return length( v / maxComponent ) * maxComponent;
	}
#endif
struct IncidentLight {
	vec3 color;
	vec3 direction;
	bool visible;
};
struct ReflectedLight {
	vec3 directDiffuse;
	vec3 directSpecular;
	vec3 indirectDiffuse;
	vec3 indirectSpecular;
};
#ifdef USE_ALPHAHASH
	varying vec3 vPosition;
#endif
vec3 transformDirection( in vec3 dir, in mat4 matrix ) {
	return normalize( ( matrix * vec4( dir, 0.0 ) ).xyz );
}
#define inverseTransformDirection transformDirectionByInverseViewMatrix
vec3 transformNormalByInverseViewMatrix( in vec3 normal, in mat4 viewMatrix ) {
	return normalize( ( vec4( normal, 0.0 ) * viewMatrix ).xyz );
}
vec3 transformDirectionByInverseViewMatrix( in vec3 dir, in mat4 viewMatrix ) {
	return normalize( ( vec4( dir, 0.0 ) * viewMatrix ).xyz );
}
bool isPerspectiveMatrix( mat4 m ) {
	return m[ 2 ][ 3 ] == - 1.0;
}
vec2 equirectUv( in vec3 dir ) {
	float u = atan( dir.z, dir.x ) * RECIPROCAL_PI2 + 0.5;
	float v = asin( clamp( dir.y, - 1.0, 1.0 ) ) * RECIPROCAL_PI + 0.5;
	return vec2( u, v );
}
vec3 BRDF_Lambert( const in vec3 diffuseColor ) {
	return RECIPROCAL_PI * diffuseColor;
}
vec3 F_Schlick( const in vec3 f0, const in float f90, const in float dotVH ) {
	float fresnel = exp2( ( - 5.55473 * dotVH - 6.98316 ) * dotVH );
	return f0 * ( 1.0 - fresnel ) + ( f90 * fresnel );
}
float F_Schlick( const in float f0, const in float f90, const in float dotVH ) {
	float fresnel = exp2( ( - 5.55473 * dotVH - 6.98316 ) * dotVH );
	return f0 * ( 1.0 - fresnel ) + ( f90 * fresnel );
} // validated`,eM=`vec3 transformedNormal = objectNormal;
#ifdef USE_TANGENT
	vec3 transformedTangent = objectTangent;
#endif
#ifdef USE_BATCHING
	mat3 bm = mat3( batchingMatrix );
	transformedNormal /= vec3( dot( bm[ 0 ], bm[ 0 ] ), dot( bm[ 1 ], bm[ 1 ] ), dot( bm[ 2 ], bm[ 2 ] ) );
	transformedNormal = bm * transformedNormal;
	#ifdef USE_TANGENT
		transformedTangent = bm * transformedTangent;
	#endif
#endif
#ifdef USE_INSTANCING
	mat3 im = mat3( instanceMatrix );
	transformedNormal /= vec3( dot( im[ 0 ], im[ 0 ] ), dot( im[ 1 ], im[ 1 ] ), dot( im[ 2 ], im[ 2 ] ) );
	transformedNormal = im * transformedNormal;
	#ifdef USE_TANGENT
		transformedTangent = im * transformedTangent;
	#endif
#endif
transformedNormal = normalMatrix * transformedNormal;
#ifdef FLIP_SIDED
	transformedNormal = - transformedNormal;
#endif
#ifdef USE_TANGENT
	transformedTangent = ( modelViewMatrix * vec4( transformedTangent, 0.0 ) ).xyz;
#endif`,tM=`#ifdef USE_DISPLACEMENTMAP
	uniform sampler2D displacementMap;
	uniform float displacementScale;
	uniform float displacementBias;
#endif`,nM=`#ifdef USE_DISPLACEMENTMAP
	transformed += normalize( objectNormal ) * ( texture2D( displacementMap, vDisplacementMapUv ).x * displacementScale + displacementBias );
#endif`,iM=`#ifdef USE_EMISSIVEMAP
	vec4 emissiveColor = texture2D( emissiveMap, vEmissiveMapUv );
	#ifdef DECODE_VIDEO_TEXTURE_EMISSIVE
		emissiveColor = sRGBTransferEOTF( emissiveColor );
	#endif
	totalEmissiveRadiance *= emissiveColor.rgb;
#endif`,sM=`#ifdef USE_EMISSIVEMAP
	uniform sampler2D emissiveMap;
#endif`,rM="gl_FragColor = linearToOutputTexel( gl_FragColor );",oM=`vec4 LinearTransferOETF( in vec4 value ) {
	return value;
}
vec4 sRGBTransferEOTF( in vec4 value ) {
	return vec4( mix( pow( value.rgb * 0.9478672986 + vec3( 0.0521327014 ), vec3( 2.4 ) ), value.rgb * 0.0773993808, vec3( lessThanEqual( value.rgb, vec3( 0.04045 ) ) ) ), value.a );
}
vec4 sRGBTransferOETF( in vec4 value ) {
	return vec4( mix( pow( value.rgb, vec3( 0.41666 ) ) * 1.055 - vec3( 0.055 ), value.rgb * 12.92, vec3( lessThanEqual( value.rgb, vec3( 0.0031308 ) ) ) ), value.a );
}`,aM=`#ifdef USE_ENVMAP
	#ifdef ENV_WORLDPOS
		vec3 cameraToFrag;
		if ( isOrthographic ) {
			cameraToFrag = normalize( vec3( - viewMatrix[ 0 ][ 2 ], - viewMatrix[ 1 ][ 2 ], - viewMatrix[ 2 ][ 2 ] ) );
		} else {
			cameraToFrag = normalize( vWorldPosition - cameraPosition );
		}
		vec3 worldNormal = transformNormalByInverseViewMatrix( normal, viewMatrix );
		#ifdef ENVMAP_MODE_REFLECTION
			vec3 reflectVec = reflect( cameraToFrag, worldNormal );
		#else
			vec3 reflectVec = refract( cameraToFrag, worldNormal, refractionRatio );
		#endif
	#else
		vec3 reflectVec = vReflect;
	#endif
	#ifdef ENVMAP_TYPE_CUBE
		vec4 envColor = textureCube( envMap, envMapRotation * reflectVec );
		#ifdef ENVMAP_BLENDING_MULTIPLY
			outgoingLight = mix( outgoingLight, outgoingLight * envColor.xyz, specularStrength * reflectivity );
		#elif defined( ENVMAP_BLENDING_MIX )
			outgoingLight = mix( outgoingLight, envColor.xyz, specularStrength * reflectivity );
		#elif defined( ENVMAP_BLENDING_ADD )
			outgoingLight += envColor.xyz * specularStrength * reflectivity;
		#endif
	#endif
#endif`,lM=`#ifdef USE_ENVMAP
	uniform float envMapIntensity;
	uniform mat3 envMapRotation;
	uniform samplerCube envMap;
	#ifdef ENVMAP_TYPE_PMREM
		float roughnessToMip( const in float roughness ) {
			float r = clamp( roughness, 0.0, 1.0 );
			return ENVMAP_MAX_LOD * r * ( 2.0 - r );
		}
	#endif
#endif`,cM=`#ifdef USE_ENVMAP
	uniform float reflectivity;
	#if defined( USE_BUMPMAP ) || defined( USE_NORMALMAP ) || defined( PHONG ) || defined( LAMBERT )
		#define ENV_WORLDPOS
	#endif
	#ifdef ENV_WORLDPOS
		varying vec3 vWorldPosition;
		uniform float refractionRatio;
	#else
		varying vec3 vReflect;
	#endif
#endif`,hM=`#ifdef USE_ENVMAP
	#if defined( USE_BUMPMAP ) || defined( USE_NORMALMAP ) || defined( PHONG ) || defined( LAMBERT )
		#define ENV_WORLDPOS
	#endif
	#ifdef ENV_WORLDPOS
		
		varying vec3 vWorldPosition;
	#else
		varying vec3 vReflect;
		uniform float refractionRatio;
	#endif
#endif`,uM=`#ifdef USE_ENVMAP
	#ifdef ENV_WORLDPOS
		vWorldPosition = worldPosition.xyz;
	#else
		vec3 cameraToVertex;
		if ( isOrthographic ) {
			cameraToVertex = normalize( vec3( - viewMatrix[ 0 ][ 2 ], - viewMatrix[ 1 ][ 2 ], - viewMatrix[ 2 ][ 2 ] ) );
		} else {
			cameraToVertex = normalize( worldPosition.xyz - cameraPosition );
		}
		vec3 worldNormal = transformNormalByInverseViewMatrix( transformedNormal, viewMatrix );
		#ifdef ENVMAP_MODE_REFLECTION
			vReflect = reflect( cameraToVertex, worldNormal );
		#else
			vReflect = refract( cameraToVertex, worldNormal, refractionRatio );
		#endif
	#endif
#endif`,fM=`#ifdef USE_FOG
	vFogDepth = - mvPosition.z;
#endif`,dM=`#ifdef USE_FOG
	varying float vFogDepth;
#endif`,pM=`#ifdef USE_FOG
	#ifdef FOG_EXP2
		float fogFactor = 1.0 - exp( - fogDensity * fogDensity * vFogDepth * vFogDepth );
	#else
		float fogFactor = smoothstep( fogNear, fogFar, vFogDepth );
	#endif
	gl_FragColor.rgb = mix( gl_FragColor.rgb, fogColor, fogFactor );
#endif`,mM=`#ifdef USE_FOG
	uniform vec3 fogColor;
	varying float vFogDepth;
	#ifdef FOG_EXP2
		uniform float fogDensity;
	#else
		uniform float fogNear;
		uniform float fogFar;
	#endif
#endif`,gM=`#ifdef USE_GRADIENTMAP
	uniform sampler2D gradientMap;
#endif
vec3 getGradientIrradiance( vec3 normal, vec3 lightDirection ) {
	float dotNL = dot( normal, lightDirection );
	vec2 coord = vec2( dotNL * 0.5 + 0.5, 0.0 );
	#ifdef USE_GRADIENTMAP
		return vec3( texture2D( gradientMap, coord ).r );
	#else
		vec2 fw = fwidth( coord ) * 0.5;
		return mix( vec3( 0.7 ), vec3( 1.0 ), smoothstep( 0.7 - fw.x, 0.7 + fw.x, coord.x ) );
	#endif
}`,_M=`#ifdef USE_LIGHTMAP
	uniform sampler2D lightMap;
	uniform float lightMapIntensity;
#endif`,xM=`LambertMaterial material;
material.diffuseColor = diffuseColor.rgb;
material.specularStrength = specularStrength;`,vM=`varying vec3 vViewPosition;
struct LambertMaterial {
	vec3 diffuseColor;
	float specularStrength;
};
void RE_Direct_Lambert( const in IncidentLight directLight, const in vec3 geometryPosition, const in vec3 geometryNormal, const in vec3 geometryViewDir, const in vec3 geometryClearcoatNormal, const in LambertMaterial material, inout ReflectedLight reflectedLight ) {
	float dotNL = saturate( dot( geometryNormal, directLight.direction ) );
	vec3 irradiance = dotNL * directLight.color;
	reflectedLight.directDiffuse += irradiance * BRDF_Lambert( material.diffuseColor );
}
void RE_IndirectDiffuse_Lambert( const in vec3 irradiance, const in vec3 geometryPosition, const in vec3 geometryNormal, const in vec3 geometryViewDir, const in vec3 geometryClearcoatNormal, const in LambertMaterial material, inout ReflectedLight reflectedLight ) {
	reflectedLight.indirectDiffuse += irradiance * BRDF_Lambert( material.diffuseColor );
}
#define RE_Direct				RE_Direct_Lambert
#define RE_IndirectDiffuse		RE_IndirectDiffuse_Lambert`,yM=`uniform bool receiveShadow;
uniform vec3 ambientLightColor;
#if defined( USE_LIGHT_PROBES )
	uniform vec3 lightProbe[ 9 ];
#endif
vec3 shGetIrradianceAt( in vec3 normal, in vec3 shCoefficients[ 9 ] ) {
	float x = normal.x, y = normal.y, z = normal.z;
	vec3 result = shCoefficients[ 0 ] * 0.886227;
	result += shCoefficients[ 1 ] * 2.0 * 0.511664 * y;
	result += shCoefficients[ 2 ] * 2.0 * 0.511664 * z;
	result += shCoefficients[ 3 ] * 2.0 * 0.511664 * x;
	result += shCoefficients[ 4 ] * 2.0 * 0.429043 * x * y;
	result += shCoefficients[ 5 ] * 2.0 * 0.429043 * y * z;
	result += shCoefficients[ 6 ] * ( 0.743125 * z * z - 0.247708 );
	result += shCoefficients[ 7 ] * 2.0 * 0.429043 * x * z;
	result += shCoefficients[ 8 ] * 0.429043 * ( x * x - y * y );
	return result;
}
vec3 getLightProbeIrradiance( const in vec3 lightProbe[ 9 ], const in vec3 normal ) {
	vec3 worldNormal = transformNormalByInverseViewMatrix( normal, viewMatrix );
	vec3 irradiance = shGetIrradianceAt( worldNormal, lightProbe );
	return irradiance;
}
vec3 getAmbientLightIrradiance( const in vec3 ambientLightColor ) {
	vec3 irradiance = ambientLightColor;
	return irradiance;
}
float getDistanceAttenuation( const in float lightDistance, const in float cutoffDistance, const in float decayExponent ) {
	float distanceFalloff = 1.0 / max( pow( lightDistance, decayExponent ), 0.01 );
	if ( cutoffDistance > 0.0 ) {
		distanceFalloff *= pow2( saturate( 1.0 - pow4( lightDistance / cutoffDistance ) ) );
	}
	return distanceFalloff;
}
float getSpotAttenuation( const in float coneCosine, const in float penumbraCosine, const in float angleCosine ) {
	return smoothstep( coneCosine, penumbraCosine, angleCosine );
}
#if NUM_SUN_LIGHTS > 0
	struct SunLight {
		vec3 direction;
		vec3 color;
	};
	uniform SunLight sunLights[ NUM_SUN_LIGHTS ];
	void getSunLightInfo( const in SunLight sunLight, out IncidentLight light ) {
		light.color = sunLight.color;
		light.direction = sunLight.direction;
		light.visible = true;
	}
#endif
#if NUM_DIR_LIGHTS > 0
	struct DirectionalLight {
		vec3 direction;
		vec3 color;
	};
	uniform DirectionalLight directionalLights[ NUM_DIR_LIGHTS ];
	void getDirectionalLightInfo( const in DirectionalLight directionalLight, out IncidentLight light ) {
		light.color = directionalLight.color;
		light.direction = directionalLight.direction;
		light.visible = true;
	}
#endif
#if NUM_POINT_LIGHTS > 0
	struct PointLight {
		vec3 position;
		vec3 color;
		float distance;
		float decay;
	};
	uniform PointLight pointLights[ NUM_POINT_LIGHTS ];
	void getPointLightInfo( const in PointLight pointLight, const in vec3 geometryPosition, out IncidentLight light ) {
		vec3 lVector = pointLight.position - geometryPosition;
		light.direction = normalize( lVector );
		float lightDistance = length( lVector );
		light.color = pointLight.color;
		light.color *= getDistanceAttenuation( lightDistance, pointLight.distance, pointLight.decay );
		light.visible = ( light.color != vec3( 0.0 ) );
	}
#endif
#if NUM_SPOT_LIGHTS > 0
	struct SpotLight {
		vec3 position;
		vec3 direction;
		vec3 color;
		float distance;
		float decay;
		float coneCos;
		float penumbraCos;
	};
	uniform SpotLight spotLights[ NUM_SPOT_LIGHTS ];
	void getSpotLightInfo( const in SpotLight spotLight, const in vec3 geometryPosition, out IncidentLight light ) {
		vec3 lVector = spotLight.position - geometryPosition;
		light.direction = normalize( lVector );
		float angleCos = dot( light.direction, spotLight.direction );
		float spotAttenuation = getSpotAttenuation( spotLight.coneCos, spotLight.penumbraCos, angleCos );
		if ( spotAttenuation > 0.0 ) {
			float lightDistance = length( lVector );
			light.color = spotLight.color * spotAttenuation;
			light.color *= getDistanceAttenuation( lightDistance, spotLight.distance, spotLight.decay );
			light.visible = ( light.color != vec3( 0.0 ) );
		} else {
			light.color = vec3( 0.0 );
			light.visible = false;
		}
	}
#endif
#if NUM_RECT_AREA_LIGHTS > 0
	struct RectAreaLight {
		vec3 color;
		vec3 position;
		vec3 halfWidth;
		vec3 halfHeight;
	};
	uniform sampler2D ltc_1;	uniform sampler2D ltc_2;
	uniform RectAreaLight rectAreaLights[ NUM_RECT_AREA_LIGHTS ];
#endif
#if NUM_HEMI_LIGHTS > 0
	struct HemisphereLight {
		vec3 direction;
		vec3 skyColor;
		vec3 groundColor;
	};
	uniform HemisphereLight hemisphereLights[ NUM_HEMI_LIGHTS ];
	vec3 getHemisphereLightIrradiance( const in HemisphereLight hemiLight, const in vec3 normal ) {
		float dotNL = dot( normal, hemiLight.direction );
		float hemiDiffuseWeight = 0.5 * dotNL + 0.5;
		vec3 irradiance = mix( hemiLight.groundColor, hemiLight.skyColor, hemiDiffuseWeight );
		return irradiance;
	}
#endif
#include <lightprobes_pars_fragment>`,SM=`#ifdef USE_ENVMAP
	vec3 getIBLIrradiance( const in vec3 normal ) {
		#ifdef ENVMAP_TYPE_PMREM
			vec3 worldNormal = transformNormalByInverseViewMatrix( normal, viewMatrix );
			vec4 envMapColor = textureLod( envMap, envMapRotation * worldNormal, ENVMAP_MAX_LOD );
			return PI * envMapColor.rgb * envMapIntensity;
		#else
			return vec3( 0.0 );
		#endif
	}
	vec3 getIBLRadiance( const in vec3 viewDir, const in vec3 normal, const in float roughness ) {
		#ifdef ENVMAP_TYPE_PMREM
			vec3 reflectVec = reflect( - viewDir, normal );
			reflectVec = normalize( mix( reflectVec, normal, pow4( roughness ) ) );
			reflectVec = transformDirectionByInverseViewMatrix( reflectVec, viewMatrix );
			vec4 envMapColor = textureLod( envMap, envMapRotation * reflectVec, roughnessToMip( roughness ) );
			return envMapColor.rgb * envMapIntensity;
		#else
			return vec3( 0.0 );
		#endif
	}
	#ifdef USE_RETROREFLECTION
		vec3 getIBLRetroRadiance( const in vec3 viewDir, const in vec3 normal, const in float roughness ) {
			#ifdef ENVMAP_TYPE_PMREM
				vec3 retroVec = normalize( mix( viewDir, normal, pow4( roughness ) ) );
				retroVec = transformDirectionByInverseViewMatrix( retroVec, viewMatrix );
				vec4 envMapColor = textureLod( envMap, envMapRotation * retroVec, roughnessToMip( roughness ) );
				return envMapColor.rgb * envMapIntensity;
			#else
				return vec3( 0.0 );
			#endif
		}
	#endif
	#ifdef USE_ANISOTROPY
		vec3 getIBLAnisotropyRadiance( const in vec3 viewDir, const in vec3 normal, const in float roughness, const in vec3 bitangent, const in float anisotropy ) {
			#ifdef ENVMAP_TYPE_PMREM
				vec3 bentNormal = cross( bitangent, viewDir );
				bentNormal = normalize( cross( bentNormal, bitangent ) );
				bentNormal = normalize( mix( bentNormal, normal, pow2( pow2( 1.0 - anisotropy * ( 1.0 - roughness ) ) ) ) );
				return getIBLRadiance( viewDir, bentNormal, roughness );
			#else
				return vec3( 0.0 );
			#endif
		}
		#ifdef USE_RETROREFLECTION
			vec3 getIBLAnisotropyRetroRadiance( const in vec3 viewDir, const in vec3 normal, const in float roughness, const in vec3 bitangent, const in float anisotropy ) {
				#ifdef ENVMAP_TYPE_PMREM
					vec3 bentNormal = cross( bitangent, viewDir );
					bentNormal = normalize( cross( bentNormal, bitangent ) );
					bentNormal = normalize( mix( bentNormal, normal, pow2( pow2( 1.0 - anisotropy * ( 1.0 - roughness ) ) ) ) );
					return getIBLRetroRadiance( viewDir, bentNormal, roughness );
				#else
					return vec3( 0.0 );
				#endif
			}
		#endif
	#endif
#endif`,MM=`ToonMaterial material;
material.diffuseColor = diffuseColor.rgb;`,bM=`varying vec3 vViewPosition;
struct ToonMaterial {
	vec3 diffuseColor;
};
void RE_Direct_Toon( const in IncidentLight directLight, const in vec3 geometryPosition, const in vec3 geometryNormal, const in vec3 geometryViewDir, const in vec3 geometryClearcoatNormal, const in ToonMaterial material, inout ReflectedLight reflectedLight ) {
	vec3 irradiance = getGradientIrradiance( geometryNormal, directLight.direction ) * directLight.color;
	reflectedLight.directDiffuse += irradiance * BRDF_Lambert( material.diffuseColor );
}
void RE_IndirectDiffuse_Toon( const in vec3 irradiance, const in vec3 geometryPosition, const in vec3 geometryNormal, const in vec3 geometryViewDir, const in vec3 geometryClearcoatNormal, const in ToonMaterial material, inout ReflectedLight reflectedLight ) {
	reflectedLight.indirectDiffuse += irradiance * BRDF_Lambert( material.diffuseColor );
}
#define RE_Direct				RE_Direct_Toon
#define RE_IndirectDiffuse		RE_IndirectDiffuse_Toon`,wM=`BlinnPhongMaterial material;
material.diffuseColor = diffuseColor.rgb;
material.specularColor = specular;
material.specularShininess = shininess;
material.specularStrength = specularStrength;`,EM=`varying vec3 vViewPosition;
struct BlinnPhongMaterial {
	vec3 diffuseColor;
	vec3 specularColor;
	float specularShininess;
	float specularStrength;
};
void RE_Direct_BlinnPhong( const in IncidentLight directLight, const in vec3 geometryPosition, const in vec3 geometryNormal, const in vec3 geometryViewDir, const in vec3 geometryClearcoatNormal, const in BlinnPhongMaterial material, inout ReflectedLight reflectedLight ) {
	float dotNL = saturate( dot( geometryNormal, directLight.direction ) );
	vec3 irradiance = dotNL * directLight.color;
	reflectedLight.directDiffuse += irradiance * BRDF_Lambert( material.diffuseColor );
	reflectedLight.directSpecular += irradiance * BRDF_BlinnPhong( directLight.direction, geometryViewDir, geometryNormal, material.specularColor, material.specularShininess ) * material.specularStrength;
}
void RE_IndirectDiffuse_BlinnPhong( const in vec3 irradiance, const in vec3 geometryPosition, const in vec3 geometryNormal, const in vec3 geometryViewDir, const in vec3 geometryClearcoatNormal, const in BlinnPhongMaterial material, inout ReflectedLight reflectedLight ) {
	reflectedLight.indirectDiffuse += irradiance * BRDF_Lambert( material.diffuseColor );
}
#define RE_Direct				RE_Direct_BlinnPhong
#define RE_IndirectDiffuse		RE_IndirectDiffuse_BlinnPhong`,TM=`PhysicalMaterial material;
material.diffuseColor = diffuseColor.rgb;
material.diffuseContribution = diffuseColor.rgb * ( 1.0 - metalnessFactor );
material.metalness = metalnessFactor;
vec3 dxy = max( abs( dFdx( nonPerturbedNormal ) ), abs( dFdy( nonPerturbedNormal ) ) );
float geometryRoughness = max( max( dxy.x, dxy.y ), dxy.z );
material.roughness = max( roughnessFactor, 0.045 );
material.roughness += geometryRoughness;
material.roughness = min( material.roughness, 1.0 );
#ifdef USE_DIFFUSE_ROUGHNESS
	float diffuseRoughnessFactor = diffuseRoughness;
	#ifdef USE_DIFFUSE_ROUGHNESSMAP
		diffuseRoughnessFactor *= texture2D( diffuseRoughnessMap, vDiffuseRoughnessMapUv ).r;
	#endif
	material.diffuseRoughness = saturate( diffuseRoughnessFactor );
#endif
#ifdef IOR
	material.ior = ior;
	#ifdef USE_SPECULAR
		float specularIntensityFactor = specularIntensity;
		vec3 specularColorFactor = specularColor;
		#ifdef USE_SPECULAR_COLORMAP
			specularColorFactor *= texture2D( specularColorMap, vSpecularColorMapUv ).rgb;
		#endif
		#ifdef USE_SPECULAR_INTENSITYMAP
			specularIntensityFactor *= texture2D( specularIntensityMap, vSpecularIntensityMapUv ).a;
		#endif
		material.specularF90 = mix( specularIntensityFactor, 1.0, metalnessFactor );
	#else
		float specularIntensityFactor = 1.0;
		vec3 specularColorFactor = vec3( 1.0 );
		material.specularF90 = 1.0;
	#endif
	material.specularColor = min( pow2( ( material.ior - 1.0 ) / ( material.ior + 1.0 ) ) * specularColorFactor, vec3( 1.0 ) ) * specularIntensityFactor;
	material.specularColorBlended = mix( material.specularColor, diffuseColor.rgb, metalnessFactor );
#else
	material.specularColor = vec3( 0.04 );
	material.specularColorBlended = mix( material.specularColor, diffuseColor.rgb, metalnessFactor );
	material.specularF90 = 1.0;
#endif
#ifdef USE_CLEARCOAT
	material.clearcoat = clearcoat;
	material.clearcoatRoughness = clearcoatRoughness;
	material.clearcoatF0 = vec3( 0.04 );
	material.clearcoatF90 = 1.0;
	#ifdef USE_CLEARCOATMAP
		material.clearcoat *= texture2D( clearcoatMap, vClearcoatMapUv ).x;
	#endif
	#ifdef USE_CLEARCOAT_ROUGHNESSMAP
		material.clearcoatRoughness *= texture2D( clearcoatRoughnessMap, vClearcoatRoughnessMapUv ).y;
	#endif
	material.clearcoat = saturate( material.clearcoat );	material.clearcoatRoughness = max( material.clearcoatRoughness, 0.045 );
	material.clearcoatRoughness += geometryRoughness;
	material.clearcoatRoughness = min( material.clearcoatRoughness, 1.0 );
#endif
#ifdef USE_DISPERSION
	material.dispersion = dispersion;
#endif
#ifdef USE_RETROREFLECTION
	material.retroreflectivity = retroreflectivity;
#endif
#ifdef USE_IRIDESCENCE
	material.iridescence = iridescence;
	material.iridescenceIOR = iridescenceIOR;
	#ifdef USE_IRIDESCENCEMAP
		material.iridescence *= texture2D( iridescenceMap, vIridescenceMapUv ).r;
	#endif
	#ifdef USE_IRIDESCENCE_THICKNESSMAP
		material.iridescenceThickness = (iridescenceThicknessMaximum - iridescenceThicknessMinimum) * texture2D( iridescenceThicknessMap, vIridescenceThicknessMapUv ).g + iridescenceThicknessMinimum;
	#else
		material.iridescenceThickness = iridescenceThicknessMaximum;
	#endif
#endif
#ifdef USE_SHEEN
	material.sheenColor = sheenColor;
	#ifdef USE_SHEEN_COLORMAP
		material.sheenColor *= texture2D( sheenColorMap, vSheenColorMapUv ).rgb;
	#endif
	material.sheenRoughness = clamp( sheenRoughness, 0.0001, 1.0 );
	#ifdef USE_SHEEN_ROUGHNESSMAP
		material.sheenRoughness *= texture2D( sheenRoughnessMap, vSheenRoughnessMapUv ).a;
	#endif
#endif
#ifdef USE_ANISOTROPY
	#ifdef USE_ANISOTROPYMAP
		mat2 anisotropyMat = mat2( anisotropyVector.x, anisotropyVector.y, - anisotropyVector.y, anisotropyVector.x );
		vec3 anisotropyPolar = texture2D( anisotropyMap, vAnisotropyMapUv ).rgb;
		vec2 anisotropyV = anisotropyMat * normalize( 2.0 * anisotropyPolar.rg - vec2( 1.0 ) ) * anisotropyPolar.b;
	#else
		vec2 anisotropyV = anisotropyVector;
	#endif
	material.anisotropy = length( anisotropyV );
	if( material.anisotropy == 0.0 ) {
		anisotropyV = vec2( 1.0, 0.0 );
	} else {
		anisotropyV /= material.anisotropy;
		material.anisotropy = saturate( material.anisotropy );
	}
	material.alphaT = mix( pow2( material.roughness ), 1.0, pow2( material.anisotropy ) );
	material.anisotropyT = tbn[ 0 ] * anisotropyV.x + tbn[ 1 ] * anisotropyV.y;
	material.anisotropyB = tbn[ 1 ] * anisotropyV.x - tbn[ 0 ] * anisotropyV.y;
#endif`,AM=`uniform sampler2D dfgLUT;
struct PhysicalMaterial {
	vec3 diffuseColor;
	vec3 diffuseContribution;
	vec3 specularColor;
	vec3 specularColorBlended;
	float roughness;
	float metalness;
	float specularF90;
	float dispersion;
	vec2 dfg;
	vec3 multiScatteringCompensation;
	#ifdef USE_DIFFUSE_ROUGHNESS
		float diffuseRoughness;
	#endif
	#ifdef USE_RETROREFLECTION
		float retroreflectivity;
	#endif
	#ifdef USE_CLEARCOAT
		float clearcoat;
		float clearcoatRoughness;
		vec3 clearcoatF0;
		float clearcoatF90;
	#endif
	#ifdef USE_IRIDESCENCE
		float iridescence;
		float iridescenceIOR;
		float iridescenceThickness;
		vec3 iridescenceFresnel;
		vec3 iridescenceF0Dielectric;
		vec3 iridescenceF0Metallic;
	#endif
	#ifdef USE_SHEEN
		vec3 sheenColor;
		float sheenRoughness;
	#endif
	#ifdef IOR
		float ior;
	#endif
	#ifdef USE_TRANSMISSION
		float transmission;
		float transmissionAlpha;
		float thickness;
		float attenuationDistance;
		vec3 attenuationColor;
	#endif
	#ifdef USE_ANISOTROPY
		float anisotropy;
		float alphaT;
		vec3 anisotropyT;
		vec3 anisotropyB;
	#endif
};
vec3 clearcoatSpecularDirect = vec3( 0.0 );
vec3 clearcoatSpecularIndirect = vec3( 0.0 );
vec3 sheenSpecularDirect = vec3( 0.0 );
vec3 sheenSpecularIndirect = vec3(0.0 );
vec3 Schlick_to_F0( const in vec3 f, const in float f90, const in float dotVH ) {
    float x = clamp( 1.0 - dotVH, 0.0, 1.0 );
    float x2 = x * x;
    float x5 = clamp( x * x2 * x2, 0.0, 0.9999 );
    return ( f - vec3( f90 ) * x5 ) / ( 1.0 - x5 );
}
#ifdef USE_DIFFUSE_ROUGHNESS
	const float EON_EPSILON = 1e-7;
	float FON_DirectionalAlbedo( const in float mu, const in float roughness, const in float A ) {
		float muComp = 1.0 - mu;
		float gOverPi = muComp * ( 0.0571085289 + muComp * ( 0.491881867 + muComp * ( - 0.332181442 + muComp * 0.0714429953 ) ) );
		return A * ( 1.0 + roughness * gOverPi );
	}
	vec3 BRDF_EON( const in vec3 lightDir, const in vec3 viewDir, const in vec3 normal, const in vec3 diffuseColor, const in float roughness ) {
		vec3 rho = saturate( diffuseColor );
		if ( roughness <= EON_EPSILON ) return BRDF_Lambert( rho );
		float dotNL = saturate( dot( normal, lightDir ) );
		float dotNV = saturate( dot( normal, viewDir ) );
		float s = dot( lightDir, viewDir ) - dotNL * dotNV;
		float sOverT = ( s > 0.0 ) ? s / max( max( dotNL, dotNV ), EON_EPSILON ) : s;
		float A = 1.0 / ( 1.0 + ( 0.5 - 2.0 / ( 3.0 * PI ) ) * roughness );
		vec3 singleScatter = rho * RECIPROCAL_PI * A * ( 1.0 + roughness * sOverT );
		float averageAlbedo = A * ( 1.0 + ( 2.0 / 3.0 - 28.0 / ( 15.0 * PI ) ) * roughness );
		float albedoV = FON_DirectionalAlbedo( dotNV, roughness, A );
		float albedoL = FON_DirectionalAlbedo( dotNL, roughness, A );
		vec3 rhoMultiScatter = rho * rho * averageAlbedo / max( vec3( EON_EPSILON ), vec3( 1.0 ) - rho * ( 1.0 - averageAlbedo ) );
		vec3 multiScatter = rhoMultiScatter * RECIPROCAL_PI
			* max( EON_EPSILON, 1.0 - albedoV )
			* max( EON_EPSILON, 1.0 - albedoL )
			/ max( EON_EPSILON, 1.0 - averageAlbedo );
		return singleScatter + multiScatter;
	}
	vec3 EON_DirectionalAlbedo( const in vec3 diffuseColor, const in float roughness, const in float dotNV ) {
		vec3 rho = saturate( diffuseColor );
		if ( roughness <= EON_EPSILON ) return rho;
		float A = 1.0 / ( 1.0 + ( 0.5 - 2.0 / ( 3.0 * PI ) ) * roughness );
		float directionalAlbedo = FON_DirectionalAlbedo( dotNV, roughness, A );
		float averageAlbedo = A * ( 1.0 + ( 2.0 / 3.0 - 28.0 / ( 15.0 * PI ) ) * roughness );
		vec3 rhoMultiScatter = rho * rho * averageAlbedo / max( vec3( EON_EPSILON ), vec3( 1.0 ) - rho * ( 1.0 - averageAlbedo ) );
		return rho * directionalAlbedo + rhoMultiScatter * ( 1.0 - directionalAlbedo );
	}
#endif
float V_GGX_SmithCorrelated( const in float alpha, const in float dotNL, const in float dotNV ) {
	float a2 = pow2( alpha );
	float gv = dotNL * sqrt( a2 + ( 1.0 - a2 ) * pow2( dotNV ) );
	float gl = dotNV * sqrt( a2 + ( 1.0 - a2 ) * pow2( dotNL ) );
	return 0.5 / max( gv + gl, EPSILON );
}
float D_GGX( const in float alpha, const in float dotNH ) {
	float a2 = pow2( alpha );
	float denom = pow2( dotNH ) * ( a2 - 1.0 ) + 1.0;
	return RECIPROCAL_PI * a2 / pow2( denom );
}
#ifdef USE_ANISOTROPY
	float V_GGX_SmithCorrelated_Anisotropic( const in float alphaT, const in float alphaB, const in float dotTV, const in float dotBV, const in float dotTL, const in float dotBL, const in float dotNV, const in float dotNL ) {
		float gv = dotNL * length( vec3( alphaT * dotTV, alphaB * dotBV, dotNV ) );
		float gl = dotNV * length( vec3( alphaT * dotTL, alphaB * dotBL, dotNL ) );
		return 0.5 / max( gv + gl, EPSILON );
	}
	float D_GGX_Anisotropic( const in float alphaT, const in float alphaB, const in float dotNH, const in float dotTH, const in float dotBH ) {
		float a2 = alphaT * alphaB;
		highp vec3 v = vec3( alphaB * dotTH, alphaT * dotBH, a2 * dotNH );
		highp float v2 = dot( v, v );
		float w2 = a2 / v2;
		return RECIPROCAL_PI * a2 * pow2 ( w2 );
	}
#endif
#ifdef USE_CLEARCOAT
	vec3 BRDF_GGX_Clearcoat( const in vec3 lightDir, const in vec3 viewDir, const in vec3 normal, const in PhysicalMaterial material) {
		vec3 f0 = material.clearcoatF0;
		float f90 = material.clearcoatF90;
		float roughness = max( material.clearcoatRoughness, 0.045 );
		float alpha = pow2( roughness );
		vec3 halfDir = normalize( lightDir + viewDir );
		float dotNL = saturate( dot( normal, lightDir ) );
		float dotNV = saturate( dot( normal, viewDir ) );
		float dotNH = saturate( dot( normal, halfDir ) );
		float dotVH = saturate( dot( viewDir, halfDir ) );
		vec3 F = F_Schlick( f0, f90, dotVH );
		float V = V_GGX_SmithCorrelated( alpha, dotNL, dotNV );
		float D = D_GGX( alpha, dotNH );
		return F * ( V * D );
	}
#endif
vec3 BRDF_GGX( const in vec3 lightDir, const in vec3 viewDir, const in vec3 normal, const in PhysicalMaterial material ) {
	vec3 f0 = material.specularColorBlended;
	float f90 = material.specularF90;
	float roughness = max( material.roughness, 0.045 );
	float alpha = pow2( roughness );
	vec3 halfDir = normalize( lightDir + viewDir );
	float dotNL = saturate( dot( normal, lightDir ) );
	float dotNV = saturate( dot( normal, viewDir ) );
	float dotNH = saturate( dot( normal, halfDir ) );
	float dotVH = saturate( dot( viewDir, halfDir ) );
	vec3 F = F_Schlick( f0, f90, dotVH );
	#ifdef USE_IRIDESCENCE
		F = mix( F, material.iridescenceFresnel, material.iridescence );
	#endif
	#ifdef USE_ANISOTROPY
		float dotTL = dot( material.anisotropyT, lightDir );
		float dotTV = dot( material.anisotropyT, viewDir );
		float dotTH = dot( material.anisotropyT, halfDir );
		float dotBL = dot( material.anisotropyB, lightDir );
		float dotBV = dot( material.anisotropyB, viewDir );
		float dotBH = dot( material.anisotropyB, halfDir );
		float alphaT = max( material.alphaT, alpha );
		float V = V_GGX_SmithCorrelated_Anisotropic( alphaT, alpha, dotTV, dotBV, dotTL, dotBL, dotNV, dotNL );
		float D = D_GGX_Anisotropic( alphaT, alpha, dotNH, dotTH, dotBH );
	#else
		float V = V_GGX_SmithCorrelated( alpha, dotNL, dotNV );
		float D = D_GGX( alpha, dotNH );
	#endif
	return F * ( V * D );
}
vec2 LTC_Uv( const in vec3 N, const in vec3 V, const in float roughness ) {
	const float LUT_SIZE = 64.0;
	const float LUT_SCALE = ( LUT_SIZE - 1.0 ) / LUT_SIZE;
	const float LUT_BIAS = 0.5 / LUT_SIZE;
	float dotNV = saturate( dot( N, V ) );
	vec2 uv = vec2( roughness, sqrt( 1.0 - dotNV ) );
	uv = uv * LUT_SCALE + LUT_BIAS;
	return uv;
}
float LTC_ClippedSphereFormFactor( const in vec3 f ) {
	float l = length( f );
	return max( ( l * l + f.z ) / ( l + 1.0 ), 0.0 );
}
vec3 LTC_EdgeVectorFormFactor( const in vec3 v1, const in vec3 v2 ) {
	float x = dot( v1, v2 );
	float y = abs( x );
	float a = 0.8543985 + ( 0.4965155 + 0.0145206 * y ) * y;
	float b = 3.4175940 + ( 4.1616724 + y ) * y;
	float v = a / b;
	float theta_sintheta = ( x > 0.0 ) ? v : 0.5 * inversesqrt( max( 1.0 - x * x, 1e-7 ) ) - v;
	return cross( v1, v2 ) * theta_sintheta;
}
vec3 LTC_Evaluate( const in vec3 N, const in vec3 V, const in vec3 P, const in mat3 mInv, const in vec3 rectCoords[ 4 ] ) {
	vec3 v1 = rectCoords[ 1 ] - rectCoords[ 0 ];
	vec3 v2 = rectCoords[ 3 ] - rectCoords[ 0 ];
	vec3 lightNormal = cross( v1, v2 );
	if( dot( lightNormal, P - rectCoords[ 0 ] ) < 0.0 ) return vec3( 0.0 );
	vec3 T1, T2;
	T1 = normalize( V - N * dot( V, N ) );
	T2 = - cross( N, T1 );
	mat3 mat = mInv * transpose( mat3( T1, T2, N ) );
	vec3 coords[ 4 ];
	coords[ 0 ] = mat * ( rectCoords[ 0 ] - P );
	coords[ 1 ] = mat * ( rectCoords[ 1 ] - P );
	coords[ 2 ] = mat * ( rectCoords[ 2 ] - P );
	coords[ 3 ] = mat * ( rectCoords[ 3 ] - P );
	coords[ 0 ] = normalize( coords[ 0 ] );
	coords[ 1 ] = normalize( coords[ 1 ] );
	coords[ 2 ] = normalize( coords[ 2 ] );
	coords[ 3 ] = normalize( coords[ 3 ] );
	vec3 vectorFormFactor = vec3( 0.0 );
	vectorFormFactor += LTC_EdgeVectorFormFactor( coords[ 0 ], coords[ 1 ] );
	vectorFormFactor += LTC_EdgeVectorFormFactor( coords[ 1 ], coords[ 2 ] );
	vectorFormFactor += LTC_EdgeVectorFormFactor( coords[ 2 ], coords[ 3 ] );
	vectorFormFactor += LTC_EdgeVectorFormFactor( coords[ 3 ], coords[ 0 ] );
	float result = LTC_ClippedSphereFormFactor( vectorFormFactor );
	return vec3( result );
}
#if defined( USE_SHEEN )
float D_Charlie( float roughness, float dotNH ) {
	float alpha = pow2( roughness );
	float invAlpha = 1.0 / alpha;
	float cos2h = dotNH * dotNH;
	float sin2h = max( 1.0 - cos2h, 0.0078125 );
	return ( 2.0 + invAlpha ) * pow( sin2h, invAlpha * 0.5 ) / ( 2.0 * PI );
}
float V_Neubelt( float dotNV, float dotNL ) {
	return saturate( 1.0 / ( 4.0 * ( dotNL + dotNV - dotNL * dotNV ) ) );
}
vec3 BRDF_Sheen( const in vec3 lightDir, const in vec3 viewDir, const in vec3 normal, vec3 sheenColor, const in float sheenRoughness ) {
	vec3 halfDir = normalize( lightDir + viewDir );
	float dotNL = saturate( dot( normal, lightDir ) );
	float dotNV = saturate( dot( normal, viewDir ) );
	float dotNH = saturate( dot( normal, halfDir ) );
	float D = D_Charlie( sheenRoughness, dotNH );
	float V = V_Neubelt( dotNV, dotNL );
	return sheenColor * ( D * V );
}
#endif
float IBLSheenBRDF( const in vec3 normal, const in vec3 viewDir, const in float roughness ) {
	float dotNV = saturate( dot( normal, viewDir ) );
	float r2 = roughness * roughness;
	float rInv = 1.0 / ( roughness + 0.1 );
	float a = -1.9362 + 1.0678 * roughness + 0.4573 * r2 - 0.8469 * rInv;
	float b = -0.6014 + 0.5538 * roughness - 0.4670 * r2 - 0.1255 * rInv;
	float DG = exp( a * dotNV + b );
	return saturate( DG );
}
vec3 EnvironmentBRDF( const in vec3 normal, const in vec3 viewDir, const in vec3 specularColor, const in float specularF90, const in float roughness ) {
	float dotNV = saturate( dot( normal, viewDir ) );
	vec2 fab = texture2D( dfgLUT, vec2( roughness, dotNV ) ).rg;
	return specularColor * fab.x + specularF90 * fab.y;
}
#ifdef USE_IRIDESCENCE
void computeMultiscatteringIridescence( const in vec2 fab, const in vec3 specularColor, const in float specularF90, const in float iridescence, const in vec3 iridescenceF0, inout vec3 singleScatter, inout vec3 multiScatter ) {
#else
void computeMultiscattering( const in vec2 fab, const in vec3 specularColor, const in float specularF90, inout vec3 singleScatter, inout vec3 multiScatter ) {
#endif
	#ifdef USE_IRIDESCENCE
		vec3 Fr = mix( specularColor, iridescenceF0, iridescence );
	#else
		vec3 Fr = specularColor;
	#endif
	vec3 FssEss = Fr * fab.x + specularF90 * fab.y;
	float Ess = fab.x + fab.y;
	float Ems = 1.0 - Ess;
	vec3 Favg = Fr + ( 1.0 - Fr ) * 0.047619;	vec3 Fms = FssEss * Favg / ( 1.0 - Ems * Favg );
	singleScatter += FssEss;
	multiScatter += Fms * Ems;
}
#if NUM_RECT_AREA_LIGHTS > 0
	void RE_Direct_RectArea_Physical( const in RectAreaLight rectAreaLight, const in vec3 geometryPosition, const in vec3 geometryNormal, const in vec3 geometryViewDir, const in vec3 geometryClearcoatNormal, const in PhysicalMaterial material, inout ReflectedLight reflectedLight ) {
		vec3 normal = geometryNormal;
		vec3 viewDir = geometryViewDir;
		vec3 position = geometryPosition;
		vec3 lightPos = rectAreaLight.position;
		vec3 halfWidth = rectAreaLight.halfWidth;
		vec3 halfHeight = rectAreaLight.halfHeight;
		vec3 lightColor = rectAreaLight.color;
		float roughness = material.roughness;
		vec3 rectCoords[ 4 ];
		rectCoords[ 0 ] = lightPos + halfWidth - halfHeight;		rectCoords[ 1 ] = lightPos - halfWidth - halfHeight;
		rectCoords[ 2 ] = lightPos - halfWidth + halfHeight;
		rectCoords[ 3 ] = lightPos + halfWidth + halfHeight;
		vec2 uv = LTC_Uv( normal, viewDir, roughness );
		vec4 t1 = texture2D( ltc_1, uv );
		vec4 t2 = texture2D( ltc_2, uv );
		mat3 mInv = mat3(
			vec3( t1.x, 0, t1.y ),
			vec3(    0, 1,    0 ),
			vec3( t1.z, 0, t1.w )
		);
		vec3 fresnel = ( material.specularColorBlended * t2.x + ( material.specularF90 - material.specularColorBlended ) * t2.y );
		reflectedLight.directSpecular += lightColor * fresnel * LTC_Evaluate( normal, viewDir, position, mInv, rectCoords );
		reflectedLight.directDiffuse += lightColor * material.diffuseContribution * LTC_Evaluate( normal, viewDir, position, mat3( 1.0 ), rectCoords );
		#ifdef USE_CLEARCOAT
			vec3 Ncc = geometryClearcoatNormal;
			vec2 uvClearcoat = LTC_Uv( Ncc, viewDir, material.clearcoatRoughness );
			vec4 t1Clearcoat = texture2D( ltc_1, uvClearcoat );
			vec4 t2Clearcoat = texture2D( ltc_2, uvClearcoat );
			mat3 mInvClearcoat = mat3(
				vec3( t1Clearcoat.x, 0, t1Clearcoat.y ),
				vec3(             0, 1,             0 ),
				vec3( t1Clearcoat.z, 0, t1Clearcoat.w )
			);
			vec3 fresnelClearcoat = material.clearcoatF0 * t2Clearcoat.x + ( material.clearcoatF90 - material.clearcoatF0 ) * t2Clearcoat.y;
			clearcoatSpecularDirect += lightColor * fresnelClearcoat * LTC_Evaluate( Ncc, viewDir, position, mInvClearcoat, rectCoords );
		#endif
	}
#endif
void RE_Direct_Physical( const in IncidentLight directLight, const in vec3 geometryPosition, const in vec3 geometryNormal, const in vec3 geometryViewDir, const in vec3 geometryClearcoatNormal, const in PhysicalMaterial material, inout ReflectedLight reflectedLight ) {
	float dotNL = saturate( dot( geometryNormal, directLight.direction ) );
	vec3 irradiance = dotNL * directLight.color;
	#ifdef USE_CLEARCOAT
		float dotNLcc = saturate( dot( geometryClearcoatNormal, directLight.direction ) );
		vec3 ccIrradiance = dotNLcc * directLight.color;
		clearcoatSpecularDirect += ccIrradiance * BRDF_GGX_Clearcoat( directLight.direction, geometryViewDir, geometryClearcoatNormal, material );
	#endif
	#ifdef USE_SHEEN
 
 		sheenSpecularDirect += irradiance * BRDF_Sheen( directLight.direction, geometryViewDir, geometryNormal, material.sheenColor, material.sheenRoughness );
 
 		float sheenAlbedoV = IBLSheenBRDF( geometryNormal, geometryViewDir, material.sheenRoughness );
 		float sheenAlbedoL = IBLSheenBRDF( geometryNormal, directLight.direction, material.sheenRoughness );
 
 		float sheenEnergyComp = 1.0 - max3( material.sheenColor ) * max( sheenAlbedoV, sheenAlbedoL );
 
 		irradiance *= sheenEnergyComp;
 
 	#endif
	vec3 specularBRDF = BRDF_GGX( directLight.direction, geometryViewDir, geometryNormal, material );
	#ifdef USE_RETROREFLECTION
		vec3 retroViewDir = reflect( - geometryViewDir, geometryNormal );
		vec3 retroSpecularBRDF = BRDF_GGX( directLight.direction, retroViewDir, geometryNormal, material );
		specularBRDF = mix( specularBRDF, retroSpecularBRDF, saturate( material.retroreflectivity ) );
	#endif
	reflectedLight.directSpecular += irradiance * specularBRDF * material.multiScatteringCompensation;
	vec3 halfDir = normalize( directLight.direction + geometryViewDir );
	float dotVH = saturate( dot( geometryViewDir, halfDir ) );
	vec3 F = F_Schlick( material.specularColor, material.specularF90, dotVH );
	#ifdef USE_RETROREFLECTION
		vec3 retroHalfDir = normalize( directLight.direction + retroViewDir );
		float dotRetroVH = saturate( dot( retroViewDir, retroHalfDir ) );
		vec3 retroF = F_Schlick( material.specularColor, material.specularF90, dotRetroVH );
		F = mix( F, retroF, saturate( material.retroreflectivity ) );
	#endif
	#ifdef USE_DIFFUSE_ROUGHNESS
		vec3 diffuseBRDF = BRDF_EON( directLight.direction, geometryViewDir, geometryNormal, material.diffuseColor, material.diffuseRoughness ) * ( 1.0 - material.metalness );
	#else
		vec3 diffuseBRDF = BRDF_Lambert( material.diffuseContribution );
	#endif
	reflectedLight.directDiffuse += irradiance * diffuseBRDF * ( 1.0 - F );
}
void RE_IndirectDiffuse_Physical( const in vec3 irradiance, const in vec3 geometryPosition, const in vec3 geometryNormal, const in vec3 geometryViewDir, const in vec3 geometryClearcoatNormal, const in PhysicalMaterial material, inout ReflectedLight reflectedLight ) {
	vec3 singleScattering = vec3( 0.0 );
	vec3 multiScattering = vec3( 0.0 );
	#ifdef USE_IRIDESCENCE
		computeMultiscatteringIridescence( material.dfg, material.specularColor, material.specularF90, material.iridescence, material.iridescenceF0Dielectric, singleScattering, multiScattering );
	#else
		computeMultiscattering( material.dfg, material.specularColor, material.specularF90, singleScattering, multiScattering );
	#endif
	#ifdef USE_DIFFUSE_ROUGHNESS
		float dotNV = saturate( dot( geometryNormal, geometryViewDir ) );
		vec3 diffuseAlbedo = EON_DirectionalAlbedo( material.diffuseColor, material.diffuseRoughness, dotNV ) * ( 1.0 - material.metalness );
		vec3 diffuse = irradiance * RECIPROCAL_PI * diffuseAlbedo * ( 1.0 - singleScattering - multiScattering );
	#else
		vec3 diffuse = irradiance * BRDF_Lambert( material.diffuseContribution ) * ( 1.0 - singleScattering - multiScattering );
	#endif
	#ifdef USE_SHEEN
		float sheenAlbedo = IBLSheenBRDF( geometryNormal, geometryViewDir, material.sheenRoughness );
		sheenSpecularIndirect += irradiance * material.sheenColor * sheenAlbedo * RECIPROCAL_PI;
		float sheenEnergyComp = 1.0 - max3( material.sheenColor ) * sheenAlbedo;
		diffuse *= sheenEnergyComp;
	#endif
	reflectedLight.indirectDiffuse += diffuse;
}
void RE_IndirectSpecular_Physical( const in vec3 radiance, const in vec3 irradiance, const in vec3 clearcoatRadiance, const in vec3 geometryPosition, const in vec3 geometryNormal, const in vec3 geometryViewDir, const in vec3 geometryClearcoatNormal, const in PhysicalMaterial material, inout ReflectedLight reflectedLight) {
	#ifdef USE_CLEARCOAT
		clearcoatSpecularIndirect += clearcoatRadiance * EnvironmentBRDF( geometryClearcoatNormal, geometryViewDir, material.clearcoatF0, material.clearcoatF90, material.clearcoatRoughness );
	#endif
	#ifdef USE_SHEEN
		sheenSpecularIndirect += irradiance * material.sheenColor * IBLSheenBRDF( geometryNormal, geometryViewDir, material.sheenRoughness ) * RECIPROCAL_PI;
 	#endif
	vec3 singleScatteringDielectric = vec3( 0.0 );
	vec3 multiScatteringDielectric = vec3( 0.0 );
	vec3 singleScatteringMetallic = vec3( 0.0 );
	vec3 multiScatteringMetallic = vec3( 0.0 );
	#ifdef USE_IRIDESCENCE
		computeMultiscatteringIridescence( material.dfg, material.specularColor, material.specularF90, material.iridescence, material.iridescenceF0Dielectric, singleScatteringDielectric, multiScatteringDielectric );
		computeMultiscatteringIridescence( material.dfg, material.diffuseColor, material.specularF90, material.iridescence, material.iridescenceF0Metallic, singleScatteringMetallic, multiScatteringMetallic );
	#else
		computeMultiscattering( material.dfg, material.specularColor, material.specularF90, singleScatteringDielectric, multiScatteringDielectric );
		computeMultiscattering( material.dfg, material.diffuseColor, material.specularF90, singleScatteringMetallic, multiScatteringMetallic );
	#endif
	vec3 singleScattering = mix( singleScatteringDielectric, singleScatteringMetallic, material.metalness );
	vec3 multiScattering = mix( multiScatteringDielectric, multiScatteringMetallic, material.metalness );
	vec3 totalScatteringDielectric = singleScatteringDielectric + multiScatteringDielectric;
	#ifdef USE_DIFFUSE_ROUGHNESS
		float dotNV = saturate( dot( geometryNormal, geometryViewDir ) );
		vec3 diffuse = EON_DirectionalAlbedo( material.diffuseColor, material.diffuseRoughness, dotNV ) * ( 1.0 - material.metalness ) * ( 1.0 - totalScatteringDielectric );
	#else
		vec3 diffuse = material.diffuseContribution * ( 1.0 - totalScatteringDielectric );
	#endif
	vec3 cosineWeightedIrradiance = irradiance * RECIPROCAL_PI;
	vec3 indirectSpecular = radiance * singleScattering;
	indirectSpecular += multiScattering * cosineWeightedIrradiance;
	vec3 indirectDiffuse = diffuse * cosineWeightedIrradiance;
	#ifdef USE_SHEEN
		float sheenAlbedo = IBLSheenBRDF( geometryNormal, geometryViewDir, material.sheenRoughness );
		float sheenEnergyComp = 1.0 - max3( material.sheenColor ) * sheenAlbedo;
		indirectSpecular *= sheenEnergyComp;
		indirectDiffuse *= sheenEnergyComp;
	#endif
	reflectedLight.indirectSpecular += indirectSpecular;
	reflectedLight.indirectDiffuse += indirectDiffuse;
}
#define RE_Direct				RE_Direct_Physical
#define RE_Direct_RectArea		RE_Direct_RectArea_Physical
#define RE_IndirectDiffuse		RE_IndirectDiffuse_Physical
#define RE_IndirectSpecular		RE_IndirectSpecular_Physical
float computeSpecularOcclusion( const in float dotNV, const in float ambientOcclusion, const in float roughness ) {
	return saturate( pow( dotNV + ambientOcclusion, exp2( - 16.0 * roughness - 1.0 ) ) - 1.0 + ambientOcclusion );
}`,RM=`
vec3 geometryPosition = - vViewPosition;
vec3 geometryNormal = normal;
vec3 geometryViewDir = ( isOrthographic ) ? vec3( 0, 0, 1 ) : normalize( vViewPosition );
vec3 geometryClearcoatNormal = vec3( 0.0 );
#ifdef USE_CLEARCOAT
	geometryClearcoatNormal = clearcoatNormal;
#endif
#ifdef USE_IRIDESCENCE
	float dotNVi = saturate( dot( normal, geometryViewDir ) );
	if ( material.iridescenceThickness == 0.0 ) {
		material.iridescence = 0.0;
	} else {
		material.iridescence = saturate( material.iridescence );
	}
	if ( material.iridescence > 0.0 ) {
		vec3 iridescenceFresnelDielectric = evalIridescence( 1.0, material.iridescenceIOR, dotNVi, material.iridescenceThickness, material.specularColor );
		vec3 iridescenceFresnelMetallic = evalIridescence( 1.0, material.iridescenceIOR, dotNVi, material.iridescenceThickness, material.diffuseColor );
		material.iridescenceFresnel = mix( iridescenceFresnelDielectric, iridescenceFresnelMetallic, material.metalness );
		material.iridescenceF0Dielectric = Schlick_to_F0( iridescenceFresnelDielectric, 1.0, dotNVi );
		material.iridescenceF0Metallic = Schlick_to_F0( iridescenceFresnelMetallic, 1.0, dotNVi );
	}
#endif
#ifdef STANDARD
	float dotNVms = saturate( dot( geometryNormal, geometryViewDir ) );
	material.dfg = texture2D( dfgLUT, vec2( material.roughness, dotNVms ) ).rg;
	#if ( NUM_SUN_LIGHTS > 0 || NUM_DIR_LIGHTS > 0 || NUM_POINT_LIGHTS > 0 || NUM_SPOT_LIGHTS > 0 )
		float EssMs = material.dfg.x + material.dfg.y;
		material.multiScatteringCompensation = 1.0 + material.specularColorBlended * ( 1.0 / EssMs - 1.0 );
	#endif
#endif
IncidentLight directLight;
#if ( NUM_POINT_LIGHTS > 0 ) && defined( RE_Direct )
	PointLight pointLight;
	#if defined( USE_SHADOWMAP ) && NUM_POINT_LIGHT_SHADOWS > 0
	PointLightShadow pointLightShadow;
	#endif
	#pragma unroll_loop_start
	for ( int i = 0; i < NUM_POINT_LIGHTS; i ++ ) {
		pointLight = pointLights[ i ];
		getPointLightInfo( pointLight, geometryPosition, directLight );
		#if defined( USE_SHADOWMAP ) && ( UNROLLED_LOOP_INDEX < NUM_POINT_LIGHT_SHADOWS ) && ( defined( SHADOWMAP_TYPE_PCF ) || defined( SHADOWMAP_TYPE_BASIC ) )
		pointLightShadow = pointLightShadows[ i ];
		directLight.color *= ( directLight.visible && receiveShadow ) ? getPointShadow( pointShadowMap[ i ], pointLightShadow.shadowMapSize, pointLightShadow.shadowIntensity, pointLightShadow.shadowBias, pointLightShadow.shadowRadius, vPointShadowCoord[ i ], pointLightShadow.shadowCameraNear, pointLightShadow.shadowCameraFar ) : 1.0;
		#endif
		RE_Direct( directLight, geometryPosition, geometryNormal, geometryViewDir, geometryClearcoatNormal, material, reflectedLight );
	}
	#pragma unroll_loop_end
#endif
#if ( NUM_SPOT_LIGHTS > 0 ) && defined( RE_Direct )
	SpotLight spotLight;
	vec4 spotColor;
	vec3 spotLightCoord;
	bool inSpotLightMap;
	#if defined( USE_SHADOWMAP ) && NUM_SPOT_LIGHT_SHADOWS > 0
	SpotLightShadow spotLightShadow;
	#endif
	#pragma unroll_loop_start
	for ( int i = 0; i < NUM_SPOT_LIGHTS; i ++ ) {
		spotLight = spotLights[ i ];
		getSpotLightInfo( spotLight, geometryPosition, directLight );
		#if ( UNROLLED_LOOP_INDEX < NUM_SPOT_LIGHT_SHADOWS_WITH_MAPS )
		#define SPOT_LIGHT_MAP_INDEX UNROLLED_LOOP_INDEX
		#elif ( UNROLLED_LOOP_INDEX < NUM_SPOT_LIGHT_SHADOWS )
		#define SPOT_LIGHT_MAP_INDEX NUM_SPOT_LIGHT_MAPS
		#else
		#define SPOT_LIGHT_MAP_INDEX ( UNROLLED_LOOP_INDEX - NUM_SPOT_LIGHT_SHADOWS + NUM_SPOT_LIGHT_SHADOWS_WITH_MAPS )
		#endif
		#if ( SPOT_LIGHT_MAP_INDEX < NUM_SPOT_LIGHT_MAPS )
			spotLightCoord = vSpotLightCoord[ i ].xyz / vSpotLightCoord[ i ].w;
			inSpotLightMap = all( lessThan( abs( spotLightCoord * 2. - 1. ), vec3( 1.0 ) ) );
			spotColor = texture2D( spotLightMap[ SPOT_LIGHT_MAP_INDEX ], spotLightCoord.xy );
			directLight.color = inSpotLightMap ? directLight.color * spotColor.rgb : directLight.color;
		#endif
		#undef SPOT_LIGHT_MAP_INDEX
		#if defined( USE_SHADOWMAP ) && ( UNROLLED_LOOP_INDEX < NUM_SPOT_LIGHT_SHADOWS )
		spotLightShadow = spotLightShadows[ i ];
		directLight.color *= ( directLight.visible && receiveShadow ) ? getShadow( spotShadowMap[ i ], spotLightShadow.shadowMapSize, spotLightShadow.shadowIntensity, spotLightShadow.shadowBias, spotLightShadow.shadowRadius, vSpotLightCoord[ i ] ) : 1.0;
		#endif
		RE_Direct( directLight, geometryPosition, geometryNormal, geometryViewDir, geometryClearcoatNormal, material, reflectedLight );
	}
	#pragma unroll_loop_end
#endif
#if ( NUM_SUN_LIGHTS > 0 ) && defined( RE_Direct )
	SunLight sunLight;
	#if defined( USE_SHADOWMAP ) && NUM_SUN_LIGHT_SHADOWS > 0
	SunLightShadow sunLightShadow;
	#endif
	#pragma unroll_loop_start
	for ( int i = 0; i < NUM_SUN_LIGHTS; i ++ ) {
		sunLight = sunLights[ i ];
		getSunLightInfo( sunLight, directLight );
		#if defined( USE_SHADOWMAP ) && ( UNROLLED_LOOP_INDEX < NUM_SUN_LIGHT_SHADOWS )
		sunLightShadow = sunLightShadows[ i ];
		directLight.color *= ( directLight.visible && receiveShadow ) ? getSunShadow( sunShadowMap[ i ], sunLightShadow, UNROLLED_LOOP_INDEX ) : 1.0;
		#endif
		RE_Direct( directLight, geometryPosition, geometryNormal, geometryViewDir, geometryClearcoatNormal, material, reflectedLight );
	}
	#pragma unroll_loop_end
#endif
#if ( NUM_DIR_LIGHTS > 0 ) && defined( RE_Direct )
	DirectionalLight directionalLight;
	#if defined( USE_SHADOWMAP ) && NUM_DIR_LIGHT_SHADOWS > 0
	DirectionalLightShadow directionalLightShadow;
	#endif
	#pragma unroll_loop_start
	for ( int i = 0; i < NUM_DIR_LIGHTS; i ++ ) {
		directionalLight = directionalLights[ i ];
		getDirectionalLightInfo( directionalLight, directLight );
		#if defined( USE_SHADOWMAP ) && ( UNROLLED_LOOP_INDEX < NUM_DIR_LIGHT_SHADOWS )
		directionalLightShadow = directionalLightShadows[ i ];
		directLight.color *= ( directLight.visible && receiveShadow ) ? getShadow( directionalShadowMap[ i ], directionalLightShadow.shadowMapSize, directionalLightShadow.shadowIntensity, directionalLightShadow.shadowBias, directionalLightShadow.shadowRadius, vDirectionalShadowCoord[ i ] ) : 1.0;
		#endif
		RE_Direct( directLight, geometryPosition, geometryNormal, geometryViewDir, geometryClearcoatNormal, material, reflectedLight );
	}
	#pragma unroll_loop_end
#endif
#if ( NUM_RECT_AREA_LIGHTS > 0 ) && defined( RE_Direct_RectArea )
	RectAreaLight rectAreaLight;
	#pragma unroll_loop_start
	for ( int i = 0; i < NUM_RECT_AREA_LIGHTS; i ++ ) {
		rectAreaLight = rectAreaLights[ i ];
		RE_Direct_RectArea( rectAreaLight, geometryPosition, geometryNormal, geometryViewDir, geometryClearcoatNormal, material, reflectedLight );
	}
	#pragma unroll_loop_end
#endif
#if defined( RE_IndirectDiffuse )
	vec3 iblIrradiance = vec3( 0.0 );
	vec3 irradiance = getAmbientLightIrradiance( ambientLightColor );
	#if defined( USE_LIGHT_PROBES )
		irradiance += getLightProbeIrradiance( lightProbe, geometryNormal );
	#endif
	#if ( NUM_HEMI_LIGHTS > 0 )
		#pragma unroll_loop_start
		for ( int i = 0; i < NUM_HEMI_LIGHTS; i ++ ) {
			irradiance += getHemisphereLightIrradiance( hemisphereLights[ i ], geometryNormal );
		}
		#pragma unroll_loop_end
	#endif
	#if NUM_LIGHT_PROBE_GRIDS > 0
		vec3 probeWorldPos = ( ( vec4( geometryPosition, 1.0 ) - viewMatrix[ 3 ] ) * viewMatrix ).xyz;
		vec3 probeWorldNormal = transformNormalByInverseViewMatrix( geometryNormal, viewMatrix );
		int probeGrid = - 1;
		#pragma unroll_loop_start
		for ( int i = 0; i < NUM_LIGHT_PROBE_GRIDS; i ++ ) {
			if ( isInsideLightProbeGrid( probeWorldPos, probeWorldNormal, probesMin[ i ], probesMax[ i ], probesResolution[ i ] ) ) probeGrid = UNROLLED_LOOP_INDEX;
		}
		#pragma unroll_loop_end
		#pragma unroll_loop_start
		for ( int i = 0; i < NUM_LIGHT_PROBE_GRIDS; i ++ ) {
			if ( probeGrid == UNROLLED_LOOP_INDEX ) irradiance += getLightProbeGridIrradiance( probesSH[ i ], probesMin[ i ], probesMax[ i ], probesResolution[ i ], probeWorldPos, probeWorldNormal );
		}
		#pragma unroll_loop_end
	#endif
#endif
#if defined( RE_IndirectSpecular )
	vec3 radiance = vec3( 0.0 );
	vec3 clearcoatRadiance = vec3( 0.0 );
#endif`,CM=`#if defined( RE_IndirectDiffuse )
	#ifdef USE_LIGHTMAP
		vec4 lightMapTexel = texture2D( lightMap, vLightMapUv );
		vec3 lightMapIrradiance = lightMapTexel.rgb * lightMapIntensity;
		irradiance += lightMapIrradiance;
	#endif
	#if defined( USE_ENVMAP ) && defined( ENVMAP_TYPE_PMREM )
		#if defined( STANDARD ) || defined( LAMBERT ) || defined( PHONG )
			iblIrradiance += getIBLIrradiance( geometryNormal );
		#endif
	#endif
#endif
#if defined( USE_ENVMAP ) && defined( RE_IndirectSpecular )
	#ifdef USE_ANISOTROPY
		vec3 iblRadiance = getIBLAnisotropyRadiance( geometryViewDir, geometryNormal, material.roughness, material.anisotropyB, material.anisotropy );
	#else
		vec3 iblRadiance = getIBLRadiance( geometryViewDir, geometryNormal, material.roughness );
	#endif
	#ifdef USE_RETROREFLECTION
		#ifdef USE_ANISOTROPY
			vec3 retroIBLRadiance = getIBLAnisotropyRetroRadiance( geometryViewDir, geometryNormal, material.roughness, material.anisotropyB, material.anisotropy );
		#else
			vec3 retroIBLRadiance = getIBLRetroRadiance( geometryViewDir, geometryNormal, material.roughness );
		#endif
		iblRadiance = mix( iblRadiance, retroIBLRadiance, saturate( material.retroreflectivity ) );
	#endif
	radiance += iblRadiance;
	#ifdef USE_CLEARCOAT
		clearcoatRadiance += getIBLRadiance( geometryViewDir, geometryClearcoatNormal, material.clearcoatRoughness );
	#endif
#endif`,IM=`#if defined( RE_IndirectDiffuse )
	#if defined( LAMBERT ) || defined( PHONG )
		irradiance += iblIrradiance;
	#endif
	RE_IndirectDiffuse( irradiance, geometryPosition, geometryNormal, geometryViewDir, geometryClearcoatNormal, material, reflectedLight );
#endif
#if defined( RE_IndirectSpecular )
	RE_IndirectSpecular( radiance, iblIrradiance, clearcoatRadiance, geometryPosition, geometryNormal, geometryViewDir, geometryClearcoatNormal, material, reflectedLight );
#endif`,PM=`#if NUM_LIGHT_PROBE_GRIDS > 0
uniform highp sampler3D probesSH[ NUM_LIGHT_PROBE_GRIDS ];
uniform vec3 probesMin[ NUM_LIGHT_PROBE_GRIDS ];
uniform vec3 probesMax[ NUM_LIGHT_PROBE_GRIDS ];
uniform vec3 probesResolution[ NUM_LIGHT_PROBE_GRIDS ];
bool isInsideLightProbeGrid( vec3 worldPos, vec3 worldNormal, vec3 probesMin, vec3 probesMax, vec3 probesResolution ) {
	vec3 spacing = ( probesMax - probesMin ) / probesResolution;
	vec3 samplePos = worldPos + worldNormal * spacing * 0.5;
	vec3 margin = spacing * 0.01;
	return all( greaterThanEqual( samplePos, probesMin - margin ) ) && all( lessThanEqual( samplePos, probesMax + margin ) );
}
vec3 getLightProbeGridIrradiance( highp sampler3D probesSH, vec3 probesMin, vec3 probesMax, vec3 probesResolution, vec3 worldPos, vec3 worldNormal ) {
	vec3 res = probesResolution;
	vec3 gridRange = probesMax - probesMin;
	vec3 probeSpacing = gridRange / res;
	vec3 samplePos = worldPos + worldNormal * probeSpacing * 0.5;
	vec3 uvw = clamp( ( samplePos - probesMin ) / gridRange, 0.5 / res, 1.0 - 0.5 / res );
	float nz          = res.z;
	float paddedSlices = nz + 2.0;
	float atlasDepth  = 7.0 * paddedSlices;
	float uvZBase     = uvw.z * nz + 1.0;
	vec4 s0 = texture( probesSH, vec3( uvw.xy, ( uvZBase                       ) / atlasDepth ) );
	vec4 s1 = texture( probesSH, vec3( uvw.xy, ( uvZBase +       paddedSlices   ) / atlasDepth ) );
	vec4 s2 = texture( probesSH, vec3( uvw.xy, ( uvZBase + 2.0 * paddedSlices   ) / atlasDepth ) );
	vec4 s3 = texture( probesSH, vec3( uvw.xy, ( uvZBase + 3.0 * paddedSlices   ) / atlasDepth ) );
	vec4 s4 = texture( probesSH, vec3( uvw.xy, ( uvZBase + 4.0 * paddedSlices   ) / atlasDepth ) );
	vec4 s5 = texture( probesSH, vec3( uvw.xy, ( uvZBase + 5.0 * paddedSlices   ) / atlasDepth ) );
	vec4 s6 = texture( probesSH, vec3( uvw.xy, ( uvZBase + 6.0 * paddedSlices   ) / atlasDepth ) );
	vec3 c0 = s0.xyz;
	vec3 c1 = vec3( s0.w, s1.xy );
	vec3 c2 = vec3( s1.zw, s2.x );
	vec3 c3 = s2.yzw;
	vec3 c4 = s3.xyz;
	vec3 c5 = vec3( s3.w, s4.xy );
	vec3 c6 = vec3( s4.zw, s5.x );
	vec3 c7 = s5.yzw;
	vec3 c8 = s6.xyz;
	float x = worldNormal.x, y = worldNormal.y, z = worldNormal.z;
	vec3 result = c0 * 0.886227;
	result += c1 * 2.0 * 0.511664 * y;
	result += c2 * 2.0 * 0.511664 * z;
	result += c3 * 2.0 * 0.511664 * x;
	result += c4 * 2.0 * 0.429043 * x * y;
	result += c5 * 2.0 * 0.429043 * y * z;
	result += c6 * ( 0.743125 * z * z - 0.247708 );
	result += c7 * 2.0 * 0.429043 * x * z;
	result += c8 * 0.429043 * ( x * x - y * y );
	return max( result, vec3( 0.0 ) );
}
#endif`,LM=`#if defined( USE_LOGARITHMIC_DEPTH_BUFFER )
	gl_FragDepth = vIsPerspective == 0.0 ? gl_FragCoord.z : log2( vFragDepth ) * logDepthBufFC * 0.5;
#endif`,DM=`#if defined( USE_LOGARITHMIC_DEPTH_BUFFER )
	uniform float logDepthBufFC;
	varying float vFragDepth;
	varying float vIsPerspective;
#endif`,NM=`#ifdef USE_LOGARITHMIC_DEPTH_BUFFER
	varying float vFragDepth;
	varying float vIsPerspective;
#endif`,UM=`#ifdef USE_LOGARITHMIC_DEPTH_BUFFER
	vFragDepth = 1.0 + gl_Position.w;
	vIsPerspective = float( isPerspectiveMatrix( projectionMatrix ) );
#endif`,OM=`#ifdef USE_MAP
	vec4 sampledDiffuseColor = texture2D( map, vMapUv );
	#ifdef DECODE_VIDEO_TEXTURE
		sampledDiffuseColor = sRGBTransferEOTF( sampledDiffuseColor );
	#endif
	diffuseColor *= sampledDiffuseColor;
#endif`,FM=`#ifdef USE_MAP
	uniform sampler2D map;
#endif`,BM=`#if defined( USE_MAP ) || defined( USE_ALPHAMAP )
	#if defined( USE_POINTS_UV )
		vec2 uv = vUv;
	#else
		vec2 uv = ( uvTransform * vec3( gl_PointCoord.x, 1.0 - gl_PointCoord.y, 1 ) ).xy;
	#endif
#endif
#ifdef USE_MAP
	diffuseColor *= texture2D( map, uv );
#endif
#ifdef USE_ALPHAMAP
	diffuseColor.a *= texture2D( alphaMap, uv ).g;
#endif`,kM=`#if defined( USE_POINTS_UV )
	varying vec2 vUv;
#else
	#if defined( USE_MAP ) || defined( USE_ALPHAMAP )
		uniform mat3 uvTransform;
	#endif
#endif
#ifdef USE_MAP
	uniform sampler2D map;
#endif
#ifdef USE_ALPHAMAP
	uniform sampler2D alphaMap;
#endif`,zM=`float metalnessFactor = metalness;
#ifdef USE_METALNESSMAP
	vec4 texelMetalness = texture2D( metalnessMap, vMetalnessMapUv );
	metalnessFactor *= texelMetalness.b;
#endif`,HM=`#ifdef USE_METALNESSMAP
	uniform sampler2D metalnessMap;
#endif`,GM=`#ifdef USE_INSTANCING_MORPH
	float morphTargetInfluences[ MORPHTARGETS_COUNT ];
	float morphTargetBaseInfluence = texelFetch( morphTexture, ivec2( 0, gl_InstanceID ), 0 ).r;
	for ( int i = 0; i < MORPHTARGETS_COUNT; i ++ ) {
		morphTargetInfluences[i] =  texelFetch( morphTexture, ivec2( i + 1, gl_InstanceID ), 0 ).r;
	}
#endif`,VM=`#if defined( USE_MORPHCOLORS )
	#if defined( USE_COLOR_ALPHA )
		vColor *= morphTargetBaseInfluence;
	#elif defined( USE_COLOR )
		vColor.rgb *= morphTargetBaseInfluence;
	#endif
	for ( int i = 0; i < MORPHTARGETS_COUNT; i ++ ) {
		#if defined( USE_COLOR_ALPHA )
			if ( morphTargetInfluences[ i ] != 0.0 ) vColor += getMorph( gl_VertexID, i, 2 ) * morphTargetInfluences[ i ];
		#elif defined( USE_COLOR )
			if ( morphTargetInfluences[ i ] != 0.0 ) vColor.rgb += getMorph( gl_VertexID, i, 2 ).rgb * morphTargetInfluences[ i ];
		#endif
	}
#endif`,WM=`#ifdef USE_MORPHNORMALS
	objectNormal *= morphTargetBaseInfluence;
	for ( int i = 0; i < MORPHTARGETS_COUNT; i ++ ) {
		if ( morphTargetInfluences[ i ] != 0.0 ) objectNormal += getMorph( gl_VertexID, i, 1 ).xyz * morphTargetInfluences[ i ];
	}
#endif`,XM=`#ifdef USE_MORPHTARGETS
	#ifndef USE_INSTANCING_MORPH
		uniform float morphTargetBaseInfluence;
		uniform float morphTargetInfluences[ MORPHTARGETS_COUNT ];
	#endif
	uniform sampler2DArray morphTargetsTexture;
	uniform ivec2 morphTargetsTextureSize;
	vec4 getMorph( const in int vertexIndex, const in int morphTargetIndex, const in int offset ) {
		int texelIndex = vertexIndex * MORPHTARGETS_TEXTURE_STRIDE + offset;
		int y = texelIndex / morphTargetsTextureSize.x;
		int x = texelIndex - y * morphTargetsTextureSize.x;
		ivec3 morphUV = ivec3( x, y, morphTargetIndex );
		return texelFetch( morphTargetsTexture, morphUV, 0 );
	}
#endif`,qM=`#ifdef USE_MORPHTARGETS
	transformed *= morphTargetBaseInfluence;
	for ( int i = 0; i < MORPHTARGETS_COUNT; i ++ ) {
		if ( morphTargetInfluences[ i ] != 0.0 ) transformed += getMorph( gl_VertexID, i, 0 ).xyz * morphTargetInfluences[ i ];
	}
#endif`,YM=`float faceDirection = gl_FrontFacing ? 1.0 : - 1.0;
#ifdef FLAT_SHADED
	vec3 fdx = dFdx( vViewPosition );
	vec3 fdy = dFdy( vViewPosition );
	vec3 normal = normalize( cross( fdx, fdy ) );
#else
	vec3 normal = normalize( vNormal );
	#ifdef DOUBLE_SIDED
		normal *= faceDirection;
	#endif
#endif
#if defined( USE_NORMALMAP_TANGENTSPACE ) || defined( USE_CLEARCOAT_NORMALMAP ) || defined( USE_ANISOTROPY )
	#ifdef USE_TANGENT
		mat3 tbn = mat3( normalize( vTangent ), normalize( vBitangent ), normal );
	#else
		mat3 tbn = getTangentFrame( - vViewPosition, normal,
		#if defined( USE_NORMALMAP )
			vNormalMapUv
		#elif defined( USE_CLEARCOAT_NORMALMAP )
			vClearcoatNormalMapUv
		#else
			vUv
		#endif
		);
	#endif
	#ifdef DOUBLE_SIDED
		tbn[0] *= faceDirection;
		tbn[1] *= faceDirection;
	#endif
#endif
#ifdef USE_CLEARCOAT_NORMALMAP
	#ifdef USE_TANGENT
		mat3 tbn2 = mat3( normalize( vTangent ), normalize( vBitangent ), normal );
	#else
		mat3 tbn2 = getTangentFrame( - vViewPosition, normal, vClearcoatNormalMapUv );
	#endif
	#ifdef DOUBLE_SIDED
		tbn2[0] *= faceDirection;
		tbn2[1] *= faceDirection;
	#endif
#endif
vec3 nonPerturbedNormal = normal;`,ZM=`#ifdef USE_NORMALMAP_OBJECTSPACE
	normal = texture2D( normalMap, vNormalMapUv ).xyz * 2.0 - 1.0;
	#ifdef FLIP_SIDED
		normal = - normal;
	#endif
	#ifdef DOUBLE_SIDED
		normal = normal * faceDirection;
	#endif
	normal = normalize( normalMatrix * normal );
#elif defined( USE_NORMALMAP_TANGENTSPACE )
	vec3 mapN = texture2D( normalMap, vNormalMapUv ).xyz * 2.0 - 1.0;
	#if defined( USE_PACKED_NORMALMAP )
		mapN = vec3( mapN.xy, sqrt( saturate( 1.0 - dot( mapN.xy, mapN.xy ) ) ) );
	#endif
	mapN.xy *= normalScale;
	normal = normalize( tbn * mapN );
#elif defined( USE_BUMPMAP )
	normal = perturbNormalArb( - vViewPosition, normal, dHdxy_fwd(), faceDirection );
#endif`,KM=`#ifndef FLAT_SHADED
	varying vec3 vNormal;
	#ifdef USE_TANGENT
		varying vec3 vTangent;
		varying vec3 vBitangent;
	#endif
#endif`,$M=`#ifndef FLAT_SHADED
	varying vec3 vNormal;
	#ifdef USE_TANGENT
		varying vec3 vTangent;
		varying vec3 vBitangent;
	#endif
#endif`,JM=`#ifndef FLAT_SHADED
	vNormal = normalize( transformedNormal );
	#ifdef USE_TANGENT
		vTangent = normalize( transformedTangent );
		vBitangent = normalize( cross( vNormal, vTangent ) * tangent.w );
		#ifdef FLIP_SIDED
			vBitangent = - vBitangent;
		#endif
	#endif
#endif`,jM=`#ifdef USE_NORMALMAP
	uniform sampler2D normalMap;
	uniform vec2 normalScale;
#endif
#ifdef USE_NORMALMAP_OBJECTSPACE
	uniform mat3 normalMatrix;
#endif
#if ! defined ( USE_TANGENT ) && ( defined ( USE_NORMALMAP_TANGENTSPACE ) || defined ( USE_CLEARCOAT_NORMALMAP ) || defined( USE_ANISOTROPY ) )
	mat3 getTangentFrame( vec3 eye_pos, vec3 surf_norm, vec2 uv ) {
		vec3 q0 = dFdx( eye_pos.xyz );
		vec3 q1 = dFdy( eye_pos.xyz );
		vec2 st0 = dFdx( uv.st );
		vec2 st1 = dFdy( uv.st );
		vec3 N = surf_norm;
		vec3 q1perp = cross( q1, N );
		vec3 q0perp = cross( N, q0 );
		vec3 T = q1perp * st0.x + q0perp * st1.x;
		vec3 B = q1perp * st0.y + q0perp * st1.y;
		float det = max( dot( T, T ), dot( B, B ) );
		float scale = ( det == 0.0 ) ? 0.0 : inversesqrt( det );
		return mat3( T * scale, B * scale, N );
	}
#endif`,QM=`#ifdef USE_CLEARCOAT
	vec3 clearcoatNormal = nonPerturbedNormal;
#endif`,eb=`#ifdef USE_CLEARCOAT_NORMALMAP
	vec3 clearcoatMapN = texture2D( clearcoatNormalMap, vClearcoatNormalMapUv ).xyz * 2.0 - 1.0;
	clearcoatMapN.xy *= clearcoatNormalScale;
	clearcoatNormal = normalize( tbn2 * clearcoatMapN );
#endif`,tb=`#ifdef USE_CLEARCOATMAP
	uniform sampler2D clearcoatMap;
#endif
#ifdef USE_CLEARCOAT_NORMALMAP
	uniform sampler2D clearcoatNormalMap;
	uniform vec2 clearcoatNormalScale;
#endif
#ifdef USE_CLEARCOAT_ROUGHNESSMAP
	uniform sampler2D clearcoatRoughnessMap;
#endif`,nb=`#ifdef USE_IRIDESCENCEMAP
	uniform sampler2D iridescenceMap;
#endif
#ifdef USE_IRIDESCENCE_THICKNESSMAP
	uniform sampler2D iridescenceThicknessMap;
#endif`,ib=`#ifdef OPAQUE
diffuseColor.a = 1.0;
#endif
#ifdef USE_TRANSMISSION
diffuseColor.a *= material.transmissionAlpha;
#endif
gl_FragColor = vec4( outgoingLight, diffuseColor.a );`,sb=`vec3 packNormalToRGB( const in vec3 normal ) {
	return normalize( normal ) * 0.5 + 0.5;
}
vec3 unpackRGBToNormal( const in vec3 rgb ) {
	return 2.0 * rgb.xyz - 1.0;
}
const float PackUpscale = 256. / 255.;const float UnpackDownscale = 255. / 256.;const float ShiftRight8 = 1. / 256.;
const float Inv255 = 1. / 255.;
const vec4 PackFactors = vec4( 1.0, 256.0, 256.0 * 256.0, 256.0 * 256.0 * 256.0 );
const vec2 UnpackFactors2 = vec2( UnpackDownscale, 1.0 / PackFactors.g );
const vec3 UnpackFactors3 = vec3( UnpackDownscale / PackFactors.rg, 1.0 / PackFactors.b );
const vec4 UnpackFactors4 = vec4( UnpackDownscale / PackFactors.rgb, 1.0 / PackFactors.a );
vec4 packDepthToRGBA( const in float v ) {
	if( v <= 0.0 )
		return vec4( 0., 0., 0., 0. );
	if( v >= 1.0 )
		return vec4( 1., 1., 1., 1. );
	float vuf;
	float af = modf( v * PackFactors.a, vuf );
	float bf = modf( vuf * ShiftRight8, vuf );
	float gf = modf( vuf * ShiftRight8, vuf );
	return vec4( vuf * Inv255, gf * PackUpscale, bf * PackUpscale, af );
}
vec3 packDepthToRGB( const in float v ) {
	if( v <= 0.0 )
		return vec3( 0., 0., 0. );
	if( v >= 1.0 )
		return vec3( 1., 1., 1. );
	float vuf;
	float bf = modf( v * PackFactors.b, vuf );
	float gf = modf( vuf * ShiftRight8, vuf );
	return vec3( vuf * Inv255, gf * PackUpscale, bf );
}
vec2 packDepthToRG( const in float v ) {
	if( v <= 0.0 )
		return vec2( 0., 0. );
	if( v >= 1.0 )
		return vec2( 1., 1. );
	float vuf;
	float gf = modf( v * 256., vuf );
	return vec2( vuf * Inv255, gf );
}
float unpackRGBAToDepth( const in vec4 v ) {
	return dot( v, UnpackFactors4 );
}
float unpackRGBToDepth( const in vec3 v ) {
	return dot( v, UnpackFactors3 );
}
float unpackRGToDepth( const in vec2 v ) {
	return v.r * UnpackFactors2.r + v.g * UnpackFactors2.g;
}
vec4 pack2HalfToRGBA( const in vec2 v ) {
	vec4 r = vec4( v.x, fract( v.x * 255.0 ), v.y, fract( v.y * 255.0 ) );
	return vec4( r.x - r.y / 255.0, r.y, r.z - r.w / 255.0, r.w );
}
vec2 unpackRGBATo2Half( const in vec4 v ) {
	return vec2( v.x + ( v.y / 255.0 ), v.z + ( v.w / 255.0 ) );
}
float viewZToOrthographicDepth( const in float viewZ, const in float near, const in float far ) {
	return ( viewZ + near ) / ( near - far );
}
float orthographicDepthToViewZ( const in float depth, const in float near, const in float far ) {
	#ifdef USE_REVERSED_DEPTH_BUFFER
	
		return depth * ( far - near ) - far;
	#else
		return depth * ( near - far ) - near;
	#endif
}
float viewZToPerspectiveDepth( const in float viewZ, const in float near, const in float far ) {
	return ( ( near + viewZ ) * far ) / ( ( far - near ) * viewZ );
}
float perspectiveDepthToViewZ( const in float depth, const in float near, const in float far ) {
	
	#ifdef USE_REVERSED_DEPTH_BUFFER
		return ( near * far ) / ( ( near - far ) * depth - near );
	#else
		return ( near * far ) / ( ( far - near ) * depth - far );
	#endif
}`,rb=`#ifdef PREMULTIPLIED_ALPHA
	gl_FragColor.rgb *= gl_FragColor.a;
#endif`,ob=`vec4 mvPosition = vec4( transformed, 1.0 );
#ifdef USE_BATCHING
	mvPosition = batchingMatrix * mvPosition;
#endif
#ifdef USE_INSTANCING
	mvPosition = instanceMatrix * mvPosition;
#endif
mvPosition = modelViewMatrix * mvPosition;
gl_Position = projectionMatrix * mvPosition;`,ab=`#ifdef DITHERING
	gl_FragColor.rgb = dithering( gl_FragColor.rgb );
#endif`,lb=`#ifdef DITHERING
	vec3 dithering( vec3 color ) {
		float grid_position = rand( gl_FragCoord.xy );
		vec3 dither_shift_RGB = vec3( 0.25 / 255.0, -0.25 / 255.0, 0.25 / 255.0 );
		dither_shift_RGB = mix( 2.0 * dither_shift_RGB, -2.0 * dither_shift_RGB, grid_position );
		return color + dither_shift_RGB;
	}
#endif`,cb=`float roughnessFactor = roughness;
#ifdef USE_ROUGHNESSMAP
	vec4 texelRoughness = texture2D( roughnessMap, vRoughnessMapUv );
	roughnessFactor *= texelRoughness.g;
#endif`,hb=`#ifdef USE_ROUGHNESSMAP
	uniform sampler2D roughnessMap;
#endif`,ub=`#if NUM_SPOT_LIGHT_COORDS > 0
	varying vec4 vSpotLightCoord[ NUM_SPOT_LIGHT_COORDS ];
#endif
#if NUM_SPOT_LIGHT_MAPS > 0
	uniform sampler2D spotLightMap[ NUM_SPOT_LIGHT_MAPS ];
#endif
#ifdef USE_SHADOWMAP
	#if NUM_SUN_LIGHT_SHADOWS > 0
		#define SUN_LIGHT_CASCADES 2
		#if defined( SHADOWMAP_TYPE_PCF )
			uniform sampler2DShadow sunShadowMap[ NUM_SUN_LIGHT_SHADOWS ];
		#else
			uniform sampler2D sunShadowMap[ NUM_SUN_LIGHT_SHADOWS ];
		#endif
		uniform mat4 sunShadowMatrix[ NUM_SUN_LIGHT_SHADOWS * SUN_LIGHT_CASCADES ];
		uniform vec4 sunShadowCascade[ NUM_SUN_LIGHT_SHADOWS * SUN_LIGHT_CASCADES ];
		varying vec4 vSunShadowWorldPosition;
		varying vec3 vSunShadowWorldNormal;
		struct SunLightShadow {
			float shadowIntensity;
			float shadowBias;
			float shadowNormalBias;
			float shadowRadius;
			vec2 shadowMapSize;
		};
		uniform SunLightShadow sunLightShadows[ NUM_SUN_LIGHT_SHADOWS ];
	#endif
	#if NUM_DIR_LIGHT_SHADOWS > 0
		#if defined( SHADOWMAP_TYPE_PCF )
			uniform sampler2DShadow directionalShadowMap[ NUM_DIR_LIGHT_SHADOWS ];
		#else
			uniform sampler2D directionalShadowMap[ NUM_DIR_LIGHT_SHADOWS ];
		#endif
		varying vec4 vDirectionalShadowCoord[ NUM_DIR_LIGHT_SHADOWS ];
		struct DirectionalLightShadow {
			float shadowIntensity;
			float shadowBias;
			float shadowNormalBias;
			float shadowRadius;
			vec2 shadowMapSize;
		};
		uniform DirectionalLightShadow directionalLightShadows[ NUM_DIR_LIGHT_SHADOWS ];
	#endif
	#if NUM_SPOT_LIGHT_SHADOWS > 0
		#if defined( SHADOWMAP_TYPE_PCF )
			uniform sampler2DShadow spotShadowMap[ NUM_SPOT_LIGHT_SHADOWS ];
		#else
			uniform sampler2D spotShadowMap[ NUM_SPOT_LIGHT_SHADOWS ];
		#endif
		struct SpotLightShadow {
			float shadowIntensity;
			float shadowBias;
			float shadowNormalBias;
			float shadowRadius;
			vec2 shadowMapSize;
		};
		uniform SpotLightShadow spotLightShadows[ NUM_SPOT_LIGHT_SHADOWS ];
	#endif
	#if NUM_POINT_LIGHT_SHADOWS > 0
		#if defined( SHADOWMAP_TYPE_PCF )
			uniform samplerCubeShadow pointShadowMap[ NUM_POINT_LIGHT_SHADOWS ];
		#elif defined( SHADOWMAP_TYPE_BASIC )
			uniform samplerCube pointShadowMap[ NUM_POINT_LIGHT_SHADOWS ];
		#endif
		varying vec4 vPointShadowCoord[ NUM_POINT_LIGHT_SHADOWS ];
		struct PointLightShadow {
			float shadowIntensity;
			float shadowBias;
			float shadowNormalBias;
			float shadowRadius;
			vec2 shadowMapSize;
			float shadowCameraNear;
			float shadowCameraFar;
		};
		uniform PointLightShadow pointLightShadows[ NUM_POINT_LIGHT_SHADOWS ];
	#endif
	#if defined( SHADOWMAP_TYPE_PCF )
		float interleavedGradientNoise( vec2 position ) {
			return fract( 52.9829189 * fract( dot( position, vec2( 0.06711056, 0.00583715 ) ) ) );
		}
		vec2 vogelDiskSample( int sampleIndex, int samplesCount, float phi ) {
			const float goldenAngle = 2.399963229728653;
			float r = sqrt( ( float( sampleIndex ) + 0.5 ) / float( samplesCount ) );
			float theta = float( sampleIndex ) * goldenAngle + phi;
			return vec2( cos( theta ), sin( theta ) ) * r;
		}
	#endif
	#if defined( SHADOWMAP_TYPE_PCF )
		float getShadow( sampler2DShadow shadowMap, vec2 shadowMapSize, float shadowIntensity, float shadowBias, float shadowRadius, vec4 shadowCoord ) {
			float shadow = 1.0;
			shadowCoord.xyz /= shadowCoord.w;
			#ifdef USE_REVERSED_DEPTH_BUFFER
				shadowCoord.z -= shadowBias;
			#else
				shadowCoord.z += shadowBias;
			#endif
			bool inFrustum = shadowCoord.x >= 0.0 && shadowCoord.x <= 1.0 && shadowCoord.y >= 0.0 && shadowCoord.y <= 1.0;
			bool frustumTest = inFrustum && shadowCoord.z <= 1.0;
			if ( frustumTest ) {
				vec2 texelSize = vec2( 1.0 ) / shadowMapSize;
				vec2 radius = shadowRadius * texelSize;
				float phi = interleavedGradientNoise( gl_FragCoord.xy ) * PI2;
				shadow = (
					texture( shadowMap, vec3( shadowCoord.xy + vogelDiskSample( 0, 5, phi ) * radius, shadowCoord.z ) ) +
					texture( shadowMap, vec3( shadowCoord.xy + vogelDiskSample( 1, 5, phi ) * radius, shadowCoord.z ) ) +
					texture( shadowMap, vec3( shadowCoord.xy + vogelDiskSample( 2, 5, phi ) * radius, shadowCoord.z ) ) +
					texture( shadowMap, vec3( shadowCoord.xy + vogelDiskSample( 3, 5, phi ) * radius, shadowCoord.z ) ) +
					texture( shadowMap, vec3( shadowCoord.xy + vogelDiskSample( 4, 5, phi ) * radius, shadowCoord.z ) )
				) * 0.2;
			}
			return mix( 1.0, shadow, shadowIntensity );
		}
	#elif defined( SHADOWMAP_TYPE_VSM )
		float getShadow( sampler2D shadowMap, vec2 shadowMapSize, float shadowIntensity, float shadowBias, float shadowRadius, vec4 shadowCoord ) {
			float shadow = 1.0;
			shadowCoord.xyz /= shadowCoord.w;
			#ifdef USE_REVERSED_DEPTH_BUFFER
				shadowCoord.z -= shadowBias;
			#else
				shadowCoord.z += shadowBias;
			#endif
			bool inFrustum = shadowCoord.x >= 0.0 && shadowCoord.x <= 1.0 && shadowCoord.y >= 0.0 && shadowCoord.y <= 1.0;
			bool frustumTest = inFrustum && shadowCoord.z <= 1.0;
			if ( frustumTest ) {
				vec2 distribution = texture2D( shadowMap, shadowCoord.xy ).rg;
				float mean = distribution.x;
				float variance = distribution.y * distribution.y;
				#ifdef USE_REVERSED_DEPTH_BUFFER
					float hard_shadow = step( mean, shadowCoord.z );
				#else
					float hard_shadow = step( shadowCoord.z, mean );
				#endif
				
				if ( hard_shadow == 1.0 ) {
					shadow = 1.0;
				} else {
					variance = max( variance, 0.0000001 );
					float d = shadowCoord.z - mean;
					float p_max = variance / ( variance + d * d );
					p_max = clamp( ( p_max - 0.3 ) / 0.65, 0.0, 1.0 );
					shadow = max( hard_shadow, p_max );
				}
			}
			return mix( 1.0, shadow, shadowIntensity );
		}
	#else
		float getShadow( sampler2D shadowMap, vec2 shadowMapSize, float shadowIntensity, float shadowBias, float shadowRadius, vec4 shadowCoord ) {
			float shadow = 1.0;
			shadowCoord.xyz /= shadowCoord.w;
			#ifdef USE_REVERSED_DEPTH_BUFFER
				shadowCoord.z -= shadowBias;
			#else
				shadowCoord.z += shadowBias;
			#endif
			bool inFrustum = shadowCoord.x >= 0.0 && shadowCoord.x <= 1.0 && shadowCoord.y >= 0.0 && shadowCoord.y <= 1.0;
			bool frustumTest = inFrustum && shadowCoord.z <= 1.0;
			if ( frustumTest ) {
				float depth = texture2D( shadowMap, shadowCoord.xy ).r;
				#ifdef USE_REVERSED_DEPTH_BUFFER
					shadow = step( depth, shadowCoord.z );
				#else
					shadow = step( shadowCoord.z, depth );
				#endif
			}
			return mix( 1.0, shadow, shadowIntensity );
		}
	#endif
	#if NUM_SUN_LIGHT_SHADOWS > 0
		float getSunShadow(
			#if defined( SHADOWMAP_TYPE_PCF )
				sampler2DShadow shadowMap,
			#else
				sampler2D shadowMap,
			#endif
			SunLightShadow sunLightShadow,
			int shadowIndex
		) {
			vec4 shadowWorldPosition = vec4( vSunShadowWorldPosition.xyz + vSunShadowWorldNormal * sunLightShadow.shadowNormalBias, 1.0 );
			float viewDepth = vSunShadowWorldPosition.w;
			int cascadeOffset = shadowIndex * SUN_LIGHT_CASCADES;
			float shadow = 1.0;
			for ( int i = SUN_LIGHT_CASCADES - 1; i >= 0; i -- ) {
				vec4 cascade = sunShadowCascade[ cascadeOffset + i ];
				if ( viewDepth >= cascade.x && viewDepth < cascade.y ) {
					float cascadeShadow = getShadow(
						shadowMap,
						sunLightShadow.shadowMapSize,
						sunLightShadow.shadowIntensity,
						sunLightShadow.shadowBias,
						sunLightShadow.shadowRadius,
						sunShadowMatrix[ cascadeOffset + i ] * shadowWorldPosition
					);
					shadow = mix( cascadeShadow, shadow, smoothstep( cascade.z, cascade.y, viewDepth ) );
				}
			}
			return shadow;
		}
	#endif
	#if NUM_POINT_LIGHT_SHADOWS > 0
	#if defined( SHADOWMAP_TYPE_PCF )
	float getPointShadow( samplerCubeShadow shadowMap, vec2 shadowMapSize, float shadowIntensity, float shadowBias, float shadowRadius, vec4 shadowCoord, float shadowCameraNear, float shadowCameraFar ) {
		float shadow = 1.0;
		vec3 lightToPosition = shadowCoord.xyz;
		vec3 bd3D = normalize( lightToPosition );
		vec3 absVec = abs( lightToPosition );
		float viewSpaceZ = max( max( absVec.x, absVec.y ), absVec.z );
		if ( viewSpaceZ - shadowCameraFar <= 0.0 && viewSpaceZ - shadowCameraNear >= 0.0 ) {
			float lightDistance = length( lightToPosition );
			float depthRange = shadowCameraFar - shadowCameraNear;
			#ifdef USE_REVERSED_DEPTH_BUFFER
				float depthA = - shadowCameraNear / depthRange - shadowBias;
				float depthB = shadowCameraNear * shadowCameraFar / ( depthRange * lightDistance );
			#else
				float depthA = shadowCameraFar / depthRange + shadowBias;
				float depthB = - shadowCameraNear * shadowCameraFar / ( depthRange * lightDistance );
			#endif
			float texelSize = shadowRadius / shadowMapSize.x;
			vec3 absDir = abs( bd3D );
			vec3 tangent = absDir.x > absDir.z ? vec3( 0.0, 1.0, 0.0 ) : vec3( 1.0, 0.0, 0.0 );
			tangent = normalize( cross( bd3D, tangent ) );
			vec3 bitangent = cross( bd3D, tangent );
			float phi = interleavedGradientNoise( gl_FragCoord.xy ) * PI2;
			shadow = 0.0;
			for ( int i = 0; i < 5; i ++ ) {
				vec2 offset = vogelDiskSample( i, 5, phi );
				vec3 direction = bd3D + ( tangent * offset.x + bitangent * offset.y ) * texelSize;
				vec3 absDirection = abs( direction );
				float dp = depthA + depthB / max( max( absDirection.x, absDirection.y ), absDirection.z );
				shadow += texture( shadowMap, vec4( direction, dp ) );
			}
			shadow *= 0.2;
		}
		return mix( 1.0, shadow, shadowIntensity );
	}
	#elif defined( SHADOWMAP_TYPE_BASIC )
	float getPointShadow( samplerCube shadowMap, vec2 shadowMapSize, float shadowIntensity, float shadowBias, float shadowRadius, vec4 shadowCoord, float shadowCameraNear, float shadowCameraFar ) {
		float shadow = 1.0;
		vec3 lightToPosition = shadowCoord.xyz;
		vec3 absVec = abs( lightToPosition );
		float viewSpaceZ = max( max( absVec.x, absVec.y ), absVec.z );
		if ( viewSpaceZ - shadowCameraFar <= 0.0 && viewSpaceZ - shadowCameraNear >= 0.0 ) {
			float dp = ( shadowCameraFar * ( viewSpaceZ - shadowCameraNear ) ) / ( viewSpaceZ * ( shadowCameraFar - shadowCameraNear ) );
			dp += shadowBias;
			vec3 bd3D = normalize( lightToPosition );
			float depth = textureCube( shadowMap, bd3D ).r;
			#ifdef USE_REVERSED_DEPTH_BUFFER
				depth = 1.0 - depth;
			#endif
			shadow = step( dp, depth );
		}
		return mix( 1.0, shadow, shadowIntensity );
	}
	#endif
	#endif
#endif`,fb=`#if NUM_SPOT_LIGHT_COORDS > 0
	uniform mat4 spotLightMatrix[ NUM_SPOT_LIGHT_COORDS ];
	varying vec4 vSpotLightCoord[ NUM_SPOT_LIGHT_COORDS ];
#endif
#ifdef USE_SHADOWMAP
	#if NUM_SUN_LIGHT_SHADOWS > 0
		varying vec4 vSunShadowWorldPosition;
		varying vec3 vSunShadowWorldNormal;
	#endif
	#if NUM_DIR_LIGHT_SHADOWS > 0
		uniform mat4 directionalShadowMatrix[ NUM_DIR_LIGHT_SHADOWS ];
		varying vec4 vDirectionalShadowCoord[ NUM_DIR_LIGHT_SHADOWS ];
		struct DirectionalLightShadow {
			float shadowIntensity;
			float shadowBias;
			float shadowNormalBias;
			float shadowRadius;
			vec2 shadowMapSize;
		};
		uniform DirectionalLightShadow directionalLightShadows[ NUM_DIR_LIGHT_SHADOWS ];
	#endif
	#if NUM_SPOT_LIGHT_SHADOWS > 0
		struct SpotLightShadow {
			float shadowIntensity;
			float shadowBias;
			float shadowNormalBias;
			float shadowRadius;
			vec2 shadowMapSize;
		};
		uniform SpotLightShadow spotLightShadows[ NUM_SPOT_LIGHT_SHADOWS ];
	#endif
	#if NUM_POINT_LIGHT_SHADOWS > 0
		uniform mat4 pointShadowMatrix[ NUM_POINT_LIGHT_SHADOWS ];
		varying vec4 vPointShadowCoord[ NUM_POINT_LIGHT_SHADOWS ];
		struct PointLightShadow {
			float shadowIntensity;
			float shadowBias;
			float shadowNormalBias;
			float shadowRadius;
			vec2 shadowMapSize;
			float shadowCameraNear;
			float shadowCameraFar;
		};
		uniform PointLightShadow pointLightShadows[ NUM_POINT_LIGHT_SHADOWS ];
	#endif
#endif`,db=`#if ( defined( USE_SHADOWMAP ) && ( NUM_DIR_LIGHT_SHADOWS > 0 || NUM_SUN_LIGHT_SHADOWS > 0 || NUM_POINT_LIGHT_SHADOWS > 0 ) ) || ( NUM_SPOT_LIGHT_COORDS > 0 )
	#ifdef HAS_NORMAL
		vec3 shadowWorldNormal = transformNormalByInverseViewMatrix( transformedNormal, viewMatrix );
	#else
		vec3 shadowWorldNormal = vec3( 0.0 );
	#endif
	vec4 shadowWorldPosition;
#endif
#if defined( USE_SHADOWMAP )
	#if NUM_SUN_LIGHT_SHADOWS > 0
		vSunShadowWorldPosition = vec4( worldPosition.xyz, - mvPosition.z );
		vSunShadowWorldNormal = shadowWorldNormal;
	#endif
	#if NUM_DIR_LIGHT_SHADOWS > 0
		#pragma unroll_loop_start
		for ( int i = 0; i < NUM_DIR_LIGHT_SHADOWS; i ++ ) {
			shadowWorldPosition = worldPosition + vec4( shadowWorldNormal * directionalLightShadows[ i ].shadowNormalBias, 0 );
			vDirectionalShadowCoord[ i ] = directionalShadowMatrix[ i ] * shadowWorldPosition;
		}
		#pragma unroll_loop_end
	#endif
	#if NUM_POINT_LIGHT_SHADOWS > 0
		#pragma unroll_loop_start
		for ( int i = 0; i < NUM_POINT_LIGHT_SHADOWS; i ++ ) {
			shadowWorldPosition = worldPosition + vec4( shadowWorldNormal * pointLightShadows[ i ].shadowNormalBias, 0 );
			vPointShadowCoord[ i ] = pointShadowMatrix[ i ] * shadowWorldPosition;
		}
		#pragma unroll_loop_end
	#endif
#endif
#if NUM_SPOT_LIGHT_COORDS > 0
	#pragma unroll_loop_start
	for ( int i = 0; i < NUM_SPOT_LIGHT_COORDS; i ++ ) {
		shadowWorldPosition = worldPosition;
		#if ( defined( USE_SHADOWMAP ) && UNROLLED_LOOP_INDEX < NUM_SPOT_LIGHT_SHADOWS )
			shadowWorldPosition.xyz += shadowWorldNormal * spotLightShadows[ i ].shadowNormalBias;
		#endif
		vSpotLightCoord[ i ] = spotLightMatrix[ i ] * shadowWorldPosition;
	}
	#pragma unroll_loop_end
#endif`,pb=`float getShadowMask() {
	float shadow = 1.0;
	#ifdef USE_SHADOWMAP
	#if NUM_SUN_LIGHT_SHADOWS > 0
	SunLightShadow sunLight;
	#pragma unroll_loop_start
	for ( int i = 0; i < NUM_SUN_LIGHT_SHADOWS; i ++ ) {
		sunLight = sunLightShadows[ i ];
		shadow *= receiveShadow ? getSunShadow( sunShadowMap[ i ], sunLight, UNROLLED_LOOP_INDEX ) : 1.0;
	}
	#pragma unroll_loop_end
	#endif
	#if NUM_DIR_LIGHT_SHADOWS > 0
	DirectionalLightShadow directionalLight;
	#pragma unroll_loop_start
	for ( int i = 0; i < NUM_DIR_LIGHT_SHADOWS; i ++ ) {
		directionalLight = directionalLightShadows[ i ];
		shadow *= receiveShadow ? getShadow( directionalShadowMap[ i ], directionalLight.shadowMapSize, directionalLight.shadowIntensity, directionalLight.shadowBias, directionalLight.shadowRadius, vDirectionalShadowCoord[ i ] ) : 1.0;
	}
	#pragma unroll_loop_end
	#endif
	#if NUM_SPOT_LIGHT_SHADOWS > 0
	SpotLightShadow spotLight;
	#pragma unroll_loop_start
	for ( int i = 0; i < NUM_SPOT_LIGHT_SHADOWS; i ++ ) {
		spotLight = spotLightShadows[ i ];
		shadow *= receiveShadow ? getShadow( spotShadowMap[ i ], spotLight.shadowMapSize, spotLight.shadowIntensity, spotLight.shadowBias, spotLight.shadowRadius, vSpotLightCoord[ i ] ) : 1.0;
	}
	#pragma unroll_loop_end
	#endif
	#if NUM_POINT_LIGHT_SHADOWS > 0 && ( defined( SHADOWMAP_TYPE_PCF ) || defined( SHADOWMAP_TYPE_BASIC ) )
	PointLightShadow pointLight;
	#pragma unroll_loop_start
	for ( int i = 0; i < NUM_POINT_LIGHT_SHADOWS; i ++ ) {
		pointLight = pointLightShadows[ i ];
		shadow *= receiveShadow ? getPointShadow( pointShadowMap[ i ], pointLight.shadowMapSize, pointLight.shadowIntensity, pointLight.shadowBias, pointLight.shadowRadius, vPointShadowCoord[ i ], pointLight.shadowCameraNear, pointLight.shadowCameraFar ) : 1.0;
	}
	#pragma unroll_loop_end
	#endif
	#endif
	return shadow;
}`,mb=`#ifdef USE_SKINNING
	mat4 boneMatX = getBoneMatrix( skinIndex.x );
	mat4 boneMatY = getBoneMatrix( skinIndex.y );
	mat4 boneMatZ = getBoneMatrix( skinIndex.z );
	mat4 boneMatW = getBoneMatrix( skinIndex.w );
#endif`,gb=`#ifdef USE_SKINNING
	uniform mat4 bindMatrix;
	uniform mat4 bindMatrixInverse;
	uniform highp sampler2D boneTexture;
	mat4 getBoneMatrix( const in float i ) {
		int size = textureSize( boneTexture, 0 ).x;
		int j = int( i ) * 4;
		int x = j % size;
		int y = j / size;
		vec4 v1 = texelFetch( boneTexture, ivec2( x, y ), 0 );
		vec4 v2 = texelFetch( boneTexture, ivec2( x + 1, y ), 0 );
		vec4 v3 = texelFetch( boneTexture, ivec2( x + 2, y ), 0 );
		vec4 v4 = texelFetch( boneTexture, ivec2( x + 3, y ), 0 );
		return mat4( v1, v2, v3, v4 );
	}
#endif`,_b=`#ifdef USE_SKINNING
	vec4 skinVertex = bindMatrix * vec4( transformed, 1.0 );
	vec4 skinned = vec4( 0.0 );
	skinned += boneMatX * skinVertex * skinWeight.x;
	skinned += boneMatY * skinVertex * skinWeight.y;
	skinned += boneMatZ * skinVertex * skinWeight.z;
	skinned += boneMatW * skinVertex * skinWeight.w;
	transformed = ( bindMatrixInverse * skinned ).xyz;
#endif`,xb=`#ifdef USE_SKINNING
	mat4 skinMatrix = mat4( 0.0 );
	skinMatrix += skinWeight.x * boneMatX;
	skinMatrix += skinWeight.y * boneMatY;
	skinMatrix += skinWeight.z * boneMatZ;
	skinMatrix += skinWeight.w * boneMatW;
	skinMatrix = bindMatrixInverse * skinMatrix * bindMatrix;
	objectNormal = vec4( skinMatrix * vec4( objectNormal, 0.0 ) ).xyz;
	#ifdef USE_TANGENT
		objectTangent = vec4( skinMatrix * vec4( objectTangent, 0.0 ) ).xyz;
	#endif
#endif`,vb=`float specularStrength;
#ifdef USE_SPECULARMAP
	vec4 texelSpecular = texture2D( specularMap, vSpecularMapUv );
	specularStrength = texelSpecular.r;
#else
	specularStrength = 1.0;
#endif`,yb=`#ifdef USE_SPECULARMAP
	uniform sampler2D specularMap;
#endif`,Sb=`#if defined( TONE_MAPPING )
	gl_FragColor.rgb = toneMapping( gl_FragColor.rgb );
#endif`,Mb=`#ifndef saturate
#define saturate( a ) clamp( a, 0.0, 1.0 )
#endif
uniform float toneMappingExposure;
vec3 LinearToneMapping( vec3 color ) {
	return saturate( toneMappingExposure * color );
}
vec3 ReinhardToneMapping( vec3 color ) {
	color *= toneMappingExposure;
	return saturate( color / ( vec3( 1.0 ) + color ) );
}
vec3 CineonToneMapping( vec3 color ) {
	color *= toneMappingExposure;
	color = max( vec3( 0.0 ), color - 0.004 );
	return pow( ( color * ( 6.2 * color + 0.5 ) ) / ( color * ( 6.2 * color + 1.7 ) + 0.06 ), vec3( 2.2 ) );
}
vec3 RRTAndODTFit( vec3 v ) {
	vec3 a = v * ( v + 0.0245786 ) - 0.000090537;
	vec3 b = v * ( 0.983729 * v + 0.4329510 ) + 0.238081;
	return a / b;
}
vec3 ACESFilmicToneMapping( vec3 color ) {
	const mat3 ACESInputMat = mat3(
		vec3( 0.59719, 0.07600, 0.02840 ),		vec3( 0.35458, 0.90834, 0.13383 ),
		vec3( 0.04823, 0.01566, 0.83777 )
	);
	const mat3 ACESOutputMat = mat3(
		vec3(  1.60475, -0.10208, -0.00327 ),		vec3( -0.53108,  1.10813, -0.07276 ),
		vec3( -0.07367, -0.00605,  1.07602 )
	);
	color *= toneMappingExposure / 0.6;
	color = ACESInputMat * color;
	color = RRTAndODTFit( color );
	color = ACESOutputMat * color;
	return saturate( color );
}
const mat3 LINEAR_REC2020_TO_LINEAR_SRGB = mat3(
	vec3( 1.6605, - 0.1246, - 0.0182 ),
	vec3( - 0.5876, 1.1329, - 0.1006 ),
	vec3( - 0.0728, - 0.0083, 1.1187 )
);
const mat3 LINEAR_SRGB_TO_LINEAR_REC2020 = mat3(
	vec3( 0.6274, 0.0691, 0.0164 ),
	vec3( 0.3293, 0.9195, 0.0880 ),
	vec3( 0.0433, 0.0113, 0.8956 )
);
vec3 agxDefaultContrastApprox( vec3 x ) {
	vec3 x2 = x * x;
	vec3 x4 = x2 * x2;
	return + 15.5 * x4 * x2
		- 40.14 * x4 * x
		+ 31.96 * x4
		- 6.868 * x2 * x
		+ 0.4298 * x2
		+ 0.1191 * x
		- 0.00232;
}
vec3 AgXToneMapping( vec3 color ) {
	const mat3 AgXInsetMatrix = mat3(
		vec3( 0.856627153315983, 0.137318972929847, 0.11189821299995 ),
		vec3( 0.0951212405381588, 0.761241990602591, 0.0767994186031903 ),
		vec3( 0.0482516061458583, 0.101439036467562, 0.811302368396859 )
	);
	const mat3 AgXOutsetMatrix = mat3(
		vec3( 1.1271005818144368, - 0.1413297634984383, - 0.14132976349843826 ),
		vec3( - 0.11060664309660323, 1.157823702216272, - 0.11060664309660294 ),
		vec3( - 0.016493938717834573, - 0.016493938717834257, 1.2519364065950405 )
	);
	const float AgxMinEv = - 12.47393;	const float AgxMaxEv = 4.026069;
	color *= toneMappingExposure;
	color = LINEAR_SRGB_TO_LINEAR_REC2020 * color;
	color = AgXInsetMatrix * color;
	color = max( color, 1e-10 );	color = log2( color );
	color = ( color - AgxMinEv ) / ( AgxMaxEv - AgxMinEv );
	color = clamp( color, 0.0, 1.0 );
	color = agxDefaultContrastApprox( color );
	color = AgXOutsetMatrix * color;
	color = pow( max( vec3( 0.0 ), color ), vec3( 2.2 ) );
	color = LINEAR_REC2020_TO_LINEAR_SRGB * color;
	color = clamp( color, 0.0, 1.0 );
	return color;
}
vec3 NeutralToneMapping( vec3 color ) {
	const float StartCompression = 0.8 - 0.04;
	const float Desaturation = 0.15;
	color *= toneMappingExposure;
	float x = min( color.r, min( color.g, color.b ) );
	float offset = x < 0.08 ? x - 6.25 * x * x : 0.04;
	color -= offset;
	float peak = max( color.r, max( color.g, color.b ) );
	if ( peak < StartCompression ) return color;
	float d = 1. - StartCompression;
	float newPeak = 1. - d * d / ( peak + d - StartCompression );
	color *= newPeak / peak;
	float g = 1. - 1. / ( Desaturation * ( peak - newPeak ) + 1. );
	return mix( color, vec3( newPeak ), g );
}
vec3 CustomToneMapping( vec3 color ) { return color; }`,bb=`#ifdef USE_TRANSMISSION
	material.transmission = transmission;
	material.transmissionAlpha = 1.0;
	material.thickness = thickness;
	material.attenuationDistance = attenuationDistance;
	material.attenuationColor = attenuationColor;
	#ifdef USE_TRANSMISSIONMAP
		material.transmission *= texture2D( transmissionMap, vTransmissionMapUv ).r;
	#endif
	#ifdef USE_THICKNESSMAP
		material.thickness *= texture2D( thicknessMap, vThicknessMapUv ).g;
	#endif
	vec3 pos = vWorldPosition;
	vec3 v = normalize( cameraPosition - pos );
	vec3 n = transformNormalByInverseViewMatrix( normal, viewMatrix );
	vec4 transmitted = getIBLVolumeRefraction(
		n, v, material.roughness, material.diffuseContribution, material.specularColorBlended, material.specularF90,
		pos, modelMatrix, viewMatrix, projectionMatrix, material.dispersion, material.ior, material.thickness,
		material.attenuationColor, material.attenuationDistance );
	material.transmissionAlpha = mix( material.transmissionAlpha, transmitted.a, material.transmission );
	totalDiffuse = mix( totalDiffuse, transmitted.rgb, material.transmission );
#endif`,wb=`#ifdef USE_TRANSMISSION
	uniform float transmission;
	uniform float thickness;
	uniform float attenuationDistance;
	uniform vec3 attenuationColor;
	#ifdef USE_TRANSMISSIONMAP
		uniform sampler2D transmissionMap;
	#endif
	#ifdef USE_THICKNESSMAP
		uniform sampler2D thicknessMap;
	#endif
	uniform vec2 transmissionSamplerSize;
	uniform sampler2D transmissionSamplerMap;
	uniform mat4 modelMatrix;
	uniform mat4 projectionMatrix;
	varying vec3 vWorldPosition;
	float w0( float a ) {
		return ( 1.0 / 6.0 ) * ( a * ( a * ( - a + 3.0 ) - 3.0 ) + 1.0 );
	}
	float w1( float a ) {
		return ( 1.0 / 6.0 ) * ( a *  a * ( 3.0 * a - 6.0 ) + 4.0 );
	}
	float w2( float a ){
		return ( 1.0 / 6.0 ) * ( a * ( a * ( - 3.0 * a + 3.0 ) + 3.0 ) + 1.0 );
	}
	float w3( float a ) {
		return ( 1.0 / 6.0 ) * ( a * a * a );
	}
	float g0( float a ) {
		return w0( a ) + w1( a );
	}
	float g1( float a ) {
		return w2( a ) + w3( a );
	}
	float h0( float a ) {
		return - 1.0 + w1( a ) / ( w0( a ) + w1( a ) );
	}
	float h1( float a ) {
		return 1.0 + w3( a ) / ( w2( a ) + w3( a ) );
	}
	vec4 bicubic( sampler2D tex, vec2 uv, vec4 texelSize, float lod ) {
		uv = uv * texelSize.zw + 0.5;
		vec2 iuv = floor( uv );
		vec2 fuv = fract( uv );
		float g0x = g0( fuv.x );
		float g1x = g1( fuv.x );
		float h0x = h0( fuv.x );
		float h1x = h1( fuv.x );
		float h0y = h0( fuv.y );
		float h1y = h1( fuv.y );
		vec2 p0 = ( vec2( iuv.x + h0x, iuv.y + h0y ) - 0.5 ) * texelSize.xy;
		vec2 p1 = ( vec2( iuv.x + h1x, iuv.y + h0y ) - 0.5 ) * texelSize.xy;
		vec2 p2 = ( vec2( iuv.x + h0x, iuv.y + h1y ) - 0.5 ) * texelSize.xy;
		vec2 p3 = ( vec2( iuv.x + h1x, iuv.y + h1y ) - 0.5 ) * texelSize.xy;
		return g0( fuv.y ) * ( g0x * textureLod( tex, p0, lod ) + g1x * textureLod( tex, p1, lod ) ) +
			g1( fuv.y ) * ( g0x * textureLod( tex, p2, lod ) + g1x * textureLod( tex, p3, lod ) );
	}
	vec4 textureBicubic( sampler2D sampler, vec2 uv, float lod ) {
		vec2 fLodSize = vec2( textureSize( sampler, int( lod ) ) );
		vec2 cLodSize = vec2( textureSize( sampler, int( lod + 1.0 ) ) );
		vec2 fLodSizeInv = 1.0 / fLodSize;
		vec2 cLodSizeInv = 1.0 / cLodSize;
		vec4 fSample = bicubic( sampler, uv, vec4( fLodSizeInv, fLodSize ), floor( lod ) );
		vec4 cSample = bicubic( sampler, uv, vec4( cLodSizeInv, cLodSize ), ceil( lod ) );
		return mix( fSample, cSample, fract( lod ) );
	}
	vec3 getVolumeTransmissionRay( const in vec3 n, const in vec3 v, const in float thickness, const in float ior, const in mat4 modelMatrix ) {
		vec3 refractionVector = refract( - v, normalize( n ), 1.0 / ior );
		vec3 modelScale;
		modelScale.x = length( vec3( modelMatrix[ 0 ].xyz ) );
		modelScale.y = length( vec3( modelMatrix[ 1 ].xyz ) );
		modelScale.z = length( vec3( modelMatrix[ 2 ].xyz ) );
		return normalize( refractionVector ) * thickness * modelScale;
	}
	float applyIorToRoughness( const in float roughness, const in float ior ) {
		return roughness * clamp( ior * 2.0 - 2.0, 0.0, 1.0 );
	}
	vec4 getTransmissionSample( const in vec2 fragCoord, const in float roughness, const in float ior ) {
		float lod = log2( transmissionSamplerSize.x ) * applyIorToRoughness( roughness, ior );
		return textureBicubic( transmissionSamplerMap, fragCoord.xy, lod );
	}
	vec3 volumeAttenuation( const in float transmissionDistance, const in vec3 attenuationColor, const in float attenuationDistance ) {
		if ( isinf( attenuationDistance ) ) {
			return vec3( 1.0 );
		} else {
			vec3 attenuationCoefficient = -log( attenuationColor ) / attenuationDistance;
			vec3 transmittance = exp( - attenuationCoefficient * transmissionDistance );			return transmittance;
		}
	}
	vec4 getIBLVolumeRefraction( const in vec3 n, const in vec3 v, const in float roughness, const in vec3 diffuseColor,
		const in vec3 specularColor, const in float specularF90, const in vec3 position, const in mat4 modelMatrix,
		const in mat4 viewMatrix, const in mat4 projMatrix, const in float dispersion, const in float ior, const in float thickness,
		const in vec3 attenuationColor, const in float attenuationDistance ) {
		vec4 transmittedLight;
		vec3 transmittance;
		#ifdef USE_DISPERSION
			float halfSpread = ( ior - 1.0 ) * 0.025 * dispersion;
			vec3 iors = vec3( ior - halfSpread, ior, ior + halfSpread );
			for ( int i = 0; i < 3; i ++ ) {
				vec3 transmissionRay = getVolumeTransmissionRay( n, v, thickness, iors[ i ], modelMatrix );
				vec3 refractedRayExit = position + transmissionRay;
				vec4 ndcPos = projMatrix * viewMatrix * vec4( refractedRayExit, 1.0 );
				vec2 refractionCoords = ndcPos.xy / ndcPos.w;
				refractionCoords += 1.0;
				refractionCoords /= 2.0;
				vec4 transmissionSample = getTransmissionSample( refractionCoords, roughness, iors[ i ] );
				transmittedLight[ i ] = transmissionSample[ i ];
				transmittedLight.a += transmissionSample.a;
				transmittance[ i ] = diffuseColor[ i ] * volumeAttenuation( length( transmissionRay ), attenuationColor, attenuationDistance )[ i ];
			}
			transmittedLight.a /= 3.0;
		#else
			vec3 transmissionRay = getVolumeTransmissionRay( n, v, thickness, ior, modelMatrix );
			vec3 refractedRayExit = position + transmissionRay;
			vec4 ndcPos = projMatrix * viewMatrix * vec4( refractedRayExit, 1.0 );
			vec2 refractionCoords = ndcPos.xy / ndcPos.w;
			refractionCoords += 1.0;
			refractionCoords /= 2.0;
			transmittedLight = getTransmissionSample( refractionCoords, roughness, ior );
			transmittance = diffuseColor * volumeAttenuation( length( transmissionRay ), attenuationColor, attenuationDistance );
		#endif
		vec3 attenuatedColor = transmittance * transmittedLight.rgb;
		vec3 F = EnvironmentBRDF( n, v, specularColor, specularF90, roughness );
		float transmittanceFactor = ( transmittance.r + transmittance.g + transmittance.b ) / 3.0;
		return vec4( ( 1.0 - F ) * attenuatedColor, 1.0 - ( 1.0 - transmittedLight.a ) * transmittanceFactor );
	}
#endif`,Eb=`#if defined( USE_UV ) || defined( USE_ANISOTROPY )
	varying vec2 vUv;
#endif
#ifdef USE_MAP
	varying vec2 vMapUv;
#endif
#ifdef USE_ALPHAMAP
	varying vec2 vAlphaMapUv;
#endif
#ifdef USE_LIGHTMAP
	varying vec2 vLightMapUv;
#endif
#ifdef USE_AOMAP
	varying vec2 vAoMapUv;
#endif
#ifdef USE_BUMPMAP
	varying vec2 vBumpMapUv;
#endif
#ifdef USE_NORMALMAP
	varying vec2 vNormalMapUv;
#endif
#ifdef USE_EMISSIVEMAP
	varying vec2 vEmissiveMapUv;
#endif
#ifdef USE_METALNESSMAP
	varying vec2 vMetalnessMapUv;
#endif
#ifdef USE_ROUGHNESSMAP
	varying vec2 vRoughnessMapUv;
#endif
#ifdef USE_DIFFUSE_ROUGHNESSMAP
	varying vec2 vDiffuseRoughnessMapUv;
#endif
#ifdef USE_ANISOTROPYMAP
	varying vec2 vAnisotropyMapUv;
#endif
#ifdef USE_CLEARCOATMAP
	varying vec2 vClearcoatMapUv;
#endif
#ifdef USE_CLEARCOAT_NORMALMAP
	varying vec2 vClearcoatNormalMapUv;
#endif
#ifdef USE_CLEARCOAT_ROUGHNESSMAP
	varying vec2 vClearcoatRoughnessMapUv;
#endif
#ifdef USE_IRIDESCENCEMAP
	varying vec2 vIridescenceMapUv;
#endif
#ifdef USE_IRIDESCENCE_THICKNESSMAP
	varying vec2 vIridescenceThicknessMapUv;
#endif
#ifdef USE_SHEEN_COLORMAP
	varying vec2 vSheenColorMapUv;
#endif
#ifdef USE_SHEEN_ROUGHNESSMAP
	varying vec2 vSheenRoughnessMapUv;
#endif
#ifdef USE_SPECULARMAP
	varying vec2 vSpecularMapUv;
#endif
#ifdef USE_SPECULAR_COLORMAP
	varying vec2 vSpecularColorMapUv;
#endif
#ifdef USE_SPECULAR_INTENSITYMAP
	varying vec2 vSpecularIntensityMapUv;
#endif
#ifdef USE_TRANSMISSIONMAP
	uniform mat3 transmissionMapTransform;
	varying vec2 vTransmissionMapUv;
#endif
#ifdef USE_THICKNESSMAP
	uniform mat3 thicknessMapTransform;
	varying vec2 vThicknessMapUv;
#endif`,Tb=`#if defined( USE_UV ) || defined( USE_ANISOTROPY )
	varying vec2 vUv;
#endif
#ifdef USE_MAP
	uniform mat3 mapTransform;
	varying vec2 vMapUv;
#endif
#ifdef USE_ALPHAMAP
	uniform mat3 alphaMapTransform;
	varying vec2 vAlphaMapUv;
#endif
#ifdef USE_LIGHTMAP
	uniform mat3 lightMapTransform;
	varying vec2 vLightMapUv;
#endif
#ifdef USE_AOMAP
	uniform mat3 aoMapTransform;
	varying vec2 vAoMapUv;
#endif
#ifdef USE_BUMPMAP
	uniform mat3 bumpMapTransform;
	varying vec2 vBumpMapUv;
#endif
#ifdef USE_NORMALMAP
	uniform mat3 normalMapTransform;
	varying vec2 vNormalMapUv;
#endif
#ifdef USE_DISPLACEMENTMAP
	uniform mat3 displacementMapTransform;
	varying vec2 vDisplacementMapUv;
#endif
#ifdef USE_EMISSIVEMAP
	uniform mat3 emissiveMapTransform;
	varying vec2 vEmissiveMapUv;
#endif
#ifdef USE_METALNESSMAP
	uniform mat3 metalnessMapTransform;
	varying vec2 vMetalnessMapUv;
#endif
#ifdef USE_ROUGHNESSMAP
	uniform mat3 roughnessMapTransform;
	varying vec2 vRoughnessMapUv;
#endif
#ifdef USE_DIFFUSE_ROUGHNESSMAP
	uniform mat3 diffuseRoughnessMapTransform;
	varying vec2 vDiffuseRoughnessMapUv;
#endif
#ifdef USE_ANISOTROPYMAP
	uniform mat3 anisotropyMapTransform;
	varying vec2 vAnisotropyMapUv;
#endif
#ifdef USE_CLEARCOATMAP
	uniform mat3 clearcoatMapTransform;
	varying vec2 vClearcoatMapUv;
#endif
#ifdef USE_CLEARCOAT_NORMALMAP
	uniform mat3 clearcoatNormalMapTransform;
	varying vec2 vClearcoatNormalMapUv;
#endif
#ifdef USE_CLEARCOAT_ROUGHNESSMAP
	uniform mat3 clearcoatRoughnessMapTransform;
	varying vec2 vClearcoatRoughnessMapUv;
#endif
#ifdef USE_SHEEN_COLORMAP
	uniform mat3 sheenColorMapTransform;
	varying vec2 vSheenColorMapUv;
#endif
#ifdef USE_SHEEN_ROUGHNESSMAP
	uniform mat3 sheenRoughnessMapTransform;
	varying vec2 vSheenRoughnessMapUv;
#endif
#ifdef USE_IRIDESCENCEMAP
	uniform mat3 iridescenceMapTransform;
	varying vec2 vIridescenceMapUv;
#endif
#ifdef USE_IRIDESCENCE_THICKNESSMAP
	uniform mat3 iridescenceThicknessMapTransform;
	varying vec2 vIridescenceThicknessMapUv;
#endif
#ifdef USE_SPECULARMAP
	uniform mat3 specularMapTransform;
	varying vec2 vSpecularMapUv;
#endif
#ifdef USE_SPECULAR_COLORMAP
	uniform mat3 specularColorMapTransform;
	varying vec2 vSpecularColorMapUv;
#endif
#ifdef USE_SPECULAR_INTENSITYMAP
	uniform mat3 specularIntensityMapTransform;
	varying vec2 vSpecularIntensityMapUv;
#endif
#ifdef USE_TRANSMISSIONMAP
	uniform mat3 transmissionMapTransform;
	varying vec2 vTransmissionMapUv;
#endif
#ifdef USE_THICKNESSMAP
	uniform mat3 thicknessMapTransform;
	varying vec2 vThicknessMapUv;
#endif`,Ab=`#if defined( USE_UV ) || defined( USE_ANISOTROPY )
	vUv = vec3( uv, 1 ).xy;
#endif
#ifdef USE_MAP
	vMapUv = ( mapTransform * vec3( MAP_UV, 1 ) ).xy;
#endif
#ifdef USE_ALPHAMAP
	vAlphaMapUv = ( alphaMapTransform * vec3( ALPHAMAP_UV, 1 ) ).xy;
#endif
#ifdef USE_LIGHTMAP
	vLightMapUv = ( lightMapTransform * vec3( LIGHTMAP_UV, 1 ) ).xy;
#endif
#ifdef USE_AOMAP
	vAoMapUv = ( aoMapTransform * vec3( AOMAP_UV, 1 ) ).xy;
#endif
#ifdef USE_BUMPMAP
	vBumpMapUv = ( bumpMapTransform * vec3( BUMPMAP_UV, 1 ) ).xy;
#endif
#ifdef USE_NORMALMAP
	vNormalMapUv = ( normalMapTransform * vec3( NORMALMAP_UV, 1 ) ).xy;
#endif
#ifdef USE_DISPLACEMENTMAP
	vDisplacementMapUv = ( displacementMapTransform * vec3( DISPLACEMENTMAP_UV, 1 ) ).xy;
#endif
#ifdef USE_EMISSIVEMAP
	vEmissiveMapUv = ( emissiveMapTransform * vec3( EMISSIVEMAP_UV, 1 ) ).xy;
#endif
#ifdef USE_METALNESSMAP
	vMetalnessMapUv = ( metalnessMapTransform * vec3( METALNESSMAP_UV, 1 ) ).xy;
#endif
#ifdef USE_ROUGHNESSMAP
	vRoughnessMapUv = ( roughnessMapTransform * vec3( ROUGHNESSMAP_UV, 1 ) ).xy;
#endif
#ifdef USE_DIFFUSE_ROUGHNESSMAP
	vDiffuseRoughnessMapUv = ( diffuseRoughnessMapTransform * vec3( DIFFUSE_ROUGHNESSMAP_UV, 1 ) ).xy;
#endif
#ifdef USE_ANISOTROPYMAP
	vAnisotropyMapUv = ( anisotropyMapTransform * vec3( ANISOTROPYMAP_UV, 1 ) ).xy;
#endif
#ifdef USE_CLEARCOATMAP
	vClearcoatMapUv = ( clearcoatMapTransform * vec3( CLEARCOATMAP_UV, 1 ) ).xy;
#endif
#ifdef USE_CLEARCOAT_NORMALMAP
	vClearcoatNormalMapUv = ( clearcoatNormalMapTransform * vec3( CLEARCOAT_NORMALMAP_UV, 1 ) ).xy;
#endif
#ifdef USE_CLEARCOAT_ROUGHNESSMAP
	vClearcoatRoughnessMapUv = ( clearcoatRoughnessMapTransform * vec3( CLEARCOAT_ROUGHNESSMAP_UV, 1 ) ).xy;
#endif
#ifdef USE_IRIDESCENCEMAP
	vIridescenceMapUv = ( iridescenceMapTransform * vec3( IRIDESCENCEMAP_UV, 1 ) ).xy;
#endif
#ifdef USE_IRIDESCENCE_THICKNESSMAP
	vIridescenceThicknessMapUv = ( iridescenceThicknessMapTransform * vec3( IRIDESCENCE_THICKNESSMAP_UV, 1 ) ).xy;
#endif
#ifdef USE_SHEEN_COLORMAP
	vSheenColorMapUv = ( sheenColorMapTransform * vec3( SHEEN_COLORMAP_UV, 1 ) ).xy;
#endif
#ifdef USE_SHEEN_ROUGHNESSMAP
	vSheenRoughnessMapUv = ( sheenRoughnessMapTransform * vec3( SHEEN_ROUGHNESSMAP_UV, 1 ) ).xy;
#endif
#ifdef USE_SPECULARMAP
	vSpecularMapUv = ( specularMapTransform * vec3( SPECULARMAP_UV, 1 ) ).xy;
#endif
#ifdef USE_SPECULAR_COLORMAP
	vSpecularColorMapUv = ( specularColorMapTransform * vec3( SPECULAR_COLORMAP_UV, 1 ) ).xy;
#endif
#ifdef USE_SPECULAR_INTENSITYMAP
	vSpecularIntensityMapUv = ( specularIntensityMapTransform * vec3( SPECULAR_INTENSITYMAP_UV, 1 ) ).xy;
#endif
#ifdef USE_TRANSMISSIONMAP
	vTransmissionMapUv = ( transmissionMapTransform * vec3( TRANSMISSIONMAP_UV, 1 ) ).xy;
#endif
#ifdef USE_THICKNESSMAP
	vThicknessMapUv = ( thicknessMapTransform * vec3( THICKNESSMAP_UV, 1 ) ).xy;
#endif`,Rb=`#if defined( USE_ENVMAP ) || defined( DISTANCE ) || defined ( USE_SHADOWMAP ) || defined ( USE_TRANSMISSION ) || NUM_SPOT_LIGHT_COORDS > 0
	vec4 worldPosition = vec4( transformed, 1.0 );
	#ifdef USE_BATCHING
		worldPosition = batchingMatrix * worldPosition;
	#endif
	#ifdef USE_INSTANCING
		worldPosition = instanceMatrix * worldPosition;
	#endif
	worldPosition = modelMatrix * worldPosition;
#endif`,Cb=`varying vec2 vUv;
uniform mat3 uvTransform;
void main() {
	vUv = ( uvTransform * vec3( uv, 1 ) ).xy;
	gl_Position = vec4( position.xy, 1.0, 1.0 );
}`,Ib=`uniform sampler2D t2D;
uniform float backgroundIntensity;
varying vec2 vUv;
void main() {
	vec4 texColor = texture2D( t2D, vUv );
	#ifdef DECODE_VIDEO_TEXTURE
		texColor = vec4( mix( pow( texColor.rgb * 0.9478672986 + vec3( 0.0521327014 ), vec3( 2.4 ) ), texColor.rgb * 0.0773993808, vec3( lessThanEqual( texColor.rgb, vec3( 0.04045 ) ) ) ), texColor.w );
	#endif
	texColor.rgb *= backgroundIntensity;
	gl_FragColor = texColor;
	#include <tonemapping_fragment>
	#include <colorspace_fragment>
}`,Pb=`varying vec3 vWorldDirection;
#include <common>
void main() {
	vWorldDirection = transformDirection( position, modelMatrix );
	#include <begin_vertex>
	#include <project_vertex>
	gl_Position.z = gl_Position.w;
}`,Lb=`uniform float backgroundBlurriness;
uniform float backgroundIntensity;
uniform mat3 backgroundRotation;
varying vec3 vWorldDirection;
#include <envmap_common_pars_fragment>
void main() {
	#ifdef ENVMAP_TYPE_PMREM
		vec4 texColor = textureLod( envMap, backgroundRotation * vWorldDirection, roughnessToMip( backgroundBlurriness ) );
	#else
		vec4 texColor = textureCube( envMap, backgroundRotation * vWorldDirection );
	#endif
	texColor.rgb *= backgroundIntensity;
	gl_FragColor = texColor;
	#include <tonemapping_fragment>
	#include <colorspace_fragment>
}`,Db=`varying vec3 vWorldDirection;
#include <common>
void main() {
	vWorldDirection = transformDirection( position, modelMatrix );
	#include <begin_vertex>
	#include <project_vertex>
	gl_Position.z = gl_Position.w;
}`,Nb=`uniform samplerCube tCube;
uniform float tFlip;
uniform float opacity;
varying vec3 vWorldDirection;
void main() {
	vec4 texColor = textureCube( tCube, vec3( tFlip * vWorldDirection.x, vWorldDirection.yz ) );
	gl_FragColor = texColor;
	gl_FragColor.a *= opacity;
	#include <tonemapping_fragment>
	#include <colorspace_fragment>
}`,Ub=`#include <common>
#include <batching_pars_vertex>
#include <uv_pars_vertex>
#include <displacementmap_pars_vertex>
#include <morphtarget_pars_vertex>
#include <skinning_pars_vertex>
#include <logdepthbuf_pars_vertex>
#include <clipping_planes_pars_vertex>
varying vec2 vHighPrecisionZW;
void main() {
	#include <uv_vertex>
	#include <batching_vertex>
	#include <skinbase_vertex>
	#include <morphinstance_vertex>
	#ifdef USE_DISPLACEMENTMAP
		#include <beginnormal_vertex>
		#include <morphnormal_vertex>
		#include <skinnormal_vertex>
	#endif
	#include <begin_vertex>
	#include <morphtarget_vertex>
	#include <skinning_vertex>
	#include <displacementmap_vertex>
	#include <project_vertex>
	#include <logdepthbuf_vertex>
	#include <clipping_planes_vertex>
	vHighPrecisionZW = gl_Position.zw;
}`,Ob=`#if DEPTH_PACKING == 3200
	uniform float opacity;
#endif
#include <common>
#include <packing>
#include <uv_pars_fragment>
#include <map_pars_fragment>
#include <alphamap_pars_fragment>
#include <alphatest_pars_fragment>
#include <alphahash_pars_fragment>
#include <logdepthbuf_pars_fragment>
#include <clipping_planes_pars_fragment>
varying vec2 vHighPrecisionZW;
void main() {
	vec4 diffuseColor = vec4( 1.0 );
	#include <clipping_planes_fragment>
	#if DEPTH_PACKING == 3200
		diffuseColor.a = opacity;
	#endif
	#include <map_fragment>
	#include <alphamap_fragment>
	#include <alphatest_fragment>
	#include <alphahash_fragment>
	#include <logdepthbuf_fragment>
	#ifdef USE_REVERSED_DEPTH_BUFFER
		float fragCoordZ = vHighPrecisionZW[ 0 ] / vHighPrecisionZW[ 1 ];
	#else
		float fragCoordZ = 0.5 * vHighPrecisionZW[ 0 ] / vHighPrecisionZW[ 1 ] + 0.5;
	#endif
	#if DEPTH_PACKING == 3200
		gl_FragColor = vec4( vec3( 1.0 - fragCoordZ ), opacity );
	#elif DEPTH_PACKING == 3201
		gl_FragColor = packDepthToRGBA( fragCoordZ );
	#elif DEPTH_PACKING == 3202
		gl_FragColor = vec4( packDepthToRGB( fragCoordZ ), 1.0 );
	#elif DEPTH_PACKING == 3203
		gl_FragColor = vec4( packDepthToRG( fragCoordZ ), 0.0, 1.0 );
	#endif
}`,Fb=`#define DISTANCE
varying vec3 vWorldPosition;
#include <common>
#include <batching_pars_vertex>
#include <uv_pars_vertex>
#include <displacementmap_pars_vertex>
#include <morphtarget_pars_vertex>
#include <skinning_pars_vertex>
#include <clipping_planes_pars_vertex>
void main() {
	#include <uv_vertex>
	#include <batching_vertex>
	#include <skinbase_vertex>
	#include <morphinstance_vertex>
	#ifdef USE_DISPLACEMENTMAP
		#include <beginnormal_vertex>
		#include <morphnormal_vertex>
		#include <skinnormal_vertex>
	#endif
	#include <begin_vertex>
	#include <morphtarget_vertex>
	#include <skinning_vertex>
	#include <displacementmap_vertex>
	#include <project_vertex>
	#include <worldpos_vertex>
	#include <clipping_planes_vertex>
	vWorldPosition = worldPosition.xyz;
}`,Bb=`#define DISTANCE
uniform vec3 referencePosition;
uniform float nearDistance;
uniform float farDistance;
varying vec3 vWorldPosition;
#include <common>
#include <uv_pars_fragment>
#include <map_pars_fragment>
#include <alphamap_pars_fragment>
#include <alphatest_pars_fragment>
#include <alphahash_pars_fragment>
#include <clipping_planes_pars_fragment>
void main() {
	vec4 diffuseColor = vec4( 1.0 );
	#include <clipping_planes_fragment>
	#include <map_fragment>
	#include <alphamap_fragment>
	#include <alphatest_fragment>
	#include <alphahash_fragment>
	float dist = length( vWorldPosition - referencePosition );
	dist = ( dist - nearDistance ) / ( farDistance - nearDistance );
	dist = saturate( dist );
	gl_FragColor = vec4( dist, 0.0, 0.0, 1.0 );
}`,kb=`varying vec3 vWorldDirection;
#include <common>
void main() {
	vWorldDirection = transformDirection( position, modelMatrix );
	#include <begin_vertex>
	#include <project_vertex>
}`,zb=`uniform sampler2D tEquirect;
varying vec3 vWorldDirection;
#include <common>
void main() {
	vec3 direction = normalize( vWorldDirection );
	vec2 sampleUV = equirectUv( direction );
	gl_FragColor = texture2D( tEquirect, sampleUV );
	#include <tonemapping_fragment>
	#include <colorspace_fragment>
}`,Hb=`uniform float scale;
attribute float lineDistance;
varying float vLineDistance;
#include <common>
#include <uv_pars_vertex>
#include <color_pars_vertex>
#include <fog_pars_vertex>
#include <morphtarget_pars_vertex>
#include <logdepthbuf_pars_vertex>
#include <clipping_planes_pars_vertex>
void main() {
	vLineDistance = scale * lineDistance;
	#include <uv_vertex>
	#include <color_vertex>
	#include <morphinstance_vertex>
	#include <morphcolor_vertex>
	#include <begin_vertex>
	#include <morphtarget_vertex>
	#include <project_vertex>
	#include <logdepthbuf_vertex>
	#include <clipping_planes_vertex>
	#include <fog_vertex>
}`,Gb=`uniform vec3 diffuse;
uniform float opacity;
uniform float dashSize;
uniform float totalSize;
varying float vLineDistance;
#include <common>
#include <color_pars_fragment>
#include <uv_pars_fragment>
#include <map_pars_fragment>
#include <fog_pars_fragment>
#include <logdepthbuf_pars_fragment>
#include <clipping_planes_pars_fragment>
void main() {
	vec4 diffuseColor = vec4( diffuse, opacity );
	#include <clipping_planes_fragment>
	if ( mod( vLineDistance, totalSize ) > dashSize ) {
		discard;
	}
	vec3 outgoingLight = vec3( 0.0 );
	#include <logdepthbuf_fragment>
	#include <map_fragment>
	#include <color_fragment>
	outgoingLight = diffuseColor.rgb;
	#include <opaque_fragment>
	#include <tonemapping_fragment>
	#include <colorspace_fragment>
	#include <fog_fragment>
	#include <premultiplied_alpha_fragment>
}`,Vb=`#include <common>
#include <batching_pars_vertex>
#include <uv_pars_vertex>
#include <envmap_pars_vertex>
#include <color_pars_vertex>
#include <fog_pars_vertex>
#include <morphtarget_pars_vertex>
#include <skinning_pars_vertex>
#include <logdepthbuf_pars_vertex>
#include <clipping_planes_pars_vertex>
void main() {
	#include <uv_vertex>
	#include <color_vertex>
	#include <morphinstance_vertex>
	#include <morphcolor_vertex>
	#include <batching_vertex>
	#if defined ( USE_ENVMAP ) || defined ( USE_SKINNING )
		#include <beginnormal_vertex>
		#include <morphnormal_vertex>
		#include <skinbase_vertex>
		#include <skinnormal_vertex>
		#include <defaultnormal_vertex>
	#endif
	#include <begin_vertex>
	#include <morphtarget_vertex>
	#include <skinning_vertex>
	#include <project_vertex>
	#include <logdepthbuf_vertex>
	#include <clipping_planes_vertex>
	#include <worldpos_vertex>
	#include <envmap_vertex>
	#include <fog_vertex>
}`,Wb=`uniform vec3 diffuse;
uniform float opacity;
#ifndef FLAT_SHADED
	varying vec3 vNormal;
#endif
#include <common>
#include <dithering_pars_fragment>
#include <color_pars_fragment>
#include <uv_pars_fragment>
#include <map_pars_fragment>
#include <alphamap_pars_fragment>
#include <alphatest_pars_fragment>
#include <alphahash_pars_fragment>
#include <aomap_pars_fragment>
#include <lightmap_pars_fragment>
#include <envmap_common_pars_fragment>
#include <envmap_pars_fragment>
#include <fog_pars_fragment>
#include <specularmap_pars_fragment>
#include <logdepthbuf_pars_fragment>
#include <clipping_planes_pars_fragment>
void main() {
	vec4 diffuseColor = vec4( diffuse, opacity );
	#include <clipping_planes_fragment>
	#include <logdepthbuf_fragment>
	#include <map_fragment>
	#include <color_fragment>
	#include <alphamap_fragment>
	#include <alphatest_fragment>
	#include <alphahash_fragment>
	#include <specularmap_fragment>
	ReflectedLight reflectedLight = ReflectedLight( vec3( 0.0 ), vec3( 0.0 ), vec3( 0.0 ), vec3( 0.0 ) );
	#ifdef USE_LIGHTMAP
		vec4 lightMapTexel = texture2D( lightMap, vLightMapUv );
		reflectedLight.indirectDiffuse += lightMapTexel.rgb * lightMapIntensity * RECIPROCAL_PI;
	#else
		reflectedLight.indirectDiffuse += vec3( 1.0 );
	#endif
	#include <aomap_fragment>
	reflectedLight.indirectDiffuse *= diffuseColor.rgb;
	vec3 outgoingLight = reflectedLight.indirectDiffuse;
	#include <envmap_fragment>
	#include <opaque_fragment>
	#include <tonemapping_fragment>
	#include <colorspace_fragment>
	#include <fog_fragment>
	#include <premultiplied_alpha_fragment>
	#include <dithering_fragment>
}`,Xb=`#define LAMBERT
varying vec3 vViewPosition;
#include <common>
#include <batching_pars_vertex>
#include <uv_pars_vertex>
#include <displacementmap_pars_vertex>
#include <envmap_pars_vertex>
#include <color_pars_vertex>
#include <fog_pars_vertex>
#include <normal_pars_vertex>
#include <morphtarget_pars_vertex>
#include <skinning_pars_vertex>
#include <shadowmap_pars_vertex>
#include <logdepthbuf_pars_vertex>
#include <clipping_planes_pars_vertex>
void main() {
	#include <uv_vertex>
	#include <color_vertex>
	#include <morphinstance_vertex>
	#include <morphcolor_vertex>
	#include <batching_vertex>
	#include <beginnormal_vertex>
	#include <morphnormal_vertex>
	#include <skinbase_vertex>
	#include <skinnormal_vertex>
	#include <defaultnormal_vertex>
	#include <normal_vertex>
	#include <begin_vertex>
	#include <morphtarget_vertex>
	#include <skinning_vertex>
	#include <displacementmap_vertex>
	#include <project_vertex>
	#include <logdepthbuf_vertex>
	#include <clipping_planes_vertex>
	vViewPosition = - mvPosition.xyz;
	#include <worldpos_vertex>
	#include <envmap_vertex>
	#include <shadowmap_vertex>
	#include <fog_vertex>
}`,qb=`#define LAMBERT
uniform vec3 diffuse;
uniform vec3 emissive;
uniform float opacity;
#include <common>
#include <dithering_pars_fragment>
#include <color_pars_fragment>
#include <uv_pars_fragment>
#include <map_pars_fragment>
#include <alphamap_pars_fragment>
#include <alphatest_pars_fragment>
#include <alphahash_pars_fragment>
#include <aomap_pars_fragment>
#include <lightmap_pars_fragment>
#include <emissivemap_pars_fragment>
#include <envmap_common_pars_fragment>
#include <envmap_pars_fragment>
#include <envmap_physical_pars_fragment>
#include <fog_pars_fragment>
#include <bsdfs>
#include <lights_pars_begin>
#include <normal_pars_fragment>
#include <lights_lambert_pars_fragment>
#include <shadowmap_pars_fragment>
#include <bumpmap_pars_fragment>
#include <normalmap_pars_fragment>
#include <specularmap_pars_fragment>
#include <logdepthbuf_pars_fragment>
#include <clipping_planes_pars_fragment>
void main() {
	vec4 diffuseColor = vec4( diffuse, opacity );
	#include <clipping_planes_fragment>
	ReflectedLight reflectedLight = ReflectedLight( vec3( 0.0 ), vec3( 0.0 ), vec3( 0.0 ), vec3( 0.0 ) );
	vec3 totalEmissiveRadiance = emissive;
	#include <logdepthbuf_fragment>
	#include <map_fragment>
	#include <color_fragment>
	#include <alphamap_fragment>
	#include <alphatest_fragment>
	#include <alphahash_fragment>
	#include <specularmap_fragment>
	#include <normal_fragment_begin>
	#include <normal_fragment_maps>
	#include <emissivemap_fragment>
	#include <lights_lambert_fragment>
	#include <lights_fragment_begin>
	#include <lights_fragment_maps>
	#include <lights_fragment_end>
	#include <aomap_fragment>
	vec3 outgoingLight = reflectedLight.directDiffuse + reflectedLight.indirectDiffuse + totalEmissiveRadiance;
	#include <envmap_fragment>
	#include <opaque_fragment>
	#include <tonemapping_fragment>
	#include <colorspace_fragment>
	#include <fog_fragment>
	#include <premultiplied_alpha_fragment>
	#include <dithering_fragment>
}`,Yb=`#define MATCAP
varying vec3 vViewPosition;
#include <common>
#include <batching_pars_vertex>
#include <uv_pars_vertex>
#include <color_pars_vertex>
#include <displacementmap_pars_vertex>
#include <fog_pars_vertex>
#include <normal_pars_vertex>
#include <morphtarget_pars_vertex>
#include <skinning_pars_vertex>
#include <logdepthbuf_pars_vertex>
#include <clipping_planes_pars_vertex>
void main() {
	#include <uv_vertex>
	#include <color_vertex>
	#include <morphinstance_vertex>
	#include <morphcolor_vertex>
	#include <batching_vertex>
	#include <beginnormal_vertex>
	#include <morphnormal_vertex>
	#include <skinbase_vertex>
	#include <skinnormal_vertex>
	#include <defaultnormal_vertex>
	#include <normal_vertex>
	#include <begin_vertex>
	#include <morphtarget_vertex>
	#include <skinning_vertex>
	#include <displacementmap_vertex>
	#include <project_vertex>
	#include <logdepthbuf_vertex>
	#include <clipping_planes_vertex>
	#include <fog_vertex>
	vViewPosition = - mvPosition.xyz;
}`,Zb=`#define MATCAP
uniform vec3 diffuse;
uniform float opacity;
uniform sampler2D matcap;
varying vec3 vViewPosition;
#include <common>
#include <dithering_pars_fragment>
#include <color_pars_fragment>
#include <uv_pars_fragment>
#include <map_pars_fragment>
#include <alphamap_pars_fragment>
#include <alphatest_pars_fragment>
#include <alphahash_pars_fragment>
#include <fog_pars_fragment>
#include <normal_pars_fragment>
#include <bumpmap_pars_fragment>
#include <normalmap_pars_fragment>
#include <logdepthbuf_pars_fragment>
#include <clipping_planes_pars_fragment>
void main() {
	vec4 diffuseColor = vec4( diffuse, opacity );
	#include <clipping_planes_fragment>
	#include <logdepthbuf_fragment>
	#include <map_fragment>
	#include <color_fragment>
	#include <alphamap_fragment>
	#include <alphatest_fragment>
	#include <alphahash_fragment>
	#include <normal_fragment_begin>
	#include <normal_fragment_maps>
	vec3 viewDir = normalize( vViewPosition );
	vec3 x = normalize( vec3( viewDir.z, 0.0, - viewDir.x ) );
	vec3 y = cross( viewDir, x );
	vec2 uv = vec2( dot( x, normal ), dot( y, normal ) ) * 0.495 + 0.5;
	#ifdef USE_MATCAP
		vec4 matcapColor = texture2D( matcap, uv );
	#else
		vec4 matcapColor = vec4( vec3( mix( 0.2, 0.8, uv.y ) ), 1.0 );
	#endif
	vec3 outgoingLight = diffuseColor.rgb * matcapColor.rgb;
	#include <opaque_fragment>
	#include <tonemapping_fragment>
	#include <colorspace_fragment>
	#include <fog_fragment>
	#include <premultiplied_alpha_fragment>
	#include <dithering_fragment>
}`,Kb=`#define NORMAL
#if defined( FLAT_SHADED ) || defined( USE_BUMPMAP ) || defined( USE_NORMALMAP_TANGENTSPACE )
	varying vec3 vViewPosition;
#endif
#include <common>
#include <batching_pars_vertex>
#include <uv_pars_vertex>
#include <displacementmap_pars_vertex>
#include <normal_pars_vertex>
#include <morphtarget_pars_vertex>
#include <skinning_pars_vertex>
#include <logdepthbuf_pars_vertex>
#include <clipping_planes_pars_vertex>
void main() {
	#include <uv_vertex>
	#include <batching_vertex>
	#include <beginnormal_vertex>
	#include <morphinstance_vertex>
	#include <morphnormal_vertex>
	#include <skinbase_vertex>
	#include <skinnormal_vertex>
	#include <defaultnormal_vertex>
	#include <normal_vertex>
	#include <begin_vertex>
	#include <morphtarget_vertex>
	#include <skinning_vertex>
	#include <displacementmap_vertex>
	#include <project_vertex>
	#include <logdepthbuf_vertex>
	#include <clipping_planes_vertex>
#if defined( FLAT_SHADED ) || defined( USE_BUMPMAP ) || defined( USE_NORMALMAP_TANGENTSPACE )
	vViewPosition = - mvPosition.xyz;
#endif
}`,$b=`#define NORMAL
uniform float opacity;
#if defined( FLAT_SHADED ) || defined( USE_BUMPMAP ) || defined( USE_NORMALMAP_TANGENTSPACE )
	varying vec3 vViewPosition;
#endif
#include <uv_pars_fragment>
#include <normal_pars_fragment>
#include <bumpmap_pars_fragment>
#include <normalmap_pars_fragment>
#include <logdepthbuf_pars_fragment>
#include <clipping_planes_pars_fragment>
void main() {
	vec4 diffuseColor = vec4( 0.0, 0.0, 0.0, opacity );
	#include <clipping_planes_fragment>
	#include <logdepthbuf_fragment>
	#include <normal_fragment_begin>
	#include <normal_fragment_maps>
	gl_FragColor = vec4( normalize( normal ) * 0.5 + 0.5, diffuseColor.a );
	#ifdef OPAQUE
		gl_FragColor.a = 1.0;
	#endif
}`,Jb=`#define PHONG
varying vec3 vViewPosition;
#include <common>
#include <batching_pars_vertex>
#include <uv_pars_vertex>
#include <displacementmap_pars_vertex>
#include <envmap_pars_vertex>
#include <color_pars_vertex>
#include <fog_pars_vertex>
#include <normal_pars_vertex>
#include <morphtarget_pars_vertex>
#include <skinning_pars_vertex>
#include <shadowmap_pars_vertex>
#include <logdepthbuf_pars_vertex>
#include <clipping_planes_pars_vertex>
void main() {
	#include <uv_vertex>
	#include <color_vertex>
	#include <morphcolor_vertex>
	#include <batching_vertex>
	#include <beginnormal_vertex>
	#include <morphinstance_vertex>
	#include <morphnormal_vertex>
	#include <skinbase_vertex>
	#include <skinnormal_vertex>
	#include <defaultnormal_vertex>
	#include <normal_vertex>
	#include <begin_vertex>
	#include <morphtarget_vertex>
	#include <skinning_vertex>
	#include <displacementmap_vertex>
	#include <project_vertex>
	#include <logdepthbuf_vertex>
	#include <clipping_planes_vertex>
	vViewPosition = - mvPosition.xyz;
	#include <worldpos_vertex>
	#include <envmap_vertex>
	#include <shadowmap_vertex>
	#include <fog_vertex>
}`,jb=`#define PHONG
uniform vec3 diffuse;
uniform vec3 emissive;
uniform vec3 specular;
uniform float shininess;
uniform float opacity;
#include <common>
#include <dithering_pars_fragment>
#include <color_pars_fragment>
#include <uv_pars_fragment>
#include <map_pars_fragment>
#include <alphamap_pars_fragment>
#include <alphatest_pars_fragment>
#include <alphahash_pars_fragment>
#include <aomap_pars_fragment>
#include <lightmap_pars_fragment>
#include <emissivemap_pars_fragment>
#include <envmap_common_pars_fragment>
#include <envmap_pars_fragment>
#include <envmap_physical_pars_fragment>
#include <fog_pars_fragment>
#include <bsdfs>
#include <lights_pars_begin>
#include <normal_pars_fragment>
#include <lights_phong_pars_fragment>
#include <shadowmap_pars_fragment>
#include <bumpmap_pars_fragment>
#include <normalmap_pars_fragment>
#include <specularmap_pars_fragment>
#include <logdepthbuf_pars_fragment>
#include <clipping_planes_pars_fragment>
void main() {
	vec4 diffuseColor = vec4( diffuse, opacity );
	#include <clipping_planes_fragment>
	ReflectedLight reflectedLight = ReflectedLight( vec3( 0.0 ), vec3( 0.0 ), vec3( 0.0 ), vec3( 0.0 ) );
	vec3 totalEmissiveRadiance = emissive;
	#include <logdepthbuf_fragment>
	#include <map_fragment>
	#include <color_fragment>
	#include <alphamap_fragment>
	#include <alphatest_fragment>
	#include <alphahash_fragment>
	#include <specularmap_fragment>
	#include <normal_fragment_begin>
	#include <normal_fragment_maps>
	#include <emissivemap_fragment>
	#include <lights_phong_fragment>
	#include <lights_fragment_begin>
	#include <lights_fragment_maps>
	#include <lights_fragment_end>
	#include <aomap_fragment>
	vec3 outgoingLight = reflectedLight.directDiffuse + reflectedLight.indirectDiffuse + reflectedLight.directSpecular + reflectedLight.indirectSpecular + totalEmissiveRadiance;
	#include <envmap_fragment>
	#include <opaque_fragment>
	#include <tonemapping_fragment>
	#include <colorspace_fragment>
	#include <fog_fragment>
	#include <premultiplied_alpha_fragment>
	#include <dithering_fragment>
}`,Qb=`#define STANDARD
varying vec3 vViewPosition;
#ifdef USE_TRANSMISSION
	varying vec3 vWorldPosition;
#endif
#include <common>
#include <batching_pars_vertex>
#include <uv_pars_vertex>
#include <displacementmap_pars_vertex>
#include <color_pars_vertex>
#include <fog_pars_vertex>
#include <normal_pars_vertex>
#include <morphtarget_pars_vertex>
#include <skinning_pars_vertex>
#include <shadowmap_pars_vertex>
#include <logdepthbuf_pars_vertex>
#include <clipping_planes_pars_vertex>
void main() {
	#include <uv_vertex>
	#include <color_vertex>
	#include <morphinstance_vertex>
	#include <morphcolor_vertex>
	#include <batching_vertex>
	#include <beginnormal_vertex>
	#include <morphnormal_vertex>
	#include <skinbase_vertex>
	#include <skinnormal_vertex>
	#include <defaultnormal_vertex>
	#include <normal_vertex>
	#include <begin_vertex>
	#include <morphtarget_vertex>
	#include <skinning_vertex>
	#include <displacementmap_vertex>
	#include <project_vertex>
	#include <logdepthbuf_vertex>
	#include <clipping_planes_vertex>
	vViewPosition = - mvPosition.xyz;
	#include <worldpos_vertex>
	#include <shadowmap_vertex>
	#include <fog_vertex>
#ifdef USE_TRANSMISSION
	vWorldPosition = worldPosition.xyz;
#endif
}`,ew=`#define STANDARD
#ifdef PHYSICAL
	#define IOR
	#define USE_SPECULAR
#endif
uniform vec3 diffuse;
uniform vec3 emissive;
uniform float roughness;
uniform float metalness;
uniform float opacity;
#ifdef IOR
	uniform float ior;
#endif
#ifdef USE_SPECULAR
	uniform float specularIntensity;
	uniform vec3 specularColor;
	#ifdef USE_SPECULAR_COLORMAP
		uniform sampler2D specularColorMap;
	#endif
	#ifdef USE_SPECULAR_INTENSITYMAP
		uniform sampler2D specularIntensityMap;
	#endif
#endif
#ifdef USE_CLEARCOAT
	uniform float clearcoat;
	uniform float clearcoatRoughness;
#endif
#ifdef USE_DIFFUSE_ROUGHNESS
	uniform float diffuseRoughness;
	#ifdef USE_DIFFUSE_ROUGHNESSMAP
		uniform sampler2D diffuseRoughnessMap;
	#endif
#endif
#ifdef USE_DISPERSION
	uniform float dispersion;
#endif
#ifdef USE_RETROREFLECTION
	uniform float retroreflectivity;
#endif
#ifdef USE_IRIDESCENCE
	uniform float iridescence;
	uniform float iridescenceIOR;
	uniform float iridescenceThicknessMinimum;
	uniform float iridescenceThicknessMaximum;
#endif
#ifdef USE_SHEEN
	uniform vec3 sheenColor;
	uniform float sheenRoughness;
	#ifdef USE_SHEEN_COLORMAP
		uniform sampler2D sheenColorMap;
	#endif
	#ifdef USE_SHEEN_ROUGHNESSMAP
		uniform sampler2D sheenRoughnessMap;
	#endif
#endif
#ifdef USE_ANISOTROPY
	uniform vec2 anisotropyVector;
	#ifdef USE_ANISOTROPYMAP
		uniform sampler2D anisotropyMap;
	#endif
#endif
varying vec3 vViewPosition;
#include <common>
#include <dithering_pars_fragment>
#include <color_pars_fragment>
#include <uv_pars_fragment>
#include <map_pars_fragment>
#include <alphamap_pars_fragment>
#include <alphatest_pars_fragment>
#include <alphahash_pars_fragment>
#include <aomap_pars_fragment>
#include <lightmap_pars_fragment>
#include <emissivemap_pars_fragment>
#include <iridescence_fragment>
#include <envmap_common_pars_fragment>
#include <envmap_physical_pars_fragment>
#include <fog_pars_fragment>
#include <lights_pars_begin>
#include <normal_pars_fragment>
#include <lights_physical_pars_fragment>
#include <transmission_pars_fragment>
#include <shadowmap_pars_fragment>
#include <bumpmap_pars_fragment>
#include <normalmap_pars_fragment>
#include <clearcoat_pars_fragment>
#include <iridescence_pars_fragment>
#include <roughnessmap_pars_fragment>
#include <metalnessmap_pars_fragment>
#include <logdepthbuf_pars_fragment>
#include <clipping_planes_pars_fragment>
void main() {
	vec4 diffuseColor = vec4( diffuse, opacity );
	#include <clipping_planes_fragment>
	ReflectedLight reflectedLight = ReflectedLight( vec3( 0.0 ), vec3( 0.0 ), vec3( 0.0 ), vec3( 0.0 ) );
	vec3 totalEmissiveRadiance = emissive;
	#include <logdepthbuf_fragment>
	#include <map_fragment>
	#include <color_fragment>
	#include <alphamap_fragment>
	#include <alphatest_fragment>
	#include <alphahash_fragment>
	#include <roughnessmap_fragment>
	#include <metalnessmap_fragment>
	#include <normal_fragment_begin>
	#include <normal_fragment_maps>
	#include <clearcoat_normal_fragment_begin>
	#include <clearcoat_normal_fragment_maps>
	#include <emissivemap_fragment>
	#include <lights_physical_fragment>
	#include <lights_fragment_begin>
	#include <lights_fragment_maps>
	#include <lights_fragment_end>
	#include <aomap_fragment>
	vec3 totalDiffuse = reflectedLight.directDiffuse + reflectedLight.indirectDiffuse;
	vec3 totalSpecular = reflectedLight.directSpecular + reflectedLight.indirectSpecular;
	#include <transmission_fragment>
	vec3 outgoingLight = totalDiffuse + totalSpecular + totalEmissiveRadiance;
	#ifdef USE_SHEEN
 
		outgoingLight = outgoingLight + sheenSpecularDirect + sheenSpecularIndirect;
 
 	#endif
	#ifdef USE_CLEARCOAT
		float dotNVcc = saturate( dot( geometryClearcoatNormal, geometryViewDir ) );
		vec3 Fcc = F_Schlick( material.clearcoatF0, material.clearcoatF90, dotNVcc );
		outgoingLight = outgoingLight * ( 1.0 - material.clearcoat * Fcc ) + ( clearcoatSpecularDirect + clearcoatSpecularIndirect ) * material.clearcoat;
	#endif
	#include <opaque_fragment>
	#include <tonemapping_fragment>
	#include <colorspace_fragment>
	#include <fog_fragment>
	#include <premultiplied_alpha_fragment>
	#include <dithering_fragment>
}`,tw=`#define TOON
varying vec3 vViewPosition;
#include <common>
#include <batching_pars_vertex>
#include <uv_pars_vertex>
#include <displacementmap_pars_vertex>
#include <color_pars_vertex>
#include <fog_pars_vertex>
#include <normal_pars_vertex>
#include <morphtarget_pars_vertex>
#include <skinning_pars_vertex>
#include <shadowmap_pars_vertex>
#include <logdepthbuf_pars_vertex>
#include <clipping_planes_pars_vertex>
void main() {
	#include <uv_vertex>
	#include <color_vertex>
	#include <morphinstance_vertex>
	#include <morphcolor_vertex>
	#include <batching_vertex>
	#include <beginnormal_vertex>
	#include <morphnormal_vertex>
	#include <skinbase_vertex>
	#include <skinnormal_vertex>
	#include <defaultnormal_vertex>
	#include <normal_vertex>
	#include <begin_vertex>
	#include <morphtarget_vertex>
	#include <skinning_vertex>
	#include <displacementmap_vertex>
	#include <project_vertex>
	#include <logdepthbuf_vertex>
	#include <clipping_planes_vertex>
	vViewPosition = - mvPosition.xyz;
	#include <worldpos_vertex>
	#include <shadowmap_vertex>
	#include <fog_vertex>
}`,nw=`#define TOON
uniform vec3 diffuse;
uniform vec3 emissive;
uniform float opacity;
#include <common>
#include <dithering_pars_fragment>
#include <color_pars_fragment>
#include <uv_pars_fragment>
#include <map_pars_fragment>
#include <alphamap_pars_fragment>
#include <alphatest_pars_fragment>
#include <alphahash_pars_fragment>
#include <aomap_pars_fragment>
#include <lightmap_pars_fragment>
#include <emissivemap_pars_fragment>
#include <gradientmap_pars_fragment>
#include <fog_pars_fragment>
#include <bsdfs>
#include <lights_pars_begin>
#include <normal_pars_fragment>
#include <lights_toon_pars_fragment>
#include <shadowmap_pars_fragment>
#include <bumpmap_pars_fragment>
#include <normalmap_pars_fragment>
#include <logdepthbuf_pars_fragment>
#include <clipping_planes_pars_fragment>
void main() {
	vec4 diffuseColor = vec4( diffuse, opacity );
	#include <clipping_planes_fragment>
	ReflectedLight reflectedLight = ReflectedLight( vec3( 0.0 ), vec3( 0.0 ), vec3( 0.0 ), vec3( 0.0 ) );
	vec3 totalEmissiveRadiance = emissive;
	#include <logdepthbuf_fragment>
	#include <map_fragment>
	#include <color_fragment>
	#include <alphamap_fragment>
	#include <alphatest_fragment>
	#include <alphahash_fragment>
	#include <normal_fragment_begin>
	#include <normal_fragment_maps>
	#include <emissivemap_fragment>
	#include <lights_toon_fragment>
	#include <lights_fragment_begin>
	#include <lights_fragment_maps>
	#include <lights_fragment_end>
	#include <aomap_fragment>
	vec3 outgoingLight = reflectedLight.directDiffuse + reflectedLight.indirectDiffuse + totalEmissiveRadiance;
	#include <opaque_fragment>
	#include <tonemapping_fragment>
	#include <colorspace_fragment>
	#include <fog_fragment>
	#include <premultiplied_alpha_fragment>
	#include <dithering_fragment>
}`,iw=`uniform float size;
uniform float scale;
#include <common>
#include <color_pars_vertex>
#include <fog_pars_vertex>
#include <morphtarget_pars_vertex>
#include <logdepthbuf_pars_vertex>
#include <clipping_planes_pars_vertex>
#ifdef USE_POINTS_UV
	varying vec2 vUv;
	uniform mat3 uvTransform;
#endif
void main() {
	#ifdef USE_POINTS_UV
		vUv = ( uvTransform * vec3( uv, 1 ) ).xy;
	#endif
	#include <color_vertex>
	#include <morphinstance_vertex>
	#include <morphcolor_vertex>
	#include <begin_vertex>
	#include <morphtarget_vertex>
	#include <project_vertex>
	gl_PointSize = size;
	#ifdef USE_SIZEATTENUATION
		bool isPerspective = isPerspectiveMatrix( projectionMatrix );
		if ( isPerspective ) gl_PointSize *= ( scale / - mvPosition.z );
	#endif
	#include <logdepthbuf_vertex>
	#include <clipping_planes_vertex>
	#include <worldpos_vertex>
	#include <fog_vertex>
}`,sw=`uniform vec3 diffuse;
uniform float opacity;
#include <common>
#include <color_pars_fragment>
#include <map_particle_pars_fragment>
#include <alphatest_pars_fragment>
#include <alphahash_pars_fragment>
#include <fog_pars_fragment>
#include <logdepthbuf_pars_fragment>
#include <clipping_planes_pars_fragment>
void main() {
	vec4 diffuseColor = vec4( diffuse, opacity );
	#include <clipping_planes_fragment>
	vec3 outgoingLight = vec3( 0.0 );
	#include <logdepthbuf_fragment>
	#include <map_particle_fragment>
	#include <color_fragment>
	#include <alphatest_fragment>
	#include <alphahash_fragment>
	outgoingLight = diffuseColor.rgb;
	#include <opaque_fragment>
	#include <tonemapping_fragment>
	#include <colorspace_fragment>
	#include <fog_fragment>
	#include <premultiplied_alpha_fragment>
}`,rw=`#include <common>
#include <batching_pars_vertex>
#include <fog_pars_vertex>
#include <morphtarget_pars_vertex>
#include <skinning_pars_vertex>
#include <logdepthbuf_pars_vertex>
#include <shadowmap_pars_vertex>
void main() {
	#include <batching_vertex>
	#include <beginnormal_vertex>
	#include <morphinstance_vertex>
	#include <morphnormal_vertex>
	#include <skinbase_vertex>
	#include <skinnormal_vertex>
	#include <defaultnormal_vertex>
	#include <begin_vertex>
	#include <morphtarget_vertex>
	#include <skinning_vertex>
	#include <project_vertex>
	#include <logdepthbuf_vertex>
	#include <worldpos_vertex>
	#include <shadowmap_vertex>
	#include <fog_vertex>
}`,ow=`uniform vec3 color;
uniform float opacity;
#include <common>
#include <fog_pars_fragment>
#include <bsdfs>
#include <lights_pars_begin>
#include <logdepthbuf_pars_fragment>
#include <shadowmap_pars_fragment>
#include <shadowmask_pars_fragment>
void main() {
	#include <logdepthbuf_fragment>
	gl_FragColor = vec4( color, opacity * ( 1.0 - getShadowMask() ) );
	#include <tonemapping_fragment>
	#include <colorspace_fragment>
	#include <fog_fragment>
	#include <premultiplied_alpha_fragment>
}`,aw=`uniform float rotation;
uniform vec2 center;
#include <common>
#include <uv_pars_vertex>
#include <fog_pars_vertex>
#include <logdepthbuf_pars_vertex>
#include <clipping_planes_pars_vertex>
void main() {
	#include <uv_vertex>
	vec4 mvPosition = modelViewMatrix[ 3 ];
	vec2 scale = vec2( length( modelMatrix[ 0 ].xyz ), length( modelMatrix[ 1 ].xyz ) );
	#ifndef USE_SIZEATTENUATION
		bool isPerspective = isPerspectiveMatrix( projectionMatrix );
		if ( isPerspective ) scale *= - mvPosition.z;
	#endif
	vec2 alignedPosition = ( position.xy - ( center - vec2( 0.5 ) ) ) * scale;
	vec2 rotatedPosition;
	rotatedPosition.x = cos( rotation ) * alignedPosition.x - sin( rotation ) * alignedPosition.y;
	rotatedPosition.y = sin( rotation ) * alignedPosition.x + cos( rotation ) * alignedPosition.y;
	mvPosition.xy += rotatedPosition;
	gl_Position = projectionMatrix * mvPosition;
	#include <logdepthbuf_vertex>
	#include <clipping_planes_vertex>
	#include <fog_vertex>
}`,lw=`uniform vec3 diffuse;
uniform float opacity;
#include <common>
#include <uv_pars_fragment>
#include <map_pars_fragment>
#include <alphamap_pars_fragment>
#include <alphatest_pars_fragment>
#include <alphahash_pars_fragment>
#include <fog_pars_fragment>
#include <logdepthbuf_pars_fragment>
#include <clipping_planes_pars_fragment>
void main() {
	vec4 diffuseColor = vec4( diffuse, opacity );
	#include <clipping_planes_fragment>
	vec3 outgoingLight = vec3( 0.0 );
	#include <logdepthbuf_fragment>
	#include <map_fragment>
	#include <alphamap_fragment>
	#include <alphatest_fragment>
	#include <alphahash_fragment>
	outgoingLight = diffuseColor.rgb;
	#include <opaque_fragment>
	#include <tonemapping_fragment>
	#include <colorspace_fragment>
	#include <fog_fragment>
}`,At={alphahash_fragment:IS,alphahash_pars_fragment:PS,alphamap_fragment:LS,alphamap_pars_fragment:DS,alphatest_fragment:NS,alphatest_pars_fragment:US,aomap_fragment:OS,aomap_pars_fragment:FS,batching_pars_vertex:BS,batching_vertex:kS,begin_vertex:zS,beginnormal_vertex:HS,bsdfs:GS,iridescence_fragment:VS,bumpmap_pars_fragment:WS,clipping_planes_fragment:XS,clipping_planes_pars_fragment:qS,clipping_planes_pars_vertex:YS,clipping_planes_vertex:ZS,color_fragment:KS,color_pars_fragment:$S,color_pars_vertex:JS,color_vertex:jS,common:QS,defaultnormal_vertex:eM,displacementmap_pars_vertex:tM,displacementmap_vertex:nM,emissivemap_fragment:iM,emissivemap_pars_fragment:sM,colorspace_fragment:rM,colorspace_pars_fragment:oM,envmap_fragment:aM,envmap_common_pars_fragment:lM,envmap_pars_fragment:cM,envmap_pars_vertex:hM,envmap_physical_pars_fragment:SM,envmap_vertex:uM,fog_vertex:fM,fog_pars_vertex:dM,fog_fragment:pM,fog_pars_fragment:mM,gradientmap_pars_fragment:gM,lightmap_pars_fragment:_M,lights_lambert_fragment:xM,lights_lambert_pars_fragment:vM,lights_pars_begin:yM,lights_toon_fragment:MM,lights_toon_pars_fragment:bM,lights_phong_fragment:wM,lights_phong_pars_fragment:EM,lights_physical_fragment:TM,lights_physical_pars_fragment:AM,lights_fragment_begin:RM,lights_fragment_maps:CM,lights_fragment_end:IM,lightprobes_pars_fragment:PM,logdepthbuf_fragment:LM,logdepthbuf_pars_fragment:DM,logdepthbuf_pars_vertex:NM,logdepthbuf_vertex:UM,map_fragment:OM,map_pars_fragment:FM,map_particle_fragment:BM,map_particle_pars_fragment:kM,metalnessmap_fragment:zM,metalnessmap_pars_fragment:HM,morphinstance_vertex:GM,morphcolor_vertex:VM,morphnormal_vertex:WM,morphtarget_pars_vertex:XM,morphtarget_vertex:qM,normal_fragment_begin:YM,normal_fragment_maps:ZM,normal_pars_fragment:KM,normal_pars_vertex:$M,normal_vertex:JM,normalmap_pars_fragment:jM,clearcoat_normal_fragment_begin:QM,clearcoat_normal_fragment_maps:eb,clearcoat_pars_fragment:tb,iridescence_pars_fragment:nb,opaque_fragment:ib,packing:sb,premultiplied_alpha_fragment:rb,project_vertex:ob,dithering_fragment:ab,dithering_pars_fragment:lb,roughnessmap_fragment:cb,roughnessmap_pars_fragment:hb,shadowmap_pars_fragment:ub,shadowmap_pars_vertex:fb,shadowmap_vertex:db,shadowmask_pars_fragment:pb,skinbase_vertex:mb,skinning_pars_vertex:gb,skinning_vertex:_b,skinnormal_vertex:xb,specularmap_fragment:vb,specularmap_pars_fragment:yb,tonemapping_fragment:Sb,tonemapping_pars_fragment:Mb,transmission_fragment:bb,transmission_pars_fragment:wb,uv_pars_fragment:Eb,uv_pars_vertex:Tb,uv_vertex:Ab,worldpos_vertex:Rb,background_vert:Cb,background_frag:Ib,backgroundCube_vert:Pb,backgroundCube_frag:Lb,cube_vert:Db,cube_frag:Nb,depth_vert:Ub,depth_frag:Ob,distance_vert:Fb,distance_frag:Bb,equirect_vert:kb,equirect_frag:zb,linedashed_vert:Hb,linedashed_frag:Gb,meshbasic_vert:Vb,meshbasic_frag:Wb,meshlambert_vert:Xb,meshlambert_frag:qb,meshmatcap_vert:Yb,meshmatcap_frag:Zb,meshnormal_vert:Kb,meshnormal_frag:$b,meshphong_vert:Jb,meshphong_frag:jb,meshphysical_vert:Qb,meshphysical_frag:ew,meshtoon_vert:tw,meshtoon_frag:nw,points_vert:iw,points_frag:sw,shadow_vert:rw,shadow_frag:ow,sprite_vert:aw,sprite_frag:lw},Ye={common:{diffuse:{value:new ft(16777215)},opacity:{value:1},map:{value:null},mapTransform:{value:new yt},alphaMap:{value:null},alphaMapTransform:{value:new yt},alphaTest:{value:0}},specularmap:{specularMap:{value:null},specularMapTransform:{value:new yt}},envmap:{envMap:{value:null},envMapRotation:{value:new yt},reflectivity:{value:1},ior:{value:1.5},refractionRatio:{value:.98},dfgLUT:{value:null}},aomap:{aoMap:{value:null},aoMapIntensity:{value:1},aoMapTransform:{value:new yt}},lightmap:{lightMap:{value:null},lightMapIntensity:{value:1},lightMapTransform:{value:new yt}},bumpmap:{bumpMap:{value:null},bumpMapTransform:{value:new yt},bumpScale:{value:1}},normalmap:{normalMap:{value:null},normalMapTransform:{value:new yt},normalScale:{value:new lt(1,1)}},displacementmap:{displacementMap:{value:null},displacementMapTransform:{value:new yt},displacementScale:{value:1},displacementBias:{value:0}},emissivemap:{emissiveMap:{value:null},emissiveMapTransform:{value:new yt}},metalnessmap:{metalnessMap:{value:null},metalnessMapTransform:{value:new yt}},roughnessmap:{roughnessMap:{value:null},roughnessMapTransform:{value:new yt}},gradientmap:{gradientMap:{value:null}},fog:{fogDensity:{value:25e-5},fogNear:{value:1},fogFar:{value:2e3},fogColor:{value:new ft(16777215)}},lights:{ambientLightColor:{value:[]},lightProbe:{value:[]},sunLights:{value:[],properties:{direction:{},color:{}}},sunLightShadows:{value:[],properties:{shadowIntensity:1,shadowBias:{},shadowNormalBias:{},shadowRadius:{},shadowMapSize:{}}},sunShadowMatrix:{value:[]},sunShadowCascade:{value:[]},directionalLights:{value:[],properties:{direction:{},color:{}}},directionalLightShadows:{value:[],properties:{shadowIntensity:1,shadowBias:{},shadowNormalBias:{},shadowRadius:{},shadowMapSize:{}}},directionalShadowMatrix:{value:[]},spotLights:{value:[],properties:{color:{},position:{},direction:{},distance:{},coneCos:{},penumbraCos:{},decay:{}}},spotLightShadows:{value:[],properties:{shadowIntensity:1,shadowBias:{},shadowNormalBias:{},shadowRadius:{},shadowMapSize:{}}},spotLightMap:{value:[]},spotLightMatrix:{value:[]},pointLights:{value:[],properties:{color:{},position:{},decay:{},distance:{}}},pointLightShadows:{value:[],properties:{shadowIntensity:1,shadowBias:{},shadowNormalBias:{},shadowRadius:{},shadowMapSize:{},shadowCameraNear:{},shadowCameraFar:{}}},pointShadowMatrix:{value:[]},hemisphereLights:{value:[],properties:{direction:{},skyColor:{},groundColor:{}}},rectAreaLights:{value:[],properties:{color:{},position:{},width:{},height:{}}},ltc_1:{value:null},ltc_2:{value:null},probesSH:{value:[]},probesMin:{value:[]},probesMax:{value:[]},probesResolution:{value:[]}},points:{diffuse:{value:new ft(16777215)},opacity:{value:1},size:{value:1},scale:{value:1},map:{value:null},alphaMap:{value:null},alphaMapTransform:{value:new yt},alphaTest:{value:0},uvTransform:{value:new yt}},sprite:{diffuse:{value:new ft(16777215)},opacity:{value:1},center:{value:new lt(.5,.5)},rotation:{value:0},map:{value:null},mapTransform:{value:new yt},alphaMap:{value:null},alphaMapTransform:{value:new yt},alphaTest:{value:0}}},Ts={basic:{uniforms:ni([Ye.common,Ye.specularmap,Ye.envmap,Ye.aomap,Ye.lightmap,Ye.fog]),vertexShader:At.meshbasic_vert,fragmentShader:At.meshbasic_frag},lambert:{uniforms:ni([Ye.common,Ye.specularmap,Ye.envmap,Ye.aomap,Ye.lightmap,Ye.emissivemap,Ye.bumpmap,Ye.normalmap,Ye.displacementmap,Ye.fog,Ye.lights,{emissive:{value:new ft(0)},envMapIntensity:{value:1}}]),vertexShader:At.meshlambert_vert,fragmentShader:At.meshlambert_frag},phong:{uniforms:ni([Ye.common,Ye.specularmap,Ye.envmap,Ye.aomap,Ye.lightmap,Ye.emissivemap,Ye.bumpmap,Ye.normalmap,Ye.displacementmap,Ye.fog,Ye.lights,{emissive:{value:new ft(0)},specular:{value:new ft(1118481)},shininess:{value:30},envMapIntensity:{value:1}}]),vertexShader:At.meshphong_vert,fragmentShader:At.meshphong_frag},standard:{uniforms:ni([Ye.common,Ye.envmap,Ye.aomap,Ye.lightmap,Ye.emissivemap,Ye.bumpmap,Ye.normalmap,Ye.displacementmap,Ye.roughnessmap,Ye.metalnessmap,Ye.fog,Ye.lights,{emissive:{value:new ft(0)},roughness:{value:1},metalness:{value:0},envMapIntensity:{value:1}}]),vertexShader:At.meshphysical_vert,fragmentShader:At.meshphysical_frag},toon:{uniforms:ni([Ye.common,Ye.aomap,Ye.lightmap,Ye.emissivemap,Ye.bumpmap,Ye.normalmap,Ye.displacementmap,Ye.gradientmap,Ye.fog,Ye.lights,{emissive:{value:new ft(0)}}]),vertexShader:At.meshtoon_vert,fragmentShader:At.meshtoon_frag},matcap:{uniforms:ni([Ye.common,Ye.bumpmap,Ye.normalmap,Ye.displacementmap,Ye.fog,{matcap:{value:null}}]),vertexShader:At.meshmatcap_vert,fragmentShader:At.meshmatcap_frag},points:{uniforms:ni([Ye.points,Ye.fog]),vertexShader:At.points_vert,fragmentShader:At.points_frag},dashed:{uniforms:ni([Ye.common,Ye.fog,{scale:{value:1},dashSize:{value:1},totalSize:{value:2}}]),vertexShader:At.linedashed_vert,fragmentShader:At.linedashed_frag},depth:{uniforms:ni([Ye.common,Ye.displacementmap]),vertexShader:At.depth_vert,fragmentShader:At.depth_frag},normal:{uniforms:ni([Ye.common,Ye.bumpmap,Ye.normalmap,Ye.displacementmap,{opacity:{value:1}}]),vertexShader:At.meshnormal_vert,fragmentShader:At.meshnormal_frag},sprite:{uniforms:ni([Ye.sprite,Ye.fog]),vertexShader:At.sprite_vert,fragmentShader:At.sprite_frag},background:{uniforms:{uvTransform:{value:new yt},t2D:{value:null},backgroundIntensity:{value:1}},vertexShader:At.background_vert,fragmentShader:At.background_frag},backgroundCube:{uniforms:{envMap:{value:null},backgroundBlurriness:{value:0},backgroundIntensity:{value:1},backgroundRotation:{value:new yt}},vertexShader:At.backgroundCube_vert,fragmentShader:At.backgroundCube_frag},cube:{uniforms:{tCube:{value:null},tFlip:{value:-1},opacity:{value:1}},vertexShader:At.cube_vert,fragmentShader:At.cube_frag},equirect:{uniforms:{tEquirect:{value:null}},vertexShader:At.equirect_vert,fragmentShader:At.equirect_frag},distance:{uniforms:ni([Ye.common,Ye.displacementmap,{referencePosition:{value:new Q},nearDistance:{value:1},farDistance:{value:1e3}}]),vertexShader:At.distance_vert,fragmentShader:At.distance_frag},shadow:{uniforms:ni([Ye.lights,Ye.fog,{color:{value:new ft(0)},opacity:{value:1}}]),vertexShader:At.shadow_vert,fragmentShader:At.shadow_frag}};Ts.physical={uniforms:ni([Ts.standard.uniforms,{clearcoat:{value:0},clearcoatMap:{value:null},clearcoatMapTransform:{value:new yt},clearcoatNormalMap:{value:null},clearcoatNormalMapTransform:{value:new yt},clearcoatNormalScale:{value:new lt(1,1)},clearcoatRoughness:{value:0},clearcoatRoughnessMap:{value:null},clearcoatRoughnessMapTransform:{value:new yt},diffuseRoughness:{value:0},diffuseRoughnessMap:{value:null},diffuseRoughnessMapTransform:{value:new yt},dispersion:{value:0},retroreflectivity:{value:0},iridescence:{value:0},iridescenceMap:{value:null},iridescenceMapTransform:{value:new yt},iridescenceIOR:{value:1.3},iridescenceThicknessMinimum:{value:100},iridescenceThicknessMaximum:{value:400},iridescenceThicknessMap:{value:null},iridescenceThicknessMapTransform:{value:new yt},sheen:{value:0},sheenColor:{value:new ft(0)},sheenColorMap:{value:null},sheenColorMapTransform:{value:new yt},sheenRoughness:{value:1},sheenRoughnessMap:{value:null},sheenRoughnessMapTransform:{value:new yt},transmission:{value:0},transmissionMap:{value:null},transmissionMapTransform:{value:new yt},transmissionSamplerSize:{value:new lt},transmissionSamplerMap:{value:null},thickness:{value:0},thicknessMap:{value:null},thicknessMapTransform:{value:new yt},attenuationDistance:{value:0},attenuationColor:{value:new ft(0)},specularColor:{value:new ft(1,1,1)},specularColorMap:{value:null},specularColorMapTransform:{value:new yt},specularIntensity:{value:1},specularIntensityMap:{value:null},specularIntensityMapTransform:{value:new yt},anisotropyVector:{value:new lt},anisotropyMap:{value:null},anisotropyMapTransform:{value:new yt}}]),vertexShader:At.meshphysical_vert,fragmentShader:At.meshphysical_frag};var qh={r:0,b:0,g:0},cw=new Mt,m_=new yt;m_.set(-1,0,0,0,1,0,0,0,1);function hw(i,e,t,n,s,r){let o=new ft(0),a=s===!0?0:1,l,c,h=null,u=0,f=null;function p(b){let P=b.isScene===!0?b.background:null;if(P&&P.isTexture){let w=b.backgroundBlurriness>0;P=e.get(P,w)}return P}function x(b){let P=!1,w=p(b);w===null?g(o,a):w&&w.isColor&&(g(w,1),P=!0);let D=i.xr.getEnvironmentBlendMode();D==="additive"?t.buffers.color.setClear(0,0,0,1,r):D==="alpha-blend"&&t.buffers.color.setClear(0,0,0,0,r),(i.autoClear||P)&&(t.buffers.depth.setTest(!0),t.buffers.depth.setMask(!0),t.buffers.color.setMask(!0),i.clear(i.autoClearColor,i.autoClearDepth,i.autoClearStencil))}function M(b,P){let w=p(P);w&&w.isCubeTexture?(c===void 0&&(c=new In(new Qo(1,1,1),new fi({name:"BackgroundCubeMaterial",uniforms:oo(Ts.backgroundCube.uniforms),vertexShader:Ts.backgroundCube.vertexShader,fragmentShader:Ts.backgroundCube.fragmentShader,side:pi,depthTest:!1,depthWrite:!1,fog:!1,allowOverride:!1})),c.geometry.deleteAttribute("normal"),c.geometry.deleteAttribute("uv"),c.onBeforeRender=function(D,I,y){this.matrixWorld.copyPosition(y.matrixWorld)},Object.defineProperty(c.material,"envMap",{get:function(){return this.uniforms.envMap.value}}),n.update(c)),c.material.uniforms.envMap.value=w,c.material.uniforms.backgroundBlurriness.value=P.backgroundBlurriness,c.material.uniforms.backgroundIntensity.value=P.backgroundIntensity,c.material.uniforms.backgroundRotation.value.setFromMatrix4(cw.makeRotationFromEuler(P.backgroundRotation)).transpose(),w.isRenderTargetTexture===!1&&c.material.uniforms.backgroundRotation.value.premultiply(m_),c.material.toneMapped=Ct.getTransfer(w.colorSpace)!==qt,(h!==w||u!==w.version||f!==i.toneMapping)&&(c.material.needsUpdate=!0,h=w,u=w.version,f=i.toneMapping),c.layers.enableAll(),b.unshift(c,c.geometry,c.material,0,0,null)):w&&w.isTexture&&(l===void 0&&(l=new In(new Ss(2,2),new fi({name:"BackgroundMaterial",uniforms:oo(Ts.background.uniforms),vertexShader:Ts.background.vertexShader,fragmentShader:Ts.background.fragmentShader,side:bs,depthTest:!1,depthWrite:!1,fog:!1,allowOverride:!1})),l.geometry.deleteAttribute("normal"),Object.defineProperty(l.material,"map",{get:function(){return this.uniforms.t2D.value}}),n.update(l)),l.material.uniforms.t2D.value=w,l.material.uniforms.backgroundIntensity.value=P.backgroundIntensity,l.material.toneMapped=Ct.getTransfer(w.colorSpace)!==qt,w.matrixAutoUpdate===!0&&w.updateMatrix(),l.material.uniforms.uvTransform.value.copy(w.matrix),(h!==w||u!==w.version||f!==i.toneMapping)&&(l.material.needsUpdate=!0,h=w,u=w.version,f=i.toneMapping),l.layers.enableAll(),b.unshift(l,l.geometry,l.material,0,0,null))}function g(b,P){b.getRGB(qh,Sd(i)),t.buffers.color.setClear(qh.r,qh.g,qh.b,P,r)}function _(){c!==void 0&&(c.geometry.dispose(),c.material.dispose(),c=void 0),l!==void 0&&(l.geometry.dispose(),l.material.dispose(),l=void 0)}return{getClearColor:function(){return o},setClearColor:function(b,P=1){o.set(b),a=P,g(o,a)},getClearAlpha:function(){return a},setClearAlpha:function(b){a=b,g(o,a)},render:x,addToRenderList:M,dispose:_}}function uw(i,e){let t=i.getParameter(i.MAX_VERTEX_ATTRIBS),n={},s=f(null),r=s,o=!1;function a(O,Y,Z,U,W){let $=!1,q=u(O,U,Z,Y);r!==q&&(r=q,c(r.object)),$=p(O,U,Z,W),$&&x(O,U,Z,W),W!==null&&e.update(W,i.ELEMENT_ARRAY_BUFFER),($||o)&&(o=!1,w(O,Y,Z,U),W!==null&&i.bindBuffer(i.ELEMENT_ARRAY_BUFFER,e.get(W).buffer))}function l(){return i.createVertexArray()}function c(O){return i.bindVertexArray(O)}function h(O){return i.deleteVertexArray(O)}function u(O,Y,Z,U){let W=U.wireframe===!0,$=n[Y.id];$===void 0&&($={},n[Y.id]=$);let q=O.isInstancedMesh===!0?O.id:0,xe=$[q];xe===void 0&&(xe={},$[q]=xe);let ne=xe[Z.id];ne===void 0&&(ne={},xe[Z.id]=ne);let se=ne[W];return se===void 0&&(se=f(l()),ne[W]=se),se}function f(O){let Y=[],Z=[],U=[];for(let W=0;W<t;W++)Y[W]=0,Z[W]=0,U[W]=0;return{geometry:null,program:null,wireframe:!1,newAttributes:Y,enabledAttributes:Z,attributeDivisors:U,object:O,attributes:{},index:null}}function p(O,Y,Z,U){let W=r.attributes,$=Y.attributes,q=0,xe=Z.getAttributes();for(let ne in xe)if(xe[ne].location>=0){let de=W[ne],ge=$[ne];if(ge===void 0&&(ne==="instanceMatrix"&&O.instanceMatrix&&(ge=O.instanceMatrix),ne==="instanceColor"&&O.instanceColor&&(ge=O.instanceColor)),de===void 0||de.attribute!==ge||ge&&de.data!==ge.data)return!0;q++}return r.attributesNum!==q||r.index!==U}function x(O,Y,Z,U){let W={},$=Y.attributes,q=0,xe=Z.getAttributes();for(let ne in xe)if(xe[ne].location>=0){let de=$[ne];de===void 0&&(ne==="instanceMatrix"&&O.instanceMatrix&&(de=O.instanceMatrix),ne==="instanceColor"&&O.instanceColor&&(de=O.instanceColor));let ge={};ge.attribute=de,de&&de.data&&(ge.data=de.data),W[ne]=ge,q++}r.attributes=W,r.attributesNum=q,r.index=U}function M(){let O=r.newAttributes;for(let Y=0,Z=O.length;Y<Z;Y++)O[Y]=0}function g(O){_(O,0)}function _(O,Y){let Z=r.newAttributes,U=r.enabledAttributes,W=r.attributeDivisors;Z[O]=1,U[O]===0&&(i.enableVertexAttribArray(O),U[O]=1),W[O]!==Y&&(i.vertexAttribDivisor(O,Y),W[O]=Y)}function b(){let O=r.newAttributes,Y=r.enabledAttributes;for(let Z=0,U=Y.length;Z<U;Z++)Y[Z]!==O[Z]&&(i.disableVertexAttribArray(Z),Y[Z]=0)}function P(O,Y,Z,U,W,$,q){q===!0?i.vertexAttribIPointer(O,Y,Z,W,$):i.vertexAttribPointer(O,Y,Z,U,W,$)}function w(O,Y,Z,U){M();let W=U.attributes,$=Z.getAttributes(),q=Y.defaultAttributeValues;for(let xe in $){let ne=$[xe];if(ne.location>=0){let se=W[xe];if(se===void 0&&(xe==="instanceMatrix"&&O.instanceMatrix&&(se=O.instanceMatrix),xe==="instanceColor"&&O.instanceColor&&(se=O.instanceColor)),se!==void 0){let de=se.normalized,ge=se.itemSize,pe=e.get(se);if(pe===void 0)continue;let re=pe.buffer,Te=pe.type,Ie=pe.bytesPerElement,Oe=Te===i.INT||Te===i.UNSIGNED_INT||se.gpuType===lh;if(se.isInterleavedBufferAttribute){let ye=se.data,$e=ye.isInterleavedBuffer===!0?ye.stride:ye.itemSize,ut=se.offset;if(ye.isInstancedInterleavedBuffer||ye.isInstancedBufferAttribute){for(let et=0;et<ne.locationSize;et++)_(ne.location+et,ye.meshPerAttribute);O.isInstancedMesh!==!0&&U._maxInstanceCount===void 0&&(U._maxInstanceCount=ye.meshPerAttribute*ye.count)}else for(let et=0;et<ne.locationSize;et++)g(ne.location+et);i.bindBuffer(i.ARRAY_BUFFER,re);for(let et=0;et<ne.locationSize;et++)P(ne.location+et,ge/ne.locationSize,Te,de,$e*Ie,(ut+ge/ne.locationSize*et)*Ie,Oe)}else{if(se.isInstancedBufferAttribute){for(let ye=0;ye<ne.locationSize;ye++)_(ne.location+ye,se.meshPerAttribute);O.isInstancedMesh!==!0&&U._maxInstanceCount===void 0&&(U._maxInstanceCount=se.meshPerAttribute*se.count)}else for(let ye=0;ye<ne.locationSize;ye++)g(ne.location+ye);i.bindBuffer(i.ARRAY_BUFFER,re);for(let ye=0;ye<ne.locationSize;ye++)P(ne.location+ye,ge/ne.locationSize,Te,de,ge*Ie,ge/ne.locationSize*ye*Ie,Oe)}}else if(q!==void 0){let de=q[xe];if(de!==void 0)switch(de.length){case 2:i.vertexAttrib2fv(ne.location,de);break;case 3:i.vertexAttrib3fv(ne.location,de);break;case 4:i.vertexAttrib4fv(ne.location,de);break;default:i.vertexAttrib1fv(ne.location,de)}}}}b()}function D(){G();for(let O in n){let Y=n[O];for(let Z in Y){let U=Y[Z];for(let W in U){let $=U[W];for(let q in $)h($[q].object),delete $[q];delete U[W]}}delete n[O]}}function I(O){if(n[O.id]===void 0)return;let Y=n[O.id];for(let Z in Y){let U=Y[Z];for(let W in U){let $=U[W];for(let q in $)h($[q].object),delete $[q];delete U[W]}}delete n[O.id]}function y(O){for(let Y in n){let Z=n[Y];for(let U in Z){let W=Z[U];if(W[O.id]===void 0)continue;let $=W[O.id];for(let q in $)h($[q].object),delete $[q];delete W[O.id]}}}function T(O){for(let Y in n){let Z=n[Y],U=O.isInstancedMesh===!0?O.id:0,W=Z[U];if(W!==void 0){for(let $ in W){let q=W[$];for(let xe in q)h(q[xe].object),delete q[xe];delete W[$]}delete Z[U],Object.keys(Z).length===0&&delete n[Y]}}}function G(){k(),o=!0,r!==s&&(r=s,c(r.object))}function k(){s.geometry=null,s.program=null,s.wireframe=!1}return{setup:a,reset:G,resetDefaultState:k,dispose:D,releaseStatesOfGeometry:I,releaseStatesOfObject:T,releaseStatesOfProgram:y,initAttributes:M,enableAttribute:g,disableUnusedAttributes:b}}function fw(i,e,t){let n;function s(l){n=l}function r(l,c){i.drawArrays(n,l,c),t.update(c,n,1)}function o(l,c,h){h!==0&&(i.drawArraysInstanced(n,l,c,h),t.update(c,n,h))}function a(l,c,h){if(h===0)return;e.get("WEBGL_multi_draw").multiDrawArraysWEBGL(n,l,0,c,0,h);let f=0;for(let p=0;p<h;p++)f+=c[p];t.update(f,n,1)}this.setMode=s,this.render=r,this.renderInstances=o,this.renderMultiDraw=a}function dw(i,e,t,n){let s;function r(){if(s!==void 0)return s;if(e.has("EXT_texture_filter_anisotropic")===!0){let y=e.get("EXT_texture_filter_anisotropic");s=i.getParameter(y.MAX_TEXTURE_MAX_ANISOTROPY_EXT)}else s=0;return s}function o(y){return!(y!==un&&n.convert(y)!==i.getParameter(i.IMPLEMENTATION_COLOR_READ_FORMAT))}function a(y){let T=y===hn&&(e.has("EXT_color_buffer_half_float")||e.has("EXT_color_buffer_float"));return!(y!==ti&&y!==Pn&&!T&&n.convert(y)!==i.getParameter(i.IMPLEMENTATION_COLOR_READ_TYPE))}function l(y){if(y==="highp"){if(i.getShaderPrecisionFormat(i.VERTEX_SHADER,i.HIGH_FLOAT).precision>0&&i.getShaderPrecisionFormat(i.FRAGMENT_SHADER,i.HIGH_FLOAT).precision>0)return"highp";y="mediump"}return y==="mediump"&&i.getShaderPrecisionFormat(i.VERTEX_SHADER,i.MEDIUM_FLOAT).precision>0&&i.getShaderPrecisionFormat(i.FRAGMENT_SHADER,i.MEDIUM_FLOAT).precision>0?"mediump":"lowp"}let c=t.precision!==void 0?t.precision:"highp",h=l(c);h!==c&&(nt("WebGLRenderer:",c,"not supported, using",h,"instead."),c=h);let u=t.reversedDepthBuffer===!0&&e.has("EXT_clip_control"),f=t.logarithmicDepthBuffer===!0&&u===!1;t.reversedDepthBuffer===!0&&u===!1&&nt("WebGLRenderer: Unable to use reversed depth buffer due to missing EXT_clip_control extension. Fallback to default depth buffer."),t.logarithmicDepthBuffer===!0&&u===!0&&nt("WebGLRenderer: Logarithmic depth buffer is ignored when reversed depth buffer is enabled.");let p=i.getParameter(i.MAX_TEXTURE_IMAGE_UNITS),x=i.getParameter(i.MAX_VERTEX_TEXTURE_IMAGE_UNITS),M=i.getParameter(i.MAX_TEXTURE_SIZE),g=i.getParameter(i.MAX_CUBE_MAP_TEXTURE_SIZE),_=i.getParameter(i.MAX_VERTEX_ATTRIBS),b=i.getParameter(i.MAX_VERTEX_UNIFORM_VECTORS),P=i.getParameter(i.MAX_VARYING_VECTORS),w=i.getParameter(i.MAX_FRAGMENT_UNIFORM_VECTORS),D=i.getParameter(i.MAX_SAMPLES),I=i.getParameter(i.SAMPLES);return{isWebGL2:!0,getMaxAnisotropy:r,getMaxPrecision:l,textureFormatReadable:o,textureTypeReadable:a,precision:c,logarithmicDepthBuffer:f,reversedDepthBuffer:u,maxTextures:p,maxVertexTextures:x,maxTextureSize:M,maxCubemapSize:g,maxAttributes:_,maxVertexUniforms:b,maxVaryings:P,maxFragmentUniforms:w,maxSamples:D,samples:I}}function pw(i){let e=this,t=null,n=0,s=!1,r=!1,o=new Li,a=new yt,l={value:null,needsUpdate:!1};this.uniform=l,this.numPlanes=0,this.numIntersection=0,this.init=function(u,f){let p=u.length!==0||f||n!==0||s;return s=f,n=u.length,p},this.beginShadows=function(){r=!0,h(null)},this.endShadows=function(){r=!1},this.setGlobalState=function(u,f){t=h(u,f,0)},this.setState=function(u,f,p){let x=u.clippingPlanes,M=u.clipIntersection,g=u.clipShadows,_=i.get(u);if(!s||x===null||x.length===0||r&&!g)r?h(null):c();else{let b=r?0:n,P=b*4,w=_.clippingState||null;l.value=w,w=h(x,f,P,p);for(let D=0;D!==P;++D)w[D]=t[D];_.clippingState=w,this.numIntersection=M?this.numPlanes:0,this.numPlanes+=b}};function c(){l.value!==t&&(l.value=t,l.needsUpdate=n>0),e.numPlanes=n,e.numIntersection=0}function h(u,f,p,x){let M=u!==null?u.length:0,g=null;if(M!==0){if(g=l.value,x!==!0||g===null){let _=p+M*4,b=f.matrixWorldInverse;a.getNormalMatrix(b),(g===null||g.length<_)&&(g=new Float32Array(_));for(let P=0,w=p;P!==M;++P,w+=4)o.copy(u[P]).applyMatrix4(b,a),o.normal.toArray(g,w),g[w+3]=o.constant}l.value=g,l.needsUpdate=!0}return e.numPlanes=M,e.numIntersection=0,g}}var Cl=class extends hi{constructor(e=1,t={}){super(e,e,t),this.isWebGLCubeRenderTarget=!0;let n={width:e,height:e,depth:1},s=[n,n,n,n,n,n];this.texture=new sl(s),this._setTextureOptions(t),this.texture.isRenderTargetTexture=!0}fromEquirectangularTexture(e,t){this.texture.type=t.type,this.texture.colorSpace=t.colorSpace,this.texture.generateMipmaps=t.generateMipmaps,this.texture.minFilter=t.minFilter,this.texture.magFilter=t.magFilter;let n={uniforms:{tEquirect:{value:null}},vertexShader:`

				varying vec3 vWorldDirection;

				vec3 transformDirection( in vec3 dir, in mat4 matrix ) {

					return normalize( ( matrix * vec4( dir, 0.0 ) ).xyz );

				}

				void main() {

					vWorldDirection = transformDirection( position, modelMatrix );

					#include <begin_vertex>
					#include <project_vertex>

				}
			`,fragmentShader:`

				uniform sampler2D tEquirect;

				varying vec3 vWorldDirection;

				#include <common>

				void main() {

					vec3 direction = normalize( vWorldDirection );

					vec2 sampleUV = equirectUv( direction );

					gl_FragColor = texture2D( tEquirect, sampleUV );

				}
			`},s=new Qo(5,5,5),r=new fi({name:"CubemapFromEquirect",uniforms:oo(n.uniforms),vertexShader:n.vertexShader,fragmentShader:n.fragmentShader,side:pi,blending:to});r.uniforms.tEquirect.value=t;let o=new In(s,r),a=t.minFilter;return t.minFilter===Ni&&(t.minFilter=Xt),new na(1,10,this).update(e,o),t.minFilter=a,o.geometry.dispose(),o.material.dispose(),this}clear(e,t=!0,n=!0,s=!0){let r=e.getRenderTarget();for(let o=0;o<6;o++)e.setRenderTarget(this,o),e.clear(t,n,s);e.setRenderTarget(r)}},Y0=256,mw=3,gw=20,g_=256,__=16,_w=3,xw=new Q,vw=new ft,Zh=class i{constructor(e){this._renderer=e,this._cubeSize=0,this._sourceTarget=null,this._cubeCamera=new na(1,10,null),this._boxMesh=new In(new Qo(5,5,5),null),this._cubemapMaterial=null,this._equirectMaterial=null,this._blurMaterial=null,this._ggxMaterial=null,this._integrationMaterial=null}fromScene(e,t=0,n=.1,s=100,r={}){let{size:o=256,position:a=xw}=r,l=this._renderer;this._setSize(o);let c=this._allocateTarget(),h=this._getSourceTarget(!0);t>0&&(h.texture.mipmapsAutoUpdate=!1);let u=l.autoClear,f=l.autoClearColor,p=l.autoClearDepth,x=l.autoClearStencil,M=e.background;l.autoClear=!0,l.autoClearColor=!0,l.autoClearDepth=!0,l.autoClearStencil=!0,M===null&&(e.background=l.getClearColor(vw));let g=new na(n,s,h);return g.position.copy(a),g.update(l,e),l.autoClear=u,l.autoClearColor=f,l.autoClearDepth=p,l.autoClearStencil=x,e.background=M,t>0&&(h.texture.mipmapsAutoUpdate=!0,this._blur(c,t)),this._applyPMREM(c),c}fromEquirectangular(e,t=null){return this._fromTexture(e,t)}fromCubemap(e,t=null){return this._fromTexture(e,t)}compileCubemapShader(){this._cubemapMaterial===null&&(this._cubemapMaterial=$0(),this._compileMaterial(this._cubemapMaterial))}compileEquirectangularShader(){this._equirectMaterial===null&&(this._equirectMaterial=K0(),this._compileMaterial(this._equirectMaterial))}dispose(){this._sourceTarget!==null&&this._sourceTarget.dispose(),this._cubemapMaterial!==null&&this._cubemapMaterial.dispose(),this._equirectMaterial!==null&&this._equirectMaterial.dispose(),this._blurMaterial!==null&&this._blurMaterial.dispose(),this._ggxMaterial!==null&&this._ggxMaterial.dispose(),this._integrationMaterial!==null&&this._integrationMaterial.dispose(),this._boxMesh.geometry.dispose()}static lodToRoughness(e,t){return t>0?1-Math.sqrt(1-e/t):0}_setSize(e){this._cubeSize=Math.max(Y0,xd(e))}_fromTexture(e,t){e.mapping===io||e.mapping===ra?this._setSize(e.image.length===0?Y0:e.image[0].width||e.image[0].image.width):this._setSize(e.image.width/4);let n=t||this._allocateTarget();return this._textureToCubemap(e),this._applyPMREM(n),n}_allocateTarget(){let e=this._cubeSize,t=Z0(e,!1,!1),n=Math.log2(e)-mw;for(let s=0;s<=n;s++)t.texture.mipmaps.push({width:e>>s,height:e>>s});return t.texture.name="PMREM",t.texture.isPMREMTexture=!0,t}_getSourceTarget(e=!1){let t=this._cubeSize,n=this._sourceTarget;return(n===null||n.width!==t||e&&n.depthBuffer===!1)&&(n!==null&&n.dispose(),this._sourceTarget=Z0(t,!0,e)),this._sourceTarget}_compileMaterial(e){this._boxMesh.material=e,this._renderer.compile(this._boxMesh,this._cubeCamera.children[0])}_renderCube(e,t,n){let s=this._boxMesh,r=this._cubeCamera;s.material=n,r.renderTarget=e,r.activeMipmapLevel=t;let o=e.width>>t;e.viewport.set(0,0,o,o),r.update(this._renderer,s),e.viewport.set(0,0,e.width,e.height)}_textureToCubemap(e){let t;e.mapping===io||e.mapping===ra?(this._cubemapMaterial===null&&(this._cubemapMaterial=$0()),t=this._cubemapMaterial,t.uniforms.flipEnvMap.value=e.isRenderTargetTexture===!1?-1:1):(this._equirectMaterial===null&&(this._equirectMaterial=K0()),t=this._equirectMaterial),t.uniforms.envMap.value=e,this._renderCube(this._getSourceTarget(),0,t)}_applyPMREM(e){this._ggxMaterial===null&&(this._ggxMaterial=yw(),this._integrationMaterial=Sw());let t=this._cubeSize,n=e.texture.mipmaps.length-1,s=this._ggxMaterial.uniforms;s.envMap.value=this._sourceTarget.texture;let r=this._integrationMaterial.uniforms;r.envMap.value=this._sourceTarget.texture,r.sourceLod.value=Math.log2(t/__);for(let o=0;o<=n;o++){let a=i.lodToRoughness(o,n);if(o>n-_w)r.roughness.value=a,this._renderCube(e,o,this._integrationMaterial);else{let l=a>0?Math.log2(t)+.5*Math.log2(6/(g_*Math.pow(a,4)))+.5:0;s.roughness.value=a,s.lodBias.value=l,this._renderCube(e,o,this._ggxMaterial)}}}_blur(e,t){this._blurMaterial===null&&(this._blurMaterial=Mw());let n=this._blurMaterial,s=n.uniforms,r=this._sourceTarget;s.sigma.value=Math.min(t,Math.PI)/Math.SQRT2,s.envMap.value=r.texture,this._renderCube(e,0,n),s.envMap.value=e.texture,this._renderCube(r,0,n)}};function Z0(i,e,t){return new Cl(i,{minFilter:Ni,generateMipmaps:e,type:hn,colorSpace:cn,depthBuffer:t})}function Il(i,e,t){return new fi({name:i,uniforms:e,vertexShader:At.cube_vert,fragmentShader:t,side:pi,blending:to,depthTest:!1,depthWrite:!1})}function yw(){return Il("PMREMGGXConvolution",{envMap:{value:null},roughness:{value:0},lodBias:{value:0}},`

		#define GGX_SAMPLES ${g_}u

		varying vec3 vWorldDirection;

		uniform samplerCube envMap;
		uniform float roughness;
		uniform float lodBias;

		#include <common>

		// Van der Corput radical inverse
		float radicalInverse_VdC( uint bits ) {

			bits = ( bits << 16u ) | ( bits >> 16u );
			bits = ( ( bits & 0x55555555u ) << 1u ) | ( ( bits & 0xAAAAAAAAu ) >> 1u );
			bits = ( ( bits & 0x33333333u ) << 2u ) | ( ( bits & 0xCCCCCCCCu ) >> 2u );
			bits = ( ( bits & 0x0F0F0F0Fu ) << 4u ) | ( ( bits & 0xF0F0F0F0u ) >> 4u );
			bits = ( ( bits & 0x00FF00FFu ) << 8u ) | ( ( bits & 0xFF00FF00u ) >> 8u );
			return float( bits ) * 2.3283064365386963e-10; // / 0x100000000

		}

		// Hammersley sequence
		vec2 hammersley( uint i, uint N ) {

			return vec2( float( i ) / float( N ), radicalInverse_VdC( i ) );

		}

		void main() {

			vec3 N = normalize( vWorldDirection );

			// For very low roughness, just sample the environment directly
			if ( roughness < 0.001 ) {

				gl_FragColor = vec4( textureLod( envMap, N, 0.0 ).rgb, 1.0 );
				return;

			}

			float alpha = roughness * roughness;
			float alpha2 = alpha * alpha;

			// Tangent space basis for VNDF sampling
			vec3 up = abs( N.z ) < 0.999 ? vec3( 0.0, 0.0, 1.0 ) : vec3( 1.0, 0.0, 0.0 );
			vec3 tangent = normalize( cross( up, N ) );
			vec3 bitangent = cross( N, tangent );

			vec3 prefilteredColor = vec3( 0.0 );
			float totalWeight = 0.0;

			for ( uint i = 0u; i < GGX_SAMPLES; i ++ ) {

				vec2 Xi = hammersley( i, GGX_SAMPLES );

				// With V = N, sample the reflected direction directly.
				float invQ = 1.0 / ( 1.0 - Xi.x + alpha2 * Xi.x );
				float NdotL = ( 1.0 - Xi.x - alpha2 * Xi.x ) * invQ;

				if ( NdotL > 0.0 ) {

					float phi = 2.0 * PI * Xi.y;
					float sinTheta = 2.0 * alpha * sqrt( Xi.x * ( 1.0 - Xi.x ) ) * invQ;
					vec3 L = N * NdotL + ( tangent * cos( phi ) + bitangent * sin( phi ) ) * sinTheta;

					// Match the source mip to the sample's solid angle. The terms
					// independent of the sample are precomputed in lodBias.
					float d = alpha2 * invQ;
					float lod = max( log2( d ) + lodBias, 0.0 );

					// Weight by NdotL for the split-sum approximation
					prefilteredColor += textureLod( envMap, L, lod ).rgb * NdotL;
					totalWeight += NdotL;

				}

			}

			gl_FragColor = vec4( prefilteredColor / totalWeight, 1.0 );

		}
	`)}function Sw(){return Il("PMREMGGXIntegration",{envMap:{value:null},roughness:{value:0},sourceLod:{value:0},sourceSize:{value:__}},`

		varying vec3 vWorldDirection;

		uniform samplerCube envMap;
		uniform float roughness;
		uniform float sourceLod;
		uniform int sourceSize;

		void main() {

			vec3 N = normalize( vWorldDirection );

			float alpha = roughness * roughness;
			float alpha2 = alpha * alpha;

			float texelSize = 2.0 / float( sourceSize );

			vec3 prefilteredColor = vec3( 0.0 );
			float totalWeight = 0.0;

			// Pair opposite texels: only the one in N's hemisphere contributes.
			for ( int face = 0; face < 3; face ++ ) {

				for ( int y = 0; y < sourceSize; y ++ ) {

					for ( int x = 0; x < sourceSize; x ++ ) {

						vec2 uv = ( vec2( x, y ) + 0.5 ) * texelSize - 1.0;
						vec3 texelDirection = face == 0 ? vec3( 1.0, uv ) : ( face == 1 ? vec3( uv.x, 1.0, uv.y ) : vec3( uv, 1.0 ) );

						float invDistance = inversesqrt( 1.0 + dot( uv, uv ) );
						float NdotL = dot( N, texelDirection );
						texelDirection *= NdotL < 0.0 ? - 1.0 : 1.0;
						NdotL = abs( NdotL ) * invDistance;

						// With V = N, NdotH squared is ( 1 + NdotL ) / 2. Common factors
						// in the GGX distribution and texel solid angle cancel when normalized.
						float d = 1.0 + alpha2 + ( alpha2 - 1.0 ) * NdotL;
						float weight = NdotL * invDistance * invDistance * invDistance / ( d * d );

						prefilteredColor += textureLod( envMap, texelDirection, sourceLod ).rgb * weight;
						totalWeight += weight;

					}

				}

			}

			gl_FragColor = vec4( prefilteredColor / totalWeight, 1.0 );

		}
	`)}function Mw(){return Il("PMREMSphericalGaussianBlur",{envMap:{value:null},sigma:{value:0}},`

		#define SAMPLES ${gw}
		#define GOLDEN_ANGLE 2.39996322973

		varying vec3 vWorldDirection;

		uniform samplerCube envMap;
		uniform float sigma;

		#include <common>

		void main() {

			vec3 outputDirection = normalize( vWorldDirection );

			vec3 up = abs( outputDirection.z ) < 0.999 ? vec3( 0.0, 0.0, 1.0 ) : vec3( 1.0, 0.0, 0.0 );
			vec3 tangent = normalize( cross( up, outputDirection ) );
			vec3 bitangent = cross( outputDirection, tangent );

			// Truncate the kernel at three standard deviations or at the antipode.
			float thetaMax = min( 3.0 * sigma, PI );
			float truncation = 1.0 - exp( - 0.5 * thetaMax * thetaMax / ( sigma * sigma ) );

			vec3 accumColor = vec3( 0.0 );
			float accumWeight = 0.0;

			for ( int i = 0; i < SAMPLES; i ++ ) {

				// Stratified inverse-CDF sampling of the Gaussian, placed on a golden-angle spiral.
				float stratum = ( float( i ) + 0.5 ) / float( SAMPLES );
				float theta = sigma * sqrt( - 2.0 * log( 1.0 - stratum * truncation ) );
				float phi = float( i ) * GOLDEN_ANGLE;

				vec3 offset = cos( phi ) * tangent + sin( phi ) * bitangent;
				vec3 sampleDirection = cos( theta ) * outputDirection + sin( theta ) * offset;

				// Correct the planar sample density to solid angle.
				float weight = sin( theta ) / theta;

				accumColor += weight * textureLod( envMap, sampleDirection, 0.0 ).rgb;
				accumWeight += weight;

			}

			gl_FragColor = vec4( accumColor / accumWeight, 1.0 );

		}
	`)}function K0(){return Il("PMREMEquirectangularToCubemap",{envMap:{value:null}},`

		varying vec3 vWorldDirection;

		uniform sampler2D envMap;

		#include <common>

		void main() {

			// Average four subpixel samples to preserve small, bright features.
			vec3 direction = normalize( vWorldDirection );
			vec3 dx = dFdx( direction ) * 0.25;
			vec3 dy = dFdy( direction ) * 0.25;

			vec3 color = textureLod( envMap, equirectUv( normalize( direction - dx - dy ) ), 0.0 ).rgb;
			color += textureLod( envMap, equirectUv( normalize( direction + dx - dy ) ), 0.0 ).rgb;
			color += textureLod( envMap, equirectUv( normalize( direction - dx + dy ) ), 0.0 ).rgb;
			color += textureLod( envMap, equirectUv( normalize( direction + dx + dy ) ), 0.0 ).rgb;
			gl_FragColor = vec4( color * 0.25, 1.0 );

		}
	`)}function $0(){return Il("PMREMCubemapToCubemap",{envMap:{value:null},flipEnvMap:{value:-1}},`

		varying vec3 vWorldDirection;

		uniform samplerCube envMap;
		uniform float flipEnvMap;

		void main() {

			gl_FragColor = vec4( textureCube( envMap, vec3( flipEnvMap * vWorldDirection.x, vWorldDirection.yz ) ).rgb, 1.0 );

		}
	`)}function bw(i){let e=new WeakMap,t=new WeakMap,n=null;function s(f,p=!1){return f==null?null:p?o(f):r(f)}function r(f){if(f&&f.isTexture){let p=f.mapping;if(p===oa||p===oh)if(e.has(f)){let x=e.get(f).texture;return a(x,f.mapping)}else{let x=f.image;if(x&&x.height>0){let M=new Cl(x.height);return M.fromEquirectangularTexture(i,f),e.set(f,M),f.addEventListener("dispose",c),a(M.texture,f.mapping)}else return null}}return f}function o(f){if(f&&f.isTexture&&f.isPMREMTexture!==!0){let p=f.mapping,x=p===oa||p===oh,M=p===io||p===ra;if(x||M){let g=t.get(f),_=g!==void 0?g.texture.pmremVersion:0;if(f.isRenderTargetTexture&&f.pmremVersion!==_)return n===null&&(n=new Zh(i)),g=x?n.fromEquirectangular(f,g):n.fromCubemap(f,g),g.texture.pmremVersion=f.pmremVersion,t.set(f,g),g.texture;if(g!==void 0)return g.texture;{let b=f.image;return x&&b&&b.height>0||M&&b&&l(b)?(n===null&&(n=new Zh(i)),g=x?n.fromEquirectangular(f):n.fromCubemap(f),g.texture.pmremVersion=f.pmremVersion,t.set(f,g),f.addEventListener("dispose",h),g.texture):null}}}return f}function a(f,p){return p===oa?f.mapping=io:p===oh&&(f.mapping=ra),f}function l(f){let p=0,x=6;for(let M=0;M<x;M++)f[M]!==void 0&&p++;return p===x}function c(f){let p=f.target;p.removeEventListener("dispose",c);let x=e.get(p);x!==void 0&&(e.delete(p),x.dispose())}function h(f){let p=f.target;p.removeEventListener("dispose",h);let x=t.get(p);x!==void 0&&(t.delete(p),x.dispose())}function u(){e=new WeakMap,t=new WeakMap,n!==null&&(n.dispose(),n=null)}return{get:s,dispose:u}}function ww(i){let e={};function t(n){if(e[n]!==void 0)return e[n];let s=i.getExtension(n);return e[n]=s,s}return{has:function(n){return t(n)!==null},init:function(){t("EXT_color_buffer_float"),t("WEBGL_clip_cull_distance"),t("OES_texture_float_linear"),t("EXT_color_buffer_half_float"),t("WEBGL_multisampled_render_to_texture"),t("WEBGL_render_shared_exponent")},get:function(n){let s=t(n);return s===null&&Xr("WebGLRenderer: "+n+" extension not supported."),s}}}function Ew(i,e,t,n){let s={},r=new WeakMap,o=new FinalizationRegistry(x=>delete s[x]);function a(x){l(x.target)}function l(x){x.index!==null&&e.remove(x.index);for(let g in x.attributes)e.remove(x.attributes[g]);x.removeEventListener("dispose",a),delete s[x.id],o.unregister(x);let M=r.get(x);M&&(e.remove(M),r.delete(x)),n.releaseStatesOfGeometry(x),x.isInstancedBufferGeometry===!0&&delete x._maxInstanceCount,t.memory.geometries--}function c(x,M){return s[M.id]!==void 0||(M.addEventListener("dispose",a),s[M.id]=new WeakRef(M),o.register(M,M.id,M),t.memory.geometries++),M}function h(x){let M=x.attributes;for(let g in M)e.update(M[g],i.ARRAY_BUFFER)}function u(x){let M=x.index,g=x.attributes.position,_=0;if(g===void 0)return;let b=M!==null?M.array.length:g.array.length/3-1,P=g.count>=65535?ja:Ja,w=new P(Math.ceil(b/3)*6,1),D=w.array;if(M!==null){let y=M.array;_=M.version;for(let T=0,G=0;T<b;T+=3){let k=y[T+0],O=y[T+1],Y=y[T+2];D[G++]=k,D[G++]=O,D[G++]=O,D[G++]=Y,D[G++]=Y,D[G++]=k}}else{_=g.version;for(let y=0,T=0;y<b;y+=3){let G=y+0,k=y+1,O=y+2;D[T++]=G,D[T++]=k,D[T++]=k,D[T++]=O,D[T++]=O,D[T++]=G}}w.version=_;let I=r.get(x);I&&e.remove(I),r.set(x,w)}function f(x){let M=r.get(x);if(M){let g=x.index;g!==null&&M.version<g.version&&u(x)}else u(x);return r.get(x)}function p(){for(let x in s){let M=s[x].deref();M!==void 0&&l(M)}}return{get:c,update:h,getWireframeAttribute:f,dispose:p}}function Tw(i,e,t){let n;function s(u){n=u}let r,o;function a(u){r=u.type,o=u.bytesPerElement}function l(u,f){i.drawElements(n,f,r,u*o),t.update(f,n,1)}function c(u,f,p){p!==0&&(i.drawElementsInstanced(n,f,r,u*o,p),t.update(f,n,p))}function h(u,f,p){if(p===0)return;e.get("WEBGL_multi_draw").multiDrawElementsWEBGL(n,f,0,r,u,0,p);let M=0;for(let g=0;g<p;g++)M+=f[g];t.update(M,n,1)}this.setMode=s,this.setIndex=a,this.render=l,this.renderInstances=c,this.renderMultiDraw=h}function Aw(i){let e={geometries:0,textures:0},t={frame:0,calls:0,triangles:0,points:0,lines:0};function n(r,o,a){switch(t.calls++,o){case i.TRIANGLES:t.triangles+=a*(r/3);break;case i.LINES:t.lines+=a*(r/2);break;case i.LINE_STRIP:t.lines+=a*(r-1);break;case i.LINE_LOOP:t.lines+=a*r;break;case i.POINTS:t.points+=a*r;break;default:gt("WebGLInfo: Unknown draw mode:",o);break}}function s(){t.calls=0,t.triangles=0,t.points=0,t.lines=0}return{memory:e,render:t,programs:null,autoReset:!0,reset:s,update:n}}function Rw(i,e,t){let n=new WeakMap,s=new $t;function r(o,a,l){let c=o.morphTargetInfluences,h=a.morphAttributes.position||a.morphAttributes.normal||a.morphAttributes.color,u=h!==void 0?h.length:0,f=n.get(a);if(f===void 0||f.count!==u){let G=function(){y.dispose(),n.delete(a),a.removeEventListener("dispose",G)};f!==void 0&&f.texture.dispose();let p=a.morphAttributes.position!==void 0,x=a.morphAttributes.normal!==void 0,M=a.morphAttributes.color!==void 0,g=a.morphAttributes.position||[],_=a.morphAttributes.normal||[],b=a.morphAttributes.color||[],P=0;p===!0&&(P=1),x===!0&&(P=2),M===!0&&(P=3);let w=a.attributes.position.count*P,D=1;w>e.maxTextureSize&&(D=Math.ceil(w/e.maxTextureSize),w=e.maxTextureSize);let I=new Float32Array(w*D*4*u),y=new Ka(I,w,D,u);y.type=Pn,y.needsUpdate=!0;let T=P*4;for(let k=0;k<u;k++){let O=g[k],Y=_[k],Z=b[k],U=w*D*4*k;for(let W=0;W<O.count;W++){let $=W*T;p===!0&&(s.fromBufferAttribute(O,W),I[U+$+0]=s.x,I[U+$+1]=s.y,I[U+$+2]=s.z,I[U+$+3]=0),x===!0&&(s.fromBufferAttribute(Y,W),I[U+$+4]=s.x,I[U+$+5]=s.y,I[U+$+6]=s.z,I[U+$+7]=0),M===!0&&(s.fromBufferAttribute(Z,W),I[U+$+8]=s.x,I[U+$+9]=s.y,I[U+$+10]=s.z,I[U+$+11]=Z.itemSize===4?s.w:1)}}f={count:u,texture:y,size:new lt(w,D)},n.set(a,f),a.addEventListener("dispose",G)}if(o.isInstancedMesh===!0&&o.morphTexture!==null)l.getUniforms().setValue(i,"morphTexture",o.morphTexture,t);else{let p=0;for(let M=0;M<c.length;M++)p+=c[M];let x=a.morphTargetsRelative?1:1-p;l.getUniforms().setValue(i,"morphTargetBaseInfluence",x),l.getUniforms().setValue(i,"morphTargetInfluences",c)}l.getUniforms().setValue(i,"morphTargetsTexture",f.texture,t),l.getUniforms().setValue(i,"morphTargetsTextureSize",f.size)}return{update:r}}function Cw(i,e,t,n,s){let r=new WeakMap;function o(c){let h=s.render.frame,u=c.geometry,f=e.get(c,u);if(r.get(f)!==h&&(e.update(f),r.set(f,h)),c.isInstancedMesh&&(c.hasEventListener("dispose",l)===!1&&c.addEventListener("dispose",l),r.get(c)!==h&&(t.update(c.instanceMatrix,i.ARRAY_BUFFER),c.instanceColor!==null&&t.update(c.instanceColor,i.ARRAY_BUFFER),r.set(c,h))),c.isSkinnedMesh){let p=c.skeleton;r.get(p)!==h&&(p.update(),r.set(p,h))}return f}function a(){r=new WeakMap}function l(c){let h=c.target;h.removeEventListener("dispose",l),n.releaseStatesOfObject(h),t.remove(h.instanceMatrix),h.instanceColor!==null&&t.remove(h.instanceColor)}return{update:o,dispose:a}}var Iw={[_l]:"LINEAR_TONE_MAPPING",[ed]:"REINHARD_TONE_MAPPING",[td]:"CINEON_TONE_MAPPING",[nd]:"ACES_FILMIC_TONE_MAPPING",[xl]:"AGX_TONE_MAPPING",[vl]:"NEUTRAL_TONE_MAPPING",[id]:"CUSTOM_TONE_MAPPING"};function Pw(i,e,t,n,s,r){let o=new hi(e,t,{type:i,depthBuffer:s,stencilBuffer:r,samples:n?4:0,storeMultisampledDepthBuffer:!1,storeMultisampledStencilBuffer:!1,resolveDepthBuffer:!1,resolveStencilBuffer:!1}),a=null,l=null,c=null,h=new Qn;h.setAttribute("position",new ci([-1,3,0,-1,-1,0,3,-1,0],3)),h.setAttribute("uv",new ci([0,2,0,0,2,0],2));let u=new Zc({uniforms:{tDiffuse:{value:null}},vertexShader:`
			precision highp float;

			uniform mat4 modelViewMatrix;
			uniform mat4 projectionMatrix;

			attribute vec3 position;
			attribute vec2 uv;

			varying vec2 vUv;

			void main() {
				vUv = uv;
				gl_Position = projectionMatrix * modelViewMatrix * vec4( position, 1.0 );
			}`,fragmentShader:`
			precision highp float;

			uniform sampler2D tDiffuse;

			varying vec2 vUv;

			#include <tonemapping_pars_fragment>
			#include <colorspace_pars_fragment>

			void main() {
				gl_FragColor = texture2D( tDiffuse, vUv );

				#ifdef LINEAR_TONE_MAPPING
					gl_FragColor.rgb = LinearToneMapping( gl_FragColor.rgb );
				#elif defined( REINHARD_TONE_MAPPING )
					gl_FragColor.rgb = ReinhardToneMapping( gl_FragColor.rgb );
				#elif defined( CINEON_TONE_MAPPING )
					gl_FragColor.rgb = CineonToneMapping( gl_FragColor.rgb );
				#elif defined( ACES_FILMIC_TONE_MAPPING )
					gl_FragColor.rgb = ACESFilmicToneMapping( gl_FragColor.rgb );
				#elif defined( AGX_TONE_MAPPING )
					gl_FragColor.rgb = AgXToneMapping( gl_FragColor.rgb );
				#elif defined( NEUTRAL_TONE_MAPPING )
					gl_FragColor.rgb = NeutralToneMapping( gl_FragColor.rgb );
				#elif defined( CUSTOM_TONE_MAPPING )
					gl_FragColor.rgb = CustomToneMapping( gl_FragColor.rgb );
				#endif

				#ifdef SRGB_TRANSFER
					gl_FragColor = sRGBTransferOETF( gl_FragColor );
				#endif
			}`,depthTest:!1,depthWrite:!1}),f=new In(h,u),p=new eo(-1,1,1,-1,0,1),x=null,M=null,g=!1,_,b=null,P=[],w=!1;this.setSize=function(D,I){o.setSize(D,I),a!==null&&a.setSize(D,I),l!==null&&l.setSize(D,I);for(let y=0;y<P.length;y++){let T=P[y];T.setSize&&T.setSize(D,I)}},this.setEffects=function(D){P=D,w=P.length>0&&P[0].isRenderPass===!0;let I=o.width,y=o.height;P.length>0&&a===null&&(a=new hi(I,y,{type:hn,depthBuffer:!1,stencilBuffer:!1}),l=new hi(I,y,{type:hn,depthBuffer:!1,stencilBuffer:!1}));let T=s===!0&&P.some(G=>G.needsDepthTexture===!0);T!==(o.depthTexture!==null)&&(T===!0&&c===null&&(c=new qs(I,y),r===!0&&(c.format=Qs,c.type=ro)),o.dispose(),o.depthTexture=T?c:null,o.resolveDepthBuffer=T,o.storeMultisampledDepthBuffer=T);for(let G=0;G<P.length;G++){let k=P[G];k.setSize&&k.setSize(I,y),T&&k.needsDepthTexture===!0&&k.setDepthTexture&&k.setDepthTexture(c)}},this.begin=function(D,I){if(g||D.toneMapping===Wi&&P.length===0)return!1;if(b=I,I!==null){let y=I.width,T=I.height;(o.width!==y||o.height!==T)&&this.setSize(y,T)}return w===!1&&D.setRenderTarget(o),_=D.toneMapping,D.toneMapping=Wi,!0},this.hasRenderPass=function(){return w},this.end=function(D,I){D.toneMapping=_,g=!0;let y=o,T=a;for(let G=0;G<P.length;G++){let k=P[G];k.enabled!==!1&&(k.render(D,T,y,I),k.needsSwap!==!1&&(y=T,T=T===a?l:a))}if(x!==D.outputColorSpace||M!==D.toneMapping){x=D.outputColorSpace,M=D.toneMapping,u.defines={},Ct.getTransfer(x)===qt&&(u.defines.SRGB_TRANSFER="");let G=Iw[M];G&&(u.defines[G]=""),u.needsUpdate=!0}u.uniforms.tDiffuse.value=y.texture,D.setRenderTarget(b),D.render(f,p),b=null,g=!1},this.isCompositing=function(){return g},this.dispose=function(){o.dispose(),a!==null&&a.dispose(),l!==null&&l.dispose(),h.dispose(),u.dispose()}}var x_=new Yn,v_=new qs(1,1),y_=new rl(1),S_=new Ka,M_=new Wc,b_=new sl,J0=[],j0=[],Q0=new Float32Array(16),e_=new Float32Array(9),t_=new Float32Array(4);function fa(i,e,t){let n=i[0];if(n<=0||n>0)return i;let s=e*t,r=J0[s];if(r===void 0&&(r=new Float32Array(s),J0[s]=r),e!==0){n.toArray(r,0);for(let o=1,a=0;o!==e;++o)a+=t,i[o].toArray(r,a)}return r}function Fn(i,e){if(i.length!==e.length)return!1;for(let t=0,n=i.length;t<n;t++)if(i[t]!==e[t])return!1;return!0}function Bn(i,e){for(let t=0,n=e.length;t<n;t++)i[t]=e[t]}function $h(i,e){let t=j0[e];t===void 0&&(t=new Int32Array(e),j0[e]=t);for(let n=0;n!==e;++n)t[n]=i.allocateTextureUnit();return t}function Lw(i,e){let t=this.cache;t[0]!==e&&(i.uniform1f(this.addr,e),t[0]=e)}function Dw(i,e){let t=this.cache;if(e.x!==void 0)(t[0]!==e.x||t[1]!==e.y)&&(i.uniform2f(this.addr,e.x,e.y),t[0]=e.x,t[1]=e.y);else{if(Fn(t,e))return;i.uniform2fv(this.addr,e),Bn(t,e)}}function Nw(i,e){let t=this.cache;if(e.x!==void 0)(t[0]!==e.x||t[1]!==e.y||t[2]!==e.z)&&(i.uniform3f(this.addr,e.x,e.y,e.z),t[0]=e.x,t[1]=e.y,t[2]=e.z);else if(e.r!==void 0)(t[0]!==e.r||t[1]!==e.g||t[2]!==e.b)&&(i.uniform3f(this.addr,e.r,e.g,e.b),t[0]=e.r,t[1]=e.g,t[2]=e.b);else{if(Fn(t,e))return;i.uniform3fv(this.addr,e),Bn(t,e)}}function Uw(i,e){let t=this.cache;if(e.x!==void 0)(t[0]!==e.x||t[1]!==e.y||t[2]!==e.z||t[3]!==e.w)&&(i.uniform4f(this.addr,e.x,e.y,e.z,e.w),t[0]=e.x,t[1]=e.y,t[2]=e.z,t[3]=e.w);else{if(Fn(t,e))return;i.uniform4fv(this.addr,e),Bn(t,e)}}function Ow(i,e){let t=this.cache,n=e.elements;if(n===void 0){if(Fn(t,e))return;i.uniformMatrix2fv(this.addr,!1,e),Bn(t,e)}else{if(Fn(t,n))return;t_.set(n),i.uniformMatrix2fv(this.addr,!1,t_),Bn(t,n)}}function Fw(i,e){let t=this.cache,n=e.elements;if(n===void 0){if(Fn(t,e))return;i.uniformMatrix3fv(this.addr,!1,e),Bn(t,e)}else{if(Fn(t,n))return;e_.set(n),i.uniformMatrix3fv(this.addr,!1,e_),Bn(t,n)}}function Bw(i,e){let t=this.cache,n=e.elements;if(n===void 0){if(Fn(t,e))return;i.uniformMatrix4fv(this.addr,!1,e),Bn(t,e)}else{if(Fn(t,n))return;Q0.set(n),i.uniformMatrix4fv(this.addr,!1,Q0),Bn(t,n)}}function kw(i,e){let t=this.cache;t[0]!==e&&(i.uniform1i(this.addr,e),t[0]=e)}function zw(i,e){let t=this.cache;if(e.x!==void 0)(t[0]!==e.x||t[1]!==e.y)&&(i.uniform2i(this.addr,e.x,e.y),t[0]=e.x,t[1]=e.y);else{if(Fn(t,e))return;i.uniform2iv(this.addr,e),Bn(t,e)}}function Hw(i,e){let t=this.cache;if(e.x!==void 0)(t[0]!==e.x||t[1]!==e.y||t[2]!==e.z)&&(i.uniform3i(this.addr,e.x,e.y,e.z),t[0]=e.x,t[1]=e.y,t[2]=e.z);else{if(Fn(t,e))return;i.uniform3iv(this.addr,e),Bn(t,e)}}function Gw(i,e){let t=this.cache;if(e.x!==void 0)(t[0]!==e.x||t[1]!==e.y||t[2]!==e.z||t[3]!==e.w)&&(i.uniform4i(this.addr,e.x,e.y,e.z,e.w),t[0]=e.x,t[1]=e.y,t[2]=e.z,t[3]=e.w);else{if(Fn(t,e))return;i.uniform4iv(this.addr,e),Bn(t,e)}}function Vw(i,e){let t=this.cache;t[0]!==e&&(i.uniform1ui(this.addr,e),t[0]=e)}function Ww(i,e){let t=this.cache;if(e.x!==void 0)(t[0]!==e.x||t[1]!==e.y)&&(i.uniform2ui(this.addr,e.x,e.y),t[0]=e.x,t[1]=e.y);else{if(Fn(t,e))return;i.uniform2uiv(this.addr,e),Bn(t,e)}}function Xw(i,e){let t=this.cache;if(e.x!==void 0)(t[0]!==e.x||t[1]!==e.y||t[2]!==e.z)&&(i.uniform3ui(this.addr,e.x,e.y,e.z),t[0]=e.x,t[1]=e.y,t[2]=e.z);else{if(Fn(t,e))return;i.uniform3uiv(this.addr,e),Bn(t,e)}}function qw(i,e){let t=this.cache;if(e.x!==void 0)(t[0]!==e.x||t[1]!==e.y||t[2]!==e.z||t[3]!==e.w)&&(i.uniform4ui(this.addr,e.x,e.y,e.z,e.w),t[0]=e.x,t[1]=e.y,t[2]=e.z,t[3]=e.w);else{if(Fn(t,e))return;i.uniform4uiv(this.addr,e),Bn(t,e)}}function Jh(i){return i.version===0&&(i.compareFunction=pd,i.needsUpdate=!0),i}function Yw(i,e,t){let n=this.cache,s=t.allocateTextureUnit();n[0]!==s&&(i.uniform1i(this.addr,s),n[0]=s);let r;this.type===i.SAMPLER_2D_SHADOW?r=Jh(v_):r=x_,t.setTexture2D(e||r,s)}function Zw(i,e,t){let n=this.cache,s=t.allocateTextureUnit();n[0]!==s&&(i.uniform1i(this.addr,s),n[0]=s),t.setTexture3D(e||M_,s)}function Kw(i,e,t){let n=this.cache,s=t.allocateTextureUnit();n[0]!==s&&(i.uniform1i(this.addr,s),n[0]=s);let r;this.type===i.SAMPLER_CUBE_SHADOW?r=Jh(y_):r=b_,t.setTextureCube(e||r,s)}function $w(i,e,t){let n=this.cache,s=t.allocateTextureUnit();n[0]!==s&&(i.uniform1i(this.addr,s),n[0]=s),t.setTexture2DArray(e||S_,s)}function Jw(i){switch(i){case 5126:return Lw;case 35664:return Dw;case 35665:return Nw;case 35666:return Uw;case 35674:return Ow;case 35675:return Fw;case 35676:return Bw;case 5124:case 35670:return kw;case 35667:case 35671:return zw;case 35668:case 35672:return Hw;case 35669:case 35673:return Gw;case 5125:return Vw;case 36294:return Ww;case 36295:return Xw;case 36296:return qw;case 35678:case 36198:case 36298:case 36306:case 35682:return Yw;case 35679:case 36299:case 36307:return Zw;case 35680:case 36300:case 36308:case 36293:return Kw;case 36289:case 36303:case 36311:case 36292:return $w}}function jw(i,e){i.uniform1fv(this.addr,e)}function Qw(i,e){let t=fa(e,this.size,2);i.uniform2fv(this.addr,t)}function e1(i,e){let t=fa(e,this.size,3);i.uniform3fv(this.addr,t)}function t1(i,e){let t=fa(e,this.size,4);i.uniform4fv(this.addr,t)}function n1(i,e){let t=fa(e,this.size,4);i.uniformMatrix2fv(this.addr,!1,t)}function i1(i,e){let t=fa(e,this.size,9);i.uniformMatrix3fv(this.addr,!1,t)}function s1(i,e){let t=fa(e,this.size,16);i.uniformMatrix4fv(this.addr,!1,t)}function r1(i,e){i.uniform1iv(this.addr,e)}function o1(i,e){i.uniform2iv(this.addr,e)}function a1(i,e){i.uniform3iv(this.addr,e)}function l1(i,e){i.uniform4iv(this.addr,e)}function c1(i,e){i.uniform1uiv(this.addr,e)}function h1(i,e){i.uniform2uiv(this.addr,e)}function u1(i,e){i.uniform3uiv(this.addr,e)}function f1(i,e){i.uniform4uiv(this.addr,e)}function d1(i,e,t){let n=this.cache,s=e.length,r=$h(t,s);Fn(n,r)||(i.uniform1iv(this.addr,r),Bn(n,r));let o;this.type===i.SAMPLER_2D_SHADOW?o=Jh(v_):o=x_;for(let a=0;a!==s;++a)t.setTexture2D(e[a]||o,r[a])}function p1(i,e,t){let n=this.cache,s=e.length,r=$h(t,s);Fn(n,r)||(i.uniform1iv(this.addr,r),Bn(n,r));for(let o=0;o!==s;++o)t.setTexture3D(e[o]||M_,r[o])}function m1(i,e,t){let n=this.cache,s=e.length,r=$h(t,s);Fn(n,r)||(i.uniform1iv(this.addr,r),Bn(n,r));let o;this.type===i.SAMPLER_CUBE_SHADOW?o=Jh(y_):o=b_;for(let a=0;a!==s;++a)t.setTextureCube(e[a]||o,r[a])}function g1(i,e,t){let n=this.cache,s=e.length,r=$h(t,s);Fn(n,r)||(i.uniform1iv(this.addr,r),Bn(n,r));for(let o=0;o!==s;++o)t.setTexture2DArray(e[o]||S_,r[o])}function _1(i){switch(i){case 5126:return jw;case 35664:return Qw;case 35665:return e1;case 35666:return t1;case 35674:return n1;case 35675:return i1;case 35676:return s1;case 5124:case 35670:return r1;case 35667:case 35671:return o1;case 35668:case 35672:return a1;case 35669:case 35673:return l1;case 5125:return c1;case 36294:return h1;case 36295:return u1;case 36296:return f1;case 35678:case 36198:case 36298:case 36306:case 35682:return d1;case 35679:case 36299:case 36307:return p1;case 35680:case 36300:case 36308:case 36293:return m1;case 36289:case 36303:case 36311:case 36292:return g1}}var Ad=class{constructor(e,t,n){this.id=e,this.addr=n,this.cache=[],this.type=t.type,this.setValue=Jw(t.type)}},Rd=class{constructor(e,t,n){this.id=e,this.addr=n,this.cache=[],this.type=t.type,this.size=t.size,this.setValue=_1(t.type)}},Cd=class{constructor(e){this.id=e,this.seq=[],this.map={}}setValue(e,t,n){let s=this.seq;for(let r=0,o=s.length;r!==o;++r){let a=s[r];a.setValue(e,t[a.id],n)}}},Ed=/(\w+)(\])?(\[|\.)?/g;function n_(i,e){i.seq.push(e),i.map[e.id]=e}function x1(i,e,t){let n=i.name,s=n.length;for(Ed.lastIndex=0;;){let r=Ed.exec(n),o=Ed.lastIndex,a=r[1],l=r[2]==="]",c=r[3];if(l&&(a=a|0),c===void 0||c==="["&&o+2===s){n_(t,c===void 0?new Ad(a,i,e):new Rd(a,i,e));break}else{let u=t.map[a];u===void 0&&(u=new Cd(a),n_(t,u)),t=u}}}var ua=class{constructor(e,t){this.seq=[],this.map={};let n=e.getProgramParameter(t,e.ACTIVE_UNIFORMS);for(let o=0;o<n;++o){let a=e.getActiveUniform(t,o),l=e.getUniformLocation(t,a.name);x1(a,l,this)}let s=[],r=[];for(let o of this.seq)o.type===e.SAMPLER_2D_SHADOW||o.type===e.SAMPLER_CUBE_SHADOW||o.type===e.SAMPLER_2D_ARRAY_SHADOW?s.push(o):r.push(o);s.length>0&&(this.seq=s.concat(r))}setValue(e,t,n,s){let r=this.map[t];r!==void 0&&r.setValue(e,n,s)}setOptional(e,t,n){let s=t[n];s!==void 0&&this.setValue(e,n,s)}static upload(e,t,n,s){for(let r=0,o=t.length;r!==o;++r){let a=t[r],l=n[a.id];l.needsUpdate!==!1&&a.setValue(e,l.value,s)}}static seqWithValue(e,t){let n=[];for(let s=0,r=e.length;s!==r;++s){let o=e[s];o.id in t&&n.push(o)}return n}};function i_(i,e,t){let n=i.createShader(e);return i.shaderSource(n,t),i.compileShader(n),n}var v1=37297,y1=0;function S1(i,e){let t=i.split(`
`),n=[],s=Math.max(e-6,0),r=Math.min(e+6,t.length);for(let o=s;o<r;o++){let a=o+1;n.push(`${a===e?">":" "} ${a}: ${t[o]}`)}return n.join(`
`)}var s_=new yt;function M1(i){Ct._getMatrix(s_,Ct.workingColorSpace,i);let e=`mat3( ${s_.elements.map(t=>t.toFixed(4))} )`;switch(Ct.getTransfer(i)){case Ya:return[e,"LinearTransferOETF"];case qt:return[e,"sRGBTransferOETF"];default:return nt("WebGLProgram: Unsupported color space: ",i),[e,"LinearTransferOETF"]}}function r_(i,e,t){let n=i.getShaderParameter(e,i.COMPILE_STATUS),r=(i.getShaderInfoLog(e)||"").trim();if(n&&r==="")return"";let o=/ERROR: 0:(\d+)/.exec(r);if(o){let a=parseInt(o[1]);return t.toUpperCase()+`

`+r+`

`+S1(i.getShaderSource(e),a)}else return r}function b1(i,e){let t=M1(e);return[`vec4 ${i}( vec4 value ) {`,`	return ${t[1]}( vec4( ${t[0]} * value.rgb, value.a ) );`,"}"].join(`
`)}var w1={[_l]:"Linear",[ed]:"Reinhard",[td]:"Cineon",[nd]:"ACESFilmic",[xl]:"AgX",[vl]:"Neutral",[id]:"Custom"};function E1(i,e){let t=w1[e];return t===void 0?(nt("WebGLProgram: Unsupported toneMapping:",e),"vec3 "+i+"( vec3 color ) { return LinearToneMapping( color ); }"):"vec3 "+i+"( vec3 color ) { return "+t+"ToneMapping( color ); }"}var Yh=new Q;function T1(){Ct.getLuminanceCoefficients(Yh);let i=Yh.x.toFixed(4),e=Yh.y.toFixed(4),t=Yh.z.toFixed(4);return["float luminance( const in vec3 rgb ) {",`	const vec3 weights = vec3( ${i}, ${e}, ${t} );`,"	return dot( weights, rgb );","}"].join(`
`)}function A1(i){return[i.extensionClipCullDistance?"#extension GL_ANGLE_clip_cull_distance : require":"",i.extensionMultiDraw?"#extension GL_ANGLE_multi_draw : require":""].filter(Rl).join(`
`)}function R1(i){let e=[];for(let t in i){let n=i[t];n!==!1&&e.push("#define "+t+" "+n)}return e.join(`
`)}function C1(i,e){let t={},n=i.getProgramParameter(e,i.ACTIVE_ATTRIBUTES);for(let s=0;s<n;s++){let r=i.getActiveAttrib(e,s),o=r.name,a=1;r.type===i.FLOAT_MAT2&&(a=2),r.type===i.FLOAT_MAT3&&(a=3),r.type===i.FLOAT_MAT4&&(a=4),t[o]={type:r.type,location:i.getAttribLocation(e,o),locationSize:a}}return t}function Rl(i){return i!==""}function o_(i,e){let t=e.numSpotLightShadows+e.numSpotLightMaps-e.numSpotLightShadowsWithMaps;return i.replace(/NUM_SUN_LIGHTS/g,e.numSunLights).replace(/NUM_DIR_LIGHTS/g,e.numDirLights).replace(/NUM_SPOT_LIGHTS/g,e.numSpotLights).replace(/NUM_SPOT_LIGHT_MAPS/g,e.numSpotLightMaps).replace(/NUM_SPOT_LIGHT_COORDS/g,t).replace(/NUM_RECT_AREA_LIGHTS/g,e.numRectAreaLights).replace(/NUM_POINT_LIGHTS/g,e.numPointLights).replace(/NUM_HEMI_LIGHTS/g,e.numHemiLights).replace(/NUM_SUN_LIGHT_SHADOWS/g,e.numSunLightShadows).replace(/NUM_DIR_LIGHT_SHADOWS/g,e.numDirLightShadows).replace(/NUM_SPOT_LIGHT_SHADOWS_WITH_MAPS/g,e.numSpotLightShadowsWithMaps).replace(/NUM_SPOT_LIGHT_SHADOWS/g,e.numSpotLightShadows).replace(/NUM_POINT_LIGHT_SHADOWS/g,e.numPointLightShadows).replace(/NUM_LIGHT_PROBE_GRIDS/g,e.numLightProbeGrids)}function a_(i,e){return i.replace(/NUM_CLIPPING_PLANES/g,e.numClippingPlanes).replace(/UNION_CLIPPING_PLANES/g,e.numClippingPlanes-e.numClipIntersection)}var I1=/^[ \t]*#include +<([\w\d./]+)>/gm;function Id(i){return i.replace(I1,P1)}function P1(i,e){let t=At[e];if(t===void 0)throw new Error("THREE.WebGLProgram: Can not resolve #include <"+e+">");return Id(t)}var L1=/#pragma unroll_loop_start\s+for\s*\(\s*int\s+i\s*=\s*(\d+)\s*;\s*i\s*<\s*(\d+)\s*;\s*i\s*\+\+\s*\)\s*{([\s\S]+?)}\s+#pragma unroll_loop_end/g;function l_(i){return i.replace(L1,D1)}function D1(i,e,t,n){let s="";for(let r=parseInt(e);r<parseInt(t);r++)s+=n.replace(/\[\s*i\s*\]/g,"[ "+r+" ]").replace(/UNROLLED_LOOP_INDEX/g,r);return s}function c_(i){let e=`precision ${i.precision} float;
	precision ${i.precision} int;
	precision ${i.precision} sampler2D;
	precision ${i.precision} samplerCube;
	precision ${i.precision} sampler3D;
	precision ${i.precision} sampler2DArray;
	precision ${i.precision} sampler2DShadow;
	precision ${i.precision} samplerCubeShadow;
	precision ${i.precision} sampler2DArrayShadow;
	precision ${i.precision} isampler2D;
	precision ${i.precision} isampler3D;
	precision ${i.precision} isamplerCube;
	precision ${i.precision} isampler2DArray;
	precision ${i.precision} usampler2D;
	precision ${i.precision} usampler3D;
	precision ${i.precision} usamplerCube;
	precision ${i.precision} usampler2DArray;
	`;return i.precision==="highp"?e+=`
#define HIGH_PRECISION`:i.precision==="mediump"?e+=`
#define MEDIUM_PRECISION`:i.precision==="lowp"&&(e+=`
#define LOW_PRECISION`),e}var N1={[ml]:"SHADOWMAP_TYPE_PCF",[ia]:"SHADOWMAP_TYPE_VSM"};function U1(i){return N1[i.shadowMapType]||"SHADOWMAP_TYPE_BASIC"}var O1={[ra]:"ENVMAP_MODE_REFRACTION"};function F1(i){return i.envMap===!1?"ENVMAP_MODE_REFLECTION":O1[i.envMapMode]||"ENVMAP_MODE_REFLECTION"}var B1={[Qf]:"ENVMAP_BLENDING_MULTIPLY",[A0]:"ENVMAP_BLENDING_MIX",[R0]:"ENVMAP_BLENDING_ADD"};function k1(i){return i.envMap===!1?"ENVMAP_BLENDING_NONE":B1[i.combine]||"ENVMAP_BLENDING_NONE"}function z1(i,e,t,n){let s=i.getContext(),r=t.defines,o=t.vertexShader,a=t.fragmentShader,l=U1(t),c=t.envMapPMREM===!0?"ENVMAP_TYPE_PMREM":"ENVMAP_TYPE_CUBE",h=F1(t),u=k1(t),f=A1(t),p=R1(r),x=s.createProgram(),M,g,_=t.glslVersion?"#version "+t.glslVersion+`
`:"";t.isRawShaderMaterial?(M=["#define SHADER_TYPE "+t.shaderType,"#define SHADER_NAME "+t.shaderName,p].filter(Rl).join(`
`),M.length>0&&(M+=`
`),g=["#define SHADER_TYPE "+t.shaderType,"#define SHADER_NAME "+t.shaderName,p].filter(Rl).join(`
`),g.length>0&&(g+=`
`)):(M=[c_(t),"#define SHADER_TYPE "+t.shaderType,"#define SHADER_NAME "+t.shaderName,p,t.extensionClipCullDistance?"#define USE_CLIP_DISTANCE":"",t.batching?"#define USE_BATCHING":"",t.batchingColor?"#define USE_BATCHING_COLOR":"",t.instancing?"#define USE_INSTANCING":"",t.instancingColor?"#define USE_INSTANCING_COLOR":"",t.instancingMorph?"#define USE_INSTANCING_MORPH":"",t.useFog&&t.fog?"#define USE_FOG":"",t.useFog&&t.fogExp2?"#define FOG_EXP2":"",t.map?"#define USE_MAP":"",t.envMap?"#define USE_ENVMAP":"",t.envMap?"#define "+h:"",t.lightMap?"#define USE_LIGHTMAP":"",t.aoMap?"#define USE_AOMAP":"",t.bumpMap?"#define USE_BUMPMAP":"",t.normalMap?"#define USE_NORMALMAP":"",t.normalMapObjectSpace?"#define USE_NORMALMAP_OBJECTSPACE":"",t.normalMapTangentSpace?"#define USE_NORMALMAP_TANGENTSPACE":"",t.displacementMap?"#define USE_DISPLACEMENTMAP":"",t.emissiveMap?"#define USE_EMISSIVEMAP":"",t.anisotropy?"#define USE_ANISOTROPY":"",t.anisotropyMap?"#define USE_ANISOTROPYMAP":"",t.clearcoatMap?"#define USE_CLEARCOATMAP":"",t.clearcoatRoughnessMap?"#define USE_CLEARCOAT_ROUGHNESSMAP":"",t.clearcoatNormalMap?"#define USE_CLEARCOAT_NORMALMAP":"",t.diffuseRoughnessMap?"#define USE_DIFFUSE_ROUGHNESSMAP":"",t.iridescenceMap?"#define USE_IRIDESCENCEMAP":"",t.iridescenceThicknessMap?"#define USE_IRIDESCENCE_THICKNESSMAP":"",t.specularMap?"#define USE_SPECULARMAP":"",t.specularColorMap?"#define USE_SPECULAR_COLORMAP":"",t.specularIntensityMap?"#define USE_SPECULAR_INTENSITYMAP":"",t.roughnessMap?"#define USE_ROUGHNESSMAP":"",t.metalnessMap?"#define USE_METALNESSMAP":"",t.alphaMap?"#define USE_ALPHAMAP":"",t.alphaHash?"#define USE_ALPHAHASH":"",t.transmission?"#define USE_TRANSMISSION":"",t.transmissionMap?"#define USE_TRANSMISSIONMAP":"",t.thicknessMap?"#define USE_THICKNESSMAP":"",t.sheenColorMap?"#define USE_SHEEN_COLORMAP":"",t.sheenRoughnessMap?"#define USE_SHEEN_ROUGHNESSMAP":"",t.mapUv?"#define MAP_UV "+t.mapUv:"",t.alphaMapUv?"#define ALPHAMAP_UV "+t.alphaMapUv:"",t.lightMapUv?"#define LIGHTMAP_UV "+t.lightMapUv:"",t.aoMapUv?"#define AOMAP_UV "+t.aoMapUv:"",t.emissiveMapUv?"#define EMISSIVEMAP_UV "+t.emissiveMapUv:"",t.bumpMapUv?"#define BUMPMAP_UV "+t.bumpMapUv:"",t.normalMapUv?"#define NORMALMAP_UV "+t.normalMapUv:"",t.displacementMapUv?"#define DISPLACEMENTMAP_UV "+t.displacementMapUv:"",t.metalnessMapUv?"#define METALNESSMAP_UV "+t.metalnessMapUv:"",t.roughnessMapUv?"#define ROUGHNESSMAP_UV "+t.roughnessMapUv:"",t.anisotropyMapUv?"#define ANISOTROPYMAP_UV "+t.anisotropyMapUv:"",t.clearcoatMapUv?"#define CLEARCOATMAP_UV "+t.clearcoatMapUv:"",t.clearcoatNormalMapUv?"#define CLEARCOAT_NORMALMAP_UV "+t.clearcoatNormalMapUv:"",t.clearcoatRoughnessMapUv?"#define CLEARCOAT_ROUGHNESSMAP_UV "+t.clearcoatRoughnessMapUv:"",t.diffuseRoughnessMapUv?"#define DIFFUSE_ROUGHNESSMAP_UV "+t.diffuseRoughnessMapUv:"",t.iridescenceMapUv?"#define IRIDESCENCEMAP_UV "+t.iridescenceMapUv:"",t.iridescenceThicknessMapUv?"#define IRIDESCENCE_THICKNESSMAP_UV "+t.iridescenceThicknessMapUv:"",t.sheenColorMapUv?"#define SHEEN_COLORMAP_UV "+t.sheenColorMapUv:"",t.sheenRoughnessMapUv?"#define SHEEN_ROUGHNESSMAP_UV "+t.sheenRoughnessMapUv:"",t.specularMapUv?"#define SPECULARMAP_UV "+t.specularMapUv:"",t.specularColorMapUv?"#define SPECULAR_COLORMAP_UV "+t.specularColorMapUv:"",t.specularIntensityMapUv?"#define SPECULAR_INTENSITYMAP_UV "+t.specularIntensityMapUv:"",t.transmissionMapUv?"#define TRANSMISSIONMAP_UV "+t.transmissionMapUv:"",t.thicknessMapUv?"#define THICKNESSMAP_UV "+t.thicknessMapUv:"",t.vertexTangents&&t.flatShading===!1?"#define USE_TANGENT":"",t.vertexNormals?"#define HAS_NORMAL":"",t.vertexColors?"#define USE_COLOR":"",t.vertexAlphas?"#define USE_COLOR_ALPHA":"",t.vertexUv1s?"#define USE_UV1":"",t.vertexUv2s?"#define USE_UV2":"",t.vertexUv3s?"#define USE_UV3":"",t.pointsUvs?"#define USE_POINTS_UV":"",t.flatShading?"#define FLAT_SHADED":"",t.skinning?"#define USE_SKINNING":"",t.morphTargets?"#define USE_MORPHTARGETS":"",t.morphNormals&&t.flatShading===!1?"#define USE_MORPHNORMALS":"",t.morphColors?"#define USE_MORPHCOLORS":"",t.morphTargetsCount>0?"#define MORPHTARGETS_TEXTURE_STRIDE "+t.morphTextureStride:"",t.morphTargetsCount>0?"#define MORPHTARGETS_COUNT "+t.morphTargetsCount:"",t.doubleSided?"#define DOUBLE_SIDED":"",t.flipSided?"#define FLIP_SIDED":"",t.shadowMapEnabled?"#define USE_SHADOWMAP":"",t.shadowMapEnabled?"#define "+l:"",t.sizeAttenuation?"#define USE_SIZEATTENUATION":"",t.numLightProbes>0?"#define USE_LIGHT_PROBES":"",t.logarithmicDepthBuffer?"#define USE_LOGARITHMIC_DEPTH_BUFFER":"",t.reversedDepthBuffer?"#define USE_REVERSED_DEPTH_BUFFER":"","uniform mat4 modelMatrix;","uniform mat4 modelViewMatrix;","uniform mat4 projectionMatrix;","uniform mat4 viewMatrix;","uniform mat3 normalMatrix;","uniform vec3 cameraPosition;","uniform bool isOrthographic;","#ifdef USE_INSTANCING","	attribute mat4 instanceMatrix;","#endif","#ifdef USE_INSTANCING_COLOR","	attribute vec3 instanceColor;","#endif","#ifdef USE_INSTANCING_MORPH","	uniform sampler2D morphTexture;","#endif","attribute vec3 position;","attribute vec3 normal;","attribute vec2 uv;","#ifdef USE_UV1","	attribute vec2 uv1;","#endif","#ifdef USE_UV2","	attribute vec2 uv2;","#endif","#ifdef USE_UV3","	attribute vec2 uv3;","#endif","#ifdef USE_TANGENT","	attribute vec4 tangent;","#endif","#if defined( USE_COLOR_ALPHA )","	attribute vec4 color;","#elif defined( USE_COLOR )","	attribute vec3 color;","#endif","#ifdef USE_SKINNING","	attribute vec4 skinIndex;","	attribute vec4 skinWeight;","#endif",`
`].filter(Rl).join(`
`),g=[c_(t),"#define SHADER_TYPE "+t.shaderType,"#define SHADER_NAME "+t.shaderName,p,t.useFog&&t.fog?"#define USE_FOG":"",t.useFog&&t.fogExp2?"#define FOG_EXP2":"",t.alphaToCoverage?"#define ALPHA_TO_COVERAGE":"",t.map?"#define USE_MAP":"",t.matcap?"#define USE_MATCAP":"",t.envMap?"#define USE_ENVMAP":"",t.envMap?"#define "+c:"",t.envMap?"#define "+h:"",t.envMap?"#define "+u:"",t.envMapPMREM?"#define ENVMAP_MAX_LOD "+t.envMapMaxLod+".0":"",t.envMapPMREM?"#define ENVMAP_SIZE "+t.envMapSize+".0":"",t.lightMap?"#define USE_LIGHTMAP":"",t.aoMap?"#define USE_AOMAP":"",t.bumpMap?"#define USE_BUMPMAP":"",t.normalMap?"#define USE_NORMALMAP":"",t.normalMapObjectSpace?"#define USE_NORMALMAP_OBJECTSPACE":"",t.normalMapTangentSpace?"#define USE_NORMALMAP_TANGENTSPACE":"",t.packedNormalMap?"#define USE_PACKED_NORMALMAP":"",t.emissiveMap?"#define USE_EMISSIVEMAP":"",t.anisotropy?"#define USE_ANISOTROPY":"",t.anisotropyMap?"#define USE_ANISOTROPYMAP":"",t.clearcoat?"#define USE_CLEARCOAT":"",t.clearcoatMap?"#define USE_CLEARCOATMAP":"",t.clearcoatRoughnessMap?"#define USE_CLEARCOAT_ROUGHNESSMAP":"",t.clearcoatNormalMap?"#define USE_CLEARCOAT_NORMALMAP":"",t.diffuseRoughness?"#define USE_DIFFUSE_ROUGHNESS":"",t.diffuseRoughnessMap?"#define USE_DIFFUSE_ROUGHNESSMAP":"",t.dispersion?"#define USE_DISPERSION":"",t.retroreflection?"#define USE_RETROREFLECTION":"",t.iridescence?"#define USE_IRIDESCENCE":"",t.iridescenceMap?"#define USE_IRIDESCENCEMAP":"",t.iridescenceThicknessMap?"#define USE_IRIDESCENCE_THICKNESSMAP":"",t.specularMap?"#define USE_SPECULARMAP":"",t.specularColorMap?"#define USE_SPECULAR_COLORMAP":"",t.specularIntensityMap?"#define USE_SPECULAR_INTENSITYMAP":"",t.roughnessMap?"#define USE_ROUGHNESSMAP":"",t.metalnessMap?"#define USE_METALNESSMAP":"",t.alphaMap?"#define USE_ALPHAMAP":"",t.alphaTest?"#define USE_ALPHATEST":"",t.alphaHash?"#define USE_ALPHAHASH":"",t.sheen?"#define USE_SHEEN":"",t.sheenColorMap?"#define USE_SHEEN_COLORMAP":"",t.sheenRoughnessMap?"#define USE_SHEEN_ROUGHNESSMAP":"",t.transmission?"#define USE_TRANSMISSION":"",t.transmissionMap?"#define USE_TRANSMISSIONMAP":"",t.thicknessMap?"#define USE_THICKNESSMAP":"",t.vertexTangents&&t.flatShading===!1?"#define USE_TANGENT":"",t.vertexColors||t.instancingColor?"#define USE_COLOR":"",t.vertexAlphas||t.batchingColor?"#define USE_COLOR_ALPHA":"",t.vertexUv1s?"#define USE_UV1":"",t.vertexUv2s?"#define USE_UV2":"",t.vertexUv3s?"#define USE_UV3":"",t.pointsUvs?"#define USE_POINTS_UV":"",t.gradientMap?"#define USE_GRADIENTMAP":"",t.flatShading?"#define FLAT_SHADED":"",t.doubleSided?"#define DOUBLE_SIDED":"",t.flipSided?"#define FLIP_SIDED":"",t.shadowMapEnabled?"#define USE_SHADOWMAP":"",t.shadowMapEnabled?"#define "+l:"",t.premultipliedAlpha?"#define PREMULTIPLIED_ALPHA":"",t.numLightProbes>0?"#define USE_LIGHT_PROBES":"",t.decodeVideoTexture?"#define DECODE_VIDEO_TEXTURE":"",t.decodeVideoTextureEmissive?"#define DECODE_VIDEO_TEXTURE_EMISSIVE":"",t.logarithmicDepthBuffer?"#define USE_LOGARITHMIC_DEPTH_BUFFER":"",t.reversedDepthBuffer?"#define USE_REVERSED_DEPTH_BUFFER":"","uniform mat4 viewMatrix;","uniform vec3 cameraPosition;","uniform bool isOrthographic;",t.toneMapping!==Wi?"#define TONE_MAPPING":"",t.toneMapping!==Wi?At.tonemapping_pars_fragment:"",t.toneMapping!==Wi?E1("toneMapping",t.toneMapping):"",t.dithering?"#define DITHERING":"",t.opaque?"#define OPAQUE":"",At.colorspace_pars_fragment,b1("linearToOutputTexel",t.outputColorSpace),T1(),t.useDepthPacking?"#define DEPTH_PACKING "+t.depthPacking:"",`
`].filter(Rl).join(`
`)),o=Id(o),o=o_(o,t),o=a_(o,t),a=Id(a),a=o_(a,t),a=a_(a,t),o=l_(o),a=l_(a),t.isRawShaderMaterial!==!0&&(_=`#version 300 es
`,M=[f,"#define attribute in","#define varying out","#define texture2D texture"].join(`
`)+`
`+M,g=["#define varying in",t.glslVersion===gd?"":"layout(location = 0) out highp vec4 pc_fragColor;",t.glslVersion===gd?"":"#define gl_FragColor pc_fragColor","#define gl_FragDepthEXT gl_FragDepth","#define texture2D texture","#define textureCube texture","#define texture2DProj textureProj","#define texture2DLodEXT textureLod","#define texture2DProjLodEXT textureProjLod","#define textureCubeLodEXT textureLod","#define texture2DGradEXT textureGrad","#define texture2DProjGradEXT textureProjGrad","#define textureCubeGradEXT textureGrad"].join(`
`)+`
`+g);let b=_+M+o,P=_+g+a,w=i_(s,s.VERTEX_SHADER,b),D=i_(s,s.FRAGMENT_SHADER,P);s.attachShader(x,w),s.attachShader(x,D),t.index0AttributeName!==void 0?s.bindAttribLocation(x,0,t.index0AttributeName):t.hasPositionAttribute===!0&&s.bindAttribLocation(x,0,"position"),s.linkProgram(x);function I(k){if(i.debug.checkShaderErrors){let O=s.getProgramInfoLog(x)||"",Y=s.getShaderInfoLog(w)||"",Z=s.getShaderInfoLog(D)||"",U=O.trim(),W=Y.trim(),$=Z.trim(),q=!0,xe=!0;if(s.getProgramParameter(x,s.LINK_STATUS)===!1)if(q=!1,typeof i.debug.onShaderError=="function")i.debug.onShaderError(s,x,w,D);else{let ne=r_(s,w,"vertex"),se=r_(s,D,"fragment");gt("WebGLProgram: Shader Error "+s.getError()+" - VALIDATE_STATUS "+s.getProgramParameter(x,s.VALIDATE_STATUS)+`

Material Name: `+k.name+`
Material Type: `+k.type+`

Program Info Log: `+U+`
`+ne+`
`+se)}else U!==""?nt("WebGLProgram: Program Info Log:",U):(W===""||$==="")&&(xe=!1);xe&&(k.diagnostics={runnable:q,programLog:U,vertexShader:{log:W,prefix:M},fragmentShader:{log:$,prefix:g}})}s.deleteShader(w),s.deleteShader(D),y=new ua(s,x),T=C1(s,x)}let y;this.getUniforms=function(){return y===void 0&&I(this),y};let T;this.getAttributes=function(){return T===void 0&&I(this),T};let G=t.rendererExtensionParallelShaderCompile===!1;return this.isReady=function(){return G===!1&&(G=s.getProgramParameter(x,v1)),G},this.destroy=function(){n.releaseStatesOfProgram(this),s.deleteProgram(x),this.program=void 0},this.type=t.shaderType,this.name=t.shaderName,this.id=y1++,this.cacheKey=e,this.usedTimes=1,this.program=x,this.vertexShader=w,this.fragmentShader=D,this}var H1=0,Pd=class{constructor(){this.shaderCache=new Map,this.materialCache=new Map}update(e,t,n){let s=this._getShaderCacheForMaterial(e);return s.has(t)===!1&&(s.add(t),t.usedTimes++),s.has(n)===!1&&(s.add(n),n.usedTimes++),this}remove(e){let t=this.materialCache.get(e);for(let n of t)n.usedTimes--,n.usedTimes===0&&this.shaderCache.delete(n.code);return this.materialCache.delete(e),this}getVertexShaderStage(e){return this._getShaderStage(e.vertexShader)}getFragmentShaderStage(e){return this._getShaderStage(e.fragmentShader)}dispose(){this.shaderCache.clear(),this.materialCache.clear()}_getShaderCacheForMaterial(e){let t=this.materialCache,n=t.get(e);return n===void 0&&(n=new Set,t.set(e,n)),n}_getShaderStage(e){let t=this.shaderCache,n=t.get(e);return n===void 0&&(n=new Ld(e),t.set(e,n)),n}},Ld=class{constructor(e){this.id=H1++,this.code=e,this.usedTimes=0}};function G1(i){return i===yi||i===wl||i===El}function V1(i,e,t,n,s,r){let o=new $a,a=new Pd,l=new Set,c=[],h=new Map,u=n.logarithmicDepthBuffer,f={MeshDepthMaterial:"depth",MeshDistanceMaterial:"distance",MeshNormalMaterial:"normal",MeshBasicMaterial:"basic",MeshLambertMaterial:"lambert",MeshPhongMaterial:"phong",MeshToonMaterial:"toon",MeshStandardMaterial:"physical",MeshPhysicalMaterial:"physical",MeshMatcapMaterial:"matcap",LineBasicMaterial:"basic",LineDashedMaterial:"dashed",PointsMaterial:"points",ShadowMaterial:"shadow",SpriteMaterial:"sprite"};function p(y){return l.add(y),y===0?"uv":`uv${y}`}function x(y,T,G,k,O,Y){let Z=k.fog,U=O.geometry,W=y.isMeshStandardMaterial||y.isMeshLambertMaterial||y.isMeshPhongMaterial?k.environment:null,$=y.isMeshStandardMaterial||y.isMeshLambertMaterial&&!y.envMap||y.isMeshPhongMaterial&&!y.envMap,q=e.get(y.envMap||W,$),xe=f[y.type],ne=n.precision;y.precision!==null&&(ne=n.getMaxPrecision(y.precision),ne!==y.precision&&nt("WebGLProgram.getParameters:",y.precision,"not supported, using",ne,"instead."));let se=U.morphAttributes.position||U.morphAttributes.normal||U.morphAttributes.color,de=se!==void 0?se.length:0,ge=0;U.morphAttributes.position!==void 0&&(ge=1),U.morphAttributes.normal!==void 0&&(ge=2),U.morphAttributes.color!==void 0&&(ge=3);let pe,re,Te,Ie;if(xe){let Ge=Ts[xe];pe=Ge.vertexShader,re=Ge.fragmentShader}else{pe=y.vertexShader,re=y.fragmentShader;let Ge=a.getVertexShaderStage(y),wt=a.getFragmentShaderStage(y);a.update(y,Ge,wt),Te=Ge.id,Ie=wt.id}let Oe=i.getRenderTarget(),ye=i.state.buffers.depth.getReversed(),$e=O.isInstancedMesh===!0,ut=O.isBatchedMesh===!0,et=!!y.map,bt=!!y.matcap,vt=!!q,_t=vt&&q.isPMREMTexture===!0,Yt=!!y.aoMap,Ft=!!y.lightMap,fn=!!y.bumpMap&&y.wireframe===!1,Vt=!!y.normalMap,Tn=!!y.displacementMap,Pt=!!y.emissiveMap,yn=!!y.metalnessMap,nn=!!y.roughnessMap,Sn=y.anisotropy>0,V=y.clearcoat>0,He=y.diffuseRoughness>0,ct=y.dispersion>0,xt=y.retroreflectivity>0,Ne=y.iridescence>0,Zt=y.sheen>0,je=y.transmission>0,at=Sn&&!!y.anisotropyMap,N=V&&!!y.clearcoatMap,E=V&&!!y.clearcoatNormalMap,ee=V&&!!y.clearcoatRoughnessMap,Se=He&&!!y.diffuseRoughnessMap,me=Ne&&!!y.iridescenceMap,De=Ne&&!!y.iridescenceThicknessMap,Ue=Zt&&!!y.sheenColorMap,ae=Zt&&!!y.sheenRoughnessMap,ue=!!y.specularMap,Ae=!!y.specularColorMap,H=!!y.specularIntensityMap,he=je&&!!y.transmissionMap,oe=je&&!!y.thicknessMap,ke=!!y.gradientMap,Pe=!!y.alphaMap,Fe=y.alphaTest>0,tt=!!y.alphaHash,dt=!!y.extensions,Me=Wi;y.toneMapped&&(Oe===null||Oe.isXRRenderTarget===!0)&&(Me=i.toneMapping);let Je=_t?q.isCompressedCubeTexture?q.image[0].mipmaps:q.mipmaps:null,pt={shaderID:xe,shaderType:y.type,shaderName:y.name,vertexShader:pe,fragmentShader:re,defines:y.defines,customVertexShaderID:Te,customFragmentShaderID:Ie,isRawShaderMaterial:y.isRawShaderMaterial===!0,glslVersion:y.glslVersion,precision:ne,batching:ut,batchingColor:ut&&O._colorsTexture!==null,instancing:$e,instancingColor:$e&&O.instanceColor!==null,instancingMorph:$e&&O.morphTexture!==null,outputColorSpace:Oe===null?i.outputColorSpace:Oe.isXRRenderTarget===!0?Oe.texture.colorSpace:Ct.workingColorSpace,alphaToCoverage:!!y.alphaToCoverage,map:et,matcap:bt,envMap:vt,envMapMode:vt&&q.mapping,envMapPMREM:_t,envMapMaxLod:_t?Je.length-1:null,envMapSize:_t?Je[0].width:null,aoMap:Yt,lightMap:Ft,bumpMap:fn,normalMap:Vt,displacementMap:Tn,emissiveMap:Pt,normalMapObjectSpace:Vt&&y.normalMapType===L0,normalMapTangentSpace:Vt&&y.normalMapType===Wh,packedNormalMap:Vt&&y.normalMapType===Wh&&G1(y.normalMap.format),metalnessMap:yn,roughnessMap:nn,anisotropy:Sn,anisotropyMap:at,clearcoat:V,clearcoatMap:N,clearcoatNormalMap:E,clearcoatRoughnessMap:ee,diffuseRoughness:He,diffuseRoughnessMap:Se,dispersion:ct,retroreflection:xt,iridescence:Ne,iridescenceMap:me,iridescenceThicknessMap:De,sheen:Zt,sheenColorMap:Ue,sheenRoughnessMap:ae,specularMap:ue,specularColorMap:Ae,specularIntensityMap:H,transmission:je,transmissionMap:he,thicknessMap:oe,gradientMap:ke,opaque:y.transparent===!1&&y.blending===sa&&y.alphaToCoverage===!1,alphaMap:Pe,alphaTest:Fe,alphaHash:tt,combine:y.combine,mapUv:et&&p(y.map.channel),aoMapUv:Yt&&p(y.aoMap.channel),lightMapUv:Ft&&p(y.lightMap.channel),bumpMapUv:fn&&p(y.bumpMap.channel),normalMapUv:Vt&&p(y.normalMap.channel),displacementMapUv:Tn&&p(y.displacementMap.channel),emissiveMapUv:Pt&&p(y.emissiveMap.channel),metalnessMapUv:yn&&p(y.metalnessMap.channel),roughnessMapUv:nn&&p(y.roughnessMap.channel),anisotropyMapUv:at&&p(y.anisotropyMap.channel),clearcoatMapUv:N&&p(y.clearcoatMap.channel),clearcoatNormalMapUv:E&&p(y.clearcoatNormalMap.channel),clearcoatRoughnessMapUv:ee&&p(y.clearcoatRoughnessMap.channel),diffuseRoughnessMapUv:Se&&p(y.diffuseRoughnessMap.channel),iridescenceMapUv:me&&p(y.iridescenceMap.channel),iridescenceThicknessMapUv:De&&p(y.iridescenceThicknessMap.channel),sheenColorMapUv:Ue&&p(y.sheenColorMap.channel),sheenRoughnessMapUv:ae&&p(y.sheenRoughnessMap.channel),specularMapUv:ue&&p(y.specularMap.channel),specularColorMapUv:Ae&&p(y.specularColorMap.channel),specularIntensityMapUv:H&&p(y.specularIntensityMap.channel),transmissionMapUv:he&&p(y.transmissionMap.channel),thicknessMapUv:oe&&p(y.thicknessMap.channel),alphaMapUv:Pe&&p(y.alphaMap.channel),vertexTangents:!!U.attributes.tangent&&(Vt||Sn),vertexNormals:!!U.attributes.normal,vertexColors:y.vertexColors,vertexAlphas:y.vertexColors===!0&&!!U.attributes.color&&U.attributes.color.itemSize===4,pointsUvs:O.isPoints===!0&&!!U.attributes.uv&&(et||Pe),fog:!!Z,useFog:y.fog===!0,fogExp2:!!Z&&Z.isFogExp2,flatShading:y.wireframe===!1&&(y.flatShading===!0||U.attributes.normal===void 0&&Vt===!1&&(y.isMeshLambertMaterial||y.isMeshPhongMaterial||y.isMeshStandardMaterial||y.isMeshPhysicalMaterial)),sizeAttenuation:y.sizeAttenuation===!0,logarithmicDepthBuffer:u,reversedDepthBuffer:ye,skinning:O.isSkinnedMesh===!0,hasPositionAttribute:U.attributes.position!==void 0,morphTargets:U.morphAttributes.position!==void 0,morphNormals:U.morphAttributes.normal!==void 0,morphColors:U.morphAttributes.color!==void 0,morphTargetsCount:de,morphTextureStride:ge,numSunLights:T.sun.length,numDirLights:T.directional.length,numPointLights:T.point.length,numSpotLights:T.spot.length,numSpotLightMaps:T.spotLightMap.length,numRectAreaLights:T.rectArea.length,numHemiLights:T.hemi.length,numSunLightShadows:T.sunShadowMap.length,numDirLightShadows:T.directionalShadowMap.length,numPointLightShadows:T.pointShadowMap.length,numSpotLightShadows:T.spotShadowMap.length,numSpotLightShadowsWithMaps:T.numSpotLightShadowsWithMaps,numLightProbes:T.numLightProbes,numLightProbeGrids:Y.filter(Ge=>Ge.texture!==null).length,numClippingPlanes:r.numPlanes,numClipIntersection:r.numIntersection,dithering:y.dithering,shadowMapEnabled:i.shadowMap.enabled&&G.length>0,shadowMapType:i.shadowMap.type,toneMapping:Me,decodeVideoTexture:et&&y.map.isVideoTexture===!0&&Ct.getTransfer(y.map.colorSpace)===qt,decodeVideoTextureEmissive:Pt&&y.emissiveMap.isVideoTexture===!0&&Ct.getTransfer(y.emissiveMap.colorSpace)===qt,premultipliedAlpha:y.premultipliedAlpha,doubleSided:y.side===ei,flipSided:y.side===pi,useDepthPacking:y.depthPacking>=0,depthPacking:y.depthPacking||0,index0AttributeName:y.index0AttributeName,extensionClipCullDistance:dt&&y.extensions.clipCullDistance===!0&&t.has("WEBGL_clip_cull_distance"),extensionMultiDraw:(dt&&y.extensions.multiDraw===!0||ut)&&t.has("WEBGL_multi_draw"),rendererExtensionParallelShaderCompile:t.has("KHR_parallel_shader_compile"),customProgramCacheKey:y.customProgramCacheKey()};return pt.vertexUv1s=l.has(1),pt.vertexUv2s=l.has(2),pt.vertexUv3s=l.has(3),l.clear(),pt}function M(y){let T=[];if(y.shaderID?T.push(y.shaderID):(T.push(y.customVertexShaderID),T.push(y.customFragmentShaderID)),y.defines!==void 0)for(let G in y.defines)T.push(G),T.push(y.defines[G]);return y.isRawShaderMaterial===!1&&(g(T,y),_(T,y),T.push(i.outputColorSpace)),T.push(y.customProgramCacheKey),T.join()}function g(y,T){y.push(T.precision),y.push(T.outputColorSpace),y.push(T.envMapMode),y.push(T.envMapPMREM),y.push(T.envMapMaxLod),y.push(T.envMapSize),y.push(T.mapUv),y.push(T.alphaMapUv),y.push(T.lightMapUv),y.push(T.aoMapUv),y.push(T.bumpMapUv),y.push(T.normalMapUv),y.push(T.displacementMapUv),y.push(T.emissiveMapUv),y.push(T.metalnessMapUv),y.push(T.roughnessMapUv),y.push(T.anisotropyMapUv),y.push(T.clearcoatMapUv),y.push(T.clearcoatNormalMapUv),y.push(T.clearcoatRoughnessMapUv),y.push(T.diffuseRoughnessMapUv),y.push(T.iridescenceMapUv),y.push(T.iridescenceThicknessMapUv),y.push(T.sheenColorMapUv),y.push(T.sheenRoughnessMapUv),y.push(T.specularMapUv),y.push(T.specularColorMapUv),y.push(T.specularIntensityMapUv),y.push(T.transmissionMapUv),y.push(T.thicknessMapUv),y.push(T.combine),y.push(T.fogExp2),y.push(T.sizeAttenuation),y.push(T.morphTargetsCount),y.push(T.numSunLights),y.push(T.numDirLights),y.push(T.numPointLights),y.push(T.numSpotLights),y.push(T.numSpotLightMaps),y.push(T.numHemiLights),y.push(T.numRectAreaLights),y.push(T.numSunLightShadows),y.push(T.numDirLightShadows),y.push(T.numPointLightShadows),y.push(T.numSpotLightShadows),y.push(T.numSpotLightShadowsWithMaps),y.push(T.numLightProbes),y.push(T.numLightProbeGrids),y.push(T.shadowMapType),y.push(T.toneMapping),y.push(T.numClippingPlanes),y.push(T.numClipIntersection),y.push(T.depthPacking)}function _(y,T){o.disableAll(),T.instancing&&o.enable(0),T.instancingColor&&o.enable(1),T.instancingMorph&&o.enable(2),T.matcap&&o.enable(3),T.envMap&&o.enable(4),T.normalMapObjectSpace&&o.enable(5),T.normalMapTangentSpace&&o.enable(6),T.clearcoat&&o.enable(7),T.iridescence&&o.enable(8),T.alphaTest&&o.enable(9),T.vertexColors&&o.enable(10),T.vertexAlphas&&o.enable(11),T.vertexUv1s&&o.enable(12),T.vertexUv2s&&o.enable(13),T.vertexUv3s&&o.enable(14),T.vertexTangents&&o.enable(15),T.anisotropy&&o.enable(16),T.alphaHash&&o.enable(17),T.batching&&o.enable(18),T.dispersion&&o.enable(19),T.retroreflection&&o.enable(24),T.diffuseRoughness&&o.enable(25),T.batchingColor&&o.enable(20),T.gradientMap&&o.enable(21),T.packedNormalMap&&o.enable(22),T.vertexNormals&&o.enable(23),y.push(o.mask),o.disableAll(),T.fog&&o.enable(0),T.useFog&&o.enable(1),T.flatShading&&o.enable(2),T.logarithmicDepthBuffer&&o.enable(3),T.reversedDepthBuffer&&o.enable(4),T.skinning&&o.enable(5),T.morphTargets&&o.enable(6),T.morphNormals&&o.enable(7),T.morphColors&&o.enable(8),T.premultipliedAlpha&&o.enable(9),T.shadowMapEnabled&&o.enable(10),T.doubleSided&&o.enable(11),T.flipSided&&o.enable(12),T.useDepthPacking&&o.enable(13),T.dithering&&o.enable(14),T.transmission&&o.enable(15),T.sheen&&o.enable(16),T.opaque&&o.enable(17),T.pointsUvs&&o.enable(18),T.decodeVideoTexture&&o.enable(19),T.decodeVideoTextureEmissive&&o.enable(20),T.alphaToCoverage&&o.enable(21),T.numLightProbeGrids>0&&o.enable(22),T.hasPositionAttribute&&o.enable(23),y.push(o.mask)}function b(y){let T=f[y.type],G;if(T){let k=Ts[T];G=W0.clone(k.uniforms)}else G=y.uniforms;return G}function P(y,T){let G=h.get(T);return G!==void 0?++G.usedTimes:(G=new z1(i,T,y,s),c.push(G),h.set(T,G)),G}function w(y){if(--y.usedTimes===0){let T=c.indexOf(y);c[T]=c[c.length-1],c.pop(),h.delete(y.cacheKey),y.destroy()}}function D(y){a.remove(y)}function I(){a.dispose()}return{getParameters:x,getProgramCacheKey:M,getUniforms:b,acquireProgram:P,releaseProgram:w,releaseShaderCache:D,programs:c,dispose:I}}function W1(){let i=new WeakMap;function e(o){return i.has(o)}function t(o){let a=i.get(o);return a===void 0&&(a={},i.set(o,a)),a}function n(o){i.delete(o)}function s(o,a,l){i.get(o)[a]=l}function r(){i=new WeakMap}return{has:e,get:t,remove:n,update:s,dispose:r}}function X1(i,e){return i.groupOrder!==e.groupOrder?i.groupOrder-e.groupOrder:i.renderOrder!==e.renderOrder?i.renderOrder-e.renderOrder:i.material.id!==e.material.id?i.material.id-e.material.id:i.materialVariant!==e.materialVariant?i.materialVariant-e.materialVariant:i.z!==e.z?i.z-e.z:i.id-e.id}function h_(i,e){return i.groupOrder!==e.groupOrder?i.groupOrder-e.groupOrder:i.renderOrder!==e.renderOrder?i.renderOrder-e.renderOrder:i.z!==e.z?e.z-i.z:i.id-e.id}function u_(){let i=[],e=0,t=[],n=[],s=[];function r(){e=0,t.length=0,n.length=0,s.length=0}function o(f){let p=0;return f.isInstancedMesh&&(p+=2),f.isSkinnedMesh&&(p+=1),p}function a(f,p,x,M,g,_){let b=i[e];return b===void 0?(b={id:f.id,object:f,geometry:p,material:x,materialVariant:o(f),groupOrder:M,renderOrder:f.renderOrder,z:g,group:_},i[e]=b):(b.id=f.id,b.object=f,b.geometry=p,b.material=x,b.materialVariant=o(f),b.groupOrder=M,b.renderOrder=f.renderOrder,b.z=g,b.group=_),e++,b}function l(f,p,x,M,g,_,b){b.reversedDepth===!0&&(g=-g);let P=a(f,p,x,M,g,_);x.transmission>0?n.push(P):x.transparent===!0?s.push(P):t.push(P)}function c(f,p,x,M,g,_){let b=a(f,p,x,M,g,_);x.transmission>0?n.unshift(b):x.transparent===!0?s.unshift(b):t.unshift(b)}function h(f,p){t.length>1&&t.sort(f||X1),n.length>1&&n.sort(p||h_),s.length>1&&s.sort(p||h_)}function u(){for(let f=e,p=i.length;f<p;f++){let x=i[f];if(x.id===null)break;x.id=null,x.object=null,x.geometry=null,x.material=null,x.group=null}}return{opaque:t,transmissive:n,transparent:s,init:r,push:l,unshift:c,finish:u,sort:h}}function q1(){let i=new WeakMap;function e(n,s){let r=i.get(n),o;return r===void 0?(o=new u_,i.set(n,[o])):s>=r.length?(o=new u_,r.push(o)):o=r[s],o}function t(){i=new WeakMap}return{get:e,dispose:t}}function Y1(){let i={};return{get:function(e){if(i[e.id]!==void 0)return i[e.id];let t;switch(e.type){case"SunLight":case"DirectionalLight":t={direction:new Q,color:new ft};break;case"SpotLight":t={position:new Q,direction:new Q,color:new ft,distance:0,coneCos:0,penumbraCos:0,decay:0};break;case"PointLight":t={position:new Q,color:new ft,distance:0,decay:0};break;case"HemisphereLight":t={direction:new Q,skyColor:new ft,groundColor:new ft};break;case"RectAreaLight":t={color:new ft,position:new Q,halfWidth:new Q,halfHeight:new Q};break}return i[e.id]=t,t}}}function Z1(){let i={};return{get:function(e){if(i[e.id]!==void 0)return i[e.id];let t;switch(e.type){case"SunLight":case"DirectionalLight":t={shadowIntensity:1,shadowBias:0,shadowNormalBias:0,shadowRadius:1,shadowMapSize:new lt};break;case"SpotLight":t={shadowIntensity:1,shadowBias:0,shadowNormalBias:0,shadowRadius:1,shadowMapSize:new lt};break;case"PointLight":t={shadowIntensity:1,shadowBias:0,shadowNormalBias:0,shadowRadius:1,shadowMapSize:new lt,shadowCameraNear:1,shadowCameraFar:1e3};break}return i[e.id]=t,t}}}var K1=0;function $1(i,e){return(e.castShadow?2:0)-(i.castShadow?2:0)+(e.map?1:0)-(i.map?1:0)}function J1(i){let e=new Y1,t=Z1(),n={version:0,hash:{sunLength:-1,directionalLength:-1,pointLength:-1,spotLength:-1,rectAreaLength:-1,hemiLength:-1,numSunShadows:-1,numDirectionalShadows:-1,numPointShadows:-1,numSpotShadows:-1,numSpotMaps:-1,numLightProbes:-1},ambient:[0,0,0],probe:[],sun:[],sunShadow:[],sunShadowMap:[],sunShadowMatrix:[],sunShadowCascade:[],directional:[],directionalShadow:[],directionalShadowMap:[],directionalShadowMatrix:[],spot:[],spotLightMap:[],spotShadow:[],spotShadowMap:[],spotLightMatrix:[],rectArea:[],rectAreaLTC1:null,rectAreaLTC2:null,point:[],pointShadow:[],pointShadowMap:[],pointShadowMatrix:[],hemi:[],numSpotLightShadowsWithMaps:0,numLightProbes:0};for(let c=0;c<9;c++)n.probe.push(new Q);let s=new Q,r=new Mt,o=new Mt;function a(c){let h=0,u=0,f=0;for(let Y=0;Y<9;Y++)n.probe[Y].set(0,0,0);let p=0,x=0,M=0,g=0,_=0,b=0,P=0,w=0,D=0,I=0,y=0,T=0,G=0,k=0;c.sort($1);for(let Y=0,Z=c.length;Y<Z;Y++){let U=c[Y],W=U.color,$=U.intensity,q=U.distance,xe=null;if(U.shadow&&U.shadow.map&&(U.shadow.map.texture.format===yi?xe=U.shadow.map.texture:xe=U.shadow.map.depthTexture||U.shadow.map.texture),U.isAmbientLight)h+=W.r*$,u+=W.g*$,f+=W.b*$;else if(U.isLightProbe){for(let ne=0;ne<9;ne++)n.probe[ne].addScaledVector(U.sh.coefficients[ne],$);k++}else if(U.isSunLight){let ne=e.get(U);if(ne.color.copy(U.color).multiplyScalar(U.intensity),U.castShadow){let se=U.shadow,de=t.get(U);de.shadowIntensity=se.intensity,de.shadowBias=se.bias,de.shadowNormalBias=se.normalBias,de.shadowRadius=se.radius,de.shadowMapSize.copy(se.mapSize).multiply(se.getFrameExtents()),n.sunShadow[x]=de,n.sunShadowMap[x]=xe;let ge=se.getViewportCount();for(let pe=0;pe<ge;pe++)n.sunShadowMatrix[M+pe]=se.getMatrix(pe),n.sunShadowCascade[M+pe]=se._cascadeData[pe];M+=ge,x++}n.sun[p]=ne,p++}else if(U.isDirectionalLight){let ne=e.get(U);if(ne.color.copy(U.color).multiplyScalar(U.intensity),U.castShadow){let se=U.shadow,de=t.get(U);de.shadowIntensity=se.intensity,de.shadowBias=se.bias,de.shadowNormalBias=se.normalBias,de.shadowRadius=se.radius,de.shadowMapSize=se.mapSize,n.directionalShadow[g]=de,n.directionalShadowMap[g]=xe,n.directionalShadowMatrix[g]=U.shadow.matrix,D++}n.directional[g]=ne,g++}else if(U.isSpotLight){let ne=e.get(U);ne.position.setFromMatrixPosition(U.matrixWorld),ne.color.copy(W).multiplyScalar($),ne.distance=q,ne.coneCos=Math.cos(U.angle),ne.penumbraCos=Math.cos(U.angle*(1-U.penumbra)),ne.decay=U.decay,n.spot[b]=ne;let se=U.shadow;if(U.map&&(n.spotLightMap[T]=U.map,T++,se.updateMatrices(U),U.castShadow&&G++),n.spotLightMatrix[b]=se.matrix,U.castShadow){let de=t.get(U);de.shadowIntensity=se.intensity,de.shadowBias=se.bias,de.shadowNormalBias=se.normalBias,de.shadowRadius=se.radius,de.shadowMapSize=se.mapSize,n.spotShadow[b]=de,n.spotShadowMap[b]=xe,y++}b++}else if(U.isRectAreaLight){let ne=e.get(U);ne.color.copy(W).multiplyScalar($),ne.halfWidth.set(U.width*.5,0,0),ne.halfHeight.set(0,U.height*.5,0),n.rectArea[P]=ne,P++}else if(U.isPointLight){let ne=e.get(U);if(ne.color.copy(U.color).multiplyScalar(U.intensity),ne.distance=U.distance,ne.decay=U.decay,U.castShadow){let se=U.shadow,de=t.get(U);de.shadowIntensity=se.intensity,de.shadowBias=se.bias,de.shadowNormalBias=se.normalBias,de.shadowRadius=se.radius,de.shadowMapSize=se.mapSize,de.shadowCameraNear=se.camera.near,de.shadowCameraFar=se.camera.far,n.pointShadow[_]=de,n.pointShadowMap[_]=xe,n.pointShadowMatrix[_]=U.shadow.matrix,I++}n.point[_]=ne,_++}else if(U.isHemisphereLight){let ne=e.get(U);ne.skyColor.copy(U.color).multiplyScalar($),ne.groundColor.copy(U.groundColor).multiplyScalar($),n.hemi[w]=ne,w++}}P>0&&(i.has("OES_texture_float_linear")===!0?(n.rectAreaLTC1=Ye.LTC_FLOAT_1,n.rectAreaLTC2=Ye.LTC_FLOAT_2):(n.rectAreaLTC1=Ye.LTC_HALF_1,n.rectAreaLTC2=Ye.LTC_HALF_2)),n.ambient[0]=h,n.ambient[1]=u,n.ambient[2]=f;let O=n.hash;(O.sunLength!==p||O.directionalLength!==g||O.pointLength!==_||O.spotLength!==b||O.rectAreaLength!==P||O.hemiLength!==w||O.numSunShadows!==x||O.numDirectionalShadows!==D||O.numPointShadows!==I||O.numSpotShadows!==y||O.numSpotMaps!==T||O.numLightProbes!==k)&&(n.sun.length=p,n.directional.length=g,n.spot.length=b,n.rectArea.length=P,n.point.length=_,n.hemi.length=w,n.sunShadow.length=x,n.sunShadowMap.length=x,n.sunShadowMatrix.length=M,n.sunShadowCascade.length=M,n.directionalShadow.length=D,n.directionalShadowMap.length=D,n.directionalShadowMatrix.length=D,n.pointShadow.length=I,n.pointShadowMap.length=I,n.pointShadowMatrix.length=I,n.spotShadow.length=y,n.spotShadowMap.length=y,n.spotLightMatrix.length=y+T-G,n.spotLightMap.length=T,n.numSpotLightShadowsWithMaps=G,n.numLightProbes=k,O.sunLength=p,O.directionalLength=g,O.pointLength=_,O.spotLength=b,O.rectAreaLength=P,O.hemiLength=w,O.numSunShadows=x,O.numDirectionalShadows=D,O.numPointShadows=I,O.numSpotShadows=y,O.numSpotMaps=T,O.numLightProbes=k,n.version=K1++)}function l(c,h){let u=0,f=0,p=0,x=0,M=0,g=0,_=h.matrixWorldInverse;for(let b=0,P=c.length;b<P;b++){let w=c[b];if(w.isSunLight){let D=n.sun[u];D.direction.setFromMatrixPosition(w.matrixWorld),D.direction.transformDirection(_),u++}else if(w.isDirectionalLight){let D=n.directional[f];D.direction.setFromMatrixPosition(w.matrixWorld),s.setFromMatrixPosition(w.target.matrixWorld),D.direction.sub(s),D.direction.transformDirection(_),f++}else if(w.isSpotLight){let D=n.spot[x];D.position.setFromMatrixPosition(w.matrixWorld),D.position.applyMatrix4(_),D.direction.setFromMatrixPosition(w.matrixWorld),s.setFromMatrixPosition(w.target.matrixWorld),D.direction.sub(s),D.direction.transformDirection(_),x++}else if(w.isRectAreaLight){let D=n.rectArea[M];D.position.setFromMatrixPosition(w.matrixWorld),D.position.applyMatrix4(_),o.identity(),r.copy(w.matrixWorld),r.premultiply(_),o.extractRotation(r),D.halfWidth.set(w.width*.5,0,0),D.halfHeight.set(0,w.height*.5,0),D.halfWidth.applyMatrix4(o),D.halfHeight.applyMatrix4(o),M++}else if(w.isPointLight){let D=n.point[p];D.position.setFromMatrixPosition(w.matrixWorld),D.position.applyMatrix4(_),p++}else if(w.isHemisphereLight){let D=n.hemi[g];D.direction.setFromMatrixPosition(w.matrixWorld),D.direction.transformDirection(_),g++}}}return{setup:a,setupView:l,state:n}}function f_(i){let e=new J1(i),t=[],n=[],s=[];function r(u){h.camera=u,t.length=0,n.length=0,s.length=0}function o(u){u.isLightProbeGrid?s.push(u):t.push(u)}function a(u){n.push(u)}function l(){e.setup(t),s.sort((u,f)=>u.priority-f.priority||u.id-f.id)}function c(u){e.setupView(t,u)}let h={lightsArray:t,shadowsArray:n,lightProbeGridArray:s,camera:null,lights:e,transmissionRenderTarget:{},textureUnits:0};return{init:r,state:h,setupLights:l,setupLightsView:c,pushLight:o,pushShadow:a}}function j1(i){let e=new WeakMap;function t(s,r=0){let o=e.get(s),a;return o===void 0?(a=new f_(i),e.set(s,[a])):r>=o.length?(a=new f_(i),o.push(a)):a=o[r],a}function n(){e=new WeakMap}return{get:t,dispose:n}}var Q1=`void main() {
	gl_Position = vec4( position, 1.0 );
}`,eE=`uniform sampler2D shadow_pass;
uniform vec2 resolution;
uniform float radius;
void main() {
	const float samples = float( VSM_SAMPLES );
	float mean = 0.0;
	float squared_mean = 0.0;
	float uvStride = samples <= 1.0 ? 0.0 : 2.0 / ( samples - 1.0 );
	float uvStart = samples <= 1.0 ? 0.0 : - 1.0;
	for ( float i = 0.0; i < samples; i ++ ) {
		float uvOffset = uvStart + i * uvStride;
		#ifdef HORIZONTAL_PASS
			vec2 distribution = texture2D( shadow_pass, ( gl_FragCoord.xy + vec2( uvOffset, 0.0 ) * radius ) / resolution ).rg;
			mean += distribution.x;
			squared_mean += distribution.y * distribution.y + distribution.x * distribution.x;
		#else
			float depth = texture2D( shadow_pass, ( gl_FragCoord.xy + vec2( 0.0, uvOffset ) * radius ) / resolution ).r;
			mean += depth;
			squared_mean += depth * depth;
		#endif
	}
	mean = mean / samples;
	squared_mean = squared_mean / samples;
	float std_dev = sqrt( max( 0.0, squared_mean - mean * mean ) );
	gl_FragColor = vec4( mean, std_dev, 0.0, 1.0 );
}`,tE=[new Q(1,0,0),new Q(-1,0,0),new Q(0,1,0),new Q(0,-1,0),new Q(0,0,1),new Q(0,0,-1)],nE=[new Q(0,-1,0),new Q(0,-1,0),new Q(0,0,1),new Q(0,0,-1),new Q(0,-1,0),new Q(0,-1,0)],d_=new Mt,Al=new Q,Td=new Q;function iE(i,e,t){let n=new br,s=new lt,r=new lt,o=new $t,a=new Kc,l=new $c,c={},h=t.maxTextureSize,u={[bs]:pi,[pi]:bs,[ei]:ei},f=new fi({defines:{VSM_SAMPLES:8},uniforms:{shadow_pass:{value:null},resolution:{value:new lt},radius:{value:4}},vertexShader:Q1,fragmentShader:eE}),p=f.clone();p.defines.HORIZONTAL_PASS=1;let x=new Qn;x.setAttribute("position",new $n(new Float32Array([-1,-1,.5,3,-1,.5,-1,3,.5]),3));let M=new In(x,f),g=this;this.enabled=!1,this.autoUpdate=!0,this.needsUpdate=!1,this.type=ml;let _=this.type;this.render=function(I,y,T){if(g.enabled===!1||g.autoUpdate===!1&&g.needsUpdate===!1||I.length===0)return;this.type===h0&&(nt("WebGLShadowMap: PCFSoftShadowMap has been removed. Using PCFShadowMap instead."),this.type=ml);let G=i.getRenderTarget(),k=i.getActiveCubeFace(),O=i.getActiveMipmapLevel(),Y=i.state;Y.setBlending(to),Y.buffers.depth.getReversed()===!0?Y.buffers.color.setClear(0,0,0,0):Y.buffers.color.setClear(1,1,1,1),Y.buffers.depth.setTest(!0),Y.setScissorTest(!1);let Z=_!==this.type;Z&&y.traverse(function(U){U.material&&(Array.isArray(U.material)?U.material.forEach(W=>W.needsUpdate=!0):U.material.needsUpdate=!0)});for(let U=0,W=I.length;U<W;U++){let $=I[U],q=$.shadow;if(q===void 0){nt("WebGLShadowMap:",$,"has no shadow.");continue}if(q.autoUpdate===!1&&q.needsUpdate===!1)continue;s.copy(q.mapSize);let xe=q.getFrameExtents();s.multiply(xe),r.copy(q.mapSize),(s.x>h||s.y>h)&&(s.x>h&&(r.x=Math.floor(h/xe.x),s.x=r.x*xe.x,q.mapSize.x=r.x),s.y>h&&(r.y=Math.floor(h/xe.y),s.y=r.y*xe.y,q.mapSize.y=r.y));let ne=i.state.buffers.depth.getReversed();if(q.camera._reversedDepth=ne,q.map===null||Z===!0){if(q.map!==null&&(q.map.depthTexture!==null&&(q.map.depthTexture.dispose(),q.map.depthTexture=null),q.map.dispose()),this.type===ia){if($.isPointLight){nt("WebGLShadowMap: VSM shadow maps are not supported for PointLights. Use PCF or BasicShadowMap instead.");continue}q.map=new hi(s.x,s.y,{format:yi,type:hn,minFilter:Xt,magFilter:Xt,generateMipmaps:!1}),q.map.texture.name=$.name+".shadowMap",q.map.depthTexture=new qs(s.x,s.y,Pn),q.map.depthTexture.name=$.name+".shadowMapDepth",q.map.depthTexture.format=Hs,q.map.depthTexture.compareFunction=null,q.map.depthTexture.minFilter=En,q.map.depthTexture.magFilter=En}else $.isPointLight?(q.map=new Cl(s.x),q.map.depthTexture=new rl(s.x,as)):(q.map=new hi(s.x,s.y),q.map.depthTexture=new qs(s.x,s.y,as)),q.map.depthTexture.name=$.name+".shadowMap",q.map.depthTexture.format=Hs,this.type===ml?(q.map.depthTexture.compareFunction=ne?dd:fd,q.map.depthTexture.minFilter=Xt,q.map.depthTexture.magFilter=Xt):(q.map.depthTexture.compareFunction=null,q.map.depthTexture.minFilter=En,q.map.depthTexture.magFilter=En);q.camera.updateProjectionMatrix()}q.map.isWebGLCubeRenderTarget!==!0&&(q.map.width!==s.x||q.map.height!==s.y)&&q.map.setSize(s.x,s.y);let se=q.map.isWebGLCubeRenderTarget?6:q.getViewportCount();$.isPointLight!==!0&&q.updateMatrices($,T);let de=(q.camera.layers.mask&4294967294)!==0?q.camera.layers:T.layers;for(let ge=0;ge<se;ge++){let pe=q.getCamera(ge);if($.isPointLight){let re=q.camera,Te=q.matrix,Ie=$.distance||re.far;Ie!==re.far&&(re.far=Ie,re.updateProjectionMatrix()),Al.setFromMatrixPosition($.matrixWorld),re.position.copy(Al),Td.copy(re.position),Td.add(tE[ge]),re.up.copy(nE[ge]),re.lookAt(Td),re.updateMatrixWorld(),Te.makeTranslation(-Al.x,-Al.y,-Al.z),d_.multiplyMatrices(re.projectionMatrix,re.matrixWorldInverse),q._frustum.setFromProjectionMatrix(d_,re.coordinateSystem,re.reversedDepth)}if(q.map.isWebGLCubeRenderTarget)i.setRenderTarget(q.map,ge),i.clear();else{ge===0&&(i.setRenderTarget(q.map),i.clear());let re=q.getViewport(ge);o.set(r.x*re.x,r.y*re.y,r.x*re.z,r.y*re.w),Y.viewport(o)}n=q.getFrustum(ge),w(y,T,pe,$,de,this.type)}q.isPointLightShadow!==!0&&this.type===ia&&b(q,T),q.needsUpdate=!1}_=this.type,g.needsUpdate=!1,i.setRenderTarget(G,k,O)};function b(I,y){let T=e.update(M);f.defines.VSM_SAMPLES!==I.blurSamples&&(f.defines.VSM_SAMPLES=I.blurSamples,p.defines.VSM_SAMPLES=I.blurSamples,f.needsUpdate=!0,p.needsUpdate=!0),I.mapPass===null?I.mapPass=new hi(s.x,s.y,{format:yi,type:hn}):(I.mapPass.width!==I.map.width||I.mapPass.height!==I.map.height)&&I.mapPass.setSize(I.map.width,I.map.height),f.uniforms.shadow_pass.value=I.map.depthTexture,f.uniforms.resolution.value.set(I.map.width,I.map.height),f.uniforms.radius.value=I.radius,i.setRenderTarget(I.mapPass),i.clear(),i.renderBufferDirect(y,null,T,f,M,null),p.uniforms.shadow_pass.value=I.mapPass.texture,p.uniforms.resolution.value.set(I.map.width,I.map.height),p.uniforms.radius.value=I.radius,i.setRenderTarget(I.map),i.clear(),i.renderBufferDirect(y,null,T,p,M,null)}function P(I,y,T,G){let k=null,O=T.isPointLight===!0?I.customDistanceMaterial:I.customDepthMaterial;if(O!==void 0)k=O;else if(k=T.isPointLight===!0?l:a,i.localClippingEnabled&&y.clipShadows===!0&&Array.isArray(y.clippingPlanes)&&y.clippingPlanes.length!==0||y.displacementMap&&y.displacementScale!==0||y.alphaMap&&y.alphaTest>0||y.map&&y.alphaTest>0||y.alphaToCoverage===!0){let Y=k.uuid,Z=y.uuid,U=c[Y];U===void 0&&(U={},c[Y]=U);let W=U[Z];W===void 0&&(W=k.clone(),U[Z]=W,y.addEventListener("dispose",D)),k=W}if(k.visible=y.visible,k.wireframe=y.wireframe,G===ia?k.side=y.shadowSide!==null?y.shadowSide:y.side:k.side=y.shadowSide!==null?y.shadowSide:u[y.side],k.alphaMap=y.alphaMap,k.alphaTest=y.alphaToCoverage===!0?.5:y.alphaTest,k.map=y.map,k.clipShadows=y.clipShadows,k.clippingPlanes=y.clippingPlanes,k.clipIntersection=y.clipIntersection,k.displacementMap=y.displacementMap,k.displacementScale=y.displacementScale,k.displacementBias=y.displacementBias,k.wireframeLinewidth=y.wireframeLinewidth,k.linewidth=y.linewidth,T.isPointLight===!0&&k.isMeshDistanceMaterial===!0){let Y=i.properties.get(k);Y.light=T}return k}function w(I,y,T,G,k,O){if(I.visible===!1)return;if(I.layers.test(k)&&(I.isMesh||I.isLine||I.isPoints)&&(I.castShadow||I.receiveShadow&&O===ia)&&(!I.frustumCulled||I.intersectsFrustum(n))){I.modelViewMatrix.multiplyMatrices(T.matrixWorldInverse,I.matrixWorld);let U=e.update(I),W=I.material;if(Array.isArray(W)){let $=U.groups;for(let q=0,xe=$.length;q<xe;q++){let ne=$[q],se=W[ne.materialIndex];if(se&&se.visible){let de=P(I,se,G,O);I.onBeforeShadow(i,I,y,T,U,de,ne),i.renderBufferDirect(T,null,U,de,I,ne),I.onAfterShadow(i,I,y,T,U,de,ne)}}}else if(W.visible){let $=P(I,W,G,O);I.onBeforeShadow(i,I,y,T,U,$,null),i.renderBufferDirect(T,null,U,$,I,null),I.onAfterShadow(i,I,y,T,U,$,null)}}let Z=I.children;for(let U=0,W=Z.length;U<W;U++)w(Z[U],y,T,G,k,O)}function D(I){I.target.removeEventListener("dispose",D);for(let T in c){let G=c[T],k=I.target.uuid;k in G&&(G[k].dispose(),delete G[k])}}}function sE(i,e){function t(){let H=!1,he=new $t,oe=null,ke=new $t(0,0,0,0);return{setMask:function(Pe){oe!==Pe&&!H&&(i.colorMask(Pe,Pe,Pe,Pe),oe=Pe)},setLocked:function(Pe){H=Pe},setClear:function(Pe,Fe,tt,dt,Me){Me===!0&&(Pe*=dt,Fe*=dt,tt*=dt),he.set(Pe,Fe,tt,dt),ke.equals(he)===!1&&(i.clearColor(Pe,Fe,tt,dt),ke.copy(he))},reset:function(){H=!1,oe=null,ke.set(-1,0,0,0)}}}function n(){let H=!1,he=!1,oe=null,ke=null,Pe=null;return{setReversed:function(Fe){if(he!==Fe){let tt=e.get("EXT_clip_control");Fe?tt.clipControlEXT(tt.LOWER_LEFT_EXT,tt.ZERO_TO_ONE_EXT):tt.clipControlEXT(tt.LOWER_LEFT_EXT,tt.NEGATIVE_ONE_TO_ONE_EXT),he=Fe;let dt=Pe;Pe=null,this.setClear(dt)}},getReversed:function(){return he},setTest:function(Fe){Fe?ye(i.DEPTH_TEST):$e(i.DEPTH_TEST)},setMask:function(Fe){oe!==Fe&&!H&&(i.depthMask(Fe),oe=Fe)},setFunc:function(Fe){if(he&&(Fe=G0[Fe]),ke!==Fe){switch(Fe){case Uc:i.depthFunc(i.NEVER);break;case Oc:i.depthFunc(i.ALWAYS);break;case Fc:i.depthFunc(i.LESS);break;case Go:i.depthFunc(i.LEQUAL);break;case Bc:i.depthFunc(i.EQUAL);break;case kc:i.depthFunc(i.GEQUAL);break;case zc:i.depthFunc(i.GREATER);break;case Hc:i.depthFunc(i.NOTEQUAL);break;default:i.depthFunc(i.LEQUAL)}ke=Fe}},setLocked:function(Fe){H=Fe},setClear:function(Fe){Pe!==Fe&&(Pe=Fe,he&&(Fe=1-Fe),i.clearDepth(Fe))},reset:function(){H=!1,oe=null,ke=null,Pe=null,he=!1}}}function s(){let H=!1,he=null,oe=null,ke=null,Pe=null,Fe=null,tt=null,dt=null,Me=null;return{setTest:function(Je){H||(Je?ye(i.STENCIL_TEST):$e(i.STENCIL_TEST))},setMask:function(Je){he!==Je&&!H&&(i.stencilMask(Je),he=Je)},setFunc:function(Je,pt,Ge){(oe!==Je||ke!==pt||Pe!==Ge)&&(i.stencilFunc(Je,pt,Ge),oe=Je,ke=pt,Pe=Ge)},setOp:function(Je,pt,Ge){(Fe!==Je||tt!==pt||dt!==Ge)&&(i.stencilOp(Je,pt,Ge),Fe=Je,tt=pt,dt=Ge)},setLocked:function(Je){H=Je},setClear:function(Je){Me!==Je&&(i.clearStencil(Je),Me=Je)},reset:function(){H=!1,he=null,oe=null,ke=null,Pe=null,Fe=null,tt=null,dt=null,Me=null}}}let r=new t,o=new n,a=new s,l={},c=new WeakMap,h={},u={},f={},p=new WeakMap,x=[],M=null,g=!1,_=null,b=null,P=null,w=null,D=null,I=null,y=null,T=new ft(0,0,0),G=0,k=!1,O=null,Y=null,Z=null,U=null,W=null,$=i.getParameter(i.MAX_COMBINED_TEXTURE_IMAGE_UNITS),q=!1,xe=0,ne=i.getParameter(i.VERSION);ne.indexOf("WebGL")!==-1?(xe=parseFloat(/^WebGL (\d)/.exec(ne)[1]),q=xe>=1):ne.indexOf("OpenGL ES")!==-1&&(xe=parseFloat(/^OpenGL ES (\d)/.exec(ne)[1]),q=xe>=2);let se=null,de={},ge=i.getParameter(i.SCISSOR_BOX),pe=i.getParameter(i.VIEWPORT),re=new $t().fromArray(ge),Te=new $t().fromArray(pe);function Ie(H,he,oe,ke){let Pe=new Uint8Array(4),Fe=i.createTexture();i.bindTexture(H,Fe),i.texParameteri(H,i.TEXTURE_MIN_FILTER,i.NEAREST),i.texParameteri(H,i.TEXTURE_MAG_FILTER,i.NEAREST);for(let tt=0;tt<oe;tt++)H===i.TEXTURE_3D||H===i.TEXTURE_2D_ARRAY?i.texImage3D(he,0,i.RGBA,1,1,ke,0,i.RGBA,i.UNSIGNED_BYTE,Pe):i.texImage2D(he+tt,0,i.RGBA,1,1,0,i.RGBA,i.UNSIGNED_BYTE,Pe);return Fe}let Oe={};Oe[i.TEXTURE_2D]=Ie(i.TEXTURE_2D,i.TEXTURE_2D,1),Oe[i.TEXTURE_CUBE_MAP]=Ie(i.TEXTURE_CUBE_MAP,i.TEXTURE_CUBE_MAP_POSITIVE_X,6),Oe[i.TEXTURE_2D_ARRAY]=Ie(i.TEXTURE_2D_ARRAY,i.TEXTURE_2D_ARRAY,1,1),Oe[i.TEXTURE_3D]=Ie(i.TEXTURE_3D,i.TEXTURE_3D,1,1),r.setClear(0,0,0,1),o.setClear(1),a.setClear(0),ye(i.DEPTH_TEST),o.setFunc(Go),fn(!1),Vt(Yf),ye(i.CULL_FACE),Yt(to);function ye(H){h[H]!==!0&&(i.enable(H),h[H]=!0)}function $e(H){h[H]!==!1&&(i.disable(H),h[H]=!1)}function ut(H,he){return f[H]!==he?(i.bindFramebuffer(H,he),f[H]=he,H===i.DRAW_FRAMEBUFFER&&(f[i.FRAMEBUFFER]=he),H===i.FRAMEBUFFER&&(f[i.DRAW_FRAMEBUFFER]=he),!0):!1}function et(H,he){let oe=x,ke=!1;if(H){oe=p.get(he),oe===void 0&&(oe=[],p.set(he,oe));let Pe=H.textures;if(oe.length!==Pe.length||oe[0]!==i.COLOR_ATTACHMENT0){for(let Fe=0,tt=Pe.length;Fe<tt;Fe++)oe[Fe]=i.COLOR_ATTACHMENT0+Fe;oe.length=Pe.length,ke=!0}}else oe[0]!==i.BACK&&(oe[0]=i.BACK,ke=!0);ke&&i.drawBuffers(oe)}function bt(H){return M!==H?(i.useProgram(H),M=H,!0):!1}let vt={[no]:i.FUNC_ADD,[u0]:i.FUNC_SUBTRACT,[f0]:i.FUNC_REVERSE_SUBTRACT};vt[d0]=i.MIN,vt[p0]=i.MAX;let _t={[m0]:i.ZERO,[gl]:i.ONE,[g0]:i.SRC_COLOR,[Jf]:i.SRC_ALPHA,[M0]:i.SRC_ALPHA_SATURATE,[y0]:i.DST_COLOR,[x0]:i.DST_ALPHA,[_0]:i.ONE_MINUS_SRC_COLOR,[jf]:i.ONE_MINUS_SRC_ALPHA,[S0]:i.ONE_MINUS_DST_COLOR,[v0]:i.ONE_MINUS_DST_ALPHA,[b0]:i.CONSTANT_COLOR,[w0]:i.ONE_MINUS_CONSTANT_COLOR,[E0]:i.CONSTANT_ALPHA,[T0]:i.ONE_MINUS_CONSTANT_ALPHA};function Yt(H,he,oe,ke,Pe,Fe,tt,dt,Me,Je){if(H===to){g===!0&&($e(i.BLEND),g=!1);return}if(g===!1&&(ye(i.BLEND),g=!0),H!==rh){if(H!==_||Je!==k){if((b!==no||D!==no)&&(i.blendEquation(i.FUNC_ADD),b=no,D=no),Je)switch(H){case sa:i.blendFuncSeparate(i.ONE,i.ONE_MINUS_SRC_ALPHA,i.ONE,i.ONE_MINUS_SRC_ALPHA);break;case Zf:i.blendFunc(i.ONE,i.ONE);break;case Kf:i.blendFuncSeparate(i.ZERO,i.ONE_MINUS_SRC_COLOR,i.ZERO,i.ONE);break;case $f:i.blendFuncSeparate(i.DST_COLOR,i.ONE_MINUS_SRC_ALPHA,i.ZERO,i.ONE);break;default:gt("WebGLState: Invalid blending: ",H);break}else switch(H){case sa:i.blendFuncSeparate(i.SRC_ALPHA,i.ONE_MINUS_SRC_ALPHA,i.ONE,i.ONE_MINUS_SRC_ALPHA);break;case Zf:i.blendFuncSeparate(i.SRC_ALPHA,i.ONE,i.ONE,i.ONE);break;case Kf:gt("WebGLState: SubtractiveBlending requires material.premultipliedAlpha = true");break;case $f:gt("WebGLState: MultiplyBlending requires material.premultipliedAlpha = true");break;default:gt("WebGLState: Invalid blending: ",H);break}P=null,w=null,I=null,y=null,T.set(0,0,0),G=0,_=H,k=Je}return}Pe=Pe||he,Fe=Fe||oe,tt=tt||ke,(he!==b||Pe!==D)&&(i.blendEquationSeparate(vt[he],vt[Pe]),b=he,D=Pe),(oe!==P||ke!==w||Fe!==I||tt!==y)&&(i.blendFuncSeparate(_t[oe],_t[ke],_t[Fe],_t[tt]),P=oe,w=ke,I=Fe,y=tt),(dt.equals(T)===!1||Me!==G)&&(i.blendColor(dt.r,dt.g,dt.b,Me),T.copy(dt),G=Me),_=H,k=!1}function Ft(H,he){H.side===ei?$e(i.CULL_FACE):ye(i.CULL_FACE);let oe=H.side===pi;he&&(oe=!oe),fn(oe),H.blending===sa&&H.transparent===!1?Yt(to):Yt(H.blending,H.blendEquation,H.blendSrc,H.blendDst,H.blendEquationAlpha,H.blendSrcAlpha,H.blendDstAlpha,H.blendColor,H.blendAlpha,H.premultipliedAlpha),o.setFunc(H.depthFunc),o.setTest(H.depthTest),o.setMask(H.depthWrite),r.setMask(H.colorWrite);let ke=H.stencilWrite;a.setTest(ke),ke&&(a.setMask(H.stencilWriteMask),a.setFunc(H.stencilFunc,H.stencilRef,H.stencilFuncMask),a.setOp(H.stencilFail,H.stencilZFail,H.stencilZPass)),Pt(H.polygonOffset,H.polygonOffsetFactor,H.polygonOffsetUnits),H.alphaToCoverage===!0?ye(i.SAMPLE_ALPHA_TO_COVERAGE):$e(i.SAMPLE_ALPHA_TO_COVERAGE)}function fn(H){O!==H&&(H?i.frontFace(i.CW):i.frontFace(i.CCW),O=H)}function Vt(H){H!==l0?(ye(i.CULL_FACE),H!==Y&&(H===Yf?i.cullFace(i.BACK):H===c0?i.cullFace(i.FRONT):i.cullFace(i.FRONT_AND_BACK))):$e(i.CULL_FACE),Y=H}function Tn(H){H!==Z&&(q&&i.lineWidth(H),Z=H)}function Pt(H,he,oe){H?(ye(i.POLYGON_OFFSET_FILL),(U!==he||W!==oe)&&(U=he,W=oe,o.getReversed()&&(he=-he,oe=-oe),i.polygonOffset(he,oe))):$e(i.POLYGON_OFFSET_FILL)}function yn(H){H?ye(i.SCISSOR_TEST):$e(i.SCISSOR_TEST)}function nn(H){H===void 0&&(H=i.TEXTURE0+$-1),se!==H&&(i.activeTexture(H),se=H)}function Sn(H,he,oe){oe===void 0&&(se===null?oe=i.TEXTURE0+$-1:oe=se);let ke=de[oe];ke===void 0&&(ke={type:void 0,texture:void 0},de[oe]=ke),(ke.type!==H||ke.texture!==he)&&(se!==oe&&(i.activeTexture(oe),se=oe),i.bindTexture(H,he||Oe[H]),ke.type=H,ke.texture=he)}function V(){let H=de[se];H!==void 0&&H.type!==void 0&&(i.bindTexture(H.type,null),H.type=void 0,H.texture=void 0)}function He(){try{i.compressedTexImage2D(...arguments)}catch(H){gt("WebGLState:",H)}}function ct(){try{i.compressedTexImage3D(...arguments)}catch(H){gt("WebGLState:",H)}}function xt(){try{i.texSubImage2D(...arguments)}catch(H){gt("WebGLState:",H)}}function Ne(){try{i.texSubImage3D(...arguments)}catch(H){gt("WebGLState:",H)}}function Zt(){try{i.compressedTexSubImage2D(...arguments)}catch(H){gt("WebGLState:",H)}}function je(){try{i.compressedTexSubImage3D(...arguments)}catch(H){gt("WebGLState:",H)}}function at(){try{i.texStorage2D(...arguments)}catch(H){gt("WebGLState:",H)}}function N(){try{i.texStorage3D(...arguments)}catch(H){gt("WebGLState:",H)}}function E(){try{i.texImage2D(...arguments)}catch(H){gt("WebGLState:",H)}}function ee(){try{i.texImage3D(...arguments)}catch(H){gt("WebGLState:",H)}}function Se(H){return u[H]!==void 0?u[H]:i.getParameter(H)}function me(H,he){u[H]!==he&&(i.pixelStorei(H,he),u[H]=he)}function De(H){re.equals(H)===!1&&(i.scissor(H.x,H.y,H.z,H.w),re.copy(H))}function Ue(H){Te.equals(H)===!1&&(i.viewport(H.x,H.y,H.z,H.w),Te.copy(H))}function ae(H,he){let oe=c.get(he);oe===void 0&&(oe=new WeakMap,c.set(he,oe));let ke=oe.get(H);ke===void 0&&(ke=i.getUniformBlockIndex(he,H.name),i.uniformBlockBinding(he,ke,ke),oe.set(H,ke))}function ue(H,he,oe){let Pe=c.get(he).get(H);l[Pe]!==oe&&(i.bindBufferBase(i.UNIFORM_BUFFER,Pe,oe),l[Pe]=oe)}function Ae(){i.disable(i.BLEND),i.disable(i.CULL_FACE),i.disable(i.DEPTH_TEST),i.disable(i.POLYGON_OFFSET_FILL),i.disable(i.SCISSOR_TEST),i.disable(i.STENCIL_TEST),i.disable(i.SAMPLE_ALPHA_TO_COVERAGE),i.blendEquation(i.FUNC_ADD),i.blendFunc(i.ONE,i.ZERO),i.blendFuncSeparate(i.ONE,i.ZERO,i.ONE,i.ZERO),i.blendColor(0,0,0,0),i.colorMask(!0,!0,!0,!0),i.clearColor(0,0,0,0),i.depthMask(!0),i.depthFunc(i.LESS),o.setReversed(!1),i.clearDepth(1),i.stencilMask(4294967295),i.stencilFunc(i.ALWAYS,0,4294967295),i.stencilOp(i.KEEP,i.KEEP,i.KEEP),i.clearStencil(0),i.cullFace(i.BACK),i.frontFace(i.CCW),i.polygonOffset(0,0),i.activeTexture(i.TEXTURE0),i.bindFramebuffer(i.FRAMEBUFFER,null),i.bindFramebuffer(i.DRAW_FRAMEBUFFER,null),i.bindFramebuffer(i.READ_FRAMEBUFFER,null),i.useProgram(null),i.lineWidth(1),i.scissor(0,0,i.canvas.width,i.canvas.height),i.viewport(0,0,i.canvas.width,i.canvas.height),i.pixelStorei(i.PACK_ALIGNMENT,4),i.pixelStorei(i.UNPACK_ALIGNMENT,4),i.pixelStorei(i.UNPACK_FLIP_Y_WEBGL,!1),i.pixelStorei(i.UNPACK_PREMULTIPLY_ALPHA_WEBGL,!1),i.pixelStorei(i.UNPACK_COLORSPACE_CONVERSION_WEBGL,i.BROWSER_DEFAULT_WEBGL),i.pixelStorei(i.PACK_ROW_LENGTH,0),i.pixelStorei(i.PACK_SKIP_PIXELS,0),i.pixelStorei(i.PACK_SKIP_ROWS,0),i.pixelStorei(i.UNPACK_ROW_LENGTH,0),i.pixelStorei(i.UNPACK_IMAGE_HEIGHT,0),i.pixelStorei(i.UNPACK_SKIP_PIXELS,0),i.pixelStorei(i.UNPACK_SKIP_ROWS,0),i.pixelStorei(i.UNPACK_SKIP_IMAGES,0),h={},u={},se=null,de={},f={},l={},p=new WeakMap,x=[],M=null,g=!1,_=null,b=null,P=null,w=null,D=null,I=null,y=null,T=new ft(0,0,0),G=0,k=!1,O=null,Y=null,Z=null,U=null,W=null,re.set(0,0,i.canvas.width,i.canvas.height),Te.set(0,0,i.canvas.width,i.canvas.height),r.reset(),o.reset(),a.reset()}return{buffers:{color:r,depth:o,stencil:a},enable:ye,disable:$e,bindFramebuffer:ut,drawBuffers:et,useProgram:bt,setBlending:Yt,setMaterial:Ft,setFlipSided:fn,setCullFace:Vt,setLineWidth:Tn,setPolygonOffset:Pt,setScissorTest:yn,activeTexture:nn,bindTexture:Sn,unbindTexture:V,compressedTexImage2D:He,compressedTexImage3D:ct,texImage2D:E,texImage3D:ee,pixelStorei:me,getParameter:Se,updateUBOMapping:ae,uniformBlockBinding:ue,texStorage2D:at,texStorage3D:N,texSubImage2D:xt,texSubImage3D:Ne,compressedTexSubImage2D:Zt,compressedTexSubImage3D:je,scissor:De,viewport:Ue,reset:Ae}}function rE(i,e,t,n,s,r,o){let a=e.has("WEBGL_multisampled_render_to_texture")?e.get("WEBGL_multisampled_render_to_texture"):null,l=typeof navigator>"u"?!1:/OculusBrowser/g.test(navigator.userAgent),c=new lt,h=new WeakMap,u=new Set,f,p=new WeakMap,x=new Set,M=new FinalizationRegistry(N=>x.delete(N)),g=!1;try{g=typeof OffscreenCanvas<"u"&&new OffscreenCanvas(1,1).getContext("2d")!==null}catch{}function _(N,E){return g?new OffscreenCanvas(N,E):Xo("canvas")}function b(N,E,ee){let Se=1,me=at(N);if((me.width>ee||me.height>ee)&&(Se=ee/Math.max(me.width,me.height)),Se<1)if(typeof HTMLImageElement<"u"&&N instanceof HTMLImageElement||typeof HTMLCanvasElement<"u"&&N instanceof HTMLCanvasElement||typeof ImageBitmap<"u"&&N instanceof ImageBitmap||typeof VideoFrame<"u"&&N instanceof VideoFrame){let De=Math.floor(Se*me.width),Ue=Math.floor(Se*me.height);f===void 0&&(f=_(De,Ue));let ae=E?_(De,Ue):f;return ae.width=De,ae.height=Ue,ae.getContext("2d").drawImage(N,0,0,De,Ue),nt("WebGLRenderer: Texture has been resized from ("+me.width+"x"+me.height+") to ("+De+"x"+Ue+")."),ae}else return"data"in N&&nt("WebGLRenderer: Image in DataTexture is too big ("+me.width+"x"+me.height+")."),N;return N}function P(N){return N.generateMipmaps}function w(N){i.generateMipmap(N)}function D(N){return N.isWebGLCubeRenderTarget?i.TEXTURE_CUBE_MAP:N.isWebGL3DRenderTarget?i.TEXTURE_3D:N.isWebGLArrayRenderTarget||N.isCompressedArrayTexture?i.TEXTURE_2D_ARRAY:i.TEXTURE_2D}function I(N,E,ee,Se,me,De=!1){if(N!==null){if(i[N]!==void 0)return i[N];nt("WebGLRenderer: Attempt to use non-existing WebGL internal format '"+N+"'")}let Ue;Se&&(Ue=e.get("EXT_texture_norm16"),Ue||nt("WebGLRenderer: Unable to use normalized textures without EXT_texture_norm16 extension"));let ae=E;if(E===i.RED&&(ee===i.FLOAT&&(ae=i.R32F),ee===i.HALF_FLOAT&&(ae=i.R16F),ee===i.UNSIGNED_BYTE&&(ae=i.R8),ee===i.UNSIGNED_SHORT&&Ue&&(ae=Ue.R16_EXT),ee===i.SHORT&&Ue&&(ae=Ue.R16_SNORM_EXT)),E===i.RED_INTEGER&&(ee===i.UNSIGNED_BYTE&&(ae=i.R8UI),ee===i.UNSIGNED_SHORT&&(ae=i.R16UI),ee===i.UNSIGNED_INT&&(ae=i.R32UI),ee===i.BYTE&&(ae=i.R8I),ee===i.SHORT&&(ae=i.R16I),ee===i.INT&&(ae=i.R32I)),E===i.RG&&(ee===i.FLOAT&&(ae=i.RG32F),ee===i.HALF_FLOAT&&(ae=i.RG16F),ee===i.UNSIGNED_BYTE&&(ae=i.RG8),ee===i.UNSIGNED_SHORT&&Ue&&(ae=Ue.RG16_EXT),ee===i.SHORT&&Ue&&(ae=Ue.RG16_SNORM_EXT)),E===i.RG_INTEGER&&(ee===i.UNSIGNED_BYTE&&(ae=i.RG8UI),ee===i.UNSIGNED_SHORT&&(ae=i.RG16UI),ee===i.UNSIGNED_INT&&(ae=i.RG32UI),ee===i.BYTE&&(ae=i.RG8I),ee===i.SHORT&&(ae=i.RG16I),ee===i.INT&&(ae=i.RG32I)),E===i.RGB_INTEGER&&(ee===i.UNSIGNED_BYTE&&(ae=i.RGB8UI),ee===i.UNSIGNED_SHORT&&(ae=i.RGB16UI),ee===i.UNSIGNED_INT&&(ae=i.RGB32UI),ee===i.BYTE&&(ae=i.RGB8I),ee===i.SHORT&&(ae=i.RGB16I),ee===i.INT&&(ae=i.RGB32I)),E===i.RGBA_INTEGER&&(ee===i.UNSIGNED_BYTE&&(ae=i.RGBA8UI),ee===i.UNSIGNED_SHORT&&(ae=i.RGBA16UI),ee===i.UNSIGNED_INT&&(ae=i.RGBA32UI),ee===i.BYTE&&(ae=i.RGBA8I),ee===i.SHORT&&(ae=i.RGBA16I),ee===i.INT&&(ae=i.RGBA32I)),E===i.RGB&&(ee===i.UNSIGNED_SHORT&&Ue&&(ae=Ue.RGB16_EXT),ee===i.SHORT&&Ue&&(ae=Ue.RGB16_SNORM_EXT),ee===i.UNSIGNED_INT_5_9_9_9_REV&&(ae=i.RGB9_E5),ee===i.UNSIGNED_INT_10F_11F_11F_REV&&(ae=i.R11F_G11F_B10F)),E===i.RGBA){let ue=De?Ya:Ct.getTransfer(me);ee===i.FLOAT&&(ae=i.RGBA32F),ee===i.HALF_FLOAT&&(ae=i.RGBA16F),ee===i.UNSIGNED_BYTE&&(ae=ue===qt?i.SRGB8_ALPHA8:i.RGBA8),ee===i.UNSIGNED_SHORT&&Ue&&(ae=Ue.RGBA16_EXT),ee===i.SHORT&&Ue&&(ae=Ue.RGBA16_SNORM_EXT),ee===i.UNSIGNED_SHORT_4_4_4_4&&(ae=i.RGBA4),ee===i.UNSIGNED_SHORT_5_5_5_1&&(ae=i.RGB5_A1)}return(ae===i.R16F||ae===i.R32F||ae===i.RG16F||ae===i.RG32F||ae===i.RGBA16F||ae===i.RGBA32F)&&e.get("EXT_color_buffer_float"),ae}function y(N,E){let ee;return N?E===null||E===as||E===ro?ee=i.DEPTH24_STENCIL8:E===Pn?ee=i.DEPTH32F_STENCIL8:E===la&&(ee=i.DEPTH24_STENCIL8,nt("DepthTexture: 16 bit depth attachment is not supported with stencil. Using 24-bit attachment.")):E===null||E===as||E===ro?ee=i.DEPTH_COMPONENT24:E===Pn?ee=i.DEPTH_COMPONENT32F:E===la&&(ee=i.DEPTH_COMPONENT16),ee}function T(N,E){return P(N)===!0||N.isFramebufferTexture&&N.minFilter!==En&&N.minFilter!==Xt?Math.log2(Math.max(E.width,E.height))+1:N.mipmaps.length>0?N.mipmaps.length:N.isCompressedTexture&&Array.isArray(N.image)?E.mipmaps.length:1}function G(N){let E=new WeakRef(N);n.get(N).__ref=E,x.add(E),M.register(N,E,E)}function k(N){let E=n.get(N).__ref;E!==void 0&&(x.delete(E),M.unregister(E))}function O(N){Z(N.target)}function Y(N){U(N.target)}function Z(N){N.removeEventListener("dispose",O),k(N),$(N),N.isVideoTexture&&h.delete(N),N.isHTMLTexture&&u.delete(N)}function U(N){N.removeEventListener("dispose",Y),k(N),xe(N)}function W(){for(let N of x){let E=N.deref();E!==void 0&&(E.isRenderTarget===!0?U(E):Z(E))}x.clear(),u.clear()}function $(N){let E=n.get(N);if(E.__webglInit===void 0)return;let ee=N.source,Se=p.get(ee);if(Se){let me=Se[E.__cacheKey];me.usedTimes--,me.usedTimes===0&&q(N),Object.keys(Se).length===0&&p.delete(ee)}n.remove(N)}function q(N){let E=n.get(N);i.deleteTexture(E.__webglTexture);let ee=N.source,Se=p.get(ee);delete Se[E.__cacheKey],o.memory.textures--}function xe(N){let E=n.get(N);E.__depthDisposeCallback&&E.__depthDisposeCallback();let ee=N.depthTexture;if(ee&&ee.renderTarget===N&&Z(ee),N.isWebGLCubeRenderTarget)for(let me=0;me<6;me++){if(Array.isArray(E.__webglFramebuffer[me]))for(let De=0;De<E.__webglFramebuffer[me].length;De++)i.deleteFramebuffer(E.__webglFramebuffer[me][De]);else i.deleteFramebuffer(E.__webglFramebuffer[me]);E.__webglDepthbuffer&&i.deleteRenderbuffer(E.__webglDepthbuffer[me])}else{if(Array.isArray(E.__webglFramebuffer))for(let me=0;me<E.__webglFramebuffer.length;me++)i.deleteFramebuffer(E.__webglFramebuffer[me]);else i.deleteFramebuffer(E.__webglFramebuffer);if(E.__webglDepthbuffer&&i.deleteRenderbuffer(E.__webglDepthbuffer),E.__webglMultisampledFramebuffer&&i.deleteFramebuffer(E.__webglMultisampledFramebuffer),E.__webglColorRenderbuffer)for(let me=0;me<E.__webglColorRenderbuffer.length;me++)E.__webglColorRenderbuffer[me]&&i.deleteRenderbuffer(E.__webglColorRenderbuffer[me]);E.__webglDepthRenderbuffer&&i.deleteRenderbuffer(E.__webglDepthRenderbuffer)}let Se=N.textures;for(let me=0,De=Se.length;me<De;me++){let Ue=n.get(Se[me]);Ue.__webglTexture&&(i.deleteTexture(Ue.__webglTexture),o.memory.textures--),n.remove(Se[me])}n.remove(N)}let ne=0;function se(){ne=0}function de(){return ne}function ge(N){ne=N}function pe(){let N=ne;return N>=s.maxTextures&&nt("WebGLTextures: Trying to use "+(N+1)+" texture units while this GPU supports only "+s.maxTextures),ne+=1,N}function re(N){let E=[];return E.push(N.wrapS),E.push(N.wrapT),E.push(N.wrapR||0),E.push(N.magFilter),E.push(N.minFilter),E.push(N.anisotropy),E.push(N.internalFormat),E.push(N.format),E.push(N.type),E.push(N.generateMipmaps),E.push(N.mipmapsAutoUpdate),E.push(N.premultiplyAlpha),E.push(N.flipY),E.push(N.unpackAlignment),E.push(N.colorSpace),E.join()}function Te(N,E){let ee=n.get(N);if(N.isVideoTexture&&Zt(N),N.isRenderTargetTexture===!1&&N.isExternalTexture!==!0&&N.version>0&&ee.__version!==N.version){let Se=N.image;if(Se===null)nt("WebGLRenderer: Texture marked for update but no image data found.");else if(Se.complete===!1)nt("WebGLRenderer: Texture marked for update but image is incomplete");else{Ft(ee,N,E);return}}else N.isExternalTexture&&(ee.__webglTexture=N.sourceTexture?N.sourceTexture:null);t.bindTexture(i.TEXTURE_2D,ee.__webglTexture,i.TEXTURE0+E)}function Ie(N,E){let ee=n.get(N);if(N.isRenderTargetTexture===!1&&N.version>0&&ee.__version!==N.version){Ft(ee,N,E);return}else N.isExternalTexture&&(ee.__webglTexture=N.sourceTexture?N.sourceTexture:null);t.bindTexture(i.TEXTURE_2D_ARRAY,ee.__webglTexture,i.TEXTURE0+E)}function Oe(N,E){let ee=n.get(N);if(N.isRenderTargetTexture===!1&&N.version>0&&ee.__version!==N.version){Ft(ee,N,E);return}t.bindTexture(i.TEXTURE_3D,ee.__webglTexture,i.TEXTURE0+E)}function ye(N,E){let ee=n.get(N);if(N.version>0&&ee.__version!==N.version){fn(ee,N,E);return}t.bindTexture(i.TEXTURE_CUBE_MAP,ee.__webglTexture,i.TEXTURE0+E)}let $e={[Mr]:i.REPEAT,[gi]:i.CLAMP_TO_EDGE,[Vo]:i.MIRRORED_REPEAT},ut={[En]:i.NEAREST,[ah]:i.NEAREST_MIPMAP_NEAREST,[so]:i.NEAREST_MIPMAP_LINEAR,[Xt]:i.LINEAR,[aa]:i.LINEAR_MIPMAP_NEAREST,[Ni]:i.LINEAR_MIPMAP_LINEAR},et={[N0]:i.NEVER,[pd]:i.ALWAYS,[U0]:i.LESS,[fd]:i.LEQUAL,[O0]:i.EQUAL,[dd]:i.GEQUAL,[F0]:i.GREATER,[B0]:i.NOTEQUAL};function bt(N,E){if(E.type===Pn&&e.has("OES_texture_float_linear")===!1&&(E.magFilter===Xt||E.magFilter===aa||E.magFilter===so||E.magFilter===Ni||E.minFilter===Xt||E.minFilter===aa||E.minFilter===so||E.minFilter===Ni)&&nt("WebGLRenderer: Unable to use linear filtering with floating point textures. OES_texture_float_linear not supported on this device."),i.texParameteri(N,i.TEXTURE_WRAP_S,$e[E.wrapS]),i.texParameteri(N,i.TEXTURE_WRAP_T,$e[E.wrapT]),(N===i.TEXTURE_3D||N===i.TEXTURE_2D_ARRAY)&&i.texParameteri(N,i.TEXTURE_WRAP_R,$e[E.wrapR]),i.texParameteri(N,i.TEXTURE_MAG_FILTER,ut[E.magFilter]),i.texParameteri(N,i.TEXTURE_MIN_FILTER,ut[E.minFilter]),E.compareFunction&&(i.texParameteri(N,i.TEXTURE_COMPARE_MODE,i.COMPARE_REF_TO_TEXTURE),i.texParameteri(N,i.TEXTURE_COMPARE_FUNC,et[E.compareFunction])),e.has("EXT_texture_filter_anisotropic")===!0){if(E.magFilter===En||E.minFilter!==so&&E.minFilter!==Ni||E.type===Pn&&e.has("OES_texture_float_linear")===!1)return;if(E.anisotropy>1||n.get(E).__currentAnisotropy){let ee=e.get("EXT_texture_filter_anisotropic");i.texParameterf(N,ee.TEXTURE_MAX_ANISOTROPY_EXT,Math.min(E.anisotropy,s.getMaxAnisotropy())),n.get(E).__currentAnisotropy=E.anisotropy}}}function vt(N,E){let ee=!1;N.__webglInit===void 0&&(N.__webglInit=!0,E.addEventListener("dispose",O),G(E));let Se=E.source,me=p.get(Se);me===void 0&&(me={},p.set(Se,me));let De=re(E);if(De!==N.__cacheKey){me[De]===void 0&&(me[De]={texture:i.createTexture(),usedTimes:0},o.memory.textures++,ee=!0),me[De].usedTimes++;let Ue=me[N.__cacheKey];Ue!==void 0&&(me[N.__cacheKey].usedTimes--,Ue.usedTimes===0&&q(E)),N.__cacheKey=De,N.__webglTexture=me[De].texture}return ee}function _t(N,E,ee){return Math.floor(Math.floor(N/ee)/E)}function Yt(N,E,ee,Se){let De=N.updateRanges;if(De.length===0)t.texSubImage2D(i.TEXTURE_2D,0,0,0,E.width,E.height,ee,Se,E.data);else{De.sort((H,he)=>H.start-he.start);let Ue=0;for(let H=1;H<De.length;H++){let he=De[Ue],oe=De[H],ke=he.start+he.count,Pe=_t(oe.start,E.width,4),Fe=_t(he.start,E.width,4);oe.start<=ke+1&&Pe===Fe&&_t(oe.start+oe.count-1,E.width,4)===Pe?he.count=Math.max(he.count,oe.start+oe.count-he.start):(++Ue,De[Ue]=oe)}De.length=Ue+1;let ae=t.getParameter(i.UNPACK_ROW_LENGTH),ue=t.getParameter(i.UNPACK_SKIP_PIXELS),Ae=t.getParameter(i.UNPACK_SKIP_ROWS);t.pixelStorei(i.UNPACK_ROW_LENGTH,E.width);for(let H=0,he=De.length;H<he;H++){let oe=De[H],ke=Math.floor(oe.start/4),Pe=Math.ceil(oe.count/4),Fe=ke%E.width,tt=Math.floor(ke/E.width),dt=Pe,Me=1;t.pixelStorei(i.UNPACK_SKIP_PIXELS,Fe),t.pixelStorei(i.UNPACK_SKIP_ROWS,tt),t.texSubImage2D(i.TEXTURE_2D,0,Fe,tt,dt,Me,ee,Se,E.data)}N.clearUpdateRanges(),t.pixelStorei(i.UNPACK_ROW_LENGTH,ae),t.pixelStorei(i.UNPACK_SKIP_PIXELS,ue),t.pixelStorei(i.UNPACK_SKIP_ROWS,Ae)}}function Ft(N,E,ee){let Se=i.TEXTURE_2D;(E.isDataArrayTexture||E.isCompressedArrayTexture)&&(Se=i.TEXTURE_2D_ARRAY),E.isData3DTexture&&(Se=i.TEXTURE_3D);let me=vt(N,E),De=E.source;t.bindTexture(Se,N.__webglTexture,i.TEXTURE0+ee);let Ue=n.get(De);if(De.version!==Ue.__version||me===!0){if(t.activeTexture(i.TEXTURE0+ee),(typeof ImageBitmap<"u"&&E.image instanceof ImageBitmap)===!1){let Me=Ct.getPrimaries(Ct.workingColorSpace),Je=E.colorSpace===tr?null:Ct.getPrimaries(E.colorSpace),pt=E.colorSpace===tr||Me===Je?i.NONE:i.BROWSER_DEFAULT_WEBGL;t.pixelStorei(i.UNPACK_FLIP_Y_WEBGL,E.flipY),t.pixelStorei(i.UNPACK_PREMULTIPLY_ALPHA_WEBGL,E.premultiplyAlpha),t.pixelStorei(i.UNPACK_COLORSPACE_CONVERSION_WEBGL,pt)}t.pixelStorei(i.UNPACK_ALIGNMENT,E.unpackAlignment);let ue=b(E.image,!1,s.maxTextureSize);ue=je(E,ue);let Ae=r.convert(E.format,E.colorSpace),H=r.convert(E.type),he=I(E.internalFormat,Ae,H,E.normalized,E.colorSpace,E.isVideoTexture);bt(Se,E);let oe,ke=E.mipmaps,Pe=E.isVideoTexture!==!0,Fe=Ue.__version===void 0||me===!0,tt=De.dataReady,dt=T(E,ue);if(E.isDepthTexture)he=y(E.format===Qs,E.type),Fe&&(Pe?t.texStorage2D(i.TEXTURE_2D,1,he,ue.width,ue.height):t.texImage2D(i.TEXTURE_2D,0,he,ue.width,ue.height,0,Ae,H,null));else if(E.isDataTexture)if(ke.length>0){Pe&&Fe&&t.texStorage2D(i.TEXTURE_2D,dt,he,ke[0].width,ke[0].height);for(let Me=0,Je=ke.length;Me<Je;Me++)oe=ke[Me],Pe?tt&&t.texSubImage2D(i.TEXTURE_2D,Me,0,0,oe.width,oe.height,Ae,H,oe.data):t.texImage2D(i.TEXTURE_2D,Me,he,oe.width,oe.height,0,Ae,H,oe.data);E.generateMipmaps=!1}else Pe?(Fe&&t.texStorage2D(i.TEXTURE_2D,dt,he,ue.width,ue.height),tt&&Yt(E,ue,Ae,H)):t.texImage2D(i.TEXTURE_2D,0,he,ue.width,ue.height,0,Ae,H,ue.data);else if(E.isCompressedTexture)if(E.isCompressedArrayTexture){Pe&&Fe&&t.texStorage3D(i.TEXTURE_2D_ARRAY,dt,he,ke[0].width,ke[0].height,ue.depth);for(let Me=0,Je=ke.length;Me<Je;Me++)if(oe=ke[Me],E.format!==un)if(Ae!==null)if(Pe){if(tt)if(E.layerUpdates.size>0){let pt=wd(oe.width,oe.height,E.format,E.type);for(let Ge of E.layerUpdates){let wt=oe.data.subarray(Ge*pt/oe.data.BYTES_PER_ELEMENT,(Ge+1)*pt/oe.data.BYTES_PER_ELEMENT);t.compressedTexSubImage3D(i.TEXTURE_2D_ARRAY,Me,0,0,Ge,oe.width,oe.height,1,Ae,wt)}}else t.compressedTexSubImage3D(i.TEXTURE_2D_ARRAY,Me,0,0,0,oe.width,oe.height,ue.depth,Ae,oe.data)}else t.compressedTexImage3D(i.TEXTURE_2D_ARRAY,Me,he,oe.width,oe.height,ue.depth,0,oe.data,0,0);else nt("WebGLRenderer: Attempt to load unsupported compressed texture format in .uploadTexture()");else Pe?tt&&t.texSubImage3D(i.TEXTURE_2D_ARRAY,Me,0,0,0,oe.width,oe.height,ue.depth,Ae,H,oe.data):t.texImage3D(i.TEXTURE_2D_ARRAY,Me,he,oe.width,oe.height,ue.depth,0,Ae,H,oe.data);E.layerUpdates.size>0&&E.clearLayerUpdates()}else{Pe&&Fe&&t.texStorage2D(i.TEXTURE_2D,dt,he,ke[0].width,ke[0].height);for(let Me=0,Je=ke.length;Me<Je;Me++)oe=ke[Me],E.format!==un?Ae!==null?Pe?tt&&t.compressedTexSubImage2D(i.TEXTURE_2D,Me,0,0,oe.width,oe.height,Ae,oe.data):t.compressedTexImage2D(i.TEXTURE_2D,Me,he,oe.width,oe.height,0,oe.data):nt("WebGLRenderer: Attempt to load unsupported compressed texture format in .uploadTexture()"):Pe?tt&&t.texSubImage2D(i.TEXTURE_2D,Me,0,0,oe.width,oe.height,Ae,H,oe.data):t.texImage2D(i.TEXTURE_2D,Me,he,oe.width,oe.height,0,Ae,H,oe.data)}else if(E.isDataArrayTexture)if(Pe){if(Fe&&t.texStorage3D(i.TEXTURE_2D_ARRAY,dt,he,ue.width,ue.height,ue.depth),tt)if(E.layerUpdates.size>0){let Me=wd(ue.width,ue.height,E.format,E.type);for(let Je of E.layerUpdates){let pt=ue.data.subarray(Je*Me/ue.data.BYTES_PER_ELEMENT,(Je+1)*Me/ue.data.BYTES_PER_ELEMENT);t.texSubImage3D(i.TEXTURE_2D_ARRAY,0,0,0,Je,ue.width,ue.height,1,Ae,H,pt)}E.clearLayerUpdates()}else t.texSubImage3D(i.TEXTURE_2D_ARRAY,0,0,0,0,ue.width,ue.height,ue.depth,Ae,H,ue.data)}else t.texImage3D(i.TEXTURE_2D_ARRAY,0,he,ue.width,ue.height,ue.depth,0,Ae,H,ue.data);else if(E.isData3DTexture)Pe?(Fe&&t.texStorage3D(i.TEXTURE_3D,dt,he,ue.width,ue.height,ue.depth),tt&&t.texSubImage3D(i.TEXTURE_3D,0,0,0,0,ue.width,ue.height,ue.depth,Ae,H,ue.data)):t.texImage3D(i.TEXTURE_3D,0,he,ue.width,ue.height,ue.depth,0,Ae,H,ue.data);else if(E.isFramebufferTexture){if(Fe)if(Pe)t.texStorage2D(i.TEXTURE_2D,dt,he,ue.width,ue.height);else{let Me=ue.width,Je=ue.height;for(let pt=0;pt<dt;pt++)t.texImage2D(i.TEXTURE_2D,pt,he,Me,Je,0,Ae,H,null),Me>>=1,Je>>=1}}else if(E.isHTMLTexture){if("texElementImage2D"in i){let Me=i.canvas;if(Me.hasAttribute("layoutsubtree")||Me.setAttribute("layoutsubtree","true"),ue.parentNode!==Me){Me.appendChild(ue),u.add(E),Me.onpaint=Je=>{let pt=Je.changedElements;for(let Ge of u)pt.includes(Ge.image)&&(Ge.needsUpdate=!0)},Me.requestPaint();return}if(i.texElementImage2D.length===3)i.texElementImage2D(i.TEXTURE_2D,i.RGBA8,ue);else{let pt=i.RGBA,Ge=i.RGBA,wt=i.UNSIGNED_BYTE;i.texElementImage2D(i.TEXTURE_2D,0,pt,Ge,wt,ue)}i.texParameteri(i.TEXTURE_2D,i.TEXTURE_MIN_FILTER,i.LINEAR),i.texParameteri(i.TEXTURE_2D,i.TEXTURE_WRAP_S,i.CLAMP_TO_EDGE),i.texParameteri(i.TEXTURE_2D,i.TEXTURE_WRAP_T,i.CLAMP_TO_EDGE)}}else if(ke.length>0){if(Pe&&Fe){let Me=at(ke[0]);t.texStorage2D(i.TEXTURE_2D,dt,he,Me.width,Me.height)}for(let Me=0,Je=ke.length;Me<Je;Me++)oe=ke[Me],Pe?tt&&t.texSubImage2D(i.TEXTURE_2D,Me,0,0,Ae,H,oe):t.texImage2D(i.TEXTURE_2D,Me,he,Ae,H,oe);E.generateMipmaps=!1}else if(Pe){if(Fe){let Me=at(ue);t.texStorage2D(i.TEXTURE_2D,dt,he,Me.width,Me.height)}tt&&t.texSubImage2D(i.TEXTURE_2D,0,0,0,Ae,H,ue)}else t.texImage2D(i.TEXTURE_2D,0,he,Ae,H,ue);P(E)&&E.mipmapsAutoUpdate===!0&&w(Se),Ue.__version=De.version,E.onUpdate&&E.onUpdate(E)}N.__version=E.version}function fn(N,E,ee){if(E.image.length!==6)return;let Se=vt(N,E),me=E.source;t.bindTexture(i.TEXTURE_CUBE_MAP,N.__webglTexture,i.TEXTURE0+ee);let De=n.get(me);if(me.version!==De.__version||Se===!0){t.activeTexture(i.TEXTURE0+ee);let Ue=Ct.getPrimaries(Ct.workingColorSpace),ae=E.colorSpace===tr?null:Ct.getPrimaries(E.colorSpace),ue=E.colorSpace===tr||Ue===ae?i.NONE:i.BROWSER_DEFAULT_WEBGL;t.pixelStorei(i.UNPACK_FLIP_Y_WEBGL,E.flipY),t.pixelStorei(i.UNPACK_PREMULTIPLY_ALPHA_WEBGL,E.premultiplyAlpha),t.pixelStorei(i.UNPACK_ALIGNMENT,E.unpackAlignment),t.pixelStorei(i.UNPACK_COLORSPACE_CONVERSION_WEBGL,ue);let Ae=E.isCompressedTexture||E.image[0].isCompressedTexture,H=E.image[0]&&E.image[0].isDataTexture,he=[];for(let Ge=0;Ge<6;Ge++)!Ae&&!H?he[Ge]=b(E.image[Ge],!0,s.maxCubemapSize):he[Ge]=H?E.image[Ge].image:E.image[Ge],he[Ge]=je(E,he[Ge]);let oe=he[0],ke=r.convert(E.format,E.colorSpace),Pe=r.convert(E.type),Fe=I(E.internalFormat,ke,Pe,E.normalized,E.colorSpace),tt=E.isVideoTexture!==!0,dt=De.__version===void 0||Se===!0,Me=me.dataReady,Je=T(E,oe);bt(i.TEXTURE_CUBE_MAP,E);let pt;if(E.isDepthTexture){if(Fe=y(E.format===Qs,E.type),dt)if(tt)t.texStorage2D(i.TEXTURE_CUBE_MAP,1,Fe,oe.width,oe.height);else for(let Ge=0;Ge<6;Ge++)t.texImage2D(i.TEXTURE_CUBE_MAP_POSITIVE_X+Ge,0,Fe,oe.width,oe.height,0,ke,Pe,null)}else if(Ae){tt&&dt&&t.texStorage2D(i.TEXTURE_CUBE_MAP,Je,Fe,oe.width,oe.height);for(let Ge=0;Ge<6;Ge++){pt=he[Ge].mipmaps;for(let wt=0;wt<pt.length;wt++){let jt=pt[wt];E.format!==un?ke!==null?tt?Me&&t.compressedTexSubImage2D(i.TEXTURE_CUBE_MAP_POSITIVE_X+Ge,wt,0,0,jt.width,jt.height,ke,jt.data):t.compressedTexImage2D(i.TEXTURE_CUBE_MAP_POSITIVE_X+Ge,wt,Fe,jt.width,jt.height,0,jt.data):nt("WebGLRenderer: Attempt to load unsupported compressed texture format in .setTextureCube()"):tt?Me&&t.texSubImage2D(i.TEXTURE_CUBE_MAP_POSITIVE_X+Ge,wt,0,0,jt.width,jt.height,ke,Pe,jt.data):t.texImage2D(i.TEXTURE_CUBE_MAP_POSITIVE_X+Ge,wt,Fe,jt.width,jt.height,0,ke,Pe,jt.data)}}}else{if(pt=E.mipmaps,tt&&dt){pt.length>0&&Je++;let Ge=at(he[0]);t.texStorage2D(i.TEXTURE_CUBE_MAP,Je,Fe,Ge.width,Ge.height)}for(let Ge=0;Ge<6;Ge++)if(H){tt?Me&&t.texSubImage2D(i.TEXTURE_CUBE_MAP_POSITIVE_X+Ge,0,0,0,he[Ge].width,he[Ge].height,ke,Pe,he[Ge].data):t.texImage2D(i.TEXTURE_CUBE_MAP_POSITIVE_X+Ge,0,Fe,he[Ge].width,he[Ge].height,0,ke,Pe,he[Ge].data);for(let wt=0;wt<pt.length;wt++){let Zn=pt[wt].image[Ge].image;tt?Me&&t.texSubImage2D(i.TEXTURE_CUBE_MAP_POSITIVE_X+Ge,wt+1,0,0,Zn.width,Zn.height,ke,Pe,Zn.data):t.texImage2D(i.TEXTURE_CUBE_MAP_POSITIVE_X+Ge,wt+1,Fe,Zn.width,Zn.height,0,ke,Pe,Zn.data)}}else{tt?Me&&t.texSubImage2D(i.TEXTURE_CUBE_MAP_POSITIVE_X+Ge,0,0,0,ke,Pe,he[Ge]):t.texImage2D(i.TEXTURE_CUBE_MAP_POSITIVE_X+Ge,0,Fe,ke,Pe,he[Ge]);for(let wt=0;wt<pt.length;wt++){let jt=pt[wt];tt?Me&&t.texSubImage2D(i.TEXTURE_CUBE_MAP_POSITIVE_X+Ge,wt+1,0,0,ke,Pe,jt.image[Ge]):t.texImage2D(i.TEXTURE_CUBE_MAP_POSITIVE_X+Ge,wt+1,Fe,ke,Pe,jt.image[Ge])}}}P(E)&&E.mipmapsAutoUpdate===!0&&w(i.TEXTURE_CUBE_MAP),De.__version=me.version,E.onUpdate&&E.onUpdate(E)}N.__version=E.version}function Vt(N,E,ee,Se,me,De){let Ue=r.convert(ee.format,ee.colorSpace),ae=r.convert(ee.type),ue=I(ee.internalFormat,Ue,ae,ee.normalized,ee.colorSpace),Ae=n.get(E),H=n.get(ee);if(H.__renderTarget=E,!Ae.__hasExternalTextures){let he=Math.max(1,E.width>>De),oe=Math.max(1,E.height>>De);me===i.TEXTURE_3D||me===i.TEXTURE_2D_ARRAY?t.texImage3D(me,De,ue,he,oe,E.depth,0,Ue,ae,null):t.texImage2D(me,De,ue,he,oe,0,Ue,ae,null)}t.bindFramebuffer(i.FRAMEBUFFER,N),Ne(E)?a.framebufferTexture2DMultisampleEXT(i.FRAMEBUFFER,Se,me,H.__webglTexture,0,xt(E)):(me===i.TEXTURE_2D||me>=i.TEXTURE_CUBE_MAP_POSITIVE_X&&me<=i.TEXTURE_CUBE_MAP_NEGATIVE_Z)&&i.framebufferTexture2D(i.FRAMEBUFFER,Se,me,H.__webglTexture,De),t.bindFramebuffer(i.FRAMEBUFFER,null)}function Tn(N,E,ee){if(i.bindRenderbuffer(i.RENDERBUFFER,N),E.depthBuffer){let Se=E.depthTexture,me=Se&&Se.isDepthTexture?Se.type:null,De=y(E.stencilBuffer,me),Ue=E.stencilBuffer?i.DEPTH_STENCIL_ATTACHMENT:i.DEPTH_ATTACHMENT;Ne(E)?a.renderbufferStorageMultisampleEXT(i.RENDERBUFFER,xt(E),De,E.width,E.height):ee?i.renderbufferStorageMultisample(i.RENDERBUFFER,xt(E),De,E.width,E.height):i.renderbufferStorage(i.RENDERBUFFER,De,E.width,E.height),i.framebufferRenderbuffer(i.FRAMEBUFFER,Ue,i.RENDERBUFFER,N)}else{let Se=E.textures;for(let me=0;me<Se.length;me++){let De=Se[me],Ue=r.convert(De.format,De.colorSpace),ae=r.convert(De.type),ue=I(De.internalFormat,Ue,ae,De.normalized,De.colorSpace);Ne(E)?a.renderbufferStorageMultisampleEXT(i.RENDERBUFFER,xt(E),ue,E.width,E.height):ee?i.renderbufferStorageMultisample(i.RENDERBUFFER,xt(E),ue,E.width,E.height):i.renderbufferStorage(i.RENDERBUFFER,ue,E.width,E.height)}}i.bindRenderbuffer(i.RENDERBUFFER,null)}function Pt(N,E,ee){let Se=E.isWebGLCubeRenderTarget===!0;if(t.bindFramebuffer(i.FRAMEBUFFER,N),!(E.depthTexture&&E.depthTexture.isDepthTexture))throw new Error("THREE.WebGLTextures: renderTarget.depthTexture must be an instance of THREE.DepthTexture.");let me=n.get(E.depthTexture);me.__renderTarget=E;let De=Se?E.depthTexture.image[0]:E.depthTexture.image;(!me.__webglTexture||De.width!==E.width||De.height!==E.height)&&(De.width=E.width,De.height=E.height,E.depthTexture.needsUpdate=!0),Se?ye(E.depthTexture,0):Te(E.depthTexture,0);let Ue=me.__webglTexture,ae=xt(E),ue=Se?i.TEXTURE_CUBE_MAP_POSITIVE_X+ee:i.TEXTURE_2D,Ae=E.depthTexture.format===Qs?i.DEPTH_STENCIL_ATTACHMENT:i.DEPTH_ATTACHMENT;if(E.depthTexture.format===Hs)Ne(E)?a.framebufferTexture2DMultisampleEXT(i.FRAMEBUFFER,Ae,ue,Ue,0,ae):i.framebufferTexture2D(i.FRAMEBUFFER,Ae,ue,Ue,0);else if(E.depthTexture.format===Qs)Ne(E)?a.framebufferTexture2DMultisampleEXT(i.FRAMEBUFFER,Ae,ue,Ue,0,ae):i.framebufferTexture2D(i.FRAMEBUFFER,Ae,ue,Ue,0);else throw new Error("THREE.WebGLTextures: Unknown depthTexture format.")}function yn(N){let E=n.get(N),ee=N.isWebGLCubeRenderTarget===!0;if(E.__boundDepthTexture!==N.depthTexture){let Se=N.depthTexture;if(E.__depthDisposeCallback&&E.__depthDisposeCallback(),Se){let me=()=>{delete E.__boundDepthTexture,delete E.__depthDisposeCallback,Se.removeEventListener("dispose",me)};Se.addEventListener("dispose",me),E.__depthDisposeCallback=me}E.__boundDepthTexture=Se}if(N.depthTexture&&!E.__autoAllocateDepthBuffer)if(ee)for(let Se=0;Se<6;Se++)Pt(E.__webglFramebuffer[Se],N,Se);else N.texture.mipmaps.length>0?Pt(E.__webglFramebuffer[0],N,0):Pt(E.__webglFramebuffer,N,0);else if(ee){E.__webglDepthbuffer=[];for(let Se=0;Se<6;Se++)if(t.bindFramebuffer(i.FRAMEBUFFER,E.__webglFramebuffer[Se]),E.__webglDepthbuffer[Se]===void 0)E.__webglDepthbuffer[Se]=i.createRenderbuffer(),Tn(E.__webglDepthbuffer[Se],N,!1);else{let me=N.stencilBuffer?i.DEPTH_STENCIL_ATTACHMENT:i.DEPTH_ATTACHMENT,De=E.__webglDepthbuffer[Se];i.bindRenderbuffer(i.RENDERBUFFER,De),i.framebufferRenderbuffer(i.FRAMEBUFFER,me,i.RENDERBUFFER,De)}}else if(N.texture.mipmaps.length>0?t.bindFramebuffer(i.FRAMEBUFFER,E.__webglFramebuffer[0]):t.bindFramebuffer(i.FRAMEBUFFER,E.__webglFramebuffer),E.__webglDepthbuffer===void 0)E.__webglDepthbuffer=i.createRenderbuffer(),Tn(E.__webglDepthbuffer,N,!1);else{let me=N.stencilBuffer?i.DEPTH_STENCIL_ATTACHMENT:i.DEPTH_ATTACHMENT,De=E.__webglDepthbuffer;i.bindRenderbuffer(i.RENDERBUFFER,De),i.framebufferRenderbuffer(i.FRAMEBUFFER,me,i.RENDERBUFFER,De)}t.bindFramebuffer(i.FRAMEBUFFER,null)}function nn(N,E,ee){let Se=n.get(N);E!==void 0&&Vt(Se.__webglFramebuffer,N,N.texture,i.COLOR_ATTACHMENT0,i.TEXTURE_2D,0),ee!==void 0&&yn(N)}function Sn(N){let E=N.texture,ee=n.get(N),Se=n.get(E);N.addEventListener("dispose",Y),G(N);let me=N.textures,De=N.isWebGLCubeRenderTarget===!0,Ue=me.length>1;if(Ue||(Se.__webglTexture===void 0&&(Se.__webglTexture=i.createTexture()),Se.__version=E.version,o.memory.textures++),De){ee.__webglFramebuffer=[];for(let ae=0;ae<6;ae++)if(E.mipmaps.length>0){ee.__webglFramebuffer[ae]=[];for(let ue=0;ue<E.mipmaps.length;ue++)ee.__webglFramebuffer[ae][ue]=i.createFramebuffer()}else ee.__webglFramebuffer[ae]=i.createFramebuffer()}else{if(E.mipmaps.length>0){ee.__webglFramebuffer=[];for(let ae=0;ae<E.mipmaps.length;ae++)ee.__webglFramebuffer[ae]=i.createFramebuffer()}else ee.__webglFramebuffer=i.createFramebuffer();if(Ue)for(let ae=0,ue=me.length;ae<ue;ae++){let Ae=n.get(me[ae]);Ae.__webglTexture===void 0&&(Ae.__webglTexture=i.createTexture(),o.memory.textures++)}if(N.samples>0&&Ne(N)===!1){ee.__webglMultisampledFramebuffer=i.createFramebuffer(),ee.__webglColorRenderbuffer=[],t.bindFramebuffer(i.FRAMEBUFFER,ee.__webglMultisampledFramebuffer);for(let ae=0;ae<me.length;ae++){let ue=me[ae];ee.__webglColorRenderbuffer[ae]=i.createRenderbuffer(),i.bindRenderbuffer(i.RENDERBUFFER,ee.__webglColorRenderbuffer[ae]);let Ae=r.convert(ue.format,ue.colorSpace),H=r.convert(ue.type),he=I(ue.internalFormat,Ae,H,ue.normalized,ue.colorSpace,N.isXRRenderTarget===!0),oe=xt(N);i.renderbufferStorageMultisample(i.RENDERBUFFER,oe,he,N.width,N.height),i.framebufferRenderbuffer(i.FRAMEBUFFER,i.COLOR_ATTACHMENT0+ae,i.RENDERBUFFER,ee.__webglColorRenderbuffer[ae])}i.bindRenderbuffer(i.RENDERBUFFER,null),N.depthBuffer&&(ee.__webglDepthRenderbuffer=i.createRenderbuffer(),Tn(ee.__webglDepthRenderbuffer,N,!0)),t.bindFramebuffer(i.FRAMEBUFFER,null)}}if(De){t.bindTexture(i.TEXTURE_CUBE_MAP,Se.__webglTexture),bt(i.TEXTURE_CUBE_MAP,E);for(let ae=0;ae<6;ae++)if(E.mipmaps.length>0)for(let ue=0;ue<E.mipmaps.length;ue++)Vt(ee.__webglFramebuffer[ae][ue],N,E,i.COLOR_ATTACHMENT0,i.TEXTURE_CUBE_MAP_POSITIVE_X+ae,ue);else Vt(ee.__webglFramebuffer[ae],N,E,i.COLOR_ATTACHMENT0,i.TEXTURE_CUBE_MAP_POSITIVE_X+ae,0);P(E)?w(i.TEXTURE_CUBE_MAP):E.mipmaps.length>0&&i.texParameteri(i.TEXTURE_CUBE_MAP,i.TEXTURE_MAX_LEVEL,E.mipmaps.length-1),t.unbindTexture()}else if(Ue){for(let ae=0,ue=me.length;ae<ue;ae++){let Ae=me[ae],H=n.get(Ae),he=i.TEXTURE_2D;(N.isWebGL3DRenderTarget||N.isWebGLArrayRenderTarget)&&(he=N.isWebGL3DRenderTarget?i.TEXTURE_3D:i.TEXTURE_2D_ARRAY),t.bindTexture(he,H.__webglTexture),bt(he,Ae),Vt(ee.__webglFramebuffer,N,Ae,i.COLOR_ATTACHMENT0+ae,he,0),P(Ae)&&w(he)}t.unbindTexture()}else{let ae=i.TEXTURE_2D;if((N.isWebGL3DRenderTarget||N.isWebGLArrayRenderTarget)&&(ae=N.isWebGL3DRenderTarget?i.TEXTURE_3D:i.TEXTURE_2D_ARRAY),t.bindTexture(ae,Se.__webglTexture),bt(ae,E),E.mipmaps.length>0)for(let ue=0;ue<E.mipmaps.length;ue++)Vt(ee.__webglFramebuffer[ue],N,E,i.COLOR_ATTACHMENT0,ae,ue);else Vt(ee.__webglFramebuffer,N,E,i.COLOR_ATTACHMENT0,ae,0);P(E)?w(ae):E.mipmaps.length>0&&i.texParameteri(ae,i.TEXTURE_MAX_LEVEL,E.mipmaps.length-1),t.unbindTexture()}N.depthBuffer&&yn(N)}function V(N){let E=N.textures;for(let ee=0,Se=E.length;ee<Se;ee++){let me=E[ee];if(P(me)&&me.mipmapsAutoUpdate===!0){let De=D(N),Ue=n.get(me).__webglTexture;t.bindTexture(De,Ue),w(De),t.unbindTexture()}}}let He=[];function ct(N){if(N.samples>0){if(Ne(N)===!1){let E=N.textures,ee=N.width,Se=N.height,me=i.COLOR_BUFFER_BIT,De=N.stencilBuffer?i.DEPTH_STENCIL_ATTACHMENT:i.DEPTH_ATTACHMENT,Ue=n.get(N),ae=E.length>1;if(ae)for(let Ae=0;Ae<E.length;Ae++)t.bindFramebuffer(i.FRAMEBUFFER,Ue.__webglMultisampledFramebuffer),i.framebufferRenderbuffer(i.FRAMEBUFFER,i.COLOR_ATTACHMENT0+Ae,i.RENDERBUFFER,null),t.bindFramebuffer(i.FRAMEBUFFER,Ue.__webglFramebuffer),i.framebufferTexture2D(i.DRAW_FRAMEBUFFER,i.COLOR_ATTACHMENT0+Ae,i.TEXTURE_2D,null,0);t.bindFramebuffer(i.READ_FRAMEBUFFER,Ue.__webglMultisampledFramebuffer),N.texture.mipmaps.length>0?t.bindFramebuffer(i.DRAW_FRAMEBUFFER,Ue.__webglFramebuffer[0]):t.bindFramebuffer(i.DRAW_FRAMEBUFFER,Ue.__webglFramebuffer);for(let Ae=0;Ae<E.length;Ae++){if(N.resolveDepthBuffer&&(N.depthBuffer&&(me|=i.DEPTH_BUFFER_BIT),N.stencilBuffer&&N.resolveStencilBuffer&&(me|=i.STENCIL_BUFFER_BIT)),ae){i.framebufferRenderbuffer(i.READ_FRAMEBUFFER,i.COLOR_ATTACHMENT0,i.RENDERBUFFER,Ue.__webglColorRenderbuffer[Ae]);let H=n.get(E[Ae]).__webglTexture;i.framebufferTexture2D(i.DRAW_FRAMEBUFFER,i.COLOR_ATTACHMENT0,i.TEXTURE_2D,H,0)}i.blitFramebuffer(0,0,ee,Se,0,0,ee,Se,me,i.NEAREST),l===!0&&(He.length=0,He.push(i.COLOR_ATTACHMENT0+Ae),N.depthBuffer&&N.storeMultisampledDepthBuffer===!1&&He.push(De),i.invalidateFramebuffer(i.READ_FRAMEBUFFER,He))}if(t.bindFramebuffer(i.READ_FRAMEBUFFER,null),t.bindFramebuffer(i.DRAW_FRAMEBUFFER,null),ae)for(let Ae=0;Ae<E.length;Ae++){t.bindFramebuffer(i.FRAMEBUFFER,Ue.__webglMultisampledFramebuffer),i.framebufferRenderbuffer(i.FRAMEBUFFER,i.COLOR_ATTACHMENT0+Ae,i.RENDERBUFFER,Ue.__webglColorRenderbuffer[Ae]);let H=n.get(E[Ae]).__webglTexture;t.bindFramebuffer(i.FRAMEBUFFER,Ue.__webglFramebuffer),i.framebufferTexture2D(i.DRAW_FRAMEBUFFER,i.COLOR_ATTACHMENT0+Ae,i.TEXTURE_2D,H,0)}t.bindFramebuffer(i.DRAW_FRAMEBUFFER,Ue.__webglMultisampledFramebuffer)}else if(N.depthBuffer&&N.storeMultisampledDepthBuffer===!1&&l){let E=N.stencilBuffer?i.DEPTH_STENCIL_ATTACHMENT:i.DEPTH_ATTACHMENT;i.invalidateFramebuffer(i.DRAW_FRAMEBUFFER,[E])}}}function xt(N){return Math.min(s.maxSamples,N.samples)}function Ne(N){let E=n.get(N);return N.samples>0&&e.has("WEBGL_multisampled_render_to_texture")===!0&&E.__useRenderToTexture!==!1}function Zt(N){let E=o.render.frame;h.get(N)!==E&&(h.set(N,E),N.update())}function je(N,E){let ee=N.colorSpace,Se=N.format,me=N.type;return N.isCompressedTexture===!0||N.isVideoTexture===!0||ee!==cn&&ee!==tr&&(Ct.getTransfer(ee)===qt?(Se!==un||me!==ti)&&nt("WebGLTextures: sRGB encoded textures have to use RGBAFormat and UnsignedByteType."):gt("WebGLTextures: Unsupported texture color space:",ee)),E}function at(N){return typeof HTMLImageElement<"u"&&N instanceof HTMLImageElement?(c.width=N.naturalWidth||N.width,c.height=N.naturalHeight||N.height):typeof VideoFrame<"u"&&N instanceof VideoFrame?(c.width=N.displayWidth,c.height=N.displayHeight):(c.width=N.width,c.height=N.height),c}this.allocateTextureUnit=pe,this.resetTextureUnits=se,this.getTextureUnits=de,this.setTextureUnits=ge,this.setTexture2D=Te,this.setTexture2DArray=Ie,this.setTexture3D=Oe,this.setTextureCube=ye,this.rebindTextures=nn,this.setupRenderTarget=Sn,this.updateRenderTargetMipmap=V,this.updateMultisampleRenderTarget=ct,this.setupDepthRenderbuffer=yn,this.setupFrameBufferTexture=Vt,this.useMultisampledRTT=Ne,this.dispose=W}function oE(i,e){function t(n,s=tr){let r,o=Ct.getTransfer(s);if(n===ti)return i.UNSIGNED_BYTE;if(n===ch)return i.UNSIGNED_SHORT_4_4_4_4;if(n===hh)return i.UNSIGNED_SHORT_5_5_5_1;if(n===ad)return i.UNSIGNED_INT_5_9_9_9_REV;if(n===ld)return i.UNSIGNED_INT_10F_11F_11F_REV;if(n===rd)return i.BYTE;if(n===od)return i.SHORT;if(n===la)return i.UNSIGNED_SHORT;if(n===lh)return i.INT;if(n===as)return i.UNSIGNED_INT;if(n===Pn)return i.FLOAT;if(n===hn)return i.HALF_FLOAT;if(n===cd)return i.ALPHA;if(n===hd)return i.RGB;if(n===un)return i.RGBA;if(n===Hs)return i.DEPTH_COMPONENT;if(n===Qs)return i.DEPTH_STENCIL;if(n===er)return i.RED;if(n===uh)return i.RED_INTEGER;if(n===yi)return i.RG;if(n===fh)return i.RG_INTEGER;if(n===dh)return i.RGBA_INTEGER;if(n===yl||n===Sl||n===Ml||n===bl)if(o===qt)if(r=e.get("WEBGL_compressed_texture_s3tc_srgb"),r!==null){if(n===yl)return r.COMPRESSED_SRGB_S3TC_DXT1_EXT;if(n===Sl)return r.COMPRESSED_SRGB_ALPHA_S3TC_DXT1_EXT;if(n===Ml)return r.COMPRESSED_SRGB_ALPHA_S3TC_DXT3_EXT;if(n===bl)return r.COMPRESSED_SRGB_ALPHA_S3TC_DXT5_EXT}else return null;else if(r=e.get("WEBGL_compressed_texture_s3tc"),r!==null){if(n===yl)return r.COMPRESSED_RGB_S3TC_DXT1_EXT;if(n===Sl)return r.COMPRESSED_RGBA_S3TC_DXT1_EXT;if(n===Ml)return r.COMPRESSED_RGBA_S3TC_DXT3_EXT;if(n===bl)return r.COMPRESSED_RGBA_S3TC_DXT5_EXT}else return null;if(n===ph||n===mh||n===gh||n===_h)if(r=e.get("WEBGL_compressed_texture_pvrtc"),r!==null){if(n===ph)return r.COMPRESSED_RGB_PVRTC_4BPPV1_IMG;if(n===mh)return r.COMPRESSED_RGB_PVRTC_2BPPV1_IMG;if(n===gh)return r.COMPRESSED_RGBA_PVRTC_4BPPV1_IMG;if(n===_h)return r.COMPRESSED_RGBA_PVRTC_2BPPV1_IMG}else return null;if(n===xh||n===vh||n===yh||n===Sh||n===Mh||n===wl||n===bh)if(r=e.get("WEBGL_compressed_texture_etc"),r!==null){if(n===xh||n===vh)return o===qt?r.COMPRESSED_SRGB8_ETC2:r.COMPRESSED_RGB8_ETC2;if(n===yh)return o===qt?r.COMPRESSED_SRGB8_ALPHA8_ETC2_EAC:r.COMPRESSED_RGBA8_ETC2_EAC;if(n===Sh)return r.COMPRESSED_R11_EAC;if(n===Mh)return r.COMPRESSED_SIGNED_R11_EAC;if(n===wl)return r.COMPRESSED_RG11_EAC;if(n===bh)return r.COMPRESSED_SIGNED_RG11_EAC}else return null;if(n===wh||n===Eh||n===Th||n===Ah||n===Rh||n===Ch||n===Ih||n===Ph||n===Lh||n===Dh||n===Nh||n===Uh||n===Oh||n===Fh)if(r=e.get("WEBGL_compressed_texture_astc"),r!==null){if(n===wh)return o===qt?r.COMPRESSED_SRGB8_ALPHA8_ASTC_4x4_KHR:r.COMPRESSED_RGBA_ASTC_4x4_KHR;if(n===Eh)return o===qt?r.COMPRESSED_SRGB8_ALPHA8_ASTC_5x4_KHR:r.COMPRESSED_RGBA_ASTC_5x4_KHR;if(n===Th)return o===qt?r.COMPRESSED_SRGB8_ALPHA8_ASTC_5x5_KHR:r.COMPRESSED_RGBA_ASTC_5x5_KHR;if(n===Ah)return o===qt?r.COMPRESSED_SRGB8_ALPHA8_ASTC_6x5_KHR:r.COMPRESSED_RGBA_ASTC_6x5_KHR;if(n===Rh)return o===qt?r.COMPRESSED_SRGB8_ALPHA8_ASTC_6x6_KHR:r.COMPRESSED_RGBA_ASTC_6x6_KHR;if(n===Ch)return o===qt?r.COMPRESSED_SRGB8_ALPHA8_ASTC_8x5_KHR:r.COMPRESSED_RGBA_ASTC_8x5_KHR;if(n===Ih)return o===qt?r.COMPRESSED_SRGB8_ALPHA8_ASTC_8x6_KHR:r.COMPRESSED_RGBA_ASTC_8x6_KHR;if(n===Ph)return o===qt?r.COMPRESSED_SRGB8_ALPHA8_ASTC_8x8_KHR:r.COMPRESSED_RGBA_ASTC_8x8_KHR;if(n===Lh)return o===qt?r.COMPRESSED_SRGB8_ALPHA8_ASTC_10x5_KHR:r.COMPRESSED_RGBA_ASTC_10x5_KHR;if(n===Dh)return o===qt?r.COMPRESSED_SRGB8_ALPHA8_ASTC_10x6_KHR:r.COMPRESSED_RGBA_ASTC_10x6_KHR;if(n===Nh)return o===qt?r.COMPRESSED_SRGB8_ALPHA8_ASTC_10x8_KHR:r.COMPRESSED_RGBA_ASTC_10x8_KHR;if(n===Uh)return o===qt?r.COMPRESSED_SRGB8_ALPHA8_ASTC_10x10_KHR:r.COMPRESSED_RGBA_ASTC_10x10_KHR;if(n===Oh)return o===qt?r.COMPRESSED_SRGB8_ALPHA8_ASTC_12x10_KHR:r.COMPRESSED_RGBA_ASTC_12x10_KHR;if(n===Fh)return o===qt?r.COMPRESSED_SRGB8_ALPHA8_ASTC_12x12_KHR:r.COMPRESSED_RGBA_ASTC_12x12_KHR}else return null;if(n===Bh||n===kh||n===zh)if(r=e.get("EXT_texture_compression_bptc"),r!==null){if(n===Bh)return o===qt?r.COMPRESSED_SRGB_ALPHA_BPTC_UNORM_EXT:r.COMPRESSED_RGBA_BPTC_UNORM_EXT;if(n===kh)return r.COMPRESSED_RGB_BPTC_SIGNED_FLOAT_EXT;if(n===zh)return r.COMPRESSED_RGB_BPTC_UNSIGNED_FLOAT_EXT}else return null;if(n===Hh||n===Gh||n===El||n===Vh)if(r=e.get("EXT_texture_compression_rgtc"),r!==null){if(n===Hh)return r.COMPRESSED_RED_RGTC1_EXT;if(n===Gh)return r.COMPRESSED_SIGNED_RED_RGTC1_EXT;if(n===El)return r.COMPRESSED_RED_GREEN_RGTC2_EXT;if(n===Vh)return r.COMPRESSED_SIGNED_RED_GREEN_RGTC2_EXT}else return null;return n===ro?i.UNSIGNED_INT_24_8:i[n]!==void 0?i[n]:null}return{convert:t}}var aE=`
void main() {

	gl_Position = vec4( position, 1.0 );

}`,lE=`
uniform sampler2DArray depthColor;
uniform float depthWidth;
uniform float depthHeight;

void main() {

	vec2 coord = vec2( gl_FragCoord.x / depthWidth, gl_FragCoord.y / depthHeight );

	if ( coord.x >= 1.0 ) {

		gl_FragDepth = texture( depthColor, vec3( coord.x - 1.0, coord.y, 1 ) ).r;

	} else {

		gl_FragDepth = texture( depthColor, vec3( coord.x, coord.y, 0 ) ).r;

	}

}`,Dd=class{constructor(){this.texture=null,this.mesh=null,this.depthNear=0,this.depthFar=0}init(e,t){if(this.texture===null){let n=new ol(e.texture);(e.depthNear!==t.depthNear||e.depthFar!==t.depthFar)&&(this.depthNear=e.depthNear,this.depthFar=e.depthFar),this.texture=n}}getMesh(e){if(this.texture!==null&&this.mesh===null){let t=e.cameras[0].viewport,n=new fi({vertexShader:aE,fragmentShader:lE,uniforms:{depthColor:{value:this.texture},depthWidth:{value:t.z},depthHeight:{value:t.w}}});this.mesh=new In(new Ss(20,20),n)}return this.mesh}reset(){this.texture=null,this.mesh=null}getDepthTexture(){return this.texture}},Nd=class extends rs{constructor(e,t){super();let n=this,s=null,r=1,o=null,a="local-floor",l=1,c=null,h=null,u=null,f=null,p=null,x=null,M=typeof XRWebGLBinding<"u",g=new Dd,_={},b=t.getContextAttributes(),P=null,w=null,D=[],I=[],y=new lt,T=null,G=null,k=new On;k.viewport=new $t;let O=new On;O.viewport=new $t;let Y=[k,O],Z=new sh,U=null,W=null;this.cameraAutoUpdate=!0,this.enabled=!1,this.isPresenting=!1,this.getController=function(re){let Te=D[re];return Te===void 0&&(Te=new Zo,D[re]=Te),Te.getTargetRaySpace()},this.getControllerGrip=function(re){let Te=D[re];return Te===void 0&&(Te=new Zo,D[re]=Te),Te.getGripSpace()},this.getHand=function(re){let Te=D[re];return Te===void 0&&(Te=new Zo,D[re]=Te),Te.getHandSpace()};function $(re){let Te=I.indexOf(re.inputSource);if(Te===-1)return;let Ie=D[Te];Ie!==void 0&&(Ie.update(re.inputSource,re.frame,c||o),Ie.dispatchEvent({type:re.type,data:re.inputSource}))}function q(){s.removeEventListener("select",$),s.removeEventListener("selectstart",$),s.removeEventListener("selectend",$),s.removeEventListener("squeeze",$),s.removeEventListener("squeezestart",$),s.removeEventListener("squeezeend",$),s.removeEventListener("end",q),s.removeEventListener("inputsourceschange",xe);for(let re=0;re<D.length;re++){let Te=I[re];Te!==null&&(I[re]=null,D[re].disconnect(Te))}U=null,W=null,g.reset();for(let re in _)delete _[re];if(e.setRenderTarget(P),p=null,f=null,u=null,s=null,w=null,pe.stop(),n.isPresenting=!1,e.setPixelRatio(T),e.setSize(y.width,y.height,!1),G!==null){let re=G.camera;re.fov=G.fov,re.zoom=G.zoom,re.updateProjectionMatrix(),G=null}n.dispatchEvent({type:"sessionend"})}this.setFramebufferScaleFactor=function(re){r=re,n.isPresenting===!0&&nt("WebXRManager: Cannot change framebuffer scale while presenting.")},this.setReferenceSpaceType=function(re){a=re,n.isPresenting===!0&&nt("WebXRManager: Cannot change reference space type while presenting.")},this.getReferenceSpace=function(){return c||o},this.setReferenceSpace=function(re){c=re},this.getBaseLayer=function(){return f!==null?f:p},this.getBinding=function(){return u===null&&M&&(u=new XRWebGLBinding(s,t)),u},this.getFrame=function(){return x},this.getSession=function(){return s},this.setSession=async function(re){if(s=re,s!==null){if(P=e.getRenderTarget(),s.addEventListener("select",$),s.addEventListener("selectstart",$),s.addEventListener("selectend",$),s.addEventListener("squeeze",$),s.addEventListener("squeezestart",$),s.addEventListener("squeezeend",$),s.addEventListener("end",q),s.addEventListener("inputsourceschange",xe),b.xrCompatible!==!0&&await t.makeXRCompatible(),T=e.getPixelRatio(),e.getSize(y),M&&"createProjectionLayer"in XRWebGLBinding.prototype){let Ie=null,Oe=null,ye=null;b.depth&&(ye=b.stencil?t.DEPTH24_STENCIL8:t.DEPTH_COMPONENT24,Ie=b.stencil?Qs:Hs,Oe=b.stencil?ro:as);let $e={colorFormat:t.RGBA8,depthFormat:ye,scaleFactor:r};u=this.getBinding(),f=u.createProjectionLayer($e),s.updateRenderState({layers:[f]}),e.setPixelRatio(1),e.setSize(f.textureWidth,f.textureHeight,!1),w=new hi(f.textureWidth,f.textureHeight,{format:un,type:ti,depthTexture:new qs(f.textureWidth,f.textureHeight,Oe,void 0,void 0,void 0,void 0,void 0,void 0,Ie),stencilBuffer:b.stencil,colorSpace:e.outputColorSpace,samples:b.antialias?4:0,resolveDepthBuffer:f.ignoreDepthValues===!1,resolveStencilBuffer:f.ignoreDepthValues===!1,storeMultisampledDepthBuffer:f.ignoreDepthValues===!1,storeMultisampledStencilBuffer:f.ignoreDepthValues===!1})}else{let Ie={antialias:b.antialias,alpha:!0,depth:b.depth,stencil:b.stencil,framebufferScaleFactor:r};p=new XRWebGLLayer(s,t,Ie),s.updateRenderState({baseLayer:p}),e.setPixelRatio(1),e.setSize(p.framebufferWidth,p.framebufferHeight,!1),w=new hi(p.framebufferWidth,p.framebufferHeight,{format:un,type:ti,colorSpace:e.outputColorSpace,stencilBuffer:b.stencil,resolveDepthBuffer:p.ignoreDepthValues===!1,resolveStencilBuffer:p.ignoreDepthValues===!1,storeMultisampledDepthBuffer:p.ignoreDepthValues===!1,storeMultisampledStencilBuffer:p.ignoreDepthValues===!1})}w.isXRRenderTarget=!0,this.setFoveation(l),c=null,o=await s.requestReferenceSpace(a),pe.setContext(s),pe.start(),n.isPresenting=!0,n.dispatchEvent({type:"sessionstart"})}},this.getEnvironmentBlendMode=function(){if(s!==null)return s.environmentBlendMode},this.getDepthTexture=function(){return g.getDepthTexture()};function xe(re){for(let Te=0;Te<re.removed.length;Te++){let Ie=re.removed[Te],Oe=I.indexOf(Ie);Oe>=0&&(I[Oe]=null,D[Oe].disconnect(Ie))}for(let Te=0;Te<re.added.length;Te++){let Ie=re.added[Te],Oe=I.indexOf(Ie);if(Oe===-1){for(let $e=0;$e<D.length;$e++)if($e>=I.length){I.push(Ie),Oe=$e;break}else if(I[$e]===null){I[$e]=Ie,Oe=$e;break}if(Oe===-1)break}let ye=D[Oe];ye&&ye.connect(Ie)}}function ne(re,Te){Te===null?re.matrixWorld.copy(re.matrix):re.matrixWorld.multiplyMatrices(Te.matrixWorld,re.matrix),re.matrixWorldInverse.copy(re.matrixWorld).invert()}this.updateCamera=function(re){if(s===null)return;let Te=re.near,Ie=re.far;g.texture!==null&&(g.depthNear>0&&(Te=g.depthNear),g.depthFar>0&&(Ie=g.depthFar)),Z.near=O.near=k.near=Te,Z.far=O.far=k.far=Ie,(U!==Z.near||W!==Z.far)&&(s.updateRenderState({depthNear:Z.near,depthFar:Z.far}),U=Z.near,W=Z.far),Z.layers.mask=re.layers.mask|6,k.layers.mask=Z.layers.mask&-5,O.layers.mask=Z.layers.mask&-3;let Oe=re.parent,ye=Z.cameras;ne(Z,Oe);for(let $e=0;$e<ye.length;$e++)ne(ye[$e],Oe);Z.projectionMatrix.copy(k.projectionMatrix),Z.projectionMatrixInverse.copy(k.projectionMatrixInverse),G===null&&re.isPerspectiveCamera&&(G={camera:re,fov:re.fov,zoom:re.zoom}),se(re,Z,Oe)};function se(re,Te,Ie){Ie===null?re.matrix.copy(Te.matrixWorld):(re.matrix.copy(Ie.matrixWorld),re.matrix.invert(),re.matrix.multiply(Te.matrixWorld)),re.matrix.decompose(re.position,re.quaternion,re.scale),re.updateMatrixWorld(!0),re.projectionMatrix.copy(Te.projectionMatrix),re.projectionMatrixInverse.copy(Te.projectionMatrixInverse),re.isPerspectiveCamera&&(re.fov=Zr*2*Math.atan(1/re.projectionMatrix.elements[5]),re.zoom=1)}this.getCamera=function(){return Z},this.getFoveation=function(){if(!(f===null&&p===null))return l},this.setFoveation=function(re){l=re,f!==null&&(f.fixedFoveation=re),p!==null&&p.fixedFoveation!==void 0&&(p.fixedFoveation=re)},this.hasDepthSensing=function(){return g.texture!==null},this.getDepthSensingMesh=function(){return g.getMesh(Z)},this.getCameraTexture=function(re){return _[re]};let de=null;function ge(re,Te){if(h=Te.getViewerPose(c||o),x=Te,h!==null){let Ie=h.views;p!==null&&(e.setRenderTargetFramebuffer(w,p.framebuffer),e.setRenderTarget(w));let Oe=!1;Ie.length!==Z.cameras.length&&(Z.cameras.length=0,Oe=!0);for(let et=0;et<Ie.length;et++){let bt=Ie[et],vt=null;if(p!==null)vt=p.getViewport(bt);else{let Yt=u.getViewSubImage(f,bt);vt=Yt.viewport,et===0&&(e.setRenderTargetTextures(w,Yt.colorTexture,Yt.depthStencilTexture),e.setRenderTarget(w))}let _t=Y[et];_t===void 0&&(_t=new On,_t.layers.enable(et),_t.viewport=new $t,Y[et]=_t),_t.matrix.fromArray(bt.transform.matrix),_t.matrix.decompose(_t.position,_t.quaternion,_t.scale),_t.projectionMatrix.fromArray(bt.projectionMatrix),_t.projectionMatrixInverse.copy(_t.projectionMatrix).invert(),_t.viewport.set(vt.x,vt.y,vt.width,vt.height),et===0&&(Z.matrix.copy(_t.matrix),Z.matrix.decompose(Z.position,Z.quaternion,Z.scale)),Oe===!0&&Z.cameras.push(_t)}let ye=s.enabledFeatures;if(ye&&ye.includes("depth-sensing")&&s.depthUsage=="gpu-optimized"&&M){u=n.getBinding();let et=u.getDepthInformation(Ie[0]);et&&et.isValid&&et.texture&&g.init(et,s.renderState)}if(ye&&ye.includes("camera-access")&&M){e.state.unbindTexture(),u=n.getBinding();for(let et=0;et<Ie.length;et++){let bt=Ie[et].camera;if(bt){let vt=_[bt];vt||(vt=new ol,_[bt]=vt);let _t=u.getCameraImage(bt);vt.sourceTexture=_t}}}}for(let Ie=0;Ie<D.length;Ie++){let Oe=I[Ie],ye=D[Ie];Oe!==null&&ye!==void 0&&ye.update(Oe,Te,c||o)}de&&de(re,Te),Te.detectedPlanes&&n.dispatchEvent({type:"planesdetected",data:Te}),x=null}let pe=new p_;pe.setAnimationLoop(ge),this.setAnimationLoop=function(re){de=re},this.dispose=function(){}}},cE=new Mt,w_=new yt;w_.set(-1,0,0,0,1,0,0,0,1);function hE(i,e){function t(g,_){g.matrixAutoUpdate===!0&&g.updateMatrix(),_.value.copy(g.matrix)}function n(g,_){_.color.getRGB(g.fogColor.value,Sd(i)),_.isFog?(g.fogNear.value=_.near,g.fogFar.value=_.far):_.isFogExp2&&(g.fogDensity.value=_.density)}function s(g,_,b,P,w){_.isNodeMaterial?_.uniformsNeedUpdate=!1:_.isMeshBasicMaterial?r(g,_):_.isMeshLambertMaterial?(r(g,_),_.envMap&&(g.envMapIntensity.value=_.envMapIntensity)):_.isMeshToonMaterial?(r(g,_),u(g,_)):_.isMeshPhongMaterial?(r(g,_),h(g,_),_.envMap&&(g.envMapIntensity.value=_.envMapIntensity)):_.isMeshStandardMaterial?(r(g,_),f(g,_),_.isMeshPhysicalMaterial&&p(g,_,w)):_.isMeshMatcapMaterial?(r(g,_),x(g,_)):_.isMeshDepthMaterial?r(g,_):_.isMeshDistanceMaterial?(r(g,_),M(g,_)):_.isMeshNormalMaterial?r(g,_):_.isLineBasicMaterial?(o(g,_),_.isLineDashedMaterial&&a(g,_)):_.isPointsMaterial?l(g,_,b,P):_.isSpriteMaterial?c(g,_):_.isShadowMaterial?(g.color.value.copy(_.color),g.opacity.value=_.opacity):_.isShaderMaterial&&(_.uniformsNeedUpdate=!1)}function r(g,_){g.opacity.value=_.opacity,_.color&&g.diffuse.value.copy(_.color),_.emissive&&g.emissive.value.copy(_.emissive).multiplyScalar(_.emissiveIntensity),_.map&&(g.map.value=_.map,t(_.map,g.mapTransform)),_.alphaMap&&(g.alphaMap.value=_.alphaMap,t(_.alphaMap,g.alphaMapTransform)),_.bumpMap&&(g.bumpMap.value=_.bumpMap,t(_.bumpMap,g.bumpMapTransform),g.bumpScale.value=_.bumpScale,_.side===pi&&(g.bumpScale.value*=-1)),_.normalMap&&(g.normalMap.value=_.normalMap,t(_.normalMap,g.normalMapTransform),g.normalScale.value.copy(_.normalScale),_.side===pi&&g.normalScale.value.negate()),_.displacementMap&&(g.displacementMap.value=_.displacementMap,t(_.displacementMap,g.displacementMapTransform),g.displacementScale.value=_.displacementScale,g.displacementBias.value=_.displacementBias),_.emissiveMap&&(g.emissiveMap.value=_.emissiveMap,t(_.emissiveMap,g.emissiveMapTransform)),_.specularMap&&(g.specularMap.value=_.specularMap,t(_.specularMap,g.specularMapTransform)),_.alphaTest>0&&(g.alphaTest.value=_.alphaTest);let b=e.get(_),P=b.envMap,w=b.envMapRotation;P&&(g.envMap.value=P,g.envMapRotation.value.setFromMatrix4(cE.makeRotationFromEuler(w)).transpose(),P.isCubeTexture&&P.isRenderTargetTexture===!1&&g.envMapRotation.value.premultiply(w_),g.reflectivity.value=_.reflectivity,g.ior.value=_.ior,g.refractionRatio.value=_.refractionRatio),_.lightMap&&(g.lightMap.value=_.lightMap,g.lightMapIntensity.value=_.lightMapIntensity,t(_.lightMap,g.lightMapTransform)),_.aoMap&&(g.aoMap.value=_.aoMap,g.aoMapIntensity.value=_.aoMapIntensity,t(_.aoMap,g.aoMapTransform))}function o(g,_){g.diffuse.value.copy(_.color),g.opacity.value=_.opacity,_.map&&(g.map.value=_.map,t(_.map,g.mapTransform))}function a(g,_){g.dashSize.value=_.dashSize,g.totalSize.value=_.dashSize+_.gapSize,g.scale.value=_.scale}function l(g,_,b,P){g.diffuse.value.copy(_.color),g.opacity.value=_.opacity,g.size.value=_.size*b,g.scale.value=P*.5,_.map&&(g.map.value=_.map,t(_.map,g.uvTransform)),_.alphaMap&&(g.alphaMap.value=_.alphaMap,t(_.alphaMap,g.alphaMapTransform)),_.alphaTest>0&&(g.alphaTest.value=_.alphaTest)}function c(g,_){g.diffuse.value.copy(_.color),g.opacity.value=_.opacity,g.rotation.value=_.rotation,_.map&&(g.map.value=_.map,t(_.map,g.mapTransform)),_.alphaMap&&(g.alphaMap.value=_.alphaMap,t(_.alphaMap,g.alphaMapTransform)),_.alphaTest>0&&(g.alphaTest.value=_.alphaTest)}function h(g,_){g.specular.value.copy(_.specular),g.shininess.value=Math.max(_.shininess,1e-4)}function u(g,_){_.gradientMap&&(g.gradientMap.value=_.gradientMap)}function f(g,_){g.metalness.value=_.metalness,_.metalnessMap&&(g.metalnessMap.value=_.metalnessMap,t(_.metalnessMap,g.metalnessMapTransform)),g.roughness.value=_.roughness,_.roughnessMap&&(g.roughnessMap.value=_.roughnessMap,t(_.roughnessMap,g.roughnessMapTransform)),_.envMap&&(g.envMapIntensity.value=_.envMapIntensity)}function p(g,_,b){g.ior.value=_.ior,_.diffuseRoughness>0&&(g.diffuseRoughness.value=_.diffuseRoughness,_.diffuseRoughnessMap&&(g.diffuseRoughnessMap.value=_.diffuseRoughnessMap,t(_.diffuseRoughnessMap,g.diffuseRoughnessMapTransform))),_.sheen>0&&(g.sheenColor.value.copy(_.sheenColor).multiplyScalar(_.sheen),g.sheenRoughness.value=_.sheenRoughness,_.sheenColorMap&&(g.sheenColorMap.value=_.sheenColorMap,t(_.sheenColorMap,g.sheenColorMapTransform)),_.sheenRoughnessMap&&(g.sheenRoughnessMap.value=_.sheenRoughnessMap,t(_.sheenRoughnessMap,g.sheenRoughnessMapTransform))),_.clearcoat>0&&(g.clearcoat.value=_.clearcoat,g.clearcoatRoughness.value=_.clearcoatRoughness,_.clearcoatMap&&(g.clearcoatMap.value=_.clearcoatMap,t(_.clearcoatMap,g.clearcoatMapTransform)),_.clearcoatRoughnessMap&&(g.clearcoatRoughnessMap.value=_.clearcoatRoughnessMap,t(_.clearcoatRoughnessMap,g.clearcoatRoughnessMapTransform)),_.clearcoatNormalMap&&(g.clearcoatNormalMap.value=_.clearcoatNormalMap,t(_.clearcoatNormalMap,g.clearcoatNormalMapTransform),g.clearcoatNormalScale.value.copy(_.clearcoatNormalScale),_.side===pi&&g.clearcoatNormalScale.value.negate())),_.dispersion>0&&(g.dispersion.value=_.dispersion),_.retroreflectivity>0&&(g.retroreflectivity.value=_.retroreflectivity),_.iridescence>0&&(g.iridescence.value=_.iridescence,g.iridescenceIOR.value=_.iridescenceIOR,g.iridescenceThicknessMinimum.value=_.iridescenceThicknessMinimum,g.iridescenceThicknessMaximum.value=_.iridescenceThicknessMaximum,_.iridescenceMap&&(g.iridescenceMap.value=_.iridescenceMap,t(_.iridescenceMap,g.iridescenceMapTransform)),_.iridescenceThicknessMap&&(g.iridescenceThicknessMap.value=_.iridescenceThicknessMap,t(_.iridescenceThicknessMap,g.iridescenceThicknessMapTransform))),_.transmission>0&&(g.transmission.value=_.transmission,g.transmissionSamplerMap.value=b.texture,g.transmissionSamplerSize.value.set(b.width,b.height),_.transmissionMap&&(g.transmissionMap.value=_.transmissionMap,t(_.transmissionMap,g.transmissionMapTransform)),g.thickness.value=_.thickness,_.thicknessMap&&(g.thicknessMap.value=_.thicknessMap,t(_.thicknessMap,g.thicknessMapTransform)),g.attenuationDistance.value=_.attenuationDistance,g.attenuationColor.value.copy(_.attenuationColor)),_.anisotropy>0&&(g.anisotropyVector.value.set(_.anisotropy*Math.cos(_.anisotropyRotation),_.anisotropy*Math.sin(_.anisotropyRotation)),_.anisotropyMap&&(g.anisotropyMap.value=_.anisotropyMap,t(_.anisotropyMap,g.anisotropyMapTransform))),g.specularIntensity.value=_.specularIntensity,g.specularColor.value.copy(_.specularColor),_.specularColorMap&&(g.specularColorMap.value=_.specularColorMap,t(_.specularColorMap,g.specularColorMapTransform)),_.specularIntensityMap&&(g.specularIntensityMap.value=_.specularIntensityMap,t(_.specularIntensityMap,g.specularIntensityMapTransform))}function x(g,_){_.matcap&&(g.matcap.value=_.matcap)}function M(g,_){let b=e.get(_).light;g.referencePosition.value.setFromMatrixPosition(b.matrixWorld),g.nearDistance.value=b.shadow.camera.near,g.farDistance.value=b.shadow.camera.far}return{refreshFogUniforms:n,refreshMaterialUniforms:s}}function uE(i,e,t,n){let s={},r={};function o(b,P){let w=P.program;n.uniformBlockBinding(b,w,s[b.id])}function a(b,P){let w=s[b.id];w===void 0&&(x(b),w=l(b),s[b.id]=w,b.addEventListener("dispose",g));let D=P.program;n.updateUBOMapping(b,D);let I=e.render.frame;r[b.id]!==I&&(c(b),r[b.id]=I)}function l(b){let P=i.createBuffer(),w=b.__size,D=b.usage;return i.bindBuffer(i.UNIFORM_BUFFER,P),i.bufferData(i.UNIFORM_BUFFER,w,D),i.bindBuffer(i.UNIFORM_BUFFER,null),P}function c(b){let P=s[b.id],w=b.uniforms,D=b.__cache;i.bindBuffer(i.UNIFORM_BUFFER,P);for(let I=0,y=w.length;I<y;I++){let T=w[I];if(Array.isArray(T))for(let G=0,k=T.length;G<k;G++)h(T[G],I,G,D);else h(T,I,0,D)}i.bindBuffer(i.UNIFORM_BUFFER,null)}function h(b,P,w,D){if(f(b,P,w,D)===!0){let I=b.__offset,y=b.value;if(Array.isArray(y)){let T=0;for(let G=0;G<y.length;G++){let k=y[G],O=M(k,!0);u(k,b.__data,T),T+=O.storage/Float32Array.BYTES_PER_ELEMENT}}else u(y,b.__data,0);i.bufferSubData(i.UNIFORM_BUFFER,I,b.__data)}}function u(b,P,w){typeof b=="number"||typeof b=="boolean"?P[w]=b:b.isMatrix3?(P[w]=b.elements[0],P[w+1]=b.elements[1],P[w+2]=b.elements[2],P[w+3]=0,P[w+4]=b.elements[3],P[w+5]=b.elements[4],P[w+6]=b.elements[5],P[w+7]=0,P[w+8]=b.elements[6],P[w+9]=b.elements[7],P[w+10]=b.elements[8],P[w+11]=0):ArrayBuffer.isView(b)?P.set(b.subarray(0,P.length-w),w):b.toArray(P,w)}function f(b,P,w,D){let I=b.value,y=P+"_"+w;if(Array.isArray(I)){D[y]===void 0&&(D[y]=[]);let T=D[y],G=!1;for(let k=0;k<I.length;k++)p(I[k],T,k)===!0&&(G=!0);return G}return p(I,D,y)}function p(b,P,w){if(P[w]===void 0)return typeof b=="number"||typeof b=="boolean"?P[w]=b:ArrayBuffer.isView(b)?P[w]=b.slice():P[w]=b.clone(),!0;{let D=P[w];if(typeof b=="number"||typeof b=="boolean"){if(D!==b)return P[w]=b,!0}else{if(ArrayBuffer.isView(b))return!0;if(D.equals(b)===!1)return D.copy(b),!0}}return!1}function x(b){let P=b.uniforms,w=0,D=16;for(let y=0,T=P.length;y<T;y++){let G=Array.isArray(P[y])?P[y]:[P[y]];for(let k=0,O=G.length;k<O;k++){let Y=G[k],Z=Array.isArray(Y.value)?Y.value:[Y.value],U=Array.isArray(P[y])||Array.isArray(Y.value),W=w;for(let q=0,xe=Z.length;q<xe;q++){let ne=Z[q],se=M(ne,U),de=w%D,ge=de%se.boundary,pe=de+ge;w+=ge,pe!==0&&D-pe<se.storage&&(w+=D-pe),q===0&&(W=w),w+=se.storage}let $=Y.type==="int"?Int32Array:Y.type==="uint"?Uint32Array:Float32Array;Y.__data=new $((w-W)/Float32Array.BYTES_PER_ELEMENT),Y.__offset=W}}let I=w%D;return I>0&&(w+=D-I),b.__size=w,b.__cache={},this}function M(b,P){let w={boundary:0,storage:0};return typeof b=="number"||typeof b=="boolean"?(w.boundary=4,w.storage=4):b.isVector2?(w.boundary=8,w.storage=8):b.isVector3||b.isColor?(w.boundary=16,w.storage=12):b.isVector4?(w.boundary=16,w.storage=16):b.isMatrix3?(w.boundary=16,w.storage=48):b.isMatrix4?(w.boundary=16,w.storage=64):b.isTexture?nt("WebGLRenderer: Texture samplers can not be part of an uniforms group."):ArrayBuffer.isView(b)?(w.boundary=16,w.storage=b.byteLength):nt("WebGLRenderer: Unsupported uniform value type.",b),P===!0&&(w.boundary=16,w.storage=Math.ceil(w.storage/16)*16),w}function g(b){let P=b.target;P.removeEventListener("dispose",g),i.deleteBuffer(s[P.id]),delete s[P.id],delete r[P.id]}function _(){for(let b in s)i.deleteBuffer(s[b]);s={},r={}}return{bind:o,update:a,dispose:_}}var fE=new Uint16Array([12469,15057,12620,14925,13266,14620,13807,14376,14323,13990,14545,13625,14713,13328,14840,12882,14931,12528,14996,12233,15039,11829,15066,11525,15080,11295,15085,10976,15082,10705,15073,10495,13880,14564,13898,14542,13977,14430,14158,14124,14393,13732,14556,13410,14702,12996,14814,12596,14891,12291,14937,11834,14957,11489,14958,11194,14943,10803,14921,10506,14893,10278,14858,9960,14484,14039,14487,14025,14499,13941,14524,13740,14574,13468,14654,13106,14743,12678,14818,12344,14867,11893,14889,11509,14893,11180,14881,10751,14852,10428,14812,10128,14765,9754,14712,9466,14764,13480,14764,13475,14766,13440,14766,13347,14769,13070,14786,12713,14816,12387,14844,11957,14860,11549,14868,11215,14855,10751,14825,10403,14782,10044,14729,9651,14666,9352,14599,9029,14967,12835,14966,12831,14963,12804,14954,12723,14936,12564,14917,12347,14900,11958,14886,11569,14878,11247,14859,10765,14828,10401,14784,10011,14727,9600,14660,9289,14586,8893,14508,8533,15111,12234,15110,12234,15104,12216,15092,12156,15067,12010,15028,11776,14981,11500,14942,11205,14902,10752,14861,10393,14812,9991,14752,9570,14682,9252,14603,8808,14519,8445,14431,8145,15209,11449,15208,11451,15202,11451,15190,11438,15163,11384,15117,11274,15055,10979,14994,10648,14932,10343,14871,9936,14803,9532,14729,9218,14645,8742,14556,8381,14461,8020,14365,7603,15273,10603,15272,10607,15267,10619,15256,10631,15231,10614,15182,10535,15118,10389,15042,10167,14963,9787,14883,9447,14800,9115,14710,8665,14615,8318,14514,7911,14411,7507,14279,7198,15314,9675,15313,9683,15309,9712,15298,9759,15277,9797,15229,9773,15166,9668,15084,9487,14995,9274,14898,8910,14800,8539,14697,8234,14590,7790,14479,7409,14367,7067,14178,6621,15337,8619,15337,8631,15333,8677,15325,8769,15305,8871,15264,8940,15202,8909,15119,8775,15022,8565,14916,8328,14804,8009,14688,7614,14569,7287,14448,6888,14321,6483,14088,6171,15350,7402,15350,7419,15347,7480,15340,7613,15322,7804,15287,7973,15229,8057,15148,8012,15046,7846,14933,7611,14810,7357,14682,7069,14552,6656,14421,6316,14251,5948,14007,5528,15356,5942,15356,5977,15353,6119,15348,6294,15332,6551,15302,6824,15249,7044,15171,7122,15070,7050,14949,6861,14818,6611,14679,6349,14538,6067,14398,5651,14189,5311,13935,4958,15359,4123,15359,4153,15356,4296,15353,4646,15338,5160,15311,5508,15263,5829,15188,6042,15088,6094,14966,6001,14826,5796,14678,5543,14527,5287,14377,4985,14133,4586,13869,4257,15360,1563,15360,1642,15358,2076,15354,2636,15341,3350,15317,4019,15273,4429,15203,4732,15105,4911,14981,4932,14836,4818,14679,4621,14517,4386,14359,4156,14083,3795,13808,3437,15360,122,15360,137,15358,285,15355,636,15344,1274,15322,2177,15281,2765,15215,3223,15120,3451,14995,3569,14846,3567,14681,3466,14511,3305,14344,3121,14037,2800,13753,2467,15360,0,15360,1,15359,21,15355,89,15346,253,15325,479,15287,796,15225,1148,15133,1492,15008,1749,14856,1882,14685,1886,14506,1783,14324,1608,13996,1398,13702,1183]),Es=null;function dE(){return Es===null&&(Es=new ys(fE,16,16,yi,hn),Es.name="DFG_LUT",Es.minFilter=Xt,Es.magFilter=Xt,Es.wrapS=gi,Es.wrapT=gi,Es.generateMipmaps=!1,Es.needsUpdate=!0),Es}var Kh=class{constructor(e={}){let{canvas:t=k0(),context:n=null,depth:s=!0,stencil:r=!1,alpha:o=!1,antialias:a=!1,premultipliedAlpha:l=!0,preserveDrawingBuffer:c=!1,powerPreference:h="default",failIfMajorPerformanceCaveat:u=!1,reversedDepthBuffer:f=!1,outputBufferType:p=ti}=e;this.isWebGLRenderer=!0;let x;if(n!==null){if(typeof WebGLRenderingContext<"u"&&n instanceof WebGLRenderingContext)throw new Error("THREE.WebGLRenderer: WebGL 1 is not supported since r163.");x=n.getContextAttributes().alpha}else x=o;let M=p,g=new Set([dh,fh,uh]),_=new Set([ti,as,la,ro,ch,hh]),b=new Uint32Array(4),P=new Int32Array(4),w={textures:[],min:[],max:[],resolution:[]},D=null,I=null,y=[],T=[],G=null;this.domElement=t,this.debug={checkShaderErrors:!0,diagnostics:{keywords:!1},onShaderError:null},this.autoClear=!0,this.autoClearColor=!0,this.autoClearDepth=!0,this.autoClearStencil=!0,this.sortObjects=!0,this.clippingPlanes=[],this.localClippingEnabled=!1,this.toneMapping=Wi,this.toneMappingExposure=1,this.transmissionResolutionScale=1;let k=this,O=!1,Y=null,Z=null,U=null,W=null;this._outputColorSpace=Un;let $=0,q=0,xe=null,ne=-1,se=null,de=new $t,ge=new $t,pe=null,re=new ft(0),Te=0,Ie=t.width,Oe=t.height,ye=1,$e=null,ut=null,et=new $t(0,0,Ie,Oe),bt=new $t(0,0,Ie,Oe),vt=!1,_t=new br,Yt=new Xc,Ft=!1,fn=!1,Vt=new Mt,Tn=new Q,Pt=new $t,yn={background:null,fog:null,environment:null,overrideMaterial:null,isScene:!0},nn=!1;function Sn(){return xe===null?ye:1}let V=n;function He(d,v){return t.getContext(d,v)}let ct,xt,Ne,Zt,je,at,N,E,ee,Se,me,De,Ue,ae,ue,Ae,H,he,oe,ke,Pe,Fe,tt;try{let d={alpha:!0,depth:s,stencil:r,antialias:a,premultipliedAlpha:l,preserveDrawingBuffer:c,powerPreference:h,failIfMajorPerformanceCaveat:u};if("setAttribute"in t&&t.setAttribute("data-engine",`three.js r${"187"}`),t.addEventListener("webglcontextlost",Je,!1),t.addEventListener("webglcontextrestored",pt,!1),t.addEventListener("webglcontextcreationerror",Ge,!1),V===null){let v="webgl2";if(V=He(v,d),V===null)throw He(v)?new Error("THREE.WebGLRenderer: Error creating WebGL context with your selected attributes."):new Error("THREE.WebGLRenderer: Error creating WebGL context.")}dt()}catch(d){throw t.removeEventListener("webglcontextlost",Je,!1),t.removeEventListener("webglcontextrestored",pt,!1),t.removeEventListener("webglcontextcreationerror",Ge,!1),gt("WebGLRenderer: "+d.message),d}function dt(){ct=new ww(V),ct.init(),Pe=new oE(V,ct),xt=new dw(V,ct,e,Pe),Ne=new sE(V,ct),xt.reversedDepthBuffer&&f&&Ne.buffers.depth.setReversed(!0),Z=V.createFramebuffer(),U=V.createFramebuffer(),W=V.createFramebuffer(),Zt=new Aw(V),je=new W1,at=new rE(V,ct,Ne,je,xt,Pe,Zt),N=new bw(k),E=new CS(V),Fe=new uw(V,E),ee=new Ew(V,E,Zt,Fe),Se=new Cw(V,ee,E,Fe,Zt),he=new Rw(V,xt,at),ue=new pw(je),me=new V1(k,N,ct,xt,Fe,ue),De=new hE(k,je),Ue=new q1,ae=new j1(ct),H=new hw(k,N,Ne,Se,x,l),Ae=new iE(k,Se,xt),tt=new uE(V,Zt,xt,Ne),oe=new fw(V,ct,Zt),ke=new Tw(V,ct,Zt),Zt.programs=me.programs,k.capabilities=xt,k.extensions=ct,k.properties=je,k.renderLists=Ue,k.shadowMap=Ae,k.state=Ne,k.info=Zt}M!==ti&&(G=new Pw(M,t.width,t.height,a,s,r));let Me=new Nd(k,V);this.xr=Me,this.getContext=function(){return V},this.getContextAttributes=function(){return V.getContextAttributes()},this.forceContextLoss=function(){let d=ct.get("WEBGL_lose_context");d&&d.loseContext()},this.forceContextRestore=function(){let d=ct.get("WEBGL_lose_context");d&&d.restoreContext()},this.getPixelRatio=function(){return ye},this.setPixelRatio=function(d){d!==void 0&&(ye=d,this.setSize(Ie,Oe,!1))},this.getSize=function(d){return d.set(Ie,Oe)},this.setSize=function(d,v,A=!0){if(Me.isPresenting){nt("WebGLRenderer: Can't change size while VR device is presenting.");return}Ie=d,Oe=v,t.width=Math.floor(d*ye),t.height=Math.floor(v*ye),A===!0&&(t.style.width=d+"px",t.style.height=v+"px"),G!==null&&G.setSize(t.width,t.height),this.setViewport(0,0,d,v)},this.getDrawingBufferSize=function(d){return d.set(Ie*ye,Oe*ye).floor()},this.setDrawingBufferSize=function(d,v,A){Ie=d,Oe=v,ye=A,t.width=Math.floor(d*A),t.height=Math.floor(v*A),this.setViewport(0,0,d,v)},this.setEffects=function(d){if(M===ti){gt("WebGLRenderer: setEffects() requires outputBufferType set to HalfFloatType or FloatType.");return}if(d){for(let v=0;v<d.length;v++)if(d[v].isOutputPass===!0){nt("WebGLRenderer: OutputPass is not needed in setEffects(). Tone mapping and color space conversion are applied automatically.");break}}G.setEffects(d||[])},this.getCurrentViewport=function(d){return d.copy(de)},this.getViewport=function(d){return d.copy(et)},this.setViewport=function(d,v,A,C){d.isVector4?et.set(d.x,d.y,d.z,d.w):et.set(d,v,A,C),Ne.viewport(de.copy(et).multiplyScalar(Sn()).round())},this.getScissor=function(d){return d.copy(bt)},this.setScissor=function(d,v,A,C){d.isVector4?bt.set(d.x,d.y,d.z,d.w):bt.set(d,v,A,C),Ne.scissor(ge.copy(bt).multiplyScalar(Sn()).round())},this.getScissorTest=function(){return vt},this.setScissorTest=function(d){Ne.setScissorTest(vt=d)},this.setOpaqueSort=function(d){$e=d},this.setTransparentSort=function(d){ut=d},this.getClearColor=function(d){return d.copy(H.getClearColor())},this.setClearColor=function(){H.setClearColor(...arguments)},this.getClearAlpha=function(){return H.getClearAlpha()},this.setClearAlpha=function(){H.setClearAlpha(...arguments)},this.clear=function(d=!0,v=!0,A=!0){let C=0;if(d){let F=!1;if(xe!==null){let L=xe.texture.format;F=g.has(L)}if(F){let L=xe.texture.type,J=_.has(L),X=H.getClearColor(),j=H.getClearAlpha(),te=X.r,fe=X.g,le=X.b;J?(b[0]=te,b[1]=fe,b[2]=le,b[3]=j,V.clearBufferuiv(V.COLOR,0,b)):(P[0]=te,P[1]=fe,P[2]=le,P[3]=j,V.clearBufferiv(V.COLOR,0,P))}else C|=V.COLOR_BUFFER_BIT}v&&(C|=V.DEPTH_BUFFER_BIT,this.state.buffers.depth.setMask(!0)),A&&(C|=V.STENCIL_BUFFER_BIT,this.state.buffers.stencil.setMask(4294967295)),C!==0&&V.clear(C)},this.clearColor=function(){this.clear(!0,!1,!1)},this.clearDepth=function(){this.clear(!1,!0,!1)},this.clearStencil=function(){this.clear(!1,!1,!0)},this.setNodesHandler=function(d){d.setRenderer(this),Y=d},this.dispose=function(){t.removeEventListener("webglcontextlost",Je,!1),t.removeEventListener("webglcontextrestored",pt,!1),t.removeEventListener("webglcontextcreationerror",Ge,!1),H.dispose(),Ue.dispose(),ae.dispose(),at.dispose(),je.dispose(),N.dispose(),Se.dispose(),ee.dispose(),Fe.dispose(),tt.dispose(),me.dispose(),Me.dispose(),Me.removeEventListener("sessionstart",Pr),Me.removeEventListener("sessionend",Ui),Yi.stop()};function Je(d){d.preventDefault(),Za("WebGLRenderer: Context Lost."),O=!0}function pt(){Za("WebGLRenderer: Context Restored."),O=!1;let d=Zt.autoReset,v=Ae.enabled,A=Ae.autoUpdate,C=Ae.needsUpdate,F=Ae.type;dt(),Zt.autoReset=d,Ae.enabled=v,Ae.autoUpdate=A,Ae.needsUpdate=C,Ae.type=F}function Ge(d){gt("WebGLRenderer: A WebGL context could not be created. Reason: ",d.statusMessage)}function wt(d){let v=d.target;v.removeEventListener("dispose",wt),jt(v)}function jt(d){Zn(d),je.remove(d)}function Zn(d){let v=je.get(d).programs;v!==void 0&&(v.forEach(function(A){me.releaseProgram(A)}),d.isShaderMaterial&&me.releaseShaderCache(d))}this.renderBufferDirect=function(d,v,A,C,F,L){v===null&&(v=yn);let J=F.isMesh&&F.matrixWorld.determinantAffine()<0,X=or(d,v,A,C,F);Ne.setMaterial(C,J);let j=A.index,te=1;if(C.wireframe===!0){if(j=ee.getWireframeAttribute(A),j===void 0)return;te=2}let fe=A.drawRange,le=A.attributes.position,ce=fe.start*te,be=(fe.start+fe.count)*te;L!==null&&(ce=Math.max(ce,L.start*te),be=Math.min(be,(L.start+L.count)*te)),j!==null?(ce=Math.max(ce,0),be=Math.min(be,j.count)):le!=null&&(ce=Math.max(ce,0),be=Math.min(be,le.count));let we=be-ce;if(we<0||we===1/0)return;Fe.setup(F,C,X,A,j);let Ee,ze=oe;if(j!==null&&(Ee=E.get(j),ze=ke,ze.setIndex(Ee)),F.isMesh)C.wireframe===!0?(Ne.setLineWidth(C.wireframeLinewidth*Sn()),ze.setMode(V.LINES)):ze.setMode(V.TRIANGLES);else if(F.isLine){let it=C.linewidth;it===void 0&&(it=1),Ne.setLineWidth(it*Sn()),F.isLineSegments?ze.setMode(V.LINES):F.isLineLoop?ze.setMode(V.LINE_LOOP):ze.setMode(V.LINE_STRIP)}else F.isPoints?ze.setMode(V.POINTS):F.isSprite&&ze.setMode(V.TRIANGLES);if(F.isBatchedMesh)if(ct.get("WEBGL_multi_draw"))ze.renderMultiDraw(F._multiDrawStarts,F._multiDrawCounts,F._multiDrawCount);else{let it=F._multiDrawStarts,ve=F._multiDrawCounts,rt=F._multiDrawCount,Re=j?E.get(j).bytesPerElement:1,Xe=je.get(C).currentProgram.getUniforms();for(let Ve=0;Ve<rt;Ve++)Xe.setValue(V,"_gl_DrawID",Ve),ze.render(it[Ve]/Re,ve[Ve])}else if(F.isInstancedMesh)ze.renderInstances(ce,we,F.count);else if(A.isInstancedBufferGeometry){let it=A._maxInstanceCount!==void 0?A._maxInstanceCount:1/0,ve=Math.min(A.instanceCount,it);ze.renderInstances(ce,we,ve)}else ze.render(ce,we)};function Ir(d,v,A,C){Y!==null&&d.isNodeMaterial&&Y.setObject(C,d),Ft===!0&&ue.setState(d,A,!1),d.transparent===!0&&d.side===ei&&d.forceSinglePass===!1?(d.side=pi,d.needsUpdate=!0,ii(d,v,C),d.side=bs,d.needsUpdate=!0,ii(d,v,C),d.side=ei):ii(d,v,C)}this.compile=function(d,v,A=null){A===null&&(A=d),Y!==null&&Y.renderStart(d,v,A),I=ae.get(A),I.init(v),T.push(I),A.traverseVisible(function(F){F.isLight&&F.layers.test(v.layers)&&(I.pushLight(F),F.castShadow&&I.pushShadow(F))}),d!==A&&d.traverseVisible(function(F){F.isLight&&F.layers.test(v.layers)&&(I.pushLight(F),F.castShadow&&I.pushShadow(F))}),I.setupLights(),Y!==null&&Y.updateLights(I.state.lightsArray),fn=this.localClippingEnabled,Ft=ue.init(this.clippingPlanes,fn),Ft===!0&&ue.setGlobalState(this.clippingPlanes,v),Y!==null&&Ae.render(I.state.shadowsArray,A,v);let C=new Set;return d.traverse(function(F){if(!(F.isMesh||F.isPoints||F.isLine||F.isSprite))return;let L=F.material;if(L)if(Array.isArray(L))for(let J=0;J<L.length;J++){let X=L[J];Ir(X,A,v,F),C.add(X)}else Ir(L,A,v,F),C.add(L)}),I=T.pop(),Y!==null&&Y.renderEnd(),C},this.compileAsync=function(d,v,A=null){let C=this.compile(d,v,A);return new Promise(F=>{function L(){if(C.forEach(function(J){let j=je.get(J).currentProgram;(j===void 0||j.isReady())&&C.delete(J)}),C.size===0){F(d);return}setTimeout(L,10)}ct.get("KHR_parallel_shader_compile")!==null?L():setTimeout(L,10)})};let sr=null;function Sa(d){sr&&sr(d)}function Pr(){Yi.stop()}function Ui(){Yi.start()}let Yi=new p_;Yi.setAnimationLoop(Sa),typeof self<"u"&&Yi.setContext(self),this.setAnimationLoop=function(d){sr=d,Me.setAnimationLoop(d),d===null?Yi.stop():Yi.start()},Me.addEventListener("sessionstart",Pr),Me.addEventListener("sessionend",Ui),this.render=function(d,v){if(v!==void 0&&v.isCamera!==!0){gt("WebGLRenderer.render: camera is not an instance of THREE.Camera.");return}if(O===!0)return;Y!==null&&Y.renderStart(d,v);let A=Me.enabled===!0&&Me.isPresenting===!0,C=G!==null&&(xe===null||A)&&G.begin(k,xe);if(d.matrixWorldAutoUpdate===!0&&d.updateMatrixWorld(),v.parent===null&&v.matrixWorldAutoUpdate===!0&&v.updateMatrixWorld(),Me.enabled===!0&&Me.isPresenting===!0&&(G===null||G.isCompositing()===!1)&&(Me.cameraAutoUpdate===!0&&Me.updateCamera(v),v=Me.getCamera()),d.isScene===!0&&d.onBeforeRender(k,d,v,xe),I=ae.get(d,T.length),I.init(v),I.state.textureUnits=at.getTextureUnits(),T.push(I),Vt.multiplyMatrices(v.projectionMatrix,v.matrixWorldInverse),v.isArrayCamera?Yt.setFromArrayCamera(v):_t.setFromProjectionMatrix(Vt,Gi,v.reversedDepth),fn=this.localClippingEnabled,Ft=ue.init(this.clippingPlanes,fn),D=Ue.get(d,y.length),D.init(),y.push(D),this.info.render.frame++,Me.enabled===!0&&Me.isPresenting===!0){let J=k.xr.getDepthSensingMesh();J!==null&&Zi(J,v,-1/0,k.sortObjects)}Zi(d,v,0,k.sortObjects),D.finish(),Y!==null&&Y.updateLights(I.state.lightsArray),k.sortObjects===!0&&D.sort($e,ut),nn=Me.enabled===!1||Me.isPresenting===!1||Me.hasDepthSensing()===!1,nn&&H.addToRenderList(D,d),this.info.autoReset===!0&&this.info.reset(),Ft===!0&&ue.beginShadows();let F=I.state.shadowsArray;if(Ae.render(F,d,v),Ft===!0&&ue.endShadows(),(C&&G.hasRenderPass())===!1){let J=D.opaque,X=D.transmissive;if(I.setupLights(),v.isArrayCamera){let j=v.cameras;if(X.length>0)for(let te=0,fe=j.length;te<fe;te++){let le=j[te];Mi(J,X,d,le)}nn&&H.render(d);for(let te=0,fe=j.length;te<fe;te++){let le=j[te];rr(D,d,le,le.viewport)}}else X.length>0&&Mi(J,X,d,v),nn&&H.render(d),rr(D,d,v)}xe!==null&&q===0&&(at.updateMultisampleRenderTarget(xe),at.updateRenderTargetMipmap(xe)),C&&G.end(k),d.isScene===!0&&d.onAfterRender(k,d,v),Fe.resetDefaultState(),ne=-1,se=null,T.pop(),T.length>0?(I=T[T.length-1],at.setTextureUnits(I.state.textureUnits),Ft===!0&&ue.setGlobalState(k.clippingPlanes,I.state.camera)):I=null,y.pop(),y.length>0?D=y[y.length-1]:D=null,Y!==null&&Y.renderEnd()};function Zi(d,v,A,C){if(d.visible===!1)return;if(d.layers.test(v.layers)){if(d.isGroup)A=d.renderOrder;else if(d.isLOD)d.autoUpdate===!0&&d.update(v);else if(d.isLight)I.pushLight(d),d.castShadow&&I.pushShadow(d);else if(d.isSprite){let J=v.isArrayCamera?Yt:_t;if(!d.frustumCulled||d.intersectsFrustum(J)){C&&Pt.setFromMatrixPosition(d.matrixWorld).applyMatrix4(Vt);let X=Se.update(d),j=d.material;j.visible&&D.push(d,X,j,A,Pt.z,null,v)}}else if(d.isMesh||d.isLine||d.isPoints){let J=v.isArrayCamera?Yt:_t;if(!d.frustumCulled||d.intersectsFrustum(J)){let X=Se.update(d),j=d.material;if(C&&(d.boundingSphere!==void 0?(d.boundingSphere===null&&d.computeBoundingSphere(),Pt.copy(d.boundingSphere.center)):(X.boundingSphere===null&&X.computeBoundingSphere(),Pt.copy(X.boundingSphere.center)),Pt.applyMatrix4(d.matrixWorld).applyMatrix4(Vt)),Array.isArray(j)){let te=X.groups;for(let fe=0,le=te.length;fe<le;fe++){let ce=te[fe],be=j[ce.materialIndex];be&&be.visible&&D.push(d,X,be,A,Pt.z,ce,v)}}else j.visible&&D.push(d,X,j,A,Pt.z,null,v)}}}let L=d.children;for(let J=0,X=L.length;J<X;J++)Zi(L[J],v,A,C)}function rr(d,v,A,C){let{opaque:F,transmissive:L,transparent:J}=d;I.setupLightsView(A),Ft===!0&&ue.setGlobalState(k.clippingPlanes,A),C&&Ne.viewport(de.copy(C)),F.length>0&&sn(F,v,A),L.length>0&&sn(L,v,A),J.length>0&&sn(J,v,A),Ne.buffers.depth.setTest(!0),Ne.buffers.depth.setMask(!0),Ne.buffers.color.setMask(!0),Ne.setPolygonOffset(!1)}function Mi(d,v,A,C){if((A.isScene===!0?A.overrideMaterial:null)!==null)return;if(I.state.transmissionRenderTarget[C.id]===void 0){let ce=ct.has("EXT_color_buffer_half_float")||ct.has("EXT_color_buffer_float");I.state.transmissionRenderTarget[C.id]=new hi(1,1,{generateMipmaps:!0,type:ce?hn:ti,minFilter:Ni,samples:Math.max(4,xt.samples),stencilBuffer:r,resolveDepthBuffer:!1,resolveStencilBuffer:!1,storeMultisampledDepthBuffer:!1,storeMultisampledStencilBuffer:!1,colorSpace:Ct.workingColorSpace})}let L=I.state.transmissionRenderTarget[C.id],J=C.viewport||de;L.setSize(J.z*k.transmissionResolutionScale,J.w*k.transmissionResolutionScale);let X=k.getRenderTarget(),j=k.getActiveCubeFace(),te=k.getActiveMipmapLevel();k.setRenderTarget(L),k.getClearColor(re),Te=k.getClearAlpha(),Te<1&&k.setClearColor(16777215,.5),k.clear(),nn&&H.render(A);let fe=k.toneMapping;k.toneMapping=Wi;let le=C.viewport;if(C.viewport!==void 0&&(C.viewport=void 0),I.setupLightsView(C),Ft===!0&&ue.setGlobalState(k.clippingPlanes,C),sn(d,A,C),at.updateMultisampleRenderTarget(L),at.updateRenderTargetMipmap(L),ct.has("WEBGL_multisampled_render_to_texture")===!1){let ce=!1;for(let be=0,we=v.length;be<we;be++){let Ee=v[be],{object:ze,geometry:it,material:ve,group:rt}=Ee;if(ve.side===ei&&ze.layers.test(C.layers)){let Re=ve.side;ve.side=pi,ve.needsUpdate=!0,pn(ze,A,C,it,ve,rt),ve.side=Re,ve.needsUpdate=!0,ce=!0}}ce===!0&&(at.updateMultisampleRenderTarget(L),at.updateRenderTargetMipmap(L))}k.setRenderTarget(X,j,te),k.setClearColor(re,Te),le!==void 0&&(C.viewport=le),k.toneMapping=fe}function sn(d,v,A){let C=v.isScene===!0?v.overrideMaterial:null;for(let F=0,L=d.length;F<L;F++){let J=d[F],{object:X,geometry:j,group:te}=J,fe=J.material;fe.allowOverride===!0&&C!==null&&(fe=C),X.layers.test(A.layers)&&pn(X,v,A,j,fe,te)}}function pn(d,v,A,C,F,L){Y!==null&&F.isNodeMaterial&&Y.setObject(d,F),d.onBeforeRender(k,v,A,C,F,L),d.modelViewMatrix.multiplyMatrices(A.matrixWorldInverse,d.matrixWorld),d.normalMatrix.getNormalMatrix(d.modelViewMatrix),F.onBeforeRender(k,v,A,C,d,L),F.transparent===!0&&F.side===ei&&F.forceSinglePass===!1?(F.side=pi,F.needsUpdate=!0,k.renderBufferDirect(A,v,C,F,d,L),F.side=bs,F.needsUpdate=!0,k.renderBufferDirect(A,v,C,F,d,L),F.side=ei):k.renderBufferDirect(A,v,C,F,d,L),d.onAfterRender(k,v,A,C,F,L)}function mn(d){let v=0;for(let A of d)A.texture!==null&&v++;return v}function ii(d,v,A){v.isScene!==!0&&(v=yn);let C=je.get(d),F=I.state.lights,L=I.state.shadowsArray,J=F.state.version,X=me.getParameters(d,F.state,L,v,A,I.state.lightProbeGridArray),j=me.getProgramCacheKey(X),te=C.programs;C.environment=d.isMeshStandardMaterial||d.isMeshLambertMaterial||d.isMeshPhongMaterial?v.environment:null,C.fog=v.fog;let fe=d.isMeshStandardMaterial||d.isMeshLambertMaterial&&!d.envMap||d.isMeshPhongMaterial&&!d.envMap;C.envMap=N.get(d.envMap||C.environment,fe),C.envMapRotation=C.environment!==null&&d.envMap===null?v.environmentRotation:d.envMapRotation,te===void 0&&(d.addEventListener("dispose",wt),te=new Map,C.programs=te,C.programVariants=new Map);let le=te.get(j);if(le!==void 0){if(C.currentProgram===le&&C.lightsStateVersion===J)return us(d,X),le}else X.uniforms=me.getUniforms(d),Y!==null&&d.isNodeMaterial&&Y.build(d,A,X),d.onBeforeCompile(X,k),le=me.acquireProgram(X,j),te.set(j,le),C.uniforms=X.uniforms;let ce=C.uniforms;return(!d.isShaderMaterial&&!d.isRawShaderMaterial||d.clipping===!0)&&(ce.clippingPlanes=ue.uniform),us(d,X),C.needsLights=wn(d),C.lightsStateVersion=J,C.needsLights&&(ce.ambientLightColor.value=F.state.ambient,ce.lightProbe.value=F.state.probe,ce.sunLights.value=F.state.sun,ce.sunLightShadows.value=F.state.sunShadow,ce.directionalLights.value=F.state.directional,ce.directionalLightShadows.value=F.state.directionalShadow,ce.spotLights.value=F.state.spot,ce.spotLightShadows.value=F.state.spotShadow,ce.rectAreaLights.value=F.state.rectArea,ce.ltc_1.value=F.state.rectAreaLTC1,ce.ltc_2.value=F.state.rectAreaLTC2,ce.pointLights.value=F.state.point,ce.pointLightShadows.value=F.state.pointShadow,ce.hemisphereLights.value=F.state.hemi,ce.sunShadowMatrix.value=F.state.sunShadowMatrix,ce.sunShadowCascade.value=F.state.sunShadowCascade,ce.directionalShadowMatrix.value=F.state.directionalShadowMatrix,ce.spotLightMatrix.value=F.state.spotLightMatrix,ce.spotLightMap.value=F.state.spotLightMap,ce.pointShadowMatrix.value=F.state.pointShadowMatrix),C.numLightProbeGrids=mn(I.state.lightProbeGridArray),C.currentProgram=le,C.uniformsList=null,le}function zn(d,v,A,C,F){let L=je.get(d),J=L.currentProgram.id+","+C+","+F,X=L.programVariants.get(J);return X===void 0?(X=ii(d,v,A),L.programVariants.set(J,X)):(L.currentProgram=X,L.uniformsList=null,L.outputColorSpace=C,L.toneMapping=F),X}function hs(d){if(d.uniformsList===null){let v=d.currentProgram.getUniforms();d.uniformsList=ua.seqWithValue(v.seq,d.uniforms)}return d.uniformsList}function us(d,v){let A=je.get(d);A.outputColorSpace=v.outputColorSpace,A.batching=v.batching,A.batchingColor=v.batchingColor,A.instancing=v.instancing,A.instancingColor=v.instancingColor,A.instancingMorph=v.instancingMorph,A.skinning=v.skinning,A.morphTargets=v.morphTargets,A.morphNormals=v.morphNormals,A.morphColors=v.morphColors,A.morphTargetsCount=v.morphTargetsCount,A.numClippingPlanes=v.numClippingPlanes,A.numIntersection=v.numClipIntersection,A.vertexAlphas=v.vertexAlphas,A.vertexTangents=v.vertexTangents,A.toneMapping=v.toneMapping}function or(d,v,A,C,F){v.isScene!==!0&&(v=yn),at.resetTextureUnits();let L=v.fog,J=C.isMeshStandardMaterial||C.isMeshLambertMaterial||C.isMeshPhongMaterial?v.environment:null,X=xe===null?k.outputColorSpace:xe.isXRRenderTarget===!0?xe.texture.colorSpace:Ct.workingColorSpace,j=C.isMeshStandardMaterial||C.isMeshLambertMaterial&&!C.envMap||C.isMeshPhongMaterial&&!C.envMap,te=N.get(C.envMap||J,j),fe=C.vertexColors===!0&&!!A.attributes.color&&A.attributes.color.itemSize===4,le=!!A.attributes.tangent&&(!!C.normalMap||C.anisotropy>0),ce=!!A.morphAttributes.position,be=!!A.morphAttributes.normal,we=!!A.morphAttributes.color,Ee=Wi;C.toneMapped&&(xe===null||xe.isXRRenderTarget===!0)&&(Ee=k.toneMapping);let ze=A.morphAttributes.position||A.morphAttributes.normal||A.morphAttributes.color,it=ze!==void 0?ze.length:0,ve=je.get(C),rt=I.state.lights;if(Ft===!0&&(fn===!0||d!==se)){let ot=d===se&&C.id===ne;ue.setState(C,d,ot)}let Re=!1,Xe=!1;C.version===ve.__version?ve.needsLights&&ve.lightsStateVersion!==rt.state.version||F.isBatchedMesh&&ve.batching===!1||!F.isBatchedMesh&&ve.batching===!0||F.isBatchedMesh&&ve.batchingColor===!0&&F._colorsTexture===null||F.isBatchedMesh&&ve.batchingColor===!1&&F._colorsTexture!==null||F.isInstancedMesh&&ve.instancing===!1||!F.isInstancedMesh&&ve.instancing===!0||F.isSkinnedMesh&&ve.skinning===!1||!F.isSkinnedMesh&&ve.skinning===!0||F.isInstancedMesh&&ve.instancingColor===!0&&F.instanceColor===null||F.isInstancedMesh&&ve.instancingColor===!1&&F.instanceColor!==null||F.isInstancedMesh&&ve.instancingMorph===!0&&F.morphTexture===null||F.isInstancedMesh&&ve.instancingMorph===!1&&F.morphTexture!==null||ve.envMap!==te||C.fog===!0&&ve.fog!==L||ve.numClippingPlanes!==void 0&&(ve.numClippingPlanes!==ue.numPlanes||ve.numIntersection!==ue.numIntersection)||ve.vertexAlphas!==fe||ve.vertexTangents!==le||ve.morphTargets!==ce||ve.morphNormals!==be||ve.morphColors!==we||ve.morphTargetsCount!==it||ve.numLightProbeGrids!==mn(I.state.lightProbeGridArray)?Re=!0:(ve.outputColorSpace!==X||ve.toneMapping!==Ee)&&(Xe=!0):(Re=!0,ve.__version=C.version);let Ve=ve.currentProgram;(Re===!0||Xe===!0)&&(Ve=Xe===!0?zn(C,v,F,X,Ee):ii(C,v,F),Y&&C.isNodeMaterial&&Y.onUpdateProgram(C,Ve,ve));let Nt=!1,Et=!1,ht=!1,qe=Ve.getUniforms(),Tt=ve.uniforms;if(Ne.useProgram(Ve.program)&&(Nt=!0,Et=!0,ht=!0),C.id!==ne&&(ne=C.id,Et=!0),Nt||se!==d){Ne.buffers.depth.getReversed()&&d.reversedDepth!==!0&&(d._reversedDepth=!0,d.updateProjectionMatrix()),qe.setValue(V,"projectionMatrix",d.projectionMatrix),qe.setValue(V,"viewMatrix",d.matrixWorldInverse);let Bt=qe.map.cameraPosition;Bt!==void 0&&Bt.setValue(V,Tn.setFromMatrixPosition(d.matrixWorld)),xt.logarithmicDepthBuffer&&qe.setValue(V,"logDepthBufFC",2/(Math.log(d.far+1)/Math.LN2)),(C.isMeshPhongMaterial||C.isMeshToonMaterial||C.isMeshLambertMaterial||C.isMeshBasicMaterial||C.isMeshStandardMaterial||C.isShaderMaterial)&&qe.setValue(V,"isOrthographic",d.isOrthographicCamera===!0),se!==d&&(se=d,Et=!0,ht=!0)}if(ve.needsLights&&(rt.state.sunShadowMap.length>0&&qe.setValue(V,"sunShadowMap",rt.state.sunShadowMap,at),rt.state.directionalShadowMap.length>0&&qe.setValue(V,"directionalShadowMap",rt.state.directionalShadowMap,at),rt.state.spotShadowMap.length>0&&qe.setValue(V,"spotShadowMap",rt.state.spotShadowMap,at),rt.state.pointShadowMap.length>0&&qe.setValue(V,"pointShadowMap",rt.state.pointShadowMap,at)),F.isSkinnedMesh){qe.setOptional(V,F,"bindMatrix"),qe.setOptional(V,F,"bindMatrixInverse");let ot=F.skeleton;ot&&(ot.boneTexture===null&&ot.computeBoneTexture(),qe.setValue(V,"boneTexture",ot.boneTexture,at))}F.isBatchedMesh&&(qe.setOptional(V,F,"batchingTexture"),qe.setValue(V,"batchingTexture",F._matricesTexture,at),qe.setOptional(V,F,"batchingIdTexture"),qe.setValue(V,"batchingIdTexture",F._indirectTexture,at),qe.setOptional(V,F,"batchingColorTexture"),F._colorsTexture!==null&&qe.setValue(V,"batchingColorTexture",F._colorsTexture,at));let Kt=A.morphAttributes;if((Kt.position!==void 0||Kt.normal!==void 0||Kt.color!==void 0)&&he.update(F,A,Ve),(Et||ve.receiveShadow!==F.receiveShadow)&&(ve.receiveShadow=F.receiveShadow,qe.setValue(V,"receiveShadow",F.receiveShadow)),(C.isMeshStandardMaterial||C.isMeshLambertMaterial||C.isMeshPhongMaterial)&&C.envMap===null&&v.environment!==null&&(Tt.envMapIntensity.value=v.environmentIntensity),Tt.dfgLUT!==void 0&&(Tt.dfgLUT.value=dE()),Et){if(qe.setValue(V,"toneMappingExposure",k.toneMappingExposure),ve.needsLights&&gn(Tt,ht),L&&C.fog===!0&&De.refreshFogUniforms(Tt,L),De.refreshMaterialUniforms(Tt,C,ye,Oe,I.state.transmissionRenderTarget[d.id]),ve.needsLights&&ve.numLightProbeGrids>0){let ot=w,Bt=0;for(let _n of I.state.lightProbeGridArray)_n.texture!==null&&(ot.textures[Bt]=_n.texture,ot.min[Bt]=_n.boundingBox.min,ot.max[Bt]=_n.boundingBox.max,ot.resolution[Bt]=_n.resolution,Bt++);for(let _n in ot)ot[_n].length=Bt;Tt.probesSH.value=ot.textures,Tt.probesMin.value=ot.min,Tt.probesMax.value=ot.max,Tt.probesResolution.value=ot.resolution}ua.upload(V,hs(ve),Tt,at)}if(C.isShaderMaterial&&C.uniformsNeedUpdate===!0&&(ua.upload(V,hs(ve),Tt,at),C.uniformsNeedUpdate=!1),C.isSpriteMaterial&&qe.setValue(V,"center",F.center),qe.setValue(V,"modelViewMatrix",F.modelViewMatrix),qe.setValue(V,"normalMatrix",F.normalMatrix),qe.setValue(V,"modelMatrix",F.matrixWorld),C.uniformsGroups!==void 0){let ot=C.uniformsGroups;for(let Bt=0,_n=ot.length;Bt<_n;Bt++){let fs=ot[Bt];tt.update(fs,Ve),tt.bind(fs,Ve)}}return Ve}function gn(d,v){d.ambientLightColor.needsUpdate=v,d.lightProbe.needsUpdate=v,d.sunLights.needsUpdate=v,d.sunLightShadows.needsUpdate=v,d.directionalLights.needsUpdate=v,d.directionalLightShadows.needsUpdate=v,d.pointLights.needsUpdate=v,d.pointLightShadows.needsUpdate=v,d.spotLights.needsUpdate=v,d.spotLightShadows.needsUpdate=v,d.rectAreaLights.needsUpdate=v,d.hemisphereLights.needsUpdate=v}function wn(d){return d.isMeshLambertMaterial||d.isMeshToonMaterial||d.isMeshPhongMaterial||d.isMeshStandardMaterial||d.isShadowMaterial||d.isShaderMaterial&&d.lights===!0}this.getActiveCubeFace=function(){return $},this.getActiveMipmapLevel=function(){return q},this.getRenderTarget=function(){return xe},this.setRenderTargetTextures=function(d,v,A){let C=je.get(d);C.__autoAllocateDepthBuffer=d.resolveDepthBuffer===!1,C.__autoAllocateDepthBuffer===!1&&(C.__useRenderToTexture=!1),je.get(d.texture).__webglTexture=v,je.get(d.depthTexture).__webglTexture=C.__autoAllocateDepthBuffer?void 0:A,C.__hasExternalTextures=!0},this.setRenderTargetFramebuffer=function(d,v){let A=je.get(d);A.__webglFramebuffer=v,A.__useDefaultFramebuffer=v===void 0},this.setRenderTarget=function(d,v=0,A=0){xe=d,$=v,q=A;let C=null,F=!1,L=!1;if(d){let X=je.get(d);if(X.__useDefaultFramebuffer!==void 0){Ne.bindFramebuffer(V.FRAMEBUFFER,X.__webglFramebuffer),de.copy(d.viewport),ge.copy(d.scissor),pe=d.scissorTest,Ne.viewport(de),Ne.scissor(ge),Ne.setScissorTest(pe),ne=-1;return}else if(X.__webglFramebuffer===void 0)at.setupRenderTarget(d);else if(X.__hasExternalTextures)at.rebindTextures(d,je.get(d.texture).__webglTexture,je.get(d.depthTexture).__webglTexture);else if(d.depthBuffer){let fe=d.depthTexture;if(X.__boundDepthTexture!==fe){if(fe!==null&&je.has(fe)&&(d.width!==fe.image.width||d.height!==fe.image.height))throw new Error("THREE.WebGLRenderer: Attached DepthTexture is initialized to the incorrect size.");at.setupDepthRenderbuffer(d)}}let j=d.texture;(j.isData3DTexture||j.isDataArrayTexture||j.isCompressedArrayTexture)&&(L=!0);let te=je.get(d).__webglFramebuffer;d.isWebGLCubeRenderTarget?(Array.isArray(te[v])?C=te[v][A]:C=te[v],F=!0):d.samples>0&&at.useMultisampledRTT(d)===!1?C=je.get(d).__webglMultisampledFramebuffer:Array.isArray(te)?C=te[A]:C=te,de.copy(d.viewport),ge.copy(d.scissor),pe=d.scissorTest}else de.copy(et).multiplyScalar(ye).floor(),ge.copy(bt).multiplyScalar(ye).floor(),pe=vt;if(A!==0&&(C=Z),Ne.bindFramebuffer(V.FRAMEBUFFER,C)&&Ne.drawBuffers(d,C),Ne.viewport(de),Ne.scissor(ge),Ne.setScissorTest(pe),F){let X=je.get(d.texture);V.framebufferTexture2D(V.FRAMEBUFFER,V.COLOR_ATTACHMENT0,V.TEXTURE_CUBE_MAP_POSITIVE_X+v,X.__webglTexture,A)}else if(L){let X=v;for(let j=0;j<d.textures.length;j++){let te=je.get(d.textures[j]);V.framebufferTextureLayer(V.FRAMEBUFFER,V.COLOR_ATTACHMENT0+j,te.__webglTexture,A,X)}}else if(d!==null&&A!==0){let X=je.get(d.texture);V.framebufferTexture2D(V.FRAMEBUFFER,V.COLOR_ATTACHMENT0,V.TEXTURE_2D,X.__webglTexture,A)}ne=-1};function m(d){let v=je.get(d);return(v.__readFormat!==d.format||v.__readType!==d.type)&&(v.__readFormat=d.format,v.__readType=d.type,v.__formatReadable=xt.textureFormatReadable(d.format),v.__typeReadable=xt.textureTypeReadable(d.type)),v}this.readRenderTargetPixels=function(d,v,A,C,F,L,J,X=0){if(!(d&&d.isWebGLRenderTarget)){gt("WebGLRenderer.readRenderTargetPixels: renderTarget is not THREE.WebGLRenderTarget.");return}let j=je.get(d).__webglFramebuffer;if(d.isWebGLCubeRenderTarget&&J!==void 0&&(j=j[J],Array.isArray(j)&&(j=j[0])),j){Ne.bindFramebuffer(V.FRAMEBUFFER,j);try{let te=d.textures[X],fe=te.format,le=te.type;d.textures.length>1&&V.readBuffer(V.COLOR_ATTACHMENT0+X);let ce=m(te);if(ce.__formatReadable===!1){gt("WebGLRenderer.readRenderTargetPixels: renderTarget is not in RGBA or implementation defined format.");return}if(ce.__typeReadable===!1){gt("WebGLRenderer.readRenderTargetPixels: renderTarget is not in UnsignedByteType or implementation defined type.");return}v>=0&&v<=d.width-C&&A>=0&&A<=d.height-F&&V.readPixels(v,A,C,F,Pe.convert(fe),Pe.convert(le),L)}finally{let te=xe!==null?je.get(xe).__webglFramebuffer:null;Ne.bindFramebuffer(V.FRAMEBUFFER,te)}}},this.readRenderTargetPixelsAsync=async function(d,v,A,C,F,L,J,X=0){if(!(d&&d.isWebGLRenderTarget))throw new Error("THREE.WebGLRenderer.readRenderTargetPixels: renderTarget is not THREE.WebGLRenderTarget.");let j=je.get(d).__webglFramebuffer;if(d.isWebGLCubeRenderTarget&&J!==void 0&&(j=j[J],Array.isArray(j)&&(j=j[0])),j)if(v>=0&&v<=d.width-C&&A>=0&&A<=d.height-F){Ne.bindFramebuffer(V.FRAMEBUFFER,j);let te=d.textures[X],fe=te.format,le=te.type;d.textures.length>1&&V.readBuffer(V.COLOR_ATTACHMENT0+X);let ce=m(te);if(ce.__formatReadable===!1)throw new Error("THREE.WebGLRenderer.readRenderTargetPixelsAsync: renderTarget is not in RGBA or implementation defined format.");if(ce.__typeReadable===!1)throw new Error("THREE.WebGLRenderer.readRenderTargetPixelsAsync: renderTarget is not in UnsignedByteType or implementation defined type.");let be=V.createBuffer();V.bindBuffer(V.PIXEL_PACK_BUFFER,be),V.bufferData(V.PIXEL_PACK_BUFFER,L.byteLength,V.STREAM_READ),V.readPixels(v,A,C,F,Pe.convert(fe),Pe.convert(le),0),V.bindBuffer(V.PIXEL_PACK_BUFFER,null);let we=xe!==null?je.get(xe).__webglFramebuffer:null;Ne.bindFramebuffer(V.FRAMEBUFFER,we);let Ee=V.fenceSync(V.SYNC_GPU_COMMANDS_COMPLETE,0);return V.flush(),await H0(V,Ee,4),V.bindBuffer(V.PIXEL_PACK_BUFFER,be),V.getBufferSubData(V.PIXEL_PACK_BUFFER,0,L),V.bindBuffer(V.PIXEL_PACK_BUFFER,null),V.deleteBuffer(be),V.deleteSync(Ee),L}else throw new Error("THREE.WebGLRenderer.readRenderTargetPixelsAsync: requested read bounds are out of range.")},this.copyFramebufferToTexture=function(d,v=null,A=0){let C=Math.pow(2,-A),F=Math.floor(d.image.width*C),L=Math.floor(d.image.height*C),J=v!==null?v.x:0,X=v!==null?v.y:0;at.setTexture2D(d,0),V.copyTexSubImage2D(V.TEXTURE_2D,A,0,0,J,X,F,L),Ne.unbindTexture()},this.copyTextureToTexture=function(d,v,A=null,C=null,F=0,L=0){let J,X,j,te,fe,le,ce,be,we,Ee=d.isCompressedTexture?d.mipmaps[L]:d.image;if(A!==null)J=A.max.x-A.min.x,X=A.max.y-A.min.y,j=A.isBox3?A.max.z-A.min.z:1,te=A.min.x,fe=A.min.y,le=A.isBox3?A.min.z:0;else{let qe=Math.pow(2,-F);J=Math.floor(Ee.width*qe),X=Math.floor(Ee.height*qe),d.isDataArrayTexture?j=Ee.depth:d.isData3DTexture?j=Math.floor(Ee.depth*qe):j=1,te=0,fe=0,le=0}C!==null?(ce=C.x,be=C.y,we=C.z):(ce=0,be=0,we=0);let ze=Pe.convert(v.format),it=Pe.convert(v.type),ve;v.isData3DTexture?(at.setTexture3D(v,0),ve=V.TEXTURE_3D):v.isDataArrayTexture||v.isCompressedArrayTexture?(at.setTexture2DArray(v,0),ve=V.TEXTURE_2D_ARRAY):(at.setTexture2D(v,0),ve=V.TEXTURE_2D),Ne.activeTexture(V.TEXTURE0),Ne.pixelStorei(V.UNPACK_FLIP_Y_WEBGL,v.flipY),Ne.pixelStorei(V.UNPACK_PREMULTIPLY_ALPHA_WEBGL,v.premultiplyAlpha),Ne.pixelStorei(V.UNPACK_ALIGNMENT,v.unpackAlignment);let rt=Ne.getParameter(V.UNPACK_ROW_LENGTH),Re=Ne.getParameter(V.UNPACK_IMAGE_HEIGHT),Xe=Ne.getParameter(V.UNPACK_SKIP_PIXELS),Ve=Ne.getParameter(V.UNPACK_SKIP_ROWS),Nt=Ne.getParameter(V.UNPACK_SKIP_IMAGES);Ne.pixelStorei(V.UNPACK_ROW_LENGTH,Ee.width),Ne.pixelStorei(V.UNPACK_IMAGE_HEIGHT,Ee.height),Ne.pixelStorei(V.UNPACK_SKIP_PIXELS,te),Ne.pixelStorei(V.UNPACK_SKIP_ROWS,fe),Ne.pixelStorei(V.UNPACK_SKIP_IMAGES,le);let Et=d.isDataArrayTexture||d.isData3DTexture,ht=v.isDataArrayTexture||v.isData3DTexture;if(d.isDepthTexture){let qe=je.get(d),Tt=je.get(v),Kt=je.get(qe.__renderTarget),ot=je.get(Tt.__renderTarget);Ne.bindFramebuffer(V.READ_FRAMEBUFFER,Kt.__webglFramebuffer),Ne.bindFramebuffer(V.DRAW_FRAMEBUFFER,ot.__webglFramebuffer);for(let Bt=0;Bt<j;Bt++)Et&&(V.framebufferTextureLayer(V.READ_FRAMEBUFFER,V.COLOR_ATTACHMENT0,je.get(d).__webglTexture,F,le+Bt),V.framebufferTextureLayer(V.DRAW_FRAMEBUFFER,V.COLOR_ATTACHMENT0,je.get(v).__webglTexture,L,we+Bt)),V.blitFramebuffer(te,fe,te+J,fe+X,ce,be,ce+J,be+X,V.DEPTH_BUFFER_BIT,V.NEAREST);Ne.bindFramebuffer(V.READ_FRAMEBUFFER,null),Ne.bindFramebuffer(V.DRAW_FRAMEBUFFER,null)}else if(F!==0||d.isRenderTargetTexture||je.has(d)){let qe=je.get(d),Tt=je.get(v);Ne.bindFramebuffer(V.READ_FRAMEBUFFER,U),Ne.bindFramebuffer(V.DRAW_FRAMEBUFFER,W);for(let Kt=0;Kt<j;Kt++)Et?V.framebufferTextureLayer(V.READ_FRAMEBUFFER,V.COLOR_ATTACHMENT0,qe.__webglTexture,F,le+Kt):V.framebufferTexture2D(V.READ_FRAMEBUFFER,V.COLOR_ATTACHMENT0,V.TEXTURE_2D,qe.__webglTexture,F),ht?V.framebufferTextureLayer(V.DRAW_FRAMEBUFFER,V.COLOR_ATTACHMENT0,Tt.__webglTexture,L,we+Kt):V.framebufferTexture2D(V.DRAW_FRAMEBUFFER,V.COLOR_ATTACHMENT0,V.TEXTURE_2D,Tt.__webglTexture,L),F!==0?V.blitFramebuffer(te,fe,te+J,fe+X,ce,be,ce+J,be+X,V.COLOR_BUFFER_BIT,V.NEAREST):ht?V.copyTexSubImage3D(ve,L,ce,be,we+Kt,te,fe,J,X):V.copyTexSubImage2D(ve,L,ce,be,te,fe,J,X);Ne.bindFramebuffer(V.READ_FRAMEBUFFER,null),Ne.bindFramebuffer(V.DRAW_FRAMEBUFFER,null)}else ht?d.isDataTexture||d.isData3DTexture?V.texSubImage3D(ve,L,ce,be,we,J,X,j,ze,it,Ee.data):v.isCompressedArrayTexture?V.compressedTexSubImage3D(ve,L,ce,be,we,J,X,j,ze,Ee.data):V.texSubImage3D(ve,L,ce,be,we,J,X,j,ze,it,Ee):d.isDataTexture?V.texSubImage2D(V.TEXTURE_2D,L,ce,be,J,X,ze,it,Ee.data):d.isCompressedTexture?V.compressedTexSubImage2D(V.TEXTURE_2D,L,ce,be,Ee.width,Ee.height,ze,Ee.data):V.texSubImage2D(V.TEXTURE_2D,L,ce,be,J,X,ze,it,Ee);Ne.pixelStorei(V.UNPACK_ROW_LENGTH,rt),Ne.pixelStorei(V.UNPACK_IMAGE_HEIGHT,Re),Ne.pixelStorei(V.UNPACK_SKIP_PIXELS,Xe),Ne.pixelStorei(V.UNPACK_SKIP_ROWS,Ve),Ne.pixelStorei(V.UNPACK_SKIP_IMAGES,Nt),L===0&&v.generateMipmaps===!0&&v.mipmapsAutoUpdate===!0&&V.generateMipmap(ve),Ne.unbindTexture()},this.initRenderTarget=function(d){je.get(d).__webglFramebuffer===void 0&&at.setupRenderTarget(d)},this.initTexture=function(d){d.isCubeTexture?at.setTextureCube(d,0):d.isData3DTexture?at.setTexture3D(d,0):d.isDataArrayTexture||d.isCompressedArrayTexture?at.setTexture2DArray(d,0):at.setTexture2D(d,0),Ne.unbindTexture()},this.resetState=function(){$=0,q=0,xe=null,Ne.reset(),Fe.reset()},typeof __THREE_DEVTOOLS__<"u"&&__THREE_DEVTOOLS__.dispatchEvent(new CustomEvent("observe",{detail:this}))}get coordinateSystem(){return Gi}get outputColorSpace(){return this._outputColorSpace}set outputColorSpace(e){this._outputColorSpace=e;let t=this.getContext();t.drawingBufferColorSpace=Ct._getDrawingBufferColorSpace(e),t.unpackColorSpace=Ct._getUnpackColorSpace()}};function Pl(i,e,t){let n=new ys(new Uint16Array(i),e,t,un,hn);return n.minFilter=n.magFilter=Xt,n.needsUpdate=!0,n}function jh(i){return i.mapping=oa,i.flipY=!0,i}function Qh(i){let e=Math.min(Math.max(i,0),1);return e<=.0031308?12.92*e:1.055*e**(1/2.4)-.055}var Ud=["shaded","albedo","roughness","metallic","normals","occlusion"],pE=`
if (channel == 1) gl_FragColor = sRGBTransferOETF(vec4(diffuseColor.rgb, 1.0));
if (channel == 2) gl_FragColor = vec4(vec3(roughnessFactor), 1.0);
if (channel == 3) gl_FragColor = vec4(vec3(metalnessFactor), 1.0);
if (channel == 4) gl_FragColor = vec4(0.5 * (inverse(mat3(viewMatrix)) * normal) + 0.5, 1.0);
#ifndef USE_AOMAP
float ambientOcclusion = 1.0;
#endif
if (channel == 5) gl_FragColor = vec4(vec3(ambientOcclusion), 1.0);
`,mE=`
if (unfolded) gl_Position = vec4((vec2(2.0, -2.0) * uv + vec2(-1.0, 1.0)) * stretch, 0.0, 1.0);
`,gE=i=>At[i].replaceAll("gl_FrontFacing","(gl_FrontFacing != unfolded)");function E_(i,e){if(!i.isMeshStandardMaterial){let{map:t,color:n,side:s,vertexColors:r}=i;i=new Ys({map:t,color:n,side:s,vertexColors:r,metalness:0})}return i.onBeforeCompile=t=>{Object.assign(t.uniforms,e),t.vertexShader=t.vertexShader.replace("#include <common>",`#include <common>
uniform bool unfolded;
uniform vec2 stretch;`).replace("#include <project_vertex>",`#include <project_vertex>
${mE}`),t.fragmentShader=t.fragmentShader.replace("#include <common>",`#include <common>
uniform int channel;
uniform bool unfolded;`).replace("#include <normal_fragment_begin>",gE("normal_fragment_begin")).replace("#include <colorspace_fragment>",`#include <colorspace_fragment>
${pE}`)},i}var _E={none:"none",neutral:"neutral",agx:"AgX"},eu=Math.PI/36,xE={channel:["1 – 6","what is shown"],unfolded:["u","as textures"],wireframe:["w","wireframe"],turn:["[ ]","turn the light"],exposure:[", .","darker, brighter"],tone:["t","tone mapping"],ground:["g","ground shadow"],background:["b","light as background"],spin:["a","turn about the object"],home:["r","front view"],save:["s","save picture"],full:["x","full screen"],"":["← → ↑ ↓ + −","turn the object; nearer, farther"]},nr=(i,e,t=!1)=>We("label",{class:"check"},We("input",{type:"checkbox",name:i,checked:t}),` ${e}`),Dl=(i,e,t=[])=>We("label",{},`${e} `,We("select",{name:i},...t.map(([n,s])=>new Option(s,n)))),Ll=(i,e,{min:t,max:n,step:s,value:r=0,unit:o=""})=>We("label",{},`${e} `,We("output",{"data-unit":o}),We("input",{type:"range",name:i,min:t,max:n,step:s,value:r})),Od=(i,e)=>We("button",{type:"button",name:i},e);function tu(i){for(let e of i.querySelectorAll("label > output"))e.value=`${e.nextSibling.value}${e.dataset.unit}`}function Fd(i,e){let t=()=>{tu(i),e()};i.addEventListener("input",t),i.addEventListener("dblclick",({target:n})=>{n.type==="range"&&(n.value=n.defaultValue,t())})}var da=class{constructor(e,t,{changed:n,first:s=[],lights:r=[],last:o=[],keys:a={},name:l="asset"}){Object.assign(this,{form:e,viewer:t,changed:n});let c=Ud.map((x,M)=>We("label",{},We("input",{type:"radio",name:"channel",value:M,checked:M===0}),We("span",{},x)));this.lit=We("fieldset",{},...s,Dl("light","Light"),...r,Ll("turn","Turn the light",{min:-180,max:180,step:1,unit:"°"}),Ll("exposure","Exposure",{min:-6,max:6,step:.1,unit:" EV"}),Dl("tone","Tone mapping",Object.entries(_E)),nr("ground","Ground shadow",!0),nr("background","Light as background"),Ll("blur","Blur of the background",{min:0,max:1,step:.05,value:.3}));let h={...xE,...a};e.classList.add("controls"),e.append(We("fieldset",{class:"pills","aria-label":"What is shown"},...c),We("div",{class:"pair"},nr("wireframe","Wireframe"),nr("unfolded","As textures"),nr("spin","Turntable")),this.lit,...o,We("div",{class:"pair"},Od("home","Front view"),Od("save","Save picture"),Od("full","Full screen")),We("details",{},We("summary",{},"Keys"),We("dl",{},...Object.values(h).flatMap(([x,M])=>[We("dt",{},x),We("dd",{},M)]))));for(let x of e.querySelectorAll("[name]")){let M=h[x.name],g=x.type==="range"?"; a double click resets it":"";M&&((x.closest("label")??x).title=`${M[1]} (${M[0]})${g}`)}Fd(e,()=>this.tell()),e.addEventListener("submit",x=>x.preventDefault());let{home:u,save:f,full:p}=e.elements;u.addEventListener("click",()=>t.home()),f.addEventListener("click",()=>t.save(l)),p.addEventListener("click",()=>this.fullScreen())}get values(){let e={};for(let t of this.form.querySelectorAll("[name]"))t.type==="checkbox"?e[t.name]=t.checked:t.type==="range"?e[t.name]=Number(t.value):(t.type!=="radio"||t.checked)&&(e[t.name]=t.value);return{...e,channel:Number(e.channel)}}setLights(e,t){let{light:n}=this.form.elements;n.replaceChildren(...e.map(([s,r])=>new Option(r,s))),t!==void 0&&(n.value=t)}tell(){tu(this.form);let{values:e}=this;this.lit.disabled=e.channel!==0,this.changed(e)}write(e,t){e.matches(":disabled")||(e[e.type==="checkbox"||e.type==="radio"?"checked":"value"]=t,this.tell())}fullScreen(){document.fullscreenElement?document.exitFullscreen():this.form.parentElement.requestFullscreen()}step(e,t){let n=this.form.elements[e];if(n.options)return this.write(n,n.options[(n.selectedIndex+t+n.options.length)%n.options.length].value);let s=Number(n.value)+t*Number(n.step),r=n.max-n.min;this.write(n,e==="turn"?s-r*Math.round(s/r):s)}toggle(e){let t=this.form.elements[e];this.write(t,!t.checked)}listen(e,t={}){let{viewer:n}=this,{channel:s,save:r}=this.form.elements,o=(h,u)=>()=>this.step(h,u),a=h=>()=>this.toggle(h),l=()=>n.move(0,0,.9),c={...Object.fromEntries(Ud.map((h,u)=>[String(u+1),()=>this.write(s[u],!0)])),ArrowLeft:()=>n.move(-eu,0),ArrowRight:()=>n.move(eu,0),ArrowUp:()=>n.move(0,eu),ArrowDown:()=>n.move(0,-eu),"+":l,"=":l,"-":()=>n.move(0,0,1/.9),"[":o("turn",-5),"]":o("turn",5),",":o("exposure",-5),".":o("exposure",5),t:o("tone",1),b:a("background"),g:a("ground"),a:a("spin"),u:a("unfolded"),w:a("wireframe"),r:()=>n.home(),s:()=>r.click(),x:()=>this.fullScreen(),...t};e.addEventListener("keydown",h=>{if(h.ctrlKey||h.metaKey||h.altKey||h.target.matches?.("select")||h.target.matches?.("input")&&h.key.startsWith("Arrow"))return;let u=c[h.key];u&&(h.preventDefault(),u())})}};async function T_(i,{lights:e}){if(!e.length)return!1;let t=await Promise.all(e.map(async h=>new Bd(h,new Uint16Array(await Aa(h.packed))))),n={stops:0,own:!0},s=()=>{for(let h of t)h.draw((n.own?h.white:t[0].white)/2**n.stops)},r=We("p",{class:"said"}),o=(h,u)=>{let[f,p]=Xl(h.canvas,u),x=t.map(M=>`${M.name} ${M.at(f,p).map(g=>Is(g)).join(" ")}`);r.textContent=`azimuth ${Math.round(360*(.5-f))}°, elevation ${Math.round(90-180*p)}°: ${x.join(" · ")}`;for(let M of t)M.mark(f,p)},a=()=>{r.textContent="Radiance under the pointer: red, green, blue.";for(let h of t)h.mark(null)};for(let h of t)h.canvas.addEventListener("pointermove",u=>o(h,u)),h.canvas.addEventListener("pointerleave",a);a();let l=We("div",{class:"toolbar"}),c=Ll("exposure","Exposure",{min:-10,max:10,step:.25,unit:" EV"});return Fd(l,()=>{n.stops=Number(c.querySelector("input").value),s()}),l.classList.add("controls"),l.append(c),t.length>1&&l.append(Ta("White",["each by its own mean",`all as the ${e[0].name}`],h=>{n.own=h===0,s()})),tu(l),i.querySelector(".lights").after(l,We("div",{class:"cards lights widget"},...t.map(h=>h.figure)),r),!0}var Bd=class{constructor({name:e,white:t,width:n,height:s},r){Object.assign(this,{name:e,white:t,width:n,height:s}),this.radiance=Float32Array.from(r,Le.fromHalfFloat),this.canvas=We("canvas",{width:n,height:s,role:"img","aria-label":e}),this.cross=We("i",{class:"cross",hidden:!0}),this.limit=We("span");let o=We("figcaption",{},`${e}; white is a radiance of `,this.limit);this.figure=We("figure",{class:"card"},We("div",{class:"sky"},this.canvas,this.cross),o)}draw(e){this.limit.textContent=Is(e);let t=new ImageData(this.width,this.height);for(let n=0;n<this.radiance.length;n++)t.data[n]=n%4===3?255:Math.round(255*Qh(this.radiance[n]/e));this.canvas.getContext("2d").putImageData(t,0,0)}at(e,t){let n=4*(Math.floor(t*this.height)*this.width+Math.floor(e*this.width));return[...this.radiance.subarray(n,n+3)]}mark(e,t){this.cross.hidden=e===null,e!==null&&Object.assign(this.cross.style,{left:`${100*e}%`,top:`${100*t}%`})}};function nu(i){let e=We("div",{id:"drop",hidden:!0},"Drop an .hdr or .exr: it becomes the light");document.body.append(e);let t=0,n=s=>{t=Math.max(0,t+s),e.hidden=t===0};addEventListener("dragenter",s=>{s.preventDefault(),n(1)}),addEventListener("dragleave",()=>n(-1)),addEventListener("dragover",s=>s.preventDefault()),addEventListener("drop",s=>{s.preventDefault(),n(-t),s.dataTransfer.files.length&&i(s.dataTransfer.files[0])})}function iu(i){let e=We("input",{type:"file",accept:".hdr,.exr",hidden:!0,onchange:()=>e.files.length&&i(e.files[0])}),t=We("button",{type:"button",onclick:()=>e.click()},"open one");return[We("p",{class:"hint"},"or drop an .hdr or .exr anywhere, or ",t),e]}var A_={type:"change"},zd={type:"start"},C_={type:"end"},su=new Ws,R_=new Li,vE=Math.cos(70*ha.DEG2RAD),kn=new Q,Si=2*Math.PI,Ht={NONE:-1,ROTATE:0,DOLLY:1,PAN:2,TOUCH_ROTATE:3,TOUCH_PAN:4,TOUCH_DOLLY_PAN:5,TOUCH_DOLLY_ROTATE:6},kd=1e-6,ru=class extends pl{constructor(e,t=null){super(e,t),this.state=Ht.NONE,this.target=new Q,this.cursor=new Q,this.minDistance=0,this.maxDistance=1/0,this.minZoom=0,this.maxZoom=1/0,this.minTargetRadius=0,this.maxTargetRadius=1/0,this.minPolarAngle=0,this.maxPolarAngle=Math.PI,this.minAzimuthAngle=-1/0,this.maxAzimuthAngle=1/0,this.enableDamping=!1,this.dampingFactor=.05,this.enableZoom=!0,this.zoomSpeed=1,this.enableRotate=!0,this.rotateSpeed=1,this.keyRotateSpeed=1,this.enablePan=!0,this.panSpeed=1,this.screenSpacePanning=!0,this.keyPanSpeed=7,this.zoomToCursor=!1,this.autoRotate=!1,this.autoRotateSpeed=2,this.keys={LEFT:"ArrowLeft",UP:"ArrowUp",RIGHT:"ArrowRight",BOTTOM:"ArrowDown"},this.mouseButtons={LEFT:Ar.ROTATE,MIDDLE:Ar.DOLLY,RIGHT:Ar.PAN},this.touches={ONE:Rr.ROTATE,TWO:Rr.DOLLY_PAN},this.target0=this.target.clone(),this.position0=this.object.position.clone(),this.zoom0=this.object.zoom,this._cursorStyle="auto",this._domElementKeyEvents=null,this._lastPosition=new Q,this._lastQuaternion=new qn,this._lastTargetPosition=new Q,this._quat=new qn().setFromUnitVectors(e.up,new Q(0,1,0)),this._quatInverse=this._quat.clone().invert(),this._spherical=new Tr,this._sphericalDelta=new Tr,this._scale=1,this._panOffset=new Q,this._rotateStart=new lt,this._rotateEnd=new lt,this._rotateDelta=new lt,this._panStart=new lt,this._panEnd=new lt,this._panDelta=new lt,this._dollyStart=new lt,this._dollyEnd=new lt,this._dollyDelta=new lt,this._dollyDirection=new Q,this._mouse=new lt,this._performCursorZoom=!1,this._pointers=[],this._pointerPositions={},this._controlActive=!1,this._onPointerMove=SE.bind(this),this._onPointerDown=yE.bind(this),this._onPointerUp=ME.bind(this),this._onContextMenu=CE.bind(this),this._onMouseWheel=EE.bind(this),this._onKeyDown=TE.bind(this),this._onTouchStart=AE.bind(this),this._onTouchMove=RE.bind(this),this._onMouseDown=bE.bind(this),this._onMouseMove=wE.bind(this),this._interceptControlDown=IE.bind(this),this._interceptControlUp=PE.bind(this),this.domElement!==null&&this.connect(this.domElement),this.update()}set cursorStyle(e){this._cursorStyle=e,e==="grab"?this.domElement.style.cursor="grab":this.domElement.style.cursor="auto"}get cursorStyle(){return this._cursorStyle}connect(e){super.connect(e),this.domElement.addEventListener("pointerdown",this._onPointerDown),this.domElement.addEventListener("pointercancel",this._onPointerUp),this.domElement.addEventListener("contextmenu",this._onContextMenu),this.domElement.addEventListener("wheel",this._onMouseWheel,{passive:!1}),this.domElement.ownerDocument.addEventListener("keydown",this._interceptControlDown,{passive:!0,capture:!0}),this.domElement.style.touchAction="none"}disconnect(){this.state=Ht.NONE,this.domElement.removeEventListener("pointerdown",this._onPointerDown),this.domElement.ownerDocument.removeEventListener("pointermove",this._onPointerMove),this.domElement.ownerDocument.removeEventListener("pointerup",this._onPointerUp),this.domElement.removeEventListener("pointercancel",this._onPointerUp),this.domElement.removeEventListener("wheel",this._onMouseWheel),this.domElement.removeEventListener("contextmenu",this._onContextMenu),this.stopListenToKeyEvents(),this.domElement.ownerDocument.removeEventListener("keydown",this._interceptControlDown,{capture:!0}),this.domElement.ownerDocument.removeEventListener("keyup",this._interceptControlUp,{capture:!0}),this._controlActive=!1,this._pointers.length=0,this._pointerPositions={},this.domElement.style.touchAction="",this.domElement.style.cursor="auto"}dispose(){this.disconnect()}getPolarAngle(){return this._spherical.phi}getAzimuthalAngle(){return this._spherical.theta}getDistance(){return this.object.position.distanceTo(this.target)}listenToKeyEvents(e){e.addEventListener("keydown",this._onKeyDown),this._domElementKeyEvents=e}stopListenToKeyEvents(){this._domElementKeyEvents!==null&&(this._domElementKeyEvents.removeEventListener("keydown",this._onKeyDown),this._domElementKeyEvents=null)}saveState(){this.target0.copy(this.target),this.position0.copy(this.object.position),this.zoom0=this.object.zoom}reset(){this.target.copy(this.target0),this.object.position.copy(this.position0),this.object.zoom=this.zoom0,this.object.updateProjectionMatrix(),this.dispatchEvent(A_),this.update(),this.state=Ht.NONE}pan(e,t){this._pan(e,t),this.update()}dollyIn(e){this._dollyIn(e),this.update()}dollyOut(e){this._dollyOut(e),this.update()}rotateLeft(e){this._rotateLeft(e),this.update()}rotateUp(e){this._rotateUp(e),this.update()}update(e=null){let t=this.object.position;kn.copy(t).sub(this.target),kn.applyQuaternion(this._quat),this._spherical.setFromVector3(kn),this.autoRotate&&this.state===Ht.NONE&&this._rotateLeft(this._getAutoRotationAngle(e)),this.enableDamping?(this._spherical.theta+=this._sphericalDelta.theta*this.dampingFactor,this._spherical.phi+=this._sphericalDelta.phi*this.dampingFactor):(this._spherical.theta+=this._sphericalDelta.theta,this._spherical.phi+=this._sphericalDelta.phi);let n=this.minAzimuthAngle,s=this.maxAzimuthAngle;isFinite(n)&&isFinite(s)&&(n<-Math.PI?n+=Si:n>Math.PI&&(n-=Si),s<-Math.PI?s+=Si:s>Math.PI&&(s-=Si),n<=s?this._spherical.theta=Math.max(n,Math.min(s,this._spherical.theta)):this._spherical.theta=this._spherical.theta>(n+s)/2?Math.max(n,this._spherical.theta):Math.min(s,this._spherical.theta)),this._spherical.phi=Math.max(this.minPolarAngle,Math.min(this.maxPolarAngle,this._spherical.phi)),this._spherical.makeSafe(),this.enableDamping===!0?this.target.addScaledVector(this._panOffset,this.dampingFactor):this.target.add(this._panOffset),this.target.sub(this.cursor),this.target.clampLength(this.minTargetRadius,this.maxTargetRadius),this.target.add(this.cursor);let r=!1;if(this.zoomToCursor&&this._performCursorZoom||this.object.isOrthographicCamera)this._spherical.radius=this._clampDistance(this._spherical.radius);else{let o=this._spherical.radius;this._spherical.radius=this._clampDistance(this._spherical.radius*this._scale),r=o!=this._spherical.radius}if(kn.setFromSpherical(this._spherical),kn.applyQuaternion(this._quatInverse),t.copy(this.target).add(kn),this.object.lookAt(this.target),this.enableDamping===!0?(this._sphericalDelta.theta*=1-this.dampingFactor,this._sphericalDelta.phi*=1-this.dampingFactor,this._panOffset.multiplyScalar(1-this.dampingFactor)):(this._sphericalDelta.set(0,0,0),this._panOffset.set(0,0,0)),this.zoomToCursor&&this._performCursorZoom){let o=null;if(this.object.isPerspectiveCamera){let a=kn.length();o=this._clampDistance(a*this._scale);let l=a-o;this.object.position.addScaledVector(this._dollyDirection,l),this.object.updateMatrixWorld(),r=!!l}else if(this.object.isOrthographicCamera){let a=new Q(this._mouse.x,this._mouse.y,0);a.unproject(this.object);let l=this.object.zoom;this.object.zoom=Math.max(this.minZoom,Math.min(this.maxZoom,this.object.zoom/this._scale)),this.object.updateProjectionMatrix(),r=l!==this.object.zoom;let c=new Q(this._mouse.x,this._mouse.y,0);c.unproject(this.object),this.object.position.sub(c).add(a),this.object.updateMatrixWorld(),o=kn.length()}else console.warn("WARNING: OrbitControls.js encountered an unknown camera type - zoom to cursor disabled."),this.zoomToCursor=!1;o!==null&&(this.screenSpacePanning?this.target.set(0,0,-1).transformDirection(this.object.matrix).multiplyScalar(o).add(this.object.position):(su.origin.copy(this.object.position),su.direction.set(0,0,-1).transformDirection(this.object.matrix),Math.abs(this.object.up.dot(su.direction))<vE?this.object.lookAt(this.target):(R_.setFromNormalAndCoplanarPoint(this.object.up,this.target),su.intersectPlane(R_,this.target))))}else if(this.object.isOrthographicCamera){let o=this.object.zoom;this.object.zoom=Math.max(this.minZoom,Math.min(this.maxZoom,this.object.zoom/this._scale)),o!==this.object.zoom&&(this.object.updateProjectionMatrix(),r=!0)}return this._scale=1,this._performCursorZoom=!1,r||this._lastPosition.distanceToSquared(this.object.position)>kd||8*(1-this._lastQuaternion.dot(this.object.quaternion))>kd||this._lastTargetPosition.distanceToSquared(this.target)>kd?(this.dispatchEvent(A_),this._lastPosition.copy(this.object.position),this._lastQuaternion.copy(this.object.quaternion),this._lastTargetPosition.copy(this.target),!0):!1}_getAutoRotationAngle(e){return e!==null?Si/60*this.autoRotateSpeed*e:Si/60/60*this.autoRotateSpeed}_getZoomScale(e){let t=Math.abs(e*.01);return Math.pow(.95,this.zoomSpeed*t)}_rotateLeft(e){this._sphericalDelta.theta-=e}_rotateUp(e){this._sphericalDelta.phi-=e}_panLeft(e,t){kn.setFromMatrixColumn(t,0),kn.multiplyScalar(-e),this._panOffset.add(kn)}_panUp(e,t){this.screenSpacePanning===!0?kn.setFromMatrixColumn(t,1):(kn.setFromMatrixColumn(t,0),kn.crossVectors(this.object.up,kn)),kn.multiplyScalar(e),this._panOffset.add(kn)}_pan(e,t){let n=this.domElement;if(this.object.isPerspectiveCamera){let s=this.object.position;kn.copy(s).sub(this.target);let r=kn.length();r*=Math.tan(this.object.fov/2*Math.PI/180),this._panLeft(2*e*r/n.clientHeight,this.object.matrix),this._panUp(2*t*r/n.clientHeight,this.object.matrix)}else this.object.isOrthographicCamera?(this._panLeft(e*(this.object.right-this.object.left)/this.object.zoom/n.clientWidth,this.object.matrix),this._panUp(t*(this.object.top-this.object.bottom)/this.object.zoom/n.clientHeight,this.object.matrix)):(console.warn("WARNING: OrbitControls.js encountered an unknown camera type - pan disabled."),this.enablePan=!1)}_dollyOut(e){this.object.isPerspectiveCamera||this.object.isOrthographicCamera?this._scale/=e:(console.warn("WARNING: OrbitControls.js encountered an unknown camera type - dolly/zoom disabled."),this.enableZoom=!1)}_dollyIn(e){this.object.isPerspectiveCamera||this.object.isOrthographicCamera?this._scale*=e:(console.warn("WARNING: OrbitControls.js encountered an unknown camera type - dolly/zoom disabled."),this.enableZoom=!1)}_updateZoomParameters(e,t){if(!this.zoomToCursor)return;this._performCursorZoom=!0;let n=this.domElement.getBoundingClientRect(),s=e-n.left,r=t-n.top,o=n.width,a=n.height;this._mouse.x=s/o*2-1,this._mouse.y=-(r/a)*2+1,this._dollyDirection.set(this._mouse.x,this._mouse.y,1).unproject(this.object).sub(this.object.position).normalize()}_clampDistance(e){return Math.max(this.minDistance,Math.min(this.maxDistance,e))}_handleMouseDownRotate(e){this._rotateStart.set(e.clientX,e.clientY)}_handleMouseDownDolly(e){this._updateZoomParameters(e.clientX,e.clientY),this._dollyStart.set(e.clientX,e.clientY)}_handleMouseDownPan(e){this._panStart.set(e.clientX,e.clientY)}_handleMouseMoveRotate(e){this._rotateEnd.set(e.clientX,e.clientY),this._rotateDelta.subVectors(this._rotateEnd,this._rotateStart).multiplyScalar(this.rotateSpeed);let t=this.domElement;this._rotateLeft(Si*this._rotateDelta.x/t.clientHeight),this._rotateUp(Si*this._rotateDelta.y/t.clientHeight),this._rotateStart.copy(this._rotateEnd),this.update()}_handleMouseMoveDolly(e){this._dollyEnd.set(e.clientX,e.clientY),this._dollyDelta.subVectors(this._dollyEnd,this._dollyStart),this._dollyDelta.y>0?this._dollyOut(this._getZoomScale(this._dollyDelta.y)):this._dollyDelta.y<0&&this._dollyIn(this._getZoomScale(this._dollyDelta.y)),this._dollyStart.copy(this._dollyEnd),this.zoomToCursor&&(this._performCursorZoom=!0,this._dollyDirection.set(this._mouse.x,this._mouse.y,1).unproject(this.object).sub(this.object.position).normalize()),this.update()}_handleMouseMovePan(e){this._panEnd.set(e.clientX,e.clientY),this._panDelta.subVectors(this._panEnd,this._panStart).multiplyScalar(this.panSpeed),this._pan(this._panDelta.x,this._panDelta.y),this._panStart.copy(this._panEnd),this.update()}_handleMouseWheel(e){this._updateZoomParameters(e.clientX,e.clientY),e.deltaY<0?this._dollyIn(this._getZoomScale(e.deltaY)):e.deltaY>0&&this._dollyOut(this._getZoomScale(e.deltaY)),this.update()}_handleKeyDown(e){let t=!1;switch(e.code){case this.keys.UP:e.ctrlKey||e.metaKey||e.shiftKey?this.enableRotate&&this._rotateUp(Si*this.keyRotateSpeed/this.domElement.clientHeight):this.enablePan&&this._pan(0,this.keyPanSpeed),t=!0;break;case this.keys.BOTTOM:e.ctrlKey||e.metaKey||e.shiftKey?this.enableRotate&&this._rotateUp(-Si*this.keyRotateSpeed/this.domElement.clientHeight):this.enablePan&&this._pan(0,-this.keyPanSpeed),t=!0;break;case this.keys.LEFT:e.ctrlKey||e.metaKey||e.shiftKey?this.enableRotate&&this._rotateLeft(Si*this.keyRotateSpeed/this.domElement.clientHeight):this.enablePan&&this._pan(this.keyPanSpeed,0),t=!0;break;case this.keys.RIGHT:e.ctrlKey||e.metaKey||e.shiftKey?this.enableRotate&&this._rotateLeft(-Si*this.keyRotateSpeed/this.domElement.clientHeight):this.enablePan&&this._pan(-this.keyPanSpeed,0),t=!0;break}t&&(e.preventDefault(),this.update())}_handleTouchStartRotate(e){if(this._pointers.length===1)this._rotateStart.set(e.pageX,e.pageY);else{let t=this._getSecondPointerPosition(e),n=.5*(e.pageX+t.x),s=.5*(e.pageY+t.y);this._rotateStart.set(n,s)}}_handleTouchStartPan(e){if(this._pointers.length===1)this._panStart.set(e.pageX,e.pageY);else{let t=this._getSecondPointerPosition(e),n=.5*(e.pageX+t.x),s=.5*(e.pageY+t.y);this._panStart.set(n,s)}}_handleTouchStartDolly(e){let t=this._getSecondPointerPosition(e),n=e.pageX-t.x,s=e.pageY-t.y,r=Math.sqrt(n*n+s*s);this._dollyStart.set(0,r)}_handleTouchStartDollyPan(e){this.enableZoom&&this._handleTouchStartDolly(e),this.enablePan&&this._handleTouchStartPan(e)}_handleTouchStartDollyRotate(e){this.enableZoom&&this._handleTouchStartDolly(e),this.enableRotate&&this._handleTouchStartRotate(e)}_handleTouchMoveRotate(e){if(this._pointers.length==1)this._rotateEnd.set(e.pageX,e.pageY);else{let n=this._getSecondPointerPosition(e),s=.5*(e.pageX+n.x),r=.5*(e.pageY+n.y);this._rotateEnd.set(s,r)}this._rotateDelta.subVectors(this._rotateEnd,this._rotateStart).multiplyScalar(this.rotateSpeed);let t=this.domElement;this._rotateLeft(Si*this._rotateDelta.x/t.clientHeight),this._rotateUp(Si*this._rotateDelta.y/t.clientHeight),this._rotateStart.copy(this._rotateEnd)}_handleTouchMovePan(e){if(this._pointers.length===1)this._panEnd.set(e.pageX,e.pageY);else{let t=this._getSecondPointerPosition(e),n=.5*(e.pageX+t.x),s=.5*(e.pageY+t.y);this._panEnd.set(n,s)}this._panDelta.subVectors(this._panEnd,this._panStart).multiplyScalar(this.panSpeed),this._pan(this._panDelta.x,this._panDelta.y),this._panStart.copy(this._panEnd)}_handleTouchMoveDolly(e){let t=this._getSecondPointerPosition(e),n=e.pageX-t.x,s=e.pageY-t.y,r=Math.sqrt(n*n+s*s);this._dollyEnd.set(0,r),this._dollyDelta.set(0,Math.pow(this._dollyEnd.y/this._dollyStart.y,this.zoomSpeed)),this._dollyOut(this._dollyDelta.y),this._dollyStart.copy(this._dollyEnd);let o=(e.pageX+t.x)*.5,a=(e.pageY+t.y)*.5;this._updateZoomParameters(o,a)}_handleTouchMoveDollyPan(e){this.enableZoom&&this._handleTouchMoveDolly(e),this.enablePan&&this._handleTouchMovePan(e)}_handleTouchMoveDollyRotate(e){this.enableZoom&&this._handleTouchMoveDolly(e),this.enableRotate&&this._handleTouchMoveRotate(e)}_addPointer(e){this._pointers.push(e.pointerId)}_removePointer(e){delete this._pointerPositions[e.pointerId];for(let t=0;t<this._pointers.length;t++)if(this._pointers[t]==e.pointerId){this._pointers.splice(t,1);return}}_isTrackingPointer(e){for(let t=0;t<this._pointers.length;t++)if(this._pointers[t]==e.pointerId)return!0;return!1}_trackPointer(e){let t=this._pointerPositions[e.pointerId];t===void 0&&(t=new lt,this._pointerPositions[e.pointerId]=t),t.set(e.pageX,e.pageY)}_getSecondPointerPosition(e){let t=e.pointerId===this._pointers[0]?this._pointers[1]:this._pointers[0];return this._pointerPositions[t]}_customWheelEvent(e){let t=e.deltaMode,n={clientX:e.clientX,clientY:e.clientY,deltaY:e.deltaY};switch(t){case 1:n.deltaY*=16;break;case 2:n.deltaY*=100;break}return e.ctrlKey&&!this._controlActive&&(n.deltaY*=10),n}};function yE(i){this.enabled!==!1&&(this._pointers.length===0&&(this.domElement.setPointerCapture(i.pointerId),this.domElement.ownerDocument.addEventListener("pointermove",this._onPointerMove),this.domElement.ownerDocument.addEventListener("pointerup",this._onPointerUp)),!this._isTrackingPointer(i)&&(this._addPointer(i),i.pointerType==="touch"?this._onTouchStart(i):this._onMouseDown(i),this._cursorStyle==="grab"&&(this.domElement.style.cursor="grabbing")))}function SE(i){this.enabled!==!1&&(i.pointerType==="touch"?this._onTouchMove(i):this._onMouseMove(i))}function ME(i){switch(this._removePointer(i),this._pointers.length){case 0:this.domElement.releasePointerCapture(i.pointerId),this.domElement.ownerDocument.removeEventListener("pointermove",this._onPointerMove),this.domElement.ownerDocument.removeEventListener("pointerup",this._onPointerUp),this.dispatchEvent(C_),this.state=Ht.NONE,this._cursorStyle==="grab"&&(this.domElement.style.cursor="grab");break;case 1:let e=this._pointers[0],t=this._pointerPositions[e];this._onTouchStart({pointerId:e,pageX:t.x,pageY:t.y});break}}function bE(i){let e;switch(i.button){case 0:e=this.mouseButtons.LEFT;break;case 1:e=this.mouseButtons.MIDDLE;break;case 2:e=this.mouseButtons.RIGHT;break;default:e=-1}switch(e){case Ar.DOLLY:if(this.enableZoom===!1)return;this._handleMouseDownDolly(i),this.state=Ht.DOLLY;break;case Ar.ROTATE:if(i.ctrlKey||i.metaKey||i.shiftKey){if(this.enablePan===!1)return;this._handleMouseDownPan(i),this.state=Ht.PAN}else{if(this.enableRotate===!1)return;this._handleMouseDownRotate(i),this.state=Ht.ROTATE}break;case Ar.PAN:if(i.ctrlKey||i.metaKey||i.shiftKey){if(this.enableRotate===!1)return;this._handleMouseDownRotate(i),this.state=Ht.ROTATE}else{if(this.enablePan===!1)return;this._handleMouseDownPan(i),this.state=Ht.PAN}break;default:this.state=Ht.NONE}this.state!==Ht.NONE&&this.dispatchEvent(zd)}function wE(i){switch(this.state){case Ht.ROTATE:if(this.enableRotate===!1)return;this._handleMouseMoveRotate(i);break;case Ht.DOLLY:if(this.enableZoom===!1)return;this._handleMouseMoveDolly(i);break;case Ht.PAN:if(this.enablePan===!1)return;this._handleMouseMovePan(i);break}}function EE(i){this.enabled===!1||this.enableZoom===!1||this.state!==Ht.NONE||(i.preventDefault(),this.dispatchEvent(zd),this._handleMouseWheel(this._customWheelEvent(i)),this.dispatchEvent(C_))}function TE(i){this.enabled!==!1&&this._handleKeyDown(i)}function AE(i){switch(this._trackPointer(i),this._pointers.length){case 1:switch(this.touches.ONE){case Rr.ROTATE:if(this.enableRotate===!1){this.state=Ht.NONE;break}this._handleTouchStartRotate(i),this.state=Ht.TOUCH_ROTATE;break;case Rr.PAN:if(this.enablePan===!1){this.state=Ht.NONE;break}this._handleTouchStartPan(i),this.state=Ht.TOUCH_PAN;break;default:this.state=Ht.NONE}break;case 2:switch(this.touches.TWO){case Rr.DOLLY_PAN:if(this.enableZoom===!1&&this.enablePan===!1)return;this._handleTouchStartDollyPan(i),this.state=Ht.TOUCH_DOLLY_PAN;break;case Rr.DOLLY_ROTATE:if(this.enableZoom===!1&&this.enableRotate===!1)return;this._handleTouchStartDollyRotate(i),this.state=Ht.TOUCH_DOLLY_ROTATE;break;default:this.state=Ht.NONE}break;default:this.state=Ht.NONE}this.state!==Ht.NONE&&this.dispatchEvent(zd)}function RE(i){switch(this._trackPointer(i),this.state){case Ht.TOUCH_ROTATE:if(this.enableRotate===!1)return;this._handleTouchMoveRotate(i),this.update();break;case Ht.TOUCH_PAN:if(this.enablePan===!1)return;this._handleTouchMovePan(i),this.update();break;case Ht.TOUCH_DOLLY_PAN:if(this.enableZoom===!1&&this.enablePan===!1)return;this._handleTouchMoveDollyPan(i),this.update();break;case Ht.TOUCH_DOLLY_ROTATE:if(this.enableZoom===!1&&this.enableRotate===!1)return;this._handleTouchMoveDollyRotate(i),this.update();break;default:this.state=Ht.NONE}}function CE(i){this.enabled!==!1&&i.preventDefault()}function IE(i){i.key==="Control"&&(this._controlActive=!0,this.domElement.ownerDocument.addEventListener("keyup",this._interceptControlUp,{passive:!0,capture:!0}))}function PE(i){i.key==="Control"&&(this._controlActive=!1,this.domElement.ownerDocument.removeEventListener("keyup",this._interceptControlUp,{passive:!0,capture:!0}))}var LE=.05,DE=14,NE=1862540,ou=class{constructor(e,t){this.viewer=e,this.list=t,this.lines=t.length?UE(t,e.controls.target):null,this.lines&&e.overlay.add(this.lines),this.photos=document.getElementById("photos"),this.shown=[],e.addEventListener("drawn",()=>this.place()),e.addEventListener("left",()=>this.look(-1)),e.canvas.addEventListener("click",n=>this.clicked(n)),this.show(!1),this.look(-1)}show(e){this.lines&&(this.lines.visible=e),this.viewer.draw()}look(e){if(e===this.number)return;this.number=e;let t=this.list[e]??null;this.shown=t?this.viewer.views.map(()=>this.photo(e)):[],this.photos.replaceChildren(...this.shown.map(({stage:n})=>n)),this.viewer.lookThrough(t),this.changed?.(e)}photo(e){let t=new Image;t.onerror=()=>this.failed?.(e),Object.assign(t,{alt:`photo ${this.list[e].name}`,src:`photos/${e}`});let n=new go("How much of the photo is shown",()=>{for(let{divider:s}of this.shown)s.slider.value=n.slider.value;this.place()});return n.tags.forEach((s,r)=>s.textContent=["photo","render"][r]),{image:t,divider:n,stage:We("div",{class:"stage"},t,...n.nodes)}}place(){this.shown.forEach(({image:e,divider:t,stage:n},s)=>{let[r,o,a,l]=this.viewer.boxes[s];Object.assign(n.style,{left:`${r}px`,bottom:`${o}px`,width:`${a}px`,height:`${l}px`}),t.cut(e)})}clicked(e){if(!this.lines?.visible||this.viewer.through)return;let{left:t,top:n,height:s}=this.viewer.canvas.getBoundingClientRect(),[r,o]=[e.clientX-t,e.clientY-n],l=this.viewer.boxes.flatMap(([c,,h])=>this.list.map((u,f)=>{let p=new Q(u.pose[3],u.pose[7],u.pose[11]).project(this.viewer.camera),[x,M]=[c+h*(p.x+1)/2,s*(1-p.y)/2];return{number:f,distance:p.z<1?Math.hypot(x-r,M-o):1/0}})).reduce((c,h)=>h.distance<c.distance?h:c);l.distance<DE&&this.look(l.number)}},Hd=i=>new Mt().set(...i);function UE(i,e){let t=[];for(let{pose:s,intrinsics:r,width:o,height:a}of i){let l=Hd(s),c=new Q().setFromMatrixPosition(l),h=LE*c.distanceTo(e),[u,f,p,x]=r,M=[[0,0],[o,0],[o,a],[0,a]].map(([g,_])=>new Q(h*(g-p)/u,h*(x-_)/f,-h).applyMatrix4(l));M.forEach((g,_)=>t.push(c,g,g,M[(_+1)%4]))}let n=new Qn().setFromPoints(t);return new $r(n,new wr({color:NE,toneMapped:!1}))}function Gd(i,e){if(e===ud)return console.warn("THREE.BufferGeometryUtils.toTrianglesDrawMode(): Geometry already defined as triangles."),i;if(e===ca||e===Tl){let t=i.getIndex();if(t===null){let r=[],o=i.getAttribute("position");if(o!==void 0){for(let a=0;a<o.count;a++)r.push(a);i.setIndex(r),t=i.getIndex()}else return console.error("THREE.BufferGeometryUtils.toTrianglesDrawMode(): Undefined position attribute. Processing not possible."),i}let n=t.count-2,s=[];if(e===ca)for(let r=1;r<=n;r++)s.push(t.getX(0)),s.push(t.getX(r)),s.push(t.getX(r+1));else for(let r=0;r<n;r++)r%2===0?(s.push(t.getX(r)),s.push(t.getX(r+1)),s.push(t.getX(r+2))):(s.push(t.getX(r+2)),s.push(t.getX(r+1)),s.push(t.getX(r)));return s.length/3!==n&&console.error("THREE.BufferGeometryUtils.toTrianglesDrawMode(): Unable to generate correct amount of triangles."),i.setIndex(s),i.clearGroups(),i}else return console.error("THREE.BufferGeometryUtils.toTrianglesDrawMode(): Unknown draw mode:",e),i}function I_(i){let e=new Map,t=new Map,n=i.clone();return P_(i,n,function(s,r){e.set(r,s),t.set(s,r)}),n.traverse(function(s){if(!s.isSkinnedMesh)return;let r=s,o=e.get(s),a=o.skeleton.bones;r.skeleton=o.skeleton.clone(),r.bindMatrix.copy(o.bindMatrix),r.skeleton.bones=a.map(function(l){return t.get(l)}),r.bind(r.skeleton,r.bindMatrix)}),n}function P_(i,e,t){t(i,e);for(let n=0;n<i.children.length;n++)P_(i.children[n],e.children[n],t)}var au=class extends os{constructor(e){super(e),this.dracoLoader=null,this.ktx2Loader=null,this.meshoptDecoder=null,this.pluginCallbacks=[],this.register(function(t){return new Kd(t)}),this.register(function(t){return new $d(t)}),this.register(function(t){return new Jd(t)}),this.register(function(t){return new op(t)}),this.register(function(t){return new ap(t)}),this.register(function(t){return new lp(t)}),this.register(function(t){return new Qd(t)}),this.register(function(t){return new ep(t)}),this.register(function(t){return new tp(t)}),this.register(function(t){return new np(t)}),this.register(function(t){return new Zd(t)}),this.register(function(t){return new ip(t)}),this.register(function(t){return new jd(t)}),this.register(function(t){return new rp(t)}),this.register(function(t){return new sp(t)}),this.register(function(t){return new qd(t)}),this.register(function(t){return new lu(t,It.EXT_MESHOPT_COMPRESSION)}),this.register(function(t){return new lu(t,It.KHR_MESHOPT_COMPRESSION)}),this.register(function(t){return new cp(t)})}load(e,t,n,s){let r=this,o;if(this.resourcePath!=="")o=this.resourcePath;else if(this.path!==""){let c=js.extractUrlBase(e);o=js.resolveURL(c,this.path)}else o=js.extractUrlBase(e);this.manager.itemStart(e);let a=function(c){s?s(c):console.error(c),r.manager.itemError(e),r.manager.itemEnd(e)},l=new Jr(this.manager);l.setPriority(this.priority),l.setCache(this.cache),l.setPath(this.path),l.setResponseType("arraybuffer"),l.setRequestHeader(this.requestHeader),l.setWithCredentials(this.withCredentials),l.load(e,function(c){try{r.parse(c,o,function(h){t(h),r.manager.itemEnd(e)},a)}catch(h){a(h)}},n,a)}setDRACOLoader(e){return this.dracoLoader=e,this}setKTX2Loader(e){return this.ktx2Loader=e,this}setMeshoptDecoder(e){return this.meshoptDecoder=e,this}register(e){return this.pluginCallbacks.indexOf(e)===-1&&this.pluginCallbacks.push(e),this}unregister(e){return this.pluginCallbacks.indexOf(e)!==-1&&this.pluginCallbacks.splice(this.pluginCallbacks.indexOf(e),1),this}parse(e,t,n,s){let r,o={},a={},l=new TextDecoder;if(typeof e=="string")r=JSON.parse(e);else if(e instanceof ArrayBuffer)if(l.decode(new Uint8Array(e,0,4))===O_){try{o[It.KHR_BINARY_GLTF]=new hp(e)}catch(u){s&&s(u);return}r=JSON.parse(o[It.KHR_BINARY_GLTF].content)}else r=JSON.parse(l.decode(e));else r=e;if(r.asset===void 0||r.asset.version[0]<2){s&&s(new Error("THREE.GLTFLoader: Unsupported asset. glTF versions >=2.0 are supported."));return}let c=new _p(r,{path:t||this.resourcePath||"",crossOrigin:this.crossOrigin,priority:this.priority,cache:this.cache,withCredentials:this.withCredentials,requestHeader:this.requestHeader,manager:this.manager,ktx2Loader:this.ktx2Loader,meshoptDecoder:this.meshoptDecoder});c.fileLoader.setRequestHeader(this.requestHeader);for(let h=0;h<this.pluginCallbacks.length;h++){let u=this.pluginCallbacks[h](c);u.name||console.error("THREE.GLTFLoader: Invalid plugin found: missing name"),a[u.name]=u,o[u.name]=!0}if(r.extensionsUsed)for(let h=0;h<r.extensionsUsed.length;++h){let u=r.extensionsUsed[h],f=r.extensionsRequired||[];switch(u){case It.KHR_MATERIALS_UNLIT:o[u]=new Yd;break;case It.KHR_DRACO_MESH_COMPRESSION:o[u]=new up(r,this.dracoLoader);break;case It.KHR_TEXTURE_TRANSFORM:o[u]=new fp;break;case It.KHR_MESH_QUANTIZATION:o[u]=new dp;break;default:f.indexOf(u)>=0&&a[u]===void 0&&console.warn('THREE.GLTFLoader: Unknown extension "'+u+'".')}}c.setExtensions(o),c.setPlugins(a),c.parse(n,s)}parseAsync(e,t){let n=this;return new Promise(function(s,r){n.parse(e,t,s,r)})}};function OE(){let i={};return{get:function(e){return i[e]},add:function(e,t){i[e]=t},remove:function(e){delete i[e]},removeAll:function(){i={}}}}function vn(i,e,t){let n=i.json.materials[e];return n.extensions&&n.extensions[t]?n.extensions[t]:null}var It={KHR_BINARY_GLTF:"KHR_binary_glTF",KHR_DRACO_MESH_COMPRESSION:"KHR_draco_mesh_compression",KHR_LIGHTS_PUNCTUAL:"KHR_lights_punctual",KHR_MATERIALS_CLEARCOAT:"KHR_materials_clearcoat",KHR_MATERIALS_DIFFUSE_ROUGHNESS:"KHR_materials_diffuse_roughness",KHR_MATERIALS_DISPERSION:"KHR_materials_dispersion",KHR_MATERIALS_IOR:"KHR_materials_ior",KHR_MATERIALS_SHEEN:"KHR_materials_sheen",KHR_MATERIALS_SPECULAR:"KHR_materials_specular",KHR_MATERIALS_TRANSMISSION:"KHR_materials_transmission",KHR_MATERIALS_IRIDESCENCE:"KHR_materials_iridescence",KHR_MATERIALS_ANISOTROPY:"KHR_materials_anisotropy",KHR_MATERIALS_UNLIT:"KHR_materials_unlit",KHR_MATERIALS_VOLUME:"KHR_materials_volume",KHR_TEXTURE_BASISU:"KHR_texture_basisu",KHR_TEXTURE_TRANSFORM:"KHR_texture_transform",KHR_MESH_QUANTIZATION:"KHR_mesh_quantization",KHR_MATERIALS_EMISSIVE_STRENGTH:"KHR_materials_emissive_strength",EXT_MATERIALS_BUMP:"EXT_materials_bump",EXT_TEXTURE_WEBP:"EXT_texture_webp",EXT_TEXTURE_AVIF:"EXT_texture_avif",EXT_MESHOPT_COMPRESSION:"EXT_meshopt_compression",KHR_MESHOPT_COMPRESSION:"KHR_meshopt_compression",EXT_MESH_GPU_INSTANCING:"EXT_mesh_gpu_instancing"},qd=class{constructor(e){this.parser=e,this.name=It.KHR_LIGHTS_PUNCTUAL,this.cache={refs:{},uses:{}}}_markDefs(){let e=this.parser,t=this.parser.json.nodes||[];for(let n=0,s=t.length;n<s;n++){let r=t[n];r.extensions&&r.extensions[this.name]&&r.extensions[this.name].light!==void 0&&e._addNodeRef(this.cache,r.extensions[this.name].light)}}_loadLight(e){let t=this.parser,n="light:"+e,s=t.cache.get(n);if(s)return s;let r=t.json,l=((r.extensions&&r.extensions[this.name]||{}).lights||[])[e],c,h=new ft(16777215);l.color!==void 0&&h.setRGB(l.color[0],l.color[1],l.color[2],cn);let u=l.range!==void 0?l.range:0;switch(l.type){case"directional":c=new fl(h),c.target.position.set(0,0,-1),c.add(c.target);break;case"point":c=new ul(h),c.distance=u;break;case"spot":c=new hl(h),c.distance=u,l.spot=l.spot||{},l.spot.innerConeAngle=l.spot.innerConeAngle!==void 0?l.spot.innerConeAngle:0,l.spot.outerConeAngle=l.spot.outerConeAngle!==void 0?l.spot.outerConeAngle:Math.PI/4,c.angle=l.spot.outerConeAngle,c.penumbra=1-l.spot.innerConeAngle/l.spot.outerConeAngle,c.target.position.set(0,0,-1),c.add(c.target);break;default:throw new Error("THREE.GLTFLoader: Unexpected light type: "+l.type)}return c.position.set(0,0,0),As(c,l),l.intensity!==void 0&&(c.intensity=l.intensity),c.name=t.createUniqueName(l.name||"light_"+e),s=Promise.resolve(c),t.cache.add(n,s),s}getDependency(e,t){if(e==="light")return this._loadLight(t)}createNodeAttachment(e){let t=this,n=this.parser,r=n.json.nodes[e],a=(r.extensions&&r.extensions[this.name]||{}).light;return a===void 0?null:this._loadLight(a).then(function(l){return n._getNodeRef(t.cache,a,l)})}},Yd=class{constructor(){this.name=It.KHR_MATERIALS_UNLIT}getMaterialType(){return Vi}extendParams(e,t,n){let s=[];e.color=new ft(1,1,1),e.opacity=1;let r=t.pbrMetallicRoughness;if(r){if(Array.isArray(r.baseColorFactor)){let o=r.baseColorFactor;e.color.setRGB(o[0],o[1],o[2],cn),e.opacity=o[3]}r.baseColorTexture!==void 0&&s.push(n.assignTexture(e,"map",r.baseColorTexture,Un))}return Promise.all(s)}},Zd=class{constructor(e){this.parser=e,this.name=It.KHR_MATERIALS_EMISSIVE_STRENGTH}extendMaterialParams(e,t){let n=vn(this.parser,e,this.name);return n===null||n.emissiveStrength!==void 0&&(t.emissiveIntensity=n.emissiveStrength),Promise.resolve()}},Kd=class{constructor(e){this.parser=e,this.name=It.KHR_MATERIALS_CLEARCOAT}getMaterialType(e){return vn(this.parser,e,this.name)!==null?di:null}extendMaterialParams(e,t){let n=vn(this.parser,e,this.name);if(n===null)return Promise.resolve();let s=[];if(n.clearcoatFactor!==void 0&&(t.clearcoat=n.clearcoatFactor),n.clearcoatTexture!==void 0&&s.push(this.parser.assignTexture(t,"clearcoatMap",n.clearcoatTexture)),n.clearcoatRoughnessFactor!==void 0&&(t.clearcoatRoughness=n.clearcoatRoughnessFactor),n.clearcoatRoughnessTexture!==void 0&&s.push(this.parser.assignTexture(t,"clearcoatRoughnessMap",n.clearcoatRoughnessTexture)),n.clearcoatNormalTexture!==void 0&&(s.push(this.parser.assignTexture(t,"clearcoatNormalMap",n.clearcoatNormalTexture)),n.clearcoatNormalTexture.scale!==void 0)){let r=n.clearcoatNormalTexture.scale;t.clearcoatNormalScale=new lt(r,r)}return Promise.all(s)}},$d=class{constructor(e){this.parser=e,this.name=It.KHR_MATERIALS_DIFFUSE_ROUGHNESS}getMaterialType(e){return vn(this.parser,e,this.name)!==null?di:null}extendMaterialParams(e,t){let n=vn(this.parser,e,this.name);if(n===null)return Promise.resolve();let s=[];return t.diffuseRoughness=n.diffuseRoughnessFactor!==void 0?n.diffuseRoughnessFactor:0,n.diffuseRoughnessTexture!==void 0&&s.push(this.parser.assignTexture(t,"diffuseRoughnessMap",n.diffuseRoughnessTexture)),Promise.all(s)}},Jd=class{constructor(e){this.parser=e,this.name=It.KHR_MATERIALS_DISPERSION}getMaterialType(e){return vn(this.parser,e,this.name)!==null?di:null}extendMaterialParams(e,t){let n=vn(this.parser,e,this.name);return n===null||(t.dispersion=n.dispersion!==void 0?n.dispersion:0),Promise.resolve()}},jd=class{constructor(e){this.parser=e,this.name=It.KHR_MATERIALS_IRIDESCENCE}getMaterialType(e){return vn(this.parser,e,this.name)!==null?di:null}extendMaterialParams(e,t){let n=vn(this.parser,e,this.name);if(n===null)return Promise.resolve();let s=[];return n.iridescenceFactor!==void 0&&(t.iridescence=n.iridescenceFactor),n.iridescenceTexture!==void 0&&s.push(this.parser.assignTexture(t,"iridescenceMap",n.iridescenceTexture)),n.iridescenceIor!==void 0&&(t.iridescenceIOR=n.iridescenceIor),n.iridescenceThicknessMinimum!==void 0&&(t.iridescenceThicknessMinimum=n.iridescenceThicknessMinimum),n.iridescenceThicknessMaximum!==void 0&&(t.iridescenceThicknessMaximum=n.iridescenceThicknessMaximum),n.iridescenceThicknessTexture!==void 0&&s.push(this.parser.assignTexture(t,"iridescenceThicknessMap",n.iridescenceThicknessTexture)),Promise.all(s)}},Qd=class{constructor(e){this.parser=e,this.name=It.KHR_MATERIALS_SHEEN}getMaterialType(e){return vn(this.parser,e,this.name)!==null?di:null}extendMaterialParams(e,t){let n=vn(this.parser,e,this.name);if(n===null)return Promise.resolve();let s=[];if(t.sheenColor=new ft(0,0,0),t.sheenRoughness=0,t.sheen=1,n.sheenColorFactor!==void 0){let r=n.sheenColorFactor;t.sheenColor.setRGB(r[0],r[1],r[2],cn)}return n.sheenRoughnessFactor!==void 0&&(t.sheenRoughness=n.sheenRoughnessFactor),n.sheenColorTexture!==void 0&&s.push(this.parser.assignTexture(t,"sheenColorMap",n.sheenColorTexture,Un)),n.sheenRoughnessTexture!==void 0&&s.push(this.parser.assignTexture(t,"sheenRoughnessMap",n.sheenRoughnessTexture)),Promise.all(s)}},ep=class{constructor(e){this.parser=e,this.name=It.KHR_MATERIALS_TRANSMISSION}getMaterialType(e){return vn(this.parser,e,this.name)!==null?di:null}extendMaterialParams(e,t){let n=vn(this.parser,e,this.name);if(n===null)return Promise.resolve();let s=[];return n.transmissionFactor!==void 0&&(t.transmission=n.transmissionFactor),n.transmissionTexture!==void 0&&s.push(this.parser.assignTexture(t,"transmissionMap",n.transmissionTexture)),Promise.all(s)}},tp=class{constructor(e){this.parser=e,this.name=It.KHR_MATERIALS_VOLUME}getMaterialType(e){return vn(this.parser,e,this.name)!==null?di:null}extendMaterialParams(e,t){let n=vn(this.parser,e,this.name);if(n===null)return Promise.resolve();let s=[];t.thickness=n.thicknessFactor!==void 0?n.thicknessFactor:0,n.thicknessTexture!==void 0&&s.push(this.parser.assignTexture(t,"thicknessMap",n.thicknessTexture)),t.attenuationDistance=n.attenuationDistance||1/0;let r=n.attenuationColor||[1,1,1];return t.attenuationColor=new ft().setRGB(r[0],r[1],r[2],cn),Promise.all(s)}},np=class{constructor(e){this.parser=e,this.name=It.KHR_MATERIALS_IOR}getMaterialType(e){return vn(this.parser,e,this.name)!==null?di:null}extendMaterialParams(e,t){let n=vn(this.parser,e,this.name);return n===null||(t.ior=n.ior!==void 0?n.ior:1.5,t.ior===0&&(t.ior=1e3)),Promise.resolve()}},ip=class{constructor(e){this.parser=e,this.name=It.KHR_MATERIALS_SPECULAR}getMaterialType(e){return vn(this.parser,e,this.name)!==null?di:null}extendMaterialParams(e,t){let n=vn(this.parser,e,this.name);if(n===null)return Promise.resolve();let s=[];t.specularIntensity=n.specularFactor!==void 0?n.specularFactor:1,n.specularTexture!==void 0&&s.push(this.parser.assignTexture(t,"specularIntensityMap",n.specularTexture));let r=n.specularColorFactor||[1,1,1];return t.specularColor=new ft().setRGB(r[0],r[1],r[2],cn),n.specularColorTexture!==void 0&&s.push(this.parser.assignTexture(t,"specularColorMap",n.specularColorTexture,Un)),Promise.all(s)}},sp=class{constructor(e){this.parser=e,this.name=It.EXT_MATERIALS_BUMP}getMaterialType(e){return vn(this.parser,e,this.name)!==null?di:null}extendMaterialParams(e,t){let n=vn(this.parser,e,this.name);if(n===null)return Promise.resolve();let s=[];return t.bumpScale=n.bumpFactor!==void 0?n.bumpFactor:1,n.bumpTexture!==void 0&&s.push(this.parser.assignTexture(t,"bumpMap",n.bumpTexture)),Promise.all(s)}},rp=class{constructor(e){this.parser=e,this.name=It.KHR_MATERIALS_ANISOTROPY}getMaterialType(e){return vn(this.parser,e,this.name)!==null?di:null}extendMaterialParams(e,t){let n=vn(this.parser,e,this.name);if(n===null)return Promise.resolve();let s=[];return n.anisotropyStrength!==void 0&&(t.anisotropy=n.anisotropyStrength),n.anisotropyRotation!==void 0&&(t.anisotropyRotation=n.anisotropyRotation),n.anisotropyTexture!==void 0&&s.push(this.parser.assignTexture(t,"anisotropyMap",n.anisotropyTexture)),Promise.all(s)}},op=class{constructor(e){this.parser=e,this.name=It.KHR_TEXTURE_BASISU}loadTexture(e){let t=this.parser,n=t.json,s=n.textures[e];if(!s.extensions||!s.extensions[this.name])return null;let r=s.extensions[this.name],o=t.options.ktx2Loader;if(!o){if(n.extensionsRequired&&n.extensionsRequired.indexOf(this.name)>=0)throw new Error("THREE.GLTFLoader: setKTX2Loader must be called before loading KTX2 textures");return null}return t.loadTextureImage(e,r.source,o)}},ap=class{constructor(e){this.parser=e,this.name=It.EXT_TEXTURE_WEBP}loadTexture(e){let t=this.name,n=this.parser,s=n.json,r=s.textures[e];if(!r.extensions||!r.extensions[t])return null;let o=r.extensions[t],a=s.images[o.source],l=n.textureLoader;if(a.uri){let c=n.options.manager.getHandler(a.uri);c!==null&&(l=c)}return n.loadTextureImage(e,o.source,l)}},lp=class{constructor(e){this.parser=e,this.name=It.EXT_TEXTURE_AVIF}loadTexture(e){let t=this.name,n=this.parser,s=n.json,r=s.textures[e];if(!r.extensions||!r.extensions[t])return null;let o=r.extensions[t],a=s.images[o.source],l=n.textureLoader;if(a.uri){let c=n.options.manager.getHandler(a.uri);c!==null&&(l=c)}return n.loadTextureImage(e,o.source,l)}},lu=class{constructor(e,t){this.name=t,this.parser=e}loadBufferView(e){let t=this.parser.json,n=t.bufferViews[e];if(n.extensions&&n.extensions[this.name]){let s=n.extensions[this.name],r=this.parser.getDependency("buffer",s.buffer),o=this.parser.options.meshoptDecoder;if(!o||!o.supported){if(t.extensionsRequired&&t.extensionsRequired.indexOf(this.name)>=0)throw new Error("THREE.GLTFLoader: setMeshoptDecoder must be called before loading compressed files");return null}return r.then(function(a){let l=s.byteOffset||0,c=s.byteLength||0,h=s.count,u=s.byteStride,f=new Uint8Array(a,l,c);return o.decodeGltfBufferAsync?o.decodeGltfBufferAsync(h,u,f,s.mode,s.filter).then(function(p){return p.buffer}):o.ready.then(function(){let p=new ArrayBuffer(h*u);return o.decodeGltfBuffer(new Uint8Array(p),h,u,f,s.mode,s.filter),p})})}else return null}},cp=class{constructor(e){this.name=It.EXT_MESH_GPU_INSTANCING,this.parser=e}createNodeMesh(e){let t=this.parser.json,n=t.nodes[e];if(!n.extensions||!n.extensions[this.name]||n.mesh===void 0)return null;let s=t.meshes[n.mesh];for(let c of s.primitives)if(c.mode!==Xi.TRIANGLES&&c.mode!==Xi.TRIANGLE_STRIP&&c.mode!==Xi.TRIANGLE_FAN&&c.mode!==void 0)return null;let o=n.extensions[this.name].attributes,a=[],l={};for(let c in o)a.push(this.parser.getDependency("accessor",o[c]).then(h=>(l[c]=h,l[c])));return a.length<1?null:(a.push(this.parser.createNodeMesh(e)),Promise.all(a).then(c=>{let h=c.pop(),u=h.isGroup?h.children:[h],f=c[0].count,p=[];for(let x of u){let M=new Mt,g=new Q,_=new qn,b=new Q(1,1,1),P=new tl(x.geometry,x.material,f);for(let D=0;D<f;D++)l.TRANSLATION&&g.fromBufferAttribute(l.TRANSLATION,D),l.ROTATION&&_.fromBufferAttribute(l.ROTATION,D),l.SCALE&&b.fromBufferAttribute(l.SCALE,D),P.setMatrixAt(D,M.compose(g,_,b));let w=null;for(let D in l)if(D==="_COLOR_0"){let I=l[D];P.instanceColor=new Xs(I.array,I.itemSize,I.normalized)}else if(D!=="TRANSLATION"&&D!=="ROTATION"&&D!=="SCALE"){if(w===null){let y=P.geometry;w=new Qn,w.name=y.name;for(let T in y.attributes)w.setAttribute(T,y.attributes[T]);for(let T in y.morphAttributes)w.morphAttributes[T]=y.morphAttributes[T];y.index!==null&&w.setIndex(y.index),w.morphTargetsRelative=y.morphTargetsRelative;for(let T of y.groups)w.addGroup(T.start,T.count,T.materialIndex);y.boundingBox!==null&&(w.boundingBox=y.boundingBox.clone()),y.boundingSphere!==null&&(w.boundingSphere=y.boundingSphere.clone()),w.drawRange.start=y.drawRange.start,w.drawRange.count=y.drawRange.count,w.userData=Object.assign({},y.userData),P.geometry=w}let I=l[D];w.setAttribute(D,new Xs(I.array,I.itemSize,I.normalized))}xn.prototype.copy.call(P,x),this.parser.assignFinalMaterial(P),p.push(P)}return h.isGroup?(h.clear(),h.add(...p),h):p[0]}))}},O_="glTF",Nl=12,L_={JSON:1313821514,BIN:5130562},hp=class{constructor(e){this.name=It.KHR_BINARY_GLTF,this.content=null,this.body=null;let t=new DataView(e,0,Nl),n=new TextDecoder;if(this.header={magic:n.decode(new Uint8Array(e.slice(0,4))),version:t.getUint32(4,!0),length:t.getUint32(8,!0)},this.header.magic!==O_)throw new Error("THREE.GLTFLoader: Unsupported glTF-Binary header.");if(this.header.version<2)throw new Error("THREE.GLTFLoader: Legacy binary file detected.");let s=this.header.length-Nl,r=new DataView(e,Nl),o=0;for(;o<s;){let a=r.getUint32(o,!0);o+=4;let l=r.getUint32(o,!0);if(o+=4,l===L_.JSON){let c=new Uint8Array(e,Nl+o,a);this.content=n.decode(c)}else if(l===L_.BIN){let c=Nl+o;this.body=e.slice(c,c+a)}o+=a}if(this.content===null)throw new Error("THREE.GLTFLoader: JSON content not found.")}},up=class{constructor(e,t){if(!t)throw new Error("THREE.GLTFLoader: No DRACOLoader instance provided.");this.name=It.KHR_DRACO_MESH_COMPRESSION,this.json=e,this.dracoLoader=t,this.dracoLoader.preload()}decodePrimitive(e,t){let n=this.json,s=this.dracoLoader,r=e.extensions[this.name].bufferView,o=e.extensions[this.name].attributes,a={},l={},c={};for(let h in o){let u=mp[h]||h.toLowerCase();a[u]=o[h]}for(let h in e.attributes){let u=mp[h]||h.toLowerCase();if(o[h]!==void 0){let f=n.accessors[e.attributes[h]],p=pa[f.componentType];c[u]=p.name,l[u]=f.normalized===!0}}return t.getDependency("bufferView",r).then(function(h){return new Promise(function(u,f){s.decodeDracoFile(h,function(p){for(let x in p.attributes){let M=p.attributes[x],g=l[x];g!==void 0&&(M.normalized=g)}u(p)},a,c,cn,f)})})}},fp=class{constructor(){this.name=It.KHR_TEXTURE_TRANSFORM}extendTexture(e,t){if((t.texCoord===void 0||t.texCoord===e.channel)&&t.offset===void 0&&t.rotation===void 0&&t.scale===void 0)return e;if(e=e.clone(),t.texCoord!==void 0&&(e.channel=t.texCoord),t.offset!==void 0&&e.offset.fromArray(t.offset),t.rotation!==void 0&&(e.rotation=t.rotation),t.scale!==void 0&&e.repeat.fromArray(t.scale),t.rotation!==void 0){let n=Math.cos(e.rotation),s=Math.sin(e.rotation);e.matrix.set(e.repeat.x*n,e.repeat.y*s,e.offset.x,-e.repeat.x*s,e.repeat.y*n,e.offset.y,0,0,1),e.matrixAutoUpdate=!1}return e.needsUpdate=!0,e}},dp=class{constructor(){this.name=It.KHR_MESH_QUANTIZATION}},cu=class extends Ms{constructor(e,t,n,s){super(e,t,n,s)}copySampleValue_(e){let t=this.resultBuffer,n=this.sampleValues,s=this.valueSize,r=e*s*3+s;for(let o=0;o!==s;o++)t[o]=n[r+o];return t}interpolate_(e,t,n,s){let r=this.resultBuffer,o=this.sampleValues,a=this.valueSize,l=a*2,c=a*3,h=s-t,u=(n-t)/h,f=u*u,p=f*u,x=e*c,M=x-c,g=-2*p+3*f,_=p-f,b=1-g,P=_-f+u;for(let w=0;w!==a;w++){let D=o[M+w+a],I=o[M+w+l]*h,y=o[x+w+a],T=o[x+w]*h;r[w]=b*D+P*I+g*y+_*T}return r}},FE=new qn,pp=class extends cu{interpolate_(e,t,n,s){let r=super.interpolate_(e,t,n,s);return FE.fromArray(r).normalize().toArray(r),r}},Xi={FLOAT:5126,FLOAT_MAT3:35675,FLOAT_MAT4:35676,FLOAT_VEC2:35664,FLOAT_VEC3:35665,FLOAT_VEC4:35666,LINEAR:9729,REPEAT:10497,SAMPLER_2D:35678,POINTS:0,LINES:1,LINE_LOOP:2,LINE_STRIP:3,TRIANGLES:4,TRIANGLE_STRIP:5,TRIANGLE_FAN:6,UNSIGNED_BYTE:5121,UNSIGNED_SHORT:5123},pa={5120:Int8Array,5121:Uint8Array,5122:Int16Array,5123:Uint16Array,5125:Uint32Array,5126:Float32Array},D_={9728:En,9729:Xt,9984:ah,9985:aa,9986:so,9987:Ni},N_={33071:gi,33648:Vo,10497:Mr},Vd={SCALAR:1,VEC2:2,VEC3:3,VEC4:4,MAT2:4,MAT3:9,MAT4:16},mp={POSITION:"position",NORMAL:"normal",TANGENT:"tangent",TEXCOORD_0:"uv",TEXCOORD_1:"uv1",TEXCOORD_2:"uv2",TEXCOORD_3:"uv3",COLOR_0:"color",WEIGHTS_0:"skinWeight",JOINTS_0:"skinIndex"},Cr={scale:"scale",translation:"position",rotation:"quaternion",weights:"morphTargetInfluences"},BE={CUBICSPLINE:void 0,LINEAR:Yr,STEP:qr},Wd={OPAQUE:"OPAQUE",MASK:"MASK",BLEND:"BLEND"};function kE(i){return i.DefaultMaterial===void 0&&(i.DefaultMaterial=new Ys({color:16777215,emissive:0,metalness:1,roughness:1,transparent:!1,depthTest:!0,side:bs})),i.DefaultMaterial}function lo(i,e,t){for(let n in t.extensions)i[n]===void 0&&(e.userData.gltfExtensions=e.userData.gltfExtensions||{},e.userData.gltfExtensions[n]=t.extensions[n])}function As(i,e){e.extras!==void 0&&(typeof e.extras=="object"?Object.assign(i.userData,e.extras):console.warn("THREE.GLTFLoader: Ignoring primitive type .extras, "+e.extras))}function zE(i,e,t){let n=!1,s=!1,r=!1;for(let c=0,h=e.length;c<h;c++){let u=e[c];if(u.POSITION!==void 0&&(n=!0),u.NORMAL!==void 0&&(s=!0),u.COLOR_0!==void 0&&(r=!0),n&&s&&r)break}if(!n&&!s&&!r)return Promise.resolve(i);let o=[],a=[],l=[];for(let c=0,h=e.length;c<h;c++){let u=e[c];if(n){let f=u.POSITION!==void 0?t.getDependency("accessor",u.POSITION):i.attributes.position;o.push(f)}if(s){let f=u.NORMAL!==void 0?t.getDependency("accessor",u.NORMAL):i.attributes.normal;a.push(f)}if(r){let f=u.COLOR_0!==void 0?t.getDependency("accessor",u.COLOR_0):i.attributes.color;l.push(f)}}return Promise.all([Promise.all(o),Promise.all(a),Promise.all(l)]).then(function(c){let h=c[0],u=c[1],f=c[2];return n&&(i.morphAttributes.position=h),s&&(i.morphAttributes.normal=u),r&&(i.morphAttributes.color=f),i.morphTargetsRelative=!0,i})}function HE(i,e){if(i.updateMorphTargets(),e.weights!==void 0)for(let t=0,n=e.weights.length;t<n;t++)i.morphTargetInfluences[t]=e.weights[t];if(e.extras&&Array.isArray(e.extras.targetNames)){let t=e.extras.targetNames;if(i.morphTargetInfluences.length===t.length){i.morphTargetDictionary={};for(let n=0,s=t.length;n<s;n++)i.morphTargetDictionary[t[n]]=n}else console.warn("THREE.GLTFLoader: Invalid extras.targetNames length. Ignoring names.")}}function GE(i){let e,t=i.extensions&&i.extensions[It.KHR_DRACO_MESH_COMPRESSION];if(t?e="draco:"+t.bufferView+":"+t.indices+":"+Xd(t.attributes):e=i.indices+":"+Xd(i.attributes)+":"+i.mode,i.targets!==void 0)for(let n=0,s=i.targets.length;n<s;n++)e+=":"+Xd(i.targets[n]);return e}function Xd(i){let e="",t=Object.keys(i).sort();for(let n=0,s=t.length;n<s;n++)e+=t[n]+":"+i[t[n]]+";";return e}function gp(i){switch(i){case Int8Array:return 1/127;case Uint8Array:return 1/255;case Int16Array:return 1/32767;case Uint16Array:return 1/65535;default:throw new Error("THREE.GLTFLoader: Unsupported normalized accessor component type.")}}function VE(i){return i.search(/\.jpe?g($|\?)/i)>0||i.search(/^data\:image\/jpeg/)===0?"image/jpeg":i.search(/\.webp($|\?)/i)>0||i.search(/^data\:image\/webp/)===0?"image/webp":i.search(/\.ktx2($|\?)/i)>0||i.search(/^data\:image\/ktx2/)===0?"image/ktx2":"image/png"}var WE=new Mt,_p=class{constructor(e={},t={}){this.json=e,this.extensions={},this.plugins={},this.options=t,this.cache=new OE,this.associations=new Map,this.primitiveCache={},this.nodeCache={},this.meshCache={refs:{},uses:{}},this.cameraCache={refs:{},uses:{}},this.lightCache={refs:{},uses:{}},this.sourceCache={},this.textureCache={},this.nodeNamesUsed={};let n=!1,s=-1,r=!1,o=-1;if(typeof navigator<"u"&&typeof navigator.userAgent<"u"){let a=navigator.userAgent;n=/^((?!chrome|android).)*safari/i.test(a)===!0;let l=a.match(/Version\/(\d+)/);s=n&&l?parseInt(l[1],10):-1,r=a.indexOf("Firefox")>-1,o=r?a.match(/Firefox\/([0-9]+)\./)[1]:-1}typeof createImageBitmap>"u"||n&&s<17||r&&o<98?(this.textureLoader=new cl(this.options.manager),this.textureLoader.setPriority(this.options.priority),this.textureLoader.setCache(this.options.cache)):(this.textureLoader=new dl(this.options.manager),this.textureLoader.setPriority(this.options.priority),this.textureLoader.setCache(this.options.cache)),this.textureLoader.setCrossOrigin(this.options.crossOrigin),this.textureLoader.setWithCredentials(this.options.withCredentials),this.textureLoader.setRequestHeader(this.options.requestHeader),this.fileLoader=new Jr(this.options.manager),this.fileLoader.setPriority(this.options.priority),this.fileLoader.setCache(this.options.cache),this.fileLoader.setResponseType("arraybuffer"),(this.options.withCredentials||this.options.crossOrigin==="use-credentials")&&this.fileLoader.setWithCredentials(!0)}setExtensions(e){this.extensions=e}setPlugins(e){this.plugins=e}parse(e,t){let n=this,s=this.json,r=this.extensions;this.cache.removeAll(),this.nodeCache={},this._invokeAll(function(o){return o._markDefs&&o._markDefs()}),Promise.all(this._invokeAll(function(o){return o.beforeRoot&&o.beforeRoot()})).then(function(){return Promise.all([n.getDependencies("scene"),n.getDependencies("animation"),n.getDependencies("camera")])}).then(function(o){let a={scene:o[0][s.scene||0],scenes:o[0],animations:o[1],cameras:o[2],asset:s.asset,parser:n,userData:{}};return lo(r,a,s),As(a,s),Promise.all(n._invokeAll(function(l){return l.afterRoot&&l.afterRoot(a)})).then(function(){for(let l of a.scenes)l.updateMatrixWorld();e(a)})}).catch(t)}_markDefs(){let e=this.json.nodes||[],t=this.json.skins||[],n=this.json.meshes||[];for(let s=0,r=t.length;s<r;s++){let o=t[s].joints;for(let a=0,l=o.length;a<l;a++)e[o[a]].isBone=!0}for(let s=0,r=e.length;s<r;s++){let o=e[s];o.mesh!==void 0&&(this._addNodeRef(this.meshCache,o.mesh),o.skin!==void 0&&(n[o.mesh].isSkinnedMesh=!0)),o.camera!==void 0&&this._addNodeRef(this.cameraCache,o.camera)}}_addNodeRef(e,t){t!==void 0&&(e.refs[t]===void 0&&(e.refs[t]=e.uses[t]=0),e.refs[t]++)}_getNodeRef(e,t,n){if(e.refs[t]<=1)return n;let s=n.clone(),r=(o,a)=>{let l=this.associations.get(o);l!=null&&this.associations.set(a,l);for(let[c,h]of o.children.entries())r(h,a.children[c])};return r(n,s),s.name+="_instance_"+e.uses[t]++,s}_invokeOne(e){let t=Object.values(this.plugins);t.push(this);for(let n=0;n<t.length;n++){let s=e(t[n]);if(s)return s}return null}_invokeAll(e){let t=Object.values(this.plugins);t.unshift(this);let n=[];for(let s=0;s<t.length;s++){let r=e(t[s]);r&&n.push(r)}return n}getDependency(e,t){let n=e+":"+t,s=this.cache.get(n);if(!s){switch(e){case"scene":s=this.loadScene(t);break;case"node":s=this._invokeOne(function(r){return r.loadNode&&r.loadNode(t)});break;case"mesh":s=this._invokeOne(function(r){return r.loadMesh&&r.loadMesh(t)});break;case"accessor":s=this.loadAccessor(t);break;case"bufferView":s=this._invokeOne(function(r){return r.loadBufferView&&r.loadBufferView(t)});break;case"buffer":s=this.loadBuffer(t);break;case"material":s=this._invokeOne(function(r){return r.loadMaterial&&r.loadMaterial(t)});break;case"texture":s=this._invokeOne(function(r){return r.loadTexture&&r.loadTexture(t)});break;case"skin":s=this.loadSkin(t);break;case"animation":s=this._invokeOne(function(r){return r.loadAnimation&&r.loadAnimation(t)});break;case"camera":s=this.loadCamera(t);break;default:if(s=this._invokeOne(function(r){return r!=this&&r.getDependency&&r.getDependency(e,t)}),!s)throw new Error("Unknown type: "+e);break}this.cache.add(n,s)}return s}getDependencies(e){let t=this.cache.get(e);if(!t){let n=this,s=this.json[e+(e==="mesh"?"es":"s")]||[];t=Promise.all(s.map(function(r,o){return n.getDependency(e,o)})),this.cache.add(e,t)}return t}loadBuffer(e){let t=this.json.buffers[e],n=this.fileLoader;if(t.type&&t.type!=="arraybuffer")throw new Error("THREE.GLTFLoader: "+t.type+" buffer type is not supported.");if(t.uri===void 0&&e===0)return Promise.resolve(this.extensions[It.KHR_BINARY_GLTF].body);let s=this.options;return new Promise(function(r,o){n.load(js.resolveURL(t.uri,s.path),r,void 0,function(){o(new Error('THREE.GLTFLoader: Failed to load buffer "'+t.uri+'".'))})})}loadBufferView(e){let t=this.json.bufferViews[e];return this.getDependency("buffer",t.buffer).then(function(n){let s=t.byteLength||0,r=t.byteOffset||0;return n.slice(r,r+s)})}loadAccessor(e){let t=this,n=this.json,s=this.json.accessors[e];if(s.bufferView===void 0&&s.sparse===void 0){let o=Vd[s.type],a=pa[s.componentType],l=s.normalized===!0,c=new a(s.count*o);return Promise.resolve(new $n(c,o,l))}let r=[];return s.bufferView!==void 0?r.push(this.getDependency("bufferView",s.bufferView)):r.push(null),s.sparse!==void 0&&(r.push(this.getDependency("bufferView",s.sparse.indices.bufferView)),r.push(this.getDependency("bufferView",s.sparse.values.bufferView))),Promise.all(r).then(function(o){let a=o[0],l=Vd[s.type],c=pa[s.componentType],h=c.BYTES_PER_ELEMENT,u=h*l,f=s.byteOffset||0,p=s.bufferView!==void 0?n.bufferViews[s.bufferView].byteStride:void 0,x=s.normalized===!0,M,g;if(p&&p!==u){let _=Math.floor(f/p),b="InterleavedBuffer:"+s.bufferView+":"+s.componentType+":"+_+":"+s.count,P=t.cache.get(b);P||(M=new c(a,_*p,s.count*p/h),P=new Ko(M,p/h),t.cache.add(b,P)),g=new $o(P,l,f%p/h,x)}else a===null?M=new c(s.count*l):M=new c(a,f,s.count*l),g=new $n(M,l,x);if(s.sparse!==void 0){let _=Vd.SCALAR,b=pa[s.sparse.indices.componentType],P=s.sparse.indices.byteOffset||0,w=s.sparse.values.byteOffset||0,D=new b(o[1],P,s.sparse.count*_),I=new c(o[2],w,s.sparse.count*l);a!==null&&(g=new $n(g.array.slice(),g.itemSize,g.normalized)),g.normalized=!1;for(let y=0,T=D.length;y<T;y++){let G=D[y];if(g.setX(G,I[y*l]),l>=2&&g.setY(G,I[y*l+1]),l>=3&&g.setZ(G,I[y*l+2]),l>=4&&g.setW(G,I[y*l+3]),l>=5)throw new Error("THREE.GLTFLoader: Unsupported itemSize in sparse BufferAttribute.")}g.normalized=x}return g})}loadTexture(e){let t=this.json,n=this.options,r=t.textures[e].source,o=t.images[r],a=this.textureLoader;if(o.uri){let l=n.manager.getHandler(o.uri);l!==null&&(a=l)}return this.loadTextureImage(e,r,a)}loadTextureImage(e,t,n){let s=this,r=this.json,o=r.textures[e],a=r.images[t],l=(a.uri||a.bufferView)+":"+o.sampler;if(this.textureCache[l])return this.textureCache[l];let c=this.loadImageSource(t,n).then(function(h){h.flipY=!1,h.name=o.name||a.name||"",h.name===""&&typeof a.uri=="string"&&a.uri.startsWith("data:image/")===!1&&(h.name=a.uri);let f=(r.samplers||{})[o.sampler]||{};return h.magFilter=D_[f.magFilter]||Xt,h.minFilter=D_[f.minFilter]||Ni,h.wrapS=N_[f.wrapS]||Mr,h.wrapT=N_[f.wrapT]||Mr,h.generateMipmaps=!h.isCompressedTexture&&h.minFilter!==En&&h.minFilter!==Xt,s.associations.set(h,{textures:e}),h}).catch(function(){return null});return this.textureCache[l]=c,c}loadImageSource(e,t){let n=this,s=this.json,r=this.options;if(this.sourceCache[e]!==void 0)return this.sourceCache[e].then(f=>f.clone());let o=s.images[e],a=self.URL||self.webkitURL,l=o.uri||"",c=!1,h;if(t.isKTX2Loader===!0&&o.bufferView!==void 0)h=n.getDependency("bufferView",o.bufferView).then(function(f){return new Promise(function(p,x){t.parse(f,p,x)})});else{if(o.bufferView!==void 0)l=n.getDependency("bufferView",o.bufferView).then(function(f){c=!0;let p=new Blob([f],{type:o.mimeType});return l=a.createObjectURL(p),l});else if(o.uri===void 0)throw new Error("THREE.GLTFLoader: Image "+e+" is missing URI and bufferView");h=Promise.resolve(l).then(function(f){return new Promise(function(p,x){let M=p;t.isImageBitmapLoader===!0&&(M=function(g){let _=new Yn(g);_.needsUpdate=!0,p(_)}),t.load(js.resolveURL(f,r.path),M,void 0,x)})})}let u=h.then(function(f){return c===!0&&a.revokeObjectURL(l),As(f,o),f.userData.mimeType=o.mimeType||VE(o.uri),f}).catch(function(f){throw console.error("THREE.GLTFLoader: Couldn't load texture",l),f});return this.sourceCache[e]=u,u}assignTexture(e,t,n,s){let r=this;return this.getDependency("texture",n.index).then(function(o){if(!o)return null;if(n.texCoord!==void 0&&n.texCoord>0&&(o=o.clone(),o.channel=n.texCoord),r.extensions[It.KHR_TEXTURE_TRANSFORM]){let a=n.extensions!==void 0?n.extensions[It.KHR_TEXTURE_TRANSFORM]:void 0;if(a){let l=r.associations.get(o);o=r.extensions[It.KHR_TEXTURE_TRANSFORM].extendTexture(o,a),r.associations.set(o,l)}}return s!==void 0&&(o.colorSpace=s),e[t]=o,o})}assignFinalMaterial(e){let t=e.geometry,n=e.material,s=t.attributes.tangent===void 0,r=t.attributes.color!==void 0,o=t.attributes.normal===void 0;if(e.isPoints){let a="PointsMaterial:"+n.uuid,l=this.cache.get(a);l||(l=new jo,xi.prototype.copy.call(l,n),l.color.copy(n.color),l.map=n.map,l.sizeAttenuation=!1,this.cache.add(a,l)),n=l}else if(e.isLine){let a="LineBasicMaterial:"+n.uuid,l=this.cache.get(a);l||(l=new wr,xi.prototype.copy.call(l,n),l.color.copy(n.color),l.map=n.map,this.cache.add(a,l)),n=l}if(s||r||o){let a="ClonedMaterial:"+n.uuid+":";s&&(a+="derivative-tangents:"),r&&(a+="vertex-colors:"),o&&(a+="flat-shading:");let l=this.cache.get(a);l||(l=n.clone(),r&&(l.vertexColors=!0),o&&(l.flatShading=!0),s&&(l.normalScale&&(l.normalScale.y*=-1),l.clearcoatNormalScale&&(l.clearcoatNormalScale.y*=-1)),this.cache.add(a,l),this.associations.set(l,this.associations.get(n))),n=l}e.material=n}getMaterialType(){return Ys}loadMaterial(e){let t=this,n=this.json,s=this.extensions,r=n.materials[e],o,a={},l=r.extensions||{},c=[];if(l[It.KHR_MATERIALS_UNLIT]){let u=s[It.KHR_MATERIALS_UNLIT];o=u.getMaterialType(),c.push(u.extendParams(a,r,t))}else{let u=r.pbrMetallicRoughness||{};if(a.color=new ft(1,1,1),a.opacity=1,Array.isArray(u.baseColorFactor)){let f=u.baseColorFactor;a.color.setRGB(f[0],f[1],f[2],cn),a.opacity=f[3]}u.baseColorTexture!==void 0&&c.push(t.assignTexture(a,"map",u.baseColorTexture,Un)),a.metalness=u.metallicFactor!==void 0?u.metallicFactor:1,a.roughness=u.roughnessFactor!==void 0?u.roughnessFactor:1,u.metallicRoughnessTexture!==void 0&&(c.push(t.assignTexture(a,"metalnessMap",u.metallicRoughnessTexture)),c.push(t.assignTexture(a,"roughnessMap",u.metallicRoughnessTexture))),o=this._invokeOne(function(f){return f.getMaterialType&&f.getMaterialType(e)}),c.push(Promise.all(this._invokeAll(function(f){return f.extendMaterialParams&&f.extendMaterialParams(e,a)})))}r.doubleSided===!0&&(a.side=ei);let h=r.alphaMode||Wd.OPAQUE;if(h===Wd.BLEND?(a.transparent=!0,a.depthWrite=!1):(a.transparent=!1,h===Wd.MASK&&(a.alphaTest=r.alphaCutoff!==void 0?r.alphaCutoff:.5)),r.normalTexture!==void 0&&o!==Vi&&(c.push(t.assignTexture(a,"normalMap",r.normalTexture)),a.normalScale=new lt(1,1),r.normalTexture.scale!==void 0)){let u=r.normalTexture.scale;a.normalScale.set(u,u)}if(r.occlusionTexture!==void 0&&o!==Vi&&(c.push(t.assignTexture(a,"aoMap",r.occlusionTexture)),r.occlusionTexture.strength!==void 0&&(a.aoMapIntensity=r.occlusionTexture.strength)),r.emissiveFactor!==void 0&&o!==Vi){let u=r.emissiveFactor;a.emissive=new ft().setRGB(u[0],u[1],u[2],cn)}return r.emissiveTexture!==void 0&&o!==Vi&&c.push(t.assignTexture(a,"emissiveMap",r.emissiveTexture,Un)),Promise.all(c).then(function(){let u=new o(a);return r.name&&(u.name=r.name),As(u,r),t.associations.set(u,{materials:e}),r.extensions&&lo(s,u,r),u})}createUniqueName(e){let t=tn.sanitizeNodeName(e||"");return t in this.nodeNamesUsed?t+"_"+ ++this.nodeNamesUsed[t]:(this.nodeNamesUsed[t]=0,t)}loadGeometries(e){let t=this,n=this.extensions,s=this.primitiveCache;function r(a){return n[It.KHR_DRACO_MESH_COMPRESSION].decodePrimitive(a,t).then(function(l){return U_(l,a,t)})}let o=[];for(let a=0,l=e.length;a<l;a++){let c=e[a],h=GE(c),u=s[h];if(u)o.push(u.promise);else{let f;c.extensions&&c.extensions[It.KHR_DRACO_MESH_COMPRESSION]?f=r(c):f=U_(new Qn,c,t),c.mode===Xi.TRIANGLE_STRIP?f=f.then(p=>Gd(p,Tl)):c.mode===Xi.TRIANGLE_FAN&&(f=f.then(p=>Gd(p,ca))),s[h]={primitive:c,promise:f},o.push(f)}}return Promise.all(o)}loadMesh(e){let t=this,n=this.json,s=this.extensions,r=n.meshes[e],o=r.primitives,a=[];for(let l=0,c=o.length;l<c;l++){let h=o[l].material===void 0?kE(this.cache):this.getDependency("material",o[l].material);a.push(h)}return a.push(t.loadGeometries(o)),Promise.all(a).then(async function(l){let c=l.slice(0,l.length-1),h=l[l.length-1],u=[];for(let p=0,x=h.length;p<x;p++){let M=h[p],g=o[p],_,b=c[p];if(g.mode===Xi.TRIANGLES||g.mode===Xi.TRIANGLE_STRIP||g.mode===Xi.TRIANGLE_FAN||g.mode===void 0){let P=r.isSkinnedMesh===!0,w=M.hasAttribute("skinIndex")&&M.hasAttribute("skinWeight");P&&w===!1&&console.warn("THREE.GLTFLoader: Missing skinIndex or skinWeight attributes. Skinning disabled."),_=P&&w?new Qa(M,b):new In(M,b),_.isSkinnedMesh===!0&&_.normalizeSkinWeights()}else if(g.mode===Xi.LINES)_=new $r(M,b);else if(g.mode===Xi.LINE_STRIP)_=new Kr(M,b);else if(g.mode===Xi.LINE_LOOP)_=new nl(M,b);else if(g.mode===Xi.POINTS)_=new il(M,b);else throw new Error("THREE.GLTFLoader: Primitive mode unsupported: "+g.mode);Object.keys(_.geometry.morphAttributes).length>0&&HE(_,r),_.name=t.createUniqueName(r.name||"mesh_"+e),As(_,r),g.extensions&&lo(s,_,g),t.assignFinalMaterial(_),u.push(_)}for(let p=0,x=u.length;p<x;p++)t.associations.set(u[p],{meshes:e,primitives:p});if(u.length===1)return r.extensions&&lo(s,u[0],r),u[0];let f=new Di;r.extensions&&lo(s,f,r),t.associations.set(f,{meshes:e});for(let p=0,x=u.length;p<x;p++)f.add(u[p]);return f})}loadCamera(e){let t,n=this.json.cameras[e],s=n[n.type];if(!s){console.warn("THREE.GLTFLoader: Missing camera parameters.");return}return n.type==="perspective"?t=new On(ha.radToDeg(s.yfov),s.aspectRatio||1,s.znear||1,s.zfar||2e6):n.type==="orthographic"&&(t=new eo(-s.xmag,s.xmag,s.ymag,-s.ymag,s.znear,s.zfar)),n.name&&(t.name=this.createUniqueName(n.name)),As(t,n),Promise.resolve(t)}loadSkin(e){let t=this.json.skins[e],n=[];for(let s=0,r=t.joints.length;s<r;s++)n.push(this._loadNodeShallow(t.joints[s]));return t.inverseBindMatrices!==void 0?n.push(this.getDependency("accessor",t.inverseBindMatrices)):n.push(null),Promise.all(n).then(function(s){let r=s.pop(),o=s,a=[],l=[];for(let c=0,h=o.length;c<h;c++){let u=o[c];if(u){a.push(u);let f=new Mt;r!==null&&f.fromArray(r.array,c*16),l.push(f)}else console.warn('THREE.GLTFLoader: Joint "%s" could not be found.',t.joints[c])}return new el(a,l)})}loadAnimation(e){let t=this.json,n=this,s=t.animations[e],r=s.name?s.name:"animation_"+e,o=[],a=[],l=[],c=[],h=[];for(let u=0,f=s.channels.length;u<f;u++){let p=s.channels[u],x=s.samplers[p.sampler],M=p.target,g=M.node,_=s.parameters!==void 0?s.parameters[x.input]:x.input,b=s.parameters!==void 0?s.parameters[x.output]:x.output;M.node!==void 0&&(o.push(this.getDependency("node",g)),a.push(this.getDependency("accessor",_)),l.push(this.getDependency("accessor",b)),c.push(x),h.push(M))}return Promise.all([Promise.all(o),Promise.all(a),Promise.all(l),Promise.all(c),Promise.all(h)]).then(function(u){let f=u[0],p=u[1],x=u[2],M=u[3],g=u[4],_=[];for(let P=0,w=f.length;P<w;P++){let D=f[P],I=p[P],y=x[P],T=M[P],G=g[P];if(D===void 0)continue;D.updateMatrix&&D.updateMatrix();let k=n._createAnimationTracks(D,I,y,T,G);if(k)for(let O=0;O<k.length;O++)_.push(k[O])}let b=new ll(r,void 0,_);return As(b,s),b})}createNodeMesh(e){let t=this.json,n=this,s=t.nodes[e];return s.mesh===void 0?null:n.getDependency("mesh",s.mesh).then(function(r){let o=n._getNodeRef(n.meshCache,s.mesh,r);return s.weights!==void 0&&o.traverse(function(a){if(a.isMesh)for(let l=0,c=s.weights.length;l<c;l++)a.morphTargetInfluences[l]=s.weights[l]}),o})}loadNode(e){let t=this.json,n=this,s=t.nodes[e],r=n._loadNodeShallow(e),o=[],a=s.children||[];for(let c=0,h=a.length;c<h;c++)o.push(n.getDependency("node",a[c]));let l=s.skin===void 0?Promise.resolve(null):n.getDependency("skin",s.skin);return Promise.all([r,Promise.all(o),l]).then(function(c){let h=c[0],u=c[1],f=c[2];f!==null&&h.traverse(function(p){p.isSkinnedMesh&&p.bind(f,WE)});for(let p=0,x=u.length;p<x;p++)h.add(u[p]);if(h.userData.pivot!==void 0&&u.length>0){let p=h.userData.pivot,x=u[0];h.pivot=new Q().fromArray(p),h.position.x-=p[0],h.position.y-=p[1],h.position.z-=p[2],x.position.set(0,0,0),delete h.userData.pivot}return h})}_loadNodeShallow(e){let t=this.json,n=this.extensions,s=this;if(this.nodeCache[e]!==void 0)return this.nodeCache[e];let r=t.nodes[e],o=r.name?s.createUniqueName(r.name):"",a=[],l=s._invokeOne(function(c){return c.createNodeMesh&&c.createNodeMesh(e)});return l&&a.push(l),r.camera!==void 0&&a.push(s.getDependency("camera",r.camera).then(function(c){return s._getNodeRef(s.cameraCache,r.camera,c)})),s._invokeAll(function(c){return c.createNodeAttachment&&c.createNodeAttachment(e)}).forEach(function(c){a.push(c)}),this.nodeCache[e]=Promise.all(a).then(function(c){let h;if(r.isBone===!0?h=new Jo:c.length>1?h=new Di:c.length===1?h=c[0]:h=new xn,h!==c[0])for(let u=0,f=c.length;u<f;u++)h.add(c[u]);if(r.name&&(h.userData.name=r.name,h.name=o),As(h,r),r.extensions&&lo(n,h,r),r.matrix!==void 0){let u=new Mt;u.fromArray(r.matrix),h.applyMatrix4(u)}else r.translation!==void 0&&h.position.fromArray(r.translation),r.rotation!==void 0&&h.quaternion.fromArray(r.rotation),r.scale!==void 0&&h.scale.fromArray(r.scale);if(!s.associations.has(h))s.associations.set(h,{});else if(r.mesh!==void 0&&s.meshCache.refs[r.mesh]>1){let u=s.associations.get(h);s.associations.set(h,{...u})}return s.associations.get(h).nodes=e,h}),this.nodeCache[e]}loadScene(e){let t=this.extensions,n=this.json.scenes[e],s=this,r=new Di;n.name&&(r.name=s.createUniqueName(n.name)),As(r,n),n.extensions&&lo(t,r,n);let o=n.nodes||[],a=[];for(let l=0,c=o.length;l<c;l++)a.push(s.getDependency("node",o[l]));return Promise.all(a).then(function(l){for(let h=0,u=l.length;h<u;h++){let f=l[h];f.parent!==null?r.add(I_(f)):r.add(f)}let c=h=>{let u=new Map;for(let[f,p]of s.associations)(f instanceof xi||f instanceof Yn)&&u.set(f,p);return h.traverse(f=>{let p=s.associations.get(f);p!=null&&u.set(f,p)}),u};return s.associations=c(r),r})}_createAnimationTracks(e,t,n,s,r){let o=[],a=e.name?e.name:e.uuid,l=[];function c(p){p.morphTargetInfluences&&l.push(p.name?p.name:p.uuid)}Cr[r.path]===Cr.weights?(c(e),e.isGroup&&e.children.forEach(c)):l.push(a);let h;switch(Cr[r.path]){case Cr.weights:h=Ks;break;case Cr.rotation:h=$s;break;case Cr.translation:case Cr.scale:h=Er;break;default:n.itemSize===1?h=Ks:h=Er;break}let u=s.interpolation!==void 0?BE[s.interpolation]:Yr,f=this._getArrayFromAccessor(n);for(let p=0,x=l.length;p<x;p++){let M=new h(l[p]+"."+Cr[r.path],t.array,f,u);s.interpolation==="CUBICSPLINE"&&this._createCubicSplineTrackInterpolant(M),o.push(M)}return o}_getArrayFromAccessor(e){let t=e.array;if(e.normalized){let n=gp(t.constructor),s=new Float32Array(t.length);for(let r=0,o=t.length;r<o;r++)s[r]=t[r]*n;t=s}return t}_createCubicSplineTrackInterpolant(e){e.createInterpolant=function(n){let s=this instanceof $s?pp:cu;return new s(this.times,this.values,this.getValueSize()/3,n)},e.createInterpolant.isInterpolantFactoryMethodGLTFCubicSpline=!0}};function XE(i,e,t){let n=e.attributes,s=new ui;if(n.POSITION!==void 0){let a=t.json.accessors[n.POSITION],l=a.min,c=a.max;if(l!==void 0&&c!==void 0){if(s.set(new Q(l[0],l[1],l[2]),new Q(c[0],c[1],c[2])),a.normalized){let h=gp(pa[a.componentType]);s.min.multiplyScalar(h),s.max.multiplyScalar(h)}}else{console.warn("THREE.GLTFLoader: Missing min/max properties for accessor POSITION.");return}}else return;let r=e.targets;if(r!==void 0){let a=new Q,l=new Q;for(let c=0,h=r.length;c<h;c++){let u=r[c];if(u.POSITION!==void 0){let f=t.json.accessors[u.POSITION],p=f.min,x=f.max;if(p!==void 0&&x!==void 0){if(l.setX(Math.max(Math.abs(p[0]),Math.abs(x[0]))),l.setY(Math.max(Math.abs(p[1]),Math.abs(x[1]))),l.setZ(Math.max(Math.abs(p[2]),Math.abs(x[2]))),f.normalized){let M=gp(pa[f.componentType]);l.multiplyScalar(M)}a.max(l)}else console.warn("THREE.GLTFLoader: Missing min/max properties for accessor POSITION.")}}s.expandByVector(a)}i.boundingBox=s;let o=new _i;s.getCenter(o.center),o.radius=s.min.distanceTo(s.max)/2,i.boundingSphere=o}function U_(i,e,t){let n=e.attributes,s=[];function r(o,a){return t.getDependency("accessor",o).then(function(l){i.setAttribute(a,l)})}for(let o in n){let a=mp[o]||o.toLowerCase();a in i.attributes||s.push(r(n[o],a))}if(e.indices!==void 0&&!i.index){let o=t.getDependency("accessor",e.indices).then(function(a){i.setIndex(a)});s.push(o)}return Ct.workingColorSpace!==cn&&"COLOR_0"in n&&console.warn(`THREE.GLTFLoader: Converting vertex colors from "srgb-linear" to "${Ct.workingColorSpace}" not supported.`),As(i,e),XE(i,e,t),Promise.all(s).then(function(){return e.targets!==void 0?zE(i,e.targets,t):i})}var ma=class extends Error{};async function Ol(i,e){let t;try{t=await fetch(i,e)}catch(s){throw s.name==="AbortError"?s:new ma("splitnerf does not answer; is the command still running?")}if(t.ok)return t;let n=await t.json().catch(()=>({}));throw new Error(n.error??`the server answers ${t.status}`)}async function xp(i,e){try{return await i()}catch(t){throw e?.aborted?t:new ma("the connection broke off; what was missing is asked for again once splitnerf answers")}}var hu=async(i,e)=>{let t=await Ol(i);return xp(()=>t[e]())},ga=()=>hu("scene.json","json"),F_=i=>hu(`assets/${i}`,"arrayBuffer"),B_=i=>hu(`photos/${i}`,"blob"),k_=i=>hu(`curves/${i}`,"json"),z_=i=>Ol(`control/${i}`,{method:"POST"}),uu=async i=>jh(await ZE(`lights/${i}`));async function H_(i){return(await(await Ol(`lights?name=${encodeURIComponent(i.name)}`,{method:"POST",body:i})).json()).number}async function G_(i,e,t){let s=(await Ol("final",{method:"POST",body:i,signal:e})).body.getReader(),r=new Uint8Array(0);for(;;){let{value:o,done:a}=await xp(()=>s.read(),e);if(a)return;r=YE(r,o);for(let l;l=qE(r);r=l.rest)t(l)}}var Ul=20;function qE(i){if(i.length<Ul)return null;let e=new DataView(i.buffer,i.byteOffset),[t,n,s,r,o]=[0,4,8,12,16].map(l=>e.getUint32(l,!0));if(i.length<Ul+o)return null;let a=Pl(i.slice(Ul,Ul+o).buffer,n,s);return{asset:t,spp:r,texture:a,rest:i.subarray(Ul+o)}}function YE(i,e){let t=new Uint8Array(i.length+e.length);return t.set(i),t.set(e,i.length),t}async function ZE(i){let e=await Ol(i),[t,n]=e.headers.get("Picture-Size").split("x").map(Number);return Pl(await xp(()=>e.arrayBuffer()),t,n)}var KE=150,$E=1024,JE=128,jE={vertexShader:"varying vec2 place; void main() { place = uv; gl_Position = vec4(position.xy, 0.0, 1.0); }",fragmentShader:`
    uniform sampler2D picture;
    uniform bool denoise;
    varying vec2 place;
    vec4 straight(vec2 offset) {
      vec4 radiance = texture2D(picture, vec2(place.x, 1.0 - place.y) + offset / vec2(textureSize(picture, 0)));
      return vec4(radiance.rgb / max(radiance.a, 1e-4), radiance.a);
    }
    void main() {
      gl_FragColor = straight(vec2(0.0));
      if (denoise) {
        vec4 near[9];
        for (int i = 0; i < 9; i++) near[i] = straight(vec2(i % 3 - 1, i / 3 - 1));
        for (int i = 0; i < 9; i++) {
          vec4 smaller = vec4(0.0);
          for (int j = 0; j < 9; j++) smaller += vec4(lessThan(near[j], near[i])) + (j < i ? vec4(equal(near[j], near[i])) : vec4(0.0));
          gl_FragColor = mix(gl_FragColor, near[i], vec4(equal(smaller, vec4(4.0))));
        }
      }
      #include <tonemapping_fragment>
      #include <colorspace_fragment>
    }`},fu=class{constructor(){this.material=new fi({...jE,uniforms:{picture:{value:null},denoise:{value:!1}},transparent:!0,depthTest:!1}),this.mesh=new In(new Ss(2,2),this.material),this.mesh.frustumCulled=!1}set(e,t){this.paths=t,this.material.uniforms.picture.value?.dispose(),this.material.uniforms.picture.value=e}render(e,t,n){this.material.uniforms.denoise.value=n&&this.paths<JE,e.render(this.mesh,t)}},du=class{constructor(e,t,n,s){Object.assign(this,{viewer:e,numbers:t,say:n,failed:s,on:!1}),e.addEventListener("drawn",()=>this.follow())}set(e){e!==this.on&&(this.on=e,this.say(""),this.stop(),this.viewer.draw())}stop(){clearTimeout(this.timer),this.request?.abort(),this.asked=void 0;for(let e of this.viewer.views)e.setPicture(null)}follow(){if(!this.on)return;let e=JSON.stringify(this.camera());if(e===this.asked)return;this.stop(),this.asked=e,this.viewer.draw();let{channel:t,wireframe:n,unfolded:s}=this.viewer.values;t===0&&!n&&!s&&(this.timer=setTimeout(()=>this.ask(e),KE))}camera(){let[,,e,t]=this.viewer.boxes[0],n=Math.min(1,$E/Math.max(e,t)),[s,r]=[Math.max(1,Math.round(n*e)),Math.max(1,Math.round(n*t))],o=this.viewer.camera.matrixWorld.clone().transpose().elements,{turn:a,channel:l,wireframe:c,unfolded:h,paths:u}=this.viewer.values,f=this.viewer.views[0].casts(this.viewer.through),p=this.viewer.views.map(x=>x.version);return{pose:o,intrinsics:this.viewer.intrinsics(s,r),width:s,height:r,turn:a,lights:this.numbers(),ground:f,paths:Number(u),shown:[l,c,h],versions:p}}async ask(e){let t=this.request=new AbortController;this.say("path tracing …");try{await G_(e,t.signal,({asset:n,spp:s,texture:r})=>{this.viewer.views[n].setPicture(r,s),this.say(`path traced, ${s} ${s===1?"path":"paths"} a pixel`),this.viewer.draw()})}catch(n){t.signal.aborted||this.failed(n)}}};var V_=512,QE=3,vp=96,eT=8,tT=.05,W_=(i,e)=>new hi(V_,V_,{type:i,format:e,depthBuffer:!1}),nT=(i,e,t={})=>new In(new Ss(2,2),new fi({vertexShader:"varying vec2 place; void main() { place = uv; gl_Position = vec4(position.xy, 0.0, 1.0); }",fragmentShader:i,uniforms:e,depthTest:!1,depthWrite:!1,...t})),pu=class{constructor(){this.hidden=W_(ti,un),this.sum=W_(hn,un),this.mask=new Vi({side:ei,toneMapped:!1}),this.add=nT(`uniform sampler2D map; varying vec2 place; void main() { gl_FragColor = vec4(texture2D(map, place).r / ${vp.toFixed(1)}); }`,{map:{value:this.hidden.texture}},{transparent:!0,blending:rh,blendSrc:gl,blendDst:gl}),this.add.frustumCulled=!1,this.plane=new In(new Ss(2,2),new fi({vertexShader:"varying vec2 place; void main() { place = uv; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }",fragmentShader:`
          uniform sampler2D map; uniform float share; varying vec2 place;
          void main() {
            float edge = smoothstep(1.0, 0.6, 2.0 * distance(place, vec2(0.5)));
            gl_FragColor = vec4(vec3(0.0), share * edge * texture2D(map, place).r);
          }`,uniforms:{map:{value:this.sum.texture},share:{value:0}},transparent:!0,depthWrite:!1})),this.eye=new Qr,this.directions=[],this.done=0}place(e){let t=new ui().setFromObject(e),n=t.getCenter(new Q);this.radius=.5*t.getSize(new Q).length(),this.plane.position.set(n.x,n.y,t.min.z-.001*this.radius),this.plane.scale.setScalar(QE*this.radius),this.done=0}setLight(e,t){if(e===this.light&&t===this.turn)return;e!==this.light&&(this.samples=e&&iT(e.image)),Object.assign(this,{light:e,turn:t});let[n,s]=[Math.cos(t*Math.PI/180),Math.sin(t*Math.PI/180)];this.directions=(this.samples??[]).map(([r,o,a])=>[n*r-s*o,s*r+n*o,a]),this.done=0}grow(e,t){if(!this.radius||this.done>=this.directions.length)return!1;let[n,s]=[e.getClearColor(new ft),e.toneMapping];e.toneMapping=Wi;let r=new Vs,o=t.parent;r.add(t),r.overrideMaterial=this.mask,e.setClearColor(0,0),this.done===0&&(e.setRenderTarget(this.sum),e.clear());for(let a of this.directions.slice(this.done,this.done+=eT))this.lookAlong(a),e.setRenderTarget(this.hidden),e.clear(),e.render(r,this.eye),e.setRenderTarget(this.sum),e.render(this.add,this.eye);return o.add(t),e.setRenderTarget(null),e.setClearColor(n,1),e.toneMapping=s,this.plane.material.uniforms.share.value=vp/this.done,this.done<this.directions.length}lookAlong([e,t,n]){let{x:s,y:r,z:o}=this.plane.position,[a,l,c]=[e/n,t/n,1/this.plane.scale.x];this.eye.projectionMatrix.set(c,0,-c*a,c*(a*o-s),0,c,-c*l,c*(l*o-r),0,0,-.1*c,.1*c*o,0,0,0,1),this.eye.projectionMatrixInverse.copy(this.eye.projectionMatrix).invert()}};function iT({data:i,width:e,height:t}){let n=Le.fromHalfFloat,s=Math.floor(t/2),r=new Float64Array(s*e),o=new Float64Array(s);for(let l=0,c=0;l<s;l++){let h=(l+.5)/t*Math.PI,u=Math.cos(h)>tT?Math.cos(h)*Math.sin(h):0;for(let f=0,p=0;f<e;f++){let x=4*(l*e+f);p+=u*(n(i[x])+n(i[x+1])+n(i[x+2])),r[l*e+f]=p}o[l]=c+=r[l*e+e-1]}if(!(o[s-1]>0))return[];let a=(l,c)=>{let h=c*l[l.length-1],u=Math.min(l.findIndex(p=>p>h)>>>0,l.length-1),f=u&&l[u-1];return[u,u+Math.min((h-f)/(l[u]-f),1)]};return Array.from({length:vp},(l,c)=>{let[h,u]=a(o,(.5+c*.7548776662)%1),[,f]=a(r.subarray(h*e,(h+1)*e),(.5+c*.569840291)%1),[p,x]=[u/t*Math.PI,2*Math.PI*(.5-f/e)];return[Math.sin(p)*Math.cos(x),Math.sin(p)*Math.sin(x),Math.cos(p)]})}var X_=Math.PI/2,yp=new ft(9409174),mu=class{constructor(){this.scene=new Vs,this.object=new Di,this.ground=new pu,this.scene.add(this.object,this.ground.plane),this.uniforms={channel:{value:0},unfolded:{value:!1},stretch:{value:new lt}},this.light=null,this.version=0,this.plate=new fu}async setAsset(e){let{scene:t}=await new au().parseAsync(e,"");this.object.traverse(n=>n.isMesh&&sT(n)),this.object.clear(),t.rotation.x=X_,t.traverse(n=>{n.isMesh&&(n.material=E_(n.material,this.uniforms))}),this.object.add(t),this.ground.place(this.object),this.setSurface()}setSurface(){let{wireframe:e,unfolded:t}=this.values;this.uniforms.unfolded.value=t,this.object.traverse(({isMesh:n,material:s})=>{if(!n)return;s.userData.side??=s.side;let r=t?ei:s.userData.side;r!==s.side&&Object.assign(s,{side:r,needsUpdate:!0}),s.wireframe=e}),this.object.traverse(n=>n.frustumCulled=!t)}setLight(e){this.light?.dispose(),this.light=this.scene.environment=e,this.setBackground(),this.ground.setLight(e,this.values.turn)}set(e){this.values=e,this.uniforms.channel.value=e.channel;let t=e.turn*Math.PI/180;for(let n of[this.scene.environmentRotation,this.scene.backgroundRotation])n.set(X_,0,t,"ZYX");this.setBackground(),this.setSurface(),this.ground.setLight(this.light,e.turn)}casts(e){let{ground:t,channel:n,wireframe:s,unfolded:r}=this.values;return t&&n===0&&!s&&!r&&!e}setBackground(){let e=this.light&&this.values.background&&this.values.channel===0&&!this.values.unfolded;this.scene.background=e?this.light:yp,this.scene.backgroundBlurriness=this.values.blur}setPicture(e,t){this.plate.set(e,t),this.object.visible=!e}render(e,t,[,,n,s],r){this.ground.plane.visible=this.object.visible&&this.casts(r);let o=Math.min(n,s);this.uniforms.stretch.value.set(o/n,o/s),e.render(this.scene,t),this.object.visible||this.plate.render(e,t,this.values.denoise)}};function sT({geometry:i,material:e}){i.dispose();for(let t of Object.values(e))t?.isTexture&&t.dispose();e.dispose()}var rT={none:_l,neutral:vl,agx:xl},q_=90,_a=class extends EventTarget{constructor(e,t){super(),this.canvas=e,this.start=t.camera,this.renderer=new Kh({canvas:e,antialias:!0}),this.renderer.autoClear=!1,this.renderer.setClearColor(yp),this.camera=new On,this.camera.up.set(0,0,1),this.controls=new ru(this.camera,e),this.controls.addEventListener("start",()=>this.leave()),this.controls.addEventListener("change",()=>this.draw()),this.views=t.sources.map(()=>new mu),this.overlay=new Vs,this.boxes=[],this.through=null,this.factor=1,this.spunAt=0,this.bar=We("div",{class:"bar3d",title:"a length at the object's middle, in the units of the data"}),this.axes=We("div",{class:"bar3d axes3d","aria-hidden":"true"}),e.after(this.bar,this.axes),this.home(),new ResizeObserver(()=>this.draw()).observe(e)}home(){this.leave();let{position:e,target:t,radius:n}=this.start;this.camera.position.set(...e),this.controls.target.set(...t),this.controls.minDistance=.1*n,this.controls.maxDistance=50*n,this.controls.update(),this.draw()}move(e,t,n=1){this.leave();let s=new qn().setFromUnitVectors(this.camera.up,new Q(0,1,0)),r=this.camera.position.clone().sub(this.controls.target).applyQuaternion(s),o=new Tr().setFromVector3(r);o.theta+=e,o.phi-=t,o.radius=Math.min(Math.max(o.radius*n,this.controls.minDistance),this.controls.maxDistance),r.setFromSpherical(o.makeSafe()).applyQuaternion(s.invert()),this.camera.position.copy(this.controls.target).add(r),this.controls.update(),this.draw()}lookThrough(e){if(this.through=e,this.factor=e?.exposure??1,e){let t=new Q(...this.start.target);Hd(e.pose).decompose(this.camera.position,this.camera.quaternion,new Q);let n=new Q(0,0,-1).applyQuaternion(this.camera.quaternion),s=Math.max(t.sub(this.camera.position).dot(n),this.controls.minDistance);this.controls.target.copy(this.camera.position).addScaledVector(n,s)}this.draw()}leave(){this.through&&(this.lookThrough(null),this.controls.update(),this.dispatchEvent(new Event("left")))}set(e){this.values=e,e.spin&&!this.controls.autoRotate&&(this.spunAt=performance.now()),this.controls.autoRotate=e.spin,this.renderer.toneMapping=rT[e.tone];for(let t of this.views)t.set(e);this.draw()}draw(){this.asked??=requestAnimationFrame(()=>{this.asked=void 0,this.drawNow()})}drawNow(){let{clientWidth:e,clientHeight:t}=this.canvas;if(!e||!t)return;this.spin();let n=this.renderer.getSize(new lt);this.renderer.setPixelRatio(Math.min(window.devicePixelRatio,2)),(n.x!==e||n.y!==t)&&this.renderer.setSize(e,t,!1);let s=this.views.map(r=>r.casts(this.through)&&r.ground.grow(this.renderer,r.object));this.renderer.toneMappingExposure=this.factor*2**this.values.exposure,this.renderer.setScissorTest(!1),this.renderer.clear(),this.renderer.setScissorTest(!0),this.boxes=this.views.map((r,o)=>this.box(o*e/this.views.length,e/this.views.length,t)),this.setLens(this.boxes[0][2],this.boxes[0][3]),this.views.forEach((r,o)=>{this.renderer.setViewport(...this.boxes[o]),this.renderer.setScissor(...this.boxes[o]),r.render(this.renderer,this.camera,this.boxes[o],this.through),this.renderer.render(this.overlay,this.camera)}),this.measure(),this.dispatchEvent(new Event("drawn")),s.some(Boolean)&&this.draw()}spin(){let e=performance.now();this.controls.autoRotate&&!this.through&&this.controls.update(Math.min((e-this.spunAt)/1e3,1)),this.spunAt=e}measure(){let{channel:e,unfolded:t}=this.values??{},[,,n,s]=this.boxes[0],r=this.intrinsics(n,s)[0]/this.camera.position.distanceTo(this.controls.target),o=10**Math.floor(Math.log10(q_/r)),a=[5,2,1].find(u=>u*o*r<=q_)*o;this.bar.hidden=e===void 0||t,this.bar.textContent=String(Number(a.toPrecision(1))),this.bar.style.width=`${a*r}px`,this.axes.hidden=this.bar.hidden;let l=this.camera.quaternion.clone().invert(),c=["x","y","z"].map((u,f)=>({name:u,...new Q().setComponent(f,1).applyQuaternion(l)}));c.sort((u,f)=>u.z-f.z);let h=c.map(({name:u,x:f,y:p})=>`<path class="${u}" d="M0 0L${20*f} ${-20*p}"/><text x="${27*f}" y="${4-27*p}">${u}</text>`);this.axes.innerHTML=`<svg viewBox="-34 -34 68 68" width="68">${h.join("")}</svg>`}save(e){this.drawNow(),this.canvas.toBlob(t=>{let n=We("a",{href:URL.createObjectURL(t),download:`${e}.png`});n.click(),URL.revokeObjectURL(n.href)})}box(e,t,n){if(!this.through)return[e,0,t,n];let s=Math.min(t/this.through.width,n/this.through.height),[r,o]=[s*this.through.width,s*this.through.height];return[e+(t-r)/2,(n-o)/2,r,o]}intrinsics(e,t){if(this.through){let[s,r,o,a]=this.through.intrinsics,[l,c]=[e/this.through.width,t/this.through.height];return[s*l,r*c,o*l,a*c]}let n=Math.min(e,t)/2/Math.tan(this.start.half_field);return[n,n,e/2,t/2]}setLens(e,t){let[n,s,r,o]=this.intrinsics(e,t),a=this.camera.position.distanceTo(new Q(...this.start.target)),l=Math.max(a-3*this.start.radius,.01*a),c=a+100*this.start.radius,h=[-r/n,(e-r)/n,o/s,(o-t)/s].map(u=>l*u);this.camera.projectionMatrix.makePerspective(...h,l,c),this.camera.projectionMatrixInverse.copy(this.camera.projectionMatrix).invert(),this.camera.updateMatrixWorld()}};var qi=Uint8Array,xa=Uint16Array,oT=Int32Array,Y_=new qi([0,0,0,0,0,0,0,0,1,1,1,1,2,2,2,2,3,3,3,3,4,4,4,4,5,5,5,5,0,0,0,0]),Z_=new qi([0,0,0,0,1,1,2,2,3,3,4,4,5,5,6,6,7,7,8,8,9,9,10,10,11,11,12,12,13,13,0,0]),aT=new qi([16,17,18,0,8,7,9,6,10,5,11,4,12,3,13,2,14,1,15]),K_=function(i,e){for(var t=new xa(31),n=0;n<31;++n)t[n]=e+=1<<i[n-1];for(var s=new oT(t[30]),n=1;n<30;++n)for(var r=t[n];r<t[n+1];++r)s[r]=r-t[n]<<5|n;return{b:t,r:s}},$_=K_(Y_,2),J_=$_.b,lT=$_.r;J_[28]=258,lT[258]=28;var j_=K_(Z_,0),cT=j_.b,CI=j_.r,bp=new xa(32768);for(Gt=0;Gt<32768;++Gt)ir=(Gt&43690)>>1|(Gt&21845)<<1,ir=(ir&52428)>>2|(ir&13107)<<2,ir=(ir&61680)>>4|(ir&3855)<<4,bp[Gt]=((ir&65280)>>8|(ir&255)<<8)>>1;var ir,Gt,Fl=(function(i,e,t){for(var n=i.length,s=0,r=new xa(e);s<n;++s)i[s]&&++r[i[s]-1];var o=new xa(e);for(s=1;s<e;++s)o[s]=o[s-1]+r[s-1]<<1;var a;if(t){a=new xa(1<<e);var l=15-e;for(s=0;s<n;++s)if(i[s])for(var c=s<<4|i[s],h=e-i[s],u=o[i[s]-1]++<<h,f=u|(1<<h)-1;u<=f;++u)a[bp[u]>>l]=c}else for(a=new xa(n),s=0;s<n;++s)i[s]&&(a[s]=bp[o[i[s]-1]++]>>15-i[s]);return a}),Bl=new qi(288);for(Gt=0;Gt<144;++Gt)Bl[Gt]=8;var Gt;for(Gt=144;Gt<256;++Gt)Bl[Gt]=9;var Gt;for(Gt=256;Gt<280;++Gt)Bl[Gt]=7;var Gt;for(Gt=280;Gt<288;++Gt)Bl[Gt]=8;var Gt,Q_=new qi(32);for(Gt=0;Gt<32;++Gt)Q_[Gt]=5;var Gt;var hT=Fl(Bl,9,1);var uT=Fl(Q_,5,1),Sp=function(i){for(var e=i[0],t=1;t<i.length;++t)i[t]>e&&(e=i[t]);return e},ls=function(i,e,t){var n=e/8|0;return(i[n]|i[n+1]<<8)>>(e&7)&t},Mp=function(i,e){var t=e/8|0;return(i[t]|i[t+1]<<8|i[t+2]<<16)>>(e&7)},fT=function(i){return(i+7)/8|0},dT=function(i,e,t){return(e==null||e<0)&&(e=0),(t==null||t>i.length)&&(t=i.length),new qi(i.subarray(e,t))};var pT=["unexpected EOF","invalid block type","invalid length/literal","invalid distance","stream finished","no stream handler",,"no callback","invalid UTF-8 data","extra field too long","date not in range 1980-2099","filename too long","stream finishing","invalid zip data"],cs=function(i,e,t){var n=new Error(e||pT[i]);if(n.code=i,Error.captureStackTrace&&Error.captureStackTrace(n,cs),!t)throw n;return n},mT=function(i,e,t,n){var s=i.length,r=n?n.length:0;if(!s||e.f&&!e.l)return t||new qi(0);var o=!t,a=o||e.i!=2,l=e.i;o&&(t=new qi(s*3));var c=function(et){var bt=t.length;if(et>bt){var vt=new qi(Math.max(bt*2,et));vt.set(t),t=vt}},h=e.f||0,u=e.p||0,f=e.b||0,p=e.l,x=e.d,M=e.m,g=e.n,_=s*8;do{if(!p){h=ls(i,u,1);var b=ls(i,u+1,3);if(u+=3,b)if(b==1)p=hT,x=uT,M=9,g=5;else if(b==2){var I=ls(i,u,31)+257,y=ls(i,u+10,15)+4,T=I+ls(i,u+5,31)+1;u+=14;for(var G=new qi(T),k=new qi(19),O=0;O<y;++O)k[aT[O]]=ls(i,u+O*3,7);u+=y*3;for(var Y=Sp(k),Z=(1<<Y)-1,U=Fl(k,Y,1),O=0;O<T;){var W=U[ls(i,u,Z)];u+=W&15;var P=W>>4;if(P<16)G[O++]=P;else{var $=0,q=0;for(P==16?(q=3+ls(i,u,3),u+=2,$=G[O-1]):P==17?(q=3+ls(i,u,7),u+=3):P==18&&(q=11+ls(i,u,127),u+=7);q--;)G[O++]=$}}var xe=G.subarray(0,I),ne=G.subarray(I);M=Sp(xe),g=Sp(ne),p=Fl(xe,M,1),x=Fl(ne,g,1)}else cs(1);else{var P=fT(u)+4,w=i[P-4]|i[P-3]<<8,D=P+w;if(D>s){l&&cs(0);break}a&&c(f+w),t.set(i.subarray(P,D),f),e.b=f+=w,e.p=u=D*8,e.f=h;continue}if(u>_){l&&cs(0);break}}a&&c(f+131072);for(var se=(1<<M)-1,de=(1<<g)-1,ge=u;;ge=u){var $=p[Mp(i,u)&se],pe=$>>4;if(u+=$&15,u>_){l&&cs(0);break}if($||cs(2),pe<256)t[f++]=pe;else if(pe==256){ge=u,p=null;break}else{var re=pe-254;if(pe>264){var O=pe-257,Te=Y_[O];re=ls(i,u,(1<<Te)-1)+J_[O],u+=Te}var Ie=x[Mp(i,u)&de],Oe=Ie>>4;Ie||cs(3),u+=Ie&15;var ne=cT[Oe];if(Oe>3){var Te=Z_[Oe];ne+=Mp(i,u)&(1<<Te)-1,u+=Te}if(u>_){l&&cs(0);break}a&&c(f+131072);var ye=f+re;if(f<ne){var $e=r-ne,ut=Math.min(ne,ye);for($e+f<0&&cs(3);f<ut;++f)t[f]=n[$e+f]}for(;f<ye;++f)t[f]=t[f-ne]}}e.l=p,e.p=ge,e.b=f,e.f=h,p&&(h=1,e.m=M,e.d=x,e.n=g)}while(!h);return f!=t.length&&o?dT(t,0,f):t.subarray(0,f)};var gT=new qi(0);var _T=function(i,e){return((i[0]&15)!=8||i[0]>>4>7||(i[0]<<8|i[1])%31)&&cs(6,"invalid zlib data"),(i[1]>>5&1)==+!e&&cs(6,"invalid zlib data: "+(i[1]&32?"need":"unexpected")+" dictionary"),(i[1]>>3&4)+2};function va(i,e){return mT(i.subarray(_T(i,e&&e.dictionary),-4),{i:2},e&&e.out,e&&e.dictionary)}var xT=typeof TextDecoder<"u"&&new TextDecoder,vT=0;try{xT.decode(gT,{stream:!0}),vT=1}catch{}var gu=class extends jr{constructor(e){super(e),this.type=hn,this.outputFormat=un,this.part=0}parse(e){let G=Math.pow(2.7182818,2.2),k=null,O=null;function Y(m,d){let v=0;for(let C=0;C<65536;++C)(C==0||m[C>>3]&1<<(C&7))&&(d[v++]=C);let A=v-1;for(;v<65536;)d[v++]=0;return A}function Z(m){for(let d=0;d<16384;d++)m[d]={},m[d].len=0,m[d].lit=0,m[d].p=null}let U={l:0,c:0,lc:0};function W(m,d,v,A,C){for(;v<m;)d=d<<8|Ae(A,C),v+=8;v-=m,U.l=d>>v&(1<<m)-1,U.c=d,U.lc=v}let $=new Array(59);function q(m){for(let v=0;v<=58;++v)$[v]=0;for(let v=0;v<65537;++v)$[m[v]]+=1;let d=0;for(let v=58;v>0;--v){let A=d+$[v]>>1;$[v]=d,d=A}for(let v=0;v<65537;++v){let A=m[v];A>0&&(m[v]=A|$[A]++<<6)}}function xe(m,d,v,A,C,F){let L=d,J=0,X=0;for(;A<=C;A++){if(L.value-d.value>v)return!1;W(6,J,X,m,L);let j=U.l;if(J=U.c,X=U.lc,F[A]=j,j==63){if(L.value-d.value>v)throw new Error("THREE.EXRLoader: Something wrong with hufUnpackEncTable");W(8,J,X,m,L);let te=U.l+6;if(J=U.c,X=U.lc,A+te>C+1)throw new Error("THREE.EXRLoader: Something wrong with hufUnpackEncTable");for(;te--;)F[A++]=0;A--}else if(j>=59){let te=j-59+2;if(A+te>C+1)throw new Error("THREE.EXRLoader: Something wrong with hufUnpackEncTable");for(;te--;)F[A++]=0;A--}}q(F)}function ne(m){return m&63}function se(m){return m>>6}function de(m,d,v,A){for(;d<=v;d++){let C=se(m[d]),F=ne(m[d]);if(C>>F)throw new Error("THREE.EXRLoader: Invalid table entry");if(F>14){let L=A[C>>F-14];if(L.len)throw new Error("THREE.EXRLoader: Invalid table entry");if(L.lit++,L.p){let J=L.p;L.p=new Array(L.lit);for(let X=0;X<L.lit-1;++X)L.p[X]=J[X]}else L.p=new Array(1);L.p[L.lit-1]=d}else if(F){let L=0;for(let J=1<<14-F;J>0;J--){let X=A[(C<<14-F)+L];if(X.len||X.p)throw new Error("THREE.EXRLoader: Invalid table entry");X.len=F,X.lit=d,L++}}}return!0}let ge={c:0,lc:0};function pe(m,d,v,A){m=m<<8|Ae(v,A),d+=8,ge.c=m,ge.lc=d}let re={c:0,lc:0};function Te(m,d,v,A,C,F,L,J,X){if(m==d){A<8&&(pe(v,A,C,F),v=ge.c,A=ge.lc),A-=8;let j=v>>A;if(j=new Uint8Array([j])[0],J.value+j>X)return!1;let te=L[J.value-1];for(;j-- >0;)L[J.value++]=te}else if(J.value<X)L[J.value++]=m;else return!1;re.c=v,re.lc=A}function Ie(m){return m&65535}function Oe(m){let d=Ie(m);return d>32767?d-65536:d}let ye={a:0,b:0};function $e(m,d){let v=Oe(m),C=Oe(d),F=v+(C&1)+(C>>1),L=F,J=F-C;ye.a=L,ye.b=J}function ut(m,d){let v=Ie(m),A=Ie(d),C=v-(A>>1)&65535,F=A+C-32768&65535;ye.a=F,ye.b=C}function et(m,d,v,A,C,F,L){let J=L<16384,X=v>C?C:v,j=1,te,fe;for(;j<=X;)j<<=1;for(j>>=1,te=j,j>>=1;j>=1;){fe=0;let le=fe+F*(C-te),ce=F*j,be=F*te,we=A*j,Ee=A*te,ze,it,ve,rt;for(;fe<=le;fe+=be){let Re=fe,Xe=fe+A*(v-te);for(;Re<=Xe;Re+=Ee){let Ve=Re+we,Nt=Re+ce,Et=Nt+we;J?($e(m[Re+d],m[Nt+d]),ze=ye.a,ve=ye.b,$e(m[Ve+d],m[Et+d]),it=ye.a,rt=ye.b,$e(ze,it),m[Re+d]=ye.a,m[Ve+d]=ye.b,$e(ve,rt),m[Nt+d]=ye.a,m[Et+d]=ye.b):(ut(m[Re+d],m[Nt+d]),ze=ye.a,ve=ye.b,ut(m[Ve+d],m[Et+d]),it=ye.a,rt=ye.b,ut(ze,it),m[Re+d]=ye.a,m[Ve+d]=ye.b,ut(ve,rt),m[Nt+d]=ye.a,m[Et+d]=ye.b)}if(v&j){let Ve=Re+ce;J?$e(m[Re+d],m[Ve+d]):ut(m[Re+d],m[Ve+d]),ze=ye.a,m[Ve+d]=ye.b,m[Re+d]=ze}}if(C&j){let Re=fe,Xe=fe+A*(v-te);for(;Re<=Xe;Re+=Ee){let Ve=Re+we;J?$e(m[Re+d],m[Ve+d]):ut(m[Re+d],m[Ve+d]),ze=ye.a,m[Ve+d]=ye.b,m[Re+d]=ze}}te=j,j>>=1}return fe}function bt(m,d,v,A,C,F,L,J,X){let j=0,te=0,fe=L,le=Math.trunc(A.value+(C+7)/8);for(;A.value<le;)for(pe(j,te,v,A),j=ge.c,te=ge.lc;te>=14;){let be=j>>te-14&16383,we=d[be];if(we.len)te-=we.len,Te(we.lit,F,j,te,v,A,J,X,fe),j=re.c,te=re.lc;else{if(!we.p)throw new Error("THREE.EXRLoader: hufDecode issues");let Ee;for(Ee=0;Ee<we.lit;Ee++){let ze=ne(m[we.p[Ee]]);for(;te<ze&&A.value<le;)pe(j,te,v,A),j=ge.c,te=ge.lc;if(te>=ze&&se(m[we.p[Ee]])==(j>>te-ze&(1<<ze)-1)){te-=ze,Te(we.p[Ee],F,j,te,v,A,J,X,fe),j=re.c,te=re.lc;break}}if(Ee==we.lit)throw new Error("THREE.EXRLoader: hufDecode issues")}}let ce=8-C&7;for(j>>=ce,te-=ce;te>0;){let be=d[j<<14-te&16383];if(be.len)te-=be.len,Te(be.lit,F,j,te,v,A,J,X,fe),j=re.c,te=re.lc;else throw new Error("THREE.EXRLoader: hufDecode issues")}return!0}function vt(m,d,v,A,C,F){let L={value:0},J=v.value,X=ue(d,v),j=ue(d,v);v.value+=4;let te=ue(d,v);if(v.value+=4,X<0||X>=65537||j<0||j>=65537)throw new Error("THREE.EXRLoader: Something wrong with HUF_ENCSIZE");let fe=new Array(65537),le=new Array(16384);Z(le);let ce=A-(v.value-J);if(xe(m,v,ce,X,j,fe),te>8*(A-(v.value-J)))throw new Error("THREE.EXRLoader: Something wrong with hufUncompress");de(fe,X,j,le),bt(fe,le,m,v,te,j,F,C,L)}function _t(m,d,v){for(let A=0;A<v;++A)d[A]=m[d[A]]}function Yt(m){for(let d=1;d<m.length;d++){let v=m[d-1]+m[d]-128;m[d]=v}}function Ft(m,d){let v=0,A=Math.floor((m.length+1)/2),C=0,F=m.length-1;for(;!(C>F||(d[C++]=m[v++],C>F));)d[C++]=m[A++]}function fn(m){let d=m.byteLength,v=new Array,A=0,C=new DataView(m);for(;d>0;){let F=C.getInt8(A++);if(F<0){let L=-F;d-=L+1;for(let J=0;J<L;J++)v.push(C.getUint8(A++))}else{let L=F;d-=2;let J=C.getUint8(A++);for(let X=0;X<L+1;X++)v.push(J)}}return v}function Vt(m,d,v,A,C,F){let L=new DataView(F.buffer),J=v[m.idx[0]].width,X=v[m.idx[0]].height,j=3,te=Math.floor(J/8),fe=Math.ceil(J/8),le=Math.ceil(X/8),ce=J-(fe-1)*8,be=X-(le-1)*8,we={value:0},Ee=new Array(j),ze=new Array(j),it=new Array(j),ve=new Array(j),rt=new Array(j);for(let Xe=0;Xe<j;++Xe)rt[Xe]=d[m.idx[Xe]],Ee[Xe]=Xe<1?0:Ee[Xe-1]+fe*le,ze[Xe]=new Float32Array(64),it[Xe]=new Uint16Array(64),ve[Xe]=new Uint16Array(fe*64);for(let Xe=0;Xe<le;++Xe){let Ve=8;Xe==le-1&&(Ve=be);let Nt=8;for(let ht=0;ht<fe;++ht){ht==fe-1&&(Nt=ce);for(let qe=0;qe<j;++qe)it[qe].fill(0),it[qe][0]=C[Ee[qe]++],Pt(we,A,it[qe]),yn(it[qe],ze[qe]),nn(ze[qe]);j==3&&Sn(ze);for(let qe=0;qe<j;++qe)xt(ze[qe],ve[qe],ht*64)}let Et=0;for(let ht=0;ht<j;++ht){let qe=v[m.idx[ht]].type;for(let Tt=8*Xe;Tt<8*Xe+Ve;++Tt){Et=rt[ht][Tt];for(let Kt=0;Kt<te;++Kt){let ot=Kt*64+(Tt&7)*8;L.setUint16(Et+0*qe,ve[ht][ot+0],!0),L.setUint16(Et+2*qe,ve[ht][ot+1],!0),L.setUint16(Et+4*qe,ve[ht][ot+2],!0),L.setUint16(Et+6*qe,ve[ht][ot+3],!0),L.setUint16(Et+8*qe,ve[ht][ot+4],!0),L.setUint16(Et+10*qe,ve[ht][ot+5],!0),L.setUint16(Et+12*qe,ve[ht][ot+6],!0),L.setUint16(Et+14*qe,ve[ht][ot+7],!0),Et+=16*qe}}if(te!=fe)for(let Tt=8*Xe;Tt<8*Xe+Ve;++Tt){let Kt=rt[ht][Tt]+8*te*2*qe,ot=te*64+(Tt&7)*8;for(let Bt=0;Bt<Nt;++Bt)L.setUint16(Kt+Bt*2*qe,ve[ht][ot+Bt],!0)}}}let Re=new Uint16Array(J);L=new DataView(F.buffer);for(let Xe=0;Xe<j;++Xe){v[m.idx[Xe]].decoded=!0;let Ve=v[m.idx[Xe]].type;if(v[Xe].type==2)for(let Nt=0;Nt<X;++Nt){let Et=rt[Xe][Nt];for(let ht=0;ht<J;++ht)Re[ht]=L.getUint16(Et+ht*2*Ve,!0);for(let ht=0;ht<J;++ht)L.setFloat32(Et+ht*2*Ve,Le.fromHalfFloat(Re[ht]),!0)}}}function Tn(m,d,v,A,C,F){let L=new DataView(F.buffer),J=v[m],X=J.width,j=J.height,te=Math.ceil(X/8),fe=Math.ceil(j/8),le=Math.floor(X/8),ce=X-(te-1)*8,be=j-(fe-1)*8,we={value:0},Ee=0,ze=new Float32Array(64),it=new Uint16Array(64),ve=new Uint16Array(te*64);for(let rt=0;rt<fe;++rt){let Re=8;rt==fe-1&&(Re=be);for(let Xe=0;Xe<te;++Xe)it.fill(0),it[0]=C[Ee++],Pt(we,A,it),yn(it,ze),nn(ze),xt(ze,ve,Xe*64);for(let Xe=8*rt;Xe<8*rt+Re;++Xe){let Ve=d[m][Xe];for(let Nt=0;Nt<le;++Nt){let Et=Nt*64+(Xe&7)*8;for(let ht=0;ht<8;++ht)L.setUint16(Ve+ht*2*J.type,ve[Et+ht],!0);Ve+=16*J.type}if(te!=le){let Nt=le*64+(Xe&7)*8;for(let Et=0;Et<ce;++Et)L.setUint16(Ve+Et*2*J.type,ve[Nt+Et],!0)}}}J.decoded=!0}function Pt(m,d,v){let A,C=1;for(;C<64;)A=d[m.value],A==65280?C=64:A>>8==255?C+=A&255:(v[C]=A,C++),m.value++}function yn(m,d){d[0]=Le.fromHalfFloat(m[0]),d[1]=Le.fromHalfFloat(m[1]),d[2]=Le.fromHalfFloat(m[5]),d[3]=Le.fromHalfFloat(m[6]),d[4]=Le.fromHalfFloat(m[14]),d[5]=Le.fromHalfFloat(m[15]),d[6]=Le.fromHalfFloat(m[27]),d[7]=Le.fromHalfFloat(m[28]),d[8]=Le.fromHalfFloat(m[2]),d[9]=Le.fromHalfFloat(m[4]),d[10]=Le.fromHalfFloat(m[7]),d[11]=Le.fromHalfFloat(m[13]),d[12]=Le.fromHalfFloat(m[16]),d[13]=Le.fromHalfFloat(m[26]),d[14]=Le.fromHalfFloat(m[29]),d[15]=Le.fromHalfFloat(m[42]),d[16]=Le.fromHalfFloat(m[3]),d[17]=Le.fromHalfFloat(m[8]),d[18]=Le.fromHalfFloat(m[12]),d[19]=Le.fromHalfFloat(m[17]),d[20]=Le.fromHalfFloat(m[25]),d[21]=Le.fromHalfFloat(m[30]),d[22]=Le.fromHalfFloat(m[41]),d[23]=Le.fromHalfFloat(m[43]),d[24]=Le.fromHalfFloat(m[9]),d[25]=Le.fromHalfFloat(m[11]),d[26]=Le.fromHalfFloat(m[18]),d[27]=Le.fromHalfFloat(m[24]),d[28]=Le.fromHalfFloat(m[31]),d[29]=Le.fromHalfFloat(m[40]),d[30]=Le.fromHalfFloat(m[44]),d[31]=Le.fromHalfFloat(m[53]),d[32]=Le.fromHalfFloat(m[10]),d[33]=Le.fromHalfFloat(m[19]),d[34]=Le.fromHalfFloat(m[23]),d[35]=Le.fromHalfFloat(m[32]),d[36]=Le.fromHalfFloat(m[39]),d[37]=Le.fromHalfFloat(m[45]),d[38]=Le.fromHalfFloat(m[52]),d[39]=Le.fromHalfFloat(m[54]),d[40]=Le.fromHalfFloat(m[20]),d[41]=Le.fromHalfFloat(m[22]),d[42]=Le.fromHalfFloat(m[33]),d[43]=Le.fromHalfFloat(m[38]),d[44]=Le.fromHalfFloat(m[46]),d[45]=Le.fromHalfFloat(m[51]),d[46]=Le.fromHalfFloat(m[55]),d[47]=Le.fromHalfFloat(m[60]),d[48]=Le.fromHalfFloat(m[21]),d[49]=Le.fromHalfFloat(m[34]),d[50]=Le.fromHalfFloat(m[37]),d[51]=Le.fromHalfFloat(m[47]),d[52]=Le.fromHalfFloat(m[50]),d[53]=Le.fromHalfFloat(m[56]),d[54]=Le.fromHalfFloat(m[59]),d[55]=Le.fromHalfFloat(m[61]),d[56]=Le.fromHalfFloat(m[35]),d[57]=Le.fromHalfFloat(m[36]),d[58]=Le.fromHalfFloat(m[48]),d[59]=Le.fromHalfFloat(m[49]),d[60]=Le.fromHalfFloat(m[57]),d[61]=Le.fromHalfFloat(m[58]),d[62]=Le.fromHalfFloat(m[62]),d[63]=Le.fromHalfFloat(m[63])}function nn(m){let d=.5*Math.cos(.7853975),v=.5*Math.cos(3.14159/16),A=.5*Math.cos(3.14159/8),C=.5*Math.cos(3*3.14159/16),F=.5*Math.cos(5*3.14159/16),L=.5*Math.cos(3*3.14159/8),J=.5*Math.cos(7*3.14159/16),X=new Array(4),j=new Array(4),te=new Array(4),fe=new Array(4);for(let le=0;le<8;++le){let ce=le*8;X[0]=A*m[ce+2],X[1]=L*m[ce+2],X[2]=A*m[ce+6],X[3]=L*m[ce+6],j[0]=v*m[ce+1]+C*m[ce+3]+F*m[ce+5]+J*m[ce+7],j[1]=C*m[ce+1]-J*m[ce+3]-v*m[ce+5]-F*m[ce+7],j[2]=F*m[ce+1]-v*m[ce+3]+J*m[ce+5]+C*m[ce+7],j[3]=J*m[ce+1]-F*m[ce+3]+C*m[ce+5]-v*m[ce+7],te[0]=d*(m[ce+0]+m[ce+4]),te[3]=d*(m[ce+0]-m[ce+4]),te[1]=X[0]+X[3],te[2]=X[1]-X[2],fe[0]=te[0]+te[1],fe[1]=te[3]+te[2],fe[2]=te[3]-te[2],fe[3]=te[0]-te[1],m[ce+0]=fe[0]+j[0],m[ce+1]=fe[1]+j[1],m[ce+2]=fe[2]+j[2],m[ce+3]=fe[3]+j[3],m[ce+4]=fe[3]-j[3],m[ce+5]=fe[2]-j[2],m[ce+6]=fe[1]-j[1],m[ce+7]=fe[0]-j[0]}for(let le=0;le<8;++le)X[0]=A*m[16+le],X[1]=L*m[16+le],X[2]=A*m[48+le],X[3]=L*m[48+le],j[0]=v*m[8+le]+C*m[24+le]+F*m[40+le]+J*m[56+le],j[1]=C*m[8+le]-J*m[24+le]-v*m[40+le]-F*m[56+le],j[2]=F*m[8+le]-v*m[24+le]+J*m[40+le]+C*m[56+le],j[3]=J*m[8+le]-F*m[24+le]+C*m[40+le]-v*m[56+le],te[0]=d*(m[le]+m[32+le]),te[3]=d*(m[le]-m[32+le]),te[1]=X[0]+X[3],te[2]=X[1]-X[2],fe[0]=te[0]+te[1],fe[1]=te[3]+te[2],fe[2]=te[3]-te[2],fe[3]=te[0]-te[1],m[0+le]=fe[0]+j[0],m[8+le]=fe[1]+j[1],m[16+le]=fe[2]+j[2],m[24+le]=fe[3]+j[3],m[32+le]=fe[3]-j[3],m[40+le]=fe[2]-j[2],m[48+le]=fe[1]-j[1],m[56+le]=fe[0]-j[0]}function Sn(m){for(let d=0;d<64;++d){let v=m[0][d],A=m[1][d],C=m[2][d];m[0][d]=v+1.5747*C,m[1][d]=v-.1873*A-.4682*C,m[2][d]=v+1.8556*A}}let V=new Float32Array(1),He=new Uint32Array(V.buffer);function ct(m){V[0]=m;let d=He[0],v=d>>>16&32768,A=d&2147483647;if(A>=1199570944)return v|(A>2139095040?32256:31744);if(A<947912704)return V[0]=Math.abs(m)+.5,v|He[0]-1056964608;let C=A+4095+(A>>>13&1);return v|C-939524096>>>13}function xt(m,d,v){if(O===null){O=new Uint16Array(65536);for(let A=1;A<65536;++A){if((A&31744)===31744)continue;let C=Le.fromHalfFloat(A),F=Math.abs(C),L=F<=1?Math.pow(F,2.2):Math.pow(G,F-1);O[A]=ct(C<0?-L:L)}}for(let A=0;A<64;++A)d[v+A]=O[ct(m[A])]}function Ne(m){return new DataView(m.array.buffer,m.offset.value,m.size)}function Zt(m){let d=m.viewer.buffer.slice(m.offset.value,m.offset.value+m.size),v=new Uint8Array(fn(d)),A=new Uint8Array(v.length);return Yt(v),Ft(v,A),new DataView(A.buffer)}function je(m){let d=m.array.slice(m.offset.value,m.offset.value+m.size),v=va(d),A=new Uint8Array(v.length);return Yt(v),Ft(v,A),new DataView(A.buffer)}function at(m){let d=m.viewer,v={value:m.offset.value},A=new Uint16Array(m.columns*m.lines*(m.inputChannels.length*m.type)),C=new Uint8Array(8192),F=0,L=new Array(m.inputChannels.length);for(let be=0,we=m.inputChannels.length;be<we;be++)L[be]={},L[be].start=F,L[be].end=L[be].start,L[be].nx=m.columns,L[be].ny=m.lines,L[be].size=m.type,F+=L[be].nx*L[be].ny*L[be].size;let J=Pe(d,v),X=Pe(d,v);if(X>=8192)throw new Error("THREE.EXRLoader: Something is wrong with PIZ_COMPRESSION BITMAP_SIZE");if(J<=X)for(let be=0;be<X-J+1;be++)C[be+J]=H(d,v);let j=new Uint16Array(65536),te=Y(C,j),fe=ue(d,v);vt(m.array,d,v,fe,A,F);for(let be=0;be<m.inputChannels.length;++be){let we=L[be];for(let Ee=0;Ee<L[be].size;++Ee)et(A,we.start+Ee,we.nx,we.size,we.ny,we.nx*we.size,te)}_t(j,A,F);let le=0,ce=new Uint8Array(A.buffer.byteLength);for(let be=0;be<m.lines;be++)for(let we=0;we<m.inputChannels.length;we++){let Ee=L[we],ze=Ee.nx*Ee.size,it=new Uint8Array(A.buffer,Ee.end*2,ze*2);ce.set(it,le),le+=ze*2,Ee.end+=ze}return new DataView(ce.buffer)}function N(m){let d=m.array.slice(m.offset.value,m.offset.value+m.size),v=va(d),A=m.inputChannels.length*m.lines*m.columns*m.totalBytes,C=new ArrayBuffer(A),F=new DataView(C),L=0,J=0,X=new Array(4);for(let j=0;j<m.lines;j++)for(let te=0;te<m.inputChannels.length;te++){let fe=0;switch(m.inputChannels[te].pixelType){case 1:X[0]=L,X[1]=X[0]+m.columns,L=X[1]+m.columns;for(let ce=0;ce<m.columns;++ce){let be=v[X[0]++]<<8|v[X[1]++];fe+=be,F.setUint16(J,fe,!0),J+=2}break;case 2:X[0]=L,X[1]=X[0]+m.columns,X[2]=X[1]+m.columns,L=X[2]+m.columns;for(let ce=0;ce<m.columns;++ce){let be=v[X[0]++]<<24|v[X[1]++]<<16|v[X[2]++]<<8;fe+=be,F.setUint32(J,fe,!0),J+=4}break}}return F}function E(m){let d=m.array,v=m.offset.value,A=m.columns,C=m.lines,F=m.inputChannels,L=m.totalBytes,J=gn.compression==="B44A_COMPRESSION",X=new Uint8Array(C*A*L),j=new Uint16Array(16),te=0;for(let fe=0;fe<F.length;fe++){let le=F[fe],ce=le.pixelType*2,be=Math.ceil(A/le.xSampling),we=Math.ceil(C/le.ySampling),Ee=le.xSampling===1&&le.ySampling===1;if(le.pixelType!==1){for(let ve=0;ve<we;ve++)if(Ee){let rt=ve*A*L+te*A;for(let Re=0;Re<be*ce;Re++)X[rt+Re]=d[v++]}else v+=be*ce;te+=ce;continue}let ze=Math.ceil(be/4),it=Math.ceil(we/4);for(let ve=0;ve<it;ve++)for(let rt=0;rt<ze;rt++){if(J&&d[v+2]>=52){let Re=d[v]<<8|d[v+1],Xe=Re&32768?Re&32767:~Re&65535;j.fill(Xe),v+=3}else{let Re=d[v]<<8|d[v+1],Xe=d[v+2]>>2,Ve=32<<Xe,Nt=Re+((d[v+2]<<4|d[v+3]>>4)&63)*(1<<Xe)-Ve&65535,Et=Nt+((d[v+3]<<2|d[v+4]>>6)&63)*(1<<Xe)-Ve&65535,ht=Et+(d[v+4]&63)*(1<<Xe)-Ve&65535,qe=Re+(d[v+5]>>2&63)*(1<<Xe)-Ve&65535,Tt=Nt+((d[v+5]<<4|d[v+6]>>4)&63)*(1<<Xe)-Ve&65535,Kt=Et+((d[v+6]<<2|d[v+7]>>6)&63)*(1<<Xe)-Ve&65535,ot=ht+(d[v+7]&63)*(1<<Xe)-Ve&65535,Bt=qe+(d[v+8]>>2&63)*(1<<Xe)-Ve&65535,_n=Tt+((d[v+8]<<4|d[v+9]>>4)&63)*(1<<Xe)-Ve&65535,fs=Kt+((d[v+9]<<2|d[v+10]>>6)&63)*(1<<Xe)-Ve&65535,bi=ot+(d[v+10]&63)*(1<<Xe)-Ve&65535,Ki=Bt+(d[v+11]>>2&63)*(1<<Xe)-Ve&65535,ar=_n+((d[v+11]<<4|d[v+12]>>4)&63)*(1<<Xe)-Ve&65535,lr=fs+((d[v+12]<<2|d[v+13]>>6)&63)*(1<<Xe)-Ve&65535,$i=bi+(d[v+13]&63)*(1<<Xe)-Ve&65535,Oi=[Re,qe,Bt,Ki,Nt,Tt,_n,ar,Et,Kt,fs,lr,ht,ot,bi,$i];for(let Rs=0;Rs<16;Rs++)j[Rs]=Oi[Rs]&32768?Oi[Rs]&32767:~Oi[Rs]&65535;v+=14}if(le.pLinear){if(k===null){k=new Uint16Array(65536);for(let Re=0;Re<65536;Re++)if((Re&31744)===31744||Re>32768)k[Re]=0;else{let Xe=Le.fromHalfFloat(Re);k[Re]=Xe<=0?0:Le.toHalfFloat(8*Math.log(Xe))}}for(let Re=0;Re<16;Re++)j[Re]=k[j[Re]]}for(let Re=0;Re<4;Re++){let Xe=ve*4+Re;if(!(Xe>=we))for(let Ve=0;Ve<4;Ve++){let Nt=rt*4+Ve;if(Nt>=be)continue;let Et=j[Re*4+Ve];for(let ht=0;ht<le.ySampling;ht++){let qe=Xe*le.ySampling+ht;if(!(qe>=C))for(let Tt=0;Tt<le.xSampling;Tt++){let Kt=Nt*le.xSampling+Tt;if(Kt>=A)continue;let ot=qe*A*L+te*A+Kt*2;X[ot]=Et&255,X[ot+1]=Et>>8&255}}}}}te+=2}return new DataView(X.buffer)}function ee(m){let d=m.viewer,v={value:m.offset.value},A=new Uint8Array(m.columns*m.lines*(m.inputChannels.length*m.type*2)),C={version:he(d,v),unknownUncompressedSize:he(d,v),unknownCompressedSize:he(d,v),acCompressedSize:he(d,v),dcCompressedSize:he(d,v),rleCompressedSize:he(d,v),rleUncompressedSize:he(d,v),rleRawSize:he(d,v),totalAcUncompressedCount:he(d,v),totalDcUncompressedCount:he(d,v),acCompression:he(d,v)};if(C.version<2)throw new Error("THREE.EXRLoader: "+gn.compression+" version "+C.version+" is unsupported");let F=new Array,L=Pe(d,v)-2;for(;L>0;){let we=Se(d.buffer,v),Ee=H(d,v),ze=Ee>>2&3,it=(Ee>>4)-1,ve=new Int8Array([it])[0],rt=H(d,v);F.push({name:we,index:ve,type:rt,compression:ze}),L-=we.length+3}let J=gn.channels,X=new Array(m.inputChannels.length);for(let we=0;we<m.inputChannels.length;++we){let Ee=X[we]={},ze=J[we];Ee.name=ze.name,Ee.compression=0,Ee.decoded=!1,Ee.type=ze.pixelType,Ee.pLinear=ze.pLinear,Ee.width=m.columns,Ee.height=m.lines}let j={idx:new Array(3)};for(let we=0;we<m.inputChannels.length;++we){let Ee=X[we],ze=Ee.name.lastIndexOf("."),it=ze>=0?Ee.name.substring(ze+1):Ee.name;for(let ve=0;ve<F.length;++ve){let rt=F[ve];it===rt.name&&Ee.type===rt.type&&(Ee.compression=rt.compression,rt.index>=0&&(j.idx[rt.index]=we),Ee.offset=we)}}let te,fe,le;if(C.acCompressedSize>0)switch(C.acCompression){case 0:te=new Uint16Array(C.totalAcUncompressedCount),vt(m.array,d,v,C.acCompressedSize,te,C.totalAcUncompressedCount);break;case 1:let we=m.array.slice(v.value,v.value+C.totalAcUncompressedCount),Ee=va(we);te=new Uint16Array(Ee.buffer),v.value+=C.totalAcUncompressedCount;break}if(C.dcCompressedSize>0){let we={array:m.array,offset:v,size:C.dcCompressedSize};fe=new Uint16Array(je(we).buffer),v.value+=C.dcCompressedSize}if(C.rleRawSize>0){let we=m.array.slice(v.value,v.value+C.rleCompressedSize),Ee=va(we);le=fn(Ee.buffer),v.value+=C.rleCompressedSize}let ce=0,be=new Array(X.length);for(let we=0;we<be.length;++we)be[we]=new Array;for(let we=0;we<m.lines;++we)for(let Ee=0;Ee<X.length;++Ee)be[Ee].push(ce),ce+=X[Ee].width*m.type*2;j.idx[0]!==void 0&&X[j.idx[0]]&&Vt(j,be,X,te,fe,A);for(let we=0;we<X.length;++we){let Ee=X[we];if(!Ee.decoded)switch(Ee.compression){case 2:let ze=0,it=0;for(let ve=0;ve<m.lines;++ve){let rt=be[we][ze];for(let Re=0;Re<Ee.width;++Re){for(let Xe=0;Xe<2*Ee.type;++Xe)A[rt++]=le[it+Xe*Ee.width*Ee.height];it++}ze++}break;case 1:Tn(we,be,X,te,fe,A);break;default:throw new Error("THREE.EXRLoader: unsupported channel compression")}}return new DataView(A.buffer)}function Se(m,d){let v=new Uint8Array(m),A=0;for(;v[d.value+A]!=0;)A+=1;let C=new TextDecoder().decode(v.slice(d.value,d.value+A));return d.value=d.value+A+1,C}function me(m,d,v){let A=new TextDecoder().decode(new Uint8Array(m).slice(d.value,d.value+v));return d.value=d.value+v,A}function De(m,d){let v=ae(m,d),A=ue(m,d);return[v,A]}function Ue(m,d){let v=ue(m,d),A=ue(m,d);return[v,A]}function ae(m,d){let v=m.getInt32(d.value,!0);return d.value=d.value+4,v}function ue(m,d){let v=m.getUint32(d.value,!0);return d.value=d.value+4,v}function Ae(m,d){let v=m[d.value];return d.value=d.value+1,v}function H(m,d){let v=m.getUint8(d.value);return d.value=d.value+1,v}let he=function(m,d){let v=Number(m.getBigInt64(d.value,!0));return d.value+=8,v};function oe(m,d){let v=m.getFloat32(d.value,!0);return d.value+=4,v}function ke(m,d){return Le.toHalfFloat(oe(m,d))}function Pe(m,d){let v=m.getUint16(d.value,!0);return d.value+=2,v}function Fe(m,d){return Le.fromHalfFloat(Pe(m,d))}function tt(m,d,v,A){let C=v.value,F=[];for(;v.value<C+A-1;){let L=Se(d,v),J=ae(m,v),X=H(m,v);v.value+=3;let j=ae(m,v),te=ae(m,v);F.push({name:L,pixelType:J,pLinear:X,xSampling:j,ySampling:te})}return v.value+=1,F}function dt(m,d){let v=oe(m,d),A=oe(m,d),C=oe(m,d),F=oe(m,d),L=oe(m,d),J=oe(m,d),X=oe(m,d),j=oe(m,d);return{redX:v,redY:A,greenX:C,greenY:F,blueX:L,blueY:J,whiteX:X,whiteY:j}}function Me(m,d){let v=["NO_COMPRESSION","RLE_COMPRESSION","ZIPS_COMPRESSION","ZIP_COMPRESSION","PIZ_COMPRESSION","PXR24_COMPRESSION","B44_COMPRESSION","B44A_COMPRESSION","DWAA_COMPRESSION","DWAB_COMPRESSION"],A=H(m,d);return v[A]}function Je(m,d){let v=ae(m,d),A=ae(m,d),C=ae(m,d),F=ae(m,d);return{xMin:v,yMin:A,xMax:C,yMax:F}}function pt(m,d){let v=["INCREASING_Y","DECREASING_Y","RANDOM_Y"],A=H(m,d);return v[A]}function Ge(m,d){let v=["ENVMAP_LATLONG","ENVMAP_CUBE"],A=H(m,d);return v[A]}function wt(m,d){let v=["ONE_LEVEL","MIPMAP_LEVELS","RIPMAP_LEVELS"],A=["ROUND_DOWN","ROUND_UP"],C=ue(m,d),F=ue(m,d),L=H(m,d);return{xSize:C,ySize:F,levelMode:v[L&15],roundingMode:A[L>>4]}}function jt(m,d){let v=oe(m,d),A=oe(m,d);return[v,A]}function Zn(m,d){let v=oe(m,d),A=oe(m,d),C=oe(m,d);return[v,A,C]}function Ir(m,d,v,A,C){if(A==="string"||A==="stringvector"||A==="iccProfile")return me(d,v,C);if(A==="chlist")return tt(m,d,v,C);if(A==="chromaticities")return dt(m,v);if(A==="compression")return Me(m,v);if(A==="box2i")return Je(m,v);if(A==="envmap")return Ge(m,v);if(A==="tiledesc")return wt(m,v);if(A==="lineOrder")return pt(m,v);if(A==="float")return oe(m,v);if(A==="v2f")return jt(m,v);if(A==="v3f")return Zn(m,v);if(A==="int")return ae(m,v);if(A==="rational")return De(m,v);if(A==="timecode")return Ue(m,v);if(A==="preview"||A==="deepImageState"||A==="idmanifest")return v.value+=C,"skipped";v.value+=C}function sr(m,d){let v=Math.log2(m);return d=="ROUND_DOWN"?Math.floor(v):Math.ceil(v)}function Sa(m,d,v){let A=0;switch(m.levelMode){case"ONE_LEVEL":A=1;break;case"MIPMAP_LEVELS":A=sr(Math.max(d,v),m.roundingMode)+1;break;case"RIPMAP_LEVELS":throw new Error("THREE.EXRLoader: RIPMAP_LEVELS tiles currently unsupported.")}return A}function Pr(m,d,v,A){let C=new Array(m);for(let F=0;F<m;F++){let L=1<<F,J=d/L|0;A=="ROUND_UP"&&J*L<d&&(J+=1);let X=Math.max(J,1);C[F]=(X+v-1)/v|0}return C}function Ui(){let m=this,d=m.offset,v={value:0};for(let A=0;A<m.tileCount;A++){let C=ae(m.viewer,d),F=ae(m.viewer,d);d.value+=8,m.size=ue(m.viewer,d);let L=C*m.blockWidth,J=F*m.blockHeight;m.columns=L+m.blockWidth>m.width?m.width-L:m.blockWidth,m.lines=J+m.blockHeight>m.height?m.height-J:m.blockHeight;let X=m.columns*m.totalBytes,te=m.size<m.lines*X?m.uncompress(m):Ne(m);d.value+=m.size;for(let fe=0;fe<m.lines;fe++){let le=fe*m.columns*m.totalBytes;for(let ce=0;ce<m.inputChannels.length;ce++){let be=gn.channels[ce].name,we=m.channelByteOffsets[be]*m.columns,Ee=m.decodeChannels[be];if(Ee===void 0)continue;v.value=le+we;let ze=(m.height-(1+J+fe))*m.outLineWidth;for(let it=0;it<m.columns;it++){let ve=ze+(it+L)*m.outputChannels+Ee;m.byteArray[ve]=m.getter(te,v)}}}}}function Yi(){let m=this,d=m.offset,v={value:0};for(let A=0;A<m.height/m.blockHeight;A++){let C=ae(m.viewer,d)-gn.dataWindow.yMin;m.size=ue(m.viewer,d),m.lines=C+m.blockHeight>m.height?m.height-C:m.blockHeight;let F=m.columns*m.totalBytes,J=m.size<m.lines*F?m.uncompress(m):Ne(m);d.value+=m.size;for(let X=0;X<m.lines;X++){let j=C+X,te=X*F,fe=(m.height-1-j)*m.outLineWidth;for(let le=0;le<m.inputChannels.length;le++){let ce=gn.channels[le].name,be=m.channelByteOffsets[ce]*m.columns,we=m.decodeChannels[ce];if(we!==void 0){v.value=te+be;for(let Ee=0;Ee<m.columns;Ee++){let ze=fe+Ee*m.outputChannels+we;m.byteArray[ze]=m.getter(J,v)}}}}}}function Zi(){let m=this,d=m.chunkOffsets,v={value:0};for(let A=0;A<d.length;A++){let C={value:d[A]};C.value+=4;let F=ae(m.viewer,C)-gn.dataWindow.yMin;m.size=ue(m.viewer,C),m.lines=F+m.blockHeight>m.height?m.height-F:m.blockHeight;let L=m.columns*m.totalBytes,J=m.size<m.lines*L,X=m.offset;m.offset=C;let j=J?m.uncompress(m):Ne(m);m.offset=X;for(let te=0;te<m.lines;te++){let fe=F+te,le=te*L,ce=(m.height-1-fe)*m.outLineWidth;for(let be=0;be<m.inputChannels.length;be++){let we=gn.channels[be].name,Ee=m.channelByteOffsets[we]*m.columns,ze=m.decodeChannels[we];if(ze!==void 0){v.value=le+Ee;for(let it=0;it<m.columns;it++){let ve=ce+it*m.outputChannels+ze;m.byteArray[ve]=m.getter(j,v)}}}}}}function rr(m,d,v,A){if(v===0)return null;let C=m.slice(d,d+v);switch(A){case"NO_COMPRESSION":return new DataView(C.buffer,C.byteOffset,C.byteLength);case"RLE_COMPRESSION":{let F=new Uint8Array(fn(C.buffer.slice(C.byteOffset,C.byteOffset+C.byteLength))),L=new Uint8Array(F.length);return Yt(F),Ft(F,L),new DataView(L.buffer)}case"ZIPS_COMPRESSION":{let F=va(C),L=new Uint8Array(F.length);return Yt(F),Ft(F,L),new DataView(L.buffer)}default:throw new Error("THREE.EXRLoader: "+A+" is unsupported for deep data")}}function Mi(){let m=this,d=m.chunkOffsets,v=m.width,A=m.height,C=m.deepChannels,F=gn.compression,L=m.multiPart,J=m.decodeChannels,X=m.outputChannels,j=m.byteArray instanceof Uint16Array,te=-1;for(let fe=0;fe<C.length;fe++)if(C[fe].name==="A"){te=fe;break}for(let fe=0;fe<d.length;fe++){let le={value:d[fe]};L&&(le.value+=4);let ce=ae(m.viewer,le)-gn.dataWindow.yMin,be=he(m.viewer,le),we=he(m.viewer,le);he(m.viewer,le);let Ee=rr(m.array,le.value,be,F);if(le.value+=be,Ee===null)continue;let ze=new Uint32Array(v);for(let Ve=0;Ve<v;Ve++)ze[Ve]=Ee.getUint32(Ve*4,!0);let it=ze[v-1];if(it===0){le.value+=we;continue}let ve=rr(m.array,le.value,we,F),rt=[],Re=0;for(let Ve=0;Ve<C.length;Ve++)rt.push(Re),Re+=it*C[Ve].bytesPerSample;let Xe=(A-1-ce)*m.outLineWidth;for(let Ve=0;Ve<v;Ve++){let Nt=Ve===0?0:ze[Ve-1],ht=ze[Ve]-Nt;if(ht===0)continue;let qe=new Float32Array(X),Tt=0;for(let ot=0;ot<ht;ot++){let Bt=Nt+ot,_n=1-Tt;if(_n<=0)break;let fs=1;if(te>=0){let bi=C[te].bytesPerSample,Ki=rt[te]+Bt*bi;fs=bi===2?Le.fromHalfFloat(ve.getUint16(Ki,!0)):ve.getFloat32(Ki,!0)}for(let bi=0;bi<C.length;bi++){let Ki=C[bi],ar=J[Ki.name];if(ar===void 0)continue;let lr=Ki.bytesPerSample,$i=rt[bi]+Bt*lr,Oi=lr===2?Le.fromHalfFloat(ve.getUint16($i,!0)):ve.getFloat32($i,!0);qe[ar]+=Oi*_n}Tt+=fs*_n}J.A!==void 0&&(qe[J.A]=Tt);let Kt=Xe+Ve*X;for(let ot=0;ot<X;ot++)m.byteArray[Kt+ot]=j?Le.toHalfFloat(qe[ot]):qe[ot]}}}function sn(m,d,v){let A={},C=!1;for(;;){let F=Se(d,v);if(F==="")break;C=!0;let L=Se(d,v),J=ue(m,v),X=Ir(m,d,v,L,J);X===void 0?console.warn(`THREE.EXRLoader: Skipped unknown header attribute type '${L}'.`):A[F]=X}return C?A:null}function pn(m,d,v){if(m.getUint32(0,!0)!=20000630)throw new Error("THREE.EXRLoader: Provided file doesn't appear to be in OpenEXR format.");let A=m.getUint8(4),C=m.getUint8(5),F={singleTile:!!(C&2),longName:!!(C&4),deepFormat:!!(C&8),multiPart:!!(C&16)};v.value=8;let L=[];if(F.multiPart){for(;;){let J=sn(m,d,v);if(J===null)break;J.version=A,J.spec=F,L.push(J)}if(L.length===0)throw new Error("THREE.EXRLoader: No valid part headers found.")}else{let J=sn(m,d,v);J.version=A,J.spec=F,L.push(J)}return L}function mn(m,d,v,A,C,F){let L={size:0,viewer:d,array:v,offset:A,width:m.dataWindow.xMax-m.dataWindow.xMin+1,height:m.dataWindow.yMax-m.dataWindow.yMin+1,inputChannels:m.channels,channelByteOffsets:{},shouldExpand:!1,yCbCr:!1,totalBytes:null,columns:null,lines:null,type:null,uncompress:null,getter:null,format:null,colorSpace:cn};switch(m.compression){case"NO_COMPRESSION":L.blockHeight=1,L.uncompress=Ne;break;case"RLE_COMPRESSION":L.blockHeight=1,L.uncompress=Zt;break;case"ZIPS_COMPRESSION":L.blockHeight=1,L.uncompress=je;break;case"ZIP_COMPRESSION":L.blockHeight=16,L.uncompress=je;break;case"PIZ_COMPRESSION":L.blockHeight=32,L.uncompress=at;break;case"PXR24_COMPRESSION":L.blockHeight=16,L.uncompress=N;break;case"B44_COMPRESSION":case"B44A_COMPRESSION":L.blockHeight=32,L.uncompress=E;break;case"DWAA_COMPRESSION":L.blockHeight=32,L.uncompress=ee;break;case"DWAB_COMPRESSION":L.blockHeight=256,L.uncompress=ee;break;default:throw new Error("THREE.EXRLoader: "+m.compression+" is unsupported")}let J={};for(let le of m.channels)switch(le.name){case"BY":case"RY":case"Y":case"R":case"G":case"B":case"A":J[le.name]=!0,L.type=le.pixelType}let X=!1,j=!1;if(J.Y&&J.RY&&J.BY)L.outputChannels=4,L.yCbCr=!0;else if(J.R&&J.G&&J.B)L.outputChannels=4;else if(J.Y)L.outputChannels=1;else throw new Error("THREE.EXRLoader: file contains unsupported data channels.");switch(L.outputChannels){case 4:F==un?(X=!J.A,L.format=un,L.colorSpace=cn,L.outputChannels=4,L.decodeChannels={R:0,G:1,B:2,A:3}):F==yi?(L.format=yi,L.colorSpace=cn,L.outputChannels=2,L.decodeChannels={R:0,G:1}):F==er?(L.format=er,L.colorSpace=cn,L.outputChannels=1,L.decodeChannels={R:0}):j=!0;break;case 1:F==un?(X=!0,L.format=un,L.colorSpace=cn,L.outputChannels=4,L.shouldExpand=!0,L.decodeChannels={Y:0}):F==yi?(L.format=yi,L.colorSpace=cn,L.outputChannels=2,L.shouldExpand=!0,L.decodeChannels={Y:0}):F==er?(L.format=er,L.colorSpace=cn,L.outputChannels=1,L.decodeChannels={Y:0}):j=!0;break;default:j=!0}if(j)throw new Error("THREE.EXRLoader: invalid output format for specified file.");if(L.yCbCr&&(L.format=un,L.outputChannels=4,L.decodeChannels={Y:0,RY:1,BY:2},X=!0),L.type==1)switch(C){case Pn:L.getter=Fe;break;case hn:L.getter=Pe;break}else if(L.type==2)switch(C){case Pn:L.getter=oe;break;case hn:L.getter=ke}else throw new Error("THREE.EXRLoader: unsupported pixelType "+L.type+" for "+m.compression+".");L.columns=L.width;let te=L.width*L.height*L.outputChannels;switch(C){case Pn:L.byteArray=new Float32Array(te),X&&L.byteArray.fill(1,0,te);break;case hn:L.byteArray=new Uint16Array(te),X&&L.byteArray.fill(15360,0,te);break;default:console.error("THREE.EXRLoader: unsupported type: ",C);break}let fe=0;for(let le of m.channels)L.decodeChannels[le.name]!==void 0&&(L.channelByteOffsets[le.name]=fe),fe+=le.pixelType*2;if(L.totalBytes=fe,L.outLineWidth=L.width*L.outputChannels,m.spec.deepFormat){L.deepChannels=[];let le=0;for(let ce of m.channels){let be=ce.pixelType===0?4:ce.pixelType*2;L.deepChannels.push({name:ce.name,pixelType:ce.pixelType,bytesPerSample:be}),le+=be}L.deepBytesPerSample=le,L.chunkOffsets=m._chunkOffsets,L.multiPart=m.spec.multiPart,L.decode=Mi.bind(L)}else if(m.spec.singleTile){L.blockHeight=m.tiles.ySize,L.blockWidth=m.tiles.xSize;let le=Sa(m.tiles,L.width,L.height),ce=Pr(le,L.width,m.tiles.xSize,m.tiles.roundingMode),be=Pr(le,L.height,m.tiles.ySize,m.tiles.roundingMode);L.tileCount=ce[0]*be[0];for(let we=0;we<le;we++)for(let Ee=0;Ee<be[we];Ee++)for(let ze=0;ze<ce[we];ze++)he(d,A);L.decode=Ui.bind(L)}else if(m.spec.multiPart)L.blockWidth=L.width,L.chunkOffsets=m._chunkOffsets,L.decode=Zi.bind(L);else{L.blockWidth=L.width;let le=Math.ceil(L.height/L.blockHeight);for(let ce=0;ce<le;ce++)he(d,A);L.decode=Yi.bind(L)}return L}let ii={value:0},zn=new DataView(e),hs=new Uint8Array(e),us=pn(zn,e,ii),or=Math.max(0,Math.min(this.part,us.length-1)),gn=us[or];if(gn.spec.multiPart||gn.spec.deepFormat)for(let m=0;m<us.length;m++){let d=us[m].chunkCount;if(m===or){gn._chunkOffsets=[];for(let v=0;v<d;v++)gn._chunkOffsets.push(he(zn,ii))}else for(let v=0;v<d;v++)he(zn,ii)}let wn=mn(gn,zn,hs,ii,this.type,this.outputFormat);if(wn.decode(),wn.shouldExpand){let m=wn.byteArray;if(this.outputFormat==un)for(let d=0;d<m.length;d+=4)m[d+2]=m[d+1]=m[d];else if(this.outputFormat==yi)for(let d=0;d<m.length;d+=2)m[d+1]=m[d]}if(wn.yCbCr){let m=wn.byteArray,d=wn.width*wn.height;if(this.type===hn)for(let v=0;v<d;v++){let A=v*4,C=Le.fromHalfFloat(m[A]),F=Le.fromHalfFloat(m[A+1]),L=Le.fromHalfFloat(m[A+2]),J=(1+F)*C,X=(1+L)*C,j=(C-J*.2126-X*.0722)/.7152;m[A]=Le.toHalfFloat(Math.max(0,J)),m[A+1]=Le.toHalfFloat(Math.max(0,j)),m[A+2]=Le.toHalfFloat(Math.max(0,X))}else for(let v=0;v<d;v++){let A=v*4,C=m[A],F=m[A+1],L=m[A+2],J=(1+F)*C,X=(1+L)*C;m[A]=Math.max(0,J),m[A+1]=Math.max(0,(C-J*.2126-X*.0722)/.7152),m[A+2]=Math.max(0,X)}}return{header:gn,width:wn.width,height:wn.height,data:wn.byteArray,format:wn.format,colorSpace:wn.colorSpace,type:this.type,minFilter:Xt,magFilter:Xt,generateMipmaps:!1,flipY:!1}}setDataType(e){return this.type=e,this}setOutputFormat(e){return this.outputFormat=e,this}setPart(e){return this.part=e,this}};var _u=class extends jr{constructor(e){super(e),this.type=hn}parse(e){let o=function(T,G){switch(T){case 1:throw new Error("THREE.HDRLoader: Read Error: "+(G||""));case 2:throw new Error("THREE.HDRLoader: Write Error: "+(G||""));case 3:throw new Error("THREE.HDRLoader: Bad File Format: "+(G||""));default:case 4:throw new Error("THREE.HDRLoader: Memory Error: "+(G||""))}},u=function(T,G,k){G=G||1024;let Y=T.pos,Z=-1,U=0,W="",$=String.fromCharCode.apply(null,new Uint16Array(T.subarray(Y,Y+128)));for(;0>(Z=$.indexOf(`
`))&&U<G&&Y<T.byteLength;)W+=$,U+=$.length,Y+=128,$=String.fromCharCode.apply(null,new Uint16Array(T.subarray(Y,Y+128)));return-1<Z?(k!==!1&&(T.pos+=U+Z+1),W+$.slice(0,Z)):!1},f=function(T){let G=/^#\?(\S+)/,k=/^\s*GAMMA\s*=\s*(\d+(\.\d+)?)\s*$/,O=/^\s*EXPOSURE\s*=\s*(\d+(\.\d+)?)\s*$/,Y=/^\s*FORMAT=(\S+)\s*$/,Z=/^\s*\-Y\s+(\d+)\s+\+X\s+(\d+)\s*$/,U={valid:0,string:"",comments:"",programtype:"RGBE",format:"",gamma:1,exposure:1,width:0,height:0},W,$;for((T.pos>=T.byteLength||!(W=u(T)))&&o(1,"no header found"),($=W.match(G))||o(3,"bad initial token"),U.valid|=1,U.programtype=$[1],U.string+=W+`
`;W=u(T),W!==!1;){if(U.string+=W+`
`,W.charAt(0)==="#"){U.comments+=W+`
`;continue}if(($=W.match(k))&&(U.gamma=parseFloat($[1])),($=W.match(O))&&(U.exposure=parseFloat($[1])),($=W.match(Y))&&(U.valid|=2,U.format=$[1]),($=W.match(Z))&&(U.valid|=4,U.height=parseInt($[1],10),U.width=parseInt($[2],10)),U.valid&2&&U.valid&4)break}return U.valid&2||o(3,"missing format specifier"),U.valid&4||o(3,"missing image size specifier"),U},p=function(T,G,k){let O=G;if(O<8||O>32767||T[0]!==2||T[1]!==2||T[2]&128)return new Uint8Array(T);O!==(T[2]<<8|T[3])&&o(3,"wrong scanline width");let Y=new Uint8Array(4*G*k);Y.length||o(4,"unable to allocate buffer space");let Z=0,U=0,W=4*O,$=new Uint8Array(4),q=new Uint8Array(W),xe=k;for(;xe>0&&U<T.byteLength;){U+4>T.byteLength&&o(1),$[0]=T[U++],$[1]=T[U++],$[2]=T[U++],$[3]=T[U++],($[0]!=2||$[1]!=2||($[2]<<8|$[3])!=O)&&o(3,"bad rgbe scanline format");let ne=0,se;for(;ne<W&&U<T.byteLength;){se=T[U++];let ge=se>128;if(ge&&(se-=128),(se===0||ne+se>W)&&o(3,"bad scanline data"),ge){let pe=T[U++];for(let re=0;re<se;re++)q[ne++]=pe}else q.set(T.subarray(U,U+se),ne),ne+=se,U+=se}let de=O;for(let ge=0;ge<de;ge++){let pe=0;Y[Z]=q[ge+pe],pe+=O,Y[Z+1]=q[ge+pe],pe+=O,Y[Z+2]=q[ge+pe],pe+=O,Y[Z+3]=q[ge+pe],Z+=4}xe--}return Y},x=function(T,G,k,O){let Y=T[G+3],Z=Math.pow(2,Y-128)/255;k[O+0]=T[G+0]*Z,k[O+1]=T[G+1]*Z,k[O+2]=T[G+2]*Z,k[O+3]=1},M=function(T,G,k,O){let Y=T[G+3],Z=Math.pow(2,Y-128)/255;k[O+0]=Le.toHalfFloat(Math.min(T[G+0]*Z,65504)),k[O+1]=Le.toHalfFloat(Math.min(T[G+1]*Z,65504)),k[O+2]=Le.toHalfFloat(Math.min(T[G+2]*Z,65504)),k[O+3]=Le.toHalfFloat(1)},g=new Uint8Array(e);g.pos=0;let _=f(g),b=_.width,P=_.height,w=p(g.subarray(g.pos),b,P),D,I,y;switch(this.type){case Pn:y=w.length/4;let T=new Float32Array(y*4);for(let k=0;k<y;k++)x(w,k*4,T,k*4);D=T,I=Pn;break;case hn:y=w.length/4;let G=new Uint16Array(y*4);for(let k=0;k<y;k++)M(w,k*4,G,k*4);D=G,I=hn;break;default:throw new Error("THREE.HDRLoader: Unsupported type: "+this.type)}return{width:b,height:P,data:D,header:_.string,gamma:_.gamma,exposure:_.exposure,type:I,colorSpace:cn,minFilter:Xt,magFilter:Xt,generateMipmaps:!1,flipY:!0}}setDataType(e){return this.type=e,this}};var ex={hdr:_u,exr:gu},[tx,nx]=[31744,32768];async function ix(i){let e=i.name.split(".").pop().toLowerCase();if(!(e in ex))throw new Error(`${i.name}: is no .hdr or .exr file`);let t;try{t=new ex[e]().parse(await i.arrayBuffer())}catch(a){throw new Error(`${i.name}: ${a.message??a}`)}let{data:n,width:s,height:r}=t;if(n.length!==4*s*r)throw new Error(`${i.name}: has no red, green and blue`);if(s!==2*r)throw new Error(`${i.name}: is ${s}x${r}; an equirectangular map is twice as wide as high`);if(n.some(a=>(a&tx)===tx))throw new Error(`${i.name}: has pixels that are not finite`);let o=n.some(a=>a>nx)?"Its negative radiance is shown as 0.":"";for(let a=0;a<n.length;a++)n[a]&nx&&(n[a]=0);return{name:i.name,width:s,height:r,note:o,content:e==="exr"?yT(n,4*s):n}}function yT(i,e){let t=new Uint16Array(i.length);for(let n=0;n<i.length;n+=e)t.set(i.subarray(n,n+e),i.length-e-n);return t}async function sx(i,{camera:e,lights:t,studio:n,name:s}){let r=document.getElementById("glb");if(!r)return!1;if(!document.createElement("canvas").getContext("webgl2"))return i.querySelector(".static").textContent="This browser has no WebGL 2, which the 3D view needs.",!1;let o=We("canvas",{tabindex:0,"aria-label":"The object. Drag to turn it; arrow keys turn it, + and - zoom."}),a=We("form",{"aria-label":"How to show it",autocomplete:"off"}),l=We("div",{class:"card widget object"},We("div",{class:"view3d"},o),a);i.querySelector(".place").append(l),i.classList.add("live");let c=new _a(o,{camera:e,sources:[{}]}),[h]=c.views;c.controls.enableZoom=!1,o.style.touchAction="pan-y",o.addEventListener("focus",()=>c.controls.enableZoom=!0),o.addEventListener("blur",()=>c.controls.enableZoom=!1);let u=[...t,...n],f=-1,p=async w=>{if(w===f)return;f=w;let{width:D,height:I,packed:y,content:T}=u[w],G=T??await Aa(y);f===w&&(h.setLight(jh(Pl(G,D,I))),c.draw())},x=w=>{c.set(w),p(Number(w.light))},M=We("p",{class:"hint"}),g=async w=>{try{let D=await ix(w);u.push(D),P.setLights(_(),u.length-1),P.tell(),M.textContent=D.note}catch(D){M.textContent=D.message}},_=()=>u.map((w,D)=>[D,w.name]),b=We("p",{class:"hint"},"Drag to turn; click, then the wheel zooms and keys work."),P=new da(a,c,{changed:x,name:s,lights:[...iu(g),M],last:[b]});return P.listen(l),P.setLights(_(),0),nu(g),P.tell(),await h.setAsset(await Aa(r.textContent)),c.draw(),!0}async function xu(i,e,t){for(let n of document.querySelectorAll(i))try{await e(n,t)&&n.classList.add("live")}catch(s){console.error(s)}}async function rx(){let i=JSON.parse(document.getElementById("data").textContent);Wl(Gl+Vl+Vp),addEventListener("beforeprint",()=>{for(let e of document.querySelectorAll("details"))e.open=!0}),await Promise.all([xu("[data-pairs]",Yp,i),xu("#light",T_,i),xu("#training",Sg,i)]),await xu("#object",sx,i),document.body.classList.add("ready")}var ST=8e3,vu=class{constructor(e){this.heard=e,this.line=document.getElementById("lost"),this.open(),setInterval(()=>this.last&&!this.closed&&performance.now()-this.last>ST&&this.lose(),1e3)}open(){this.source=new EventSource("events"),this.source.onmessage=({data:e})=>this.hear(JSON.parse(e)),this.source.onerror=()=>this.lose()}hear(e){this.last=performance.now(),this.lost=!1,this.line.textContent="",this.heard(e)}close(e){this.closed=!0,this.source.close(),this.line.classList.add("calm"),this.line.textContent=e}async lose(){if(!this.closed&&(this.lost=!0,this.line.textContent="The connection to splitnerf is lost; the page tries again. Does the command still run?",this.source.readyState===EventSource.CLOSED))try{await ga(),this.open()}catch(e){this.line.textContent=e.message}}};var MT={final:["f","final: path traced"],cameras:["c","the photos' cameras"],through:["n p","through the next, the previous one"],fold:["h","hide the panel"]},bT=[16,64,256,1024].map(i=>[i,`${i} paths`]),kl=i=>document.getElementById(i),yu=class extends da{constructor(e,t,n,s){let r=t.cameras.map((h,u)=>[u,h.name]),o=We("fieldset",{},nr("cameras","Cameras (click one)"),Dl("through","Look through",[[-1,"none"],...r])),a=t.sources.flatMap(({name:h,facts:u},f)=>{let p=`${h.replace(/\.glb$/i,"")}.glb`;return u?[We("p",{class:"hint"},We("a",{href:`assets/${f}`,download:p},p),`: ${u}`)]:[]}),l=r.length?[o,...a]:a;super(kl("panel"),e,{changed:n,last:l,keys:MT,name:t.sources[0].name,first:[We("div",{class:"pair"},nr("final","Final: path traced"),Dl("paths","up to",bT),nr("denoise","Denoise",!0))],lights:iu(s)}),this.form.elements.paths.value=256,this.showLights(t.lights,t.first_light??void 0),kl("fold").addEventListener("click",()=>this.fold());let c=h=>()=>r.length&&this.step("through",h);this.listen(window,{f:()=>this.toggle("final"),c:()=>r.length&&this.toggle("cameras"),n:c(1),p:c(-1),h:()=>this.fold()}),this.tell()}get values(){let{through:e=-1,cameras:t=!1,...n}=super.values;return{...n,through:Number(e),cameras:t}}setThrough(e){this.form.elements.through.value=e}showLights(e,t){let n=e.filter(o=>o.own),r=e.filter(o=>!o.own||n.length>1).map(o=>[o.number,o.name]);n.length&&r.unshift(["own",n.length>1?"each its own":n[0].name]),this.setLights(r,t)}fold(){let e=kl("panel").hidden=!kl("panel").hidden;kl("fold").setAttribute("aria-expanded",String(!e))}};var ox=150,ax=["#1c7fa8","#d1495b","#b5851b","#5c946e","#8661c1","#8f9296","#c86b98","#4f6d7a","#a3623a"],wT=i=>i.replace("loss_","").replaceAll("_"," ").replace("psnr","PSNR dB"),Su=class{constructor(e){this.element=e,this.lines=[],new ResizeObserver(()=>this.plot?.setSize({width:e.clientWidth,height:ox})).observe(e),matchMedia("(prefers-color-scheme: dark)").addEventListener("change",()=>this.build())}add(e){this.lines.push(...e),!(this.lines.length<2)&&(this.plot||this.build(),this.plot.setData(this.columns()))}columns(){let e=t=>t>0?t:null;return["step",...this.keys].map(t=>this.lines.map(n=>t==="step"?n.step:t==="psnr"?n.psnr:e(n[t])))}build(){if(this.lines.length<2)return;this.plot?.destroy(),this.keys=["psnr","loss",...Object.keys(this.lines.at(-1)).filter(s=>s.startsWith("loss_"))];let e=getComputedStyle(this.element).color,t=(s,r,o)=>({scale:s,side:r,size:o,stroke:e,font:"11px system-ui",gap:3,ticks:{size:3,stroke:e,width:1},grid:{show:r!==1,stroke:"#8883",width:1}}),n=(s,r)=>r.map(o=>o===null?"":o>=1e3?`${o/1e3}k`:String(o));this.plot=new Nn({width:this.element.clientWidth,height:ox,padding:[6,0,0,0],scales:{x:{time:!1},loss:{distr:3}},cursor:{drag:{x:!0,y:!1}},axes:[{...t("x",2,22),values:n,space:40},{...t("dB",3,26),space:24},{...t("loss",1,40)}],series:[{label:"step"},...this.keys.map((s,r)=>({label:wT(s),scale:s==="psnr"?"dB":"loss",stroke:ax[r%ax.length],width:1.5,points:{show:!1},show:r<2,value:(o,a)=>a==null?"–":s==="psnr"?a.toFixed(2):a.toPrecision(3)}))]},this.columns(),this.element)}};var ET={preparation:"Reads the data",export:"Exports the asset",refinement:"Refinement: fits asset and light to the photos",evaluation:"Scores the asset, which is final"},mi=i=>document.getElementById(i),Mu=class{constructor(e){this.failed=e,this.chart=new Su(mi("chart")),mi("training").hidden=!1,mi("pause").addEventListener("click",()=>this.press(this.state.paused?"resume":"pause")),mi("checkpoint").addEventListener("click",()=>this.press("checkpoint")),mi("stop").addEventListener("click",()=>{confirm("End the training now and deliver what there is? It can be resumed from the command line.")&&this.press("stop")})}async press(e){this.pressed=e,this.show(this.state),await z_(e).catch(this.failed)}show(e){this.state=e;let{stage:t,step:n,steps:s,progress:r,left:o,psnr:a,paused:l,saved:c,ended:h}=e,u=t==="training"&&!h;this.pressed==="checkpoint"&&c!==this.saved&&(this.pressed=void 0),this.saved=c;let f=s?`Step ${n.toLocaleString("en")} of ${s.toLocaleString("en")}`:`Step ${n.toLocaleString("en")}`;mi("phase").textContent=h?"Ended":t==="training"?l?`${f}, paused`:f:ET[t],mi("progress").hidden=!u,mi("progress").value=r;let p=[a!==null&&`PSNR ${a.toFixed(2)} dB`,u&&o!==null&&`${TT(o)} left`,u&&this.saving(c)];mi("numbers").textContent=p.filter(Boolean).join(", "),mi("buttons").hidden=!u,mi("pause").textContent=l?"Resume":"Pause",mi("checkpoint").disabled=this.pressed==="checkpoint",mi("stop").disabled=this.pressed==="stop",this.draw(e.lines).catch(()=>{})}saving(e){return this.pressed==="stop"?"stops after this step":this.pressed==="checkpoint"?"saves after this step":e!==null&&`checkpoint of step ${e.toLocaleString("en")} saved`}async draw(e){if(!(this.drawing||document.hidden||e<=this.chart.lines.length)){this.drawing=!0;try{this.chart.add(await k_(this.chart.lines.length))}finally{this.drawing=!1}}}async showLight(e){let{data:t,width:n,height:s}=(await uu(e)).image,r=Float32Array.from(t,Le.fromHalfFloat),o=r.reduce((l,c,h)=>h%4===3?l:l+c,0)/(3*n*s),a=new ImageData(n,s);r.forEach((l,c)=>a.data[c]=c%4===3?255:255*Qh(.18*l/Math.max(o,1e-9))),Object.assign(mi("recovered"),{width:n,height:s}),mi("recovered").getContext("2d").putImageData(a,0,0)}};function TT(i){let e=Math.round(i),t=[Math.floor(e/3600),Math.floor(e/60)%60,e%60];return t[0]||t.shift(),t.map((n,s)=>s?String(n).padStart(2,"0"):String(n)).join(":")}var lx=`:root { color-scheme: light dark; --card: #ffffff; --line: #dedcd7; --text: #23262b; --dim: #6d7178; --accent: #3b82c4; --grey: #8f9296; }
@media (prefers-color-scheme: dark) { :root { --card: #202327; --line: #353a41; --text: #e4e5e7; --dim: #989ea7; } }

* { box-sizing: border-box; }
html, body { height: 100%; margin: 0; }
[hidden] { display: none !important; }

body { display: flex; overflow: hidden; background: var(--grey); color: var(--text); font: 14px/1.4 system-ui, sans-serif; }
#stage { position: relative; flex: 1; min-width: 0; min-height: 0; }
#canvas { display: block; width: 100%; height: 100%; touch-action: none; outline: 0; }

#photos { position: absolute; inset: 0; overflow: hidden; pointer-events: none; }
#photos .stage { position: absolute; }
#photos img { width: 100%; height: 100%; }
#photos .tag { top: 44px; } /* below the names and the panel's button */
#photos .stage > input::-webkit-slider-thumb { width: 32px; pointer-events: auto; }
#photos .stage > input::-moz-range-thumb { width: 32px; pointer-events: auto; }

#names { position: absolute; inset: 0 0 auto; display: flex; pointer-events: none; }
#names span { flex: 1; padding: 10px 12px; overflow: hidden; text-overflow: ellipsis; white-space: nowrap; color: #fff; text-shadow: 0 0 4px #000; }
#names span + span { border-left: 1px solid #fff8; }

#said { position: absolute; left: 12px; bottom: 60px; max-width: calc(100% - 24px); margin: 0; padding: 6px 10px; border-radius: 4px;
  background: #000b; color: #fff; overflow-wrap: anywhere; }
#said:empty { display: none; }
#said.wrong { background: #8d1534; }

#lost { position: absolute; left: 12px; right: 56px; top: 40px; width: fit-content; margin: 0; padding: 6px 10px; border-radius: 4px;
  background: #8d1534; color: #fff; overflow-wrap: anywhere; }
#lost.calm { background: #000b; }
#lost:empty { display: none; }

#panel { width: 264px; overflow-y: auto; padding: 14px 16px; background: var(--card); border-left: 1px solid var(--line); }
#panel > * { margin: 0 0 12px; }

#training { padding-bottom: 12px; border-bottom: 1px solid var(--line); }
#training > * { margin: 0 0 8px; }
#phase { padding-right: 32px; font-weight: 600; }
#progress { display: block; width: 100%; accent-color: var(--accent); }
#numbers { font-variant-numeric: tabular-nums; }
#buttons { display: flex; flex-wrap: wrap; gap: 6px; }
#panel button:disabled { opacity: .45; }
#training figure { margin-bottom: 0; }
#training figcaption { font-size: 12px; }
#recovered { display: block; width: 100%; border-radius: 4px; }
.uplot { font-family: inherit; }
#chart .u-legend { font-size: 11px; line-height: 1.25; text-align: left; }
#chart .u-legend th { padding: 1px 2px; font-weight: inherit; }
#chart .u-legend td { padding: 1px 4px 1px 0; }
#chart .u-marker { width: 9px; height: 9px; }

#fold { position: fixed; right: 8px; top: 8px; width: 32px; height: 32px; border: 1px solid var(--line); border-radius: 4px;
  background: var(--card); color: inherit; font-size: 16px; cursor: pointer; }

@media (max-width: 640px) {
  body { flex-direction: column; }
  #panel { width: 100%; max-height: 45%; border-left: 0; border-top: 1px solid var(--line); }
}
`;function ya(i,e=!1){let t=document.getElementById("said");t.textContent=i,t.classList.toggle("wrong",e)}var co=i=>ya(i.message,!0),wp=class{constructor(e,t){Object.assign(this,{viewer:e,description:t,numbers:[]})}async choose(e){if(e===this.chosen)return;this.chosen=e;let t=this.asked={},{sources:n,white:s}=this.description;this.numbers=n.map(r=>e==="own"?r.light??s:Number(e));try{let r=await Promise.all(this.numbers.map(uu));if(t!==this.asked)return;this.viewer.views.forEach((o,a)=>o.setLight(r[a])),this.viewer.draw()}catch(r){throw t===this.asked&&(this.chosen=void 0),r}}async renew(e){this.description=e;let{chosen:t}=this;this.chosen=void 0,t!==void 0&&await this.choose(t)}},Ep=class{constructor(e){this.description=e,this.state={},this.viewer=new _a(document.getElementById("canvas"),e),this.lights=new wp(this.viewer,e),this.final=new du(this.viewer,()=>this.lights.numbers,ya,co),this.panel=new yu(this.viewer,this.marked(e),t=>this.set(t),t=>this.opened(t)),this.cameras=new ou(this.viewer,e.cameras),this.cameras.changed=t=>this.panel.setThrough(t),this.cameras.failed=t=>B_(t).catch(co),this.training=e.training?new Mu(co):null,document.title=`${e.sources.map(t=>t.name).join(" | ")} – splitnerf ${this.training?"train":"view"}`,document.getElementById("names").replaceChildren(...e.sources.map(t=>Object.assign(document.createElement("span"),{textContent:t.name}))),nu(t=>this.opened(t))}set(e){this.viewer.set(e),this.cameras?.show(e.cameras),this.cameras?.look(e.through),this.lights.choose(e.light).catch(co),this.final.set(e.final)}marked(e){let t=e.sources.map(n=>n.light);for(let n of e.lights)n.own=t.includes(n.number);return e}async opened(e){ya(`reading ${e.name} …`);try{let t=await H_(e);this.panel.showLights(this.marked(await ga()).lights,t),this.panel.tell(),ya("")}catch(t){co(t)}}async heard(e){this.training?.show(e),this.state=e,await this.loading,await this.renew(),e.ended&&this.connection.close(`The end: ${e.ended}.`)}async renew(){let{version:e,ended:t}=this.state,n=this.viewer.views.some((s,r)=>s.version!==(e??this.description.sources[r].version));this.loading||document.hidden&&!t||!(n||this.lights.chosen===void 0)||(this.loading=this.load().finally(()=>this.loading=void 0),await this.loading)}async load(){try{let e=this.viewer.views.every(r=>r.version===0),t=this.marked(await ga());await Promise.all(this.viewer.views.map((r,o)=>this.loadInto(r,o,t.sources[o]))),this.description=t,this.panel.showLights(t.lights,this.panel.values.light),this.viewer.start=t.camera,e&&this.viewer.home(),(!e||this.training)&&await this.lights.renew(t);let n=t.sources[0].light;n!==null&&await this.training?.showLight(n),this.panel.tell();let s=t.sources.some(r=>r.version===0);ya(s?"the surface is shown once the training begins":t.problems.join(`
`),t.problems.length>0)}catch(e){co(e)}}async loadInto(e,t,n){if(e.version!==n.version)try{await e.setAsset(await F_(t)),e.version=n.version}catch(s){throw s instanceof ma||(e.version=n.version),s}}};async function RT(){let i=new Ep(await ga());ya("loading …"),await i.load(),i.connection=new vu(e=>i.heard(e)),document.addEventListener("visibilitychange",()=>i.renew())}function cx(){return Wl(Gl+Vl+lx),RT().catch(co).finally(()=>document.body.classList.add("ready"))}(document.getElementById("data")?rx:cx)();})();
