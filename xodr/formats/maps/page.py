"""A map as a page to look at in a browser, and as a picture: lanes by type, directions,
connections, faults, differences.

The page is one file without any other; it draws what is in view only, so that large maps stay
usable.
"""

from __future__ import annotations

import html
import json
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from shapely import LineString

from schemas.common.array_types import FloatArray
from xodr.formats.maps.lane_map import LaneMap, MapLane

COLOURS = {
    "driving": "#b9c2cc", "bidirectional": "#b9c2cc", "entry": "#c9d4c0", "exit": "#d4cdc0",
    "onRamp": "#c9d4c0",
    "offRamp": "#d4cdc0", "connectingRamp": "#c9d4c0", "bus": "#e3c77f", "taxi": "#e3c77f",
    "HOV": "#e3c77f",
    "biking": "#e39a8b", "sidewalk": "#d8d8d8", "walking": "#d8d8d8", "shoulder": "#dfe3d4",
    "stop": "#dfe3d4",
    "parking": "#c6b9dd", "border": "#e8eadf", "median": "#cfe0c3", "curb": "#cccccc",
    "restricted": "#ead4d4",
    "tram": "#a8b8a8", "rail": "#a8b8a8", "none": "#eeeeee",
}  # fmt: skip
"""Fill colours by lane type."""
_OTHER = "#dddddd"
_CLOSE = 0.02
"""m by which drawn lines may be off"""


class MapFinding(NamedTuple):
    """A place of a map with a text, e.g. a fault: x, y (m)."""

    x: float
    y: float
    text: str


def write_page(
    one: LaneMap,
    findings: Sequence[MapFinding] = (),
    other: LaneMap | None = None,
    about: Sequence[str] = (),
) -> bytes:
    """The page of a map.

    Args:
        findings: places that are marked, with their texts.
        other: a second map, whose borders are drawn over the first in red.
        about: lines of text beside the map.
    """
    content = {
        "lanes": [_lane(lane) for lane in one.lanes.values()],
        "other": [_lines(lane) for lane in other.lanes.values()] if other is not None else [],
        "links": [
            _link(one, lane, name)
            for lane in one.lanes.values()
            for name in lane.successors
            if name in one.lanes
        ],
        "signals": [
            [round(s.place[0], 2), round(s.place[1], 2), f"{s.kind} {s.id} {s.type}".strip()]
            for s in one.signals
        ],
        "stops": [_thin(stop.line) for stop in one.stop_lines],
        "poles": [[round(x, 2), round(y, 2)] for _, (x, y, _), _ in one.poles],
        "findings": [[round(x, 2), round(y, 2), text] for x, y, text in findings],
        "colours": COLOURS,
    }
    # Names of maps come from files: `</script>` in one would end the script.
    data = json.dumps(content, separators=(",", ":"), ensure_ascii=False).replace("<", "\\u003c")
    types = sorted({lane.type for lane in one.lanes.values()})
    legend = "".join(
        f'<span><i style="background:{COLOURS.get(kind, _OTHER)}"></i>{html.escape(kind)}</span>'
        for kind in types
    )
    lines = "".join(f"<p>{html.escape(line)}</p>" for line in about)
    listed = "".join(
        f'<li><a href="#" data-at="{number}">{html.escape(finding.text)}</a></li>'
        for number, finding in enumerate(findings)
    )
    page = (
        _PAGE.replace("@TITLE@", html.escape(one.name)).replace("@LEGEND@", legend)
        .replace("@ABOUT@", lines)
        .replace("@LIST@", listed).replace("@DATA@", data)
    )  # fmt: skip
    return page.encode()


def _thin(line: FloatArray) -> list[list[float]]:
    return np.round(np.asarray(LineString(line[:, :2]).simplify(_CLOSE).coords), 2).tolist()


def _lines(lane: MapLane) -> list[list[list[float]]]:
    return [_thin(lane.left), _thin(lane.right)]


def _lane(lane: MapLane) -> list[Any]:
    limit = f"{lane.limit * 3.6:.0f} km/h" if lane.limit is not None else "no limit"
    text = f"{lane.id}: {lane.type}, {lane.road_type}, {limit}, {lane.length:.1f} m"
    return [lane.type, *_lines(lane), _thin(lane.centre), text]


def _link(one: LaneMap, lane: MapLane, name: str) -> list[float]:
    a, b = lane.centre[-1], one.lanes[name].centre[0]
    return [round(float(value), 2) for value in (a[0], a[1], b[0], b[1])]


