// Times, lengths and counts for people, and elements.

let isUtc = localStorage.getItem("mapmend-utc") === "1";
export const usesUtc = () => isUtc;
export function setUtc(utc) {
  isUtc = utc;
  localStorage.setItem("mapmend-utc", utc ? "1" : "0");
}

const kFirstDate = 315532800e6;  // 1980: earlier times are seconds of a video

// Microseconds since 1970, or of a video.
export function clockTime(utime) {
  if (utime < kFirstDate) return `${(utime / 1e6).toFixed(1)} s`;
  const date = new Date(utime / 1000);
  const text = date.toLocaleTimeString("en-GB", isUtc ? {timeZone: "UTC"} : {});
  return text + (isUtc ? " UTC" : "");
}

export function dateTime(utime) {
  if (utime < kFirstDate) return clockTime(utime);
  const date = new Date(utime / 1000);
  const day = date.toLocaleDateString("sv-SE", isUtc ? {timeZone: "UTC"} : {});
  return `${day} ${clockTime(utime)}`;
}

export function duration(seconds) {
  const s = Math.round(seconds);
  if (s < 60) return `${s} s`;
  const rest = `${String(s % 60).padStart(2, "0")}`;
  return s < 3600 ? `${Math.floor(s / 60)}:${rest}` : `${Math.floor(s / 3600)}:${String(Math.floor(s / 60) % 60).padStart(2, "0")}:${rest}`;
}

export function length(value, unit) {
  if (unit !== "m") return `${value.toPrecision(2)} ${unit}`;
  return value < 1000 ? `${Math.round(value)} m` : `${(value / 1000).toFixed(1)} km`;
}

export const plural = (n, noun) => `${n} ${noun}${n === 1 ? "" : "s"}`;
export const readable = text => (text ?? "").replaceAll("_", " ");

const kWinds = ["north", "north-east", "east", "south-east", "south", "south-west", "west", "north-west"];
export const wind = degrees => kWinds[Math.round(((degrees % 360) + 360) % 360 / 45) % 8];

export const at = id => document.getElementById(id);

// element("td", {class: "n", onclick: f}, "text", child, ...)
export function element(tag, attributes = {}, ...children) {
  return fill(document.createElement(tag), attributes, children);
}
export function svg(tag, attributes = {}, ...children) {
  return fill(document.createElementNS("http://www.w3.org/2000/svg", tag), attributes, children);
}
function fill(node, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (name === "color") node.style.setProperty("--c", value);
    else if (name === "ink") node.style.setProperty("--i", value);
    else node.setAttribute(name, value === true ? "" : value);
  }
  node.append(...children.filter(child => child !== undefined && child !== null));
  return node;
}

export const chip = submap => element("span", {class: "chip", color: submap?.color, ink: submap?.ink}, String(submap?.number ?? "?"));
