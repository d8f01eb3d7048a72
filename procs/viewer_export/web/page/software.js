// Draws points, lines and a picture on the ground into a 2D canvas, without a graphics processor: software WebGL takes
// microseconds for a point or line, this takes nanoseconds.
//
// A drawable has matrix (page from its own frame), xyz (Float32Array), count, and
//   kind "points": rgb (Uint8Array, three for each point) or color; size in pixels
//   kind "lines": pairs of ends, color; kind "strip": one line through all, color, width
//   kind "picture": pixels (ImageData), corner, alongX, alongY: Vector3 of the page
// color: 0xrrggbb.
import {Matrix4} from "/lib/three/build/three.module.js";

const kNear = 1e-4;  // of the camera's near plane

const abgr = color => (0xff000000 | (color & 0xff) << 16 | color & 0xff00 | color >> 16 & 0xff) >>> 0;

export class SoftwareRenderer {
  constructor(canvas) {
    this.context = canvas.getContext("2d", {alpha: false});
    this.canvas = canvas;
    this.width = this.height = 0;
    this.name = "software";
    this.matrix = new Matrix4();
    this.viewProjection = new Matrix4();
  }

  resize(width, height) {
    width = Math.max(1, Math.round(width));
    height = Math.max(1, Math.round(height));
    if (width === this.width && height === this.height) return;
    this.canvas.width = this.width = width;
    this.canvas.height = this.height = height;
    this.image = this.context.createImageData(width, height);
    this.pixels = new Uint32Array(this.image.data.buffer);
    this.depth = new Float32Array(width * height);
  }

  // isMoving: the next picture will follow at once, so the ground may be coarse.
  render(drawables, camera, background, isMoving) {
    this.pixels.fill(abgr(background));
    this.depth.fill(Infinity);
    this.near = camera.near * (1 + kNear);
    this.viewProjection.multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
    for (const drawable of drawables) {
      if (drawable.kind === "picture") this.drawPicture(drawable, isMoving ? 2 : 1);
      else if (drawable.kind === "points") this.drawPoints(drawable);
      else this.drawLines(drawable);
    }
    this.context.putImageData(this.image, 0, 0);
  }

  // Rows of the matrix to pixels: x and y in pixels times w, and w.
  rows(drawable) {
    const e = this.matrix.multiplyMatrices(this.viewProjection, drawable.matrix).elements;
    const w = this.width / 2, h = this.height / 2;
    const x = [0, 1, 2, 3].map(k => w * (e[4 * k] + e[4 * k + 3])), y = [0, 1, 2, 3].map(k => h * (e[4 * k + 3] - e[4 * k + 1]));
    return {x, y, w: [e[3], e[7], e[11], e[15]]};
  }

  drawPoints({count, xyz, rgb, color, size, ...drawable}) {
    const {x: [ax, bx, cx, dx], y: [ay, by, cy, dy], w: [aw, bw, cw, dw]} = this.rows(drawable);
    const {pixels, depth, width, height, near} = this;
    const flat = abgr(color ?? 0);
    const large = size > 1;
    for (let i = 0, j = 0; i < count; ++i, j += 3) {
      const px = xyz[j], py = xyz[j + 1], pz = xyz[j + 2];
      const w = aw * px + bw * py + cw * pz + dw;
      if (w < near) continue;
      const x = (ax * px + bx * py + cx * pz + dx) / w, y = (ay * px + by * py + cy * pz + dy) / w;
      if (!(x >= 0 && y >= 0 && x < width - 1 && y < height - 1)) continue;
      const at = (y | 0) * width + (x | 0);
      const value = rgb ? (0xff000000 | rgb[j + 2] << 16 | rgb[j + 1] << 8 | rgb[j]) >>> 0 : flat;
      if (w < depth[at]) depth[at] = w, pixels[at] = value;
      if (!large) continue;
      if (w < depth[at + 1]) depth[at + 1] = w, pixels[at + 1] = value;
      if (w < depth[at + width]) depth[at + width] = w, pixels[at + width] = value;
      if (w < depth[at + width + 1]) depth[at + width + 1] = w, pixels[at + width + 1] = value;
    }
  }