_PAGE = """<!doctype html><html lang="en"><meta charset="utf-8"><title>@TITLE@</title>
<meta name="viewport" content="width=device-width,initial-scale=1">
<style>
body{--page:#fff;--text:#111;--muted:#333;--land:#fbfbf8;--line:#ccc;--link:#05a;
margin:0;font:13px system-ui,sans-serif;display:flex;height:100vh;
background:var(--page);color:var(--text);color-scheme:light dark}
canvas{flex:1;min-width:0;min-height:0;background:var(--land);cursor:grab;touch-action:none}
aside{width:clamp(300px,28vw,385px);overflow:auto;padding:10px;border-left:1px solid var(--line);
box-sizing:border-box;overflow-wrap:anywhere}
a{color:var(--link)}button{min-width:34px;min-height:34px}
@media (max-width:700px){body{flex-direction:column}
aside{width:auto;max-height:45vh;border-left:0;border-top:1px solid var(--line)}}
@media (prefers-color-scheme:dark){body{--page:#181f27;--text:#eee;--muted:#bbc;--land:#0f1418;
--line:#444;--link:#6af}}
i{display:inline-block;width:12px;height:12px;border:1px solid #999;margin:0 4px 0 8px;
vertical-align:middle}
h1{font-size:16px;margin:0 0 6px}ul{padding-left:16px}label{display:block}
#told{min-height:3em;color:var(--muted)}
#about p{white-space:pre-wrap;margin:4px 0;font:11px ui-monospace,monospace}
</style><canvas id="map"></canvas><aside><h1>@TITLE@</h1><div>@LEGEND@</div>
<label><input type="checkbox" id="arrows" checked> directions</label>
<label><input type="checkbox" id="links"> connections</label>
<label><input type="checkbox" id="over" checked> second map, findings</label>
<p><button data-zoom="1.5" aria-label="Nearer">+</button>
<button data-zoom="0.667" aria-label="Further">−</button>
<button data-zoom="0">whole map</button></p>
<p id="told" aria-live="polite">Drag to move, turn the wheel to zoom, click a lane.</p>
<div id="about">@ABOUT@</div><ul>@LIST@</ul></aside>
<script type="application/json" id="data">@DATA@</script><script>
"use strict";
const data=JSON.parse(document.getElementById("data").textContent),
canvas=document.getElementById("map");
const pen=canvas.getContext("2d"),told=document.getElementById("told");
const box=p=>{let b=[1e12,1e12,-1e12,-1e12];for(const [x,y] of p){b[0]=Math.min(b[0],x);
b[1]=Math.min(b[1],y);
b[2]=Math.max(b[2],x);b[3]=Math.max(b[3],y)}return b};
const lanes=data.lanes.map(l=>({type:l[0],left:l[1],right:l[2],centre:l[3],text:l[4],
box:box([...l[1],...l[2]])}));
const other=data.other.map(l=>({left:l[0],right:l[1],box:box([...l[0],...l[1]])}));
let all=box([...lanes,...other].flatMap(l=>[[l.box[0],l.box[1]],[l.box[2],l.box[3]]])),scale=1,cx=0,
cy=0;
function fit(){const w=canvas.clientWidth,h=canvas.clientHeight;cx=(all[0]+all[2])/2;
cy=(all[1]+all[3])/2;
scale=0.9*Math.min(w/Math.max(all[2]-all[0],1),h/Math.max(all[3]-all[1],1))}
const X=x=>(x-cx)*scale+canvas.clientWidth/2,Y=y=>canvas.clientHeight/2-(y-cy)*scale;
function path(p){p.forEach(([x,y],n)=>n?pen.lineTo(X(x),Y(y)):pen.moveTo(X(x),Y(y)))}
function draw(){const w=canvas.clientWidth,h=canvas.clientHeight,r=devicePixelRatio||1;
canvas.width=w*r;canvas.height=h*r;
pen.setTransform(r,0,0,r,0,0);const v=[cx-w/2/scale,cy-h/2/scale,cx+w/2/scale,cy+h/2/scale];
const seen=l=>l.box[0]<v[2]&&l.box[2]>v[0]&&l.box[1]<v[3]&&l.box[3]>v[1];
const near=lanes.filter(seen);
for(const l of near){pen.fillStyle=data.colours[l.type]||"#dddddd";pen.beginPath();path(l.left);
for(let n=l.right.length-1;n>=0;n--)pen.lineTo(X(l.right[n][0]),Y(l.right[n][1]));pen.fill()}
if(scale>0.5){pen.strokeStyle="#667";pen.lineWidth=0.7;for(const l of near){pen.beginPath();
path(l.left);path(l.right);pen.stroke()}}
if(document.getElementById("arrows").checked&&scale>1.5){pen.strokeStyle="#235";pen.lineWidth=1;
for(const l of near){
const n=Math.floor(l.centre.length/2),a=l.centre[Math.max(n-1,0)],b=l.centre[n];
const d=Math.hypot(b[0]-a[0],b[1]-a[1])||1;
const ux=(b[0]-a[0])/d,uy=(b[1]-a[1])/d,mx=(a[0]+b[0])/2,my=(a[1]+b[1])/2;pen.beginPath();
path([[mx-ux*1.5-uy*0.6,my-uy*1.5+ux*0.6],[mx,my],[mx-ux*1.5+uy*0.6,my-uy*1.5-ux*0.6]]);
pen.stroke()}}
if(document.getElementById("links").checked){pen.strokeStyle="#07a";pen.lineWidth=2;
pen.fillStyle="#07a";
for(const k of data.links){if(k[0]>v[0]&&k[0]<v[2]&&k[1]>v[1]&&k[1]<v[3]){pen.beginPath();
pen.arc(X(k[0]),Y(k[1]),2.5,0,7);
pen.fill();path([[k[0],k[1]],[k[2],k[3]]]);pen.stroke()}}}
if(scale>0.3){pen.strokeStyle="#c22";pen.lineWidth=Math.max(2,0.3*scale);
for(const l of data.stops){pen.beginPath();path(l);pen.stroke()}
pen.fillStyle="#555";for(const [x,y] of data.poles){pen.beginPath();pen.arc(X(x),Y(y),2.5,0,7);
pen.fill()}}
for(const s of data.signals){pen.fillStyle=s[2].startsWith("light")?"#c60":"#06c";
if(scale>0.3)pen.fillRect(X(s[0])-3,Y(s[1])-3,6,6)}
if(document.getElementById("over").checked){pen.strokeStyle="#d22";pen.lineWidth=1;
for(const l of other.filter(seen)){
pen.beginPath();path(l.left);path(l.right);pen.stroke()}
pen.strokeStyle="#d22";pen.lineWidth=2;for(const f of data.findings){pen.beginPath();
pen.arc(X(f[0]),Y(f[1]),7,0,7);pen.stroke()}}}
addEventListener("resize",draw);
document.querySelectorAll("input").forEach(e=>e.addEventListener("change",draw));
canvas.addEventListener("wheel",e=>{e.preventDefault();const f=Math.exp(-e.deltaY*0.0015),
w=canvas.clientWidth,h=canvas.clientHeight;
const x=cx+(e.offsetX-w/2)/scale,y=cy-(e.offsetY-h/2)/scale;scale*=f;cx=x-(e.offsetX-w/2)/scale;
cy=y+(e.offsetY-h/2)/scale;draw()},
{passive:false});
document.querySelectorAll("[data-zoom]").forEach(b=>b.addEventListener("click",()=>{
if(+b.dataset.zoom)scale*=+b.dataset.zoom;else fit();draw()}));
let from=null;canvas.addEventListener("pointerdown",e=>{
from=[e.clientX,e.clientY,e.clientX,e.clientY];
canvas.setPointerCapture(e.pointerId)});
canvas.addEventListener("pointermove",e=>{if(!from)return;cx-=(e.clientX-from[0])/scale;
cy+=(e.clientY-from[1])/scale;
from[0]=e.clientX;from[1]=e.clientY;draw()});
canvas.addEventListener("pointerup",e=>{if(from&&Math.hypot(e.clientX-from[2],e.clientY-from[3])<4){
const x=cx+(e.offsetX-canvas.clientWidth/2)/scale,y=cy-(e.offsetY-canvas.clientHeight/2)/scale;
const hit=lanes.filter(l=>inside([...l.left,...[...l.right].reverse()],x,y)).map(l=>l.text);
told.textContent=`${x.toFixed(2)}, ${y.toFixed(2)} ${hit.join("; ")}`}from=null});
function inside(p,x,y){let c=false;for(let i=0,j=p.length-1;i<p.length;j=i++){
const [a,b]=p[i],[d,f]=p[j];
if((b>y)!==(f>y)&&x<(d-a)*(y-b)/(f-b)+a)c=!c}return c}
document.querySelectorAll("a[data-at]").forEach(a=>a.addEventListener("click",e=>{
e.preventDefault();
const f=data.findings[+a.dataset.at];cx=f[0];cy=f[1];scale=Math.max(scale,8);draw()}));
fit();draw();
</script></html>
"""


