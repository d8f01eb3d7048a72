// Figures, restoration, submaps, gaps and processes.
import {Vector3} from "/lib/three/build/three.module.js";
import {at, chip, clockTime, duration, element, length, plural, readable, wind} from "/page/words.js";

export function drawFigures(f) {
  if (!f) return at("figures").replaceChildren();
  const box = (value, label, note) => element("div", {class: "figure"}, element("b", {}, String(value)), element("span", {}, label), element("i", {}, note ?? ""));
  at("figures").replaceChildren(
    box(f.frames_tracked, "frames tracked", f.share_tracked && `${f.share_tracked} of ${f.frames_in}`),
    box(f.frames_in_main, "frames in the main map", f.share_in_main && `${f.share_in_main} of tracked`),
    box(f.submaps, f.submaps === 1 ? "submap" : "submaps", plural(f.losses, "loss").replace("losss", "losses")),
    box(f.parts, f.parts === 1 ? "part" : "parts", f.parts > 1 ? "not joined" : ""),
    box(f.connections_accepted, "connections", `of ${f.connections_evaluated} compared`),
    box(f.keyframes, "keyframes", ""), box(f.points_in_main, "points in the main map", ""));
}

export function drawRestoration(map) {
  const letters = key => map.submaps.get(key)?.info?.letters ?? "?";
  const head = element("tr", {}, ...["Time", "Frame", "", "L1", "L2"].map(text => element("th", {scope: "col"}, text)));
  at("restoration").replaceChildren(head, ...map.restoration.map(step => {
    const what = step.event === "merge" ? `${letters(step.submap)} is connected` : `${step.lost ? `${letters(step.lost)} is lost, ` : ""}${letters(step.submap)} begins`;
    return element("tr", {class: step.utime > map.time ? "later" : null}, element("td", {}, clockTime(step.utime)), element("td", {class: "n"}, step.frame < 0 ? "–" : String(step.frame)),
      element("td", {}, what), element("td", {}, step.L1 || "–"), element("td", {}, step.L2 || "–"));
  }));
}

export function drawSubmaps(map, onKeyframe) {
  const head = element("tr", {}, ...["Submap", "Frames", "Keyframes", "Points", "Ended because"].map((text, i) => element("th", {scope: "col", class: i > 0 && i < 4 ? "n" : null}, text)));
  at("submaps").replaceChildren(head, ...map.byNumber().map(s => element("tr", {},
    element("td", {}, element("button", {type: "button", class: "plain", "aria-label": `First keyframe of submap ${s.info.number}`, onclick: () => onKeyframe(s, 0)}, chip(s.info), ` ${s.info.letters}`)),
    element("td", {class: "n"}, s.info.begin_frame === undefined ? "–" : `${s.info.begin_frame}–${s.info.end_frame}`),
    element("td", {class: "n"}, String(s.info.keyframes)), element("td", {class: "n"}, String(s.info.points)),
    element("td", {}, s.info.ended ? readable(s.info.reason) : "still growing", s.info.detail ? element("small", {}, s.info.detail) : null))));
}

// Where something lies, from the camera as it flies; both in the frame of the main part.
function bearing(map, gaps, center) {
  const live = map.livePose();
  if (!live || !live.submap.isJoined) return "";
  const dx = center[0] - live.center.x, dy = center[1] - live.center.y, away = Math.hypot(dx, dy);
  if (gaps.placed) return `${length(away, "m")} to the ${wind(90 - Math.atan2(dy, dx) * 180 / Math.PI)}`;
  // No north: by the way that the top of the image points.
  const forward = new Vector3(0, -1, 0).applyQuaternion(live.q), ahead = Math.hypot(forward.x, forward.y) > 0.2 ? forward : new Vector3(0, 0, 1).applyQuaternion(live.q);
  const turn = ((Math.atan2(ahead.y, ahead.x) - Math.atan2(dy, dx)) * 180 / Math.PI + 720) % 360;
  const hour = Math.round(turn / 30) % 12 || 12;
  return `${length(away, gaps.unit)} away, at ${hour} o'clock`;
}

export function drawGaps(map, gaps, onShow) {
  if (!gaps) return at("gaps").replaceChildren(element("p", {class: "note"}, "Nothing is known yet."));
  if (gaps.list.length === 0) {
    return at("gaps").replaceChildren(element("p", {class: "note"}, gaps.ground ? "No gap: the ground inside is seen by enough images." : "No ground is seen from above, so nothing can be said of where the map is thin."));
  }
  at("gaps").replaceChildren(element("ol", {class: "gaps"}, ...gaps.list.slice(0, 30).map(gap => {
    const where = gap.center ? bearing(map, gaps, gap.center) : "";
    const text = gap.text[0].toUpperCase() + gap.text.slice(1);
    return element("li", {class: gap.kind}, gap.center ? element("button", {type: "button", class: "plain", onclick: () => onShow(gap)}, text) : text,
      where ? element("b", {}, ` ${where}`) : null);
  })), gaps.list.length > 30 ? element("p", {class: "note"}, `and ${gaps.list.length - 30} more`) : "");
}

