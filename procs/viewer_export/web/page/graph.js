// The graph of connections: submaps in the order of time, connections as arcs beside them, the tree bold; and the table.
import {at, chip, element, svg} from "/page/words.js";

const kRow = 46, kTop = 26, kX = 30, kRadius = 13;

export const edgeText = e => `F ${e.F} · M ${e.M} · θ ${e.theta.toFixed(1)}° · C ${e.C.toFixed(1)}`;
export const verdictText = e => (e.disabled ? "switched off" : e.tree ? "in the tree" : e.verdict) + (e.weak ? ", weak" : "");

export class Graph {
  constructor(map, onEdge) {
    this.map = map;
    this.onEdge = onEdge;
    at("show-rejected").addEventListener("change", () => this.draw());
  }

  edges() {
    const now = this.map.time, submaps = this.map.submaps;
    return [...this.map.edges.values()]
      .filter(e => submaps.get(e.a)?.info && submaps.get(e.b)?.info && e.a !== e.b)
      .filter(e => now === Infinity || (e.since >= 0 && e.since <= now))
      .sort((p, q) => (q.tree - p.tree) || (q.verdict === "accepted") - (p.verdict === "accepted") || q.C - p.C);
  }

  draw() {
    const submaps = this.map.byNumber().filter(s => s.isVisible), rows = new Map(submaps.map((s, i) => [s.key, i]));
    const all = this.edges().filter(e => rows.has(e.a) && rows.has(e.b));
    const shown = all.filter(e => e.verdict === "accepted" || e.disabled || e.verdict === "deactivated" || at("show-rejected").checked);
    this.drawPicture(submaps, rows, shown);
    this.drawTable(all.filter(e => shown.includes(e)), all.length - shown.length);
  }

  drawPicture(submaps, rows, edges) {
    if (submaps.length === 0) return at("graph").replaceChildren(element("p", {class: "note"}, "No submap yet."));
    const y = key => kTop + kRow * rows.get(key), width = Math.max(260, at("graph").clientWidth || 320);
    const room = width - kX - 20, longest = Math.max(1, ...edges.map(e => Math.abs(rows.get(e.a) - rows.get(e.b))));
    const height = kTop * 2 + kRow * (submaps.length - 1) + 8;
    const picture = svg("svg", {viewBox: `0 0 ${width} ${height}`, width, height, role: "group", "aria-label": "Graph of connections"});
    // Weak ones first, so that the tree lies on top.
    for (const e of [...edges].reverse()) picture.append(this.arc(e, y, rows, room, longest));
    submaps.forEach((s, i) => {
      const middle = kTop + kRow * i, previous = submaps[i - 1];
      if (previous?.info.lost) {
        picture.append(svg("g", {class: "loss"}, svg("title", {}, previous.info.detail || previous.info.reason),
          svg("path", {d: `M${kX - 5} ${middle - kRow / 2 - 5}l10 10m-10 0l10 -10`})));
      }
      picture.append(svg("g", {class: "node"}, svg("title", {}, `Submap ${s.info.number} (${s.info.letters}): ${s.info.frames} frames, ${s.info.keyframes} keyframes`),
        svg("circle", {cx: kX, cy: middle, r: kRadius, fill: s.info.color, class: s.info.root ? "root" : null}),
        svg("text", {x: kX, y: middle + 4.5, fill: s.info.ink, "text-anchor": "middle"}, String(s.info.number))));
    });
    at("graph").replaceChildren(picture);
  }

  arc(e, y, rows, room, longest) {
    const [top, bottom] = [y(e.a), y(e.b)].sort((a, b) => a - b), span = Math.abs(rows.get(e.a) - rows.get(e.b));
    const reach = kRadius + Math.min(room * 0.45, 24 + (room * 0.45 - 24) * span / longest), x = kX + kRadius;
    const shape = `M${x} ${top + 3}C${x + reach} ${top + 3} ${x + reach} ${bottom - 3} ${x} ${bottom - 3}`;
    const kind = e.disabled ? "off" : e.tree ? "tree" : e.verdict;
    const name = `Submaps ${this.number(e.a)} and ${this.number(e.b)}, ${verdictText(e)}: ${edgeText(e)}. ${e.reason}`;
    const width = 1.2 + Math.min(4, Math.sqrt(Math.max(0, e.C)) / 4);
    const group = svg("g", {class: `edge ${kind}`, tabindex: "0", role: "button", "aria-label": name, "data-edge": `${e.a}|${e.b}`,
      onclick: () => this.onEdge(`${e.a}|${e.b}`), onkeydown: event => {
        if (event.key === "Enter" || event.key === " ") event.preventDefault(), this.onEdge(`${e.a}|${e.b}`);
      }}, svg("title", {}, name), svg("path", {d: shape, class: "hit"}), svg("path", {d: shape, "stroke-width": e.tree ? width + 1.5 : width}));
    if (e.tree) {
      // In two lines where there is no room for one.
      const lines = room < 330 ? [`F ${e.F} · M ${e.M}`, `θ ${e.theta.toFixed(1)}° · C ${e.C.toFixed(1)}`] : [edgeText(e)], at = {x: x + reach * 0.75 + 8};
      group.append(svg("text", {y: (top + bottom) / 2 + (lines.length > 1 ? -2 : 4)}, ...lines.map((line, i) => svg("tspan", {...at, dy: i * 13}, line))));
    }
    return group;
  }

  number(key) {
    return this.map.submaps.get(key)?.info?.number ?? "?";
  }

  drawTable(edges, hidden) {
    const head = element("tr", {}, ...["Submaps", "Verdict", "F", "M", "θ", "C", "Reason"].map((text, i) =>
      element("th", {class: i > 1 && i < 6 ? "n" : null, scope: "col"}, text)));
    const rows = edges.map(e => {
      const open = element("button", {type: "button", class: "plain", "data-edge": `${e.a}|${e.b}`, onclick: () => this.onEdge(`${e.a}|${e.b}`),
        "aria-label": `Show the connection of submaps ${this.number(e.a)} and ${this.number(e.b)}`},
        chip(this.map.submaps.get(e.a)?.info), "–", chip(this.map.submaps.get(e.b)?.info));
      return element("tr", {}, element("td", {}, open), element("td", {}, element("span", {class: `verdict ${e.disabled ? "off" : e.tree ? "tree" : e.verdict}`}, verdictText(e))),
        element("td", {class: "n"}, String(e.F)), element("td", {class: "n"}, String(e.M)), element("td", {class: "n"}, `${e.theta.toFixed(1)}°`),
        element("td", {class: "n"}, e.C.toFixed(1)), element("td", {class: "reason"}, e.reason));
    });
    if (hidden > 0) rows.push(element("tr", {}, element("td", {colspan: "7", class: "note"}, `${hidden} rejected ${hidden === 1 ? "pair is" : "pairs are"} not shown.`)));
    if (edges.length + hidden === 0) rows.push(element("tr", {}, element("td", {colspan: "7", class: "note"}, "No pair of submaps has been compared yet.")));
    at("edges").replaceChildren(head, ...rows);
  }
}
