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
  showRestoration(s.restoration);
  at("processes").replaceChildren(...s.processes.map(p => {
    const row = element("tr"), name = element("td"), silent = p.age_s > 3;
    name.append(element("span", "dot " + (silent ? "silent" : p.state)), p.name);
    const words = silent ? "silent for " + p.age_s.toFixed(0) + " s" : p.state + (p.message ? ": " + p.message : "");
    name.append(element("small", "", words), element("small", "", p.note));
    row.append(name, element("td", "n", p.cpu_s.toFixed(1) + " s CPU"), element("td", "n", p.rss_mb.toFixed(0) + " MB"));
    return row;
  }));
}
// L1: maps that tracking has left and that are not recovered yet; L2: the map being tracked.
function showRestoration(steps) {
  const head = element("tr");
  head.append(element("th", "n", "Frame"), ...["", "L1", "L2"].map(text => element("th", "", text)));
  at("restoration").replaceChildren(head, ...steps.map(step => {
    const row = element("tr");
    row.append(element("td", "n", step.frame < 0 ? "–" : String(step.frame)), element("td", "", step.event),
      element("td", "", step.L1), element("td", "", step.L2));
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
