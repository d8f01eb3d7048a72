// Draws the same drawables as software.js with WebGL, by three.js.
import * as THREE from "/lib/three/build/three.module.js";

function isSoftware(gl) {
  const info = gl.getExtension("WEBGL_debug_renderer_info");
  const name = info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : gl.getParameter(gl.RENDERER);
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

// null where WebGL is not there or is software. forced: also then.
export function makeGpuRenderer(canvas, forced) {
  const gl = document.createElement("canvas").getContext("webgl");
  if (!gl || (isSoftware(gl) && !forced)) return null;
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return new GpuRenderer(canvas);
}

class GpuRenderer {
  constructor(canvas) {
    this.renderer = new THREE.WebGLRenderer({canvas, antialias: true});
    this.renderer.setPixelRatio(Math.min(2, devicePixelRatio));
    this.scene = new THREE.Scene();
    this.scene.background = new THREE.Color();
    this.objects = new Map();  // by id of the drawable
    this.name = "WebGL";
  }

  resize(width, height) {
    if (width === this.width && height === this.height) return;
    this.width = width;
    this.height = height;
    this.renderer.setSize(width, height, false);
  }

  render(drawables, camera, background) {
    this.scene.background.setHex(background);
    const used = new Set();
    for (const drawable of drawables) {
      used.add(drawable.id);
      this.update(drawable);
    }
    for (const [id, object] of this.objects) {
      if (used.has(id)) continue;
      this.remove(object);
      this.objects.delete(id);
    }
    this.renderer.render(this.scene, camera);
  }

  remove(object) {
    this.scene.remove(object);
    object.geometry.dispose();
    object.material.map?.dispose();
    object.material.dispose();
  }

  update(drawable) {
    let object = this.objects.get(drawable.id);
    // The arrays are made anew when something in them has changed.
    if (object && (object.userData.xyz !== drawable.xyz || object.userData.rgb !== drawable.rgb || object.userData.pixels !== drawable.pixels)) {
      this.remove(object);
      object = null;
    }
    if (!object) {
      object = drawable.kind === "picture" ? this.makePicture(drawable) : this.makeObject(drawable);
      object.userData = {xyz: drawable.xyz, rgb: drawable.rgb, pixels: drawable.pixels};
      object.matrixAutoUpdate = false;
      object.frustumCulled = false;
      this.objects.set(drawable.id, object);
      this.scene.add(object);
    }
    if (drawable.kind !== "picture") {
      object.material.color.setHex(drawable.rgb ? 0xffffff : drawable.color);
      object.matrix.copy(drawable.matrix);
    } else {
      object.matrix.makeBasis(drawable.alongX, drawable.alongY, new THREE.Vector3(0, 0, 1)).setPosition(drawable.corner);
    }
  }

  makeObject({kind, xyz, rgb, count, size}) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(xyz.subarray(0, 3 * count), 3));
    if (rgb) geometry.setAttribute("color", new THREE.BufferAttribute(rgb.subarray(0, 3 * count), 3, true));
    const colors = rgb ? THREE.VertexColors : THREE.NoColors;
    if (kind === "points")
      return new THREE.Points(geometry, new THREE.PointsMaterial({size: size * this.renderer.getPixelRatio(), sizeAttenuation: false, vertexColors: colors}));
    const material = new THREE.LineBasicMaterial({vertexColors: colors});
    return kind === "strip" ? new THREE.Line(geometry, material) : new THREE.LineSegments(geometry, material);
  }

  // The unit square, its corner at the picture's top left.
  makePicture({pixels}) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0]), 3));
    geometry.setAttribute("uv", new THREE.BufferAttribute(new Float32Array([0, 0, 1, 0, 1, 1, 0, 1]), 2));
    geometry.setIndex([0, 1, 2, 0, 2, 3]);
    const texture = new THREE.DataTexture(new Uint8Array(pixels.data.buffer), pixels.width, pixels.height, THREE.RGBAFormat);
    texture.minFilter = texture.magFilter = THREE.LinearFilter;
    texture.needsUpdate = true;
    return new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({map: texture, alphaTest: 0.5, side: THREE.DoubleSide}));
  }
}
