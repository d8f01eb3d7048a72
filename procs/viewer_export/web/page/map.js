// The map as the page knows it: submaps with their points, keyframes and frames, each in the submap's own frame, and
// where the submaps stand on the page. A submap that is placed anew glides there.
import {Quaternion, Vector3} from "/lib/three/build/three.module.js";
import {apply, cameraOf, compose, copyOf, difference, between, fromArray, identity, toMatrix} from "./similarity.js";

const kGlideMs = 1500;
const kFirstRows = 256;

class Rows {
  constructor(fields) {
    this.fields = fields;
    this.count = 0;
    this.capacity = 0;
    for (const [name, type, width] of fields) this[name] = new type(0), this[name].width = width;
    this.version = 0;
  }
  reserve(count) {
    if (count > this.capacity) {
      this.capacity = Math.max(kFirstRows, count, 2 * this.capacity);
      for (const [name, type, width] of this.fields) {
        const grown = new type(this.capacity * width);
        grown.set(this[name]);
        grown.width = width;
        this[name] = grown;
      }
    }
    this.count = Math.max(this.count, count);
  }
  // How many rows, which come in the order of time, are not later than t.
  countUntil(t) {
    if (t === Infinity) return this.count;
    let low = 0, high = this.count;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.t[middle] <= t) low = middle + 1;
      else high = middle;
    }
    return low;
  }
}

class Submap {
  constructor(key) {
    this.key = key;
    this.info = null;  // as the feed tells it
    this.points = new Rows([["xyz", Float32Array, 3], ["t", Float32Array, 1], ["rgb", Uint8Array, 3], ["shown", Uint8Array, 1]]);
    this.keyframes = new Rows([["id", Int32Array, 1], ["frame", Int32Array, 1], ["t", Float32Array, 1],
      ["pose", Float32Array, 7], ["shown", Uint8Array, 1]]);
    this.frames = new Rows([["frame", Int32Array, 1], ["t", Float32Array, 1], ["keyframe", Uint32Array, 1], ["offset", Float32Array, 3]]);
    this.place = null;   // page_from_submap as drawn
    this.target = null;  // where it glides to
    this.from = null;
    this.since = 0;
    this.isJoined = true;  // part of the main map
    this.radius = 1;       // of its cameras, own unit
    this.matrix = null;
  }
}

const kReaders = {
  points(rows, view, at, row) {
    for (let i = 0; i < 3; ++i) rows.xyz[3 * row + i] = view.getFloat32(at + 4 * i, true);
    rows.t[row] = view.getFloat32(at + 12, true);
    for (let i = 0; i < 3; ++i) rows.rgb[3 * row + i] = view.getUint8(at + 16 + i);
    rows.shown[row] = view.getUint8(at + 19);
    return 20;
  },
  keyframes(rows, view, at, row) {
    rows.id[row] = view.getInt32(at, true);
    rows.frame[row] = view.getInt32(at + 4, true);
    rows.t[row] = view.getFloat32(at + 8, true);
    for (let i = 0; i < 7; ++i) rows.pose[7 * row + i] = view.getFloat32(at + 12 + 4 * i, true);
    rows.shown[row] = view.getUint32(at + 40, true);
    return 44;
  },
  frames(rows, view, at, row) {
    rows.frame[row] = view.getInt32(at, true);
    rows.t[row] = view.getFloat32(at + 4, true);
    rows.keyframe[row] = view.getUint32(at + 8, true);
    for (let i = 0; i < 3; ++i) rows.offset[3 * row + i] = view.getFloat32(at + 12 + 4 * i, true);
    return 24;
  },
};

export class MapData {
  constructor() {
    this.clear();
    this.reduceMotion = matchMedia("(prefers-reduced-motion: reduce)").matches;
  }

  clear() {
    this.submaps = new Map();   // by key
    this.sessions = new Map();  // by index
    this.edges = new Map();
    this.frames = new Map();    // page_from_root, by key of the root
    this.restoration = [];
    this.pose = null;
    this.time = Infinity;  // microseconds; what came later is not shown
    this.placed = new Map();
    this.version = 0;
  }

  submap(key) {
    let submap = this.submaps.get(key);
    if (!submap) this.submaps.set(key, submap = new Submap(key));
    return submap;
  }

  byNumber() {
    return [...this.submaps.values()].filter(s => s.info).sort((a, b) => a.info.number - b.info.number);
  }

  takeRows(table, view) {
    const slash = table.indexOf("/"), kind = table.slice(0, slash), read = kReaders[kind];
    if (!read) return;
    const rows = this.submap(table.slice(slash + 1))[kind];
    for (let at = 0; at < view.byteLength;) {
      const row = view.getUint32(at, true);
      rows.reserve(row + 1);
      at += 4 + read(rows, view, at + 4, row);
    }
    ++rows.version;
    ++this.version;
  }