// In plain words what a process does; alarm: somebody should look.
function stateOf(p, run, mergingFor) {
  const c = p.counters, isOver = run.ended;
  if (p.state === "error") return {kind: "bad", text: p.message || "has an error"};
  if (p.state === "done" && p.name !== "viewer_export") return {kind: "rest", text: "has done its work"};
  if (p.silent_s > 0) {
    // A frontend that has landed is silent for good; and at the end all are.
    if (p.name === "frontend" && isOver) return {kind: "rest", text: "has done its work"};
    if (run.final) return {kind: "rest", text: "has ended"};
    if (p.silent_s < 8) return {kind: "busy", text: "has not been heard for a moment"};
    return {kind: "bad", text: `has not been heard for ${duration(p.silent_s)}`};
  }
  if (p.name === "frontend") {
    if (!c.fps) return {kind: "good", text: "starts"};
    const rate = `${c.fps.toFixed(1)} frames/s`;
    const left = c.frames_total > 0 && c.frames < c.frames_total ? `, ${duration((c.frames_total - c.frames) / c.fps)} left` : "";
    const lag = p.queue > 2 ? `, ${plural(p.queue, "frame")} behind` : "";
    return {kind: "good", text: `tracks ${rate}${left}${lag}`};
  }
  if (p.name === "submap_store") return {kind: "good", text: c.records_per_s > 0 ? `stores ${Math.round(c.records_per_s)} records/s` : "has stored all it was sent"};
  if (p.name === "merger") {
    if (isOver && !run.final) {
      const left = run.merging_estimate_s - mergingFor;
      return {kind: "busy", text: left >= 1 ? `merging: ${duration(left)} left` : `merging, for ${duration(mergingFor)} so far`};
    }
    return {kind: "good", text: p.state === "busy" ? p.message || "compares submaps" : `watches for places seen before; ${plural(c.connections ?? 0, "pair")} compared`};
  }
  if (p.name === "viewer_export") {
    if (p.state === "done") return {kind: "rest", text: p.message || "has written all"};
    return {kind: p.state === "busy" && isOver ? "busy" : "good", text: isOver && p.state === "busy" ? p.message || "waits for the merged map" : "follows the flight"};
  }
  return {kind: "good", text: p.message || (p.state === "ready" ? "is ready" : p.state)};
}

const kNames = {frontend: "Tracking", submap_store: "Store", merger: "Merger", viewer_export: "Viewer and exports", hub: "Message hub", mapmend: "Launcher", mosaic: "Picture of the ground"};
// What is worth a look in figures, with its unit.
const kCounters = {frames_dropped: "dropped", gaps: "gaps", bad_messages: "bad messages", refused: "refused", duplicates: "repeated",
  images_awaited: "images awaited", images_lost: "images lost", requests_shed: "requests shed", track_ms_median: "ms a frame", broadcast_ms_median: "ms to a merge"};

export function drawHealth(processes, run, mergingFor) {
  const isFar = new Set(processes.map(p => p.host)).size > 1;
  const cards = processes.map(p => {
    const state = stateOf(p, run, mergingFor), details = Object.entries(kCounters).filter(([name]) => p.counters[name] > 0)
      .map(([name, label]) => `${Math.round(p.counters[name] * 10) / 10} ${label}`);
    const mark = {good: "●", busy: "◐", bad: "▲", rest: "○"}[state.kind];
    return element("div", {class: `process ${state.kind}`}, element("span", {class: "mark", "aria-hidden": "true"}, mark),
      element("div", {}, element("b", {}, `${kNames[p.name] ?? p.name}${p.vehicle ? ` (${p.vehicle})` : ""}${isFar ? ` on ${p.host}` : ""}`), " ", state.text,
        element("small", {}, [p.queue > 0 ? `queue ${p.queue}` : "", p.behind > 0 ? `${plural(p.behind, "record")} behind` : "", `${p.cpu_s.toFixed(1)} s CPU`, `${p.rss_mb.toFixed(0)} MB`, ...details].filter(Boolean).join(" · "))));
  });
  at("health").replaceChildren(...(cards.length > 0 ? cards : [element("p", {class: "note"}, run.is_stored ? "A stored map: nothing runs." : "Nothing has been heard yet.")]));
}
