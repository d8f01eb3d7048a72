import {Alarms} from "/page/alarms.js";
import {showEdge, showKeyframe} from "/page/dialog.js";
import {Feed} from "/page/feed.js";
import {Graph} from "/page/graph.js";
import {Ground} from "/page/ground.js";
import {MapData} from "/page/map.js";
import {drawFigures, drawGaps, drawHealth, drawRestoration, drawSubmaps} from "/page/panels.js";
import {placePicture, Space} from "/page/space.js";
import {Timeline} from "/page/timeline.js";
import {at, clockTime, readable, setUtc, usesUtc} from "/page/words.js";

const kPatienceMs = 6000;  // so long a link may be broken before it is told in red

const map = new MapData();
const openEdge = name => showEdge(map, name, run, openKeyframe);
const openKeyframe = (submap, row) => showKeyframe(map, submap, row);
const space = new Space(map, openKeyframe), ground = new Ground(map, openKeyframe);
const graph = new Graph(map, openEdge), alarms = new Alarms();
const timeline = new Timeline(map, time => {
  map.time = time;
  redraw();
});
let run = {state: "waiting", headline: "Connecting …", detail: ""};
let isUpToDate = false, linkState = "broken", mergingSince = null, lastGood = null;
const stale = new Set();  // parts of the page that are to be drawn anew

function redraw() {
  for (const part of ["graph", "timeline", "restoration", "submaps", "layout"]) stale.add(part);
}

const feed = new Feed({
  begin() {
    map.clear();
    isUpToDate = false;
    space.drawables.clear();
    space.picture = null;
    ground.picture = ground.tiles = null;
    stale.add("figures");
    redraw();
  },
  rows(table, view) {
    map.takeRows(table, view);
    stale.add("layout");
    if (table.startsWith("frames/")) stale.add("timeline");
  },
  values(changed) {
    for (const [name, value] of changed) {
      if (isUpToDate) tellNews(name, value);
      map.takeValue(name, value);
      takeValue(name, value);
    }
  },
  message(complete) {
    isUpToDate = complete;
    space.isDirty = true;
  },
  link(state) {
    linkState = state;
    drawBanner();
  },
});

function takeValue(name, value) {
  const kind = name.split("/")[0];
  if (kind === "run") {
    const wasMerging = run.state === "merging";
    run = value;
    if (run.state === "merging" && !wasMerging) mergingSince = performance.now();
    timeline.noteRevision(run);
    drawBanner();
    for (const part of ["health", "timeline"]) stale.add(part);
  } else if (kind === "process") stale.add("health");
  else if (kind === "figures") stale.add("figures");
  else if (kind === "gaps") stale.add("gaps");
  else if (kind === "pose") stale.add("pose");
  else if (kind === "mosaic" && value) showMosaic(value);
  else if (kind === "tiles" && value) ground.tiles = {...value, version: value.bytes + value.log_bytes}, stale.add("layout");
  else redraw();
}

function showMosaic(mosaic) {
  const place = placePicture(mosaic), url = `${mosaic.url}?v=${run.revision}`;
  ground.picture = {url, place};
  space.setPicture(url, place).catch(() => at("mosaic-label").hidden = true);
  stale.add("layout");
}

// Losses and merges, as they happen; and why the picture of the live camera moves.
function tellNews(name, value) {
  if (!name.startsWith("submap/") || !value) return;
  const before = map.submaps.get(name.slice(7))?.info;
  if (value.lost && !before?.lost) alarms.show("loss", `Tracking is lost after frame ${value.end_frame ?? "?"}: ${value.detail || readable(value.reason)}`);
  // A submap that is found in the map at once was never seen apart.
  const wasApart = !before || before.component === undefined || before.root;
  if (value.component === undefined || value.root || !wasApart) {
    if (before?.component !== undefined && !before.root && value.root && value.component !== before.component)
      alarms.show("note", `Submap ${value.number} is apart again: its connection does not count any more.`);
    return;
  }
  const edge = [...feed.all("edge/")].map(([, e]) => e).filter(e => e.tree && (e.a === name.slice(7) || e.b === name.slice(7))).sort((a, b) => b.C - a.C)[0];
  const other = edge && map.submaps.get(edge.a === name.slice(7) ? edge.b : edge.a)?.info?.number;
  const isLive = map.pose?.submap === name.slice(7);
  alarms.show("merge", `Submap ${value.number} is joined${other === undefined ? "" : ` to submap ${other}: ${edge.F} connected frames, ${edge.M} common points`}.${isLive ? " The live camera moves there with it." : ""}`);
}

