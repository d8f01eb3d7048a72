#pragma once

namespace mapmend {

// The live page: polls /state.json once a second and shows it. No external resources.
inline constexpr char kLivePage[] = R"html(<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>mapmend</title>
<style>
:root { --ink: #1f2933; --muted: #6b7785; --line: #e3e8ed; --good: #1b7f4b; --warn: #b25e00; --bad: #b3202a; --busy: #2f6fde; }
* { box-sizing: border-box; }
body { margin: 0; background: #f3f5f8; color: var(--ink); font: 15px/1.5 system-ui, "Segoe UI", "DejaVu Sans", Arial, sans-serif; }
main { max-width: 1500px; margin: 0 auto; padding: 18px 20px 40px; }
#banner { display: flex; flex-wrap: wrap; gap: 2px 18px; align-items: center; padding: 14px 20px; border-radius: 10px; background: #fff;
  border-left: 8px solid var(--muted); box-shadow: 0 1px 3px #0001; }
#banner b { font-size: 21px; } #banner a { margin-left: auto; padding: 7px 14px; border-radius: 8px; background: var(--good); color: #fff;
  text-decoration: none; font-weight: 600; }
#banner[data-state=tracking] { border-color: var(--busy); } #banner[data-state=merging] { border-color: var(--busy); }
#banner[data-state=lost], #banner[data-state=gone] { border-color: var(--bad); }
#banner[data-state=whole] { border-color: var(--good); } #banner[data-state=parts] { border-color: var(--warn); }
#figures { display: grid; grid-template-columns: repeat(auto-fill, minmax(150px, 1fr)); gap: 12px; margin: 14px 0; }
.figure { background: #fff; border-radius: 10px; padding: 10px 16px; box-shadow: 0 1px 3px #0001; display: flex; flex-direction: column; }
.figure b { font-size: 23px; line-height: 1.25; font-variant-numeric: tabular-nums; } .figure span { font-size: 13px; }
.figure i { font-style: normal; font-size: 12px; color: var(--muted); min-height: 18px; }
#columns { display: grid; grid-template-columns: minmax(0, 1.35fr) minmax(0, 1fr); gap: 14px; align-items: start; }
@media (max-width: 1000px) { #columns { grid-template-columns: minmax(0, 1fr); } }
.picture, .card { background: #fff; border-radius: 10px; padding: 8px; box-shadow: 0 1px 3px #0001; overflow-x: auto; margin-bottom: 14px; }
.picture svg { display: block; max-width: 100%; height: auto; }
.card { padding: 12px 18px; } .card h2 { margin: 0 0 6px; font-size: 16px; }
table { border-collapse: collapse; width: 100%; font-size: 13.5px; }
td { padding: 5px 8px 5px 0; border-top: 1px solid var(--line); vertical-align: top; } td.n { text-align: right; white-space: nowrap;
  font-variant-numeric: tabular-nums; }
td small { display: block; color: var(--muted); overflow-wrap: anywhere; }
.dot { display: inline-block; width: 9px; height: 9px; border-radius: 5px; margin-right: 7px; background: var(--muted); }
.dot.ready, .dot.done { background: var(--good); } .dot.busy { background: var(--busy); } .dot.error, .dot.silent { background: var(--bad); }
</style></head>
<body><main>
<div id="banner" data-state="waiting"><b>Connecting …</b><span></span></div>
<div id="figures"></div>
<div id="columns"><div id="pictures"></div><div><div id="graph" class="picture"></div>
<div class="card"><h2>Processes</h2><table id="processes"></table></div></div></div>
</main>
<script>
"use strict";
const at = id => document.getElementById(id);
function element(tag, className, text) {
  const e = document.createElement(tag);
  if (className) e.className = className;
  if (text !== undefined) e.textContent = text;
  return e;
}
// Replaces pictures only where they changed, so that tooltips and scrolling survive.
const drawn = new WeakMap();
function draw(holder, svg) {
  if (drawn.get(holder) === svg) return;
  drawn.set(holder, svg);
  holder.innerHTML = svg;
}
function showBanner(state, headline, detail, report) {
  const banner = at("banner");
  banner.dataset.state = state;
  banner.replaceChildren(element("b", "", headline), element("span", "", detail));
  if (report) {
    const link = element("a", "", "Open the report");
    link.href = "/report";
    banner.append(link);
  }
  document.title = headline + " – mapmend";
}
function show(s) {
  showBanner(s.state, s.headline, s.detail, s.report);
  at("figures").replaceChildren(...s.figures.map(f => {
    const box = element("div", "figure");
    box.append(element("b", "", f.value), element("span", "", f.label), element("i", "", f.note));
    return box;
  }));
  const pictures = at("pictures");
  while (pictures.children.length > s.pictures.length) pictures.lastChild.remove();
  s.pictures.forEach((svg, i) => {
    if (i >= pictures.children.length) pictures.append(element("div", "picture"));
    draw(pictures.children[i], svg);
  });
  draw(at("graph"), s.graph);
  at("processes").replaceChildren(...s.processes.map(p => {
    const row = element("tr"), name = element("td"), silent = p.age_s > 3;
    name.append(element("span", "dot " + (silent ? "silent" : p.state)), p.name);
    const words = silent ? "silent for " + p.age_s.toFixed(0) + " s" : p.state + (p.message ? ": " + p.message : "");
    name.append(element("small", "", words), element("small", "", p.note));
    row.append(name, element("td", "n", p.cpu_s.toFixed(1) + " s CPU"), element("td", "n", p.rss_mb.toFixed(0) + " MB"));
    return row;
  }));
}
async function poll() {
  try {
    const answer = await fetch("/state.json", {cache: "no-store"});
    const state = await answer.json();
    if (state) show(state);
  } catch (error) {
    showBanner("gone", "The viewer does not answer", "It has been stopped, or the link is down; what is shown may be old.", false);
  }
  setTimeout(poll, 1000);
}
poll();
</script></body></html>
)html";

}  // namespace mapmend
