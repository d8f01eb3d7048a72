// The map from above on the picture of the ground, with what is to be flown again.
import {CRS, GridLayer, ImageOverlay, LatLngBounds, LayerGroup, Map as LeafletMap, Point, Polygon, Polyline, CircleMarker, Control, SVGOverlay}
  from "/lib/leaflet/leaflet.esm.min.js";
import {Vector3} from "/lib/three/build/three.module.js";
import {apply, compose, fromArray, inverse} from "/page/similarity.js";
import {at, element} from "/page/words.js";

// Tiles that this server has; none where it has none.
const Tiles = GridLayer.extend({
  createTile(coordinates, done) {
    const image = element("img", {alt: "", width: 256, height: 256});
    image.addEventListener("load", () => done(null, image));
    image.addEventListener("error", () => done(null, image));
    image.src = `/tiles/${coordinates.z}/${coordinates.x}/${coordinates.y}?v=${this.options.version}`;
    return image;
  },
});

export class Ground {
  constructor(map, onKeyframe) {
    this.map = map;
    this.onKeyframe = onKeyframe;
    this.leaflet = null;
    this.gaps = null;
    this.picture = null;
    this.tiles = null;
    this.plane = {scale: [1, 1], offset: [0, 0], ground: null};
  }

  // A place of the page on the plane of web maps. Tiles have a ground of their own, which lies on the earth where
  // positions are known (docs/file_formats.md, Tiles); without tiles the plane is the page's.
  latLng(x, y, z = 0) {
    const {scale, offset, ground} = this.plane, p = ground ? apply(ground, new Vector3(x, y, z)) : {x, y};
    return CRS.EPSG3857.unproject(new Point(p.x * scale[0] + offset[0], p.y * scale[1] + offset[1]));
  }

  // Worked out once for each state of tiles and map.
  updatePlane() {
    this.plane = {scale: [1, 1], offset: [0, 0], ground: null};
    const m = this.tiles?.metadata, root = this.map.rootOf(0), frame = root && this.map.frames.get(root.key);
    if (!m?.tiles_from_ground || !frame) return;
    const numbers = m.tiles_from_ground.split(/[,\s]+/).filter(Boolean).map(Number), main = JSON.parse(m.components ?? "[]")[0];
    if (numbers.length !== 4 || !main?.ground_from_map) return;
    this.plane = {scale: numbers.slice(0, 2), offset: numbers.slice(2),
      ground: compose(fromArray(main.ground_from_map), inverse(fromArray(frame.page_from_root)))};
  }

  open() {
    if (this.leaflet) return;
    this.leaflet = new LeafletMap(at("ground-map"), {attributionControl: false, maxZoom: 28, zoomSnap: 0.25, preferCanvas: true, zoomAnimation: !this.map.reduceMotion});
    this.leaflet.setView(this.latLng(0, 0), 18);
    this.scale = new Control.Scale({imperial: false, metric: true});
    this.layers = new LayerGroup().addTo(this.leaflet);
    this.isFitted = false;
  }

  draw(isVisible) {
    if (!isVisible || !this.map.mainExtent) return;
    const before = JSON.stringify([this.plane.scale, this.plane.offset]);
    this.updatePlane();
    this.open();
    if (JSON.stringify([this.plane.scale, this.plane.offset]) !== before) this.isFitted = false;
    this.leaflet.invalidateSize(false);
    this.drawGround();
    const isMetric = this.map.frames.get(this.map.rootOf(0)?.key)?.unit === "m";
    if (isMetric && !this.scale._map) this.scale.addTo(this.leaflet);
    this.layers.clearLayers();
    for (const submap of this.map.byNumber()) {
      if (!submap.isVisible || !submap.target) continue;
      const path = this.map.pathOf(submap, this.map.secondsInto(submap, this.map.time)), line = [], v = new Vector3();
      for (let i = 0; i < path.length; i += 3) {
        const p = apply(submap.target, v.set(path[i], path[i + 1], path[i + 2]));
        line.push(this.latLng(p.x, p.y, p.z));
      }
      if (line.length === 0) continue;
      new Polyline(line, {color: submap.info.color, weight: 3, dashArray: submap.isJoined ? null : "6 5"}).bindTooltip(`Submap ${submap.info.number}${submap.isJoined ? "" : ", apart"}`, {sticky: true}).addTo(this.layers);
      this.drawKeyframes(submap);
    }
    this.drawGaps();
    const live = this.map.livePose();
    if (live) new CircleMarker(this.latLng(live.center.x, live.center.y, live.center.z), {radius: 7, color: "#000", weight: 2, fillColor: "#fff", fillOpacity: 1}).bindTooltip("live", {permanent: true, direction: "right"}).addTo(this.layers);
    if (!this.isFitted) this.fit();
  }

