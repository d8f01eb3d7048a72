// The 3D view.
import * as THREE from "/lib/three/build/three.module.js";
import {OrbitControls} from "/lib/three/examples/jsm/controls/OrbitControls.js";
import {apply, fromArray} from "/page/similarity.js";
import {makeGpuRenderer} from "/page/gpu.js";
import {SoftwareRenderer} from "/page/software.js";
import {at, chip, element} from "/page/words.js";

const kFrustum = 0.018;  // depth of a camera's pyramid, of the map's radius
const kPickPixels = 14;
const kMosaicPixels = 1600;
const kMovingMs = 150;  // pictures that follow each other faster are a movement
const kManyPoints = 60000;  // more are drawn as single pixels

const hex = color => parseInt(color.slice(1), 16);

export class Space {
  // onKeyframe(submap, row): a keyframe was chosen
  constructor(map, onKeyframe) {
    this.map = map;
    this.onKeyframe = onKeyframe;
    this.canvas = at("canvas");
    const wanted = new URLSearchParams(location.search).get("renderer");
    this.renderer = (wanted === "software" ? null : makeGpuRenderer(this.canvas, wanted === "webgl")) ?? new SoftwareRenderer(this.canvas);
    this.camera = new THREE.PerspectiveCamera(45, 1, 0.01, 1000);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.enableKeys = false;
    this.controls.screenSpacePanning = true;
    this.controls.addEventListener("change", () => this.isDirty = true);
    this.controls.addEventListener("start", () => this.isFree = true);
    this.isDirty = true;
    this.isFree = false;  // somebody has turned the view: it is not fitted any more
    this.isFollowing = false;
    this.drawables = new Map();  // by submap: its own, and what they were made from
    this.picture = null;
    this.frames = 0;
    this.fittedRadius = 0;
    this.drawnAt = 0;
    this.wasMoving = false;
    for (const id of ["colour", "show-frusta", "show-points", "show-mosaic"]) at(id).addEventListener("change", () => this.isDirty = true);
    at("fit").addEventListener("click", () => this.fit());
    at("top").addEventListener("click", () => this.fit(true));
    at("follow").addEventListener("click", () => this.setFollow(!this.isFollowing));
    this.canvas.addEventListener("click", event => this.pick(event.offsetX, event.offsetY));
    this.canvas.addEventListener("keydown", event => this.onKey(event));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.isDirty = true);
  }

  setFollow(follow) {
    this.isFollowing = follow;
    at("follow").setAttribute("aria-pressed", String(follow));
    this.isDirty = true;
  }

  fit(fromAbove = false) {
    const {middle, radius} = this.map.extent ?? {};
    if (!middle || !Number.isFinite(radius)) return;
    this.setFollow(false);
    const direction = fromAbove ? new THREE.Vector3(0, -0.001, 1) : new THREE.Vector3(0.25, -0.75, 0.75).normalize();
    const tangent = Math.tan(this.camera.fov * Math.PI / 360), aspect = Math.min(1, this.camera.aspect);
    this.controls.target.copy(middle);
    this.camera.position.copy(middle).addScaledVector(direction, 0.72 * radius / (tangent * aspect));
    this.fittedRadius = radius;
    this.isFree = fromAbove;
    this.controls.update();
    this.isDirty = true;
  }

  onKey(event) {
    const {target} = this.controls, offset = this.camera.position.clone().sub(target), spherical = new THREE.Spherical();
    const turn = (theta, phi) => {
      // Around z.
      const up = new THREE.Quaternion().setFromUnitVectors(this.camera.up, new THREE.Vector3(0, 1, 0));
      spherical.setFromVector3(offset.applyQuaternion(up));
      spherical.theta += theta;
      spherical.phi = Math.max(0.001, Math.min(Math.PI - 0.001, spherical.phi + phi));
      this.camera.position.copy(target).add(new THREE.Vector3().setFromSpherical(spherical).applyQuaternion(up.inverse()));
    };
    const move = (right, up) => {
      const step = offset.length() * 0.08, m = this.camera.matrix.elements;
      const by = new THREE.Vector3(m[0], m[1], m[2]).multiplyScalar(right * step).addScaledVector(new THREE.Vector3(m[4], m[5], m[6]), up * step);
      target.add(by);
      this.camera.position.add(by);
    };
    const zoom = factor => this.camera.position.copy(target).addScaledVector(offset, factor);
    const arrows = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1]};
    if (arrows[event.key]) {
      const [x, y] = arrows[event.key];
      event.shiftKey ? move(x, y) : turn(0.12 * x, -0.12 * y);
    } else if (event.key === "+" || event.key === "=") zoom(0.85);
    else if (event.key === "-") zoom(1.18);
    else if (event.key === "f" || event.key === "F") this.setFollow(!this.isFollowing);
    else if (event.key === "t" || event.key === "T") return this.fit(true);
    else if (event.key === "Home") return this.fit();
    else if (event.key === "Enter") return this.pick(this.canvas.clientWidth / 2, this.canvas.clientHeight / 2, Infinity);
    else return;
    event.preventDefault();
    this.isFree = true;
    this.controls.update();
    this.isDirty = true;
  }

  // Keyframes on the screen, nearest to a place of it first found.
  pick(x, y, within = kPickPixels) {
    let best = null;
    const v = new THREE.Vector3();
    for (const submap of this.map.submaps.values()) {
      if (!submap.isVisible || !submap.place) continue;
      const {keyframes} = submap, count = keyframes.countUntil(this.map.secondsInto(submap, this.map.time));
      for (let i = 0; i < count; ++i) {
        if (!keyframes.shown[i]) continue;
        v.copy(this.map.cameraOnPage(submap, keyframes.pose.subarray(7 * i, 7 * i + 7)).center).project(this.camera);
        if (v.z > 1) continue;
        const away = Math.hypot((v.x + 1) / 2 * this.canvas.clientWidth - x, (1 - v.y) / 2 * this.canvas.clientHeight - y);
        if (away <= within && (!best || away < best.away)) best = {submap, row: i, away};
      }
    }
    if (best) this.onKeyframe(best.submap, best.row);
  }

  // The picture of the ground: an image, and where its north-west corner and its sides lie (Vector3 of the page).
  async setPicture(url, {corner, alongX, alongY}) {
    const image = new Image();
    image.src = url;
    await image.decode();
    const scale = Math.min(1, kMosaicPixels / Math.max(image.naturalWidth, image.naturalHeight));
    const canvas = element("canvas", {width: Math.round(scale * image.naturalWidth), height: Math.round(scale * image.naturalHeight)});
    const context = canvas.getContext("2d", {willReadFrequently: true});
    context.drawImage(image, 0, 0, canvas.width, canvas.height);
    this.picture = {kind: "picture", id: "ground", pixels: context.getImageData(0, 0, canvas.width, canvas.height), corner, alongX, alongY};
    at("mosaic-label").hidden = false;
    this.isDirty = true;
  }

  frustumOf(submap, pose, depth, out) {
    const session = this.map.sessions.get(submap.info.session) ?? {width: 4, height: 3, fx: 4, fy: 4, cx: 2, cy: 1.5};
    const q = new THREE.Quaternion(-pose[3], -pose[4], -pose[5], pose[6]), t = new THREE.Vector3(pose[0], pose[1], pose[2]);
    const point = (u, v, d) => new THREE.Vector3((u - session.cx) / session.fx * d, (v - session.cy) / session.fy * d, d).sub(t).applyQuaternion(q);
    const c = point(0, 0, 0), corners = [[0, 0], [session.width, 0], [session.width, session.height], [0, session.height]].map(([u, v]) => point(u, v, depth));
    for (let i = 0; i < 4; ++i) for (const p of [c, corners[i], corners[i], corners[(i + 1) % 4]]) out.push(p.x, p.y, p.z);
  }

  // What of a submap is drawn, made anew only where something has changed.
  drawablesOf(submap) {
    const seconds = this.map.secondsInto(submap, this.map.time), {points, keyframes, frames, info} = submap;
    let own = this.drawables.get(submap.key);
    if (!own) this.drawables.set(submap.key, own = {});
    const update = (name, version, make) => {
      if (own[name]?.version !== version) own[name] = {version, made: make()};
      return own[name].made;
    };
    const byImage = at("colour").value === "image", color = hex(info.color);
    const cloud = update("points", `${points.version} ${seconds}`, () => {
      const count = points.countUntil(seconds), xyz = new Float32Array(3 * count), rgb = new Uint8Array(3 * count);
      let n = 0;
      for (let i = 0; i < count; ++i) {
        if (!points.shown[i]) continue;
        for (let k = 0; k < 3; ++k) xyz[3 * n + k] = points.xyz[3 * i + k], rgb[3 * n + k] = points.rgb[3 * i + k];
        ++n;
      }
      return {xyz, rgb, count: n};
    });
    const depth = kFrustum * this.map.mainExtent.radius / submap.place.s, coarse = Math.round(Math.log(depth) * 4);
    const pyramids = update("frusta", `${keyframes.version} ${seconds} ${coarse} ${this.map.sessions.size}`, () => {
      const out = [], count = keyframes.countUntil(seconds);
      for (let i = 0; i < count; ++i) if (keyframes.shown[i]) this.frustumOf(submap, keyframes.pose.subarray(7 * i, 7 * i + 7), depth, out);
      return {xyz: new Float32Array(out), count: out.length / 3};
    });
    const path = update("path", `${frames.version} ${keyframes.version} ${seconds}`, () => {
      const xyz = this.map.pathOf(submap, seconds);
      return {xyz, count: xyz.length / 3};
    });
    const {matrix} = submap, list = [];
    if (at("show-points").checked) list.push({kind: "points", id: `points ${submap.key} ${byImage}`, matrix, ...cloud, rgb: byImage ? cloud.rgb : undefined, color, size: this.pointSize});
    if (at("show-frusta").checked) list.push({kind: "lines", id: `frusta ${submap.key}`, matrix, ...pyramids, color});
    list.push({kind: "strip", id: `path ${submap.key}`, matrix, ...path, color, width: 2});
    return list;
  }

  liveDrawables() {
    const live = this.map.livePose();
    if (!live) return [];
    const out = [], depth = 2.5 * kFrustum * this.map.mainExtent.radius / live.submap.place.s;
    this.frustumOf(live.submap, live.pose, depth, out);
    return [{kind: "lines", id: "live", matrix: live.submap.matrix, xyz: new Float32Array(out), count: out.length / 3,
      color: hex(getComputedStyle(document.documentElement).getPropertyValue("--live").trim()), width: 2}];
  }

  // Draws if something has changed. Returns whether it did.
  draw() {
    const width = this.canvas.parentElement.clientWidth, height = this.canvas.parentElement.clientHeight;
    if (width === 0 || !this.map.extent) return false;
    if (width !== this.renderer.width || height !== this.renderer.height) {
      this.renderer.resize(width, height);
      this.camera.aspect = width / height;
      this.isDirty = true;
    }
    const {radius} = this.map.extent;
    if (!this.isFree && !this.isFollowing && Number.isFinite(radius) && Math.abs(radius / this.fittedRadius - 1) > 0.15) this.fit();
    if (this.isFollowing) this.follow();
    const now = performance.now(), isMoving = this.isDirty && now - this.drawnAt < kMovingMs;
    if (this.wasMoving && !isMoving && now - this.drawnAt >= kMovingMs) this.isDirty = true;  // once more, in full
    if (!this.isDirty) return false;
    this.isDirty = false;
    this.drawnAt = now;
    this.wasMoving = isMoving;
    const away = this.camera.position.distanceTo(this.controls.target);
    this.camera.near = Math.max(1e-6, away / 500);
    this.camera.far = away + 20 * Math.max(radius, away);
    this.camera.updateProjectionMatrix();
    this.camera.updateMatrixWorld();
    const list = [];
    if (this.picture && at("show-mosaic").checked && this.map.time === Infinity) list.push(this.picture);
    const submaps = this.map.byNumber().filter(s => s.isVisible && s.place);
    this.pointSize = submaps.reduce((n, s) => n + s.points.count, 0) > kManyPoints ? 1 : 2;
    for (const submap of submaps) list.push(...this.drawablesOf(submap));
    list.push(...this.liveDrawables());
    const background = getComputedStyle(document.documentElement).getPropertyValue("--space").trim();
    this.renderer.render(list, this.camera, hex(background), isMoving);
    this.drawLabels(submaps);
    ++this.frames;
    return true;
  }

  follow() {
    const live = this.map.livePose();
    if (!live) return;
    const by = live.center.clone().sub(this.controls.target);
    if (by.length() < 1e-4 * this.map.mainExtent.radius) return;
    this.controls.target.add(by);
    this.camera.position.add(by);
    this.controls.update();
    this.isDirty = true;
  }

  drawLabels(submaps) {
    const v = new THREE.Vector3(), labels = [], {clientWidth, clientHeight} = this.canvas;
    const add = (node, place) => {
      v.copy(place).project(this.camera);
      if (v.z > 1 || Math.abs(v.x) > 1 || Math.abs(v.y) > 1) return;
      node.style.transform = `translate(${((v.x + 1) / 2 * clientWidth).toFixed(1)}px, ${((1 - v.y) / 2 * clientHeight).toFixed(1)}px)`;
      labels.push(node);
    };
    for (const submap of submaps) {
      const path = this.map.pathOf(submap, this.map.secondsInto(submap, this.map.time));
      if (path.length === 0) continue;
      const label = element("div", {class: "label"}, chip(submap.info), submap.isJoined ? null : " apart");
      add(label, apply(submap.place, new THREE.Vector3(path[0], path[1], path[2])));
    }
    const live = this.map.livePose();
    if (live) add(element("div", {class: "label live"}, "live"), live.center);
    at("labels").replaceChildren(...labels);
  }
}

// Corner and sides of a picture with west, south, east, north in a frame of its own.
export function placePicture({west, south, east, north, page_from_picture: array}) {
  const place = fromArray(array), corner = apply(place, new THREE.Vector3(west, north, 0));
  return {corner, alongX: apply(place, new THREE.Vector3(east, north, 0)).sub(corner),
    alongY: apply(place, new THREE.Vector3(west, south, 0)).sub(corner)};
}
