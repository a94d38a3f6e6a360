// Directions of points of a picture, by the projection that the daemon reports for each image.

import type { Projection, ViewImage } from "../gen/steradian/v1/view_pb.ts";
import { IDENTITY, type Quat, type Vec3, normalize, rotate } from "./maths.ts";

/** Vertical field of view that is assumed if there is no projection, as for a headset. Only drags depend on it. */
const ASSUMED_FOV_RAD = Math.PI / 2;

/**
 * Returns the unit direction in camera axes of the point (u, v) of an image: 0 to 1 to the right and downwards. Flat pictures continue beyond their edges;
 * returns undefined outside of other pictures.
 */
export function directionAt(image: ViewImage, u: number, v: number): Vec3 | undefined {
  const { x, y, z, w } = image.orientation ?? { x: 0, y: 0, z: 0, w: 1 };
  const orientation: Quat = image.orientation ? [x, y, z, w] : IDENTITY;
  const direction = inImageAxes(image, u, v);
  return direction && rotate(orientation, normalize(direction));
}

/** Whether a drag of this image keeps the point exactly under the pointer. */
export function isExact(image: ViewImage): boolean {
  return image.projection !== undefined && image.projection.mapping !== "tabulated";
}

function inImageAxes(image: ViewImage, u: number, v: number): Vec3 | undefined {
  const { width, height, projection } = image;
  switch (projection?.mapping) {
    case "perspective": {
      const { leftTan, rightTan, downTan, upTan } = projection;
      return [leftTan + u * (rightTan - leftTan), upTan - v * (upTan - downTan), -1];
    }
    case "equirectangular": {
      const longitude = (u - 0.5) * 2 * Math.PI;
      const colatitude = v * Math.PI;
      if (colatitude < 0 || colatitude > Math.PI) return undefined;
      const sin = Math.sin(colatitude);
      return [sin * Math.sin(longitude), Math.cos(colatitude), -sin * Math.cos(longitude)];
    }
    case "equidistant":
    case "equisolid":
    case "orthographic":
    case "stereographic": {
      const radius = Math.min(width, height) / 2;
      const right = ((u - 0.5) * width) / radius;
      const up = ((0.5 - v) * height) / radius;
      const rho = Math.hypot(right, up);
      const theta = angleAt(projection, rho);
      if (theta === undefined) return undefined;
      if (rho === 0) return [0, 0, -1];
      const sin = Math.sin(theta) / rho;
      return [right * sin, up * sin, -Math.cos(theta)];
    }
    default: {
      const tan = Math.tan(ASSUMED_FOV_RAD / 2);
      return [((2 * u - 1) * tan * width) / height, (1 - 2 * v) * tan, -1];
    }
  }
}

/** Returns the angle from the axis of a round picture at a fraction of its radius; undefined outside the mapping's range. */
function angleAt({ mapping, fovRad }: Projection, rho: number): number | undefined {
  const half = fovRad / 2;
  const asin = (s: number) => (s <= 1 ? Math.asin(s) : undefined);
  switch (mapping) {
    case "equidistant":
      return rho * half <= Math.PI ? rho * half : undefined;
    case "equisolid": {
      const quarter = asin(rho * Math.sin(half / 2));
      return quarter === undefined ? undefined : 2 * quarter;
    }
    case "orthographic":
      return asin(rho * Math.sin(half));
    default:
      return 2 * Math.atan(rho * Math.tan(half / 2));
  }
}
