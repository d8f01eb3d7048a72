// One connection with its picture, one keyframe with its image.
import {cameraOf} from "/page/similarity.js";
import {at, chip, clockTime, dateTime, element} from "/page/words.js";
import {edgeText, verdictText} from "/page/graph.js";

const kFoundBy = {orb: "ORB", wide: "wide features", motion: "how the camera moved"};

let token = sessionStorage.getItem("mapmend-token") ?? "";

function open(title, ...content) {
  at("dialog-title").replaceChildren(...title);
  at("dialog-body").replaceChildren(...content);
  if (!at("dialog").open) at("dialog").showModal();
}

// An image that says why there is none.
function picture(url, description) {
  const box = element("div", {class: "shot"}, element("p", {class: "note"}, "Being drawn …")), image = element("img", {alt: description});
  image.addEventListener("load", () => box.replaceChildren(image));
  image.addEventListener("error", async () => {
    let why = "The viewer does not answer.";
    try {
      const answer = await fetch(url);
      why = answer.ok ? "The picture cannot be shown." : await answer.text();
    } catch {
      // as above
    }
    box.replaceChildren(element("p", {class: "note"}, why));
  });
  image.src = url;
  return box;
}

async function decide(edge, disabled, message) {
  message.textContent = "Asking …";
  try {
    const answer = await fetch(`/edge?a=${encodeURIComponent(edge.a)}&b=${encodeURIComponent(edge.b)}&disabled=${disabled ? 1 : 0}`,
      {method: "POST", headers: {"X-Mapmend-Token": token}});
    message.textContent = await answer.text();
    if (answer.ok) sessionStorage.setItem("mapmend-token", token);
    message.className = answer.ok ? "ok" : "refused";
  } catch {
    message.textContent = "The viewer does not answer.";
    message.className = "refused";
  }
}

function decision(edge, map, run) {
  const numbers = [edge.a, edge.b].map(key => map.submaps.get(key)?.info?.number).join(" ");
  const isOff = edge.disabled, word = isOff ? "enable" : "disable";
  if (!run.can_decide)
    return element("p", {class: "note"}, "Switched by ", element("code", {}, `mapmend edges ${word} ${run.folder || "MAP"} ${numbers}`));
  const field = element("input", {type: "password", autocomplete: "off", id: "token", value: token, placeholder: "token"});
  field.addEventListener("input", () => token = field.value.trim());
  const message = element("p", {role: "status", id: "decision"});
  return element("div", {class: "decide"}, element("label", {for: "token"}, "Token (printed when the run was started) "), field,
    element("button", {type: "button", id: "decide", onclick: () => decide(edge, !isOff, message)}, isOff ? "Switch on again" : "Switch this connection off"), message);
}

export function showEdge(map, name, run, onKeyframe) {
  const edge = map.edges.get(name);
  if (!edge) return;
  const a = map.submaps.get(edge.a), b = map.submaps.get(edge.b);
  const facts = [["Verdict", verdictText(edge)], ["Strength", edgeText(edge)], ["Found by", kFoundBy[edge.kind] ?? edge.kind], ["Inliers", String(edge.inliers)],
    ["Candidates", String(edge.candidates)], ["Error", edge.inliers > 0 ? `${edge.error_px.toFixed(2)} px` : "–"], ["Seen first", edge.since >= 0 ? clockTime(edge.since) : "–"]];
  const row = (submap, id) => {
    const {keyframes} = submap;
    for (let i = 0; i < keyframes.count; ++i) if (keyframes.id[i] === id && keyframes.shown[i]) return i;
    return -1;
  };
  const link = (submap, id) => {
    const i = row(submap, id);
    return i < 0 ? `keyframe ${id}` : element("button", {type: "button", class: "plain", onclick: () => onKeyframe(submap, i)}, `frame ${submap.keyframes.frame[i]}`);
  };
  open(["Connection ", chip(a.info), "–", chip(b.info)],
    picture(`/edge.jpg?a=${encodeURIComponent(edge.a)}&b=${encodeURIComponent(edge.b)}&v=${run.revision}`, `The two keyframes of submaps ${a.info.number} and ${b.info.number} that have most in common, with their matches`),
    element("p", {}, edge.reason), element("dl", {}, ...facts.flatMap(([term, text]) => [element("dt", {}, term), element("dd", {}, text)])),
    decision(edge, map, run),
    edge.pairs.length > 0 ? element("details", {}, element("summary", {}, `Connected frames (${edge.F})`), element("ul", {class: "pairs"}, ...edge.pairs.map(([p, q, inliers]) =>
      element("li", {}, link(a, p), " – ", link(b, q), `: ${inliers} inliers`)))) : "");
}

export function showKeyframe(map, submap, row) {
  const {keyframes} = submap;
  const step = by => {
    for (let i = row + by; i >= 0 && i < keyframes.count; i += by) if (keyframes.shown[i]) return i;
    return -1;
  };
  while (row < keyframes.count && !keyframes.shown[row]) ++row;
  if (row >= keyframes.count) return;
  const pose = keyframes.pose.subarray(7 * row, 7 * row + 7), camera = cameraOf(pose);
  const onPage = submap.place ? map.cameraOnPage(submap, pose).center : camera.center, unit = map.frames.get(map.rootOf(submap.info.component)?.key)?.unit ?? "map units";
  const url = `/keyframe.jpg?submap=${encodeURIComponent(submap.key)}&id=${keyframes.id[row]}`;
  const features = element("input", {type: "checkbox", checked: true}), box = element("div", {}, picture(url, `Image of frame ${keyframes.frame[row]} with its features`));
  features.addEventListener("change", () => box.replaceChildren(picture(`${url}&features=${features.checked ? 1 : 0}`, `Image of frame ${keyframes.frame[row]}`)));
  const go = (by, label) => {
    const next = step(by);
    return element("button", {type: "button", disabled: next < 0, onclick: () => showKeyframe(map, submap, next)}, label);
  };
  open(["Keyframe of submap ", chip(submap.info), `, frame ${keyframes.frame[row]}`], box,
    element("p", {class: "row"}, go(-1, "‹ earlier"), go(1, "later ›"), element("label", {}, features, " features")),
    element("dl", {}, element("dt", {}, "Time"), element("dd", {}, dateTime(map.utimeOf(submap, keyframes.t[row]))),
      element("dt", {}, "Place"), element("dd", {}, `${onPage.toArray().map(x => x.toFixed(2)).join(", ")} ${unit}`),
      element("dt", {}, "Keyframe"), element("dd", {}, String(keyframes.id[row]))),
    element("p", {class: "note"}, "Green rings: features that see a point of the map; grey: others."));
}