  takeValue(name, value) {
    const slash = name.indexOf("/"), kind = slash < 0 ? name : name.slice(0, slash), rest = name.slice(slash + 1);
    const put = (map, key) => value === undefined ? map.delete(key) : map.set(key, value);
    if (kind === "submap") this.submap(rest).info = value ?? null;
    else if (kind === "session") put(this.sessions, Number(rest));
    else if (kind === "edge") put(this.edges, rest);
    else if (kind === "frame") put(this.frames, rest);
    else if (kind === "restoration") this.restoration = value ?? [];
    else if (kind === "pose") this.pose = value ?? null;
    else return;
    ++this.version;
  }

  secondsInto(submap, utime) {
    if (utime === Infinity) return Infinity;
    return (utime - (this.sessions.get(submap.info.session)?.start ?? 0)) / 1e6;
  }
  utimeOf(submap, seconds) {
    return (this.sessions.get(submap.info.session)?.start ?? 0) + 1e6 * seconds;
  }

  // The submaps that are one map: now as the merger says, at an earlier time as the restoration tells.
  groups() {
    const shown = this.byNumber().filter(s => this.time === Infinity || (s.info.begin ?? Infinity) <= this.time);
    const groups = new Map();
    let maps = null;
    if (this.time !== Infinity) {
      const step = this.restoration.filter(r => r.utime <= this.time).at(-1);
      maps = new Map();
      step?.maps.forEach((map, i) => map.forEach(key => maps.set(key, `then ${i}`)));
    }
    for (const s of shown) {
      // Joined then, but not in the map of today (a connection was switched off): apart.
      const part = s.info.component === undefined ? `alone ${s.key}` : `part ${s.info.component}`;
      const name = maps === null ? part : `${part} ${maps.get(s.key) ?? s.key}`;
      if (!groups.has(name)) groups.set(name, []);
      groups.get(name).push(s);
    }
    const size = group => group.reduce((n, s) => n + s.info.frames, 0);
    // The part that holds the root of the main map first, then the largest.
    const rank = group => (group.some(s => s.info.component === 0 && s.info.root) ? 1e12 : 0) + size(group);
    return [...groups.values()].sort((a, b) => rank(b) - rank(a));
  }

  rootOf(component) {
    for (const s of this.submaps.values()) if (s.info?.component === component && s.info.root) return s;
    return null;
  }

  // page_from_root of a part. Without a word on it: turned like the main part.
  frameOf(group) {
    const component = group[0].info.component;
    const root = component === undefined ? group[0] : this.rootOf(component) ?? group[0];
    const own = this.frames.get(root.key);
    if (own) return fromArray(own.page_from_root);
    const main = this.rootOf(0), other = main && this.frames.get(main.key);
    const turn = identity();
    turn.q = other ? fromArray(other.page_from_root).q : new Quaternion(1, 0, 0, 0);  // looking down, until it is known
    return turn;
  }

  // Middle and extent of what a submap's cameras and points cover, in its own frame.
  measure(submap) {
    const {keyframes, points} = submap;
    if (submap.measured === keyframes.version + points.version) return;
    submap.measured = keyframes.version + points.version;
    const low = new Vector3(Infinity, Infinity, Infinity), high = low.clone().negate(), v = new Vector3();
    for (let i = 0; i < keyframes.count; ++i) {
      if (!keyframes.shown[i]) continue;
      v.copy(cameraOf(keyframes.pose.subarray(7 * i, 7 * i + 7)).center);
      low.min(v);
      high.max(v);
    }
    // Of the points the middle 90 %, or a few that are far away would push all others together.
    const step = Math.max(1, Math.floor(points.count / 300)), axes = [[], [], []];
    for (let i = 0; i < points.count; i += step) {
      if (points.shown[i]) for (let k = 0; k < 3; ++k) axes[k].push(points.xyz[3 * i + k]);
    }
    if (axes[0].length > 20) {
      for (const axis of axes) axis.sort((a, b) => a - b);
      const quantile = share => new Vector3(...axes.map(axis => axis[Math.floor(share * (axis.length - 1))]));
      low.min(quantile(0.05));
      high.max(quantile(0.95));
    }
    if (low.x > high.x) low.setScalar(-1), high.setScalar(1);
    submap.middle = low.clone().add(high).multiplyScalar(0.5);
    submap.radius = Math.max(1e-6, low.distanceTo(high) / 2);
  }

  extentOf(group, placeOf) {
    const low = new Vector3(Infinity, Infinity, Infinity), high = low.clone().negate();
    for (const s of group) {
      this.measure(s);
      const place = placeOf(s), middle = apply(place, s.middle), r = place.s * s.radius;
      low.min(middle.clone().subScalar(r));
      high.max(middle.clone().addScalar(r));
    }
    return {low, high, middle: low.clone().add(high).multiplyScalar(0.5), radius: low.distanceTo(high) / 2};
  }

