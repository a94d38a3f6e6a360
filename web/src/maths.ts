// Vectors and rotations, in the daemon's conventions: +x right, +y up, looking along -z.

export type Vec3 = readonly [number, number, number];
/** x, y, z, w. */
export type Quat = readonly [number, number, number, number];

export const IDENTITY: Quat = [0, 0, 0, 1];

export const add = (a: Vec3, b: Vec3): Vec3 => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const scale = (a: Vec3, s: number): Vec3 => [a[0] * s, a[1] * s, a[2] * s];
export const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a: Vec3, b: Vec3): Vec3 => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];

export function normalize(a: Vec3): Vec3 {
  const length = Math.hypot(...a);
  return length > 0 ? scale(a, 1 / length) : a;
}

/** Returns the rotation `b` followed by `a`, normalised so that rounding errors do not accumulate. */
export function multiply(a: Quat, b: Quat): Quat {
  const [ax, ay, az, aw] = a;
  const [bx, by, bz, bw] = b;
  const x = aw * bx + ax * bw + ay * bz - az * by;
  const y = aw * by - ax * bz + ay * bw + az * bx;
  const z = aw * bz + ax * by - ay * bx + az * bw;
  const w = aw * bw - ax * bx - ay * by - az * bz;
  const length = Math.hypot(x, y, z, w);
  return [x / length, y / length, z / length, w / length];
}

export const inverse = ([x, y, z, w]: Quat): Quat => [-x, -y, -z, w];

export function rotate(q: Quat, v: Vec3): Vec3 {
  const axis: Vec3 = [q[0], q[1], q[2]];
  const t = scale(cross(axis, v), 2);
  return add(add(v, scale(t, q[3])), cross(axis, t));
}

/** Returns the rotation by an angle in radians around a unit vector. */
export function around(axis: Vec3, angle: number): Quat {
  const sin = Math.sin(angle / 2);
  return [axis[0] * sin, axis[1] * sin, axis[2] * sin, Math.cos(angle / 2)];
}

/** Returns the smallest rotation from one unit vector to another. */
export function between(from: Vec3, to: Vec3): Quat {
  const w = 1 + dot(from, to);
  if (w < 1e-9) {
    // Opposite directions: half a turn about any perpendicular axis.
    const across = Math.abs(from[0]) < 0.9 ? ([1, 0, 0] as const) : ([0, 1, 0] as const);
    return around(normalize(cross(from, across)), Math.PI);
  }
  const axis = cross(from, to);
  const length = Math.hypot(...axis, w);
  return [axis[0] / length, axis[1] / length, axis[2] / length, w / length];
}

/** Returns the rotation from camera axes to ICRS for a right ascension, declination and roll of the picture (radians; roll 0: north is up). */
export function orientationTowards(ra: number, dec: number, roll: number): Quat {
  const ahead: Vec3 = [Math.cos(dec) * Math.cos(ra), Math.cos(dec) * Math.sin(ra), Math.sin(dec)];
  const north: Vec3 = [-Math.sin(dec) * Math.cos(ra), -Math.sin(dec) * Math.sin(ra), Math.cos(dec)];
  const right = cross(ahead, north);
  return multiply(fromAxes(right, north, scale(ahead, -1)), around([0, 0, 1], roll));
}

/** Returns the direction of a camera: right ascension, declination and roll in radians. */
export function towards(q: Quat): { ra: number; dec: number; roll: number } {
  const ahead = rotate(q, [0, 0, -1]);
  const dec = Math.asin(Math.max(-1, Math.min(1, ahead[2])));
  const ra = (Math.atan2(ahead[1], ahead[0]) + 2 * Math.PI) % (2 * Math.PI);
  const [x, y] = rotate(multiply(inverse(orientationTowards(ra, dec, 0)), q), [1, 0, 0]);
  return { ra, dec, roll: Math.atan2(y, x) };
}

/** Returns the rotation from x, y and z to three orthonormal vectors. */
function fromAxes(x: Vec3, y: Vec3, z: Vec3): Quat {
  const trace = x[0] + y[1] + z[2];
  // Start from the largest component, for accuracy.
  if (trace > 0) {
    const s = 2 * Math.sqrt(1 + trace);
    return [(y[2] - z[1]) / s, (z[0] - x[2]) / s, (x[1] - y[0]) / s, s / 4];
  }
  if (x[0] > y[1] && x[0] > z[2]) {
    const s = 2 * Math.sqrt(1 + x[0] - y[1] - z[2]);
    return [s / 4, (x[1] + y[0]) / s, (z[0] + x[2]) / s, (y[2] - z[1]) / s];
  }
  if (y[1] > z[2]) {
    const s = 2 * Math.sqrt(1 + y[1] - x[0] - z[2]);
    return [(x[1] + y[0]) / s, s / 4, (y[2] + z[1]) / s, (z[0] - x[2]) / s];
  }
  const s = 2 * Math.sqrt(1 + z[2] - x[0] - y[1]);
  return [(z[0] + x[2]) / s, (y[2] + z[1]) / s, s / 4, (x[1] - y[0]) / s];
}