def write_picture(
    one: LaneMap, path: str, findings: Sequence[MapFinding] = (), other: LaneMap | None = None
) -> None:
    """Draw a map into a picture (.png, .svg, .pdf); arguments as of `write_page`."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 12))
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    lanes = list(one.lanes.values())
    areas = [np.vstack([lane.left[:, :2], lane.right[::-1, :2]]) for lane in lanes]
    colours = [COLOURS.get(lane.type, _OTHER) for lane in lanes]
    axes.add_collection(
        PolyCollection(areas, facecolors=colours, edgecolors="#667788", linewidths=0.3)
    )
    if other is not None:
        lines = [line[:, :2] for lane in other.lanes.values() for line in (lane.left, lane.right)]
        axes.add_collection(LineCollection(lines, colors="#dd2222", linewidths=0.4))
    stops = [stop.line[:, :2] for stop in one.stop_lines]
    axes.add_collection(LineCollection(stops, colors="#cc2222", linewidths=1.0))
    if one.poles:
        axes.plot(*np.array([pole.place[:2] for pole in one.poles]).T, "o", ms=2.0, color="#555555")
    if findings:
        axes.plot(
            [finding.x for finding in findings],
            [finding.y for finding in findings],
            "o",
            mfc="none",
            mec="#dd2222",
        )
    axes.set_aspect("equal")
    axes.autoscale()
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    figure.savefig(path, dpi=120, bbox_inches="tight")
