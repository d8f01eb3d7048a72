// Similarities {s, q: THREE.Quaternion, t: THREE.Vector3}: x -> s q x + t. Arrays are tx ty tz qx qy qz qw [scale].
import {Matrix4, Quaternion, Vector3} from "/lib/three/build/three.module.js";

export const identity = () => ({s: 1, q: new Quaternion(), t: new Vector3()});
export const fromArray = a => ({s: a[7] ?? 1, q: new Quaternion(a[3], a[4], a[5], a[6]), t: new Vector3(a[0], a[1], a[2])});
export const copyOf = x => ({s: x.s, q: x.q.clone(), t: x.t.clone()});

export const apply = (x, v) => v.clone().applyQuaternion(x.q).multiplyScalar(x.s).add(x.t);

// a after b
export function compose(a, b) {
  return {s: a.s * b.s, q: a.q.clone().multiply(b.q), t: apply(a, b.t)};
}

export function inverse(x) {
  const q = x.q.clone().inverse();
  return {s: 1 / x.s, q, t: x.t.clone().applyQuaternion(q).multiplyScalar(-1 / x.s)};
}

export const toMatrix = (x, matrix = new Matrix4()) => matrix.compose(x.t, x.q, new Vector3(x.s, x.s, x.s));

export function between(a, b, share) {
  return {s: Math.exp(Math.log(a.s) * (1 - share) + Math.log(b.s) * share), q: a.q.clone().slerp(b.q, share),
    t: a.t.clone().lerp(b.t, share)};
}

// How far apart two are, for something of this size in its own frame, in lengths of the page.
export function difference(a, b, size) {
  const turn = 2 * Math.acos(Math.min(1, Math.abs(a.q.dot(b.q))));
  return a.t.distanceTo(b.t) + size * (Math.abs(a.s - b.s) + b.s * turn);
}

// Rigid pose cam_from_frame as array: where the camera is, and which way its axes point in the frame.
export function cameraOf(pose) {
  const q = new Quaternion(pose[3], pose[4], pose[5], pose[6]).inverse();
  return {center: new Vector3(-pose[0], -pose[1], -pose[2]).applyQuaternion(q), q};
}