  drawLines({kind, count, xyz, color, width: wide, ...drawable}) {
    const {x: [ax, bx, cx, dx], y: [ay, by, cy, dy], w: [aw, bw, cw, dw]} = this.rows(drawable);
    const value = abgr(color), step = kind === "strip" ? 3 : 6, last = 3 * (count - 1);
    for (let j = 0; j < last; j += step) {
      let x0 = xyz[j], y0 = xyz[j + 1], z0 = xyz[j + 2], x1 = xyz[j + 3], y1 = xyz[j + 4], z1 = xyz[j + 5];
      let w0 = aw * x0 + bw * y0 + cw * z0 + dw, w1 = aw * x1 + bw * y1 + cw * z1 + dw;
      if (w0 < this.near && w1 < this.near) continue;
      if (w0 < this.near || w1 < this.near) {
        // Cut off what is behind the camera.
        const share = (this.near - w0) / (w1 - w0), x = x0 + share * (x1 - x0), y = y0 + share * (y1 - y0), z = z0 + share * (z1 - z0);
        if (w0 < this.near) x0 = x, y0 = y, z0 = z, w0 = this.near;
        else x1 = x, y1 = y, z1 = z, w1 = this.near;
      }
      this.drawLine((ax * x0 + bx * y0 + cx * z0 + dx) / w0, (ay * x0 + by * y0 + cy * z0 + dy) / w0, w0,
        (ax * x1 + bx * y1 + cx * z1 + dx) / w1, (ay * x1 + by * y1 + cy * z1 + dy) / w1, w1, value, wide > 1);
    }
  }

  drawLine(x0, y0, w0, x1, y1, w1, value, wide) {
    const {pixels, depth, width, height} = this;
    // To the picture (Liang, Barsky, 1984).
    let from = 0, to = 1;
    const dx = x1 - x0, dy = y1 - y0;
    for (const [p, q] of [[-dx, x0], [dx, width - 2 - x0], [-dy, y0], [dy, height - 2 - y0]]) {
      if (p === 0) {
        if (q < 0) return;
      } else if (p < 0) from = Math.max(from, q / p);
      else to = Math.min(to, q / p);
    }
    if (!(from < to)) return;
    const steps = Math.ceil(Math.max(Math.abs(dx), Math.abs(dy)) * (to - from)) || 1, scale = (to - from) / steps;
    const beside = Math.abs(dx) > Math.abs(dy) ? width : 1;
    const sx = dx * scale, sy = dy * scale, inverse0 = 1 / w0, slope = (1 / w1 - 1 / w0) * scale;
    let x = x0 + from * dx, y = y0 + from * dy, inverse = inverse0 + (1 / w1 - 1 / w0) * from;
    for (let i = 0; i <= steps; ++i, x += sx, y += sy, inverse += slope) {
      const at = (y | 0) * width + (x | 0), w = 0.998 / inverse;  // before what it lies on
      if (w < depth[at]) depth[at] = w, pixels[at] = value;
      if (wide && w < depth[at + beside]) depth[at + beside] = w, pixels[at + beside] = value;
    }
  }

  // By the inverse homography, pixel by pixel.
  drawPicture({pixels: image, corner, alongX, alongY}, step) {
    const rows = this.rows({matrix: new Matrix4()});
    const column = (v, last) => ["x", "y", "w"].map(k => rows[k][0] * v.x + rows[k][1] * v.y + rows[k][2] * v.z + (last ? rows[k][3] : 0));
    const [a, d, g] = column(alongX, false), [b, e, h] = column(alongY, false), [c, f, i] = column(corner, true);
    const inverse = [e * i - f * h, c * h - b * i, b * f - c * e, f * g - d * i, a * i - c * g, c * d - a * f,
      d * h - e * g, b * g - a * h, a * e - b * d];
    const determinant = a * inverse[0] + b * inverse[3] + c * inverse[6];
    if (Math.abs(determinant) < 1e-12) return;
    const [ua, ub, uc, va, vb, vc, wa, wb, wc] = inverse.map(x => x / determinant);
    const {pixels, depth, width, height, near} = this;
    const source = new Uint32Array(image.data.buffer), sw = image.width, sh = image.height;
    for (let y = 0; y < height; y += step) {
      let u = ub * y + uc, v = vb * y + vc, w = wb * y + wc;
      for (let x = 0, at = y * width; x < width; x += step, at += step, u += step * ua, v += step * va, w += step * wa) {
        if (w <= 0) continue;
        const far = 1 / w, s = u * far, t = v * far;
        if (s < 0 || t < 0 || s >= 1 || t >= 1 || far < near) continue;
        const value = source[(t * sh | 0) * sw + (s * sw | 0)];
        if (value >>> 24 <= 127) continue;
        const behind = far * 1.002;  // what lies on it
        pixels[at] = value, depth[at] = behind;
        if (step === 1) continue;
        pixels[at + 1] = value, depth[at + 1] = behind;
        if (y + 1 >= height) continue;
        pixels[at + width] = pixels[at + width + 1] = value;
        depth[at + width] = depth[at + width + 1] = behind;
      }
    }
  }
}