  drawKeyframes(submap) {
    const {keyframes} = submap, count = keyframes.countUntil(this.map.secondsInto(submap, this.map.time));
    for (let i = 0; i < count; ++i) {
      if (!keyframes.shown[i]) continue;
      const {center} = this.map.cameraOnPage({place: submap.target}, keyframes.pose.subarray(7 * i, 7 * i + 7));
      new CircleMarker(this.latLng(center.x, center.y, center.z), {radius: 3, weight: 0, fillColor: submap.info.color, fillOpacity: 1})
        .on("click", () => this.onKeyframe(submap, i)).addTo(this.layers);
    }
  }

  drawGaps() {
    for (const gap of this.gaps?.list ?? []) {
      const style = {color: "#c1121f", weight: 2, fillOpacity: 0.15};
      if (gap.rings) new Polygon(gap.rings.map(ring => ring.map(([x, y]) => this.latLng(x, y))), style).bindTooltip(gap.text, {sticky: true}).addTo(this.layers);
      else if (gap.line) new Polyline(gap.line.map(([x, y]) => this.latLng(x, y)), {...style, weight: 4, dashArray: "8 6"}).bindTooltip(gap.text, {sticky: true}).addTo(this.layers);
    }
  }

  drawGround() {
    if (this.tiles && this.tilesVersion !== this.tiles.version) {
      this.tilesVersion = this.tiles.version;
      this.tileLayer?.remove();
      this.tileLayer = new Tiles({version: this.tiles.version, minNativeZoom: this.tiles.min_zoom, maxNativeZoom: this.tiles.max_zoom, minZoom: 0, maxZoom: 28}).addTo(this.leaflet);
    }
    if (this.tiles || !this.picture || this.shownPicture === this.picture) return;
    this.shownPicture = this.picture;
    this.overlay?.remove();
    const {corner, alongX, alongY} = this.picture.place, end = corner.clone().add(alongX).add(alongY);
    const bounds = new LatLngBounds(this.latLng(corner.x, corner.y), this.latLng(end.x, end.y));
    // The picture's own frame may be turned against the page's.
    const turned = Math.abs(alongX.y) > 0.003 * alongX.length();
    this.overlay = turned ? this.turnedOverlay(corner, alongX, alongY) : new ImageOverlay(this.picture.url, bounds, {alt: "the ground", pane: "tilePane"});
    this.overlay.addTo(this.leaflet);
  }

  // Leaflet places pictures along its axes only: an SVG that holds it with a turn.
  turnedOverlay(corner, alongX, alongY) {
    const corners = [corner, corner.clone().add(alongX), corner.clone().add(alongY), corner.clone().add(alongX).add(alongY)];
    const low = corners.reduce((a, b) => a.clone().min(b)), high = corners.reduce((a, b) => a.clone().max(b));
    const box = document.createElementNS("http://www.w3.org/2000/svg", "svg"), image = document.createElementNS("http://www.w3.org/2000/svg", "image");
    box.setAttribute("viewBox", `0 0 ${high.x - low.x} ${high.y - low.y}`);
    box.setAttribute("preserveAspectRatio", "none");
    image.setAttribute("href", this.picture.url);
    image.setAttribute("width", "1");
    image.setAttribute("height", "1");
    image.setAttribute("preserveAspectRatio", "none");
    image.setAttribute("transform", `matrix(${alongX.x} ${-alongX.y} ${alongY.x} ${-alongY.y} ${corner.x - low.x} ${high.y - corner.y})`);
    box.append(image);
    return new SVGOverlay(box, new LatLngBounds(this.latLng(low.x, low.y), this.latLng(high.x, high.y)), {pane: "tilePane"});
  }

  fit() {
    const {low, high} = this.map.extent ?? {};
    if (!low || !Number.isFinite(low.x)) return;
    this.leaflet.fitBounds(new LatLngBounds(this.latLng(low.x, low.y), this.latLng(high.x, high.y)), {animate: false});
    this.isFitted = this.map.extent.radius > 0;
  }

  show(gap) {
    if (this.leaflet && gap.center) this.leaflet.panTo(this.latLng(...gap.center));
  }
}