function drawBanner() {
  const banner = at("banner"), isBroken = linkState === "broken";
  let {state, headline, detail} = run;
  if (run.stopped) {
    const isOver = run.final || run.is_stored;
    headline = isOver ? `The run has ended. ${run.headline}` : "The run was stopped";
    detail = run.report ? `The report is ${run.folder}/report.html; the command mapmend view ${run.folder} shows this page again.`
      : run.folder && !run.is_stored ? `What was mapped is in ${run.folder}.` : "The command mapmend view shows it again.";
    if (!isOver) state = "stopped";
  } else if (isBroken) {
    lastGood ??= feed.brokenSince ?? performance.now();
    const isLong = performance.now() - lastGood > kPatienceMs;
    state = isLong ? "gone" : "waiting";
    headline = isLong ? "The viewer does not answer" : "Connecting …";
    detail = isLong ? "It has been stopped, or the link is down; what is shown may be old. This page connects again by itself." : run.headline ?? "";
  }
  if (!isBroken) lastGood = null;
  if (map.pose && !run.ended && !isBroken && map.pose.frame >= 0) headline += ` · frame ${map.pose.frame}`;
  banner.dataset.state = state;
  banner.dataset.link = linkState;
  const [head, rest] = at("banner-text").children;
  if (head.textContent !== headline) head.textContent = headline;
  if (rest.textContent !== detail) rest.textContent = detail;
  at("report-link").hidden = !run.report || isBroken;
  document.title = `${headline} – mapmend`;
}

function drawClock() {
  at("clock").textContent = clockTime(Date.now() * 1000);
  at("zone").textContent = usesUtc() ? "UTC" : "Local";
  at("zone").setAttribute("aria-pressed", String(usesUtc()));
}

function drawStale(now) {
  if (stale.has("layout")) map.layOut(now), space.isDirty = true;
  if (stale.has("graph")) graph.draw();
  if (stale.has("timeline")) timeline.draw();
  if (stale.has("figures")) drawFigures(feed.values.get("figures"));
  if (stale.has("restoration")) drawRestoration(map);
  if (stale.has("submaps")) drawSubmaps(map, openKeyframe);
  if (stale.has("pose")) space.isDirty = true, drawBanner();
  if (stale.has("gaps") || stale.has("pose")) {
    ground.gaps = feed.values.get("gaps");
    drawGaps(map, ground.gaps, gap => {
      choose("ground");
      ground.show(gap);
    });
  }
  if (stale.has("health")) drawHealth([...feed.all("process/")].map(([, p]) => p).sort((a, b) => a.name.localeCompare(b.name)), run, mergingSince === null ? 0 : (performance.now() - mergingSince) / 1000);
  if (!at("ground").hidden && ["layout", "gaps", "pose"].some(part => stale.has(part))) ground.draw(true);
  stale.clear();
}

let nextStale = 0;
function frame(now) {
  // Numbers and tables need not follow at the rate of the picture.
  if (stale.size > 0 && now >= nextStale) drawStale(now), nextStale = now + 250;
  if (map.glide(now)) space.isDirty = true;
  if (!at("space").hidden) space.draw();
  requestAnimationFrame(frame);
}

function choose(view) {
  for (const name of ["space", "ground"]) {
    const isChosen = name === view, tab = at(`tab-${name}`);
    at(name).hidden = !isChosen;
    tab.setAttribute("aria-selected", String(isChosen));
    tab.tabIndex = isChosen ? 0 : -1;
  }
  at("space-tools").hidden = view !== "space";
  if (view === "ground") ground.draw(true);
  space.isDirty = true;
}
for (const view of ["space", "ground"]) at(`tab-${view}`).addEventListener("click", () => choose(view));
document.querySelector("[role=tablist]").addEventListener("keydown", event => {
  if (event.key !== "ArrowLeft" && event.key !== "ArrowRight") return;
  const other = at("space").hidden ? "space" : "ground";
  choose(other);
  at(`tab-${other}`).focus();
});
at("zone").addEventListener("click", () => {
  setUtc(!usesUtc());
  drawClock();
  redraw();
});
addEventListener("resize", () => {
  stale.add("graph");
  space.isDirty = true;
});
setInterval(() => {
  drawClock();
  if (linkState === "broken") drawBanner();
  if (run.state === "merging") stale.add("health");
}, 1000);
if (matchMedia("(max-width: 640px)").matches) at("health-box").open = false;
drawClock();
requestAnimationFrame(frame);

// For tests and for the curious: how the page is doing.
window.mapmend = {
  map, feed, space, timeline,
  state: () => ({link: linkState, run, epoch: feed.epoch, version: feed.version, upToDate: isUpToDate, bytes: feed.bytes, renderer: space.renderer.name,
    submaps: map.byNumber().length, edges: map.edges.size, frames: space.frames,
    points: [...map.submaps.values()].reduce((n, s) => n + s.points.shown.subarray(0, s.points.count).reduce((m, x) => m + x, 0), 0),
    keyframes: [...map.submaps.values()].reduce((n, s) => n + s.keyframes.shown.subarray(0, s.keyframes.count).reduce((m, x) => m + x, 0), 0)}),
};
