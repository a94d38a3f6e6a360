// Identifies the object at the place of a click.

import { type IdentifiedObject, ObjectKind } from "../gen/steradian/v1/scene_pb.ts";
import type { Vec3 } from "./maths.ts";
import { notify } from "./notices.ts";
import { PATIENCE_MS, failureOf, messageOf, scenes } from "./rpc.ts";

/** Radius around a click in which stars are searched for, screen pixels. */
const NEAR_PX = 12;
/** Maximum search radius of the daemon, degrees. */
const MOST_RADIUS_DEG = 10;
/** Metres per unit of displayed distances. */
const [LIGHT_YEAR_M, KILOMETRE_M] = [9.4607304725808e15, 1000];

/** Describes an object: name, magnitude, temperature, distance. */
export function inWords({ kind, name, designation, vMag, temperatureK, distanceM }: IdentifiedObject): string {
  const words: string[] = [];
  if (kind === ObjectKind.STAR) {
    words.push([name || (designation ? "" : "A star without a name"), designation && (name ? `(${designation})` : designation)].filter(Boolean).join(" "));
    if (vMag !== undefined) words.push(`magnitude ${vMag.toFixed(2)}`);
    if (temperatureK !== undefined) words.push(`${temperatureK.toFixed(0)} K`);
    if (distanceM !== undefined) words.push(`${(distanceM / LIGHT_YEAR_M).toPrecision(3)} light-years`);
  } else {
    words.push(name);
    if (distanceM !== undefined) words.push(`${(distanceM / KILOMETRE_M).toPrecision(4)} km`);
  }
  return words.join(", ");
}

/** Identifies the object in a direction, ICRS axes, and displays it. */
export async function tellName([x, y, z]: Vec3, radPerPixel: number): Promise<void> {
  const radiusDeg = Math.min(Math.max((NEAR_PX * radPerPixel * 180) / Math.PI, 1e-6), MOST_RADIUS_DEG);
  try {
    const { objects } = await scenes.identify({ direction: { x, y, z }, radiusDeg, most: 1 }, { timeoutMs: PATIENCE_MS });
    const [first] = objects;
    notify(first ? inWords(first) : "Nothing is here.");
  } catch (error) {
    if (failureOf(error) !== "unreachable") notify(`Names: ${messageOf(error)}`, "error");
  }
}