  // Works out where all submaps stand, and lets them glide there.
  layOut(now) {
    const groups = this.groups(), shown = new Set();
    let right = 0, mainExtent = null;
    groups.forEach((group, index) => {
      const frame = this.frameOf(group);
      const own = s => s.info.place ? compose(frame, fromArray(s.info.place)) : frame;
      let shift = identity();
      const extent = this.extentOf(group, own);
      if (index === 0) {
        mainExtent = extent;
        right = extent.high.x;
      } else {
        // Apart: beside the main map, no larger than it, since its unit is another one.
        const isMeasured = this.frames.get(group[0].key)?.unit === "m";
        const scale = isMeasured ? 1 : Math.min(1, mainExtent.radius / extent.radius) * (extent.radius < mainExtent.radius / 4 ? mainExtent.radius / 4 / extent.radius : 1);
        const gap = 0.15 * mainExtent.radius;
        shift = {s: scale, q: new Quaternion(), t: new Vector3(right + gap - scale * extent.low.x,
          mainExtent.middle.y - scale * extent.middle.y, mainExtent.low.z - scale * extent.low.z)};
        right += gap + scale * (extent.high.x - extent.low.x);
      }
      for (const s of group) {
        shown.add(s);
        s.isJoined = index === 0;
        s.groupIndex = index;
        this.sendTo(s, compose(shift, own(s)), now);
      }
    });
    for (const s of this.submaps.values()) s.isVisible = shown.has(s);
    this.extent = this.extentOf([...shown], s => s.target);
    this.mainExtent = mainExtent ?? this.extent;
    this.numGroups = groups.length;
  }

  sendTo(submap, target, now) {
    if (!submap.place) submap.place = copyOf(target), submap.matrix = toMatrix(target);
    if (submap.target && difference(submap.target, target, submap.radius) < 1e-4 * submap.radius * target.s) return;
    submap.target = target;
    const isFar = difference(submap.place, target, submap.radius) > 0.02 * submap.radius * target.s;
    submap.from = isFar && !this.reduceMotion ? copyOf(submap.place) : null;
    submap.since = now;
    if (isFar && submap.from) submap.glides = (submap.glides ?? 0) + 1;
    if (!submap.from) submap.place = target, toMatrix(target, submap.matrix);
  }

  // Moves what glides. Returns whether anything does.
  glide(now) {
    let moves = false;
    for (const submap of this.submaps.values()) {
      if (!submap.from) continue;
      const share = Math.min(1, (now - submap.since) / kGlideMs), eased = share * share * (3 - 2 * share);
      submap.place = share < 1 ? between(submap.from, submap.target, eased) : submap.target;
      toMatrix(submap.place, submap.matrix);
      if (share >= 1) submap.from = null;
      moves = true;
    }
    return moves;
  }

  // Where the camera of a keyframe is on the page, with its axes.
  cameraOnPage(submap, pose) {
    const camera = cameraOf(pose);
    return {center: apply(submap.place, camera.center), q: submap.place.q.clone().multiply(camera.q)};
  }

  livePose() {
    if (this.time !== Infinity || !this.pose?.cam_from_submap) return null;
    const submap = this.submaps.get(this.pose.submap);
    return submap?.place ? {submap, pose: this.pose.cam_from_submap, ...this.cameraOnPage(submap, this.pose.cam_from_submap)} : null;
  }

  // The path of a submap until a time, in its own frame: an array of x, y, z, frame by frame.
  pathOf(submap, seconds) {
    const {frames, keyframes} = submap, cache = submap.pathCache;
    if (cache && cache.version === frames.version + keyframes.version && cache.seconds === seconds) return cache.path;
    const order = [];
    for (let i = 0; i < frames.count; ++i) if (frames.t[i] <= seconds) order.push(i);
    order.sort((a, b) => frames.t[a] - frames.t[b]);
    const path = new Float32Array(3 * order.length), v = new Vector3(), q = new Quaternion();
    let count = 0;
    for (const i of order) {
      const k = frames.keyframe[i], pose = keyframes.pose.subarray(7 * k, 7 * k + 7);
      if (k >= keyframes.count || !keyframes.shown[k]) continue;
      // x_submap = R^T (x_camera - t)
      q.set(-pose[3], -pose[4], -pose[5], pose[6]);
      v.set(frames.offset[3 * i] - pose[0], frames.offset[3 * i + 1] - pose[1], frames.offset[3 * i + 2] - pose[2]).applyQuaternion(q);
      v.toArray(path, 3 * count++);
    }
    submap.pathCache = {version: frames.version + keyframes.version, seconds, path: path.subarray(0, 3 * count)};
    return submap.pathCache.path;
  }
}
