// The time line: flights one after the other, their submaps, losses, merges and revisions; dragging it shows the map as
// it was then: what was known by that time, where it stands today.
import {at, clockTime, duration, element, readable, svg} from "/page/words.js";

const kHeight = 62, kBetween = 0.02;  // of the width, between flights

export class Timeline {
  // onTime(utime, or Infinity for now)
  constructor(map, onTime) {
    this.map = map;
    this.onTime = onTime;
    this.revisions = [];
    this.spans = [];
    this.slider = at("time");
    this.slider.addEventListener("input", () => this.goTo(Number(this.slider.value)));
    at("now").addEventListener("click", () => this.goNow());
    new ResizeObserver(() => this.draw()).observe(at("timeline-picture"));
  }

  // Flights as they follow each other: from, to in microseconds, start and end as shares of the width.
  layOut() {
    const sessions = [...this.map.sessions.values()].map(s => ({from: s.start, to: Math.max(s.start + 1, s.last)}));
    for (const submap of this.map.byNumber()) {
      const span = sessions[submap.info.session];
      if (span && submap.info.end !== undefined) span.to = Math.max(span.to, submap.info.end), span.from = Math.min(span.from, submap.info.begin);
    }
    const total = sessions.reduce((sum, s) => sum + s.to - s.from, 0), room = 1 - kBetween * Math.max(0, sessions.length - 1);
    let start = 0;
    this.spans = sessions.map(s => {
      const end = start + room * (s.to - s.from) / Math.max(1, total), span = {...s, start, end};
      start = end + kBetween;
      return span;
    });
  }

  shareOf(utime, session) {
    const span = this.spans[session] ?? this.spans.find(s => utime >= s.from && utime <= s.to) ?? this.spans.at(-1);
    if (!span) return 0;
    return span.start + (span.end - span.start) * Math.max(0, Math.min(1, (utime - span.from) / (span.to - span.from)));
  }

  utimeAt(share) {
    const span = this.spans.find(s => share <= s.end) ?? this.spans.at(-1);
    return span ? span.from + (span.to - span.from) * Math.max(0, (share - span.start) / Math.max(1e-9, span.end - span.start)) : 0;
  }

  goTo(share) {
    if (share >= 0.9999) return this.goNow();
    at("now").disabled = false;
    this.share = share;
    this.onTime(this.utimeAt(share));
    this.tell();
  }

  goNow() {
    this.share = undefined;
    this.slider.value = "1";
    at("now").disabled = true;
    this.onTime(Infinity);
    this.tell();
  }

  tell() {
    const isNow = this.share === undefined, last = this.spans.at(-1);
    const utime = isNow ? last?.to ?? 0 : this.utimeAt(this.share);
    const span = this.spans.find(s => utime >= s.from && utime <= s.to) ?? last;
    const text = last ? `${isNow ? "Now: " : "As it was at "}${clockTime(utime)}, ${duration((utime - (span?.from ?? 0)) / 1e6)} into the flight` : "No flight yet";
    at("time-text").value = text;
    this.slider.setAttribute("aria-valuetext", text);
    at("timeline").classList.toggle("past", !isNow);
  }

  noteRevision(run) {
    if (run.revision < 0 || this.revisions.at(-1)?.number === run.revision) return;
    const last = Math.max(...this.spans.map(s => s.to), 0);
    this.revisions.push({number: run.revision, utime: last, refined: run.refined});
    if (this.revisions.length > 300) this.revisions.shift();
  }

  draw() {
    this.layOut();
    const box = at("timeline-picture"), width = Math.max(200, box.clientWidth), x = (utime, session) => 6 + (width - 12) * this.shareOf(utime, session);
    const picture = svg("svg", {viewBox: `0 0 ${width} ${kHeight}`, width, height: kHeight, role: "img", "aria-label": this.describe()});
    for (const span of this.spans) picture.append(svg("rect", {class: "flight", x: 6 + (width - 12) * span.start, y: 18, width: Math.max(1, (width - 12) * (span.end - span.start)), height: 18, rx: 3}));
    for (const s of this.map.byNumber()) {
      const {begin, end, number, color, ink, session, lost, reason, detail} = s.info;
      if (begin === undefined) continue;
      const from = x(begin, session), to = Math.max(from + 2, x(end, session));
      picture.append(svg("g", {}, svg("title", {}, `Submap ${number}: frames ${s.info.begin_frame} to ${s.info.end_frame}, from ${clockTime(begin)}`),
        svg("rect", {x: from, y: 18, width: to - from, height: 18, rx: 2, fill: color}),
        to - from > 14 ? svg("text", {x: (from + to) / 2, y: 31, fill: ink, "text-anchor": "middle"}, String(number)) : null));
      if (lost) picture.append(svg("g", {class: "loss"}, svg("title", {}, `Lost at ${clockTime(end)}: ${detail || readable(reason)}`), svg("path", {d: `M${to - 4} 5l8 8m-8 0l8 -8`})));
    }
    for (const step of this.map.restoration) {
      if (step.event !== "merge") continue;
      const session = this.map.submaps.get(step.submap)?.info?.session, at = x(step.utime, session);
      picture.append(svg("g", {class: "merge"}, svg("title", {}, `Merge at ${clockTime(step.utime)}: L2 is ${step.L2}`), svg("path", {d: `M${at} 40l5 6l-5 6l-5 -6z`})));
    }
    for (const r of this.revisions) picture.append(svg("rect", {class: "revision", x: x(r.utime) - 0.5, y: 55, width: 1, height: r.refined ? 7 : 4}));
    box.replaceChildren(picture);
    this.tell();
  }

  describe() {
    const losses = this.map.byNumber().filter(s => s.info.lost).length, merges = this.map.restoration.filter(r => r.event === "merge").length;
    return `${this.map.byNumber().length} submaps, ${losses} losses (crosses), ${merges} merges (diamonds)`;
  }
}
